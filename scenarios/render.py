"""Render a scenario into a TUM RGB-D folder, with the truth beside the images."""

import json
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from dotmask.records import Trajectory
from dotmask.tum import TumSequenceWriter, format_trajectory
from scenarios.bridge import intrinsics_from_camera, rgbd_frame_from_sim
from scenarios.run import rendered_ahead
from scenarios.run_folder import check_free
from scenarios.spec import Scenario
from scenarios.world import build_simulator


def render_sequence(scenario: Scenario, out: Path, renderer: str, threads: int, advance: Callable[[], None]) -> None:
    """Write the sequence folder `out` in the TUM layout.

    Beside the images and `groundtruth.txt` it holds the rest of the truth:

    - `masks/STAMP.png`: 16-bit instance ids, 0 = background, listed in `masks.txt`;
    - `objects.json`: name, class and instance id of every actor;
    - `objects/NAME.txt`: `T_world_object` of every actor in the format of `groundtruth.txt`;
    - `scenario.json`: what was rendered.

    Args:
        scenario: what happens.
        out: a new or empty folder; it appears when all is written.
        renderer: name of the renderer.
        threads: of the renderer.
        advance: called after every frame.

    Raises:
        ScenarioError, SimError, DotmaskError: bad input; nothing is left in `out`.
    """
    check_free(out)
    simulator = build_simulator(scenario, renderer, threads)
    poses = defaultdict(list)
    stamps: list[float] = []
    with TumSequenceWriter(out, intrinsics_from_camera(simulator.camera)) as writer:
        (writer.path / "masks").mkdir()
        (writer.path / "objects").mkdir()
        mask_lines = ["# timestamp filename\n"]
        for timed in rendered_ahead(simulator):
            frame = timed.frame
            writer.write(rgbd_frame_from_sim(frame), frame.truth.T_world_camera)
            stamp = f"{frame.timestamp_s:.6f}"
            cv2.imwrite(str(writer.path / "masks" / f"{stamp}.png"), frame.truth.instance_ids)
            mask_lines.append(f"{stamp} masks/{stamp}.png\n")
            stamps.append(frame.timestamp_s)
            for actor in frame.truth.objects:
                poses[actor.name].append(actor.T_world_object)
            advance()
        (writer.path / "masks.txt").write_text("".join(mask_lines))
        for name, matrices in poses.items():
            path = Trajectory(timestamps_s=np.array(stamps), T_world_camera=np.array(matrices))
            (writer.path / "objects" / f"{name}.txt").write_text(format_trajectory(path))
        actors = [
            {"name": a.name, "class_name": a.class_name, "instance_id": a.instance_id} for a in simulator.scene.actors
        ]
        (writer.path / "objects.json").write_text(json.dumps(actors, indent=2) + "\n")
        (writer.path / "scenario.json").write_text(scenario.to_json())
