import itertools
from dataclasses import replace

import cv2
import numpy as np
import pytest

from dotmask.geometry import inverse, transform
from dotmask.mask_geometry import dilate, moved_mask
from dotmask.masking import Cutout, all_cutouts, choose_cutouts, growth_px, mask_depth
from dotmask.profiles import CALIBRATED, PAPER, MaskGrowth
from dotmask.records import Detections, Intrinsics, Reason, Track, TrackPhase, Verdict

SHAPE = (60, 80)
CAMERA = Intrinsics(width=80, height=60, fx=50.0, fy=50.0, cx=39.5, cy=29.5)
DEPTH = np.full(SHAPE, 2.0, np.float32)
SHARP = replace(CALIBRATED, growth=MaskGrowth(base_px=0.0))
STILL = np.zeros(3)


def rectangle(u0, v0, u1, v1):
    mask = np.zeros(SHAPE, bool)
    mask[v0 : v1 + 1, u0 : u1 + 1] = True
    return mask


LEFT, RIGHT = rectangle(5, 10, 20, 40), rectangle(40, 10, 60, 40)


def detect(*masks) -> Detections:
    return Detections(
        masks=np.array(masks, bool).reshape(-1, *SHAPE),
        boxes_px=np.zeros((len(masks), 4)),
        class_names=("person",) * len(masks),
        scores=np.ones(len(masks)),
    )


def track(index=None, *, moving=True, misses=0, mask=LEFT, phase=None, position=(0, 0, 2), velocity=(0, 0, 0)) -> Track:
    """Of detection `index`, or unseen; its mask was seen when it was at (0, 0, 2) in the camera frame."""
    return Track(
        track_id=1,
        class_name="person",
        timestamp_s=0.0,
        mean=np.array([*position, *velocity], float),
        covariance=np.eye(6),
        hits=9,
        misses=misses,
        phase=phase or (TrackPhase.CONFIRMED if misses == 0 else TrackPhase.COASTING),
        detection_index=index,
        mask=mask,
        mask_timestamp_s=0.0,
        mask_position_camera=np.array([0, 0, 2.0]),
        is_partial=False,
        verdict=Verdict(is_moving=moving, reason=Reason.SPEED, speed_m_s=1.0, mask_iou=None),
    )


def masked(detections, tracks, profile=SHARP, T_world_camera=None, camera_velocity=STILL):
    pose = np.eye(4) if T_world_camera is None else T_world_camera
    return mask_depth(DEPTH, choose_cutouts(detections, tracks, pose, camera_velocity, CAMERA, profile))


# ---- the two images -----------------------------------------------------------------------------


def test_mo_mdi_loses_the_movers_and_mdi_all() -> None:
    cutouts = [
        Cutout(mask=LEFT, radius_px=0, is_moving=False),
        Cutout(mask=RIGHT, radius_px=0, is_moving=True),
    ]
    answer = mask_depth(DEPTH, cutouts)
    np.testing.assert_array_equal(answer.mo_mdi_m, np.where(RIGHT, 0, DEPTH))
    np.testing.assert_array_equal(answer.mdi_m, np.where(LEFT | RIGHT, 0, DEPTH))
    assert (DEPTH == 2).all()


def test_each_mask_grows_by_its_own_radius() -> None:
    cutouts = [Cutout(mask=LEFT, radius_px=3, is_moving=True), Cutout(mask=RIGHT, radius_px=1, is_moving=True)]
    expected = np.zeros(SHAPE, bool)
    for cutout in cutouts:
        expected |= dilate(cutout.mask, cutout.radius_px)
    np.testing.assert_array_equal(mask_depth(DEPTH, cutouts).mo_mdi_m == 0, expected)
    assert not np.array_equal(expected, LEFT | RIGHT)


@pytest.mark.parametrize("radius_px", [0, 1, 2, 5, 12])
@pytest.mark.parametrize("with_box", [False, True])
def test_what_is_removed_is_the_mask_dilated_by_a_disc(radius_px, with_box) -> None:
    rng = np.random.default_rng(radius_px)
    mask = cv2.dilate((rng.random(SHAPE) < 0.002).astype(np.uint8), np.ones((3, 5))).astype(bool)
    mask[0, 7] = mask[-1, -1] = mask[30, 0] = True
    box = np.array([0, 0, SHAPE[1] - 1, SHAPE[0] - 1], float) if with_box else None
    answer = mask_depth(DEPTH, [Cutout(mask=mask, radius_px=radius_px, is_moving=False, box_px=box)])
    np.testing.assert_array_equal(answer.mdi_m == 0, dilate(mask, radius_px))
    np.testing.assert_array_equal(answer.mo_mdi_m, DEPTH)


