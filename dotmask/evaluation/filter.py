"""Judges the tracker's beliefs: errors, bias, and whether the filter is as certain as it should be.

NEES, NIS and the whiteness of innovations: Bar-Shalom, Li, Kirubarajan 2001, "Estimation with Applications to Tracking
and Navigation", section 5.4.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.stats import chi2, norm

from dotmask.records import FloatArray, Innovation

CONFIDENCE = 0.95
"""Probability that a figure of a consistent filter lies inside its bounds."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BeliefSample:
    """One observed track in one frame beside its truth.

    Attributes:
        frame: number of the frame.
        track_id: of the track.
        instance_id: of the true instance that it follows.
        mean: (6,) position and velocity in the world, metres and metres per second.
        covariance: (6, 6).
        innovation: of this frame's update; None at birth.
        centre_world: (3,) true centre, metres.
        velocity_world: (3,) true velocity of the centre, metres per second.
        ideal_world: (3,) what the estimator's own observation gives on perfect images, metres; None when not visible.
        T_world_camera: (4, 4) true pose of the camera.
    """

    frame: int
    track_id: int
    instance_id: int
    mean: FloatArray
    covariance: FloatArray
    innovation: Innovation | None
    centre_world: FloatArray
    velocity_world: FloatArray
    ideal_world: FloatArray | None
    T_world_camera: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterErrors:
    """Errors of the filter over all samples; None where there was none.

    A bias is what stays of the error when it is averaged over each instance's samples in the camera's axes (root mean
    square over the samples of their instance's mean error): an offset towards the camera stays one while the person
    walks around it. Bias and spread add up to the RMSE as `rmse² = bias² + spread²`.

    Attributes:
        samples: number of (frame, object) pairs.
        position_rmse_m: against the object's centre.
        position_bias_m: of the same error.
        position_bias_ray_m: mean of the same error along the ray from the camera to the centre: below 0, the belief is
            nearer to the camera.
        position_rmse_ideal_m: against what the estimator's own observation gives on perfect images: without the bias
            that the visible surface has as a measure of the centre.
        position_bias_ideal_m: of the same error.
        velocity_rmse_m_s: against the velocity of the centre.
        velocity_bias_m_s: of the same error.
        nees: mean of the normalised squared error of position and velocity (6 degrees of freedom), against the centre.
        nees_bounds: where it lies with probability 0.95 if the filter is consistent.
        nees_ideal: the same for the position alone (3 degrees of freedom) against the ideal observation.
        nis: mean of the normalised innovation squared (3 degrees of freedom).
        nis_bounds: where it lies with probability 0.95 if the filter is consistent.
    """

    samples: int = 0
    position_rmse_m: float | None = None
    position_bias_m: float | None = None
    position_bias_ray_m: float | None = None
    position_rmse_ideal_m: float | None = None
    position_bias_ideal_m: float | None = None
    velocity_rmse_m_s: float | None = None
    velocity_bias_m_s: float | None = None
    nees: float | None = None
    nees_bounds: tuple[float, float] | None = None
    nees_ideal: float | None = None
    nis: float | None = None
    nis_bounds: tuple[float, float] | None = None


def filter_errors(samples: Sequence[BeliefSample]) -> FilterErrors:
    """Errors and consistency of beliefs about objects."""
    if not samples:
        return FilterErrors()
    means = np.array([s.mean for s in samples])
    covariances = np.array([s.covariance for s in samples])
    centres = np.array([s.centre_world for s in samples])
    poses = np.array([s.T_world_camera for s in samples])
    instances = np.array([s.instance_id for s in samples])
    errors = means - np.concatenate([centres, [s.velocity_world for s in samples]], axis=1)
    has_ideal = np.array([s.ideal_world is not None for s in samples])
    ideals = np.array([s.ideal_world for s in samples if s.ideal_world is not None]).reshape(-1, 3)
    ideal_errors = means[has_ideal, :3] - ideals
    position, velocity = errors[:, :3], errors[:, 3:]
    nis = [s.innovation.nis for s in samples if s.innovation is not None]
    rays = centres - poses[:, :3, 3]
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    return FilterErrors(
        samples=len(samples),
        position_rmse_m=_rms_norm(position),
        position_bias_m=_bias(_rotated(poses, position), instances),
        position_bias_ray_m=float(np.mean((position * rays).sum(axis=1))),
        position_rmse_ideal_m=_rms_norm(ideal_errors),
        position_bias_ideal_m=_bias(_rotated(poses[has_ideal], ideal_errors), instances[has_ideal]),
        velocity_rmse_m_s=_rms_norm(velocity),
        velocity_bias_m_s=_bias(_rotated(poses, velocity), instances),
        nees=float(np.mean(normalised_squares(errors, covariances))),
        nees_bounds=chi_square_mean_bounds(6, len(samples)),
        nees_ideal=float(np.mean(normalised_squares(ideal_errors, covariances[has_ideal][:, :3, :3])))
        if len(ideals)
        else None,
        nis=float(np.mean(nis)) if nis else None,
        nis_bounds=chi_square_mean_bounds(3, len(nis)) if nis else None,
    )


