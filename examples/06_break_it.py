"""Search for the shortest camera motion that breaks a method, and save it as a scenario.

An evolution strategy (1 + lambda, with a step size that grows on success and shrinks otherwise) over twists that are
held for a while. A motion breaks the method when a step's relative pose error is above the bound, or SLAM is lost.
Nothing is known of how the method works.

python examples/06_break_it.py [METHOD] [FRAMES] [GENERATIONS] [OUT] [SCENARIO]
then: dotmask run --from OUT --methods METHOD
"""

import sys
from pathlib import Path

import gymnasium
import numpy as np

import scenarios.envs
from scenarios.envs.drive import DriveLimits

BOUND = 1.0  # price of a step: a centimetre, or a hundredth of a radian, or SLAM lost
HELD, CHILDREN = 5, 3  # frames for which a twist is held; trials of a generation
LIMITS = DriveLimits(speed_m_s=2.0, acceleration_m_s2=12.0, turn_rad_s=3.0, turn_acceleration_rad_s2=30.0)

gymnasium.register_envs(scenarios.envs)
method = sys.argv[1] if len(sys.argv) > 1 else "unmasked"
frames = int(sys.argv[2]) if len(sys.argv) > 2 else 12
generations = int(sys.argv[3]) if len(sys.argv) > 3 else 2
out = Path(sys.argv[4] if len(sys.argv) > 4 else "broken.json")
name = sys.argv[5] if len(sys.argv) > 5 else "smoke"

env = gymnasium.make(
    "DotMask/CameraDrive-v0", scenario=name, overrides={"frames": frames}, method=method, limits=LIMITS
)
rng = np.random.default_rng(0)


def drive(twists: np.ndarray) -> tuple[float, str | None]:
    """Cost of a motion (lower is better), and the scenario where it broke the method.

    A motion that breaks the method costs its length, metres and radians added up; another costs more than any such,
    and the less the nearer it comes.
    """
    env.reset(seed=0)
    way, worst, before, done = 0.0, 0.0, None, False
    while not done:
        step = 0 if before is None else before[0] + 1
        _, _, terminated, truncated, info = env.step(twists[step // HELD].astype(np.float32))
        T_world_camera = info["true_pose"]
        if before is not None:
            turned = np.arccos(np.clip((np.trace(before[1][:3, :3].T @ T_world_camera[:3, :3]) - 1) / 2, -1, 1))
            way += float(np.linalg.norm(T_world_camera[:3, 3] - before[1][:3, 3]) + turned)
        before, done = (step, T_world_camera), terminated or truncated
        worst = max(worst, -info["reward"]["relative_pose_error"])
        if worst >= BOUND:
            return way, env.unwrapped.driven_scenario().to_json()
    return 1e3 * (2.0 - worst / BOUND), None


best = np.zeros((-(-frames // HELD), 6))
cost, found = drive(best)
spread = 0.5
for generation in range(generations):
    children = [np.clip(best + spread * rng.normal(size=best.shape), -1, 1) for _ in range(CHILDREN)]
    trials = [drive(child) for child in children]
    winner = int(np.argmin([trial[0] for trial in trials]))
    better = trials[winner][0] < cost
    if better:
        best, (cost, found) = children[winner], trials[winner]
    spread = float(np.clip(spread * (1.5 if better else 0.7), 0.05, 1.0))
    print(f"generation {generation}: " + (f"broken after {cost:.3f} m + rad" if found else f"whole, cost {cost:.0f}"))
if found:
    out.write_text(found)
    print(f"saved {out}; repeat it with: dotmask run --from {out} --methods {method}")
else:
    print(f"{method} held: try more generations or frames")
env.close()
