from dataclasses import replace

import numpy as np
import pytest

from dotmask.profiles import CALIBRATED, PAPER
from dotmask.records import Detections, Intrinsics, RgbdFrame
from dotmask.tracking.measurement import observe

CAMERA = Intrinsics(width=320, height=240, fx=260.0, fy=270.0, cx=159.5, cy=119.5)


def frame(depth_m) -> RgbdFrame:
    size = (CAMERA.height, CAMERA.width)
    return RgbdFrame(index=0, timestamp_s=0.0, rgb=np.zeros((*size, 3), np.uint8), depth_m=depth_m, intrinsics=CAMERA)


def wall(depth_m=5.0):
    return np.full((CAMERA.height, CAMERA.width), depth_m, np.float32)


def rectangle(u0, v0, u1, v1):
    mask = np.zeros((CAMERA.height, CAMERA.width), bool)
    mask[v0 : v1 + 1, u0 : u1 + 1] = True
    return mask


def detect(*masks, class_name="chair") -> Detections:
    boxes = [[*np.argwhere(m).min(0)[::-1], *np.argwhere(m).max(0)[::-1]] for m in masks]
    return Detections(
        masks=np.array(masks),
        boxes_px=np.array(boxes, float),
        class_names=(class_name,) * len(masks),
        scores=np.ones(len(masks)),
    )


def sigmas(observation):
    return np.sqrt(np.diag(observation.covariance))


def test_position_is_the_box_centre_at_the_mean_of_the_valid_depths() -> None:
    rng = np.random.default_rng(0)
    depth = wall()
    mask = rectangle(100, 60, 160, 150) & (rng.random(depth.shape) < 0.7)
    mask[60, 100] = mask[150, 160] = True
    depth[mask] = rng.uniform(1.8, 2.4, mask.sum())
    depth[mask & (rng.random(depth.shape) < 0.2)] = 0
    [seen] = observe(detect(mask), frame(depth), PAPER)
    z = depth[mask & (depth > 0)].mean(dtype=np.float64)
    expected = [(130 - 159.5) * z / 260, (105 - 119.5) * z / 270, z]
    np.testing.assert_allclose(seen.position_camera, expected, rtol=0, atol=1e-6)
    assert (seen.class_name, seen.detection_index) == ("chair", 0)


def test_a_detection_without_depth_gives_no_observation() -> None:
    depth = wall()
    lost, found = rectangle(10, 20, 60, 90), rectangle(100, 60, 160, 150)
    depth[lost], depth[found] = 0, 2
    assert [o.detection_index for o in observe(detect(lost, found), frame(depth), PAPER)] == [1]


def test_too_few_valid_pixels_give_no_observation_where_the_profile_asks_for_more() -> None:
    depth, mask = wall(), rectangle(100, 60, 160, 150)
    depth[mask] = 0
    depth[70, 100 : 99 + CALIBRATED.min_depth_pixels] = 2
    assert len(observe(detect(mask), frame(depth), PAPER)) == 1
    assert observe(detect(mask), frame(depth), CALIBRATED) == ()


@pytest.mark.parametrize("z", [0.8, 2.0, 4.0])
def test_paper_covariance_is_the_sensors(z) -> None:
    depth, mask = wall(8.0), rectangle(100, 60, 160, 150)
    depth[mask] = z
    [seen] = observe(detect(mask), frame(depth), PAPER)
    expected = [4 * z / 260, 4 * z / 270, 0.02 + 0.0019 * (z - 0.4) ** 2]
    np.testing.assert_allclose(seen.covariance, np.diag(np.square(expected)), rtol=1e-5, atol=1e-15)


