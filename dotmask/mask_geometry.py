"""Masks as shapes: where they lie, how they overlap, and how they move with their object."""

from functools import cache

import cv2
import numpy as np
import numpy.typing as npt

from dotmask.geometry import project
from dotmask.records import FloatArray, Intrinsics, MaskImage


def bounding_rectangle(mask: MaskImage) -> tuple[int, int, int, int]:
    """Left, top, width, height (pixels) of a mask (H, W); all 0 for an empty one."""
    u, v, width, height = cv2.boundingRect(mask.view(np.uint8))
    return (u, v, width, height) if width else (0, 0, 0, 0)


def enclosing_rectangle(mask: MaskImage, expected_px: FloatArray | None) -> tuple[int, int, int, int]:
    """Left, top, width, height (pixels) of a rectangle in the image that holds all of a mask; quick if it is expected.

    Args:
        mask: (H, W).
        expected_px: (4,) `u_min, v_min, u_max, v_max` of a box; where it does not hold all of the mask, or is None, the
            answer is the bounding rectangle.
    """
    if expected_px is not None:
        u_min, v_min, u_max, v_max = expected_px.tolist()
        left, top = max(int(u_min), 0), max(int(v_min), 0)
        right, bottom = min(int(u_max) + 1, mask.shape[1]), min(int(v_max) + 1, mask.shape[0])
        if left < right and top < bottom:
            pixels = mask.view(np.uint8)
            rows = pixels[top:bottom]
            outside = pixels[:top], pixels[bottom:], rows[:, :left], rows[:, right:]
            if not any(part.size and cv2.hasNonZero(part) for part in outside):
                return left, top, right - left, bottom - top
    return bounding_rectangle(mask)


def intersection_over_union(first: MaskImage, second: MaskImage) -> float:
    """IoU of two masks (H, W); 0 where both are empty."""
    one, other = first.view(np.uint8), second.view(np.uint8)
    both = cv2.countNonZero(cv2.bitwise_and(one, other))
    union = cv2.countNonZero(one) + cv2.countNonZero(other) - both
    return both / union if union else 0.0


def aligned_iou(first: MaskImage, second: MaskImage) -> float:
    """IoU after the first mask's bounding box was moved and scaled onto the second's; 0 where one is empty.

    So neither an object that crosses the image nor one that comes nearer, nor a moving camera, looks like deformation.
    """
    a, b = bounding_rectangle(first), bounding_rectangle(second)
    if a[2] == 0 or b[2] == 0:
        return 0.0
    one = cv2.resize(_cut(first, a), (b[2], b[3]), interpolation=cv2.INTER_NEAREST_EXACT).view(np.bool_)
    other = _cut(second, b).view(np.bool_)
    return int(np.count_nonzero(one & other)) / int(np.count_nonzero(one | other))


def moved_mask(mask: MaskImage, p_before: FloatArray, p_now: FloatArray, intrinsics: Intrinsics) -> MaskImage:
    """Where a mask lies after its object moved, without a change of its outline.

    Args:
        mask: (H, W).
        p_before: (3,) where the object was in the camera frame when the mask was seen, metres.
        p_now: (3,) where it is now. Behind the camera the result is empty.
        intrinsics: of the camera.
    """
    moved = np.zeros_like(mask)
    u, v, width, height = bounding_rectangle(mask)
    if width == 0 or not (p_now[2] > 0 and p_before[2] > 0):
        return moved
    scale = float(p_before[2] / p_now[2])
    # Pixel u reaches from u to u + 1 here, its centre lies at u + 0.5.
    before, now = (project(p[None], intrinsics)[0] + 0.5 for p in (p_before, p_now))
    left, top = now + scale * (np.array([u, v]) - before)
    right, bottom = left + scale * width, top + scale * height
    rows, columns = _whole(top, bottom, mask.shape[0]), _whole(left, right, mask.shape[1])
    if rows[0] >= rows[1] or columns[0] >= columns[1]:
        return moved
    from_row = _sources(rows, top, scale, height)
    from_column = _sources(columns, left, scale, width)
    part = mask[v : v + height, u : u + width]
    moved[rows[0] : rows[1], columns[0] : columns[1]] = part[np.ix_(from_row, from_column)]
    return moved


def dilate(mask: MaskImage, radius_px: int) -> MaskImage:
    """`mask` (H, W) grown by a disc of `radius_px` pixels."""
    grown = np.zeros_like(mask)
    u, v, width, height = bounding_rectangle(mask)
    rows = slice(max(v - radius_px, 0), min(v + height + radius_px, mask.shape[0]))
    columns = slice(max(u - radius_px, 0), min(u + width + radius_px, mask.shape[1]))
    if width:
        grown[rows, columns] = cv2.dilate(mask.view(np.uint8)[rows, columns], disc(radius_px)).view(np.bool_)
    return grown


@cache
def disc(radius_px: int) -> npt.NDArray[np.uint8]:
    """(2 r + 1, 2 r + 1) 1 inside a disc, else 0."""
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius_px + 1, 2 * radius_px + 1)), np.uint8)


@cache
def disc_half_widths(radius_px: int) -> npt.NDArray[np.intp]:
    """(2 r + 1,) how far the same disc reaches to both sides of its middle column, row by row."""
    return np.asarray((disc(radius_px).sum(axis=1, dtype=np.intp) - 1) // 2, np.intp)


def _cut(mask: MaskImage, rectangle: tuple[int, int, int, int]) -> npt.NDArray[np.uint8]:
    u, v, width, height = rectangle
    return np.ascontiguousarray(mask[v : v + height, u : u + width]).view(np.uint8)


def _whole(low: float, high: float, limit: int) -> tuple[int, int]:
    """First and last + 1 of the pixels whose centres lie between two edges of pixels, inside the image."""
    return max(int(np.ceil(low - 0.5)), 0), min(int(np.floor(high - 0.5)) + 1, limit)


def _sources(span: tuple[int, int], low: float, scale: float, length: int) -> npt.NDArray[np.intp]:
    """For each pixel of the span the nearest one of a strip that began at `low` after it was scaled."""
    places = (np.arange(*span) + 0.5 - low) / scale
    return np.clip(places.astype(np.intp), 0, length - 1)
