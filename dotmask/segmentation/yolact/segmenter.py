"""A network of the family as a `Segmenter`."""

import torch
from torch import Tensor

from dotmask.records import Detections, RgbdFrame
from dotmask.segmentation.answer import detections_from
from dotmask.segmentation.yolact.anchors import anchors_of, decode
from dotmask.segmentation.yolact.design import YolactDesign
from dotmask.segmentation.yolact.fast_nms import LEAST_SCORE, Detected, fast_nms
from dotmask.segmentation.yolact.images import network_image
from dotmask.segmentation.yolact.mask_kernels import certainties, stretched_above
from dotmask.segmentation.yolact.masks import THRESHOLD, assemble
from dotmask.segmentation.yolact.network import Yolact


class YolactSegmenter:
    """Finds instances with one network, a frame at a time; float32 on a CPU, float16 on CUDA.

    Args:
        network: with its weights.
        design: of the network.
        device: where it runs.
    """

    def __init__(self, network: Yolact, design: YolactDesign, device: torch.device) -> None:
        self._design, self._device = design, device
        self._type = torch.float16 if device.type == "cuda" else torch.float32
        self._network = network.eval().to(device, self._type)
        self._anchors = anchors_of(design).to(device)

    def segment(self, frame: RgbdFrame) -> Detections:
        """See `dotmask.interfaces.Segmenter`: at most 100 instances, whose class scores at least 0.05."""
        height, width = frame.rgb.shape[:2]
        with torch.inference_mode():
            found, soft_masks = self._instances(network_image(frame, self._design, self._device))
            edges_px = found.boxes * found.boxes.new_tensor([width, height, width, height])
            edges, classes, scores, soft = (
                part.cpu().numpy() for part in (edges_px, found.classes, found.scores, soft_masks)
            )
            if self._design.weighs_certainty:
                scores = scores * certainties(soft, THRESHOLD)
            masks, kept = stretched_above(soft, THRESHOLD, height, width, self._design.least_mask_px)
            names = [self._design.class_names[index] for index in classes[kept]]
            return detections_from(masks, edges[kept], names, scores[kept])

    def _instances(self, image: Tensor) -> tuple[Detected, Tensor]:
        """Detections in an image, and their masks (N, h, w) in 0..1 at the size of the prototypes."""
        answer = self._network(image.to(self._type).contiguous(memory_format=torch.channels_last))
        # What follows is little work, and boxes need more than the eleven bits of float16.
        offsets, logits, coefficients, prototypes = (part[0].float() for part in answer[:4])
        found = fast_nms(decode(offsets, self._anchors), coefficients, torch.softmax(logits, dim=-1))
        found = Detected(*(part[found.scores >= LEAST_SCORE] for part in found))
        masks = assemble(prototypes, found.coefficients, found.boxes)
        if self._network.maskiou_net is not None and len(masks):
            expected = self._network.maskiou_net(masks.to(self._type)).float()
            found = found._replace(scores=found.scores * expected.gather(1, found.classes[:, None])[:, 0])
        return found, masks
