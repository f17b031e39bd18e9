"""Masks as combinations of prototypes (YOLACT, section "Mask Assembly")."""

import torch
from torch import Tensor
from torch.nn import functional

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
    masks = torch.sigmoid(prototypes @ coefficients.T).permute(2, 0, 1)
    height, width = masks.shape[1:]
    x = torch.arange(width, device=masks.device, dtype=boxes.dtype)
    y = torch.arange(height, device=masks.device, dtype=boxes.dtype)
    left, top, right, bottom = (boxes * boxes.new_tensor([width, height, width, height])).T[:, :, None]
    in_columns = (x >= left - CROP_MARGIN_PX) & (x < right + CROP_MARGIN_PX)
    in_rows = (y >= top - CROP_MARGIN_PX) & (y < bottom + CROP_MARGIN_PX)
    cropped: Tensor = masks * (in_rows[:, :, None] & in_columns[:, None, :])
    return cropped


def full_size(masks: Tensor, height: int, width: int) -> Tensor:
    """Masks (N, h, w) in 0..1 as masks (N, height, width) of bool."""
    if not len(masks):
        return masks.new_zeros((0, height, width), dtype=torch.bool)
    stretched = functional.interpolate(masks[None], (height, width), mode="bilinear", align_corners=False)[0]
    return stretched > THRESHOLD
