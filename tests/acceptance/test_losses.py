"""What makes SLAM lose the camera: it says so, goes on, and finds the camera again where that can be."""

import csv
from dataclasses import replace
from functools import cache
from itertools import groupby
from pathlib import Path

import numpy as np
import pytest

from dotmask.pipeline import ClosedLoop, DotMask, FrameResult
from dotmask.profiles import CALIBRATED
from dotmask.records import RgbdFrame, SlamStatus
from dotmask.slam.embedded import EmbeddedSlam
from scenarios.bridge import rgbd_frame_from_sim
from scenarios.oracle import OracleSegmenter
from scenarios.registry import scenario
from scenarios.run import RunSettings, run
from scenarios.spec import Scenario, with_overrides
from scenarios.world import build_simulator
from sim.records import SimFrame
from sim.simulator import Simulator

pytestmark = pytest.mark.acceptance

HALF_SIZE = {
    "camera.width": "320",
    "camera.height": "240",
    "camera.fx": "267.7",
    "camera.fy": "269.6",
    "camera.cx": "159.8",
    "camera.cy": "123.55",
}


def small(name: str, **overrides: str) -> Scenario:
    return with_overrides(scenario(name), {**HALF_SIZE, **overrides})


def statuses(name: str, out: Path) -> tuple[list[tuple[str, int]], list[float]]:
    """Runs of equal status with their lengths, and the position errors of the frames with a pose, metres."""
    run(small(name), RunSettings.parse(methods="dotmask"), out, lambda: None)
    with (out / "frames.csv").open() as file:
        rows = list(csv.DictReader(file))
    runs = [(status, len(list(group))) for status, group in groupby(row["status"] for row in rows)]
    assert all(bool(row["position_error_m"]) == (row["status"] != "lost") for row in rows)
    return runs, [float(row["position_error_m"]) for row in rows if row["status"] != "lost"]


def test_odometry_goes_on_after_every_failure_of_the_sensor(tmp_path: Path) -> None:
    runs, errors_m = statuses("failing_sensor", tmp_path / "run")
    assert [length for status, length in runs if status == "lost"] == [1, 1, 15, 15]
    assert [length for status, length in runs if status == "relocalised"] == [1, 1, 1, 1]
    assert max(errors_m) < 0.02


def test_a_kidnapped_camera_is_lost_until_it_sees_a_known_place(tmp_path: Path) -> None:
    runs, errors_m = statuses("kidnapped", tmp_path / "run")
    assert [status for status, _ in runs] == ["initialising", "tracked", "lost", "relocalised", "tracked"]
    # The lens is covered for 50 frames; the wall is unknown for three seconds more.
    assert runs[2][1] > 50 + 60
    assert max(errors_m) < 0.03


def test_a_wall_without_features_loses_the_camera_and_the_picture_finds_it(tmp_path: Path) -> None:
    runs, errors_m = statuses("blank_wall", tmp_path / "run")
    kinds = [status for status, _ in runs]
    assert kinds[:3] == ["initialising", "tracked", "lost"]
    assert kinds[-2:] == ["relocalised", "tracked"]
    assert np.median(errors_m) < 0.03


@cache
def kidnapping() -> Simulator:
    return build_simulator(small("kidnapped", **{"sensor.failures": "[]"}), "numba", 1)


def test_a_teleported_camera_is_never_given_a_pose_that_is_wrong() -> None:
    simulator = kidnapping()
    # It sees the desks, then from one frame to the next the wall behind it, then the desks from where it was not yet.
    shown = [*range(20), *range(170, 180), *range(310, 320)]
    oracle = OracleSegmenter()
    start = simulator.frame(0).truth.T_world_camera
    loop = ClosedLoop(DotMask(oracle, CALIBRATED), EmbeddedSlam(at(simulator, 0).intrinsics, start), "refined", start)
    results: list[FrameResult] = []
    for index, source in enumerate(shown):
        sim_frame = simulator.frame(source)
        oracle.show(index, sim_frame.truth)
        results.append(loop.step(replace(rgbd_frame_from_sim(sim_frame), index=index, timestamp_s=index / 30)))
    found = [r.pose.status for r in results]
    assert set(found[1:20]) == {SlamStatus.TRACKED}
    assert set(found[20:30]) == {SlamStatus.LOST}
    assert found[30] is SlamStatus.RELOCALISED
    assert set(found[31:]) == {SlamStatus.TRACKED}
    for source, result in zip(shown, results, strict=True):
        if result.pose.T_world_camera is not None:
            true = simulator.frame(source).truth.T_world_camera
            assert np.linalg.norm(result.pose.T_world_camera[:3, 3] - true[:3, 3]) < 0.03


def at(simulator: Simulator, index: int) -> RgbdFrame:
    frame: SimFrame = simulator.frame(index)
    return rgbd_frame_from_sim(frame)


def test_a_depth_that_is_no_number_never_gets_into_the_loop() -> None:
    frame = at(kidnapping(), 0)
    holes = frame.depth_m.copy()
    holes[100, 100] = np.nan
    with pytest.raises(ValueError, match=r"NaN.*np\.where"):
        replace(frame, depth_m=holes)
