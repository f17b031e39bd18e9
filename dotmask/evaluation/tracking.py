"""Judges the tracker: filter errors and consistency against the truth, identities by CLEAR-MOT and IDF1.

NEES and NIS: Bar-Shalom, Li, Kirubarajan 2001, "Estimation with Applications to Tracking and Navigation", section 5.4.
MOTA: Bernardin and Stiefelhagen 2008, "Evaluating Multiple Object Tracking Performance". IDF1: Ristani et al. 2016,
"Performance Measures and a Data Set for Multi-Target, Multi-Camera Tracking".
"""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment
from scipy.stats import chi2

from dotmask.records import FloatArray


def match_detections(
    masks: npt.NDArray[np.bool_], instance_ids: npt.NDArray[np.uint16], min_iou: float = 0.5
) -> tuple[int | None, ...]:
    """The true instance behind each detection.

    Detection and instance must be each other's best and overlap with an IoU of at least `min_iou`; where two detections
    claim one instance, the better IoU has it and the other one has none.

    Args:
        masks: (N, H, W) detected.
        instance_ids: (H, W) true instance of each pixel, 0 = background.
        min_iou: least intersection over union.

    Returns:
        For each detection an instance id, or None.
    """
    areas = np.bincount(instance_ids.ravel())
    best: list[tuple[float, int, int]] = []
    for index, mask in enumerate(masks):
        overlaps = np.bincount(instance_ids[mask], minlength=len(areas)).astype(np.float64)
        unions = np.maximum(areas + np.count_nonzero(mask) - overlaps, 1)
        overlaps[0] = 0.0
        instance = int(np.argmax(overlaps / unions))
        iou = float(overlaps[instance] / unions[instance])
        if instance != 0 and iou >= min_iou:
            best.append((-iou, index, instance))
    matches: list[int | None] = [None] * len(masks)
    for _, index, instance in sorted(best):
        if instance not in matches:
            matches[index] = instance
    return tuple(matches)


def chi_square_mean_bounds(degrees: int, samples: int, confidence: float = 0.95) -> tuple[float, float]:
    """Interval that the mean of `samples` independent chi-square values lies in with probability `confidence`.

    Samples of one track in consecutive frames are not independent if the model does not hold: a mean outside is proof
    of inconsistency, a mean inside is no proof of the opposite.
    """
    tail = 0.5 * (1.0 - confidence)
    low, high = chi2.ppf([tail, 1.0 - tail], degrees * samples) / samples
    return float(low), float(high)


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterErrors:
    """Errors of the filter over all samples; None where there was none.

    Attributes:
        samples: number of (frame, object) pairs.
        position_rmse_m: against the object's centre.
        position_rmse_ideal_m: against what the paper's estimator gives on perfect images: without the bias that the
            visible surface has as a measure of the centre.
        position_bias_m: mean of estimate less centre, world axes.
        velocity_rmse_m_s: against the velocity of the centre.
        velocity_bias_m_s: mean of estimate less truth, world axes.
        nees: mean of the normalised squared error of position and velocity (6 degrees of freedom), against the centre.
        nees_bounds: where it lies with probability 0.95 if the filter is consistent.
        nees_ideal: the same for the position alone (3 degrees of freedom) against the ideal observation.
        nis: mean of the normalised innovation squared (3 degrees of freedom).
        nis_bounds: where it lies with probability 0.95 if the filter is consistent.
    """

    samples: int
    position_rmse_m: float | None
    position_rmse_ideal_m: float | None
    position_bias_m: tuple[float, float, float] | None
    velocity_rmse_m_s: float | None
    velocity_bias_m_s: tuple[float, float, float] | None
    nees: float | None
    nees_bounds: tuple[float, float] | None
    nees_ideal: float | None
    nis: float | None
    nis_bounds: tuple[float, float] | None


