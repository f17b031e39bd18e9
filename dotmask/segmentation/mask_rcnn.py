"""torchvision's Mask R-CNN (He et al., ICCV 2017) with ResNet-50-FPN as a `Segmenter`."""

from pathlib import Path

import torch
from torch import nn
from torchvision.models.detection import MaskRCNN_ResNet50_FPN_Weights, maskrcnn_resnet50_fpn

from dotmask.records import Detections, RgbdFrame
from dotmask.segmentation.answer import detections_from

PUBLISHED = MaskRCNN_ResNet50_FPN_Weights.COCO_V1

THRESHOLD = 0.5
"""A pixel belongs to a mask above it."""


def mask_rcnn() -> nn.Module:
    """The network with random weights."""
    network: nn.Module = maskrcnn_resnet50_fpn(weights=None, weights_backbone=None)
    return network


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
        return detections_from(
            (found["masks"][:, 0] > THRESHOLD).cpu().numpy(),
            found["boxes"].float().cpu().numpy(),
            [self._class_names[label] for label in found["labels"].tolist()],
            found["scores"].float().cpu().numpy(),
        )
