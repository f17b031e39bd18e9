"""Images as the networks were trained on them."""

from typing import TypeVar

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor
from torch.nn import functional

from dotmask.records import RgbdFrame
from dotmask.segmentation.yolact.design import YolactDesign

Depth = TypeVar("Depth", bound=np.generic)

MEAN_RGB = (123.68, 116.78, 103.94)
STD_RGB = (58.40, 57.12, 57.38)
"""Of ImageNet, grey levels."""

MEAN_NEARNESS, STD_NEARNESS = 0.4, 0.3
"""Of the inverse of the depth, 1/m, in rooms."""


def network_image(frame: RgbdFrame, design: YolactDesign, device: torch.device) -> Tensor:
    """(1, channels, height, width) float32 of a frame, stretched to the network's size; depth comes after colour."""
    image = torch.tensor(frame.rgb, device=device).permute(2, 0, 1)[None].float()
    image = functional.interpolate(image, (design.height, design.width), mode="bilinear", align_corners=False)
    colour = colour_channels(image)
    if not design.sees_depth:
        return colour
    depth = torch.tensor(stretched(frame.depth_m, design.height, design.width), device=device)
    return torch.cat([colour, depth_channel(depth[None, None])], dim=1)


def colour_channels(images: Tensor) -> Tensor:
    """Grey levels (B, 3, height, width), float, as the network is given them: normalised by channel."""
    mean, std = (images.new_tensor(values)[:, None, None] for values in (MEAN_RGB, STD_RGB))
    return (images - mean) / std


def stretched(depth: npt.NDArray[Depth], height: int, width: int) -> npt.NDArray[Depth]:
    """(height, width) of a depth image (H, W), each pixel from the nearest one: the mean of two surfaces is none."""
    rows, columns = (
        ((np.arange(count) + 0.5) * size / count).astype(np.int64)
        for count, size in zip((height, width), depth.shape, strict=True)
    )
    nearest: npt.NDArray[Depth] = depth[rows[:, None], columns]
    return nearest


def depth_channel(depth_m: Tensor) -> Tensor:
    """Depth in metres as the network is given it: its inverse, normalised; no return is infinitely far.

    The error of a depth camera is one of the disparity, and so the same near and far in the inverse of the depth.
    """
    nearness = torch.where(depth_m > 0, 1 / depth_m, 0.0)
    return (nearness - MEAN_NEARNESS) / STD_NEARNESS
