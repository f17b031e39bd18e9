"""Removal of a grown mask from a depth image: the inner loop of the masking. Compiled by numba."""

# mypy: ignore-errors
# (numba infers the types of these functions from their arguments; numpy's own annotations do not describe them)

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def clear_grown(depth_m, mask, left, top, width, height, half_widths_px):
    """Set the depth to 0 wherever the mask, grown by a convex and symmetric shape, lies.

    Every run of mask pixels in a row makes a run in each of the rows that the shape reaches, longer by the shape's half
    width there. How many such runs begin and end at a pixel is counted first; a running sum then says what is covered,
    in a time that hardly depends on the size of the shape.

    Args:
        depth_m: (H, W) float32, changed.
        mask: (H, W) bool.
        left: of a rectangle that holds all of the mask, inside the image.
        top: likewise.
        width: likewise.
        height: likewise.
        half_widths_px: (2 r + 1,) intp of the shape, row by row: 0 is a single pixel.
    """
    reach = len(half_widths_px) // 2
    first_row, last_row = max(top - reach, 0), min(top + height - 1 + reach, mask.shape[0] - 1)
    first, last = max(left - reach, 0), min(left + width - 1 + reach, mask.shape[1] - 1)
    steps = np.zeros((last_row - first_row + 1, last - first + 2), np.int16)
    end = left + width
    for v in range(top, top + height):
        u = left
        while u < end:
            if not mask[v, u]:
                u += 1
                continue
            begin = u
            while u < end and mask[v, u]:
                u += 1
            for k in range(max(first_row - v, -reach), min(last_row - v, reach) + 1):
                half = half_widths_px[k + reach]
                steps[v + k - first_row, max(begin - half, first) - first] += 1
                steps[v + k - first_row, min(u - 1 + half, last) + 1 - first] -= 1
    for v in range(first_row, last_row + 1):
        covering = 0
        for u in range(first, last + 1):
            covering += steps[v - first_row, u - first]
            if covering > 0:
                depth_m[v, u] = 0.0