def test_calibrated_covariance_couples_depth_and_sideways_off_the_axis() -> None:
    depth, mask = wall(8.0), rectangle(20, 60, 80, 150)
    depth[mask] = 3.0
    rigid = replace(CALIBRATED.class_model("chair"), shape_sigma_m=(0.0, 0.0, 0.0))
    noise = replace(CALIBRATED.noise, pose_position_sigma_m=0.0, pose_rotation_sigma_rad=0.0)
    [seen] = observe(detect(mask), frame(depth), replace(CALIBRATED, classes=(rigid,), noise=noise))
    slope = (50 - 159.5) / 260
    depth_variance = seen.covariance[2, 2]
    assert depth_variance > 0
    assert seen.covariance[0, 2] == pytest.approx(slope * depth_variance, rel=1e-6)


def test_an_uncertain_turn_of_the_camera_moves_a_point_across_its_ray() -> None:
    depth, mask = wall(8.0), rectangle(20, 60, 80, 150)
    depth[mask] = 3.0
    turning = replace(CALIBRATED, noise=replace(CALIBRATED.noise, pose_rotation_sigma_rad=0.01))
    still = replace(CALIBRATED, noise=replace(CALIBRATED.noise, pose_rotation_sigma_rad=0.0))
    [turned], [seen] = observe(detect(mask), frame(depth), turning), observe(detect(mask), frame(depth), still)
    added, p = turned.covariance - seen.covariance, seen.position_camera
    # Turns by w shift p by w x p: as far as sqrt(2) |p| sigma in all, and not at all along p.
    assert np.trace(added) == pytest.approx(2 * 0.01**2 * p @ p, rel=1e-6)
    assert abs(p @ added @ p) < 1e-12


def test_trimmed_mean_ignores_a_mask_that_leaks_onto_the_wall() -> None:
    depth, mask = wall(6.0), rectangle(100, 60, 160, 150)
    depth[rectangle(100, 60, 150, 150)] = 2.0
    [plain], [trimmed] = (observe(detect(mask), frame(depth), p) for p in (PAPER, CALIBRATED))
    assert plain.position_camera[2] > 2.5
    assert trimmed.position_camera[2] == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("box", "is_partial"),
    [
        ((235, 40, 319, 175), True),
        ((0, 40, 84, 175), True),
        ((100, 0, 184, 135), True),
        ((100, 100, 184, 239), True),
        ((100, 40, 184, 175), False),
        ((10, 10, 309, 229), False),
    ],
    ids=["right", "left", "top", "bottom", "in the middle", "nearly the whole image"],
)
def test_the_image_border_marks_the_observation_as_partial(box, is_partial) -> None:
    depth, mask = wall(8.0), rectangle(*box)
    depth[mask] = 2.0
    [seen] = observe(detect(mask), frame(depth), CALIBRATED)
    assert seen.is_partial == is_partial
    assert not observe(detect(mask), frame(depth), PAPER)[0].is_partial, "the paper does not look"


@pytest.mark.parametrize("is_detected", [False, True], ids=["by something unknown", "by another detection"])
@pytest.mark.parametrize("side", ["left", "right", "top", "bottom"])
def test_an_occluder_marks_the_observation_as_partial_and_leaves_its_covariance(side, is_detected) -> None:
    depth, whole = wall(8.0), rectangle(100, 40, 184, 175)
    occluder = {
        "left": rectangle(60, 20, 130, 200),
        "right": rectangle(140, 20, 230, 200),
        "top": rectangle(60, 10, 230, 90),
        "bottom": rectangle(60, 120, 230, 220),
    }[side]
    depth[whole] = 2.5
    depth[occluder] = 2.45 if is_detected else 1.5
    visible = whole & ~occluder
    detections = detect(visible, occluder) if is_detected else detect(visible)
    seen = observe(detections, frame(depth), CALIBRATED)[0]
    alone = wall(8.0)
    alone[visible] = 2.5
    [free] = observe(detect(visible), frame(alone), CALIBRATED)
    assert (seen.is_partial, free.is_partial) == (True, False)
    np.testing.assert_allclose(seen.covariance, free.covariance, rtol=1e-6)
    [in_front] = observe(detect(occluder), frame(depth), CALIBRATED)
    assert not in_front.is_partial


