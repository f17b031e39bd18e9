"""The oracle: a segmenter that is fed the true masks. Every report names it."""

import numpy as np

from dotmask.records import Detections, RgbdFrame
from sim.records import GroundTruth

CLASSES = ("person", "chair", "cup", "bottle")
"""The objects of interest of the paper (section IV)."""

MIN_PIXELS = 80
"""Instances with fewer visible pixels are not reported: no network finds them at 640x480 either."""


class OracleSegmenter:
    """Reports each visible actor of a known class with its exact mask, score 1, in the order of instance ids."""

    def __init__(self) -> None:
        self._frame_index: int | None = None
        self._truth: GroundTruth | None = None

    def show(self, frame_index: int, truth: GroundTruth) -> None:
        """Hand over the truth of the frame that will be segmented next."""
        self._frame_index, self._truth = frame_index, truth

    def segment(self, frame: RgbdFrame) -> Detections:
        """See `dotmask.interfaces.Segmenter`.

        Raises:
            RuntimeError: the truth of another frame was shown.
        """
        if self._truth is None or self._frame_index != frame.index:
            raise RuntimeError(f"oracle: asked for frame {frame.index}, but was shown {self._frame_index}")
        ids = self._truth.instance_ids
        seen = [o for o in self._truth.objects if o.class_name in CLASSES and o.visible_pixels >= MIN_PIXELS]
        masks = np.zeros((len(seen), *ids.shape), np.bool_)
        boxes = np.zeros((len(seen), 4))
        for mask, box, actor in zip(masks, boxes, seen, strict=True):
            np.equal(ids, actor.instance_id, out=mask)
            rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
            box[:] = columns[0], rows[0], columns[-1], rows[-1]
        return Detections(
            masks=masks,
            boxes_px=boxes,
            class_names=tuple(o.class_name for o in seen),
            scores=np.ones(len(seen)),
        )
