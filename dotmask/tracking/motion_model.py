"""Constant velocity with random acceleration (paper, Tracking Using EKF, Prediction)."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dotmask.profiles import Profile
from dotmask.records import FloatArray, Track, TrackPhase

_ROWS, _COLUMNS = np.arange(3), np.arange(3, 6)


def transition(dt_s: float) -> FloatArray:
    """F (6, 6) `[[I, dt I], [0, I]]`."""
    F = np.eye(6)
    F[_ROWS, _COLUMNS] = dt_s
    return F


def process_noise(dt_s: float, acceleration_sigmas_m_s2: FloatArray) -> FloatArray:
    """Q (..., 6, 6) `= Γ Σ Γᵀ`, `Γ = [dt²/2 I; dt I]`: an acceleration constant over the frame, Σ its covariance.

    The paper prints `dt² I` as Γ's lower block, and σ³ in the cross terms of the expanded Q; both are misprints (see
    dotmask.profiles.PAPER).

    Args:
        dt_s: duration of the frame.
        acceleration_sigmas_m_s2: (..., 3) roots of Σ's diagonal, world axes; the components are uncorrelated (paper).
    """
    variances = acceleration_sigmas_m_s2**2
    Q = np.zeros((*variances.shape[:-1], 6, 6))
    Q[..., _ROWS, _ROWS] = 0.25 * dt_s**4 * variances
    Q[..., _ROWS, _COLUMNS] = Q[..., _COLUMNS, _ROWS] = 0.5 * dt_s**3 * variances
    Q[..., _COLUMNS, _COLUMNS] = dt_s**2 * variances
    return Q


def predict(track: Track, timestamp_s: float, profile: Profile) -> Track:
    """The belief about `track` at a later frame, before that frame is looked at.

    It counts as unseen (one more miss) until an update says otherwise. The position of a half hidden object is less
    certain than the motion model says (`slide_variance`): the track follows what is seen, and the velocity is not
    dragged along.

    Raises:
        ValueError: `timestamp_s` is not later than the belief.
    """
    return predict_all([track], timestamp_s, profile)[0]


def predict_all(tracks: Sequence[Track], timestamp_s: float, profile: Profile) -> tuple[Track, ...]:
    """`predict` for all tracks of one frame in one go.

    Raises:
        ValueError: `timestamp_s` is not later than the beliefs, or these are not of one frame.
    """
    if not tracks:
        return ()
    before_s = tracks[0].timestamp_s
    if any(track.timestamp_s != before_s for track in tracks):
        raise ValueError("predict: expected tracks of one time stamp")
    dt_s = timestamp_s - before_s
    if not dt_s > 0:
        raise ValueError(f"predict: frame at {timestamp_s} s is not later than the track's {before_s} s")
    F = transition(dt_s)
    models = [profile.class_model(track.class_name) for track in tracks]
    sigmas = np.array([model.acceleration_sigma_m_s2 * model.axis_shares for model in models])
    means = np.array([track.mean for track in tracks]) @ F.T
    P = F @ np.array([track.covariance for track in tracks]) @ F.T + process_noise(dt_s, sigmas)
    P = 0.5 * (P + P.swapaxes(1, 2))
    for covariance, track in zip(P, tracks, strict=True):
        if track.is_partial:
            covariance[_ROWS, _ROWS] += slide_variance(track.class_name, dt_s, profile)
    return tuple(
        replace(
            track,
            timestamp_s=timestamp_s,
            mean=mean,
            covariance=covariance,
            misses=track.misses + 1,
            phase=TrackPhase.TENTATIVE if track.phase is TrackPhase.TENTATIVE else TrackPhase.COASTING,
            detection_index=None,
            innovation=None,
            surface=None,
        )
        for track, mean, covariance in zip(tracks, means, P, strict=True)
    )


def slide_variance(class_name: str, dt_s: float, profile: Profile) -> float:
    """How far, squared, the measured point of a half hidden object may slide over it in `dt_s` seconds, per axis.

    What is measured is the centre of the visible part, and more or less of the object shows from frame to frame.
    """
    return profile.class_model(class_name).slide_sigma_m ** 2 * dt_s
