"""The loss that the networks learn by (YOLACT, section "Losses"), with the classes' part of RetinaNet.

YOLACT teaches classes by the anchors that are most wrong, three without a box for one with, as SSD does. A network that
begins with random weights learns faster from all of them, each weighted by how wrong it is: the focal loss (Lin et al.,
ICCV 2017).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional

from dotmask.segmentation.yolact.anchors import CENTRE_VARIANCE, SIZE_VARIANCE
from dotmask.segmentation.yolact.fast_nms import box_ious
from dotmask.segmentation.yolact.masks import mask_logits, within_reach
from dotmask.segmentation.yolact.network import Answer

CLASS_WEIGHT, BOX_WEIGHT, MASK_WEIGHT, SEMANTIC_WEIGHT = 1.0, 1.5, 6.125, 1.0

POSITIVE_IOU, NEGATIVE_IOU = 0.4, 0.3
"""An anchor stands for a box with a larger IoU than the first, and for none if its IoU with all is below the second.

YOLACT has 0.5 and 0.4; with less, more anchors learn from every object.
"""

FOCUS = 2.0
"""Exponent of the focal loss: the larger, the less counts an anchor that is right already."""

MOST_MASKS = 40
"""So many masks of an image count at most, chosen at random."""

IGNORED = -1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Target:
    """What is to be found in one image.

    Attributes:
        boxes: (N, 4) `x1, y1, x2, y2`, shares of the image.
        classes: (N,) int64, the first class is 0.
        masks: (N, h, w) float32 in 0..1, of any size.
    """

    boxes: Tensor
    classes: Tensor
    masks: Tensor


class Losses(NamedTuple):
    """Scalars, weighted; their sum is the loss."""

    classes: Tensor
    boxes: Tensor
    masks: Tensor
    semantic: Tensor


def encode(boxes: Tensor, anchors: Tensor) -> Tensor:
    """Offsets (..., 4) from anchors (..., 4) to boxes (..., 4); `decode` leads back."""
    centres, sizes = (boxes[..., :2] + boxes[..., 2:]) / 2, boxes[..., 2:] - boxes[..., :2]
    shifts = (centres - anchors[..., :2]) / (CENTRE_VARIANCE * anchors[..., 2:])
    return torch.cat([shifts, torch.log(sizes / anchors[..., 2:]) / SIZE_VARIANCE], dim=-1)


def match(anchors: Tensor, target: Target) -> tuple[Tensor, Tensor]:
    """Which box each anchor stands for, and what class it should tell.

    Every box has the anchor that overlaps it most, whatever the overlap.

    Args:
        anchors: (A, 4) centre and size.
        target: of an image.

    Returns:
        (A,) index of the box; and (A,) class with background as 0, or `IGNORED`.
    """
    if not len(target.boxes):
        nothing = torch.zeros(len(anchors), dtype=torch.int64, device=anchors.device)
        return nothing, nothing
    corners = torch.cat([anchors[:, :2] - anchors[:, 2:] / 2, anchors[:, :2] + anchors[:, 2:] / 2], dim=1)
    ious = box_ious(target.boxes, corners)
    overlap, box = ious.max(dim=0)
    for _ in range(len(target.boxes)):
        # The best pair of a box and an anchor that have no one yet.
        best = int(ious.argmax())
        row, column = divmod(best, ious.shape[1])
        box[column], overlap[column] = row, 2.0
        ious[row, :], ious[:, column] = -1.0, -1.0
    told = target.classes[box] + 1
    told[overlap <= POSITIVE_IOU] = IGNORED
    told[overlap < NEGATIVE_IOU] = 0
    return box, told


def yolact_loss(answer: Answer, targets: Sequence[Target], anchors: Tensor) -> Losses:
    """The loss of a batch.

    Args:
        answer: of a network in training.
        targets: one for each image.
        anchors: (A, 4) of the network.
    """
    assert answer.semantic is not None, "the network is in evaluation"
    matched = [match(anchors, target) for target in targets]
    positives = max(sum(int((told > 0).sum()) for _, told in matched), 1)
    zero = answer.logits.sum() * 0
    of_classes, of_boxes, of_masks, of_semantic = zero, zero, zero, zero
    # Taken apart once: the gradient of one image by its index would be as large as that of all of them.
    images = zip(*(part.unbind() for part in (*answer[:4], answer.semantic)), targets, matched, strict=True)
    for offsets, logits, coefficients, prototypes, semantic, target, (box, told) in images:
        is_positive = told > 0
        of_classes = of_classes + _class_loss(logits, told)
        wanted = encode(target.boxes[box[is_positive]], anchors[is_positive])
        of_boxes = of_boxes + functional.smooth_l1_loss(offsets[is_positive], wanted, reduction="sum")
        of_masks = of_masks + _mask_loss(prototypes, coefficients[is_positive], target, box[is_positive])
        of_semantic = of_semantic + _semantic_loss(semantic, target)
    return Losses(
        CLASS_WEIGHT * of_classes / positives,
        BOX_WEIGHT * of_boxes / positives,
        MASK_WEIGHT * of_masks / positives,
        SEMANTIC_WEIGHT * of_semantic / len(targets),
    )


def _class_loss(logits: Tensor, told: Tensor) -> Tensor:
    """Sum of the focal loss over all anchors that stand for a box or for none."""
    is_used = told != IGNORED
    likelihoods = torch.log_softmax(logits[is_used], dim=1).gather(1, told[is_used, None])
    return (-((1 - likelihoods.exp()) ** FOCUS) * likelihoods).sum()


def _mask_loss(prototypes: Tensor, coefficients: Tensor, target: Target, box: Tensor) -> Tensor:
    """Sum over the positives of the mean cross entropy where `assemble` would let the mask of the true box be.

    The authors divide by the box alone. With prototypes as few as those of `compact`, a cup would count three times.
    They also take a pixel of the prototypes for one of the mask or not; here a pixel on the outline is so in part, and
    where the outline lies is learnt more finely than the prototypes are.
    """
    if not len(box):
        return prototypes.sum() * 0
    scale = 1.0
    if len(box) > MOST_MASKS:
        chosen = torch.randperm(len(box), device=box.device)[:MOST_MASKS]
        scale, coefficients, box = len(box) / MOST_MASKS, coefficients[chosen], box[chosen]
    height, width = prototypes.shape[:2]
    wanted = _resized(target.masks, height, width)[box]
    logits = mask_logits(prototypes, coefficients)
    rows, columns = within_reach(target.boxes[box], height, width)
    counts = rows & columns
    # Weights inside of the entropy: a third of the time of weighting what comes out of it.
    weights = scale * counts / counts.sum(dim=(1, 2), keepdim=True)
    return functional.binary_cross_entropy_with_logits(logits, wanted, weights, reduction="sum")


def _semantic_loss(logits: Tensor, target: Target) -> Tensor:
    """Sum over the classes of the mean cross entropy; a pixel may be of several classes."""
    wanted = torch.zeros_like(logits)
    if len(target.masks):
        for class_index, mask in zip(target.classes.tolist(), _resized(target.masks, *logits.shape[1:]), strict=True):
            wanted[class_index] = torch.maximum(wanted[class_index], (mask > 0.5).to(wanted.dtype))
    return functional.binary_cross_entropy_with_logits(logits, wanted, reduction="none").mean(dim=(1, 2)).sum()


def _resized(masks: Tensor, height: int, width: int) -> Tensor:
    return functional.interpolate(masks[None], (height, width), mode="bilinear", align_corners=False)[0]
