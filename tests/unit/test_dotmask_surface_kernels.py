"""The compiled loops over surface points against the same in OpenCV and NumPy, whole images at a time."""

import cv2
import numpy as np
import pytest

from dotmask.tracking.surface_kernels import is_held, owners, steady_depth

SHAPE = (96, 128)


@pytest.mark.parametrize("border_px", [0, 2])
@pytest.mark.parametrize("seed", range(3))
def test_a_point_belongs_to_the_last_eroded_mask_that_holds_it(seed, border_px) -> None:
    rng = np.random.default_rng(seed)
    masks = np.array([cv2.GaussianBlur(rng.random(SHAPE), (0, 0), 6) > 0.49 for _ in range(3)])
    frames = np.array([(5, 50, 4, 40), (10, 60, 3, 44), (3, 30, 8, 40)])
    expected = np.full((SHAPE[0] // 2, SHAPE[1] // 2), -1)
    window = np.ones((2 * border_px + 1, 2 * border_px + 1), np.uint8)
    for d, (first, last, top, bottom) in enumerate(frames):
        part = masks[d, ::2, ::2][top : bottom + 1, first : last + 1].astype(np.uint8)
        inside = cv2.erode(part, window, borderType=cv2.BORDER_CONSTANT, borderValue=0)
        expected[top : bottom + 1, first : last + 1][inside > 0] = d
    v, u = np.mgrid[0 : SHAPE[0] // 2, 0 : SHAPE[1] // 2]
    pixels = np.stack([u.ravel(), v.ravel()], axis=1).astype(np.float32)
    jitter = rng.uniform(-0.49, 0.49, pixels.shape).astype(np.float32)
    found = owners(pixels + jitter, frames, masks, 2, border_px).reshape(expected.shape)
    np.testing.assert_array_equal(found, expected)
    assert set(np.unique(expected)) == {-1, 0, 1, 2}


def test_points_outside_of_the_image_belong_to_nothing() -> None:
    masks = np.ones((1, *SHAPE), bool)
    outside = np.array([[-1e6, 5], [5, -3], [900, 5], [5, 4e5]], np.float32)
    assert (owners(outside, np.array([[0, 63, 0, 47]]), masks, 2, 2) == -1).all()


def test_depth_is_the_mean_of_the_neighbours_on_the_same_surface() -> None:
    rng = np.random.default_rng(0)
    depth = (1.5 + rng.normal(0, 0.02, SHAPE)).astype(np.float32)
    depth[:, 64:] += 1.0
    depth[rng.random(SHAPE) < 0.3] = 0
    pixels = rng.uniform((1, 1), (126, 94), (500, 2))
    found = steady_depth(pixels, depth, 0.05, 5)
    for (u, v), z in zip(np.rint(pixels).astype(int), found, strict=True):
        around = depth[v - 1 : v + 2, u - 1 : u + 2].astype(float)
        same = around[(around > 0) & (np.abs(around - depth[v, u]) < 0.05)]
        assert z == pytest.approx(same.mean() if depth[v, u] > 0 and same.size >= 5 else 0.0, abs=1e-12)
    assert 0 < np.count_nonzero(found) < 500


def test_corners_hold_a_window_and_stripes_do_not() -> None:
    v, u = np.mgrid[0 : SHAPE[0], 0 : SHAPE[1]]
    stripes, squares = ((u // 5) % 2 * 200), (((u // 5) + (v // 5)) % 2 * 200)
    pixels = np.array([[40, 40], [60.4, 30.2], [2, 2], [126, 94]], np.float32)
    assert is_held(squares.astype(np.uint8), pixels, 5, 0.1).all()
    assert not is_held(stripes.astype(np.uint8), pixels, 5, 0.1).any()
    assert not is_held(stripes.T.copy().astype(np.uint8), pixels, 5, 0.1).any()
    assert not is_held(np.full(SHAPE, 90, np.uint8), pixels, 5, 0.1).any()
