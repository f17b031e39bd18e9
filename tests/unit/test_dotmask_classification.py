from dataclasses import replace

import numpy as np
import pytest

from dotmask.classification import classify, mask_iou
from dotmask.profiles import CALIBRATED, PAPER
from dotmask.records import Reason, Track, Verdict


def rectangle(u0, v0, u1, v1):
    mask = np.zeros((120, 160), bool)
    mask[v0 : v1 + 1, u0 : u1 + 1] = True
    return mask


STANDING = rectangle(50, 20, 79, 99)


def track(speed, class_name="person", mask=STANDING, sigma_v=0.02, misses=0, verdict=None) -> Track:
    return Track(
        track_id=1,
        class_name=class_name,
        timestamp_s=1.0,
        mean=np.array([0, 0, 2, 0.6 * speed, 0, 0.8 * speed]),
        covariance=np.diag([0.01**2] * 3 + [sigma_v**2] * 3),
        age_frames=5,
        misses=misses,
        detection_index=0 if misses == 0 else None,
        mask=mask,
        mask_timestamp_s=1.0,
        partial_timestamp_s=0.0,
        verdict=verdict,
    )


def idle(calm_frames=20) -> Verdict:
    return Verdict(is_moving=False, reason=Reason.IDLE, speed_m_s=0.0, mask_iou=None, calm_frames=calm_frames)


@pytest.mark.parametrize(("class_name", "threshold"), [("person", 0.01), ("chair", 0.1), ("cup", 0.1)])
def test_paper_compares_the_norm_of_the_velocity_with_the_class_threshold(class_name, threshold) -> None:
    before = track(0.0, class_name, verdict=idle())
    slow = classify(track(0.99 * threshold, class_name), before, PAPER)
    fast = classify(track(1.01 * threshold, class_name), before, PAPER)
    assert (slow.is_moving, slow.reason) == (False, Reason.IDLE)
    assert (fast.is_moving, fast.reason) == (True, Reason.SPEED)
    assert fast.speed_m_s == pytest.approx(1.01 * threshold)


def test_misprint_e_a_low_overlap_is_deformation_and_a_high_one_is_not() -> None:
    waving = rectangle(40, 20, 89, 99) & ~rectangle(40, 40, 89, 69) | STANDING & rectangle(60, 20, 70, 99)
    before = track(0.0, verdict=idle())
    moved = classify(track(0.0, mask=waving), before, PAPER)
    same = classify(track(0.0), before, PAPER)
    assert (moved.is_moving, moved.reason) == (True, Reason.DEFORMATION)
    assert moved.mask_iou is not None
    assert moved.mask_iou < PAPER.deformation_iou < 1.0
    # As printed ("above"), a person who keeps perfectly still would be moving.
    assert (same.is_moving, same.mask_iou) == (False, 1.0)


def test_rigid_objects_are_not_tested_for_deformation() -> None:
    before = track(0.0, "chair", verdict=idle())
    verdict = classify(track(0.0, "chair", mask=rectangle(0, 0, 20, 20)), before, PAPER)
    assert (verdict.is_moving, verdict.mask_iou) == (False, None)


def test_a_new_track_is_kept_by_the_paper_and_masked_by_the_calibrated_profile() -> None:
    assert classify(track(0.0), None, PAPER) == Verdict(
        is_moving=False, reason=Reason.IDLE, speed_m_s=0.0, mask_iou=None, calm_frames=1
    )
    verdict = classify(track(0.0), None, CALIBRATED)
    assert (verdict.is_moving, verdict.reason, verdict.calm_frames) == (True, Reason.NEW, 1)
    kept = classify(track(0.0), None, replace(CALIBRATED, unknown_policy="keep"))
    assert (kept.is_moving, kept.reason) == (False, Reason.NEW)


def test_a_new_track_is_idle_after_the_calm_frames() -> None:
    before, reasons = None, []
    for _ in range(CALIBRATED.calm_frames + 1):
        now = track(0.0)
        now = replace(now, verdict=classify(now, before, CALIBRATED))
        assert now.verdict is not None
        reasons.append(now.verdict.reason)
        before = now
    assert reasons == [Reason.NEW] * (CALIBRATED.calm_frames - 1) + [Reason.IDLE] * 2


