"""Each failure of the released program that lies in its tracker and its masks, by number.

The numbers are those that running the program gave (docs/original.md). `calibrated` is shown the same images, mostly at
a higher frame rate: `original` does not know any.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from dotmask import original
from dotmask.original import FOCAL_PX, P0, R_M2, STEP_S, OriginalDotMask, centred_iou, process_noise
from dotmask.pipeline import DotMask, FrontEnd, FrontEndResult
from dotmask.profiles import CALIBRATED, ORIGINAL
from dotmask.records import Detections, FloatArray, Intrinsics, Observation, Reason, RgbdFrame, Track
from dotmask.tracking.measurement_model import CAMERA_POINT

CAMERA = Intrinsics(width=640, height=480, fx=525.0, fy=525.0, cx=319.5, cy=239.5)
STILL = np.eye(4)
SIDE_PX = 100
WALL_M = 5.0

Thing = tuple[str, float, float]
"""Class, left edge of a square of SIDE_PX in pixels, depth in metres."""


class Playback:
    """Lists the things of the frame that is shown next, in that order, with falling scores."""

    def __init__(self) -> None:
        self.things: Sequence[Thing] = ()

    def segment(self, frame: RgbdFrame) -> Detections:
        masks = np.array([mask_of(thing) for thing in self.things], bool).reshape(-1, CAMERA.height, CAMERA.width)
        boxes = [[round(u), 190, round(u) + SIDE_PX - 1, 190 + SIDE_PX - 1] for _, u, _ in self.things]
        return Detections(
            masks=masks,
            boxes_px=np.array(boxes, float).reshape(-1, 4),
            class_names=tuple(name for name, _, _ in self.things),
            scores=np.linspace(0.9, 0.5, len(self.things)),
        )


def mask_of(thing: Thing) -> np.ndarray:
    mask = np.zeros((CAMERA.height, CAMERA.width), bool)
    left = round(thing[1])
    mask[190 : 190 + SIDE_PX, left : left + SIDE_PX] = True
    return mask


def frame_of(things: Sequence[Thing], index: int, rate_hz: float) -> RgbdFrame:
    depth = np.full((CAMERA.height, CAMERA.width), WALL_M, np.float32)
    for thing in things:
        depth[mask_of(thing)] = thing[2]
    rgb = np.zeros((CAMERA.height, CAMERA.width, 3), np.uint8)
    return RgbdFrame(index=index, timestamp_s=index / rate_hz, rgb=rgb, depth_m=depth, intrinsics=CAMERA)


def play(name: str, frames: Sequence[Sequence[Thing]], rate_hz: float = 4.0) -> list[FrontEndResult]:
    """What `original` or `calibrated` makes of the frames, seen by a camera that stands still."""
    segmenter = Playback()
    front_end: FrontEnd = OriginalDotMask(segmenter) if name == "original" else DotMask(segmenter, CALIBRATED)
    results = []
    for index, things in enumerate(frames):
        segmenter.things = things
        results.append(front_end.step(frame_of(things, index, rate_hz), STILL))
    return results


def lost_px(result: FrontEndResult, thing: Thing) -> int:
    """How many of the thing's pixels odometry does not see."""
    return int(np.count_nonzero(result.masked.mo_mdi_m[mask_of(thing)] == 0))


def track_at(result: FrontEndResult, detection: int) -> Track:
    return next(track for track in result.tracks if track.detection_index == detection)


CHAIR: Thing = ("chair", 450.0, 2.0)


def walk(frames: int, start_px: float = 20.0, step_px: float = 12.0) -> list[Thing]:
    """A person that crosses the left half of the image."""
    return [("person", start_px + step_px * k, 2.0) for k in range(frames)]


# 1. MO-MDI: the order of the list decides


@pytest.mark.parametrize(("chair_first", "expected"), [(True, SIDE_PX**2), (False, 0)])
def test_a_static_chair_is_lost_if_it_is_listed_before_a_moving_person(chair_first: bool, expected: int) -> None:
    frames = [[CHAIR, person] if chair_first else [person, CHAIR] for person in walk(15)]
    result = play("original", frames)[-1]
    assert not track_at(result, 0 if chair_first else 1).verdict.is_moving
    assert lost_px(result, CHAIR) == expected
    assert lost_px(result, frames[-1][1 if chair_first else 0]) == SIDE_PX**2


