"""Fast NMS: overlapping detections of a class are dropped all at once (YOLACT, section "Fast NMS")."""

from typing import NamedTuple

import torch
from torch import Tensor

LEAST_SCORE = 0.05
"""An anchor whose best class scores no more is no detection."""

MOST_A_CLASS = 200
"""Only so many of a class are compared, the best first."""

MOST_IOU = 0.5
"""A detection is dropped if it overlaps more than this with a better one of its class, even one that is dropped."""

MOST = 100
"""So many detections of all classes are kept, the best first."""


class Detected(NamedTuple):
    """Detections, the best first.

    Attributes:
        boxes: (N, 4) `x1, y1, x2, y2`.
        coefficients: (N, K) of the prototypes.
        classes: (N,) without background: the first class is 0.
        scores: (N,).
    """

    boxes: Tensor
    coefficients: Tensor
    classes: Tensor
    scores: Tensor


def box_ious(first: Tensor, second: Tensor) -> Tensor:
    """(..., N, M) of boxes (..., N, 4) and (..., M, 4)."""
    a, b = first[..., :, None, :], second[..., None, :, :]
    overlap = (torch.minimum(a[..., 2:], b[..., 2:]) - torch.maximum(a[..., :2], b[..., :2])).clamp(min=0).prod(dim=-1)
    area_a, area_b = ((box[..., 2:] - box[..., :2]).prod(dim=-1) for box in (a, b))
    return overlap / (area_a + area_b - overlap)


def fast_nms(boxes: Tensor, coefficients: Tensor, probabilities: Tensor) -> Detected:
    """The detections among all anchors.

    An anchor whose best class is above `LEAST_SCORE` is a candidate for every class, as in the authors' program.

    Args:
        boxes: (A, 4).
        coefficients: (A, K).
        probabilities: (A, classes + 1), background first.
    """
    scores = probabilities[:, 1:]
    candidates = scores.max(dim=1).values > LEAST_SCORE
    boxes, coefficients = boxes[candidates], coefficients[candidates]
    scores, order = scores[candidates].T.sort(dim=1, descending=True, stable=True)
    scores, order = scores[:, :MOST_A_CLASS], order[:, :MOST_A_CLASS]
    ranked = boxes[order]
    # Above the diagonal stand the overlaps with what is better.
    worst = box_ious(ranked, ranked).triu(diagonal=1)
    is_kept = worst.amax(dim=1) <= MOST_IOU if order.numel() else torch.zeros_like(scores, dtype=torch.bool)
    classes = torch.arange(len(scores), device=scores.device)[:, None].expand_as(is_kept)[is_kept]
    chosen, scores = order[is_kept], scores[is_kept]
    scores, best = scores.sort(descending=True, stable=True)
    scores, best = scores[:MOST], best[:MOST]
    return Detected(boxes[chosen[best]], coefficients[chosen[best]], classes[best], scores)
