"""A small backbone of inverted residuals (Sandler et al., "MobileNetV2", CVPR 2018)."""

from torch import Tensor, nn

STEM = 24
"""Channels of the first convolution."""

EXPANSION = 4
"""A block works on so many times the channels that it is given."""

STAGES = ((32, 2), (56, 3), (112, 5), (192, 4))
"""Channels and blocks at a quarter, an eighth, a sixteenth and a thirty-second of the size."""


class InvertedResidual(nn.Module):
    """1x1 to many channels, 3x3 on each of them alone, 1x1 back to few."""

    def __init__(self, channels_in: int, channels_out: int, stride: int) -> None:
        super().__init__()
        hidden = EXPANSION * channels_in
        self._has_shortcut = stride == 1 and channels_in == channels_out
        self.layers = nn.Sequential(
            nn.Conv2d(channels_in, hidden, 1, bias=False),
            nn.BatchNorm2d(hidden),
            nn.ReLU(inplace=True),
            nn.Conv2d(hidden, hidden, 3, stride, padding=1, groups=hidden, bias=False),
            nn.BatchNorm2d(hidden),
            nn.ReLU(inplace=True),
            nn.Conv2d(hidden, channels_out, 1, bias=False),
            nn.BatchNorm2d(channels_out),
        )

    def forward(self, x: Tensor) -> Tensor:
        """(B, C, H, W) to (B, O, h, w)."""
        y: Tensor = self.layers(x)
        return x + y if self._has_shortcut else y


class CompactBackbone(nn.Module):
    """Features at an eighth, a sixteenth and a thirty-second of the size."""

    CHANNELS = (STAGES[1][0], STAGES[2][0], STAGES[3][0])
    """Of C3, C4 and C5."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = nn.Sequential(
            nn.Conv2d(3, STEM, 3, 2, padding=1, bias=False), nn.BatchNorm2d(STEM), nn.ReLU(inplace=True)
        )
        self.stages = nn.ModuleList()
        channels_in = STEM
        for channels, blocks in STAGES:
            made: list[nn.Module] = [InvertedResidual(channels_in, channels, 2)]
            made += [InvertedResidual(channels, channels, 1) for _ in range(blocks - 1)]
            self.stages.append(nn.Sequential(*made))
            channels_in = channels

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """C3, C4 and C5."""
        x = self.stem(x)
        features = []
        for stage in self.stages:
            x = stage(x)
            features.append(x)
        return features[1], features[2], features[3]
