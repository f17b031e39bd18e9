from dataclasses import replace

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from scipy.spatial.transform import Rotation

from dotmask.profiles import PAPER
from dotmask.records import Detections, Observation
from dotmask.tracking.ekf import initiate, innovate, measurement_jacobian, update
from dotmask.tracking.measurement_model import CAMERA_POINT
from dotmask.tracking.motion_model import predict

DETECTIONS = Detections(
    masks=np.ones((1, 2, 2), bool), boxes_px=np.zeros((1, 4)), class_names=("person",), scores=np.ones(1)
)


def observation(position, covariance) -> Observation:
    return Observation(
        position_camera=np.asarray(position, float),
        covariance=np.asarray(covariance, float),
        class_name="person",
        detection_index=0,
        model=CAMERA_POINT,
    )


def camera(k: int) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("xyz", [0.3 + 0.05 * k, -0.2 * np.sin(k), 0.1 * k]).as_matrix()
    T[:3, 3] = [0.3 * k, -0.1 * k, 1.2]
    return T


def sequence(count=40):
    rng = np.random.default_rng(3)
    times = np.cumsum(rng.uniform(0.02, 0.06, count))
    for t in times:
        root = rng.normal(size=(3, 3))
        z = np.array([0.5 + 1.1 * t, -0.2, 3 - 0.4 * t]) + rng.normal(0, 0.03, 3)
        yield float(t), observation(z, 0.001 * (root @ root.T) + 1e-4 * np.eye(3))


def textbook_filter(steps, cameras):
    """Bar-Shalom et al. 2001, table 5.2.4-1, written out; returns the means and covariances after every update."""
    out = []
    x = P = t_last = None
    for (t, o), T in zip(steps, cameras, strict=True):
        R_wc, p_wc = T[:3, :3], T[:3, 3]
        H = np.hstack([R_wc.T, np.zeros((3, 3))])
        if x is None:
            x = np.concatenate([R_wc @ o.position_camera + p_wc, np.zeros(3)])
            P = np.zeros((6, 6))
            P[:3, :3] = R_wc @ o.covariance @ R_wc.T
            P[3:, 3:] = np.eye(3)
        else:
            dt = t - t_last
            F = np.eye(6)
            F[0, 3] = F[1, 4] = F[2, 5] = dt
            G = np.vstack([dt**2 / 2 * np.eye(3), dt * np.eye(3)])
            x, P = F @ x, F @ P @ F.T + G @ (0.62**2 * np.eye(3)) @ G.T
            S = H @ P @ H.T + o.covariance
            K = P @ H.T @ np.linalg.inv(S)
            x = x + K @ (o.position_camera - (H @ x - R_wc.T @ p_wc))
            P = P - K @ S @ K.T
        t_last = t
        out.append((x, P))
    return out


def our_filter(steps, cameras):
    out, track = [], None
    for (t, o), T in zip(steps, cameras, strict=True):
        if track is None:
            track = initiate(o, DETECTIONS, t, T, PAPER, 1)
        else:
            track = update(predict(track, t, PAPER), o, DETECTIONS, T)
        out.append((track.mean, track.covariance))
    return out


@pytest.mark.parametrize("moves", [False, True], ids=["camera at rest at the origin", "camera moves and turns"])
def test_equals_the_textbook_filter(moves) -> None:
    steps = list(sequence())
    cameras = [camera(k) if moves else np.eye(4) for k in range(len(steps))]
    for ours, theirs in zip(our_filter(steps, cameras), textbook_filter(steps, cameras), strict=True):
        np.testing.assert_allclose(ours[0], theirs[0], rtol=0, atol=1e-9)
        np.testing.assert_allclose(ours[1], theirs[1], rtol=0, atol=1e-9)


