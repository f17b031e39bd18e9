"""RTAB-Map itself, where it can run: poses in the world, masks that hold, loops, losses, and a process that dies."""

import json
import os
import signal
import sqlite3
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dotmask.errors import SlamError
from dotmask.records import FloatArray, LoopKind, MaskedDepth, RgbdFrame, SlamStatus
from dotmask.slam.rtabmap.backend import RtabmapSlam
from dotmask.slam.rtabmap.library import core
from dotmask.slam.rtabmap.settings import BASE, FIXED, SETS, rtabmap_settings
from scenarios.bridge import rgbd_frame_from_sim
from scenarios.registry import scenario
from scenarios.report import Report
from scenarios.spec import with_overrides
from scenarios.world import build_simulator

FRAMES = 36


@pytest.fixture(scope="module", autouse=True)
def _installed() -> None:
    try:
        core()
    except SlamError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def empty_room() -> list[tuple[RgbdFrame, FloatArray]]:
    """Frames of a room where nothing moves, each with its true `T_world_camera`."""
    chosen = with_overrides(scenario("smoke"), {"variant": "empty", "frames": str(FRAMES), "camera.speed": "2"})
    simulator = build_simulator(chosen, "numba", threads=2)
    frames = [simulator.frame(index) for index in range(FRAMES)]
    return [(rgbd_frame_from_sim(frame), frame.truth.T_world_camera) for frame in frames]


@pytest.fixture
def start(tmp_path: Path, empty_room) -> Callable[..., RtabmapSlam]:
    def make(*changes: str) -> RtabmapSlam:
        first, T_world_camera = empty_room[0]
        settings = rtabmap_settings("refined", changes, core())
        return RtabmapSlam(first.intrinsics, T_world_camera, settings, tmp_path / "map.db", tmp_path / "map.log")

    return make


def whole(frame: RgbdFrame) -> MaskedDepth:
    return MaskedDepth(mo_mdi_m=frame.depth_m, mdi_m=frame.depth_m)


def distance_m(T_a: FloatArray, T_b: FloatArray) -> float:
    return float(np.linalg.norm(T_a[:3, 3] - T_b[:3, 3]))


def test_rtabmap_knows_the_parameters_that_it_is_given() -> None:
    for name in SETS:
        given = rtabmap_settings(name, [f"{k}={v}" for k, v in {**BASE, **SETS[name]}.items()], core())
        assert set(given.parameters) <= set(core().parameters)
    assert set(FIXED) <= set(core().parameters)
    assert core().version == "0.21.12"


def test_poses_are_in_the_world_and_the_map_obeys_its_mask(start, empty_room, tmp_path: Path) -> None:
    """Odometry sees the whole image, the map its right half: no feature of the left one may reach the database."""
    slam = start("Mem/UseOdomFeatures=true", "Rtabmap/DetectionRate=10")
    travelled_m = max(distance_m(T, empty_room[0][1]) for _, T in empty_room[:20])
    assert travelled_m > 0.1
    half = empty_room[0][0].intrinsics.width // 2
    for frame, T_world_camera in empty_room[:20]:
        mdi_m = frame.depth_m.copy()
        mdi_m[:, :half] = 0
        masked = MaskedDepth(mo_mdi_m=frame.depth_m, mdi_m=mdi_m)
        estimate = slam.track(frame, masked)
        slam.update_map(frame, masked)
        assert estimate.status is (SlamStatus.TRACKED if frame.index else SlamStatus.INITIALISING)
        assert distance_m(estimate.T_world_camera, T_world_camera) < 0.05
        cosine = (np.trace(estimate.T_world_camera[:3, :3].T @ T_world_camera[:3, :3]) - 1) / 2
        assert cosine > np.cos(np.deg2rad(3))
    result = slam.finish()
    np.testing.assert_allclose(result.trajectory.timestamps_s, [f.timestamp_s for f, _ in empty_room[:20]])
    for T, (_, true) in zip(result.trajectory.T_world_camera, empty_room, strict=False):
        assert distance_m(T, true) < 0.05
    with sqlite3.connect(tmp_path / "map.db") as database:
        nodes = database.execute("SELECT count(*) FROM Node").fetchone()[0]
        features, leftmost = database.execute("SELECT count(*), min(pos_x) FROM Feature").fetchone()
    database.close()
    assert nodes >= 5
    assert features > 200
    assert leftmost >= half - 1


