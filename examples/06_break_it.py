"""Search for the shortest camera motion that breaks a method, and save it as a scenario.

An evolution strategy (1 + lambda, with a step size that grows on success and shrinks otherwise) over twists that are
held for a while. A motion breaks the method when the estimated camera is off by more than the bound, or SLAM is lost.
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

BOUND_M = 0.05  # the estimated camera may be off by this much
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
    _, info = env.reset(seed=0)
    way, worst, step, done = 0.0, 0.0, 0, False
    while not done:
        T_world_before = info["true_pose"]
        _, _, terminated, truncated, info = env.step(twists[step // HELD].astype(np.float32))
        step, done = step + 1, terminated or truncated
        T_world_camera = info["true_pose"]
        turned = np.arccos(np.clip((np.trace(T_world_before[:3, :3].T @ T_world_camera[:3, :3]) - 1) / 2, -1, 1))
        way += float(np.linalg.norm(T_world_camera[:3, 3] - T_world_before[:3, 3]) + turned)
        error_m = float(np.linalg.norm(info["estimated_pose"][:3, 3] - T_world_camera[:3, 3]))
        if error_m > BOUND_M or not info["is_tracked"]:
            return way, env.unwrapped.driven_scenario().to_json()
        worst = max(worst, error_m)
    return 1e3 * (2.0 - worst / BOUND_M), None


best = np.zeros((-(-frames // HELD), 6))
cost, found = drive(best)
print("a camera at rest: " + ("the method breaks without any motion" if found else f"whole, cost {cost:.0f}"))
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
