"""A colour image that is not taken at once: motion blur and rolling shutter out of several renders.

The time from the first row's first light to the last row's last is cut into equal slices. One render in the middle of
each slice, of the rows that collect light in it alone, enters every row with the share of the row's exposure that
falls into the slice. Grey levels are averaged as they are stored.
"""

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from sim.sensor.timing import Timing

SLICE_S = 0.003
"""No slice is longer."""

SLICE_PX = 2.0
"""No slice moves the image farther, unless that takes more than MAX_SLICES."""

MAX_SLICES = 64

_SHORTEST_S = 1e-9

RenderRows = Callable[[float, tuple[int, int]], npt.NDArray[np.uint8]]
"""Rows first..last-1 of the colour image at a time: (last - first, W, 3)."""


def expose(
    render_rows: RenderRows, time_s: float, shape: tuple[int, int], timing: Timing, speed_px_s: float
) -> npt.NDArray[np.uint8]:
    """The colour image (H, W, 3) whose middle row is exposed around `time_s`.

    Args:
        render_rows: what the scene looks like at a time.
        time_s: middle of the exposure of the middle row.
        shape: height and width of the image.
        timing: exposure and read-out.
        speed_px_s: about how fast the image moves: how finely time must be cut.
    """
    height, width = shape
    exposure_s = max(timing.exposure_s, _SHORTEST_S)
    rows_s = timing.row_times_s(height)
    first_s, last_s = float(rows_s[0]) - exposure_s / 2, float(rows_s[-1]) + exposure_s / 2
    count = slices(last_s - first_s, speed_px_s)
    edges = np.linspace(first_s, last_s, count + 1)
    total = np.zeros((height, width, 3), np.float32)
    for start_s, end_s in pairwise(edges):
        opened, closed = np.maximum(rows_s - exposure_s / 2, start_s), np.minimum(rows_s + exposure_s / 2, end_s)
        share = np.maximum(closed - opened, 0.0) / exposure_s
        lit = np.flatnonzero(share > 0)
        if len(lit):
            rows = int(lit[0]), int(lit[-1]) + 1
            weights = share[slice(*rows)].astype(np.float32)
            total[slice(*rows)] += weights[:, None, None] * render_rows(time_s + float(start_s + end_s) / 2, rows)
    return np.asarray(np.floor(total + np.float32(0.5)), np.uint8)


def slices(span_s: float, speed_px_s: float) -> int:
    """Into how many slices a time is cut."""
    wanted = max(span_s / SLICE_S, span_s * speed_px_s / SLICE_PX, 1.0)
    return min(math.ceil(wanted), MAX_SLICES)
