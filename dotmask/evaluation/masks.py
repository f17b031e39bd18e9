"""Judges the masks: overlap and outline against the truth, what leaks into odometry and what is wasted."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dotmask.evaluation.contours import boundary_f
from dotmask.records import DepthImage, FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class MaskCounts:
    """Pixel counts of one frame or, added up, of many.

    Attributes:
        moving_pixels: pixels of truly moving objects with depth from the sensor.
        leaked_pixels: those of them that still have depth in the MO-MDI.
        static_pixels: all other pixels with depth from the sensor.
        wasted_pixels: those of them without depth in the MO-MDI.
        iou_sum: sum of the IoU of the matched detections with their instances.
        matched_detections: number of terms in it.
        boundary_f_sum: sum of the boundary F-score of matched detections.
        outlined_detections: number of terms in it.
    """

    moving_pixels: int = 0
    leaked_pixels: int = 0
    static_pixels: int = 0
    wasted_pixels: int = 0
    iou_sum: float = 0.0
    matched_detections: int = 0
    boundary_f_sum: float = 0.0
    outlined_detections: int = 0

    def __add__(self, other: "MaskCounts") -> "MaskCounts":
        """Counts of both."""
        return MaskCounts(
            moving_pixels=self.moving_pixels + other.moving_pixels,
            leaked_pixels=self.leaked_pixels + other.leaked_pixels,
            static_pixels=self.static_pixels + other.static_pixels,
            wasted_pixels=self.wasted_pixels + other.wasted_pixels,
            iou_sum=self.iou_sum + other.iou_sum,
            matched_detections=self.matched_detections + other.matched_detections,
            boundary_f_sum=self.boundary_f_sum + other.boundary_f_sum,
            outlined_detections=self.outlined_detections + other.outlined_detections,
        )

    @property
    def leak(self) -> float | None:
        """Share of the moving objects' pixels that odometry still sees; None without such pixels."""
        return self.leaked_pixels / self.moving_pixels if self.moving_pixels else None

    @property
    def waste(self) -> float | None:
        """Share of the static pixels that odometry lost; None without such pixels."""
        return self.wasted_pixels / self.static_pixels if self.static_pixels else None

    @property
    def iou(self) -> float | None:
        """Mean IoU of the matched detections; None without any."""
        return self.iou_sum / self.matched_detections if self.matched_detections else None

    @property
    def boundary_f(self) -> float | None:
        """Mean boundary F-score of the detections whose outline was judged; None without any."""
        return self.boundary_f_sum / self.outlined_detections if self.outlined_detections else None


def count_masking(
    depth_m: DepthImage, mo_mdi_m: DepthImage, instance_ids: npt.NDArray[np.uint16], moving_ids: Iterable[int]
) -> MaskCounts:
    """Leak and waste of one frame.

    Args:
        depth_m: (H, W) the sensor's depth, metres, 0 = none.
        mo_mdi_m: (H, W) what odometry was given.
        instance_ids: (H, W) true instance of each pixel.
        moving_ids: the instances that truly move.
    """
    ids = sorted(set(moving_ids))
    is_moving_id = np.zeros(max(int(instance_ids.max(initial=0)), *ids, 0) + 1, dtype=np.bool_)
    is_moving_id[ids] = True
    is_moving = is_moving_id.take(instance_ids)
    has_depth, is_kept = depth_m > 0, mo_mdi_m > 0
    moving = int(np.count_nonzero(is_moving & has_depth))
    leaked = int(np.count_nonzero(is_moving & is_kept))
    kept = int(np.count_nonzero(is_kept))
    static = int(np.count_nonzero(has_depth)) - moving
    return MaskCounts(
        moving_pixels=moving,
        leaked_pixels=leaked,
        static_pixels=static,
        wasted_pixels=static - (kept - leaked),
    )


def count_overlap(ious: FloatArray, matches: Sequence[int | None]) -> MaskCounts:
    """IoU of the detections with the instances they were matched to.

    Args:
        ious: (N, M) of each detection with each instance (see dotmask.evaluation.matching.mask_ious).
        matches: for each detection its instance, or None (see dotmask.evaluation.matching.match_detections).
    """
    overlaps = [float(row[instance]) for row, instance in zip(ious, matches, strict=True) if instance is not None]
    return MaskCounts(iou_sum=sum(overlaps), matched_detections=len(overlaps))


def count_outlines(
    masks: npt.NDArray[np.bool_], instance_ids: npt.NDArray[np.uint16], matches: Sequence[int | None]
) -> MaskCounts:
    """Boundary F-score of the detections with the instances they were matched to.

    Args:
        masks: (N, H, W) detected.
        instance_ids: (H, W) true instance of each pixel.
        matches: as for `count_overlap`.
    """
    scores = [
        boundary_f(mask, instance_ids == instance)
        for mask, instance in zip(masks, matches, strict=True)
        if instance is not None
    ]
    return MaskCounts(boundary_f_sum=sum(scores), outlined_detections=len(scores))
