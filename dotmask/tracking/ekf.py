"""Birth and update of one track: the paper's extended Kalman filter (Tracking Using EKF, Update).

State: `[p_world, v_world]`. Measurement: `h(x) = m(R_camera_world p_world + t_camera_world)` with m what the
observation measures of a point in the camera frame, and the Jacobian `H = [m' R_camera_world, 0]` (3x6). In the paper m
is the point itself. The paper prints the rotation from camera to world with the camera's position added; that maps
camera points into the world, and h needs the inverse.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dotmask.geometry import inverse, transform
from dotmask.profiles import Profile
from dotmask.records import FloatArray, Innovation, MeasurementModel, Observation, SurfaceMotion, Track, TrackPhase

_IDENTITY = np.eye(6)
_VELOCITY = _IDENTITY[3:]


def measurement_jacobian(p_camera: FloatArray, model: MeasurementModel, T_world_camera: FloatArray) -> FloatArray:
    """H (..., 3, 6) `= [m'(p_camera) R_camera_world, 0]`, at points (..., 3) in the camera frame."""
    H = np.zeros((*p_camera.shape, 6))
    H[..., :3] = model.jacobian(p_camera) @ T_world_camera[:3, :3].T
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
    residuals, S, H = _innovations(
        track.mean[None], track.covariance[None], [observation], observation.covariance[None], T_world_camera
    )
    return Innovation(residual=residuals[0], covariance=S[0]), H[0]


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
    return update_all([track], [observation], [surface], T_world_camera, profile)[0]


def update_all(
    tracks: Sequence[Track],
    observations: Sequence[Observation],
    surfaces: Sequence[SurfaceMotion | None],
    T_world_camera: FloatArray,
    profile: Profile,
) -> tuple[Track, ...]:
    """`update` for all tracks of one frame in one go; observation and surface of each stand at its place."""
    if not tracks:
        return ()
    means = np.array([track.mean for track in tracks])
    P = np.array([track.covariance for track in tracks])
    R = np.array([observation.covariance for observation in observations])
    residuals, S, H = _innovations(means, P, observations, R, T_world_camera)
    means, P = _corrected(means, P, residuals, S, H, R)
    followed = [(i, surface) for i, surface in enumerate(surfaces) if surface is not None]
    if followed:
        at = [i for i, _ in followed]
        R = np.array([surface.covariance for _, surface in followed])
        residual = np.array([surface.velocity_world for _, surface in followed]) - means[at, 3:]
        means[at], P[at] = _corrected(means[at], P[at], residual, P[at, 3:, 3:] + R, _VELOCITY, R)
    positions_camera = transform(inverse(T_world_camera), means[:, :3])
    updated = []
    for i, (track, observation) in enumerate(zip(tracks, observations, strict=True)):
        hits = track.hits + 1
        is_confirmed = track.phase is not TrackPhase.TENTATIVE or hits >= profile.confirming_hits
        updated.append(
            replace(
                track,
                mean=means[i],
                covariance=P[i],
                hits=hits,
                misses=0,
                phase=TrackPhase.CONFIRMED if is_confirmed else TrackPhase.TENTATIVE,
                detection_index=observation.detection_index,
                mask=observation.mask,
                mask_timestamp_s=track.timestamp_s,
                mask_position_camera=positions_camera[i],
                is_partial=observation.is_partial,
                innovation=Innovation(residual=residuals[i], covariance=S[i]),
                surface=surfaces[i],
            )
        )
    return tuple(updated)


def slide(track: Track, variance_m2: float) -> Track:
    """`track` with a less certain position: the point that is measured may have slid over the object."""
    P = track.covariance.copy()
    P[:3, :3] += variance_m2 * np.eye(3)
    return replace(track, covariance=P)


def _innovations(
    means: FloatArray, P: FloatArray, observations: Sequence[Observation], R: FloatArray, T_world_camera: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Residuals y (N, 3), S (N, 3, 3) and H (N, 3, 6) of beliefs (N, 6), (N, 6, 6), see `innovate`; R (N, 3, 3)."""
    model = observations[0].model  # one frame's observations are made alike
    p_seen = np.array([observation.position_camera for observation in observations])
    p_camera = transform(inverse(T_world_camera), means[:, :3])
    depth, seen_depth = p_camera[:, 2:], p_seen[:, 2:]
    p_linear = np.where((0.5 * seen_depth < depth) & (depth < 2.0 * seen_depth), p_camera, p_seen)
    H = measurement_jacobian(p_linear, model, T_world_camera)
    aside = (model.jacobian(p_linear) @ (p_camera - p_linear)[..., None])[..., 0]  # 0 at the prediction itself
    residuals = model.measured(p_seen) - (model.measured(p_linear) + aside)
    return residuals, H @ P @ H.swapaxes(1, 2) + R, H


def _corrected(
    means: FloatArray, P: FloatArray, residuals: FloatArray, S: FloatArray, H: FloatArray, R: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Means (N, 6) and covariances (N, 6, 6) after innovations `residuals`, S of measurements H with noise R."""
    K = np.linalg.solve(S, H @ P).swapaxes(1, 2)
    rest = _IDENTITY - K @ H
    covariances = rest @ P @ rest.swapaxes(1, 2) + K @ R @ K.swapaxes(1, 2)
    return means + (K @ residuals[..., None])[..., 0], 0.5 * (covariances + covariances.swapaxes(1, 2))
