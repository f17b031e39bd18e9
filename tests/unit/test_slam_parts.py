"""Matching, pose solver, local map, keyframes and settings, each on made-up numbers."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from dotmask.geometry import inverse, project, transform
from dotmask.records import Intrinsics
from dotmask.slam.features import Features
from dotmask.slam.keyframes import Keyframe, KeyframeStore
from dotmask.slam.local_map import LocalMap
from dotmask.slam.matching import match_anywhere, match_near, match_within_groups
from dotmask.slam.pose_solver import PoseSolver
from dotmask.slam.settings import OdometrySettings

CAMERA = Intrinsics(width=640, height=480, fx=520.0, fy=560.0, cx=310.0, cy=245.0)
SETTINGS = OdometrySettings()


def random_descriptors(rng: np.random.Generator, count: int) -> np.ndarray:
    return rng.integers(0, 256, (count, 32), dtype=np.uint8)


def features_at(pixels: np.ndarray, descriptors: np.ndarray) -> Features:
    return Features(pixels=pixels, descriptors=descriptors, depth_m=np.ones(len(pixels)))


def plain_matches(expected, descriptors, features, radius_px, max_hamming, ratio):
    """`match_near` by loops over all pairs."""
    offers = []
    for i in range(len(expected)):
        seen = []
        for j in range(len(features)):
            if np.abs(expected[i] - features.pixels[j]).max() <= radius_px:
                bits = np.unpackbits(descriptors[i] ^ features.descriptors[j]).sum()
                seen.append((int(bits), j))
        seen.sort()
        if seen and seen[0][0] <= max_hamming and (len(seen) == 1 or seen[0][0] < ratio * seen[1][0]):
            offers.append((seen[0][0], i, seen[0][1]))
    taken = {}
    for _, i, j in sorted(offers):
        taken.setdefault(j, i)
    return sorted((i, j) for j, i in taken.items())


@pytest.mark.parametrize("seed", range(4))
def test_matching_near_equals_loops_over_all_pairs(seed):
    rng = np.random.default_rng(seed)
    # Few distinct descriptors with some flipped bits, so that there are ties, rivals and refusals.
    kinds = random_descriptors(rng, 12)
    noisy = lambda count: kinds[rng.integers(0, 12, count)] ^ np.packbits(rng.random((count, 256)) < 0.04, axis=1)  # noqa: E731 a local formula
    features = features_at(rng.uniform(0, [640, 480], (150, 2)), noisy(150))
    expected, descriptors = rng.uniform(-60, [700, 540], (200, 2)), noisy(200)
    found = match_near(expected, descriptors, features, radius_px=45.0, max_hamming=60, ratio=0.9)
    wanted = plain_matches(expected, descriptors, features, 45.0, 60, 0.9)
    assert len(wanted) > 20
    assert [tuple(pair) for pair in found.tolist()] == wanted


@pytest.mark.parametrize("seed", range(4))
def test_matching_within_groups_equals_loops_over_all_pairs(seed):
    rng = np.random.default_rng(seed)
    kinds = random_descriptors(rng, 40)
    noise = lambda count: np.packbits(rng.random((count, 256)) < 0.04, axis=1)  # noqa: E731 a local formula
    a_kind, b_kind = rng.integers(0, 40, 60), rng.integers(0, 40, 80)
    a, b = kinds[a_kind] ^ noise(60), kinds[b_kind] ^ noise(80)
    a_group, b_group = (a_kind % 3).astype(np.intp), (b_kind % 3).astype(np.intp)
    a_group[:5], b_group[:5] = 7, 2  # what is alike may still be in different groups, and a group may be of one side

    bits = np.unpackbits(a[:, None] ^ b[None], axis=2).sum(axis=2).astype(int)
    bits[a_group[:, None] != b_group[None]] = 10**6
    wanted = []
    for i, j in np.ndindex(*bits.shape):
        row, column = np.sort(bits[i])[:2], np.sort(bits[:, j])[:2]
        is_best = bits[i, j] == row[0] == column[0] and bits[i, j] <= 30
        if is_best and row[0] < 0.8 * row[1] and column[0] < 0.8 * column[1]:
            wanted.append((i, j))
    found = match_within_groups(a, a_group, b, b_group, max_hamming=30, ratio=0.8)
    assert len(wanted) > 5
    assert [tuple(pair) for pair in found.tolist()] == wanted


def test_matching_takes_points_at_the_edge_of_the_window():
    descriptors = random_descriptors(np.random.default_rng(0), 1)
    features = features_at(np.array([[100.0, 100.0]]), descriptors)
    kwargs = {"radius_px": 20.0, "max_hamming": 10, "ratio": 0.8}
    assert len(match_near(np.array([[120.0, 80.0]]), descriptors, features, **kwargs)) == 1
    assert len(match_near(np.array([[120.1, 80.0]]), descriptors, features, **kwargs)) == 0


def test_matching_nothing_gives_nothing():
    nothing, one = features_at(np.zeros((0, 2)), np.zeros((0, 32), np.uint8)), np.zeros((1, 32), np.uint8)
    assert match_near(np.zeros((1, 2)), one, nothing, radius_px=9.0, max_hamming=50, ratio=0.8).shape == (0, 2)
    assert match_near(np.zeros((0, 2)), one[:0], nothing, radius_px=9.0, max_hamming=50, ratio=0.8).shape == (0, 2)
    assert match_anywhere(one, nothing, max_hamming=50, ratio=0.8).shape == (0, 2)


def test_matching_anywhere_finds_a_permutation():
    rng = np.random.default_rng(3)
    descriptors = random_descriptors(rng, 60)
    order = rng.permutation(60)
    found = match_anywhere(descriptors, features_at(np.zeros((60, 2)), descriptors[order]), max_hamming=50, ratio=0.8)
    np.testing.assert_array_equal(found, np.stack([np.arange(60), np.argsort(order)], axis=1))


def scene(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """`T_camera_world`, world points, and their exact pixels and depths."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(rng.normal(0, 0.5, 3)).as_matrix()
    T[:3, 3] = rng.normal(0, 1, 3)
    p_camera = rng.uniform([-1.5, -1.0, 1.5], [1.5, 1.0, 5.0], (count, 3))
    return T, transform(inverse(T), p_camera), project(p_camera, CAMERA), p_camera[:, 2].copy()