def test_equals_filterpy_with_the_camera_at_the_origin() -> None:
    steps = list(sequence())
    ours = our_filter(steps, [np.eye(4)] * len(steps))
    peer = KalmanFilter(dim_x=6, dim_z=3)
    peer.H = np.eye(3, 6)
    t_last, first = steps[0]
    peer.x = np.concatenate([first.position_camera, np.zeros(3)])
    peer.P = np.zeros((6, 6))
    peer.P[:3, :3] = first.covariance
    peer.P[3:, 3:] = np.eye(3)
    for (t, o), (mean, covariance) in zip(steps[1:], ours[1:], strict=True):
        dt = t - t_last
        t_last = t
        peer.F = np.eye(6) + dt * np.eye(6, k=3)
        gamma = np.vstack([dt**2 / 2 * np.eye(3), dt * np.eye(3)])
        peer.Q = 0.62**2 * gamma @ gamma.T
        peer.predict()
        peer.update(o.position_camera, R=o.covariance)
        np.testing.assert_allclose(mean, peer.x, rtol=0, atol=1e-9)
        np.testing.assert_allclose(covariance, peer.P, rtol=0, atol=1e-9)


def test_misprint_c_the_gain_is_6x3_and_moves_the_velocity() -> None:
    born = initiate(observation([0, 0, 2], 1e-4 * np.eye(3)), DETECTIONS, 0.0, np.eye(4), PAPER, 1)
    after = update(predict(born, 0.1, PAPER), observation([0.1, 0, 2], 1e-4 * np.eye(3)), DETECTIONS, np.eye(4))
    assert after.velocity_world[0] == pytest.approx(1.0, abs=0.05)
    P, H = predict(born, 0.1, PAPER).covariance, measurement_jacobian(born.position_world, CAMERA_POINT, np.eye(4))
    assert (P @ H.T @ np.linalg.inv(H @ P @ H.T)).shape == (6, 3)


def test_misprint_d_h_maps_the_world_into_the_camera() -> None:
    T_world_camera = camera(4)
    p_world = np.array([1.0, 2.0, 0.5])
    truth = np.linalg.inv(T_world_camera) @ [*p_world, 1]
    born = initiate(observation([0, 0, 2], np.eye(3)), DETECTIONS, 0.0, np.eye(4), PAPER, 1)
    track = replace(born, mean=np.concatenate([p_world, np.zeros(3)]))
    residual = innovate(track, observation(truth[:3], np.eye(3)), T_world_camera).residual
    np.testing.assert_allclose(residual, 0, atol=1e-12)
    # As printed: rotation of angles (roll, pitch, yaw) camera to world, plus the camera's position.
    printed = T_world_camera[:3, :3] @ p_world + T_world_camera[:3, 3]
    assert np.linalg.norm(truth[:3] - printed) > 1.0


def test_innovation_covariance_and_nis() -> None:
    born = initiate(observation([0, 0, 2], 0.04 * np.eye(3)), DETECTIONS, 0.0, camera(2), PAPER, 1)
    seen = np.linalg.inv(camera(2)) @ [*born.position_world, 1]
    innovation = innovate(born, observation(seen[:3] + np.array([0.1, 0, 0]), 0.05 * np.eye(3)), camera(2))
    np.testing.assert_allclose(innovation.covariance, 0.09 * np.eye(3), atol=1e-12)
    assert innovation.nis == pytest.approx(0.01 / 0.09)


def test_joseph_form_survives_a_nearly_perfect_measurement() -> None:
    track = initiate(observation([0, 0, 2], 1e4 * np.eye(3)), DETECTIONS, 0.0, np.eye(4), PAPER, 1)
    for k in range(200):
        seen = observation([0, 0, 2], 1e-10 * np.eye(3))
        track = update(predict(track, 0.01 * (k + 1), PAPER), seen, DETECTIONS, np.eye(4))
        assert (np.linalg.eigvalsh(track.covariance) > 0).all()


def test_birth_is_at_rest_where_it_was_seen() -> None:
    T = camera(3)
    born = initiate(observation([0.2, -0.1, 2.5], np.diag([0.01, 0.02, 0.03])), DETECTIONS, 7.0, T, PAPER, 12)
    np.testing.assert_allclose(born.position_world, (T @ [0.2, -0.1, 2.5, 1])[:3])
    np.testing.assert_allclose(born.velocity_world, 0)
    np.testing.assert_allclose(np.sort(np.linalg.eigvalsh(born.covariance)), [0.01, 0.02, 0.03, 1, 1, 1])
    assert (born.track_id, born.timestamp_s, born.age_frames, born.misses, born.innovation) == (12, 7.0, 1, 0, None)