@pytest.mark.parametrize("reach", [0.3, 0.7])
def test_a_side_is_hidden_if_most_of_it_ends_behind_something(reach) -> None:
    depth, mask = wall(8.0), rectangle(100, 40, 184, 175)
    depth[mask] = 2.5
    depth[rectangle(185, 40, 230, 40 + round(reach * 136))] = 1.5
    [seen] = observe(detect(mask), frame(depth), CALIBRATED)
    assert seen.is_partial == (reach > 0.5)


@pytest.mark.parametrize(("columns", "other_m", "is_partial"), [(50, 1.5, True), (40, 1.5, False), (50, 2.6, False)])
def test_an_object_that_another_nearer_detection_covers_more_than_it_shows_itself_is_partial(
    columns, other_m, is_partial
) -> None:
    """Of 85 columns, the middle ones are another's: its sides are all to be seen."""
    depth, whole = wall(8.0), rectangle(100, 40, 184, 175)
    before = rectangle(120, 40, 119 + columns, 175)
    depth[whole] = 2.5
    depth[before] = other_m
    seen = observe(detect(whole & ~before, before), frame(depth), CALIBRATED)[0]
    assert seen.is_partial == is_partial


def test_what_is_behind_hides_nothing() -> None:
    depth, mask = wall(8.0), rectangle(100, 40, 184, 175)
    depth[rectangle(60, 20, 230, 200)] = 2.7
    depth[mask] = 2.5
    [seen] = observe(detect(mask), frame(depth), CALIBRATED)
    assert not seen.is_partial


def test_an_observation_carries_the_mask_of_its_detection() -> None:
    depth, one, other = wall(8.0), rectangle(10, 20, 60, 90), rectangle(100, 60, 160, 150)
    depth[one | other] = 2.0
    masks = [o.mask for o in observe(detect(one, other), frame(depth), CALIBRATED)]
    np.testing.assert_array_equal(masks, [one, other])


def test_the_floor_before_an_objects_feet_is_no_occluder() -> None:
    v = np.arange(CAMERA.height)[:, None]
    floor = np.where(v > 125, 1.2 * 270 / np.maximum(v - 119.5, 1), 8.0)  # camera 1.2 m above the floor
    depth = np.minimum(np.broadcast_to(floor, (240, 320)), 8.0).astype(np.float32)
    mask = rectangle(120, 40, 190, 119 + round(1.2 * 270 / 3.0))
    depth[mask] = 3.0
    [seen] = observe(detect(mask), frame(depth), CALIBRATED)
    assert not seen.is_partial


def test_a_walking_person_is_noisier_than_a_chair() -> None:
    depth, mask = wall(8.0), rectangle(110, 20, 180, 200)
    depth[mask] = 2.5
    [chair] = observe(detect(mask), frame(depth), CALIBRATED)
    [person] = observe(detect(mask, class_name="person"), frame(depth), CALIBRATED)
    assert (sigmas(person) > sigmas(chair)).all()


def test_boxes_that_reach_over_the_image_are_clipped() -> None:
    depth, mask = wall(), rectangle(0, 0, 50, 239)
    depth[mask] = 2.0
    detections = replace(detect(mask), boxes_px=np.array([[-3.5, -2.0, 50.4, 245.0]]))
    [seen] = observe(detections, frame(depth), CALIBRATED)
    assert seen.position_camera[2] == pytest.approx(2.0)
    assert seen.is_partial


def test_nothing_detected_nothing_observed() -> None:
    empty = Detections(
        masks=np.zeros((0, 240, 320), bool), boxes_px=np.zeros((0, 4)), class_names=(), scores=np.zeros(0)
    )
    assert observe(empty, frame(wall()), CALIBRATED) == ()


def test_an_object_with_depth_on_a_third_of_its_pixels_is_still_measured() -> None:
    depth, mask = wall(8.0), rectangle(100, 60, 160, 150)
    depth[mask] = 0
    depth[rectangle(100, 60, 120, 150)] = 2.0
    [seen] = observe(detect(mask), frame(depth), CALIBRATED)
    assert seen.position_camera[2] == pytest.approx(2.0)
