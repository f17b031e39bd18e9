"""The compiled loops of the measurement against the same in NumPy and SciPy, whole images at a time."""

import numpy as np
import pytest
from scipy import ndimage

from dotmask.tracking.measurement_kernels import hidden_objects, mean_depth, median_depth, sampled_depths

SHAPE = (60, 80)


def scene(seed):
    """A blob of a mask over noisy depth with holes."""
    rng = np.random.default_rng(seed)
    mask = ndimage.gaussian_filter(rng.random(SHAPE), 4) > 0.5
    depth = (2.0 + rng.normal(0, 0.3, SHAPE)).astype(np.float32)
    depth[rng.random(SHAPE) < 0.2] = 0.0
    return mask, depth


@pytest.mark.parametrize("step", [1, 2, 3])
@pytest.mark.parametrize("seed", range(4))
def test_median_and_mean_are_those_of_the_depths_under_the_mask(seed, step) -> None:
    mask, depth = scene(seed)
    under = np.where(mask & (depth >= 1.6) & (depth <= 2.7), depth, 0)[::step, ::step]
    samples = sampled_depths(mask, depth, step, 1.6, 2.7)
    np.testing.assert_array_equal(samples, under)
    for every in (1, 2):
        some = under[::every, ::every]
        median, count = median_depth(samples, every)
        assert count == np.count_nonzero(some)
        assert median == np.sort(some[some > 0])[count // 2]
    is_used = (under >= 1.7) & (under <= 2.5)
    pixels, mean, spread = mean_depth(samples, 1.7, 2.5)
    assert pixels == np.count_nonzero(is_used)
    assert mean == pytest.approx(under[is_used].mean(dtype=np.float64), abs=1e-9)
    outline = is_used & ~ndimage.binary_erosion(is_used)
    assert spread == pytest.approx(((under[outline].astype(float) - mean) ** 2).sum(), rel=1e-9)


def test_without_depth_there_is_neither() -> None:
    mask, depth = np.ones(SHAPE, bool), np.zeros(SHAPE, np.float32)
    samples = sampled_depths(mask, depth, 1, 0.1, 9.0)
    assert median_depth(samples, 1) == (0.0, 0)
    assert mean_depth(samples, 0.1, 9.0) == (0, 0.0, 0.0)


def box(u0, u1, v0, v1):
    """A mask that fills its crop; the stops are exclusive."""
    mask = np.zeros(SHAPE, bool)
    mask[v0:v1, u0:u1] = True
    return mask


def hidden(crops, depth, distances_m):
    masks = np.array([box(*crop) for crop in crops])
    seen = np.arange(len(crops))
    return hidden_objects(seen, np.array(crops), masks, depth, np.array(distances_m), 0.1, 1e6).tolist()


WALL_M, OBJECT_M = 4.0, 2.0


def room(*things):
    """Depth of a wall with things (crop, depth) before it."""
    depth = np.full(SHAPE, WALL_M, np.float32)
    for crop, z in things:
        depth[box(*crop)] = z
    return depth


ALONE = (30, 50, 20, 40)


def test_an_object_before_a_wall_is_whole() -> None:
    assert hidden([ALONE], room((ALONE, OBJECT_M)), [OBJECT_M]) == [False]


@pytest.mark.parametrize("crop", [(0, 20, 20, 40), (60, 80, 20, 40), (30, 50, 0, 20), (30, 50, 40, 60)])
def test_what_touches_the_border_of_the_image_may_go_on(crop) -> None:
    assert hidden([crop], room((crop, OBJECT_M)), [OBJECT_M]) == [True]


@pytest.mark.parametrize("crop", [(24, 30, 15, 45), (50, 56, 15, 45), (25, 55, 14, 20), (25, 55, 40, 46)])
@pytest.mark.parametrize(("occluder_m", "expected"), [(1.5, True), (1.95, False), (2.5, False)])
def test_something_nearer_at_any_side_hides_what_goes_on_behind_it(crop, occluder_m, expected) -> None:
    depth = room((crop, occluder_m), (ALONE, OBJECT_M))
    assert hidden([ALONE], depth, [OBJECT_M]) == [expected]


def test_a_post_that_covers_less_than_half_of_a_side_hides_nothing() -> None:
    assert hidden([ALONE], room(((24, 30, 15, 28), 1.0), (ALONE, OBJECT_M)), [OBJECT_M]) == [False]


def test_another_detection_hides_by_a_smaller_margin() -> None:
    beside = (50, 58, 15, 45)
    depth = room((beside, 1.95), (ALONE, OBJECT_M))
    assert hidden([ALONE], depth, [OBJECT_M]) == [False]
    assert hidden([ALONE, beside], depth, [OBJECT_M, 1.95])[0]


def test_a_detection_before_most_of_an_object_covers_it() -> None:
    front = (32, 50, 18, 42)
    depth = room((ALONE, OBJECT_M), (front, 1.5))
    assert hidden([ALONE, front], depth, [OBJECT_M, 1.5]) == [True, False]
    behind = room((ALONE, OBJECT_M), (front, 2.5))
    assert not hidden([front, ALONE], behind, [2.5, OBJECT_M])[1], "what lies farther away covers nothing"
