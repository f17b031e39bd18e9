"""The network: backbone, pyramid, prototypes and head."""

import re
from typing import NamedTuple

import torch
from torch import Tensor, nn

from dotmask.segmentation.yolact.compact import CompactBackbone
from dotmask.segmentation.yolact.design import YolactDesign
from dotmask.segmentation.yolact.heads import FinePrototypes, MaskIouNet, PredictionHead, prototype_network
from dotmask.segmentation.yolact.pyramid import FeaturePyramid
from dotmask.segmentation.yolact.resnet import ResNet50

_OBSOLETE = re.compile(r"backbone\.layer\d+\.|fpn\.downsample_layers\.([2-9]|\d\d+)\.")


class Answer(NamedTuple):
    """What the network says of a batch of images, for each of A anchors.

    Attributes:
        offsets: (B, A, 4) of the boxes, see `dotmask.segmentation.yolact.anchors.decode`.
        logits: (B, A, classes + 1), background first.
        coefficients: (B, A, K) in -1..1.
        prototypes: (B, h, w, K), not negative.
        semantic: (B, classes, h, w) logits on the finest level, for the loss; None in evaluation.
    """

    offsets: Tensor
    logits: Tensor
    coefficients: Tensor
    prototypes: Tensor
    semantic: Tensor | None


class Yolact(nn.Module):
    """A network of the family, with random weights.

    Names, shapes and order of its tensors are those of the authors' checkpoints.

    Args:
        design: which one.
    """

    def __init__(self, design: YolactDesign) -> None:
        super().__init__()
        classes = len(design.class_names)
        self.backbone: ResNet50 | CompactBackbone = (
            CompactBackbone(design.image_channels)
            if design.backbone == "compact"
            else ResNet50(is_deformable=design.backbone == "resnet50_deformable")
        )
        *finer, c3, c4, c5 = self.backbone.CHANNELS
        self.proto_net: nn.Module = (
            FinePrototypes(finer, design.channels, design.prototypes, is_normalised=design.is_normalised)
            if finer
            else prototype_network(design.channels, design.prototypes)
        )
        self.maskiou_net: MaskIouNet | None = MaskIouNet(classes) if design.rescores_masks else None
        self.fpn = FeaturePyramid((c3, c4, c5), design.channels, is_normalised=design.is_normalised)
        head = PredictionHead(
            design.channels,
            design.anchors_a_cell,
            classes + 1,
            design.prototypes,
            is_normalised=design.is_normalised,
        )
        self.prediction_layers = nn.ModuleList([head])
        self.semantic_seg_conv = nn.Conv2d(design.channels, classes, 1)

    def forward(self, images: Tensor) -> Answer:
        """The answer about images (B, channels, height, width), as `dotmask.segmentation.yolact.images` makes them."""
        *finer, c3, c4, c5 = self.backbone(images)
        levels = self.fpn((c3, c4, c5))
        head = self.prediction_layers[0]
        offsets, logits, coefficients = (torch.cat(parts, dim=1) for parts in zip(*map(head, levels), strict=True))
        prototypes = torch.relu(self.proto_net(levels[0], *finer)).permute(0, 2, 3, 1)
        semantic = self.semantic_seg_conv(levels[0]) if self.training else None
        return Answer(offsets, logits, coefficients, prototypes, semantic)


def current_name(old: str) -> str | None:
    """The name of a tensor of an authors' checkpoint; None for what early versions of their program wrote beside.

    Those named the backbone's stages a second time, and had more than the two convolutions for P6 and P7. The authors'
    own program leaves out both when it reads a checkpoint.
    """
    return None if _OBSOLETE.match(old) else old