def test_pose_is_exact_among_outliers():
    rng = np.random.default_rng(5)
    T, p_world, pixels, depth = scene(rng, 200)
    pixels[:80] += rng.choice([-1, 1], (80, 2)) * rng.uniform(20, 200, (80, 2))
    solution = PoseSolver(CAMERA, SETTINGS).solve(p_world, pixels, depth)
    assert solution is not None
    np.testing.assert_array_equal(solution.inliers, np.arange(80, 200))
    np.testing.assert_allclose(solution.T_camera_world, T, atol=1e-9)


def test_wrong_depth_makes_an_outlier():
    T, p_world, pixels, depth = scene(np.random.default_rng(6), 100)
    depth[:10] += 1.0
    solution = PoseSolver(CAMERA, SETTINGS).solve(p_world, pixels, depth)
    assert solution is not None
    np.testing.assert_array_equal(solution.inliers, np.arange(10, 100))
    np.testing.assert_allclose(solution.T_camera_world, T, atol=1e-9)


def test_no_pose_from_noise_or_from_too_few():
    rng = np.random.default_rng(7)
    _, p_world, _, depth = scene(rng, 60)
    solver = PoseSolver(CAMERA, SETTINGS)
    assert solver.solve(p_world, rng.uniform(0, [640, 480], (60, 2)), depth) is None
    _, p_world, pixels, depth = scene(rng, SETTINGS.min_inliers - 1)
    assert solver.solve(p_world, pixels, depth) is None
    assert solver.solve(np.zeros((0, 3)), np.zeros((0, 2)), np.zeros(0)) is None


def test_refinement_is_the_least_squares_solution():
    rng = np.random.default_rng(8)
    T, p_world, pixels, depth = scene(rng, 120)
    solver = PoseSolver(CAMERA, OdometrySettings(huber=1e6))  # without the robust loss
    pixels = pixels + rng.normal(0, 0.5, pixels.shape)
    depth = depth + rng.normal(0, 1, depth.shape) * solver.depth_sigma(depth)

    def residuals(twist: np.ndarray) -> np.ndarray:
        moved = transform(T, p_world) @ Rotation.from_rotvec(twist[:3]).as_matrix().T + twist[3:]
        return np.concatenate(
            [(project(moved, CAMERA) - pixels).ravel(), (moved[:, 2] - depth) / solver.depth_sigma(depth)]
        )

    best = least_squares(residuals, np.zeros(6), xtol=1e-15, ftol=1e-15, gtol=1e-15).x
    start = T.copy()
    start[:3, 3] += 0.02
    refined = solver.refine(start, p_world, pixels, depth) @ inverse(T)
    np.testing.assert_allclose(Rotation.from_matrix(refined[:3, :3]).as_rotvec(), best[:3], atol=1e-7)
    np.testing.assert_allclose(refined[:3, 3], best[3:], atol=1e-7)