@pytest.mark.parametrize("chair_first", [True, False])
def test_calibrated_keeps_the_chair_in_any_order(chair_first: bool) -> None:
    frames = [[CHAIR, person] if chair_first else [person, CHAIR] for person in walk(15)]
    result = play("calibrated", frames, rate_hz=10.0)[-1]
    assert lost_px(result, CHAIR) == 0
    assert lost_px(result, frames[-1][1 if chair_first else 0]) == SIDE_PX**2


# 2. A mask index that nothing renews


def person_then_chair() -> list[list[Thing]]:
    return [[person] for person in walk(15)] + [[CHAIR]] * 30


def test_a_chair_that_appears_as_a_person_leaves_gets_no_track_and_is_removed_for_ever() -> None:
    results = play("original", person_then_chair())
    assert [track.class_name for track in results[-1].tracks] == ["person"]
    assert results[-1].tracks[0].misses == 30
    assert lost_px(results[-1], CHAIR) == SIDE_PX**2


def test_calibrated_gives_that_chair_a_track_and_keeps_it() -> None:
    result = play("calibrated", person_then_chair(), rate_hz=10.0)[-1]
    assert track_at(result, 0).class_name == "chair"
    assert lost_px(result, CHAIR) == 0


# 3. Tracks that end too early, and that never end


def two_people_then_one(leaver: str, frames: int) -> list[list[Thing]]:
    left, right = ("person", 100.0, 2.0), ("person", 400.0, 2.0)
    return [[left, right]] * 10 + [[right if leaver == "left" else left]] * frames


def test_a_person_on_the_right_who_leaves_is_never_forgotten() -> None:
    result = play("original", two_people_then_one("right", 60))[-1]
    assert [track.misses for track in result.tracks] == [0, 60]


def test_a_person_on_the_left_who_leaves_is_forgotten_after_5_frames_in_place_of_10() -> None:
    counts = [len(result.tracks) for result in play("original", two_people_then_one("left", 6))[10:]]
    assert counts == [2, 2, 2, 2, 1, 1]


def test_with_nothing_detected_a_track_lives_one_frame_longer_than_the_limit() -> None:
    counts = [len(result.tracks) for result in play("original", [[CHAIR]] * 3 + [[]] * 12)[3:]]
    assert counts == [1] * ORIGINAL.max_misses + [0, 0]


@pytest.mark.parametrize("leaver", ["left", "right"])
def test_calibrated_forgets_either_after_its_limit(leaver: str) -> None:
    """Both stand still, so the limit is that of idle tracks."""
    frames = two_people_then_one(leaver, CALIBRATED.max_misses_idle + 1)
    counts = [len(result.tracks) for result in play("calibrated", frames, rate_hz=10.0)[10:]]
    assert counts == [2] * (CALIBRATED.max_misses_idle - 1) + [1, 1]


def test_a_nearer_detection_of_another_class_starts_nothing() -> None:
    """One track, one detection, classes that differ: neither a birth nor a missed frame is counted."""
    results = play("original", [[("person", 300.0, 2.0)], [("chair", 300.0, 2.0)]])
    assert [(t.class_name, t.misses) for t in results[1].tracks] == [("person", 1)]


def test_a_detection_at_the_other_side_of_the_room_is_taken_for_the_same_object() -> None:
    """No gate: 3 m in a quarter of a second."""
    results = play("original", [[("chair", 20.0, 3.0)], [("chair", 520.0, 3.0)]])
    assert [(t.track_id, t.detection_index) for t in results[1].tracks] == [(1, 0)]


# 4. Coasting


def chair_at_1_m_s(frames: int, rate_hz: float) -> list[list[Thing]]:
    """Two metres away, 262.5 pixels a second."""
    return [[("chair", 20.0 + FOCAL_PX / 2.0 / rate_hz * k, 2.0)] for k in range(frames)]


