"""Masks as combinations of prototypes (YOLACT, section "Mask Assembly")."""

import torch
from torch import Tensor

CROP_MARGIN_PX = 1.0
"""A mask may reach beyond its box by so many pixels of the prototypes."""

THRESHOLD = 0.5
"""A pixel belongs to a mask above it."""


def assemble(prototypes: Tensor, coefficients: Tensor, boxes: Tensor) -> Tensor:
    """Masks (N, h, w) in 0..1, and 0 outside of their boxes.

    Args:
        prototypes: (h, w, K).
        coefficients: (N, K).
        boxes: (N, 4) `x1, y1, x2, y2`, shares of the image.
    """
    masks = mask_logits(prototypes, coefficients).sigmoid_()
    # In place, and side by side: memory costs more here than arithmetic.
    for reach in within_reach(boxes, *prototypes.shape[:2]):
        masks.mul_(reach.to(masks.dtype))
    return masks


def mask_logits(prototypes: Tensor, coefficients: Tensor) -> Tensor:
    """(N, h, w) of prototypes (h, w, K) and coefficients (N, K), in the whole image."""
    height, width = prototypes.shape[:2]
    return (coefficients @ prototypes.flatten(0, 1).T).view(-1, height, width)


def within_reach(boxes: Tensor, height: int, width: int) -> tuple[Tensor, Tensor]:
    """Rows (N, height, 1) and columns (N, 1, width), bool, where the mask of each box (N, 4) may be.

    That is inside of the box, or `CROP_MARGIN_PX` beyond.
    """
    x = torch.arange(width, device=boxes.device, dtype=boxes.dtype)
    y = torch.arange(height, device=boxes.device, dtype=boxes.dtype)
    left, top, right, bottom = (boxes * boxes.new_tensor([width, height, width, height])).T[:, :, None]
    in_columns = (x >= left - CROP_MARGIN_PX) & (x < right + CROP_MARGIN_PX)
    in_rows = (y >= top - CROP_MARGIN_PX) & (y < bottom + CROP_MARGIN_PX)
    return in_rows[:, :, None], in_columns[:, None, :]
