"""The judge of maps on worlds made by hand."""

import numpy as np
import pytest

from dotmask.evaluation.mapping import SurfaceSamples, map_errors, seen_samples, shows_ghost, surface_distances
from dotmask.records import Intrinsics


def floor_samples(spacing_m: float = 0.05) -> SurfaceSamples:
    x, y = np.meshgrid(np.arange(-1, 1.001, spacing_m), np.arange(-1, 1.001, spacing_m))
    points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    return SurfaceSamples(points_m=points, normals=np.tile([0.0, 0, 1], (x.size, 1)), spacing_m=spacing_m)


def test_distances_to_a_plane_are_exact_between_the_samples() -> None:
    points = np.random.default_rng(0).uniform(-0.9, 0.9, (500, 3)) * (1, 1, 0.03)
    assert surface_distances(points, floor_samples()) == pytest.approx(np.abs(points[:, 2]), abs=1e-12)


def test_distances_beyond_the_rim_are_off_by_no_more_than_the_spacing() -> None:
    off = surface_distances(np.array([[1.5, 0.0, 0.0], [1.3, 0.0, 0.4]]), floor_samples())
    assert off == pytest.approx([0.5, 0.5], abs=0.0501)
    assert (off > 0.44).all()


def test_ghosts_are_pixels_of_actors_and_what_stands_in_front_of_the_empty_world() -> None:
    static = np.full((30, 60), 3.0, np.float32)
    depth, is_actor = static.copy(), np.zeros((30, 60), np.bool_)
    is_actor[5:15, 10:20] = True
    depth[5:15, 10:22] = 1.5  # the depth is of a later moment: the actor has moved on by two pixels
    depth[5:15, 10:12] = 3.0
    depth[20, 40] = 2.85  # noise
    depth[0, 0] = 0.0
    ghost = shows_ghost(depth, is_actor, static)
    expected = np.zeros((30, 60), np.bool_)
    expected[5:15, 10:22] = True
    assert (ghost == expected).all()


def test_a_pixel_beside_an_edge_of_the_static_world_is_no_ghost() -> None:
    static = np.full((30, 60), 3.0, np.float32)
    static[:, 30:] = 1.0
    depth = static.copy()
    depth[:, 28:30] = 1.0  # the sensor errs by two pixels
    assert not shows_ghost(depth, np.zeros((30, 60), np.bool_), static).any()
    depth[:, 10] = 1.0
    assert shows_ghost(depth, np.zeros((30, 60), np.bool_), static)[:, 10].all()


CAMERA = Intrinsics(width=80, height=60, fx=60.0, fy=60.0, cx=39.5, cy=29.5)


def above(z_m: float, upwards: bool = False) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = np.eye(3) if upwards else np.diag([1.0, -1.0, -1.0])
    T[2, 3] = z_m
    return T


def test_what_is_seen_is_in_the_image_in_range_facing_and_not_hidden() -> None:
    samples = floor_samples()
    depth = np.full((60, 80), 2.0, np.float32)
    depth[:, :20] = 1.0  # a box hides the left
    seen = seen_samples(samples, depth, CAMERA, above(2.0), (0.4, 3.0))
    u = 60.0 * samples.points_m[:, 0] / 2.0 + 39.5
    v = -60.0 * samples.points_m[:, 1] / 2.0 + 29.5
    assert (seen == ((np.rint(u) >= 20) & (np.rint(v) >= 0) & (np.rint(v) < 60))).all()
    assert not seen_samples(samples, depth, CAMERA, above(2.0), (0.4, 1.9)).any(), "out of range"
    below = seen_samples(samples, depth, CAMERA, above(-2.0, upwards=True), (0.4, 3.0))
    assert not below.any(), "the back of the surface"


def test_a_map_of_half_a_floor_and_a_ghost() -> None:
    samples = floor_samples(0.02)
    rng = np.random.default_rng(1)
    left = rng.uniform([-1, -1, 0.01], [0, 1, 0.01], (20000, 3))
    ghost = np.tile([0.6, 0.0, 0.0], (5000, 1))  # would complete the floor if it counted
    errors = map_errors(
        np.concatenate([left, ghost]),
        np.arange(25000) >= 20000,
        samples,
        np.ones(len(samples.points_m), np.bool_),
    )
    assert errors.points == 25000
    assert errors.ghost_fraction == pytest.approx(0.2)
    assert errors.accuracy_m == pytest.approx(0.01)
    assert errors.accuracy_median_m == pytest.approx(0.01)
    reach = np.sqrt(0.05**2 - 0.01**2)
    assert errors.completeness == pytest.approx((1 + reach) / 2, abs=0.01)


def test_an_empty_map_has_no_accuracy_and_completes_nothing() -> None:
    samples = floor_samples()
    everything = np.ones(len(samples.points_m), np.bool_)
    errors = map_errors(np.empty((0, 3)), np.empty(0, np.bool_), samples, everything)
    assert (errors.points, errors.ghost_fraction, errors.accuracy_m, errors.completeness) == (0, None, None, 0.0)
    assert map_errors(np.zeros((1, 3)), np.zeros(1, np.bool_), samples, ~everything).completeness is None
