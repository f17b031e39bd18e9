"""What is measured of a point in the camera frame, and the filter with a measurement that is not linear."""

import numpy as np
import pytest

from dotmask.geometry import inverse
from dotmask.profiles import PAPER
from dotmask.records import Intrinsics, Observation, Track
from dotmask.tracking.ekf import initiate, innovate, measurement_jacobian, update
from dotmask.tracking.measurement_model import CAMERA_POINT, PixelDepth

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
