"""Overlap, motion and growth of masks against answers by hand, numpy and scipy."""

import numpy as np
import pytest
from scipy import ndimage

from dotmask.mask_geometry import (
    aligned_iou,
    bounding_rectangle,
    dilate,
    enclosing_rectangle,
    intersection_over_union,
    moved_mask,
)
from dotmask.records import Intrinsics

SHAPE = (120, 160)
CAMERA = Intrinsics(width=160, height=120, fx=100.0, fy=110.0, cx=79.5, cy=59.5)
NOTHING = np.zeros(SHAPE, bool)


def rectangle(u0, v0, u1, v1):
    """Corners inclusive."""
    mask = np.zeros(SHAPE, bool)
    mask[v0 : v1 + 1, u0 : u1 + 1] = True
    return mask


def ellipse(u, v, half_width, half_height):
    rows, columns = np.mgrid[0 : SHAPE[0], 0 : SHAPE[1]]
    return ((columns - u) / half_width) ** 2 + ((rows - v) / half_height) ** 2 <= 1


# ---- overlap ------------------------------------------------------------------------------------


@pytest.mark.parametrize("measure", [intersection_over_union, aligned_iou])
def test_iou_of_equal_masks_is_one_and_of_nothing_zero(measure) -> None:
    standing = ellipse(60, 50, 15, 40)
    assert measure(standing, standing) == 1.0
    assert measure(standing, NOTHING) == 0.0
    assert measure(NOTHING, standing) == 0.0
    assert measure(NOTHING, NOTHING) == 0.0


@pytest.mark.parametrize("seed", range(5))
def test_iou_counts_pixels(seed) -> None:
    rng = np.random.default_rng(seed)
    a, b = (ndimage.shift(rng.random(SHAPE) < 0.3, rng.integers(-60, 60, 2), order=0) for _ in range(2))
    expected = np.count_nonzero(a & b) / np.count_nonzero(a | b)
    assert intersection_over_union(a, b) == pytest.approx(expected, abs=1e-12)
    assert intersection_over_union(b, a) == intersection_over_union(a, b)


def test_iou_of_rectangles_by_hand() -> None:
    # 20 x 10 and 20 x 10, shifted by 5 and 4: 15 x 6 in common.
    assert intersection_over_union(rectangle(10, 10, 29, 19), rectangle(15, 14, 34, 23)) == 90 / (400 - 90)
    assert intersection_over_union(rectangle(10, 10, 29, 19), rectangle(40, 10, 59, 19)) == 0.0


