"""Masks as COCO's compressed run lengths.

A mask is read column by column. The lengths of its runs of 0 and 1, beginning with 0, are written as a string: from the
third run but one on as differences to the run two before, each number in groups of 5 bits, lowest first, with a sixth
bit where another group follows, plus 48 to be printable. The format is that of COCO's own mask code
(https://github.com/cocodataset/cocoapi).
"""

import numpy as np
import numpy.typing as npt

GROUPS = 7
"""Groups of 5 bits that any 32-bit number fits into."""


def counts_from_columns(flat: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
    """Lengths of the runs of 0, 1, 0, ... of a mask's columns, one after the other (W * H,); the first may be 0."""
    changes = np.flatnonzero(flat[1:] != flat[:-1]) + 1
    edges = np.concatenate([[0], changes, [flat.size]])
    lengths = np.diff(edges)
    return np.concatenate([[0], lengths]) if flat.size and flat[0] else lengths


def text_from_counts(counts: npt.NDArray[np.int64]) -> str:
    """The string for run lengths."""
    numbers = counts.astype(np.int64)
    numbers[3:] -= counts[1:-2]
    digits = np.zeros((len(numbers), GROUPS), np.uint8)
    used = np.zeros((len(numbers), GROUPS), np.bool_)
    open_ = np.ones(len(numbers), np.bool_)
    for group in range(GROUPS):
        low = numbers & 31
        numbers = numbers >> 5  # arithmetic: a negative number ends in -1
        more = np.where(low & 16, numbers != -1, numbers != 0)
        digits[:, group] = low + 32 * more + 48
        used[:, group] = open_
        open_ &= more
    return digits[used].tobytes().decode("ascii")
