"""The oracle: a segmenter that is fed the true masks. Every report names it."""

from collections.abc import Callable

import numpy as np

from dotmask.mask_geometry import bounding_rectangle
from dotmask.records import Detections, FloatArray, MaskImage, RgbdFrame
from sim.records import GroundTruth

CLASSES = ("person", "chair", "cup", "bottle")
"""The objects of interest of the paper (section IV)."""

MIN_PIXELS = 80
"""Instances with fewer visible pixels are not reported: no network finds them at 640x480 either."""


def outer_box(mask: MaskImage) -> FloatArray:
    """(4,) `u_min, v_min, u_max, v_max` of a mask (H, W) that has pixels: the outermost pixel centres."""
    left, top, width, height = bounding_rectangle(mask)
    return np.array([left, top, left + width - 1, top + height - 1], np.float64)


def true_detections(truth: GroundTruth) -> Detections:
    """Each visible actor of a known class with its exact mask, score 1, in the order of the scene."""
    ids = truth.instance_ids
    seen = [o for o in truth.objects if o.class_name in CLASSES and o.visible_pixels >= MIN_PIXELS]
    masks = np.zeros((len(seen), *ids.shape), np.bool_)
    for mask, actor in zip(masks, seen, strict=True):
        np.equal(ids, actor.instance_id, out=mask)
    return Detections(
        masks=masks,
        boxes_px=np.array([outer_box(mask) for mask in masks], np.float64).reshape(-1, 4),
        class_names=tuple(o.class_name for o in seen),
        scores=np.ones(len(seen)),
    )


def _no_fault(frame_index: int, truth: GroundTruth, detections: Detections) -> Detections:
    return detections


class OracleSegmenter:
    """Answers with the true detections, or with what faults make of them.

    Args:
        faults: given the number of a frame, its truth and its true detections, what is answered; see
            `scenarios.faults.chain.Faults`.
    """

    def __init__(self, faults: Callable[[int, GroundTruth, Detections], Detections] = _no_fault) -> None:
        self._faults = faults
        self._frame_index: int | None = None
        self._answer: Detections | None = None

    def show(self, frame_index: int, truth: GroundTruth) -> None:
        """Hand over the truth of the frame that will be segmented next."""
        self._frame_index = frame_index
        self._answer = self._faults(frame_index, truth, true_detections(truth))

    def segment(self, frame: RgbdFrame) -> Detections:
        """See `dotmask.interfaces.Segmenter`.

        Raises:
            RuntimeError: the truth of another frame was shown.
        """
        if self._answer is None or self._frame_index != frame.index:
            raise RuntimeError(f"oracle: asked for frame {frame.index}, but was shown {self._frame_index}")
        return self._answer
