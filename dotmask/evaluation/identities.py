"""Judges who is who: CLEAR-MOT, IDF1 and HOTA from one record a frame.

MOTA: Bernardin and Stiefelhagen 2008, "Evaluating Multiple Object Tracking Performance". IDF1: Ristani et al. 2016,
"Performance Measures and a Data Set for Multi-Target, Multi-Camera Tracking". HOTA: Luiten et al. 2021, "HOTA: A Higher
Order Metric for Evaluating Multi-Object Tracking". `tools/trackeval_reference.py` stores what the program of HOTA's
authors says of the same cases.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment

from dotmask.records import FloatArray, checked

MIN_SIMILARITY = 0.5
"""A track follows an instance from this IoU on (MOTA and IDF1; HOTA looks at all thresholds)."""

HOTA_THRESHOLDS = np.arange(1, 20) / 20.0
"""The 19 localisation thresholds alpha that HOTA is the mean over."""

_ROUNDING = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrameIdentities:
    """Instances and tracks of one frame, and how well each pair fits.

    Attributes:
        instances: (G,) ids of the true instances that a tracker should have.
        tracks: (T,) ids of the tracks that it reported.
        similarity: (G, T) from 0 to 1: IoU of the instance with the mask that the track was updated with.
    """

    instances: tuple[int, ...]
    tracks: tuple[int, ...]
    similarity: FloatArray

    def __post_init__(self) -> None:
        """Check that there is a similarity for every pair, and that no id comes twice."""
        shape = (len(self.instances), len(self.tracks))
        object.__setattr__(self, "similarity", checked(self.similarity, "similarity", shape, np.float64))
        for name, ids in (("instances", self.instances), ("tracks", self.tracks)):
            if len(set(ids)) != len(ids):
                raise ValueError(f"{name}: an id comes twice in one frame: {ids}")


@dataclass(frozen=True, slots=True, kw_only=True)
class ClearScores:
    """CLEAR-MOT over a sequence.

    Attributes:
        mota: 1 - (misses + false positives + switches) / true objects; None where there was no true object.
        switches: times that an instance's track id changed.
        misses: true objects without a track, summed over frames.
        false_positives: tracks that follow no instance, or one that has a track already, summed over frames.
    """

    mota: float | None
    switches: int
    misses: int
    false_positives: int


def clear_scores(frames: Iterable[FrameIdentities]) -> ClearScores:
    """CLEAR-MOT of a sequence of frames.

    A pair of the frame before stays together while it fits; the rest is paired for the largest sum of similarities. A
    frame with nothing to pair parts nobody.
    """
    last_track: dict[int, int] = {}
    before: dict[int, int] = {}
    switches = misses = false_positives = truths = 0
    for frame in frames:
        fits = frame.similarity >= MIN_SIMILARITY - _ROUNDING
        stays = np.array([[before.get(i) == t for t in frame.tracks] for i in frame.instances]).reshape(fits.shape)
        # One pair that stays outweighs every gain in similarity of the others.
        rows, columns = linear_sum_assignment(np.where(fits, 1000.0 * stays + frame.similarity, 0.0), maximize=True)
        pairs = {
            frame.instances[row]: frame.tracks[column]
            for row, column in zip(rows, columns, strict=True)
            if fits[row, column]
        }
        before = pairs if fits.size else before
        switches += sum(last_track.get(instance, track) != track for instance, track in pairs.items())
        last_track |= pairs
        misses += len(frame.instances) - len(pairs)
        false_positives += len(frame.tracks) - len(pairs)
        truths += len(frame.instances)
    return ClearScores(
        mota=1.0 - (misses + false_positives + switches) / truths if truths else None,
        switches=switches,
        misses=misses,
        false_positives=false_positives,
    )


def idf1(frames: Iterable[FrameIdentities]) -> float | None:
    """Share of right identities under the best one-to-one naming of tracks; None where there was no true object."""
    together: Counter[tuple[int, int]] = Counter()
    truths = reports = 0
    for frame in frames:
        for row, column in np.argwhere(frame.similarity >= MIN_SIMILARITY - _ROUNDING):
            together[frame.instances[row], frame.tracks[column]] += 1
        truths += len(frame.instances)
        reports += len(frame.tracks)
    if not truths:
        return None
    instances, tracks = _numbers(i for i, _ in together), _numbers(t for _, t in together)
    counts = np.zeros((len(instances), len(tracks)))
    for (instance, track), number in together.items():
        counts[instances[instance], tracks[track]] = number
    rows, columns = linear_sum_assignment(counts, maximize=True)
    return float(2.0 * counts[rows, columns].sum() / (truths + reports))


@dataclass(frozen=True, slots=True, kw_only=True)
class HotaScores:
    """HOTA and its two parts, each the mean over `HOTA_THRESHOLDS`.

    Attributes:
        hota: at each threshold the geometric mean of the other two.
        detection: DetA, the Jaccard index of true and reported objects.
        association: AssA, the Jaccard index of an instance's and its track's lives, mean over the matched objects.
    """

    hota: float
    detection: float
    association: float


def hota_scores(frames: Sequence[FrameIdentities]) -> HotaScores | None:
    """HOTA of a sequence; None where there was no true object.

    Per frame one assignment serves all thresholds, as in TrackEval, the authors' program: it maximises the similarity
    times the alignment of the two lives as a whole (section 5 of the paper has a threshold in the assignment too).
    """
    instances = _numbers(i for frame in frames for i in frame.instances)
    tracks = _numbers(t for frame in frames for t in frame.tracks)
    if not instances:
        return None
    rows = [np.array([instances[i] for i in frame.instances], np.intp) for frame in frames]
    columns = [np.array([tracks[t] for t in frame.tracks], np.intp) for frame in frames]
    lives = np.bincount(np.concatenate(rows), minlength=len(instances))[:, None] + np.bincount(
        np.concatenate(columns), minlength=len(tracks)
    )
    alignment = _alignment(frames, rows, columns, lives)
    # matched[a, g, t]: frames in which instance g and track t are a pair at threshold a.
    matched = np.zeros((len(HOTA_THRESHOLDS), len(instances), len(tracks)))
    truths = reports = 0
    for frame, row, column in zip(frames, rows, columns, strict=True):
        pairs = linear_sum_assignment(frame.similarity * alignment[np.ix_(row, column)], maximize=True)
        is_hit = frame.similarity[pairs] >= HOTA_THRESHOLDS[:, None] - _ROUNDING
        matched[:, row[pairs[0]], column[pairs[1]]] += is_hit
        truths += len(row)
        reports += len(column)
    hits = matched.sum(axis=(1, 2))
    detection = hits / (truths + reports - hits)
    association = (matched**2 / np.maximum(lives - matched, 1.0)).sum(axis=(1, 2)) / np.maximum(hits, 1.0)
    return HotaScores(
        hota=float(np.sqrt(detection * association).mean()),
        detection=float(detection.mean()),
        association=float(association.mean()),
    )


def _alignment(
    frames: Sequence[FrameIdentities],
    rows: Sequence[npt.NDArray[np.intp]],
    columns: Sequence[npt.NDArray[np.intp]],
    lives: npt.NDArray[np.intp],
) -> FloatArray:
    """(G, T) soft Jaccard index of each instance's and each track's life, before anything is assigned.

    `lives` (G, T) is the number of frames of the instance plus that of the track.
    """
    shared = np.zeros(lives.shape)
    for frame, row, column in zip(frames, rows, columns, strict=True):
        similarity = frame.similarity
        union = similarity.sum(axis=0) + similarity.sum(axis=1, keepdims=True) - similarity
        shared[np.ix_(row, column)] += np.divide(
            similarity, union, out=np.zeros_like(similarity), where=union > _ROUNDING
        )
    aligned: FloatArray = shared / (lives - shared)
    return aligned


def _numbers(ids: Iterable[int]) -> dict[int, int]:
    """The ids in ascending order, each with its place."""
    return {value: place for place, value in enumerate(sorted(set(ids)))}
