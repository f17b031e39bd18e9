"""The segmenter `none`: finds nothing."""

import numpy as np

from dotmask.records import Detections, RgbdFrame


class NoSegmenter:
    """Finds nothing, so that nothing is masked."""

    def segment(self, frame: RgbdFrame) -> Detections:
        """See `dotmask.interfaces.Segmenter`."""
        return Detections(
            masks=np.zeros((0, *frame.depth_m.shape), np.bool_),
            boxes_px=np.zeros((0, 4)),
            class_names=(),
            scores=np.zeros(0),
        )
