"""Anchors, and the boxes that offsets from them mean (Liu et al., "SSD", ECCV 2016)."""

import torch
from torch import Tensor

from dotmask.segmentation.yolact.design import YolactDesign

CENTRE_VARIANCE, SIZE_VARIANCE = 0.1, 0.2
"""Scales of the offsets: both are learnt with a spread of about one."""


def anchors_of(design: YolactDesign) -> Tensor:
    """(A, 4) centre x and y, width and height of all anchors, shares of the image.

    The order is that of the head: level by level, row by row, place by place; at a place by scale, and within a scale
    by aspect ratio.
    """
    levels = []
    for (rows, columns), scales_px in zip(design.level_sizes, design.scales_px, strict=True):
        sizes = []
        for scale_px in scales_px:
            for ratio in design.aspect_ratios:
                width = scale_px * ratio**0.5 / design.width
                height = scale_px / ratio**0.5 / design.height
                sizes.append((width, width if design.has_square_anchors else height))
        y = (torch.arange(rows, dtype=torch.float64) + 0.5) / rows
        x = (torch.arange(columns, dtype=torch.float64) + 0.5) / columns
        centres = torch.stack([x.expand(rows, columns), y[:, None].expand(rows, columns)], dim=-1)
        shape = (rows, columns, len(sizes), 2)
        both = centres[:, :, None].expand(shape), torch.tensor(sizes, dtype=torch.float64).expand(shape)
        levels.append(torch.cat(both, dim=-1).reshape(-1, 4))
    return torch.cat(levels).float()


def decode(offsets: Tensor, anchors: Tensor) -> Tensor:
    """Boxes (..., 4) `x1, y1, x2, y2` that offsets (..., 4) from anchors (..., 4) mean."""
    centres = anchors[..., :2] + CENTRE_VARIANCE * offsets[..., :2] * anchors[..., 2:]
    sizes = anchors[..., 2:] * torch.exp(SIZE_VARIANCE * offsets[..., 2:])
    corners = centres - sizes / 2
    return torch.cat([corners, corners + sizes], dim=-1)