def test_an_unseen_object_stays_where_the_first_prediction_put_it_and_grows_uncertain() -> None:
    results = play("original", [*chair_at_1_m_s(9, 4.0), [], [], [], []])
    last, unseen = results[8].tracks[0], [result.tracks[0] for result in results[9:]]
    ways = [track.position_world[0] - last.position_world[0] for track in unseen]
    assert ways == pytest.approx([STEP_S * last.velocity_world[0]] * 4)
    assert ways == pytest.approx([0.25] * 4, abs=0.03)
    spreads = [track.covariance[0, 0] for track in (last, *unseen)]
    assert (np.diff(spreads) > 0.1).all()


def test_calibrated_moves_an_unseen_object_on() -> None:
    results = play("calibrated", [*chair_at_1_m_s(9, 4.0), [], [], [], []])
    last, unseen = results[8].tracks[0], [result.tracks[0] for result in results[9:]]
    ways = [track.position_world[0] - last.position_world[0] for track in unseen]
    assert ways == pytest.approx([0.25, 0.5, 0.75, 1.0], rel=0.1)


# 5. The fixed step


@pytest.mark.parametrize(("rate_hz", "reading"), [(4.0, 1.0), (14.0, 0.286), (30.0, 0.133)])
def test_a_speed_is_read_as_truth_times_real_step_over_a_quarter_of_a_second(rate_hz: float, reading: float) -> None:
    # 1.8 s is all that the image is wide, and 8 frames at 4 Hz: the filter has not settled quite.
    frames = chair_at_1_m_s(int(1.8 * rate_hz) + 1, rate_hz)
    speed = play("original", frames, rate_hz)[-1].tracks[0].velocity_world[0]
    assert speed == pytest.approx(reading, rel=0.2 if rate_hz == 4.0 else 0.03)


@pytest.mark.parametrize("rate_hz", [14.0, 30.0])
def test_a_chair_at_1_m_s_is_never_flagged_at_a_camera_rate(rate_hz: float) -> None:
    frames = chair_at_1_m_s(int(1.8 * rate_hz), rate_hz)
    assert not any(r.tracks[0].verdict.is_moving for r in play("original", frames, rate_hz))
    assert all(r.tracks[0].verdict.is_moving for r in play("calibrated", frames, rate_hz))


def test_at_its_own_rate_a_chair_is_flagged_after_4_frames_and_unflagged_after_7() -> None:
    """At 4 Hz, with 1 m/s: standing for long, rolling for long, standing again; at 8 m it fits into the image."""
    step = FOCAL_PX / 8.0 / 4.0
    lefts = [20.0] * 40 + [20.0 + step * (k + 1) for k in range(29)] + [20.0 + step * 29] * 10
    flags = [r.tracks[0].verdict.is_moving for r in play("original", [[("chair", u, 8.0)] for u in lefts])]
    assert flags[40:].index(True) + 1 == 4
    assert flags[69:].index(False) + 1 == 7


# 6. A covariance that has nothing to do with the errors


def standing_still(sigma_m: float, frames: int, class_name: str, axes: Sequence[int]) -> tuple[FloatArray, list[Track]]:
    """Where a thing at rest is, and the beliefs about it from points with noise along some axes; without images."""
    rng = np.random.default_rng(0)
    truth, nowhere = np.array([0.0, 0.0, 2.0]), np.ones((1, 1, 1), bool)
    found = Detections(masks=nowhere, boxes_px=np.zeros((1, 4)), class_names=(class_name,), scores=np.ones(1))
    target, tracks = None, []
    for k in range(frames):
        point = truth.copy()
        point[list(axes)] += rng.normal(0, sigma_m, len(axes))
        seen = Observation(
            position_camera=point,
            covariance=R_M2,
            class_name=class_name,
            detection_index=0,
            mask=found.masks[0],
            model=CAMERA_POINT,
        )
        if target is None:
            target = original._initiate(seen, 0.0, STILL, 1)
        else:
            target = original._update(original._predict(target, STEP_S * k), seen, STILL)
        tracks.append(target.track)
    return truth, tracks


