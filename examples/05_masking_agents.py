"""Three masking agents in the standard loop: mask nothing, mask every person, and DOTMask.

python examples/05_masking_agents.py [FRAMES] [SCENARIO]
"""

import sys
from typing import Any

import gymnasium
import numpy as np

import scenarios.envs
from dotmask.pipeline import DotMask, extrapolate
from dotmask.profiles import profile
from dotmask.records import FloatArray

gymnasium.register_envs(scenarios.envs)


class Nothing:
    """Hides nothing."""

    def __init__(self, env: Any) -> None:
        self.size = (env.intrinsics.height, env.intrinsics.width)

    def __call__(self, info: dict[str, Any]) -> dict[str, np.ndarray]:
        """The masks for the observed frame: hidden from odometry, hidden from the map."""
        nothing = np.zeros(self.size, np.int8)
        return {"odometry": nothing, "map": nothing}


class EveryPerson:
    """Hides every person, standing or walking, from both."""

    def __init__(self, env: Any) -> None:
        self.env = env

    def __call__(self, info: dict[str, Any]) -> dict[str, np.ndarray]:
        """As above."""
        frame = self.env.frame()
        found = self.env.oracle.segment(frame)  # your own network goes here
        people = np.array([name == "person" for name in found.class_names], bool)
        hidden = found.masks[people].any(axis=0).astype(np.int8)
        return {"odometry": hidden, "map": hidden}


class Method:
    """DOTMask, with the pose feedback `refined` of the standard loop."""

    def __init__(self, env: Any) -> None:
        self.env = env
        self.dotmask = DotMask(env.oracle, profile("calibrated"))
        self.poses: list[tuple[float, FloatArray]] = []
        self.stamp_s = 0.0

    def __call__(self, info: dict[str, Any]) -> dict[str, np.ndarray]:
        """As above."""
        frame = self.env.frame()
        if frame.index > 0 and info["is_tracked"]:
            self.dotmask.refine(info["estimated_pose"])
            self.poses = [*self.poses[-1:], (self.stamp_s, info["estimated_pose"])]
        predicted = info["estimated_pose"]
        if len(self.poses) == 2:
            predicted = extrapolate(*self.poses, frame.timestamp_s)
        masked, self.stamp_s = self.dotmask.step(frame, predicted).masked, frame.timestamp_s
        return {
            "odometry": (masked.mo_mdi_m == 0).astype(np.int8),
            "map": (masked.mdi_m == 0).astype(np.int8),
        }


if __name__ == "__main__":
    frames = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    name = sys.argv[2] if len(sys.argv) > 2 else "smoke"
    env = gymnasium.make("DotMask/Masking-v0", scenario=name, overrides={"frames": frames}, map_mask=True)
    for agent in (Nothing, EveryPerson, Method):
        observation, info = env.reset(seed=0)
        policy, done, rewards = agent(env.unwrapped), False, []
        while not done:
            observation, reward, terminated, truncated, info = env.step(policy(info))
            done = terminated or truncated
            rewards.append(info["reward"])
        terms = ", ".join(f"{term} {sum(r[term] for r in rewards):8.3f}" for term in rewards[0])
        print(f"{agent.__name__:12s} {terms}")
    env.close()