@pytest.mark.parametrize("outliers", [0, 15])
def test_covariance_is_that_of_the_errors(outliers):
    solver = PoseSolver(CAMERA, SETTINGS)
    rng = np.random.default_rng(11)
    nees = []
    for _ in range(150):
        T, p_world, pixels, depth = scene(rng, 300)
        # Noise of other sizes than the settings assume: the residuals must tell.
        pixels = pixels + rng.normal(0, 0.4, pixels.shape)
        depth = depth + 0.5 * rng.normal(0, 1, depth.shape) * solver.depth_sigma(depth)
        pixels[:outliers] += 40.0
        solution = solver.solve(p_world, pixels, depth)
        assert solution is not None
        error = solution.T_camera_world @ inverse(T)
        twist = np.concatenate([Rotation.from_matrix(error[:3, :3]).as_rotvec(), error[:3, 3]])
        nees.append(twist @ np.linalg.solve(solution.covariance, twist))
    # The mean of 150 values of chi-square with 6 degrees of freedom has a deviation of 0.28; a covariance that is
    # estimated from 300 matches adds some percent.
    assert 5.2 < np.mean(nees) < 7.1


def test_pixel_thresholds_scale_with_the_image():
    half = Intrinsics(width=320, height=240, fx=260.0, fy=280.0, cx=155.0, cy=122.5)
    _, p_world, pixels, depth = scene(np.random.default_rng(9), 100)
    pixels[:10, 0] += 4.0  # 2 pixels of the small image: within 2.5 x 1, not within 2.5 x 1/2
    small = np.stack([(pixels[:, 0] - 310) / 2 + 155, (pixels[:, 1] - 245) / 2 + 122.5], axis=1)
    solution = PoseSolver(half, SETTINGS).solve(p_world, small, depth)
    assert solution is not None
    np.testing.assert_array_equal(solution.inliers, np.arange(10, 100))


def test_local_map_keeps_the_latest_points_within_its_capacity():
    local_map = LocalMap(5, 20)
    local_map.add(np.arange(4.0)[:, None] * np.ones(3), np.zeros((4, 32), np.uint8), 0)
    local_map.observe(np.array([0, 3]), np.array([[0.0, 0, 0], [3.0, 3, 3]]), 1)
    local_map.add(np.array([10.0, 11, 12])[:, None] * np.ones(3), np.ones((3, 32), np.uint8), 2)
    assert local_map.p_world[:, 0].tolist() == [0, 3, 10, 11, 12]
    assert local_map.descriptors[:, 0].tolist() == [0, 0, 1, 1, 1]


def test_local_map_points_are_running_means_of_limited_depth():
    local_map = LocalMap(10, 3)
    local_map.add(np.zeros((1, 3)), np.zeros((1, 32), np.uint8), 0)
    wanted = 0.0
    for frame, (value, weight) in enumerate([(3.0, 1 / 2), (6.0, 1 / 3), (1.0, 1 / 3)], start=1):
        local_map.observe(np.array([0]), np.full((1, 3), value), frame)
        wanted += weight * (value - wanted)
    np.testing.assert_allclose(local_map.p_world, np.full((1, 3), wanted))


def add_keyframe(store: KeyframeStore, index: int, x_m: float) -> Keyframe | None:
    T = np.eye(4)
    T[0, 3] = x_m
    features = features_at(np.full((2, 2), 100.0), np.zeros((2, 32), np.uint8))
    return store.add(
        index, float(index), T, np.eye(6), features, np.zeros(2, np.intp), np.zeros((480, 640), np.float32)
    )


def test_keyframe_is_due_after_motion_or_rotation():
    store = KeyframeStore(CAMERA, SETTINGS)
    assert store.is_due(np.eye(4))
    add_keyframe(store, 0, 0.0)
    near, far, turned = np.eye(4), np.eye(4), np.eye(4)
    near[0, 3], far[0, 3] = 0.14, 0.16
    turned[:3, :3] = Rotation.from_rotvec([0, 0.16, 0]).as_matrix()
    assert not store.is_due(near)
    assert store.is_due(far)
    assert store.is_due(turned)


def test_most_redundant_keyframe_goes_first_and_both_ends_stay():
    store = KeyframeStore(CAMERA, OdometrySettings(max_keyframes=4))
    dropped = [add_keyframe(store, index, x_m) for index, x_m in enumerate([0.0, 1.0, 1.1, 2.0, 4.0])]
    assert [keyframe.number for keyframe in dropped if keyframe is not None] == [2]
    # Without 1 there is a gap of 1.1 m, without 2 of 1.0 m, without 3 of 2.9 m.
    assert [keyframe.frame_index for keyframe in store.keyframes] == [0, 1, 3, 4]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [({"features": 0}, "features"), ({"min_inliers": 5}, "min_inliers"), ({"max_keyframes": 2}, "max_keyframes")],
)
def test_settings_refuse_what_cannot_work(wrong, message):
    with pytest.raises(ValueError, match=message):
        OdometrySettings(**wrong)