@pytest.mark.parametrize("sigma_m", [0.005, 0.02, 0.05])
def test_nees_and_nis_are_hundreds_of_times_too_small(sigma_m: float) -> None:
    truth, tracks = standing_still(sigma_m, 400, "chair", (0, 1, 2))
    errors = np.array([np.concatenate([t.position_world - truth, t.velocity_world]) for t in tracks])
    nees = [e @ np.linalg.solve(t.covariance, e) for e, t in zip(errors, tracks, strict=True)]
    assert np.mean(nees) <= 0.01  # 6 if consistent
    assert np.mean([t.innovation.nis for t in tracks[1:]]) <= 0.0075  # 3 if consistent
    assert np.sqrt(tracks[-1].covariance[0, 0]) == pytest.approx(0.50, abs=0.005)


def test_the_steady_filter_is_that_of_a_riccati_equation() -> None:
    """A second implementation: scipy's solution of the Riccati equation for one axis at a time."""
    _, tracks = standing_still(0.02, 300, "person", (0, 1, 2))
    F, H = np.array([[1.0, STEP_S], [0.0, 1.0]]), np.array([[1.0, 0.0]])
    Q = STEP_S**4 / 4 * np.ones((2, 2))
    Q[1, 1] = STEP_S**2
    for axis, variance in ((0, 0.8), (1, 0.8), (2, 1.2)):
        predicted = solve_discrete_are(F.T, H.T, Q, np.array([[variance]]))
        gain = predicted[:, 0] / (predicted[0, 0] + variance)
        np.testing.assert_allclose(tracks[-1].covariance[axis, axis], gain[0] * variance, rtol=1e-6)
        np.testing.assert_allclose(tracks[-1].covariance[axis + 3, axis], predicted[1, 0] * (1 - gain[0]), rtol=1e-6)


def test_process_noise_has_the_cross_term_of_the_papers_source() -> None:
    np.testing.assert_allclose(process_noise(2.0)[0], [4 * STEP_S**4 / 4, 0, 0, 8 * STEP_S**4 / 4, 0, 0])
    assert process_noise(2.0)[4, 4] == 4 * STEP_S**2
    np.testing.assert_array_equal(P0, np.eye(6))


# 7. A threshold inside the noise


@pytest.mark.parametrize(("sigma_m", "share"), [(0.02, 0.10), (0.05, 0.51)])
def test_a_person_at_rest_is_flagged_by_noise_along_one_axis(sigma_m: float, share: float) -> None:
    _, tracks = standing_still(sigma_m, 4000, "person", (0,))
    threshold = ORIGINAL.class_model("person").speed_threshold_m_s
    flagged = np.mean([np.abs(track.velocity_world).max() > threshold for track in tracks])
    assert flagged == pytest.approx(share, abs=0.04)


def test_the_threshold_is_on_each_axis_by_itself() -> None:
    """0.008 m/s along two axes is faster than 0.01 m/s, and not moving."""
    track = play("original", [[("person", 300.0, 2.0)]] * 2)[-1].tracks[0]
    for velocity, moves in (((0.008, 0.008, 0.0), False), ((0.0, 0.0, -0.011), True)):
        faster = replace(track, mean=np.array([0.0, 0.0, 2.0, *velocity]))
        assert original._verdict(faster, track).is_moving is moves


# 8. A deformation test that takes growth for deformation


def square(side: int) -> np.ndarray:
    mask = np.zeros((480, 640), bool)
    mask[60 : 60 + side, 80 : 80 + side] = True
    return mask


@pytest.mark.parametrize(("growth", "iou"), [(0.05, 0.907), (0.10, 0.826)])
def test_growth_lowers_the_iou(growth: float, iou: float) -> None:
    grown = square(round(200 * (1 + growth)))
    assert centred_iou(square(200), np.roll(grown, (31, 57), axis=(0, 1))) == pytest.approx(iou, abs=5e-4)


def test_masks_are_compared_with_their_boxes_centres_on_each_other() -> None:
    """A small square lies in the hole of a large frame, and touches it in no other place."""
    frame = square(60)
    frame[70:110, 90:130] = False
    assert centred_iou(square(20), frame) == 0.0


def test_iou_of_a_mask_with_itself_and_of_nothing() -> None:
    assert centred_iou(square(50), square(50)) == 1.0
    assert centred_iou(square(0), square(0)) == 0.0


# 9. First frames