def notched(width, height):
    """A rectangle of multiples of 4 with a quarter cut out of it."""
    shape = np.ones((height, width), bool)
    shape[: height // 2, : width // 2] = False
    return shape


def placed(shape, u, v):
    mask = np.zeros(SHAPE, bool)
    mask[v : v + shape.shape[0], u : u + shape.shape[1]] = shape
    return mask


@pytest.mark.parametrize(("u", "v"), [(0, 0), (17, 3), (120, 80)])
@pytest.mark.parametrize(("width", "height"), [(28, 32), (40, 40), (20, 20), (14, 32), (8, 40)])
def test_aligned_iou_does_not_change_with_place_and_size(u, v, width, height) -> None:
    first = placed(notched(28, 32), 50, 40)
    assert aligned_iou(first, placed(notched(width, height), u, v)) == 1.0
    # Against a whole rectangle the notch is a quarter, wherever and however large both are.
    assert aligned_iou(first, placed(np.ones((height, width), bool), u, v)) == 0.75
    assert aligned_iou(placed(np.ones((32, 28), bool), 50, 40), placed(notched(width, height), u, v)) == 0.75


@pytest.mark.parametrize("scale", [1.0, 1.05, 1.1, 1.3])
def test_aligned_iou_forgives_shift_and_scale_where_the_plain_one_does_not(scale) -> None:
    small, large = ellipse(40, 60, 20, 30), ellipse(80, 60, round(40 * scale) / 2, round(60 * scale) / 2)
    assert aligned_iou(small, large) > 0.94
    assert intersection_over_union(small, large) < 0.3


def test_aligned_iou_sees_a_lifted_arm() -> None:
    body = ellipse(60, 60, 12, 50)
    waving = body | rectangle(60, 30, 110, 36)
    assert aligned_iou(body, waving) < 0.5


def test_bounding_rectangle() -> None:
    assert bounding_rectangle(rectangle(3, 7, 12, 9)) == (3, 7, 10, 3)
    assert bounding_rectangle(NOTHING) == (0, 0, 0, 0)


@pytest.mark.parametrize(
    ("box_px", "expected"),
    [
        (None, (3, 7, 10, 3)),
        ((2, 6, 13, 9), (2, 6, 12, 4)),
        ((-5.5, 7, 12.4, 400), (0, 7, 13, SHAPE[0] - 7)),
        ((4, 7, 12, 9), (3, 7, 10, 3)),
        ((-9, -9, -4, -4), (3, 7, 10, 3)),
    ],
    ids=["none", "wider", "beyond_the_image", "too_narrow", "outside"],
)
def test_a_box_encloses_a_mask_only_if_it_holds_all_of_it(box_px, expected) -> None:
    box = None if box_px is None else np.array(box_px, float)
    assert enclosing_rectangle(rectangle(3, 7, 12, 9), box) == expected


# ---- motion -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("du", "dv"), [(0, 0), (12, -7), (-30, 25), (70, 0), (-200, 0), (0, 300)])
def test_a_sideways_motion_shifts_the_mask(du, dv) -> None:
    mask = ellipse(60, 50, 20, 30) & ~rectangle(50, 40, 60, 45)
    before = np.array([-0.3, 0.1, 2.0])
    now = before + np.array([du * 2.0 / CAMERA.fx, dv * 2.0 / CAMERA.fy, 0])
    expected = ndimage.shift(mask, (dv, du), order=0)
    np.testing.assert_array_equal(moved_mask(mask, before, now, CAMERA), expected)


@pytest.mark.parametrize("factor", [2, 3])
def test_half_the_distance_is_twice_the_size_about_the_projected_centre(factor) -> None:
    # The object's point projects to (79.5, 59.5), a corner of pixels: each pixel becomes a block.
    mask = ellipse(84, 55, 15, 12) & ~rectangle(80, 50, 83, 55)
    before, now = np.array([0, 0, 3.0]), np.array([0, 0, 3.0 / factor])
    rows, columns = np.mgrid[0 : SHAPE[0], 0 : SHAPE[1]]
    expected = mask[60 + (rows - 60) // factor, 80 + (columns - 80) // factor]
    np.testing.assert_array_equal(moved_mask(mask, before, now, CAMERA), expected)


def test_twice_the_distance_is_half_the_size() -> None:
    whole = rectangle(40, 20, 119, 99)  # 80 x 80 about the centre
    moved = moved_mask(whole, np.array([0, 0, 1.0]), np.array([0, 0, 2.0]), CAMERA)
    np.testing.assert_array_equal(moved, rectangle(60, 40, 99, 79))


@pytest.mark.parametrize("seed", range(8))
def test_a_moved_mask_is_the_inverse_mapping_of_every_pixel(seed) -> None:
    """Second implementation: each pixel of the answer looks up where it came from, by similar triangles."""
    rng = np.random.default_rng(seed)
    mask = ndimage.binary_dilation(rng.random(SHAPE) < 0.002, iterations=5)
    mask[:, :20] = mask[:25] = False
    before, now = rng.uniform([-0.5, -0.4, 1.5], [0.5, 0.4, 3]), rng.uniform([-0.5, -0.4, 1.2], [0.5, 0.4, 3.5])
    v, u = np.mgrid[0 : SHAPE[0], 0 : SHAPE[1]].astype(float)
    ratio = now[2] / before[2]
    focal, centre = np.array([CAMERA.fx, CAMERA.fy]), np.array([CAMERA.cx, CAMERA.cy])
    pixel_before, pixel_now = (focal * p[:2] / p[2] + centre for p in (before, now))
    from_u = np.floor(pixel_before[0] + ratio * (u - pixel_now[0]) + 0.5).astype(int)
    from_v = np.floor(pixel_before[1] + ratio * (v - pixel_now[1]) + 0.5).astype(int)
    is_inside = (from_u >= 0) & (from_u < SHAPE[1]) & (from_v >= 0) & (from_v < SHAPE[0])
    expected = np.zeros(SHAPE, bool)
    expected[is_inside] = mask[from_v[is_inside], from_u[is_inside]]
    np.testing.assert_array_equal(moved_mask(mask, before, now, CAMERA), expected)
    assert expected.any()


def test_out_of_the_image_nothing_is_left() -> None:
    mask, before = rectangle(60, 40, 90, 70), np.array([0, 0, 2.0])
    for now in ([9.0, 0, 2], [-9.0, 0, 2], [0, 9.0, 2], [0, -9.0, 2]):
        assert not moved_mask(mask, before, np.array(now), CAMERA).any()


@pytest.mark.parametrize("z", [-1.0, 0.0])
def test_behind_the_camera_nothing_is_left(z) -> None:
    mask, there = rectangle(60, 40, 90, 70), np.array([0.1, 0, 2.0])
    assert not moved_mask(mask, there, np.array([0.1, 0, z]), CAMERA).any()
    assert not moved_mask(mask, np.array([0.1, 0, z]), there, CAMERA).any()


def test_right_before_the_camera_it_fills_the_image() -> None:
    mask = rectangle(60, 40, 99, 79)
    assert moved_mask(mask, np.array([0, 0, 2.0]), np.array([0, 0, 1e-3]), CAMERA).all()


def test_nothing_stays_nothing_and_the_argument_stays_as_it_is() -> None:
    there = np.array([0, 0, 2.0])
    assert not moved_mask(NOTHING, there, there, CAMERA).any()
    mask = rectangle(60, 40, 90, 70)
    moved_mask(mask, there, np.array([0.2, 0, 1.5]), CAMERA)
    np.testing.assert_array_equal(mask, rectangle(60, 40, 90, 70))


# ---- growth -------------------------------------------------------------------------------------


@pytest.mark.parametrize("radius", [0, 1, 2, 4, 9])
def test_growth_is_a_disc_by_its_definition(radius) -> None:
    whole = dilate(rectangle(40, 30, 40, 30), radius)
    v, u = np.mgrid[0 : SHAPE[0], 0 : SHAPE[1]]
    distance = np.hypot(u - 40, v - 30)
    assert whole[distance <= max(radius - 0.5, 0)].all()
    assert not whole[distance > radius + 0.5].any()


@pytest.mark.parametrize("radius", [1, 3, 6])
@pytest.mark.parametrize("seed", range(3))
def test_growth_equals_scipys_with_the_same_disc(seed, radius) -> None:
    """Also at the image's border, where nothing comes in from outside."""
    rng = np.random.default_rng(seed)
    mask = rng.random(SHAPE) < 0.003
    mask[0, 5] = mask[-1, -1] = True
    disc = dilate(rectangle(40, 30, 40, 30), radius)[30 - radius : 31 + radius, 40 - radius : 41 + radius]
    expected = ndimage.binary_dilation(mask, structure=disc)
    np.testing.assert_array_equal(dilate(mask, radius), expected)


def test_growth_stops_at_the_image_border() -> None:
    whole = dilate(rectangle(0, 0, 3, 3), 4)
    assert whole[0, :8].all()
    assert whole[:8, 0].all()
    assert np.count_nonzero(whole) < 64


def test_nothing_grows_to_nothing() -> None:
    assert not dilate(NOTHING, 4).any()