def normalised_squares(errors: FloatArray, covariances: FloatArray) -> FloatArray:
    """(N,) `eᵀ C⁻¹ e` of errors (N, D) with covariances (N, D, D)."""
    return np.asarray((errors * np.linalg.solve(covariances, errors[..., None])[..., 0]).sum(axis=1))


def chi_square_mean_bounds(degrees: int, samples: int, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Interval that the mean of `samples` independent chi-square values lies in with probability `confidence`.

    Samples of one track in consecutive frames are not independent if the model does not hold: a mean outside is proof
    of inconsistency, a mean inside is no proof of the opposite.
    """
    tail = 0.5 * (1.0 - confidence)
    low, high = chi2.ppf([tail, 1.0 - tail], degrees * samples) / samples
    return float(low), float(high)


@dataclass(frozen=True, slots=True, kw_only=True)
class Whiteness:
    """Whether the innovations of consecutive frames are independent, as those of an optimal filter are.

    Attributes:
        correlation: autocorrelation at lag 1, from -1 to 1. Above 0, the filter lags behind what it sees (or sees
            through a bias); below 0, it runs after the noise.
        bound: white innovations stay between -bound and bound with probability 0.95.
    """

    correlation: float
    bound: float


def innovation_whiteness(samples: Sequence[BeliefSample]) -> Whiteness | None:
    """Time-average autocorrelation at lag 1 of the innovations (Bar-Shalom et al., section 5.4.2), over all tracks.

    The innovations are normalised first, `L⁻¹ y` with `S = L Lᵀ`, so that those of near and far objects count alike.
    Pairs are consecutive frames of one track that both had an update; None without any. A sum over n pairs of three
    components has, for white innovations, the variance `1 / (3 n)`.
    """
    normalised = {
        (s.track_id, s.frame): np.linalg.solve(np.linalg.cholesky(s.innovation.covariance), s.innovation.residual)
        for s in samples
        if s.innovation is not None
    }
    pairs = [(v, normalised[track, k + 1]) for (track, k), v in normalised.items() if (track, k + 1) in normalised]
    if not pairs:
        return None
    first, second = np.array(pairs).transpose(1, 0, 2)
    scale = float(np.sqrt((first**2).sum() * (second**2).sum()))
    if scale == 0.0:
        return None
    return Whiteness(
        correlation=float((first * second).sum()) / scale,
        bound=float(norm.ppf(0.5 + 0.5 * CONFIDENCE)) / np.sqrt(first.size),
    )


def _rotated(T_world_camera: FloatArray, vectors_world: FloatArray) -> FloatArray:
    """(N, 3) vectors in the axes of the cameras (N, 4, 4)."""
    return np.asarray(np.einsum("nji,nj->ni", T_world_camera[:, :3, :3], vectors_world))


def _rms_norm(errors: FloatArray) -> float | None:
    return float(np.sqrt(np.mean(np.sum(errors**2, axis=1)))) if len(errors) else None


def _bias(errors: FloatArray, instances: npt.NDArray[np.int_]) -> float | None:
    """Root mean square, over the samples (N, 3), of the mean error of the sample's instance (N,)."""
    if not len(errors):
        return None
    _, index, counts = np.unique(instances, return_inverse=True, return_counts=True)
    sums = np.zeros((len(counts), 3))
    np.add.at(sums, index, errors)
    return _rms_norm((sums / counts[:, None])[index])
