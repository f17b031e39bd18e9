import itertools
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


def surface(share, speed=0.0) -> SurfaceMotion:
    velocity = np.array([0.0, 0.6 * speed, -0.8 * speed])
    points = 10_000
    return SurfaceMotion(
        points=points, moving_points=round(share * points), velocity_world=velocity, covariance=np.eye(3)
    )


def track(
    speed,
    class_name="person",
    mask=STANDING,
    sigma_v=0.02,
    misses=0,
    verdict=None,
    share=None,
    surface_speed=0.0,
    is_partial=False,
) -> Track:
    """`share` of its surface's points move, at `surface_speed`; None: there are none."""
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
        is_partial=is_partial,
        surface=None if share is None else surface(share, surface_speed),
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


PATIENCE = [
    CALIBRATED,
    replace(CALIBRATED, name="slow to believe", proof_frames=6, calm_frames=3),
    replace(CALIBRATED, name="quick to believe", proof_frames=1, calm_frames=4),
]


@pytest.mark.parametrize("profile", PATIENCE, ids=lambda p: p.name)
def test_a_new_track_is_idle_after_the_frames_that_prove_it(profile) -> None:
    before, reasons = None, []
    for _ in range(profile.proof_frames + 1):
        now = track(0.0)
        now = replace(now, verdict=classify(now, before, profile))
        assert now.verdict is not None
        reasons.append(now.verdict.reason)
        before = now
    assert reasons == [Reason.NEW] * (profile.proof_frames - 1) + [Reason.IDLE] * 2


@pytest.mark.parametrize("profile", PATIENCE, ids=lambda p: p.name)
def test_a_mover_is_idle_only_after_the_calm_frames(profile) -> None:
    before = track(1.0, verdict=Verdict(is_moving=True, reason=Reason.SPEED, speed_m_s=1.0, mask_iou=None))
    flags = []
    for _ in range(profile.calm_frames):
        now = track(0.0)
        now = replace(now, verdict=classify(now, before, profile))
        assert now.verdict is not None
        flags.append(now.verdict.is_moving)
        before = now
    assert flags == [True] * (profile.calm_frames - 1) + [False]


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


def test_one_point_alone_lets_nobody_move_but_keeps_a_mover_moving() -> None:
    """Of 16 points one is more than the share that is asked for; but one may have slipped."""
    moving = Verdict(is_moving=True, reason=Reason.SURFACE, speed_m_s=0.0, mask_iou=None, calm_frames=3)
    for verdict, moving_points, flags in ((idle(), 1, False), (idle(), 2, True), (moving, 1, True)):
        motion = replace(surface(1.0), points=16, moving_points=moving_points)
        now = replace(track(0.0), surface=motion)
        answer = classify(now, track(0.0, verdict=verdict), CALIBRATED)
        assert (answer.is_moving, answer.calm_frames == 0) == (flags, flags), (verdict.reason, moving_points)


SHAPES = {
    "same": STANDING,
    "shifted": rectangle(60, 20, 89, 99),
    "waving": STANDING | rectangle(80, 40, 109, 49),
}


@pytest.mark.parametrize("speed", [0.0, 1.0])
@pytest.mark.parametrize("shape", SHAPES)
def test_of_a_person_whose_surface_as_a_whole_rests_the_share_of_moving_points_decides(speed, shape) -> None:
    """Neither a speed, which a half hidden box may feign, nor a mask that changes its shape has a say beside it."""
    before, least = track(0.0, verdict=idle()), CALIBRATED.class_model("person").moving_share
    still = classify(track(speed, mask=SHAPES[shape], share=0.99 * least), before, CALIBRATED)
    moves = classify(track(speed, mask=SHAPES[shape], share=least), before, CALIBRATED)
    assert (still.is_moving, still.reason) == (False, Reason.IDLE)
    assert (moves.is_moving, moves.reason, moves.calm_frames) == (True, Reason.SURFACE, 0)
    assert (still.mask_iou, moves.mask_iou) == (None, None)


@pytest.mark.parametrize("class_name", ["chair", "cup"])
def test_a_thing_moves_if_it_is_fast_and_its_surface_says_so_by_share_or_by_velocity(class_name) -> None:
    """What comes straight at the camera leaves its pixels late: then the velocity of its surface tells."""
    before, model = track(0.0, class_name, verdict=idle()), CALIBRATED.class_model(class_name)
    for is_fast, has_share, is_surface_fast in itertools.product((False, True), repeat=3):
        now = track(
            model.speed_threshold_m_s * (1.5 if is_fast else 0.9),
            class_name,
            sigma_v=1e-3,
            share=model.moving_share * (1.0 if has_share else 0.99),
            surface_speed=model.speed_threshold_m_s * (1.01 if is_surface_fast else 0.99),
        )
        verdict = classify(now, before, CALIBRATED)
        moves = is_fast and (has_share or is_surface_fast)
        assert verdict.is_moving == moves, (is_fast, has_share, is_surface_fast)
        assert verdict.reason is (Reason.SPEED if moves else Reason.IDLE)


