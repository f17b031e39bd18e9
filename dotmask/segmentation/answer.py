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
    least_mask_px: int = 1,
) -> Detections:
    """Detections in the project's conventions.

    Args:
        masks: (N, H, W).
        edges_px: (N, 4) left, top, right and bottom edge of the boxes, where the image reaches from 0 to its width and
            height; a box may reach beyond.
        class_names: N names.
        scores: (N,); a score above 1 counts as 1.
        least_mask_px: detections with fewer pixels are left out.
    """
    height, width = masks.shape[1:]
    # Pixel n lies between n and n + 1, and its centre is called n: edges at 4 and 20 hold pixels 4 to 19.
    boxes_px = np.clip(np.subtract(edges_px, (0.0, 0.0, 1.0, 1.0)), 0, [width - 1, height - 1] * 2)
    centres = (boxes_px[:, :2] + boxes_px[:, 2:]) / 2
    boxes_px = np.hstack([np.minimum(boxes_px[:, :2], centres), np.maximum(boxes_px[:, 2:], centres)])
    # One mask at a time: along axes NumPy counts seven times slower.
    kept = [index for index, mask in enumerate(masks) if np.count_nonzero(mask) >= least_mask_px]
    return Detections(
        masks=masks[kept],
        boxes_px=boxes_px[kept],
        class_names=tuple(class_names[index] for index in kept),
        scores=np.minimum(scores[kept].astype(np.float64), 1.0),
    )
