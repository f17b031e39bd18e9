"""The search for the nearest descriptors in windows of an image. Compiled by numba."""

# mypy: ignore-errors
# (numba infers the types of these functions from their arguments; numpy's own annotations do not describe them)

from math import floor

import numpy as np
from numba import njit

FAR = 1 << 16
"""More bits than descriptors have: none was found."""

_ODD, _PAIRS, _NIBBLES = np.uint64(0x5555555555555555), np.uint64(0x3333333333333333), np.uint64(0x0F0F0F0F0F0F0F0F)
_BYTES, _ONE, _TWO, _FOUR, _TOP = (np.uint64(n) for n in (0x0101010101010101, 1, 2, 4, 56))


@njit(cache=True, nogil=True)
def nearest_two(expected_px, words, corner_px, corner_words, radius_px):
    """For each point the two nearest corners inside its window: keys (N,) of the first and of the second.

    A key is the number of differing bits, times 2^32, plus the index of the corner, so equal distances go to the lower
    index; `FAR` bits where there is none. The corners are sorted into square cells of the radius, so a window touches
    three cells of three rows.

    Args:
        expected_px: (N, 2) where the points should appear; what is not finite is in no window.
        words: (N, 4) uint64, descriptors of the points.
        corner_px: (K, 2).
        corner_words: (K, 4) uint64.
        radius_px: half side of the square window.
    """
    best, second = np.full(len(expected_px), FAR << 32), np.full(len(expected_px), FAR << 32)
    if len(corner_px) == 0:
        return best, second
    u_min, v_min, u_max, v_max = corner_px[0, 0], corner_px[0, 1], corner_px[0, 0], corner_px[0, 1]
    for k in range(1, len(corner_px)):
        u_min, u_max = min(u_min, corner_px[k, 0]), max(u_max, corner_px[k, 0])
        v_min, v_max = min(v_min, corner_px[k, 1]), max(v_max, corner_px[k, 1])
    columns, rows = int((u_max - u_min) / radius_px) + 1, int((v_max - v_min) / radius_px) + 1

    cell_of = np.empty(len(corner_px), np.intp)
    ends = np.zeros(columns * rows + 1, np.intp)
    for k in range(len(corner_px)):
        row, column = int((corner_px[k, 1] - v_min) / radius_px), int((corner_px[k, 0] - u_min) / radius_px)
        cell_of[k] = row * columns + column
        ends[cell_of[k] + 1] += 1
    ends = np.cumsum(ends)
    sorted_corners, filled = np.empty(len(corner_px), np.intp), ends.copy()
    for k in range(len(corner_px)):
        sorted_corners[filled[cell_of[k]]] = k
        filled[cell_of[k]] += 1

    for n in range(len(expected_px)):
        u, v = expected_px[n, 0], expected_px[n, 1]
        is_near = u_min - radius_px <= u <= u_max + radius_px and v_min - radius_px <= v <= v_max + radius_px
        if not is_near:
            continue
        column, row = floor((u - u_min) / radius_px), floor((v - v_min) / radius_px)
        left, right = max(column - 1, 0), min(column + 1, columns - 1)
        for r in range(max(row - 1, 0), min(row + 1, rows - 1) + 1):
            for place in range(ends[r * columns + left], ends[r * columns + right + 1]):
                k = sorted_corners[place]
                if abs(u - corner_px[k, 0]) > radius_px or abs(v - corner_px[k, 1]) > radius_px:
                    continue
                bits = 0
                for word in range(4):
                    bits += _ones(words[n, word] ^ corner_words[k, word])
                key = (bits << 32) | k
                if key < best[n]:
                    best[n], second[n] = key, best[n]
                elif key < second[n]:
                    second[n] = key
    return best, second


@njit(inline="always")
def _ones(word):
    """The number of ones among the bits of a uint64."""
    word = word - ((word >> _ONE) & _ODD)
    word = (word & _PAIRS) + ((word >> _TWO) & _PAIRS)
    return np.int64((((word + (word >> _FOUR)) & _NIBBLES) * _BYTES) >> _TOP)