def filter_errors(
    means: FloatArray,
    covariances: FloatArray,
    centres_world: FloatArray,
    velocities_world: FloatArray,
    ideals_world: FloatArray,
    nis: FloatArray,
) -> FilterErrors:
    """Errors and consistency of beliefs about objects.

    Args:
        means: (N, 6) position and velocity.
        covariances: (N, 6, 6).
        centres_world: (N, 3) true centres, metres.
        velocities_world: (N, 3) true velocities of the centres, metres per second.
        ideals_world: (N, 3) ideal observations in the world; NaN rows where the object was not visible.
        nis: (N,) of the update; NaN where there was none (birth, not seen).
    """
    count = len(means)
    position = means[:, :3] - centres_world
    velocity = means[:, 3:] - velocities_world
    has_ideal = np.isfinite(ideals_world).all(axis=1)
    ideal = (means[:, :3] - ideals_world)[has_ideal]
    updates = nis[np.isfinite(nis)]
    return FilterErrors(
        samples=count,
        position_rmse_m=_rms_norm(position),
        position_rmse_ideal_m=_rms_norm(ideal),
        position_bias_m=_mean_vector(position),
        velocity_rmse_m_s=_rms_norm(velocity),
        velocity_bias_m_s=_mean_vector(velocity),
        nees=_mean(normalised_squares(np.concatenate([position, velocity], axis=1), covariances)),
        nees_bounds=chi_square_mean_bounds(6, count) if count else None,
        nees_ideal=_mean(normalised_squares(ideal, covariances[has_ideal][:, :3, :3])),
        nis=_mean(updates),
        nis_bounds=chi_square_mean_bounds(3, len(updates)) if len(updates) else None,
    )


def normalised_squares(errors: FloatArray, covariances: FloatArray) -> FloatArray:
    """(N,) `eᵀ C⁻¹ e` of errors (N, D) with covariances (N, D, D)."""
    return np.asarray((errors * np.linalg.solve(covariances, errors[..., None])[..., 0]).sum(axis=1))


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameIdentities:
    """Who is who in one frame.

    Attributes:
        instances: the true instances that a tracker should have.
        tracks: for each reported track its id and the true instance it follows; None: it follows none.
    """

    instances: tuple[int, ...]
    tracks: tuple[tuple[int, int | None], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentityScores:
    """Identity metrics over a sequence; None where there was no true object.

    Attributes:
        mota: 1 - (misses + false positives + switches) / true objects.
        idf1: share of frames with the right identity under the best one-to-one naming of tracks.
        switches: times that an instance's track id changed.
        misses: true objects without a track, summed over frames.
        false_positives: tracks that follow no instance, or one that has a track already.
    """

    mota: float | None
    idf1: float | None
    switches: int
    misses: int
    false_positives: int


def identity_scores(frames: Iterable[FrameIdentities]) -> IdentityScores:
    """CLEAR-MOT and IDF1 of a sequence of frames.

    Where two tracks follow one instance, the one that had it before keeps it, else the lower id.
    """
    last_track: dict[int, int] = {}
    together: Counter[tuple[int, int]] = Counter()
    switches = misses = false_positives = truths = reports = 0
    for frame in frames:
        claims: dict[int, list[int]] = {instance: [] for instance in frame.instances}
        for track_id, instance in frame.tracks:
            if instance in claims:
                claims[instance].append(track_id)
                together[instance, track_id] += 1
        for instance, track_ids in claims.items():
            if not track_ids:
                misses += 1
                continue
            held_by = last_track.get(instance)
            keeper = held_by if held_by is not None and held_by in track_ids else min(track_ids)
            switches += held_by is not None and keeper != held_by
            last_track[instance] = keeper
        false_positives += len(frame.tracks) - sum(bool(ids) for ids in claims.values())
        truths += len(frame.instances)
        reports += len(frame.tracks)
    right = _best_naming(together)
    return IdentityScores(
        mota=1.0 - (misses + false_positives + switches) / truths if truths else None,
        idf1=2.0 * right / (truths + reports) if truths else None,
        switches=switches,
        misses=misses,
        false_positives=false_positives,
    )


def _best_naming(together: Counter[tuple[int, int]]) -> int:
    """Frames in which instance and track agree, under the one-to-one naming that makes them most."""
    if not together:
        return 0
    instances = sorted({instance for instance, _ in together})
    tracks = sorted({track for _, track in together})
    counts = np.zeros((len(instances), len(tracks)))
    for (instance, track), frames in together.items():
        counts[instances.index(instance), tracks.index(track)] = frames
    rows, columns = linear_sum_assignment(-counts)
    return int(counts[rows, columns].sum())


def _mean(values: FloatArray) -> float | None:
    return float(np.mean(values)) if len(values) else None


def _rms_norm(errors: FloatArray) -> float | None:
    return float(np.sqrt(np.mean(np.sum(errors**2, axis=1)))) if len(errors) else None


def _mean_vector(errors: FloatArray) -> tuple[float, float, float] | None:
    if not len(errors):
        return None
    x, y, z = (float(value) for value in errors.mean(axis=0))
    return x, y, z
