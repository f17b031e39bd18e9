"""A small backbone: basic residual blocks (He et al., CVPR 2016), which a CPU does faster than ones by channel."""

from torch import Tensor, nn

STEM = 16
"""Channels of the first convolution."""

STAGES = ((32, 1), (64, 2), (128, 2), (192, 2))
"""Channels and blocks at a quarter, an eighth, a sixteenth and a thirty-second of the size."""


class BasicBlock(nn.Module):
    """Two 3x3 convolutions beside a shortcut."""

    def __init__(self, channels_in: int, channels: int, stride: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            nn.Conv2d(channels_in, channels, 3, stride, padding=1, bias=False),
            nn.BatchNorm2d(channels),
            nn.ReLU(inplace=True),
            nn.Conv2d(channels, channels, 3, padding=1, bias=False),
            nn.BatchNorm2d(channels),
        )
        self.relu = nn.ReLU(inplace=True)
        self.shortcut: nn.Module = (
            nn.Identity()
            if stride == 1
            else nn.Sequential(nn.Conv2d(channels_in, channels, 1, stride, bias=False), nn.BatchNorm2d(channels))
        )

    def forward(self, x: Tensor) -> Tensor:
        """(B, C, H, W) to (B, channels, h, w)."""
        y: Tensor = self.relu(self.layers(x) + self.shortcut(x))
        return y


class CompactBackbone(nn.Module):
    """Features at a half, a quarter, an eighth, a sixteenth and a thirty-second of the size.

    Args:
        channels_in: of the image.
    """

    CHANNELS = (STEM, *(channels for channels, _ in STAGES))
    """Of C1 to C5."""

    def __init__(self, channels_in: int) -> None:
        super().__init__()
        self.stem = nn.Sequential(
            nn.Conv2d(channels_in, STEM, 3, 2, padding=1, bias=False), nn.BatchNorm2d(STEM), nn.ReLU(inplace=True)
        )
        self.stages = nn.ModuleList()
        for (channels, blocks), before in zip(STAGES, self.CHANNELS[:-1], strict=True):
            made: list[nn.Module] = [BasicBlock(before, channels, 2)]
            made += [BasicBlock(channels, channels, 1) for _ in range(blocks - 1)]
            self.stages.append(nn.Sequential(*made))

    def forward(self, x: Tensor) -> list[Tensor]:
        """C1 to C5."""
        features = [self.stem(x)]
        for stage in self.stages:
            features.append(stage(features[-1]))
        return features
