"""Images as the networks were trained on them."""

import torch
from torch import Tensor
from torch.nn import functional

from dotmask.records import ColourImage

MEAN_RGB = (123.68, 116.78, 103.94)
STD_RGB = (58.40, 57.12, 57.38)
"""Of ImageNet, grey levels."""


def network_image(rgb: ColourImage, height: int, width: int, device: torch.device) -> Tensor:
    """(1, 3, height, width) float32 of an image (H, W, 3): stretched bilinearly, then normalised by channel."""
    image = torch.tensor(rgb, device=device).permute(2, 0, 1)[None].float()
    image = functional.interpolate(image, (height, width), mode="bilinear", align_corners=False)
    mean, std = (image.new_tensor(values)[:, None, None] for values in (MEAN_RGB, STD_RGB))
    return (image - mean) / std
