"""Certainty of masks, and their stretching to the size of the image. Compiled by numba."""

# mypy: ignore-errors
# (numba infers the types of these functions from their arguments; numpy's own annotations do not describe them)

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def certainties(masks, threshold):
    """The mean (N,) float32 of what is above a threshold in each of the masks (N, h, w); 0 where nothing is.

    Args:
        masks: float32, at least 0.
        threshold: at least 0.
    """
    means = np.zeros(len(masks), np.float32)
    for n in range(len(masks)):
        top, bottom, first, last = _extent(masks[n])
        total, count = 0.0, 0
        for i in range(top, bottom + 1):
            for value in masks[n, i, first : last + 1]:
                if value > threshold:
                    total += value
                    count += 1
        if count:
            means[n] = total / count
    return means


@njit(cache=True, nogil=True)
def stretched_above(masks, threshold, height, width, least_px):
    """Masks stretched bilinearly to an image, where they are above a threshold; those that are large enough.

    The image's borders lie on those of the mask, and beyond its outermost pixel centres a mask goes on as it is there.
    Only where a mask is not 0 is anything done.

    Args:
        masks: (N, h, w) float32, at least 0.
        threshold: at least 0.
        height: of the image.
        width: of the image.
        least_px: so many pixels of the image are enough, at least 1.

    Returns:
        (M, height, width) bool, and which of the masks they are: (M,) intp, ascending.
    """
    whole = np.zeros((len(masks), height, width), np.bool_)
    rows, columns = masks.shape[1:]
    upper, lower, down = _neighbours(rows, height)
    left, right, across = _neighbours(columns, width)
    widened = np.empty((rows, width), np.float32)
    limit = np.float32(threshold)
    kept = np.empty(len(masks), np.intp)
    count = 0
    for n in range(len(masks)):
        top, bottom, first, last = _extent(masks[n])
        if bottom < 0:
            continue
        begin, end = np.searchsorted(right, first), np.searchsorted(left, last + 1)
        for i in range(max(top - 1, 0), min(bottom + 2, rows)):  # the rows around it are 0, and blended with it
            for u in range(begin, end):
                one, other = masks[n, i, left[u]], masks[n, i, right[u]]
                widened[i, u] = one + (other - one) * across[u]
        start, stop = np.searchsorted(lower, top), np.searchsorted(upper, bottom + 1)
        pixels = 0
        for v in range(start, stop):
            above, below = widened[upper[v], begin:end], widened[lower[v], begin:end]
            row = whole[count, v, begin:end]
            for u in range(len(row)):
                row[u] = above[u] + (below[u] - above[u]) * down[v] > limit
                pixels += row[u]
        if pixels >= least_px:
            kept[count] = n
            count += 1
        else:
            whole[count, start:stop, begin:end] = False
    return whole[:count], kept[:count]


@njit(cache=True, nogil=True)
def _extent(mask):
    """First and last row, first and last column of a mask (h, w) that are not 0 all along; last ones -1 if all are."""
    bits = mask.view(np.int32)  # of numbers that are at least 0, and integers are searched several at a time
    rows, columns = bits.shape
    in_column = np.zeros(columns, np.int32)
    top, bottom = rows, -1
    for i in range(rows):
        in_row = np.int32(0)
        for j in range(columns):
            in_row |= bits[i, j]
            in_column[j] |= bits[i, j]
        if in_row != 0:
            top, bottom = min(top, i), i
    first, last = columns, -1
    for j in range(columns):
        if in_column[j] != 0:
            first, last = min(first, j), j
    return top, bottom, first, last


@njit(cache=True, nogil=True)
def _neighbours(length, stretched):
    """Of each pixel along a stretched side the two pixels it lies between, and how near it is to the second, 0 to 1."""
    first, second = np.empty(stretched, np.intp), np.empty(stretched, np.intp)
    share = np.empty(stretched, np.float32)
    for n in range(stretched):
        place = min(max((n + 0.5) * length / stretched - 0.5, 0.0), length - 1.0)
        first[n] = int(place)
        second[n] = min(first[n] + 1, length - 1)
        share[n] = place - first[n]
    return first, second, share
