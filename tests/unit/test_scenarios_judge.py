"""The judge on a world of two rectangles: what it hands to each measure."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dotmask.pipeline import FrameResult, FrontEndResult
from dotmask.records import (
    Detections,
    Innovation,
    Intrinsics,
    MaskedDepth,
    PoseEstimate,
    Reason,
    RgbdFrame,
    SlamStatus,
    Track,
    TrackPhase,
    Verdict,
)
from scenarios.judge import Judge
from scenarios.run_folder import RunFolder
from sim.records import GroundTruth, ObjectTruth

SHAPE = (60, 80)
IDS = np.zeros(SHAPE, np.uint16)
IDS[10:50, 5:35], IDS[20:40, 50:70] = 1, 2  # a person who moves from frame 12 on, a chair that rests
RESTS = 12


def actor(name: str, instance: int, is_moving: bool) -> ObjectTruth:
    return ObjectTruth(
        name=name,
        class_name=name,
        instance_id=instance,
        T_world_object=np.eye(4),
        centre_world=np.array([0.0, 0.0, 3.0]),
        velocity_world=np.array([float(is_moving), 0.0, 0.0]),
        surface_speed_m_s=float(is_moving),
        is_moving=is_moving,
        visible_pixels=int(np.count_nonzero(instance == IDS)),
        occlusion=0.0,
        is_truncated=False,
        ideal_world=np.array([0.0, 0.0, 2.9]),
    )


def scene(index: int) -> GroundTruth:
    return GroundTruth(
        T_world_camera=np.eye(4),
        depth_m=np.full(SHAPE, 3.0, np.float32),
        instance_ids=IDS,
        objects=(actor("person", 1, index >= RESTS), actor("chair", 2, False)),
    )


def track(track_id: int, detection: int, name: str, mask: np.ndarray, time_s: float, speed: float, flag: bool) -> Track:
    return Track(
        track_id=track_id,
        class_name=name,
        timestamp_s=time_s,
        mean=np.array([0, 0, 2.8, speed, 0, 0]),
        covariance=np.eye(6),
        hits=2,
        misses=0,
        phase=TrackPhase.CONFIRMED,
        detection_index=detection,
        mask=mask,
        mask_timestamp_s=time_s,
        mask_position_camera=np.array([0, 0, 2.8]),
        is_partial=False,
        innovation=Innovation(residual=np.array([1.0, 0, 0]), covariance=np.eye(3)),
        verdict=Verdict(is_moving=flag, reason=Reason.SPEED, speed_m_s=speed, mask_iou=None),
    )


def answer(index: int, *, is_tracker: bool = True) -> FrameResult:
    """The person is found whole, the chair half; the person's track is flagged two frames late, the chair's never."""
    time_s, depth = index / 30, np.full(SHAPE, 3.0, np.float32)
    person, chair = IDS == 1, (IDS == 2) & (np.arange(SHAPE[1]) < 62)
    flag = index >= RESTS + 2
    mo_mdi = np.where(person & flag, np.float32(0), depth)
    tracks = (
        track(7 if index < 20 else 9, 0, "person", person, time_s, 1.0 if flag else 0.1, flag),
        track(8, 1, "chair", chair, time_s, 0.2, False),
    )
    return FrameResult(
        frame=RgbdFrame(
            index=index,
            timestamp_s=time_s,
            rgb=np.zeros((*SHAPE, 3), np.uint8),
            depth_m=depth,
            intrinsics=Intrinsics(fx=50.0, fy=50.0, cx=40.0, cy=30.0, width=SHAPE[1], height=SHAPE[0]),
        ),
        T_world_camera_predicted=np.eye(4),
        front_end=FrontEndResult(
            detections=Detections(
                masks=np.array([person, chair]),
                boxes_px=np.array([[5.0, 10, 34, 49], [50, 20, 61, 39]]),
                class_names=("person", "chair"),
                scores=np.ones(2),
            ),
            observations=(),
            tracks=tracks if is_tracker else (),
            masked=MaskedDepth(mo_mdi_m=mo_mdi, mdi_m=mo_mdi),
            stage_seconds={},
        ),
        pose=PoseEstimate(timestamp_s=time_s, T_world_camera=np.eye(4), status=SlamStatus.TRACKED, inliers=100),
        stage_seconds={"mask": 0.001, "track": 0.002} if is_tracker else {"mask": 0.001},
    )


@pytest.fixture
def judge(tmp_path: Path) -> Judge:
    judge = Judge("dotmask")
    with RunFolder(tmp_path / "run") as folder:
        for index in range(24):
            judge.see(scene(index), answer(index), folder)
    return judge


def test_classification(judge: Judge) -> None:
    moc = judge.report().moc
    assert moc.by_class is not None
    assert moc.by_class["person"].model_dump() == {
        "true_positive": 10, "false_positive": 0, "false_negative": 2, "true_negative": 12,
    }  # fmt: skip
    assert moc.by_class["chair"].true_negative == 24
    assert moc.recall == pytest.approx(10 / 12)
    assert moc.idle_flag_rate == 0
    assert (moc.starts, moc.missed_starts, moc.start_latency_frames, moc.start_latency_max_frames) == (1, 0, 2, 2)
    # Movers: 10 at 1 m/s, 2 at 0.1; resting: 12 at 0.1, 24 at 0.2.
    assert moc.auc == pytest.approx((10 * 36 + 2 * 12 * 0.5) / (12 * 36))


def test_identities(judge: Judge) -> None:
    tracking = judge.report().tracking
    # The person's life of 24 frames is cut into 20 and 4. The chair's IoU of 0.6 passes 12 of the 19 thresholds.
    person = (20 * 20 / 24 + 4 * 4 / 24) / 24
    found = 12 * (24 + 24) / (24 + 24) + 7 * 24 / (24 + 48)
    assert tracking.deta == pytest.approx(found / 19)
    assert tracking.assa == pytest.approx((12 * (person + 1) / 2 + 7 * person) / 19)
    assert tracking.switches == 1
    assert tracking.mota == pytest.approx(1 - 1 / 48)
    assert tracking.idf1 == pytest.approx(44 / 48)


def test_beliefs(judge: Judge) -> None:
    ekf = judge.report().ekf
    assert ekf.position_rmse_m == pytest.approx(0.2)
    assert ekf.position_bias_m == pytest.approx(0.2)
    assert ekf.position_bias_ray_m == pytest.approx(-0.2)
    assert ekf.position_bias_ideal_m == pytest.approx(0.1)
    assert ekf.nis == pytest.approx(1)
    assert ekf.innovation_correlation == pytest.approx(1)
    # The person's track changes its id once: 22 pairs of frames there, 23 of the chair, three components each.
    assert ekf.innovation_correlation_bound == pytest.approx(1.96 / np.sqrt(3 * (22 + 23)), rel=1e-4)


def test_masks(judge: Judge) -> None:
    masks = judge.report().masks
    assert masks.iou == pytest.approx((1 + 0.6) / 2)
    assert masks.boundary_f is not None
    assert 0.5 < masks.boundary_f < 1
    assert masks.leak == pytest.approx(2 / 12)
    assert masks.waste == 0


def test_a_method_without_tracks_is_not_scored_for_them(tmp_path: Path) -> None:
    judge = Judge("mdi")
    with RunFolder(tmp_path / "run") as folder:
        judge.see(scene(0), answer(0, is_tracker=False), folder)
    report = judge.report()
    assert report.masks.iou is not None
    assert report.tracking.mota is report.tracking.hota is report.moc.recall is report.moc.by_class is None
    assert report.ekf.nees is report.ekf.innovation_correlation is None
    assert not (tmp_path / "run" / "tracks.csv").exists()


def test_a_tracker_that_finds_nothing_misses_everything(tmp_path: Path) -> None:
    judge, blind = Judge("dotmask"), replace(answer(0, is_tracker=False), stage_seconds={"track": 0.001})
    with RunFolder(tmp_path / "run") as folder:
        judge.see(scene(0), blind, folder)
    assert (judge.report().tracking.mota, judge.report().tracking.hota) == (0, 0)


def test_rows_of_the_tables(tmp_path: Path, judge: Judge) -> None:
    with (tmp_path / "run" / "tracks.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 48
    assert {(row["class"], row["instance_id"]) for row in rows} == {("person", "1"), ("chair", "2")}
    with (tmp_path / "run" / "frames.csv").open() as file:
        frames = list(csv.DictReader(file))
    assert [int(row["leaked_pixels"]) for row in frames[11:15]] == [0, 1200, 1200, 0]
