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
from dotmask.records import Detections, FloatArray, Innovation, MeasurementModel, Observation, Track

_IDENTITY = np.eye(6)


def measurement_jacobian(p_camera: FloatArray, model: MeasurementModel, T_world_camera: FloatArray) -> FloatArray:
    """H (3, 6) `= [m'(p_camera) R_camera_world, 0]`, at a point (3,) in the camera frame."""
    H = np.zeros((3, 6))
    H[:, :3] = model.jacobian(p_camera) @ T_world_camera[:3, :3].T
    return H


def initiate(
    observation: Observation,
    detections: Detections,
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
        age_frames=1,
        misses=0,
        detection_index=observation.detection_index,
        mask=detections.masks[observation.detection_index],
        mask_timestamp_s=timestamp_s,
        partial_timestamp_s=timestamp_s,
    )


def innovate(track: Track, observation: Observation, T_world_camera: FloatArray) -> Innovation:
    """`y = z - h(x)` and `S = H P Hᵀ + R`, in the units of what is measured."""
    p_camera = transform(inverse(T_world_camera), track.position_world)
    H = measurement_jacobian(p_camera, observation.model, T_world_camera)
    return _innovation(track, observation, p_camera, H)


def update(track: Track, observation: Observation, detections: Detections, T_world_camera: FloatArray) -> Track:
    """The belief after `observation`, for a track that was predicted to its frame.

    `K = P Hᵀ S⁻¹` is 6x3 (printed 3x3 in the paper). The covariance is updated in Joseph form, which stays symmetric
    and positive definite under rounding, where the paper's `(I - K H) P` need not.
    """
    p_camera = transform(inverse(T_world_camera), track.position_world)
    H = measurement_jacobian(p_camera, observation.model, T_world_camera)
    innovation = _innovation(track, observation, p_camera, H)
    mean, covariance = _corrected(track, innovation, H, observation.covariance)
    return replace(
        track,
        mean=mean,
        covariance=covariance,
        misses=0,
        detection_index=observation.detection_index,
        mask=detections.masks[observation.detection_index],
        mask_timestamp_s=track.timestamp_s,
        partial_timestamp_s=track.timestamp_s if observation.is_partial else track.partial_timestamp_s,
        innovation=innovation,
    )


def _innovation(track: Track, observation: Observation, p_camera: FloatArray, H: FloatArray) -> Innovation:
    model = observation.model
    return Innovation(
        residual=model.measured(observation.position_camera) - model.measured(p_camera),
        covariance=H @ track.covariance @ H.T + observation.covariance,
    )


def _corrected(track: Track, innovation: Innovation, H: FloatArray, R: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean (6,) and covariance (6, 6) after an innovation."""
    P = track.covariance
    K = np.linalg.solve(innovation.covariance, H @ P).T
    rest = _IDENTITY - K @ H
    covariance = rest @ P @ rest.T + K @ R @ K.T
    return track.mean + K @ innovation.residual, 0.5 * (covariance + covariance.T)
