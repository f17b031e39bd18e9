"""Which true instance a detection shows: the overlaps that the judgements of masks and identities rest on."""

import cv2
import numpy as np
import numpy.typing as npt

from dotmask.records import FloatArray


def mask_ious(masks: npt.NDArray[np.bool_], instance_ids: npt.NDArray[np.uint16]) -> FloatArray:
    """Intersection over union of every detection with every true instance.

    Args:
        masks: (N, H, W) detected.
        instance_ids: (H, W) true instance of each pixel, 0 = background.

    Returns:
        (N, M), M one more than the highest instance id in the image: column i is instance i. Column 0 is 0: the
        background is nothing to be found.
    """
    areas = np.bincount(instance_ids.ravel())
    ious = np.zeros((len(masks), len(areas)))
    for row, mask in zip(ious, masks, strict=True):
        u, v, width, height = cv2.boundingRect(mask.view(np.uint8))
        region = (slice(v, v + height), slice(u, u + width))
        overlaps = np.bincount(instance_ids[region][mask[region]], minlength=len(areas))
        row[:] = overlaps / np.maximum(areas + overlaps.sum() - overlaps, 1)
    ious[:, :1] = 0.0
    return ious


def match_detections(ious: FloatArray, min_iou: float = 0.5) -> tuple[int | None, ...]:
    """The true instance behind each detection.

    Detection and instance must be each other's best and overlap with an IoU of at least `min_iou`; where two detections
    claim one instance, the better IoU has it and the other one has none.

    Args:
        ious: (N, M) of each detection with each instance, from `mask_ious`.
        min_iou: least intersection over union.

    Returns:
        For each detection an instance id, or None.
    """
    best = [(-float(row.max(initial=0.0)), index, int(np.argmax(row))) for index, row in enumerate(ious)]
    matches: list[int | None] = [None] * len(ious)
    for negative_iou, index, instance in sorted(best):
        if instance != 0 and -negative_iou >= min_iou and instance not in matches:
            matches[index] = instance
    return tuple(matches)
