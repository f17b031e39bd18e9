"""Pairing two streams of time stamps."""

from bisect import bisect_left

import numpy as np
import numpy.typing as npt

from dotmask.records import FloatArray


def nearest_pairs(a_s: FloatArray, b_s: FloatArray, max_difference_s: float) -> npt.NDArray[np.intp]:
    """Indices (M, 2) into two rising series of times, each index used once, in the order of time.

    The closest pair is taken first, as in the TUM benchmark's `associate.py`; a pair that would cross an accepted
    one (later in `a` but earlier in `b`) is not taken. Ties go to the earlier stamps.

    Args:
        a_s: (N,) rising, seconds.
        b_s: (M,) rising, seconds.
        max_difference_s: pairs further apart than this are none.
    """
    # Every candidate pair: the run of b within reach of each a.
    first = np.searchsorted(b_s, a_s - max_difference_s, side="left")
    counts = np.searchsorted(b_s, a_s + max_difference_s, side="right") - first
    i = np.repeat(np.arange(len(a_s)), counts)
    j = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts) + np.repeat(first, counts)
    closest_first = np.lexsort((j, i, np.abs(a_s[i] - b_s[j])))

    pairs: list[tuple[int, int]] = []  # sorted in both columns at any time
    for candidate in zip(i[closest_first].tolist(), j[closest_first].tolist(), strict=True):
        place = bisect_left(pairs, candidate)
        after_previous = place == 0 or (pairs[place - 1][0] < candidate[0] and pairs[place - 1][1] < candidate[1])
        before_next = place == len(pairs) or (candidate[0] < pairs[place][0] and candidate[1] < pairs[place][1])
        if after_previous and before_next:
            pairs.insert(place, candidate)
    return np.array(pairs, dtype=np.intp).reshape(-1, 2)
