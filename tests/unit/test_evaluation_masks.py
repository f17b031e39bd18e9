import numpy as np
import pytest

from dotmask.evaluation.contours import boundary_f
from dotmask.evaluation.masks import MaskCounts, count_masking, count_outlines, count_overlap
from dotmask.evaluation.matching import mask_ious

IDS = np.zeros((10, 10), np.uint16)
IDS[:, :3], IDS[:, 3:5] = 4, 9  # 30 pixels of instance 4, 20 of instance 9, 50 of background
DEPTH = np.full((10, 10), 2.0, np.float32)


def test_leak_and_waste_by_hand() -> None:
    mo_mdi = DEPTH.copy()
    mo_mdi[:, :2] = 0  # 20 of 30 moving pixels masked
    mo_mdi[:7, 4] = 0  # 7 static pixels lost
    counts = count_masking(DEPTH, mo_mdi, IDS, [4])
    assert (counts.moving_pixels, counts.leaked_pixels) == (30, 10)
    assert (counts.static_pixels, counts.wasted_pixels) == (70, 7)
    assert counts.leak == pytest.approx(1 / 3)
    assert counts.waste == pytest.approx(0.1)


def test_pixels_without_depth_are_neither_leaked_nor_wasted() -> None:
    depth = DEPTH.copy()
    depth[:5] = 0
    counts = count_masking(depth, np.zeros_like(depth), IDS, [4])
    assert (counts.moving_pixels, counts.leaked_pixels, counts.static_pixels, counts.wasted_pixels) == (15, 0, 35, 35)


def test_movers_out_of_view_and_none_at_all() -> None:
    assert count_masking(DEPTH, DEPTH, IDS, [400]).leak is None
    nothing = count_masking(DEPTH, DEPTH, IDS, [])
    assert (nothing.leak, nothing.waste, nothing.iou, nothing.boundary_f) == (None, 0.0, None, None)


def test_counts_add_up() -> None:
    one, two = count_masking(DEPTH, DEPTH, IDS, [4]), count_masking(DEPTH, 0 * DEPTH, IDS, [4])
    total = one + two + MaskCounts()
    assert total.leak == pytest.approx(0.5)
    assert total.waste == pytest.approx(0.5)


def test_overlap_and_outline_of_the_matched_detections() -> None:
    exact, half = IDS == 4, IDS == 9
    half = half & (np.arange(10)[:, None] < 5)
    masks, matches = np.array([exact, half, exact]), (4, 9, None)
    counts = count_overlap(mask_ious(masks, IDS), matches) + count_outlines(masks, IDS, matches)
    assert (counts.matched_detections, counts.outlined_detections) == (2, 2)
    assert counts.iou == pytest.approx(0.75)
    assert counts.boundary_f == pytest.approx((1 + boundary_f(half, IDS == 9)) / 2)
    assert counts.boundary_f < 1
