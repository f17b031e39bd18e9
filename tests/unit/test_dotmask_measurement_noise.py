"""R against what the errors of quantised borders and depths are found to be, by drawing many of them."""

from dataclasses import replace

import numpy as np
import pytest

from dotmask.profiles import CALIBRATED, PAPER
from dotmask.tracking.measurement_kernels import mean_depth, sampled_depths
from dotmask.tracking.measurement_noise import (
    box_centre_variance,
    centroid_variance,
    mean_depth_variance,
    median_depth_variance,
)

NOISE = CALIBRATED.noise
V, U = np.mgrid[0:120, 0:120].astype(np.float64)


def discs(count, radius):
    rng = np.random.default_rng(3)
    centres = 60 + rng.uniform(-0.5, 0.5, (count, 2))
    return [(c, (U - c[0]) ** 2 + (V - c[1]) ** 2 <= radius**2) for c in centres]


def noisy(true_m, rng):
    """Depth as a structured-light camera gives it: Gaussian noise, then steps of the disparity."""
    sigma = 0.0012 + 0.0019 * (true_m - 0.4) ** 2
    steps = 1.0 / 0.00284
    return (steps / np.round(steps / (true_m + sigma * rng.normal(size=true_m.shape)))).astype(np.float32)


@pytest.mark.parametrize("radius", [18.3, 41.7])
def test_the_centre_of_a_box_errs_as_two_borders_on_the_pixel_grid(radius) -> None:
    errors = []
    for centre, mask in discs(800, radius):
        columns, rows = np.flatnonzero(mask.any(0)), np.flatnonzero(mask.any(1))
        errors.append([0.5 * (columns[0] + columns[-1]) - centre[0], 0.5 * (rows[0] + rows[-1]) - centre[1]])
    # One radius: the two borders are not independent, whole diameters err more than halves. 1/24 is the mean of those.
    spread = np.var(errors)
    assert 1 / 48 - 0.003 < spread < 1 / 12 + 0.003
    np.testing.assert_allclose(box_centre_variance(NOISE), 1 / 24, rtol=0.02)


def test_over_all_sizes_the_two_borders_are_independent() -> None:
    rng = np.random.default_rng(0)
    left, width = rng.uniform(100, 101, 20_000), rng.uniform(20, 60, 20_000)
    centre = 0.5 * (np.ceil(left) + np.floor(left + width))
    np.testing.assert_allclose(box_centre_variance(NOISE)[0], np.var(centre - (left + 0.5 * width)), rtol=0.05)


@pytest.mark.parametrize("radius", [12.0, 24.5, 41.7])
def test_the_mean_of_a_discs_pixels_errs_as_its_outline_does(radius) -> None:
    errors, predicted = [], []
    for centre, mask in discs(1500, radius):
        mean = np.array([U[mask].mean(), V[mask].mean()])
        errors.append(mean - centre)
        predicted.append(centroid_variance(mask, mean, float(mask.sum()), NOISE))
    # Gauss's circle problem: the error of one radius swings about the rule.
    assert np.mean(predicted) == pytest.approx(np.var(errors), rel=0.6)
    assert np.sqrt(np.mean(predicted)) < 0.06


def test_over_all_radii_the_rule_for_discs_is_right() -> None:
    rng = np.random.default_rng(1)
    ratio = []
    for radius in rng.uniform(15, 45, 150):
        for centre, mask in discs(8, radius):
            mean = np.array([U[mask].mean(), V[mask].mean()])
            ratio.append((mean - centre) / np.sqrt(centroid_variance(mask, mean, float(mask.sum()), NOISE)))
    assert np.var(ratio) == pytest.approx(1.0, abs=0.12)


@pytest.mark.parametrize("depth_m", [1.3, 2.4, 3.5])
def test_mean_and_median_of_many_depths_err_as_predicted(depth_m) -> None:
    rng = np.random.default_rng(2)
    fine = replace(NOISE, depth_rounding_m=0.0)
    mask, means, medians = np.ones((40, 40), bool), [], []
    for true_m in depth_m + rng.uniform(-0.1, 0.1, 1500):
        depth = noisy(np.full((40, 40), true_m), rng)
        pixels, mean, spread = mean_depth(sampled_depths(mask, depth, 1, 0.1, 9.0), 0.1, 9.0)
        means.append((mean - true_m) ** 2 / mean_depth_variance(true_m, spread, pixels, fine))
        middle = np.sort(depth.ravel())[800]
        medians.append((middle - true_m) ** 2 / median_depth_variance(true_m, 1600, fine))
    # The mean of 1500 squares of unit normals: 1 with a sigma of 0.037; the outline's share is a few percent.
    assert np.mean(means) == pytest.approx(1.0, abs=0.15)
    assert np.mean(medians) == pytest.approx(1.0, abs=0.15)


def test_a_deep_object_whose_outline_is_far_away_has_an_uncertain_mean() -> None:
    [(_, mask)] = discs(1, 41.7)
    noise, radius = replace(NOISE, depth_sigma_m=0.0, depth_sigma_per_m=0.0, depth_step_per_m=0.0), 0.2
    bowl = (2.0 + radius * ((U - 60) ** 2 + (V - 60) ** 2) / 41.7**2).astype(np.float32)
    errors = []
    for centre, disc in discs(800, 41.7):
        errors.append((2.0 + radius * ((U - centre[0]) ** 2 + (V - centre[1]) ** 2) / 41.7**2)[disc].mean())
    pixels, mean, spread = mean_depth(sampled_depths(mask, bowl, 1, 0.1, 9.0), 0.1, 9.0)
    one = mean_depth_variance(mean, spread, pixels, noise)
    # One radius: see Gauss's circle problem above.
    assert one == pytest.approx(np.var(errors), rel=0.6)


def test_without_averaging_the_depth_is_as_uncertain_as_that_of_one_pixel() -> None:
    expected = (0.02 + 0.0019 * 1.6**2) ** 2
    assert mean_depth_variance(2.0, 0.1, 1600, PAPER.noise) == pytest.approx(expected)
    assert median_depth_variance(2.0, 1600, PAPER.noise) == pytest.approx(expected)