def test_the_images_do_not_depend_on_the_order_of_cutouts() -> None:
    overlapping = [
        Cutout(mask=LEFT, radius_px=2, is_moving=False),
        Cutout(mask=rectangle(15, 20, 50, 30), radius_px=1, is_moving=True),
        Cutout(mask=RIGHT, radius_px=0, is_moving=False),
        Cutout(mask=rectangle(30, 25, 45, 50), radius_px=4, is_moving=True),
    ]
    first = mask_depth(DEPTH, overlapping)
    assert not np.array_equal(first.mo_mdi_m, first.mdi_m)
    for order in itertools.permutations(overlapping):
        answer = mask_depth(DEPTH, order)
        np.testing.assert_array_equal(answer.mo_mdi_m, first.mo_mdi_m)
        np.testing.assert_array_equal(answer.mdi_m, first.mdi_m)


def test_the_images_do_not_depend_on_the_order_of_detections_and_tracks() -> None:
    masks = [LEFT, RIGHT, rectangle(15, 30, 45, 50)]
    tracks = [track(0, moving=False), track(1, moving=True), track(2, moving=False), track(misses=2, mask=RIGHT)]
    first = masked(detect(*masks), tracks, CALIBRATED)
    for order in itertools.permutations(range(3)):
        place = {old: new for new, old in enumerate(order)}
        renamed = [
            t if t.detection_index is None else replace(t, detection_index=place[t.detection_index]) for t in tracks
        ]
        answer = masked(detect(*(masks[i] for i in order)), renamed[::-1], CALIBRATED)
        np.testing.assert_array_equal(answer.mo_mdi_m, first.mo_mdi_m)
        np.testing.assert_array_equal(answer.mdi_m, first.mdi_m)


def test_a_static_object_survives_whatever_its_place_in_the_list() -> None:
    masks, flags = [LEFT, RIGHT], [False, True]
    for order in ([0, 1], [1, 0]):
        tracks = [track(k, moving=flags[i]) for k, i in enumerate(order)]
        answer = masked(detect(*(masks[i] for i in order)), tracks)
        assert (answer.mo_mdi_m[LEFT] == 2).all()
        assert (answer.mo_mdi_m[RIGHT] == 0).all()


def test_all_cutouts_take_every_object_with_the_base_radius() -> None:
    cutouts = all_cutouts(detect(LEFT, RIGHT), replace(CALIBRATED, growth=MaskGrowth(base_px=2.4, margin_m=1.0)))
    assert [(c.radius_px, c.is_moving) for c in cutouts] == [(2, True), (2, True)]
    np.testing.assert_array_equal([c.mask for c in cutouts], [LEFT, RIGHT])


def test_a_detection_of_which_nothing_is_known_is_removed_as_if_it_moved() -> None:
    answer = masked(detect(LEFT, RIGHT), [track(1, moving=False)])
    np.testing.assert_array_equal(answer.mo_mdi_m == 0, LEFT)
    np.testing.assert_array_equal(answer.mdi_m == 0, LEFT | RIGHT)


def test_a_track_without_a_verdict_is_not_known_to_move() -> None:
    answer = masked(detect(LEFT), [replace(track(0), verdict=None)])
    np.testing.assert_array_equal(answer.mo_mdi_m, DEPTH)


# ---- unseen tracks ------------------------------------------------------------------------------


@pytest.mark.parametrize("misses", range(1, 13))
def test_a_walker_that_is_missed_is_cut_out_where_it_is_predicted_for_a_while(misses) -> None:
    """It walks at 1.2 m/s, 30 frames a second, 2 m before a camera with 50 px: a pixel per frame."""
    x = 1.2 * misses / 30
    unseen = track(misses=misses, position=(x, 0, 2), velocity=(1.2, 0, 0))
    answer = masked(detect(), [unseen], replace(SHARP, coasting_mask_frames=10))
    expected = np.roll(LEFT, misses, axis=1) if misses <= 10 else np.zeros(SHAPE, bool)
    np.testing.assert_array_equal(answer.mo_mdi_m == 0, expected)
    np.testing.assert_array_equal(answer.mdi_m == 0, expected)


def test_where_an_unseen_track_is_depends_on_the_camera() -> None:
    T = np.eye(4)
    T[:3, :3] = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]  # looks along the world's x
    T[:3, 3] = [1.0, 0.2, 0.5]
    unseen = track(misses=2, mask=RIGHT, position=(4.0, 0.1, 0.3))
    p_camera = transform(inverse(T), unseen.position_world)
    np.testing.assert_allclose(p_camera, [0.2, -0.1, 3.0], atol=1e-12)
    expected = moved_mask(RIGHT, np.array([0, 0, 2.0]), p_camera, CAMERA)
    assert expected.any()
    np.testing.assert_array_equal(masked(detect(), [unseen], T_world_camera=T).mo_mdi_m == 0, expected)


def test_tracks_that_are_tentative_or_idle_are_never_cut_out_where_nothing_is_seen() -> None:
    tentative = track(misses=1, phase=TrackPhase.TENTATIVE)
    idle = track(misses=1, moving=False)
    unknown = replace(track(misses=1), verdict=None)
    answer = masked(detect(), [tentative, idle, unknown])
    np.testing.assert_array_equal(answer.mo_mdi_m, DEPTH)
    np.testing.assert_array_equal(answer.mdi_m, DEPTH)


