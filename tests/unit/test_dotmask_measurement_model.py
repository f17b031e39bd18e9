"""What is measured of a point in the camera frame, and the filter with a measurement that is not linear."""

from dataclasses import replace

import numpy as np
import pytest

from dotmask.geometry import inverse, transform
from dotmask.profiles import PAPER
from dotmask.records import Intrinsics, Observation, Track
from dotmask.tracking.association import squared_mahalanobis
from dotmask.tracking.ekf import initiate, innovate, measurement_jacobian, update
from dotmask.tracking.measurement_model import CAMERA_POINT, PixelDepth
from dotmask.tracking.motion_model import predict

CAMERA = Intrinsics(width=640, height=480, fx=535.4, fy=539.2, cx=320.1, cy=247.6)
PIXEL_DEPTH = PixelDepth(intrinsics=CAMERA)
POINTS = np.array([[0.3, -0.2, 2.0], [-1.1, 0.4, 3.7], [0.05, 0.9, 0.6]])
MASK = np.ones((4, 4), bool)


def pose(seed: int) -> np.ndarray:
    generator = np.random.default_rng(seed)
    Q, _ = np.linalg.qr(generator.normal(size=(3, 3)))
    T = np.eye(4)
    T[:3, :3] = Q * np.sign(np.linalg.det(Q))
    T[:3, 3] = generator.normal(size=3)
    return T


def test_pixel_and_depth_of_a_point() -> None:
    u, v, z = PIXEL_DEPTH.measured(POINTS)[0]
    assert (u, v, z) == pytest.approx((535.4 * 0.15 + 320.1, -539.2 * 0.1 + 247.6, 2.0))


