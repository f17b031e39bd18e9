"""Birth and update of one track: the paper's extended Kalman filter (Tracking Using EKF, Update).

State: `[p_world, v_world]`. Measurement: `h(x) = R_camera_world p_world + t_camera_world`, metres, camera frame, with
the constant Jacobian `H = [R_camera_world 0]` (3x6). The paper prints the rotation from camera to world with the
camera's position added; that maps camera points into the world, and h needs the inverse.
"""

from dataclasses import replace

import numpy as np

from dotmask.geometry import inverse
from dotmask.profiles import Profile
from dotmask.records import Detections, FloatArray, Innovation, Observation, Track

_IDENTITY = np.eye(6)


def measurement_jacobian(T_world_camera: FloatArray) -> FloatArray:
    """H (3, 6) `= [R_camera_world 0]`."""
    H = np.zeros((3, 6))
    H[:, :3] = T_world_camera[:3, :3].T
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
    covariance[:3, :3] = R_world_camera @ observation.covariance @ R_world_camera.T
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
    """`y = z - h(x)` and `S = H P Hᵀ + R`, metres, camera frame."""
    T_camera_world = inverse(T_world_camera)
    R_camera_world = T_camera_world[:3, :3]
    expected = R_camera_world @ track.position_world + T_camera_world[:3, 3]
    S = R_camera_world @ track.covariance[:3, :3] @ R_camera_world.T + observation.covariance
    return Innovation(residual=observation.position_camera - expected, covariance=S)


def update(track: Track, observation: Observation, detections: Detections, T_world_camera: FloatArray) -> Track:
    """The belief after `observation`, for a track that was predicted to its frame.

    `K = P Hᵀ S⁻¹` is 6x3 (printed 3x3 in the paper). The covariance is updated in Joseph form, which stays symmetric
    and positive definite under rounding, where the paper's `(I - K H) P` need not.
    """
    innovation = innovate(track, observation, T_world_camera)
    H = measurement_jacobian(T_world_camera)
    P = track.covariance
    K = np.linalg.solve(innovation.covariance, H @ P).T
    rest = _IDENTITY - K @ H
    covariance = rest @ P @ rest.T + K @ observation.covariance @ K.T
    return replace(
        track,
        mean=track.mean + K @ innovation.residual,
        covariance=0.5 * (covariance + covariance.T),
        misses=0,
        detection_index=observation.detection_index,
        mask=detections.masks[observation.detection_index],
        mask_timestamp_s=track.timestamp_s,
        partial_timestamp_s=track.timestamp_s if observation.is_partial else track.partial_timestamp_s,
        innovation=innovation,
    )
