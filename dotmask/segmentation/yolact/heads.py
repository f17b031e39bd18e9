"""What reads the pyramid: prototypes, the prediction head that all levels share, and the network that scores masks."""

import torch
from torch import Tensor, nn
from torch.nn import functional

from dotmask.segmentation.yolact.pyramid import convolution


def prototype_network(channels: int, prototypes: int, *, is_normalised: bool) -> nn.Sequential:
    """P3 (B, channels, h, w) to the prototypes before their ReLU (B, prototypes, 2 h, 2 w)."""

    def block() -> tuple[nn.Module, nn.Module]:
        return convolution(channels, channels, is_normalised=is_normalised), nn.ReLU(inplace=True)

    return nn.Sequential(
        *block(),
        *block(),
        *block(),
        nn.Upsample(scale_factor=2, mode="bilinear", align_corners=False),
        nn.ReLU(inplace=True),
        *block(),
        nn.Conv2d(channels, prototypes, 1),
    )


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
        self.upfeature = nn.Sequential(
            convolution(channels, channels, is_normalised=is_normalised), nn.ReLU(inplace=True)
        )
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
