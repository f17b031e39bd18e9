"""Birth and update of one track: the paper's extended Kalman filter (Tracking Using EKF, Update).

State: `[p_world, v_world]`. Measurement: `h(x) = m(R_camera_world p_world + t_camera_world)` with m what the
observation measures of a point in the camera frame, and the Jacobian `H = [m' R_camera_world, 0]` (3x6). In the paper m
is the point itself. The paper prints the rotation from camera to world with the camera's position added; that maps
camera points into the world, and h needs the inverse.
"""

from dataclasses import replace

import numpy as np

from dotmask.geometry import inverse, transform
from dotmask.profiles import Profile
from dotmask.records import FloatArray, Innovation, MeasurementModel, Observation, SurfaceMotion, Track, TrackPhase

_IDENTITY = np.eye(6)
_VELOCITY = _IDENTITY[3:]


def measurement_jacobian(p_camera: FloatArray, model: MeasurementModel, T_world_camera: FloatArray) -> FloatArray:
    """H (3, 6) `= [m'(p_camera) R_camera_world, 0]`, at a point (3,) in the camera frame."""
    H = np.zeros((3, 6))
    H[:, :3] = model.jacobian(p_camera) @ T_world_camera[:3, :3].T
    return H


def initiate(
    observation: Observation,
    timestamp_s: float,
    T_world_camera: FloatArray,
    profile: Profile,
    track_id: int,
) -> Track:
    """A new track at `observation`, at rest, as uncertain as R in position and as the class's prior in velocity."""
    R_world_camera = T_world_camera[:3, :3]
    mean = np.zeros(6)
    mean[:3] = R_world_camera @ observation.position_camera + T_world_camera[:3, 3]
    covariance = np.zeros((6, 6))
    # R is of what is measured: taken back to a point.
    back = R_world_camera @ np.linalg.inv(observation.model.jacobian(observation.position_camera))
    covariance[:3, :3] = back @ observation.covariance @ back.T
    model = profile.class_model(observation.class_name)
    covariance[3:, 3:] = np.diag((model.prior_speed_sigma_m_s * model.axis_shares) ** 2)
    return Track(
        track_id=track_id,
        class_name=observation.class_name,
        timestamp_s=timestamp_s,
        mean=mean,
        covariance=0.5 * (covariance + covariance.T),
        hits=1,
        misses=0,
        phase=TrackPhase.CONFIRMED if profile.confirming_hits == 1 else TrackPhase.TENTATIVE,
        detection_index=observation.detection_index,
        mask=observation.mask,
        mask_timestamp_s=timestamp_s,
        mask_position_camera=observation.position_camera,
        is_partial=observation.is_partial,
    )


def innovate(track: Track, observation: Observation, T_world_camera: FloatArray) -> tuple[Innovation, FloatArray]:
    """`y = z - h(x)` and `S = H P Hᵀ + R`, in the units of what is measured, and H (3, 6).

    h is taken as linear around the prediction; where that is so far off (behind the camera, or at less than half or
    more than twice the measured depth) that it is not, around the observation.
    """
    model, p_seen = observation.model, observation.position_camera
    p_camera = transform(inverse(T_world_camera), track.position_world)
    p_linear = p_camera if 0.5 * p_seen[2] < p_camera[2] < 2.0 * p_seen[2] else p_seen
    H = measurement_jacobian(p_linear, model, T_world_camera)
    expected = model.measured(p_linear)
    if p_linear is p_seen:
        expected = expected + model.jacobian(p_seen) @ (p_camera - p_seen)
    innovation = Innovation(
        residual=model.measured(p_seen) - expected, covariance=H @ track.covariance @ H.T + observation.covariance
    )
    return innovation, H


def update(
    track: Track,
    observation: Observation,
    surface: SurfaceMotion | None,
    T_world_camera: FloatArray,
    profile: Profile,
) -> Track:
    """The belief after `observation`, for a track that was predicted to its frame.

    `K = P Hᵀ S⁻¹` is 6x3 (printed 3x3 in the paper). The covariance is updated in Joseph form, which stays symmetric
    and positive definite under rounding, where the paper's `(I - K H) P` need not.

    Args:
        track: predicted.
        observation: of its position.
        surface: how its surface moves: a measurement of the velocity, `H = [0 I]`; None: there is none (paper).
        T_world_camera: (4, 4) camera pose at the frame.
        profile: says when a track is confirmed.
    """
    innovation, H = innovate(track, observation, T_world_camera)
    mean, P = _corrected(track.mean, track.covariance, innovation, H, observation.covariance)
    if surface is not None:
        residual, S = surface.velocity_world - mean[3:], P[3:, 3:] + surface.covariance
        velocity = Innovation(residual=residual, covariance=S)
        mean, P = _corrected(mean, P, velocity, _VELOCITY, surface.covariance)
    hits = track.hits + 1
    return replace(
        track,
        mean=mean,
        covariance=P,
        hits=hits,
        misses=0,
        phase=TrackPhase.CONFIRMED
        if track.phase is not TrackPhase.TENTATIVE or hits >= profile.confirming_hits
        else TrackPhase.TENTATIVE,
        detection_index=observation.detection_index,
        mask=observation.mask,
        mask_timestamp_s=track.timestamp_s,
        mask_position_camera=transform(inverse(T_world_camera), mean[:3]),
        is_partial=observation.is_partial,
        innovation=innovation,
        surface=surface,
    )


def slide(track: Track, variance_m2: float) -> Track:
    """`track` with a less certain position: the point that is measured may have slid over the object."""
    P = track.covariance.copy()
    P[:3, :3] += variance_m2 * np.eye(3)
    return replace(track, covariance=P)


def _corrected(
    mean: FloatArray, P: FloatArray, innovation: Innovation, H: FloatArray, R: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Mean (6,) and covariance (6, 6) after an innovation."""
    K = np.linalg.solve(innovation.covariance, H @ P).T
    rest = _IDENTITY - K @ H
    covariance = rest @ P @ rest.T + K @ R @ K.T
    return mean + K @ innovation.residual, 0.5 * (covariance + covariance.T)