def test_a_mover_is_idle_only_after_the_calm_frames() -> None:
    before = track(1.0, verdict=Verdict(is_moving=True, reason=Reason.SPEED, speed_m_s=1.0, mask_iou=None))
    flags = []
    for _ in range(CALIBRATED.calm_frames):
        now = track(0.0)
        now = replace(now, verdict=classify(now, before, CALIBRATED))
        assert now.verdict is not None
        flags.append(now.verdict.is_moving)
        before = now
    assert flags == [True] * (CALIBRATED.calm_frames - 1) + [False]


def test_calibrated_speed_must_stand_out_from_its_own_uncertainty() -> None:
    before = track(0.0, verdict=idle(7))
    unsure = classify(track(0.5, sigma_v=0.3), before, CALIBRATED)
    sure = classify(track(0.5, sigma_v=0.1), before, CALIBRATED)
    assert (unsure.is_moving, unsure.calm_frames) == (False, 7)
    assert (sure.is_moving, sure.reason, sure.calm_frames) == (True, Reason.SPEED, 0)
    slow_but_sure = classify(track(0.05, sigma_v=0.001), before, CALIBRATED)
    assert not slow_but_sure.is_moving


def test_a_possible_speed_neither_wakes_nor_calms() -> None:
    moving = Verdict(is_moving=True, reason=Reason.SPEED, speed_m_s=1.0, mask_iou=None, calm_frames=3)
    verdict = classify(track(0.5, sigma_v=0.3), track(1.0, verdict=moving), CALIBRATED)
    assert (verdict.is_moving, verdict.reason, verdict.calm_frames) == (True, Reason.SPEED, 3)


def test_an_unseen_track_keeps_its_verdict() -> None:
    moving = Verdict(is_moving=True, reason=Reason.SPEED, speed_m_s=1.0, mask_iou=0.8, calm_frames=3)
    verdict = classify(track(0.0, misses=2), track(1.0, misses=1, verdict=moving), CALIBRATED)
    assert verdict == Verdict(is_moving=True, reason=Reason.SPEED, speed_m_s=0.0, mask_iou=None, calm_frames=3)


def test_masks_are_compared_only_between_consecutive_sightings() -> None:
    before = track(0.0, misses=1, verdict=idle())
    assert classify(track(0.0, mask=rectangle(0, 0, 9, 9)), before, PAPER).mask_iou is None


@pytest.mark.parametrize("alignment", ["none", "box"])
def test_iou_of_equal_masks_is_one_and_of_nothing_zero(alignment) -> None:
    assert mask_iou(STANDING, STANDING, alignment) == 1.0
    assert mask_iou(STANDING, np.zeros_like(STANDING), alignment) == 0.0
    assert mask_iou(np.zeros_like(STANDING), np.zeros_like(STANDING), alignment) == 0.0


def test_plain_iou_counts_pixels() -> None:
    rng = np.random.default_rng(0)
    a, b = rng.random((2, 120, 160)) < 0.3
    expected = np.count_nonzero(a & b) / np.count_nonzero(a | b)
    assert mask_iou(a, b, "none") == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("scale", [1.0, 1.05, 1.1, 1.3])
def test_aligned_iou_forgives_shift_and_scale_where_the_plain_one_does_not(scale) -> None:
    width, height = round(40 * scale), round(60 * scale)
    v, u = np.mgrid[0:120, 0:160]
    small = ((u - 40) / 20) ** 2 + ((v - 60) / 30) ** 2 <= 1
    large = ((u - 80) / (width / 2)) ** 2 + ((v - 60) / (height / 2)) ** 2 <= 1
    assert mask_iou(small, large, "box") > 0.94
    assert mask_iou(small, large, "none") < 0.3


def test_half_hidden_a_standing_object_needs_more_speed_to_count_as_moving() -> None:
    threshold = CALIBRATED.class_model("chair").speed_threshold_m_s
    before, slow = track(0.0, "chair", verdict=idle()), track(1.4 * threshold, "chair", sigma_v=0.01)
    assert classify(slow, before, CALIBRATED).reason is Reason.SPEED
    half_hidden = replace(slow, partial_timestamp_s=slow.timestamp_s)
    assert classify(half_hidden, before, CALIBRATED).reason is Reason.IDLE
