"""What the golden files hold: a hash of one frame of every scenario, statistics of one frame, figures of a trajectory.

    python tests/golden/regenerate.py

writes them anew. Look at the difference before you commit it.
"""

import hashlib
import json
from pathlib import Path

import numpy as np

from dotmask.evaluation.trajectory import absolute_trajectory_error, relative_pose_error
from dotmask.records import Trajectory
from scenarios.registry import RENDERED_AS, scenario
from scenarios.spec import with_overrides
from scenarios.world import build_simulator

FRAME = 30


def frame_statistics() -> dict[str, object]:
    """Colour, depth, and the pixels of every actor in one frame of `smoke`."""
    frame = build_simulator(scenario("smoke"), "numba", 1).frame(FRAME)
    depth = frame.depth_m[frame.depth_m > 0]
    return {
        "mean_rgb": [round(float(v), 3) for v in frame.rgb.reshape(-1, 3).mean(axis=0)],
        "depth_quartiles_m": [round(float(v), 4) for v in np.percentile(depth, [25, 50, 75])],
        "share_without_depth": round(1 - len(depth) / frame.depth_m.size, 4),
        "visible_pixels": {actor.name: actor.visible_pixels for actor in frame.truth.objects},
    }


def frame_hash(name: str) -> str:
    """sha256 over the sensor's bytes of the middle frame of a scenario, at a quarter of the width and height."""
    camera = scenario(name).camera
    smaller = {f"camera.{key}": getattr(camera, key) // 4 for key in ("width", "height")}
    smaller |= {f"camera.{key}": getattr(camera, key) / 4 for key in ("fx", "fy", "cx", "cy")}
    simulator = build_simulator(with_overrides(scenario(name), {k: str(v) for k, v in smaller.items()}), "numba", 1)
    frame = simulator.frame(len(simulator) // 2)
    return hashlib.sha256(frame.rgb.tobytes() + frame.depth_m.tobytes()).hexdigest()


def frame_hashes() -> dict[str, str]:
    """Of all scenarios, by name; those that share their frames share the hash."""
    rendered = {name: frame_hash(name) for name in set(RENDERED_AS.values())}
    return {name: rendered[RENDERED_AS[name]] for name in sorted(RENDERED_AS)}


def trajectory_figures() -> dict[str, float]:
    """ATE and RPE of a fixed noisy spiral: no random numbers, so that they cannot change with a generator."""
    t = np.arange(200) / 30.0
    truth = np.tile(np.eye(4), (200, 1, 1))
    truth[:, :3, 3] = np.stack([np.cos(t), np.sin(t), 0.1 * t], axis=1)
    estimate = truth.copy()
    estimate[:, :3, 3] += 0.01 * np.stack([np.sin(37 * t), np.cos(23 * t), np.sin(11 * t)], axis=1)
    one, other = (Trajectory(timestamps_s=t, T_world_camera=poses) for poses in (truth, estimate))
    ate, rpe = absolute_trajectory_error(one, other), relative_pose_error(one, other)
    assert ate is not None
    assert rpe is not None
    return {"ate_rmse_m": ate.rmse_m, "ate_max_m": ate.max_m, "rpe_trans_rmse_m": rpe.trans_rmse_m}


def main() -> None:
    """Write the files."""
    files = {
        "frame_hashes": frame_hashes(),
        "smoke_frame": frame_statistics(),
        "trajectory": trajectory_figures(),
    }
    for name, values in files.items():
        (Path(__file__).parent / f"{name}.json").write_text(json.dumps(values, indent=2) + "\n")
        print(f"{name}.json")


if __name__ == "__main__":
    main()
