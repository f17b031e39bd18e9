from dataclasses import replace

import numpy as np
import pytest

from dotmask.classification import classify
from dotmask.profiles import CALIBRATED, PAPER
from dotmask.records import Reason, SurfaceMotion, Track, TrackPhase, Verdict


def rectangle(u0, v0, u1, v1):
    mask = np.zeros((120, 160), bool)
    mask[v0 : v1 + 1, u0 : u1 + 1] = True
    return mask


STANDING = rectangle(50, 20, 79, 99)


def surface(share) -> SurfaceMotion:
    return SurfaceMotion(points=20, moving_share=share, velocity_world=np.zeros(3), covariance=np.eye(3))


def track(speed, class_name="person", mask=STANDING, sigma_v=0.02, misses=0, verdict=None, share=None) -> Track:
    """`share` of its surface's points move; None: there are none."""
    return Track(
        track_id=1,
        class_name=class_name,
        timestamp_s=1.0,
        mean=np.array([0, 0, 2, 0.6 * speed, 0, 0.8 * speed]),
        covariance=np.diag([0.01**2] * 3 + [sigma_v**2] * 3),
        hits=5,
        misses=misses,
        phase=TrackPhase.CONFIRMED if misses == 0 else TrackPhase.COASTING,
        detection_index=0 if misses == 0 else None,
        mask=mask,
        mask_timestamp_s=1.0,
        mask_position_camera=np.array([0, 0, 2.0]),
        partial_timestamp_s=0.0,
        surface=None if share is None else surface(share),
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


# ---- surfaces -----------------------------------------------------------------------------------

SHAPES = {
    "same": STANDING,
    "shifted": rectangle(60, 20, 89, 99),
    "waving": STANDING | rectangle(80, 40, 109, 49),
}


@pytest.mark.parametrize("speed", [0.0, 1.0])
@pytest.mark.parametrize("shape", SHAPES)
def test_of_a_person_the_share_of_moving_points_decides_alone(speed, shape) -> None:
    """Neither a speed, which a half hidden box may feign, nor a mask that changes its shape has a say beside it."""
    before, least = track(0.0, verdict=idle()), CALIBRATED.class_model("person").moving_share
    still = classify(track(speed, mask=SHAPES[shape], share=0.99 * least), before, CALIBRATED)
    moves = classify(track(speed, mask=SHAPES[shape], share=least), before, CALIBRATED)
    assert (still.is_moving, still.reason) == (False, Reason.IDLE)
    assert (moves.is_moving, moves.reason, moves.calm_frames) == (True, Reason.SURFACE, 0)
    assert (still.mask_iou, moves.mask_iou) == (None, None)


@pytest.mark.parametrize("class_name", ["chair", "cup"])
def test_a_thing_moves_if_it_is_fast_and_most_of_its_surface_moves(class_name) -> None:
    before, model = track(0.0, class_name, verdict=idle()), CALIBRATED.class_model(class_name)
    answers = {}
    for is_fast in (False, True):
        for has_share in (False, True):
            speed = model.speed_threshold_m_s * (1.5 if is_fast else 0.9)
            share = model.moving_share * (1.0 if has_share else 0.99)
            now = track(speed, class_name, sigma_v=1e-3, share=share)
            answers[is_fast, has_share] = classify(now, before, CALIBRATED)
    for case, verdict in answers.items():
        assert verdict.is_moving == (case == (True, True)), case
        assert verdict.reason is (Reason.SPEED if case == (True, True) else Reason.IDLE)


def test_a_thing_whose_surface_moves_must_still_be_faster_than_its_uncertainty() -> None:
    before = track(0.0, "chair", verdict=idle(7))
    unsure = classify(track(0.5, "chair", sigma_v=0.3, share=1.0), before, CALIBRATED)
    assert (unsure.is_moving, unsure.calm_frames) == (False, 7)


def test_a_surface_that_rests_calms_a_thing_whose_box_slides() -> None:
    """Without points, such a speed would speak neither for motion nor for rest."""
    moving = Verdict(is_moving=True, reason=Reason.SPEED, speed_m_s=1.0, mask_iou=None, calm_frames=2)
    before = track(1.0, "chair", verdict=moving)
    rests = classify(track(0.5, "chair", sigma_v=0.3, share=0.1), before, CALIBRATED)
    without = classify(track(0.5, "chair", sigma_v=0.3), before, CALIBRATED)
    assert (rests.is_moving, rests.calm_frames) == (True, 3)
    assert (without.is_moving, without.calm_frames) == (True, 2)


def test_without_points_speed_decides_and_then_deformation() -> None:
    before = track(0.0, verdict=idle())
    fast = classify(track(0.5, mask=SHAPES["waving"], sigma_v=0.05), before, CALIBRATED)
    assert (fast.is_moving, fast.reason, fast.mask_iou) == (True, Reason.SPEED, None)
    waves = classify(track(0.0, mask=SHAPES["waving"]), before, CALIBRATED)
    assert (waves.is_moving, waves.reason) == (True, Reason.DEFORMATION)
    # An arm of 30 x 10 widens the box of 30 x 80 to 60 x 80: the aligned body fills it, the person 2700 of 4800.
    assert waves.mask_iou == pytest.approx(2700 / 4800)
    stands = classify(track(0.0), before, CALIBRATED)
    assert (stands.is_moving, stands.reason, stands.mask_iou) == (False, Reason.IDLE, 1.0)


def test_masks_are_aligned_where_the_profile_says_so() -> None:
    """A camera that turns shifts the mask by a third of its width: 20 of 40 columns in common."""
    before, now = track(0.0, verdict=idle()), track(0.0, mask=SHAPES["shifted"])
    aligned = classify(now, before, CALIBRATED)
    plain = classify(now, before, replace(CALIBRATED, aligns_masks=False))
    assert (aligned.is_moving, aligned.mask_iou) == (False, 1.0)
    assert (plain.is_moving, plain.reason) == (True, Reason.DEFORMATION)
    assert plain.mask_iou == pytest.approx(20 / 40)


def test_a_person_whose_surface_rests_is_idle_after_the_calm_frames_and_moves_at_once() -> None:
    before, seen = None, []
    for share in [0.5] + [0.0] * CALIBRATED.calm_frames + [0.0, 0.5] + [0.0] * CALIBRATED.calm_frames:
        now = track(0.0, share=share)
        verdict = classify(now, before, CALIBRATED)
        before = replace(now, verdict=verdict)
        seen.append((verdict.is_moving, verdict.calm_frames))
    hold = CALIBRATED.calm_frames
    calming = [(True, k) for k in range(hold)] + [(False, hold)]
    assert seen == [*calming, (False, hold + 1), *calming]


@pytest.mark.parametrize(("policy", "is_masked"), [("mask", True), ("keep", False)])
def test_the_policy_for_the_unknown_holds_until_something_is_known(policy, is_masked) -> None:
    profile, before = replace(CALIBRATED, unknown_policy=policy), None
    for k in range(CALIBRATED.calm_frames - 1):
        now = track(0.0, share=0.0)
        verdict = classify(now, before, profile)
        assert (verdict.is_moving, verdict.reason, verdict.calm_frames) == (is_masked, Reason.NEW, k + 1)
        before = replace(now, verdict=verdict)
    moves = classify(track(0.0, share=1.0), before, profile)
    assert (moves.is_moving, moves.reason) == (True, Reason.SURFACE)
    assert not classify(track(0.0, share=0.0), before, profile).is_moving


@pytest.mark.parametrize("moving", [False, True])
def test_a_coasting_track_keeps_its_verdict_whatever_it_is_predicted_to_do(moving) -> None:
    reason = Reason.SURFACE if moving else Reason.IDLE
    known = Verdict(is_moving=moving, reason=reason, speed_m_s=0.0, mask_iou=0.8, calm_frames=3)
    before = track(0.0, verdict=known)
    for misses in range(1, 12):
        now = track(0.0 if moving else 2.0, misses=misses, sigma_v=1e-3)
        verdict = classify(now, before, CALIBRATED)
        assert (verdict.is_moving, verdict.reason, verdict.calm_frames) == (moving, reason, 3)
        before = replace(now, verdict=verdict)
