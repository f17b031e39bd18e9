"""What reads the pyramid: prototypes, the prediction head that all levels share, and the network that scores masks."""

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional

from dotmask.segmentation.yolact.pyramid import added, convolution

FINE_CHANNELS = 16
"""Of the features that the fine prototypes are made from: at half the size of the image, more would take long."""


def prototype_network(channels: int, prototypes: int) -> nn.Sequential:
    """P3 (B, channels, h, w) to the prototypes before their ReLU (B, prototypes, 2 h, 2 w)."""
    return nn.Sequential(
        *_block(channels, channels, is_normalised=False),
        *_block(channels, channels, is_normalised=False),
        *_block(channels, channels, is_normalised=False),
        nn.Upsample(scale_factor=2, mode="bilinear", align_corners=False),
        nn.ReLU(inplace=True),
        *_block(channels, channels, is_normalised=False),
        nn.Conv2d(channels, prototypes, 1),
    )


class FinePrototypes(nn.Module):
    """Prototypes at half the size of the image, where the backbone's finest features have a say.

    Those of the published networks have a quarter of its size and come from P3 alone. In an image of 320x240 that is
    too coarse for the legs of a chair, however well it is learnt.

    Args:
        finer: channels of the features at half and at a quarter of the size.
        channels: of P3.
        prototypes: number of them.
        is_normalised: see `dotmask.segmentation.yolact.design.YolactDesign`.
    """

    def __init__(self, finer: Sequence[int], channels: int, prototypes: int, *, is_normalised: bool) -> None:
        super().__init__()
        half, quarter = finer
        self.coarse = nn.Sequential(
            *(layer for _ in range(3) for layer in _block(channels, channels, is_normalised=is_normalised))
        )
        self.quarter_lateral = nn.Conv2d(quarter, channels, 1)
        self.at_quarter = nn.Sequential(*_block(channels, FINE_CHANNELS, is_normalised=is_normalised))
        self.half_lateral = nn.Conv2d(half, FINE_CHANNELS, 1)
        self.at_half = nn.Conv2d(FINE_CHANNELS, prototypes, 3, padding=1)

    def forward(self, p3: Tensor, half: Tensor, quarter: Tensor) -> Tensor:
        """The prototypes before their ReLU (B, prototypes, h, w), as large as `half`."""
        x = self.at_quarter(functional.relu(added(self.coarse(p3), self.quarter_lateral(quarter))))
        prototypes: Tensor = self.at_half(functional.relu(added(x, self.half_lateral(half))))
        return prototypes


def _block(channels_in: int, channels: int, *, is_normalised: bool) -> tuple[nn.Module, nn.Module]:
    return convolution(channels_in, channels, is_normalised=is_normalised), nn.ReLU(inplace=True)


class PredictionHead(nn.Module):
    """Box, class scores and mask coefficients of every anchor of a level.

    Args:
        channels: of the levels.
        anchors_a_cell: number of anchors at each place.
        classes: with background.
        prototypes: number of coefficients.
        is_normalised: see `dotmask.segmentation.yolact.design.YolactDesign`.
    """

    def __init__(
        self, channels: int, anchors_a_cell: int, classes: int, prototypes: int, *, is_normalised: bool
    ) -> None:
        super().__init__()
        self._classes, self._prototypes = classes, prototypes
        self.upfeature = nn.Sequential(*_block(channels, channels, is_normalised=is_normalised))
        self.bbox_layer = nn.Conv2d(channels, anchors_a_cell * 4, 3, padding=1)
        self.conf_layer = nn.Conv2d(channels, anchors_a_cell * classes, 3, padding=1)
        self.mask_layer = nn.Conv2d(channels, anchors_a_cell * prototypes, 3, padding=1)

    def forward(self, level: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Box offsets (B, A, 4), class logits (B, A, classes) and coefficients (B, A, prototypes) in -1..1.

        Anchors go row by row, within a row place by place.
        """
        x = self.upfeature(level)

        def by_anchor(layer: nn.Module, numbers: int) -> Tensor:
            told: Tensor = layer(x)
            return told.permute(0, 2, 3, 1).reshape(len(told), -1, numbers)

        return (
            by_anchor(self.bbox_layer, 4),
            by_anchor(self.conf_layer, self._classes),
            torch.tanh(by_anchor(self.mask_layer, self._prototypes)),
        )


class MaskIouNet(nn.Module):
    """Expects the IoU of a mask with the truth, for each class (YOLACT++, section "Fast Mask Re-Scoring Network").

    Args:
        classes: without background.
    """

    CHANNELS = (1, 8, 16, 32, 64, 128)

    def __init__(self, classes: int) -> None:
        super().__init__()
        made: list[nn.Module] = []
        for channels_in, channels_out in zip(self.CHANNELS[:-1], self.CHANNELS[1:], strict=True):
            made += [nn.Conv2d(channels_in, channels_out, 3, 2), nn.ReLU(inplace=True)]
        self.maskiou_net = nn.Sequential(*made, nn.Conv2d(self.CHANNELS[-1], classes, 1), nn.ReLU(inplace=True))

    def forward(self, masks: Tensor) -> Tensor:
        """(N, h, w) masks in 0..1, cropped to their boxes, to (N, classes)."""
        x = self.maskiou_net(masks[:, None])
        return functional.max_pool2d(x, x.shape[2:])[:, :, 0, 0]
