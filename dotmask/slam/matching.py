"""Matching map points to the corners of an image by Hamming distance.

Each corner is given to one map point at most: the one with the nearest descriptor. All ties go to the lower index,
so the answer does not depend on the order of computation.
"""

import cv2
import numpy as np
import numpy.typing as npt

from dotmask.records import FloatArray
from dotmask.slam.features import Descriptors, Features
from dotmask.slam.matching_kernels import FAR, nearest_two

Matches = npt.NDArray[np.intp]
"""(M, 2): index of the map point, index of the corner."""

Groups = npt.NDArray[np.intp]
"""(N,) which group each descriptor belongs to."""


def match_near(
    expected_px: FloatArray,
    descriptors: Descriptors,
    features: Features,
    *,
    radius_px: float,
    max_hamming: int,
    ratio: float,
) -> Matches:
    """Match each point within `radius_px` of where it is expected.

    Args:
        expected_px: (N, 2) where the points should appear.
        descriptors: (N, 32) of the points.
        features: corners of the image.
        radius_px: half side of the square search window.
        max_hamming: most differing bits.
        ratio: the nearest descriptor in the window must be nearer than this times the second nearest.
    """
    best, second = nearest_two(
        expected_px, _words(descriptors), features.pixels, _words(features.descriptors), radius_px
    )
    return _one_to_one(np.arange(len(best)), best & 0xFFFFFFFF, best >> 32, second >> 32, max_hamming, ratio)


def match_anywhere(descriptors: Descriptors, features: Features, *, max_hamming: int, ratio: float) -> Matches:
    """Match without any idea of where the points should appear; arguments as in `match_near`."""
    if len(descriptors) == 0 or len(features) < 2:
        return np.zeros((0, 2), np.intp)
    pairs = cv2.BFMatcher(cv2.NORM_HAMMING).knnMatch(descriptors, features.descriptors, 2)
    table = np.array([(a.queryIdx, a.trainIdx, a.distance, b.distance) for a, b in pairs]).astype(np.int64)
    point, corner, hamming, second = table.T
    return _one_to_one(point, corner, hamming, second, max_hamming, ratio)


def match_within_groups(
    descriptors: Descriptors,
    groups: Groups,
    other_descriptors: Descriptors,
    other_groups: Groups,
    *,
    max_hamming: int,
    ratio: float,
) -> Matches:
    """Pairs (M, 2) of descriptors that are each other's nearest among those of the same group.

    Args:
        descriptors: (N, 32).
        groups: (N,) the group of each, from 0; alike descriptors should have the same one.
        other_descriptors: (K, 32).
        other_groups: (K,).
        max_hamming: most differing bits.
        ratio: seen from either side, the nearest must be nearer than this times the second nearest of the group; at
            most 1.
    """
    order = np.argsort(other_groups, kind="stable")
    ends = np.searchsorted(other_groups[order], np.arange(max(groups.max(initial=0), other_groups.max(initial=0)) + 2))
    counts = (ends[1:] - ends[:-1])[groups]
    one = np.repeat(np.arange(len(groups)), counts)
    if len(one) == 0:
        return np.zeros((0, 2), np.intp)
    other = order[np.arange(len(one)) - np.repeat(np.cumsum(counts) - counts - ends[groups], counts)]
    hamming = _hamming(descriptors, one, other_descriptors, other)

    best, second = _best_two(one, (hamming << 32) | other, len(groups))
    back = np.argsort(other, kind="stable")
    _, second_back = _best_two(other[back], ((hamming << 32) | one)[back], len(other_groups))
    distance, nearest = best >> 32, best & 0xFFFFFFFF
    candidates = np.flatnonzero((distance <= max_hamming) & (distance < ratio * (second >> 32)))
    to = nearest[candidates]
    # Nearer than the second best of the other side: then it is the other side's best.
    mutual = distance[candidates] < ratio * (second_back[to] >> 32)
    return np.stack([candidates[mutual], to[mutual]], axis=1).astype(np.intp)


def _words(descriptors: Descriptors) -> npt.NDArray[np.uint64]:
    """(N, 4) the same bits."""
    return np.ascontiguousarray(descriptors).view(np.uint64)


def _hamming(
    descriptors: Descriptors,
    chosen: npt.NDArray[np.int64],
    other_descriptors: Descriptors,
    other_chosen: npt.NDArray[np.int64],
) -> npt.NDArray[np.int64]:
    """(P,) differing bits of P pairs of descriptors, each chosen (P,) from (N, 32) and (K, 32)."""
    words = _words(descriptors).take(chosen, axis=0)
    words ^= _words(other_descriptors).take(other_chosen, axis=0)
    a, b, c, d = np.bitwise_count(words).astype(np.int64).T
    return np.asarray(a + b + c + d)  # a reduction over so short an axis takes several times as long


def _best_two(
    owner: npt.NDArray[np.int64], keys: npt.NDArray[np.int64], owners: int
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """The two least keys of each owner (their runs in rising order): two arrays (owners,), far where there is none."""
    starts = np.flatnonzero(np.r_[True, owner[1:] != owner[:-1]])
    lengths = np.diff(np.r_[starts, len(owner)])
    best, second = np.full(owners, FAR << 32), np.full(owners, FAR << 32)
    least = np.minimum.reduceat(keys, starts)
    best[owner[starts]] = least
    others = np.where(keys == np.repeat(least, lengths), FAR << 32, keys)
    second[owner[starts]] = np.minimum.reduceat(others, starts)
    return best, second


def _one_to_one(
    point: npt.NDArray[np.int64],
    corner: npt.NDArray[np.int64],
    hamming: npt.NDArray[np.int64],
    second: npt.NDArray[np.int64],
    max_hamming: int,
    ratio: float,
) -> Matches:
    good = np.flatnonzero((hamming <= max_hamming) & (hamming < ratio * second))
    good = good[np.lexsort((point[good], hamming[good]))]
    _, first = np.unique(corner[good], return_index=True)
    chosen = np.sort(good[first])
    return np.stack([point[chosen], corner[chosen]], axis=1).astype(np.intp)
