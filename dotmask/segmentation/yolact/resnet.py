"""ResNet-50 (He et al., CVPR 2016), with the stride of a block in its 3x3 convolution."""

from torch import Tensor, nn

from dotmask.segmentation.yolact.deformable import DeformableConv2d

EXPANSION = 4
"""A block gives so many times the channels of its 3x3 convolution."""

STAGES = ((64, 3, 1), (128, 4, 2), (256, 6, 2), (512, 3, 2))
"""Channels, blocks and stride of the four stages."""


class Bottleneck(nn.Module):
    """1x1, 3x3 and 1x1 convolution beside a shortcut."""

    def __init__(self, channels_in: int, channels: int, stride: int, *, is_deformable: bool, is_first: bool) -> None:
        super().__init__()
        channels_out = EXPANSION * channels
        self.conv1 = nn.Conv2d(channels_in, channels, 1, bias=False)
        self.bn1 = nn.BatchNorm2d(channels)
        self.conv2: nn.Module = (
            DeformableConv2d(channels, channels, stride)
            if is_deformable
            else nn.Conv2d(channels, channels, 3, stride, padding=1, bias=False)
        )
        self.bn2 = nn.BatchNorm2d(channels)
        self.conv3 = nn.Conv2d(channels, channels_out, 1, bias=False)
        self.bn3 = nn.BatchNorm2d(channels_out)
        self.relu = nn.ReLU(inplace=True)
        self.downsample: nn.Module | None = None
        if is_first:
            shortcut = nn.Conv2d(channels_in, channels_out, 1, stride, bias=False)
            self.downsample = nn.Sequential(shortcut, nn.BatchNorm2d(channels_out))

    def forward(self, x: Tensor) -> Tensor:
        """(B, C, H, W) to (B, 4 channels, h, w)."""
        shortcut: Tensor = x if self.downsample is None else self.downsample(x)
        y = self.relu(self.bn1(self.conv1(x)))
        y = self.relu(self.bn2(self.conv2(y)))
        y = self.bn3(self.conv3(y))
        out: Tensor = self.relu(y + shortcut)
        return out


class ResNet50(nn.Module):
    """The backbone of the published networks.

    Args:
        is_deformable: whether the 3x3 convolutions of all stages but the first are deformable.
    """

    CHANNELS = (512, 1024, 2048)
    """Of C3, C4 and C5."""

    def __init__(self, *, is_deformable: bool) -> None:
        super().__init__()
        self.layers = nn.ModuleList()
        channels_in = 64
        for stage, (channels, blocks, stride) in enumerate(STAGES):
            made: list[nn.Module] = []
            for block in range(blocks):
                is_first = block == 0
                made.append(
                    Bottleneck(
                        channels_in,
                        channels,
                        stride if is_first else 1,
                        is_deformable=is_deformable and stage > 0,
                        is_first=is_first,
                    )
                )
                channels_in = EXPANSION * channels
            self.layers.append(nn.Sequential(*made))
        self.conv1 = nn.Conv2d(3, 64, 7, 2, padding=3, bias=False)
        self.bn1 = nn.BatchNorm2d(64)
        self.relu = nn.ReLU(inplace=True)
        self.maxpool = nn.MaxPool2d(3, 2, padding=1)

    def forward(self, x: Tensor) -> list[Tensor]:
        """C3, C4 and C5, at an eighth, a sixteenth and a thirty-second of the size."""
        x = self.maxpool(self.relu(self.bn1(self.conv1(x))))
        features = []
        for layer in self.layers:
            x = layer(x)
            features.append(x)
        return features[1:]