@pytest.mark.parametrize("model", [PIXEL_DEPTH, CAMERA_POINT])
def test_the_jacobian_is_the_derivative(model: PixelDepth) -> None:
    step = 1e-6
    for k in range(3):
        shift = step * np.eye(3)[k]
        slope = (model.measured(POINTS + shift) - model.measured(POINTS - shift)) / (2 * step)
        np.testing.assert_allclose(model.jacobian(POINTS)[..., k], slope, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_the_filters_jacobian_is_the_derivative_of_h_in_the_world(seed: int) -> None:
    T_world_camera = pose(seed)
    R_world_camera, t = T_world_camera[:3, :3], T_world_camera[:3, 3]
    p_world = R_world_camera @ POINTS[0] + t
    H = measurement_jacobian(POINTS[0], PIXEL_DEPTH, T_world_camera)

    def h(p: np.ndarray) -> np.ndarray:
        return PIXEL_DEPTH.measured(R_world_camera.T @ (p - t))

    step = 1e-6
    slopes = [(h(p_world + step * e) - h(p_world - step * e)) / (2 * step) for e in np.eye(3)]
    np.testing.assert_allclose(H[:, :3], np.array(slopes).T, rtol=1e-5, atol=1e-5)
    np.testing.assert_array_equal(H[:, 3:], 0.0)


def test_a_point_behind_the_camera_has_finite_numbers() -> None:
    behind = np.array([[0.2, 0.1, -1.0], [0.0, 0.0, 0.0]])
    assert np.isfinite(PIXEL_DEPTH.measured(behind)).all()
    assert np.isfinite(PIXEL_DEPTH.jacobian(behind)).all()


def seen_at(p_camera, model: PixelDepth, R: np.ndarray) -> Observation:
    return Observation(
        position_camera=np.asarray(p_camera, float),
        covariance=R,
        class_name="person",
        detection_index=0,
        mask=MASK,
        model=model,
    )


def somewhere_else(p_camera, sigma_m: float, T_world_camera: np.ndarray) -> Track:
    """A track that is believed to be at a point of the camera frame, `sigma_m` uncertain, whatever is seen."""
    born = initiate(seen_at([0, 0, 2.0], CAMERA_POINT, np.eye(3)), 0.0, T_world_camera, PAPER, 1)
    mean = np.concatenate([transform(T_world_camera, np.asarray(p_camera, float)), np.zeros(3)])
    return replace(born, mean=mean, covariance=np.diag([sigma_m**2] * 3 + [1.0] * 3))


FAR_OFF = {
    "behind the camera": [0.4, 0.1, -1.5],
    "in the camera": [0.0, 0.0, 0.0],
    "right before the camera": [0.1, 0.0, 0.06],
    "200 m off": [30.0, -10.0, 200.0],
    "200 m aside": [200.0, 0.0, 2.2],
}


@pytest.mark.parametrize("where", FAR_OFF)
@pytest.mark.parametrize("seed", range(3))
def test_a_track_that_is_far_off_comes_to_what_is_seen(where: str, seed: int) -> None:
    """Taken as linear around such a prediction, pixels would throw it anywhere."""
    T, seen = pose(seed), np.array([0.3, -0.2, 2.0])
    track = somewhere_else(FAR_OFF[where], 50.0, T)
    observation = seen_at(seen, PIXEL_DEPTH, np.diag([1.0, 1.0, 0.01]) ** 2)
    errors = []
    for k in range(12):
        track = update(predict(track, 0.05 * (k + 1), PAPER), observation, None, T, PAPER)
        errors.append(np.linalg.norm(transform(inverse(T), track.position_world) - seen))
        assert (np.linalg.eigvalsh(track.covariance) > 0).all()
    assert errors[-1] < 0.05
    assert max(errors) <= np.linalg.norm(np.subtract(FAR_OFF[where], seen)), "never farther than it began"


def test_beliefs_stay_positive_definite_whatever_is_seen_and_however_long_ago() -> None:
    """400 runs: sigmas of R from 1e-4 to 1 (pixels, metres) and 1 ms to 100 s between the frames."""
    for seed in range(400):
        rng = np.random.default_rng(seed)
        T = pose(seed)

        def somewhere(rng: np.random.Generator = rng) -> np.ndarray:
            return rng.uniform([-3.0, -2.0, 0.3], [3.0, 2.0, 8.0])

        R = [10.0 ** rng.uniform(-8, 0) * np.eye(3) for _ in range(12)]
        track = initiate(seen_at(somewhere(), PIXEL_DEPTH, R[0]), 0.0, T, PAPER, 1)
        for covariance in R[1:]:
            track = predict(track, track.timestamp_s + 10.0 ** rng.uniform(-3, 2), PAPER)
            track = update(track, seen_at(somewhere(), PIXEL_DEPTH, covariance), None, T, PAPER)
            assert np.isfinite(track.mean).all(), seed
            np.testing.assert_array_equal(track.covariance, track.covariance.T)
            assert (np.linalg.eigvalsh(track.covariance) > 0).all(), seed


@pytest.mark.parametrize("z", [-1.0, 0.9, 1.1, 2.5, 3.9, 4.1, 200.0])
def test_the_place_of_linearisation_is_the_prediction_where_that_is_sensible_and_else_what_is_seen(z: float) -> None:
    """The same line of the camera frame, with the prediction at `z` and the observation at 2 m."""
    T, seen, predicted = pose(3), np.array([0.3, -0.2, 2.0]), np.array([0.25, -0.1, z])
    track = somewhere_else(predicted, 0.1, T)
    innovation, H = innovate(track, seen_at(seen, PIXEL_DEPTH, np.eye(3)), T)
    at_prediction = 1.0 < z < 4.0
    expected_H = measurement_jacobian(predicted if at_prediction else seen, PIXEL_DEPTH, T)
    np.testing.assert_allclose(H, expected_H, rtol=1e-9, atol=1e-9)
    plain = PIXEL_DEPTH.measured(seen) - PIXEL_DEPTH.measured(predicted)
    linear = PIXEL_DEPTH.jacobian(seen) @ (seen - predicted)
    np.testing.assert_allclose(innovation.residual, plain if at_prediction else linear, rtol=1e-9, atol=1e-8)
    assert not np.allclose(plain, linear)
    # What is linear everywhere is the same from everywhere.
    innovation, H = innovate(track, seen_at(seen, CAMERA_POINT, np.eye(3)), T)
    np.testing.assert_allclose(innovation.residual, seen - predicted, rtol=0, atol=1e-9)
    np.testing.assert_allclose(H, np.hstack([T[:3, :3].T, np.zeros((3, 3))]), rtol=0, atol=1e-12)


def test_the_distance_of_a_pair_is_that_of_the_innovation_taken_as_linear_where_it_is_seen() -> None:
    """By hand, pair by pair; a prediction behind the camera has a distance like any other, and a large one."""
    T = pose(5)
    tracks = [somewhere_else(p, 0.2, T) for p in ([0.3, -0.2, 2.1], [0.2, 0.0, -2.0], [-1.0, 0.4, 3.5])]
    observations = [seen_at(p, PIXEL_DEPTH, np.diag([2.0, 3.0, 0.02]) ** 2) for p in POINTS]
    answer = squared_mahalanobis(tracks, observations, T)
    for i, track in enumerate(tracks):
        p_camera = transform(inverse(T), track.position_world)
        for j, observation in enumerate(observations):
            J = PIXEL_DEPTH.jacobian(observation.position_camera)
            y = J @ (observation.position_camera - p_camera)
            P = J @ T[:3, :3].T @ track.covariance[:3, :3] @ T[:3, :3] @ J.T
            assert answer[i, j] == pytest.approx(y @ np.linalg.inv(P + observation.covariance) @ y, rel=1e-9)
    assert answer[1].min() > 50
    assert (answer[0, 0], answer[2, 1]) == (answer[0].min(), answer[2].min())


def test_near_the_truth_both_models_lead_to_the_same_belief() -> None:
    """To first order the models hold the same information; the difference shrinks with the square of the errors."""
    T = pose(9)
    R_point = np.diag([1e-3, 2e-3, 3e-3]) ** 2
    J = PIXEL_DEPTH.jacobian(POINTS[0])

    def seen(p_camera: np.ndarray, model: PixelDepth) -> Observation:
        R = R_point if model is CAMERA_POINT else J @ R_point @ J.T
        return Observation(
            position_camera=p_camera, covariance=R, class_name="person", detection_index=0, mask=MASK, model=model
        )

    def updated(model: PixelDepth) -> Track:
        born = initiate(seen(POINTS[0], model), 0.0, T, PAPER, 1)
        return update(born, seen(POINTS[0] + 1e-3, model), None, T, PAPER)

    linear, pixels = updated(CAMERA_POINT), updated(PIXEL_DEPTH)
    np.testing.assert_allclose(pixels.mean, linear.mean, atol=5e-6)
    np.testing.assert_allclose(pixels.covariance, linear.covariance, atol=1e-8)
    born = initiate(seen(POINTS[0], PIXEL_DEPTH), 0.0, T, PAPER, 1)
    innovation, _ = innovate(born, seen(POINTS[0] + 1e-3, PIXEL_DEPTH), T)
    expected = PIXEL_DEPTH.measured(POINTS[0] + 1e-3) - PIXEL_DEPTH.measured(POINTS[0])
    np.testing.assert_allclose(innovation.residual, expected, atol=1e-9)
    np.testing.assert_allclose((inverse(T) @ [*born.position_world, 1])[:3], POINTS[0], atol=1e-12)
