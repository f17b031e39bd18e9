"""How well the outline of a mask follows the true one (boundary F-score).

Perazzi et al. 2016, "A Benchmark Dataset and Evaluation Methodology for Video Object Segmentation" (DAVIS), section 4.
"""

import math
from functools import cache

import cv2
import numpy as np
import numpy.typing as npt

from dotmask.records import MaskImage

TOLERANCE = 0.008
"""Pixels of two contours agree if they are no farther apart than this share of the image's diagonal (paper)."""


_SQUARE = np.ones((2, 2), np.uint8)


def boundary_f(mask: MaskImage, truth: MaskImage) -> float:
    """Harmonic mean of precision and recall of the contour pixels of `mask`, both (H, W).

    Precision is the share of its contour pixels that have one of the truth's near, recall the share of the truth's that
    have one of its near; near is within `TOLERANCE`, rounded up to whole pixels as in the authors' program. The border
    of the image is no contour. 1 where neither has a contour, 0 where one has none.
    """
    radius_px = math.ceil(TOLERANCE * math.hypot(*mask.shape))
    region = _region(mask, truth, radius_px)
    mask, truth = mask[region], truth[region]
    if np.array_equal(mask, truth):
        return 1.0
    found, wanted = _contour(mask), _contour(truth)
    if not found.any() or not wanted.any():
        return float(not found.any() and not wanted.any())
    precision = _share_near(found, wanted, radius_px)
    recall = _share_near(wanted, found, radius_px)
    return 2.0 * precision * recall / (precision + recall) if precision + recall else 0.0


def _region(mask: MaskImage, truth: MaskImage, margin_px: int) -> tuple[slice, slice]:
    """The rectangle around both masks, wide enough that nothing outside of it counts."""
    u, v, width, height = cv2.boundingRect((mask | truth).view(np.uint8))
    rows = slice(max(v - margin_px, 0), v + height + margin_px)
    return rows, slice(max(u - margin_px, 0), u + width + margin_px)


def _contour(mask: MaskImage) -> MaskImage:
    """Where a pixel of `mask` differs from its neighbour to the right, below, or right below."""
    gradient = cv2.morphologyEx(mask.view(np.uint8), cv2.MORPH_GRADIENT, _SQUARE, anchor=(0, 0))
    return np.asarray(gradient, np.bool_)


def _share_near(contour: MaskImage, other: MaskImage, radius_px: int) -> float:
    near = np.asarray(cv2.dilate(other.view(np.uint8), _disc(radius_px)), np.bool_)
    return float(np.count_nonzero(contour & near) / np.count_nonzero(contour))


@cache
def _disc(radius_px: int) -> npt.NDArray[np.uint8]:
    offsets = np.arange(-radius_px, radius_px + 1)
    return np.asarray(offsets[:, None] ** 2 + offsets**2 <= radius_px**2).astype(np.uint8)
