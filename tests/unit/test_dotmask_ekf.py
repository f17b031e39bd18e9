from dataclasses import replace

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from scipy.spatial.transform import Rotation

from dotmask.geometry import inverse, transform
from dotmask.profiles import CALIBRATED, PAPER
from dotmask.records import Observation, SurfaceMotion, TrackPhase
from dotmask.tracking.ekf import initiate, innovate, measurement_jacobian, slide, update
from dotmask.tracking.measurement_model import CAMERA_POINT
from dotmask.tracking.motion_model import predict

MASK = np.ones((2, 2), bool)


def observation(position, covariance, *, is_partial=False) -> Observation:
    return Observation(
        position_camera=np.asarray(position, float),
        covariance=np.asarray(covariance, float),
        class_name="person",
        detection_index=0,
        mask=MASK,
        model=CAMERA_POINT,
        is_partial=is_partial,
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
        track = initiate(o, t, T, PAPER, 1) if track is None else update(predict(track, t, PAPER), o, None, T, PAPER)
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
    born = initiate(observation([0, 0, 2], 1e-4 * np.eye(3)), 0.0, np.eye(4), PAPER, 1)
    after = update(predict(born, 0.1, PAPER), observation([0.1, 0, 2], 1e-4 * np.eye(3)), None, np.eye(4), PAPER)
    assert after.velocity_world[0] == pytest.approx(1.0, abs=0.05)
    P, H = predict(born, 0.1, PAPER).covariance, measurement_jacobian(born.position_world, CAMERA_POINT, np.eye(4))
    assert (P @ H.T @ np.linalg.inv(H @ P @ H.T)).shape == (6, 3)


def test_misprint_d_h_maps_the_world_into_the_camera() -> None:
    T_world_camera = camera(4)
    p_world = np.array([1.0, 2.0, 0.5])
    truth = np.linalg.inv(T_world_camera) @ [*p_world, 1]
    born = initiate(observation([0, 0, 2], np.eye(3)), 0.0, np.eye(4), PAPER, 1)
    track = replace(born, mean=np.concatenate([p_world, np.zeros(3)]))
    innovation, _ = innovate(track, observation(truth[:3], np.eye(3)), T_world_camera)
    np.testing.assert_allclose(innovation.residual, 0, atol=1e-12)
    # As printed: rotation of angles (roll, pitch, yaw) camera to world, plus the camera's position.
    printed = T_world_camera[:3, :3] @ p_world + T_world_camera[:3, 3]
    assert np.linalg.norm(truth[:3] - printed) > 1.0


def test_innovation_covariance_and_nis() -> None:
    born = initiate(observation([0, 0, 2], 0.04 * np.eye(3)), 0.0, camera(2), PAPER, 1)
    seen = np.linalg.inv(camera(2)) @ [*born.position_world, 1]
    innovation, H = innovate(born, observation(seen[:3] + np.array([0.1, 0, 0]), 0.05 * np.eye(3)), camera(2))
    np.testing.assert_allclose(innovation.covariance, 0.09 * np.eye(3), atol=1e-12)
    np.testing.assert_array_equal(H, measurement_jacobian(seen[:3], CAMERA_POINT, camera(2)))
    assert innovation.nis == pytest.approx(0.01 / 0.09)


def test_joseph_form_survives_a_nearly_perfect_measurement() -> None:
    track = initiate(observation([0, 0, 2], 1e4 * np.eye(3)), 0.0, np.eye(4), PAPER, 1)
    for k in range(200):
        seen = observation([0, 0, 2], 1e-10 * np.eye(3))
        track = update(predict(track, 0.01 * (k + 1), PAPER), seen, None, np.eye(4), PAPER)
        assert (np.linalg.eigvalsh(track.covariance) > 0).all()


def test_birth_is_at_rest_where_it_was_seen() -> None:
    T = camera(3)
    born = initiate(observation([0.2, -0.1, 2.5], np.diag([0.01, 0.02, 0.03])), 7.0, T, PAPER, 12)
    np.testing.assert_allclose(born.position_world, (T @ [0.2, -0.1, 2.5, 1])[:3])
    np.testing.assert_allclose(born.velocity_world, 0)
    np.testing.assert_allclose(np.sort(np.linalg.eigvalsh(born.covariance)), [0.01, 0.02, 0.03, 1, 1, 1])
    assert (born.track_id, born.timestamp_s, born.hits, born.misses, born.innovation) == (12, 7.0, 1, 0, None)
    np.testing.assert_array_equal(born.mask_position_camera, [0.2, -0.1, 2.5])
    assert (born.mask_timestamp_s, born.detection_index, born.surface) == (7.0, 0, None)


def surface(velocity, covariance) -> SurfaceMotion:
    return SurfaceMotion(
        points=20, moving_points=20, velocity_world=np.asarray(velocity, float), covariance=np.asarray(covariance)
    )


def test_a_surfaces_velocity_is_a_measurement_of_the_velocity() -> None:
    """Against the linear update by hand with both measurements stacked: z = [position, velocity], H = [[R, 0], [0, I]].

    What two independent measurements say together is what one after the other says; filterpy agrees on the second.
    """
    rng = np.random.default_rng(11)
    steps, track = list(sequence(12)), None
    for k, (t, o) in enumerate(steps):
        T = camera(k)
        root = rng.normal(size=(3, 3))
        moves = surface(rng.normal(0, 1, 3), 0.01 * root @ root.T + 1e-3 * np.eye(3))
        if track is None:
            track = initiate(o, t, T, PAPER, 1)
            continue
        expected = predict(track, t, PAPER)
        track = update(expected, o, moves, T, PAPER)

        x, P = expected.mean, expected.covariance
        H = np.zeros((6, 6))
        H[:3, :3], H[3:, 3:] = T[:3, :3].T, np.eye(3)
        R = np.zeros((6, 6))
        R[:3, :3], R[3:, 3:] = o.covariance, moves.covariance
        z = np.concatenate([T[:3, :3] @ o.position_camera + T[:3, 3], moves.velocity_world])
        S = H @ P @ H.T + R
        K = P @ H.T @ np.linalg.inv(S)
        y = H @ (z - x)
        np.testing.assert_allclose(track.mean, x + K @ y, rtol=0, atol=1e-9)
        np.testing.assert_allclose(track.covariance, P - K @ S @ K.T, rtol=0, atol=1e-9)

        without = update(expected, o, None, T, PAPER)
        peer = KalmanFilter(dim_x=6, dim_z=3)
        peer.x, peer.P, peer.H = without.mean.copy(), without.covariance.copy(), np.eye(3, 6, k=3)
        peer.update(moves.velocity_world, R=moves.covariance)
        np.testing.assert_allclose(track.mean, peer.x, rtol=0, atol=1e-9)
        np.testing.assert_allclose(track.covariance, peer.P, rtol=0, atol=1e-9)
        assert track.surface is moves
        assert without.surface is None
        # The innovation is the position's alone: NIS keeps its three degrees of freedom.
        assert track.innovation is not None
        assert track.innovation.nis == innovate(expected, o, T)[0].nis


def test_a_sure_surface_velocity_is_believed_and_an_unsure_one_is_not() -> None:
    still = observation([0, 0, 2], 1e-4 * np.eye(3))
    born = predict(initiate(still, 0.0, camera(1), PAPER, 1), 0.1, PAPER)
    moves = [0.3, -0.2, 0.1]
    sure = update(born, still, surface(moves, 1e-10 * np.eye(3)), camera(1), PAPER)
    unsure = update(born, still, surface(moves, 1e10 * np.eye(3)), camera(1), PAPER)
    np.testing.assert_allclose(sure.velocity_world, moves, rtol=0, atol=1e-6)
    np.testing.assert_allclose(unsure.mean, update(born, still, None, camera(1), PAPER).mean, rtol=0, atol=1e-6)


def test_an_update_remembers_the_mask_and_where_the_track_was_in_the_camera() -> None:
    seen = replace(observation([0.1, 0, 2], 1e-4 * np.eye(3)), mask=~MASK, detection_index=4)
    born = initiate(observation([0, 0, 2], 1e-2 * np.eye(3)), 0.0, camera(1), PAPER, 1)
    after = update(predict(born, 0.1, PAPER), seen, None, camera(2), PAPER)
    expected = transform(inverse(camera(2)), after.position_world)
    np.testing.assert_allclose(after.mask_position_camera, expected, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(after.mask, ~MASK)
    assert (after.mask_timestamp_s, after.detection_index, after.misses, after.hits) == (0.1, 4, 0, 2)


def test_a_track_is_partial_as_long_as_its_last_observation_was() -> None:
    def next_one(track, *, is_partial):
        seen = observation([0, 0, 2], 1e-2 * np.eye(3), is_partial=is_partial)
        return update(predict(track, track.timestamp_s + 1, PAPER), seen, None, np.eye(4), PAPER)

    track = initiate(observation([0, 0, 2], 1e-2 * np.eye(3)), 0.0, np.eye(4), PAPER, 1)
    whole = next_one(track, is_partial=False)
    assert not whole.is_partial
    hidden = next_one(whole, is_partial=True)
    assert hidden.is_partial
    unseen = predict(hidden, 2.5, PAPER)
    assert unseen.is_partial, "what hid a part of it may hide all of it now"
    assert not next_one(hidden, is_partial=False).is_partial


@pytest.mark.parametrize(("profile", "needed"), [(PAPER, 1), (CALIBRATED, 3)], ids=["paper", "calibrated"])
def test_a_track_is_confirmed_when_it_was_seen_often_enough(profile, needed) -> None:
    seen = observation([0, 0, 2], 1e-2 * np.eye(3))
    track = initiate(seen, 0.0, np.eye(4), profile, 1)
    for hits in range(1, 6):
        assert track.hits == hits
        assert track.phase is (TrackPhase.CONFIRMED if hits >= needed else TrackPhase.TENTATIVE)
        track = update(predict(track, 0.1 * hits, profile), seen, None, np.eye(4), profile)
    coasting = predict(track, 1.0, profile)
    assert coasting.phase is TrackPhase.COASTING
    assert update(coasting, seen, None, np.eye(4), profile).phase is TrackPhase.CONFIRMED


def test_sliding_adds_to_the_position_alone() -> None:
    born = initiate(observation([0, 0, 2], 1e-2 * np.eye(3)), 0.0, camera(2), PAPER, 1)
    added = slide(born, 0.04).covariance - born.covariance
    np.testing.assert_allclose(added, np.diag([0.04] * 3 + [0.0] * 3), rtol=0, atol=1e-15)
    np.testing.assert_array_equal(slide(born, 0.04).mean, born.mean)
