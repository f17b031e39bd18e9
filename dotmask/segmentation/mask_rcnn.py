"""torchvision's Mask R-CNN (He et al., ICCV 2017) with ResNet-50-FPN as a `Segmenter`."""

import re
from pathlib import Path

import torch
from torch import nn
from torchvision.models.detection import MaskRCNN, MaskRCNN_ResNet50_FPN_Weights
from torchvision.models.detection.backbone_utils import resnet_fpn_backbone
from torchvision.ops import FrozenBatchNorm2d

from dotmask.records import Detections, RgbdFrame
from dotmask.segmentation.answer import detections_from

PUBLISHED = MaskRCNN_ResNet50_FPN_Weights.COCO_V1

THRESHOLD = 0.5
"""A pixel belongs to a mask above it."""


_RENAMED = (
    (re.compile(r"(backbone\.fpn\.(?:inner|layer)_blocks\.\d+)\.(weight|bias)"), r"\1.0.\2"),
    (re.compile(r"(rpn\.head\.conv)\.(weight|bias)"), r"\1.0.0.\2"),
    *(
        (re.compile(rf"(roi_heads\.mask_head)\.mask_fcn{n}\.(weight|bias)"), rf"\g<1>.{n - 1}.0.\2")
        for n in range(1, 5)
    ),
)


def mask_rcnn() -> nn.Module:
    """The network with random weights, as torchvision makes it for the published ones.

    Its batch norms are frozen and divide by the plain standard deviation, which the weights were trained with.
    """
    backbone = resnet_fpn_backbone(backbone_name="resnet50", weights=None, norm_layer=FrozenBatchNorm2d)
    network: nn.Module = MaskRCNN(backbone, len(PUBLISHED.meta["categories"]))
    for module in network.modules():
        if isinstance(module, FrozenBatchNorm2d):
            module.eps = 0.0
    return network


def current_name(old: str) -> str | None:
    """The name of a tensor of the published file in today's torchvision, which renames them when it reads a file.

    None for the counters of batch norms, which a frozen one does not have.
    """
    if old.endswith(".num_batches_tracked"):
        return None
    for pattern, new in _RENAMED:
        if pattern.fullmatch(old):
            return pattern.sub(new, old)
    return old


def cached_weights() -> Path:
    """Where torchvision keeps the published weights, whether they are there or not."""
    return Path(torch.hub.get_dir()) / "checkpoints" / Path(PUBLISHED.url).name


class MaskRcnnSegmenter:
    """Finds instances with Mask R-CNN, a frame at a time; float32 on a CPU, mixed with float16 on CUDA.

    Args:
        network: with its weights.
        device: where it runs.
    """

    def __init__(self, network: nn.Module, device: torch.device) -> None:
        self._network, self._device = network.eval().to(device), device
        self._class_names: list[str] = PUBLISHED.meta["categories"]

    def segment(self, frame: RgbdFrame) -> Detections:
        """See `dotmask.interfaces.Segmenter`: at most 100 instances with a score of at least 0.05."""
        image = torch.tensor(frame.rgb, device=self._device).permute(2, 0, 1).float() / 255
        with (
            torch.inference_mode(),
            torch.autocast(self._device.type, torch.float16, enabled=self._device.type == "cuda"),
        ):
            found = self._network([image])[0]
        masks = found["masks"][:, 0] > THRESHOLD
        shown = masks.any(dim=2).any(dim=1)
        return detections_from(
            masks[shown].cpu().numpy(),
            found["boxes"][shown].float().cpu().numpy(),
            [self._class_names[label] for label in found["labels"][shown].tolist()],
            found["scores"][shown].float().cpu().numpy(),
        )