@pytest.mark.parametrize("surface_speed", [0.0, 0.5])
def test_a_thing_whose_surface_moves_must_still_be_faster_than_its_uncertainty(surface_speed) -> None:
    before = track(0.0, "chair", verdict=idle())
    for sigma_v, moves in ((0.3, False), (0.1, True)):
        now = track(0.5, "chair", sigma_v=sigma_v, share=1.0, surface_speed=surface_speed)
        assert classify(now, before, CALIBRATED).is_moving == moves


def test_a_person_who_is_fast_as_a_whole_moves_by_speed_and_by_a_share_of_the_surface_otherwise() -> None:
    before, least = track(0.0, verdict=idle()), CALIBRATED.class_model("person").moving_share
    for share, surface_speed, reason in (
        (0.99 * least, 0.5, Reason.SPEED),
        (0.99 * least, 0.0, Reason.IDLE),
        (least, 0.5, Reason.SURFACE),
    ):
        assert classify(track(0.5, share=share, surface_speed=surface_speed), before, CALIBRATED).reason is reason


@pytest.mark.parametrize(
    ("class_name", "speed", "why"), [("person", 0.0, Reason.SURFACE), ("chair", 0.5, Reason.SPEED)]
)
def test_to_be_taken_for_moving_asks_for_a_larger_share_than_to_stay_so(class_name, speed, why) -> None:
    model = CALIBRATED.class_model(class_name)
    enter, stay = model.moving_share, model.still_moving_share
    assert stay < enter
    moving = Verdict(is_moving=True, reason=why, speed_m_s=speed, mask_iou=None)
    new = Verdict(is_moving=True, reason=Reason.NEW, speed_m_s=speed, mask_iou=None)
    for known, least in ((moving, stay), (idle(), enter), (new, enter)):
        before = track(0.0, class_name, verdict=known)
        above = classify(track(speed, class_name, share=least), before, CALIBRATED)
        below = classify(track(speed, class_name, share=0.99 * least), before, CALIBRATED)
        assert (above.is_moving, above.reason, above.calm_frames) == (True, why, 0)
        assert below.calm_frames == known.calm_frames + 1, "it speaks for rest"
    above = classify(track(speed, class_name, share=enter), None, CALIBRATED)
    assert (above.is_moving, above.reason) == (True, why)
    assert classify(track(speed, class_name, share=0.99 * enter), None, CALIBRATED).reason is Reason.NEW


@pytest.mark.parametrize(
    ("class_name", "speed", "speaks_for_rest"),
    [("chair", 0.0, True), ("chair", 0.5, False), ("person", 0.0, False), ("person", 0.5, False)],
)
def test_a_half_hidden_box_without_points_never_speaks_for_motion_and_for_rest_only_if_rigid_and_slow(
    class_name, speed, speaks_for_rest
) -> None:
    moving = Verdict(is_moving=True, reason=Reason.SPEED, speed_m_s=1.0, mask_iou=None, calm_frames=1)
    hidden = track(speed, class_name, sigma_v=1e-3, mask=SHAPES["waving"], is_partial=True)
    asleep = classify(hidden, track(0.0, class_name, verdict=idle(7)), CALIBRATED)
    assert (asleep.is_moving, asleep.reason, asleep.calm_frames) == (False, Reason.IDLE, 7 + speaks_for_rest)
    assert asleep.mask_iou is None, "its outline is the occluder's"
    awake = classify(hidden, track(1.0, class_name, verdict=moving), CALIBRATED)
    assert (awake.is_moving, awake.reason, awake.calm_frames) == (True, Reason.SPEED, 1 + speaks_for_rest)
    # Without an occluder the speed is proof, as it is where no surfaces are followed at all; points are, in any case.
    fast = speed > 0
    for now, profile in (
        (replace(hidden, is_partial=False, mask=STANDING), CALIBRATED),
        (replace(hidden, mask=STANDING), replace(CALIBRATED, surface=None)),
    ):
        verdict = classify(now, track(0.0, class_name, verdict=idle()), profile)
        assert verdict.reason is (Reason.SPEED if fast else Reason.IDLE)
    seen = classify(replace(hidden, surface=surface(1.0)), track(0.0, class_name, verdict=idle()), CALIBRATED)
    assert seen.is_moving == (fast or class_name == "person")


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
    profile, before = replace(CALIBRATED, unknown_policy=policy, proof_frames=4), None
    for k in range(profile.proof_frames - 1):
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
