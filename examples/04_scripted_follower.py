"""Follow a person at a distance, by what the method believes of where everybody is: no truth is used.

python examples/04_scripted_follower.py [FRAMES]
"""

import sys
from typing import Any

import gymnasium
import numpy as np

import scenarios.envs

DISTANCE_M, GAZE_M = 2.5, 1.2
PERSON = 0  # index of the class in `scenarios.oracle.CLASSES`

gymnasium.register_envs(scenarios.envs)
frames = int(sys.argv[1]) if len(sys.argv) > 1 else 20


def follow(observation: dict[str, Any]) -> tuple[np.ndarray, float | None]:
    """The twist towards the nearest person, and how far away that one is, metres; None where nobody is tracked."""
    tracks, T_world_camera = observation["tracks"], observation["estimated_pose"]
    people = tracks["position"][(tracks["valid"] == 1) & (tracks["class"] == PERSON)]
    if len(people) == 0:
        return np.array([0, 0, 0, 0, 0.5, 0], np.float32), None  # look around
    ahead = np.array([*people[:, :2].T, np.full(len(people), GAZE_M)]).T
    in_camera = (ahead - T_world_camera[:3, 3]) @ T_world_camera[:3, :3]
    x, y, z = in_camera[np.argmin(np.linalg.norm(in_camera, axis=1))]
    distance_m = float(np.hypot(x, z))
    right, down = np.arctan2(x, z), np.arctan2(y, z)
    twist = np.array([0, 0, 0.8 * (distance_m - DISTANCE_M), -1.5 * down, 1.5 * right, 0], np.float32)
    return np.clip(twist, -1, 1), distance_m


env = gymnasium.make("DotMask/CameraDrive-v0", scenario="smoke", overrides={"frames": frames})
observation, info = env.reset(seed=0)
done, total, number = False, 0.0, 0
while not done:
    action, distance_m = follow(observation)
    observation, reward, terminated, truncated, info = env.step(action)
    done, total, number = terminated or truncated, total + float(reward), number + 1
    if number % 5 == 0:
        where = "nobody in view" if distance_m is None else f"the nearest person is {distance_m:.2f} m away"
        print(f"{observation['stamp'][0]:5.2f} s  {where}")
print(f"reward {total:.3f}")
env.close()
