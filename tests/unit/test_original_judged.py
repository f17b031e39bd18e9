"""The profile `original` as a run sees it: which front end it is, and how its untracked detections are judged."""

from pathlib import Path

import numpy as np
import pytest

from dotmask.original import OriginalDotMask
from dotmask.pipeline import DotMask, FrameResult, FrontEndResult
from dotmask.profiles import CALIBRATED, ORIGINAL, PAPER
from dotmask.records import MaskedDepth, PoseEstimate, SlamStatus
from scenarios.bridge import rgbd_frame_from_sim
from scenarios.judge import Judge
from scenarios.oracle import OracleSegmenter
from scenarios.registry import scenario
from scenarios.run import METHODS, RunSettings, run
from scenarios.run_folder import RunFolder
from scenarios.spec import with_overrides
from scenarios.world import build_simulator


def test_the_profile_chooses_the_front_end() -> None:
    oracle = OracleSegmenter()
    assert isinstance(METHODS["dotmask"](oracle, ORIGINAL), OriginalDotMask)
    for chosen in (PAPER, CALIBRATED):
        assert isinstance(METHODS["dotmask"](oracle, chosen), DotMask)


def test_a_run_takes_the_profile_by_name(tmp_path: Path) -> None:
    short = with_overrides(scenario("smoke"), {"frames": "4"})
    report = run(short, RunSettings.parse(profile="original"), tmp_path / "run", lambda: None)
    assert report.profile == "original"
    assert report.methods["dotmask"].tracked_frames == 4
    assert set(report.methods) == {"unmasked", "mdi", "dotmask"}


@pytest.mark.parametrize(("is_masked", "recall"), [(False, 0.0), (True, 1.0)])
def test_a_detection_without_a_track_is_judged_by_its_pixels(tmp_path: Path, is_masked: bool, recall: float) -> None:
    sim_frame = build_simulator(scenario("smoke"), "numba", 1).frame(30)
    frame, oracle = rgbd_frame_from_sim(sim_frame), OracleSegmenter()
    oracle.show(frame.index, sim_frame.truth)
    detections = oracle.segment(frame)
    assert any(actor.is_moving for actor in sim_frame.truth.objects)
    image = np.zeros_like(frame.depth_m) if is_masked else frame.depth_m
    front_end = FrontEndResult(
        detections=detections,
        observations=OriginalDotMask(oracle).step(frame, np.eye(4)).observations,
        tracks=(),
        masked=MaskedDepth(mo_mdi_m=image, mdi_m=image),
        stage_seconds={},
    )
    pose = PoseEstimate(timestamp_s=frame.timestamp_s, T_world_camera=np.eye(4), status=SlamStatus.TRACKED, inliers=100)
    judge = Judge("dotmask")
    with RunFolder(tmp_path / "out") as folder:
        judge.see(
            sim_frame.truth,
            FrameResult(
                frame=frame,
                T_world_camera_predicted=np.eye(4),
                front_end=front_end,
                pose=pose,
                stage_seconds={"track": 0.0},
            ),
            folder,
        )
    assert judge.report().moc.recall == recall