def test_the_paper_cuts_out_nothing_that_is_not_seen() -> None:
    np.testing.assert_array_equal(masked(detect(), [track(misses=1)], PAPER).mdi_m, DEPTH)


def test_a_track_that_was_seen_is_masked_by_its_detection_alone() -> None:
    answer = masked(detect(RIGHT), [track(0, moving=False, mask=LEFT)])
    np.testing.assert_array_equal(answer.mo_mdi_m, DEPTH)
    np.testing.assert_array_equal(answer.mdi_m == 0, RIGHT)


def test_a_track_behind_the_camera_is_not_cut_out() -> None:
    answer = masked(detect(), [track(misses=1, position=(0, 0, -1))], CALIBRATED)
    np.testing.assert_array_equal(answer.mdi_m, DEPTH)


# ---- growth -------------------------------------------------------------------------------------


@pytest.mark.parametrize("z", [0.5, 1.0, 2.0, 4.0])
@pytest.mark.parametrize(
    ("base", "margin", "delay", "velocity"),
    [
        (1.0, 0.0, 0.0, (5, 5, 5)),
        (3.0, 0.02, 0.0, (5, 5, 5)),
        (0.0, 0.0, 0.02, (0.3, 0.4, 9)),  # 0.5 m/s across, 1 cm in 20 ms; along the axis nothing shifts
        (3.0, 0.005, 0.01, (-1.2, 0.5, 0)),  # 1.3 m/s
    ],
)
def test_the_radius_is_the_base_and_what_margin_and_delay_are_in_pixels(z, base, margin, delay, velocity) -> None:
    growth = MaskGrowth(base_px=base, margin_m=margin, depth_delay_s=delay, most_px=100.0)
    expected = base + CAMERA.fx * (margin + delay * np.hypot(velocity[0], velocity[1])) / z
    radius = growth_px(np.array([0.3, 0, z]), np.array(velocity, float), CAMERA, growth)
    assert radius == round(expected)
    assert isinstance(radius, int)


@pytest.mark.parametrize("z", [0.3, 0.1, 0.0, -1.0])
def test_the_radius_is_bounded_however_near_the_object_is(z) -> None:
    growth = MaskGrowth(base_px=1.0, margin_m=0.06, nearest_m=0.3, most_px=30.0)
    assert growth_px(np.array([0, 0, z]), STILL, CAMERA, growth) == round(1 + 0.06 * 50 / 0.3)
    capped = replace(growth, most_px=7.0)
    assert growth_px(np.array([0, 0, z]), STILL, CAMERA, capped) == 7


def radii(tracks, profile, **arguments):
    pose = arguments.get("T_world_camera", np.eye(4))
    velocity = arguments.get("camera_velocity", STILL)
    return [c.radius_px for c in choose_cutouts(detect(LEFT), tracks, pose, velocity, CAMERA, profile)]


def test_what_counts_for_the_delay_is_how_the_object_moves_as_the_camera_sees_it() -> None:
    profile = replace(CALIBRATED, growth=MaskGrowth(base_px=1.0, depth_delay_s=0.1))
    across = [track(0, velocity=(0.8, 0, 0))]
    assert radii(across, profile) == [1 + 2]  # 8 cm at 2 m: 2 pixels
    assert radii(across, profile, camera_velocity=np.array([0.8, 0, 0])) == [1]
    assert radii(across, profile, camera_velocity=np.array([-0.8, 0, 0])) == [1 + 4]
    assert radii([track(0)], profile, camera_velocity=np.array([0, 1.6, 0])) == [1 + 4]
    # A camera that looks along the world's x sees it come nearer and not across.
    T = np.eye(4)
    T[:3, :3] = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]
    along = [track(0, position=(2, 0, 0), velocity=(0.8, 0, 0))]
    assert radii(along, profile, T_world_camera=T) == [1]
    assert radii([track(0, position=(2, 0, 0), velocity=(0, 0, 0.8))], profile, T_world_camera=T) == [1 + 2]


def test_without_a_track_a_mask_grows_by_the_base() -> None:
    profile = replace(CALIBRATED, growth=MaskGrowth(base_px=2.0, margin_m=1.0))
    assert radii([], profile, camera_velocity=np.ones(3)) == [2]


def test_an_unseen_track_grows_like_a_seen_one() -> None:
    profile = replace(CALIBRATED, growth=MaskGrowth(base_px=1.0, margin_m=0.04, depth_delay_s=0.1))
    unseen = track(misses=2, velocity=(0.8, 0, 0))
    [cutout] = choose_cutouts(detect(), [unseen], np.eye(4), STILL, CAMERA, profile)
    assert cutout.radius_px == 1 + 1 + 2
