"""Matching map points to the corners of an image by Hamming distance.

Each corner is given to one map point at most: the one with the nearest descriptor. All ties go to the lower index,
so the answer does not depend on the order of computation.
"""

import cv2
import numpy as np
import numpy.typing as npt

from dotmask.records import FloatArray
from dotmask.slam.features import Descriptors, Features

Matches = npt.NDArray[np.intp]
"""(M, 2): index of the map point, index of the corner."""

_FAR = 1 << 16


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
    point, corner = _candidates(expected_px, features.pixels, radius_px)
    if len(point) == 0:
        return np.zeros((0, 2), np.intp)
    words = np.ascontiguousarray(descriptors).view(np.uint64)
    other_words = np.ascontiguousarray(features.descriptors).view(np.uint64)
    hamming = np.bitwise_count(words[point] ^ other_words[corner]).sum(axis=1, dtype=np.int64)

    # One sortable key per candidate: distance first, then the corner. The best two per point follow by minima.
    starts = np.flatnonzero(np.r_[True, point[1:] != point[:-1]])
    lengths = np.diff(np.r_[starts, len(point)])
    key = (hamming << 32) | corner
    best_key = np.minimum.reduceat(key, starts)
    others = np.where(key == np.repeat(best_key, lengths), _FAR << 32, key)
    second = np.minimum.reduceat(others, starts) >> 32
    return _one_to_one(point[starts], best_key & 0xFFFFFFFF, best_key >> 32, second, max_hamming, ratio)


def match_anywhere(descriptors: Descriptors, features: Features, *, max_hamming: int, ratio: float) -> Matches:
    """Match without any idea of where the points should appear; arguments as in `match_near`."""
    if len(descriptors) == 0 or len(features) < 2:
        return np.zeros((0, 2), np.intp)
    pairs = cv2.BFMatcher(cv2.NORM_HAMMING).knnMatch(descriptors, features.descriptors, 2)
    table = np.array([(a.queryIdx, a.trainIdx, a.distance, b.distance) for a, b in pairs]).astype(np.int64)
    point, corner, hamming, second = table.T
    return _one_to_one(point, corner, hamming, second, max_hamming, ratio)


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


def _candidates(
    expected_px: FloatArray, pixels: FloatArray, radius_px: float
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Every pair of a point and a corner in its window, in the order of the points.

    The corners are sorted into square cells of the radius, row by row. A window touches three cells of three rows,
    and the three cells of one row are one run of the sorted corners.
    """
    if len(expected_px) == 0 or len(pixels) == 0:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    cells = np.floor(pixels / radius_px).astype(np.int64) + 1  # cell 0 stays empty, as do the last ones
    columns, rows = cells.max(axis=0) + 2
    cell = cells[:, 1] * columns + cells[:, 0]
    order = np.argsort(cell, kind="stable")
    first_of_cell = np.searchsorted(cell[order], np.arange(columns * rows + 1))

    wanted = np.floor(expected_px / radius_px).astype(np.int64) + 1
    wanted[:, 0] = wanted[:, 0].clip(1, columns - 2)  # a clipped window is cut to the true one below
    wanted[:, 1] = wanted[:, 1].clip(1, rows - 2)
    left = (wanted[:, 1:] + np.array([-1, 0, 1])) * columns + wanted[:, :1] - 1
    start, end = first_of_cell[left].ravel(), first_of_cell[left + 3].ravel()
    counts = end - start
    run = np.repeat(np.arange(len(counts)), counts)
    corner = order[np.arange(len(run)) - np.repeat(np.cumsum(counts) - counts, counts) + np.repeat(start, counts)]
    point = run // 3
    inside = (np.abs(expected_px[point] - pixels[corner]) <= radius_px).all(axis=1)
    return point[inside], corner[inside]