def test_a_camera_that_was_carried_off_is_found_again_by_the_map(start, empty_room) -> None:
    """Blind for longer than the countdown, it wakes up where it has been before: no pose until the map knows where."""
    slam = start("Rtabmap/DetectionRate=10", "Odom/ResetCountdown=5")
    blind = [None] * 8
    statuses, errors = [], []
    for number, source in enumerate([*range(FRAMES), *blind, *range(10, 26)]):
        frame, T_world_camera = empty_room[source or 0]
        frame = replace(frame, index=number, timestamp_s=number / 30)
        if source is None:
            frame = replace(frame, rgb=np.zeros_like(frame.rgb), depth_m=np.zeros_like(frame.depth_m))
        estimate = slam.track(frame, whole(frame))
        slam.update_map(frame, whole(frame))
        statuses.append(estimate.status)
        if estimate.T_world_camera is not None:
            errors.append(distance_m(estimate.T_world_camera, T_world_camera))
    back = statuses[FRAMES:]
    found = back.index(SlamStatus.RELOCALISED)
    assert found > len(blind), "the first frames of the new odometry have no pose"
    assert back == [
        *[SlamStatus.LOST] * found, SlamStatus.RELOCALISED, *[SlamStatus.TRACKED] * (len(back) - found - 1)
    ]  # fmt: skip
    assert max(errors) < 0.06
    result = slam.finish()
    assert len(result.trajectory) == FRAMES + 16, "in hindsight all but the blind frames have a place"
    assert any(
        loop.kind is LoopKind.GLOBAL and loop.from_index >= FRAMES + 8 and loop.to_index < FRAMES
        for loop in result.loops
    )


def test_a_dead_process_is_an_error_that_names_its_log(start, empty_room) -> None:
    slam = start()
    frame, _ = empty_room[0]
    slam.track(frame, whole(frame))
    os.kill(slam._worker._process.pid, signal.SIGKILL)
    with pytest.raises(SlamError, match=r"ended during track of frame 2 \(SIGKILL\); its log is ") as caught:
        slam.track(empty_room[1][0], whole(empty_room[1][0]))
    Path(str(caught.value).rpartition(" ")[2]).unlink()


def test_a_database_that_cannot_be_made_is_an_error(empty_room, tmp_path: Path) -> None:
    frame, T_world_camera = empty_room[0]
    settings = rtabmap_settings("default", [], core())
    slam = RtabmapSlam(frame.intrinsics, T_world_camera, settings, tmp_path / "no/map.db", tmp_path / "map.log")
    with pytest.raises(SlamError, match=r"RTAB-Map's process (failed|ended)") as caught:
        slam.track(frame, whole(frame))
    Path(str(caught.value).rpartition(" ")[2]).unlink()


def test_a_run_with_rtabmap(dotmask, tmp_path: Path) -> None:
    out = tmp_path / "out"
    arguments = ("--slam", "rtabmap", "--slam-parameters", "refined", "--slam-set", "Vis/MinInliers=15")
    done = dotmask("run", "smoke", "--frames", 12, "--methods", "mdi", "--out", out, *arguments)
    assert done.code == 0, done.err
    report = Report.model_validate_json((out / "report.json").read_text())
    assert report.slam == "rtabmap"
    assert report.slam_parameters["Vis/MinInliers"] == "15"
    assert report.slam_parameters["Vis/PnPRefineIterations"] == "5"
    assert report.methods["mdi"].ate_rmse_m < 0.03
    assert report.methods["mdi"].tracked_frames >= 10
    assert report.methods["mdi"].time_ms.odometry > 5, "the time of its process counts"
    assert json.loads((out / "versions.json").read_text())["depthai"] == "3.12.0"
    assert (out / "rtabmap_mdi.log").is_file()
    with sqlite3.connect(out / "rtabmap_mdi.db") as database:
        assert database.execute("SELECT count(*) FROM Node").fetchone()[0] >= 1
    database.close()