def test_a_new_mover_reaches_odometry_in_its_first_frame() -> None:
    frames = [[person] for person in walk(3, step_px=60.0)]
    results = play("original", frames)
    assert [lost_px(result, things[0]) for result, things in zip(results, frames, strict=True)] == [0, 10000, 10000]
    assert results[0].tracks[0].verdict.reason is Reason.NEW
    assert lost_px(play("calibrated", frames, rate_hz=10.0)[0], frames[0][0]) == SIDE_PX**2


# 10. What it takes for an observation


def test_a_mask_without_depth_is_observed_at_the_camera() -> None:
    observed = play("original", [[("cup", 300.0, 0.0)]])[0]
    np.testing.assert_array_equal(observed.observations[0].position_camera, [0.0, 0.0, 0.0])
    assert len(observed.tracks) == 1
    assert play("calibrated", [[("cup", 300.0, 0.0)]])[0].observations == ()


def test_any_class_is_tracked_and_masked() -> None:
    result = play("original", [[("dog", 300.0, 2.0)]])[0]
    assert [track.class_name for track in result.tracks] == ["dog"]
    assert (result.masked.mdi_m[mask_of(("dog", 300.0, 2.0))] == 0).all()


def test_every_camera_has_the_same_intrinsics() -> None:
    """A thing on the axis of another camera is seen beside it."""
    other = Intrinsics(width=640, height=480, fx=300.0, fy=300.0, cx=400.0, cy=240.0)
    thing: Thing = ("cup", 350.0, 2.0)
    frame = frame_of([thing], 0, 4.0)
    frame = RgbdFrame(index=0, timestamp_s=0.0, rgb=frame.rgb, depth_m=frame.depth_m, intrinsics=other)
    segmenter = Playback()
    segmenter.things = [thing]
    x = OriginalDotMask(segmenter).step(frame, STILL).observations[0].position_camera[0]
    assert x == pytest.approx((399.5 - 319.5) / FOCAL_PX * 2.0)


def test_the_mask_grows_by_a_cross_of_one_pixel() -> None:
    result = play("original", [[CHAIR]])[0]
    gone = result.masked.mdi_m == 0
    assert np.count_nonzero(gone) == SIDE_PX**2 + 4 * SIDE_PX
    assert not gone[189, 449]


# The interface


def test_refining_with_the_same_pose_changes_nothing_and_before_the_first_frame_is_refused() -> None:
    segmenter = Playback()
    front_end = OriginalDotMask(segmenter)
    with pytest.raises(ValueError, match="no frame has been processed yet"):
        front_end.refine(STILL)
    for index, person in enumerate(walk(5)):
        segmenter.things = [person, CHAIR]
        stepped = front_end.step(frame_of(segmenter.things, index, 4.0), STILL)
    refined = front_end.refine(STILL)
    assert refined.masked is stepped.masked
    for one, other in zip(stepped.tracks, refined.tracks, strict=True):
        np.testing.assert_array_equal(one.mean, other.mean)
        assert one.verdict == other.verdict


def test_the_next_frame_starts_from_the_refined_beliefs() -> None:
    segmenter = Playback()
    front_end = OriginalDotMask(segmenter)
    segmenter.things = [CHAIR]
    front_end.step(frame_of([CHAIR], 0, 4.0), STILL)
    moved: FloatArray = np.eye(4)
    moved[0, 3] = 1.0
    refined = front_end.refine(moved).tracks[0]
    result = front_end.step(frame_of([CHAIR], 1, 4.0), moved)
    np.testing.assert_allclose(result.tracks[0].mean, refined.mean, atol=1e-9)


def test_the_pose_of_the_camera_carries_points_into_the_world() -> None:
    """A thing at rest seen from two poses: the update expects it where it is."""
    segmenter = Playback()
    front_end = OriginalDotMask(segmenter)
    there: FloatArray = np.eye(4)
    there[0, 3] = FOCAL_PX**-1 * 2.0 * 50.0
    for index, (left, pose) in enumerate(((300.0, STILL), (250.0, there))):
        segmenter.things = [("chair", left, 2.0)]
        result = front_end.step(frame_of(segmenter.things, index, 4.0), pose)
    np.testing.assert_allclose(result.tracks[0].innovation.residual, 0.0, atol=1e-6)
