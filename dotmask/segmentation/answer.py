"""From what networks say to `Detections`."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from dotmask.records import Detections


def detections_from(
    masks: npt.NDArray[np.bool_],
    edges_px: npt.NDArray[np.floating],
    class_names: Sequence[str],
    scores: npt.NDArray[np.floating],
) -> Detections:
    """Detections in the project's conventions.

    Args:
        masks: (N, H, W), none of them empty.
        edges_px: (N, 4) left, top, right and bottom edge of the boxes, where the image reaches from 0 to its width and
            height; a box may reach beyond.
        class_names: N names.
        scores: (N,); a score above 1 counts as 1.
    """
    height, width = masks.shape[1:]
    # Pixel n lies between n and n + 1, and its centre is called n: edges at 4 and 20 hold pixels 4 to 19.
    boxes_px = np.clip(np.subtract(edges_px, (0.0, 0.0, 1.0, 1.0)), 0, [width - 1, height - 1] * 2)
    centres = (boxes_px[:, :2] + boxes_px[:, 2:]) / 2
    boxes_px = np.hstack([np.minimum(boxes_px[:, :2], centres), np.maximum(boxes_px[:, 2:], centres)])
    return Detections(
        masks=masks,
        boxes_px=boxes_px,
        class_names=tuple(class_names),
        scores=np.minimum(scores.astype(np.float64), 1.0),
    )
