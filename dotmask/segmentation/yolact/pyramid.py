"""The feature pyramid (Lin et al., CVPR 2017), as YOLACT has it: no P2, and P6 and P7 by two more convolutions."""

from collections.abc import Sequence

from torch import Tensor, nn
from torch.nn import functional

NORMALISED_TOGETHER = 8
"""Channels of a group."""


def convolution(channels_in: int, channels: int, *, is_normalised: bool) -> nn.Module:
    """3x3, with group normalisation or without."""
    layer = nn.Conv2d(channels_in, channels, 3, padding=1)
    return nn.Sequential(layer, nn.GroupNorm(channels // NORMALISED_TOGETHER, channels)) if is_normalised else layer


def added(coarse: Tensor, fine: Tensor) -> Tensor:
    """Features (B, C, h, w), stretched bilinearly, and finer ones (B, C, H, W)."""
    return functional.interpolate(coarse, size=fine.shape[2:], mode="bilinear", align_corners=False) + fine


class FeaturePyramid(nn.Module):
    """Levels P3 to P7 from C3, C4 and C5.

    Args:
        channels_in: of C3, C4 and C5.
        channels: of all levels.
        is_normalised: see `dotmask.segmentation.yolact.design.YolactDesign`.
    """

    def __init__(self, channels_in: Sequence[int], channels: int, *, is_normalised: bool) -> None:
        super().__init__()
        # Both lists begin with the coarsest level, as in the authors' checkpoints.
        self.lat_layers = nn.ModuleList(nn.Conv2d(n, channels, 1) for n in reversed(channels_in))
        self.pred_layers = nn.ModuleList(
            convolution(channels, channels, is_normalised=is_normalised) for _ in channels_in
        )
        self.downsample_layers = nn.ModuleList(nn.Conv2d(channels, channels, 3, 2, padding=1) for _ in range(2))

    def forward(self, features: Sequence[Tensor]) -> list[Tensor]:
        """(B, C, h, w) of C3, C4, C5 to (B, channels, h, w) of P3 to P7."""
        merged: list[Tensor] = []
        for lateral, feature in zip(self.lat_layers, reversed(features), strict=True):
            level: Tensor = lateral(feature)
            if merged:
                level = added(merged[-1], level)
            merged.append(level)
        levels = [functional.relu(layer(level)) for layer, level in zip(self.pred_layers, merged, strict=True)]
        levels.reverse()
        for layer in self.downsample_layers:
            levels.append(layer(levels[-1]))  # without a ReLU between them
        return levels
