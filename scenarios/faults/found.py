"""Detections with a name for each, and the dice that decide about them."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from dotmask.records import Detections, MaskImage
from scenarios.oracle import outer_box
from sim.randomness import child
from sim.records import GroundTruth


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Found:
    """Detections that are known by name.

    Attributes:
        detections: N of them.
        names: N, unique in the frame: the instance id of what was found, `3/2` for the second part of instance 3,
            `ghost 7/0` for the first false positive that appeared in frame 7. What was merged has the first one's.
    """

    detections: Detections
    names: tuple[str, ...]

    @classmethod
    def by_truth(cls, detections: Detections, truth: GroundTruth) -> Self:
        """The exact detections of a frame, named by the instance that each mask shows."""
        ids = truth.instance_ids
        return cls(detections=detections, names=tuple(str(ids.flat[mask.argmax()]) for mask in detections.masks))

    def keep(self, which: list[bool]) -> "Found":
        """Those for which `which` is true, in the same order; this object itself if they are all."""
        if all(which):
            return self
        return self.select([index for index, is_kept in enumerate(which) if is_kept])

    def select(self, indices: list[int]) -> "Found":
        """Those at `indices`, in that order."""
        return Found(detections=self.detections.select(indices), names=tuple(self.names[i] for i in indices))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class One:
    """A single detection on the way to become a row of `Found`; its box is that of its mask."""

    name: str
    mask: MaskImage
    class_name: str
    score: float


def singles(found: Found) -> list[One]:
    """The rows."""
    rows = found.detections
    return [
        One(name=name, mask=mask, class_name=class_name, score=float(score))
        for name, mask, class_name, score in zip(found.names, rows.masks, rows.class_names, rows.scores, strict=True)
    ]


def together(ones: list[One], shape: tuple[int, int]) -> Found:
    """The detections of an image of `shape` (height, width); those without a pixel are left out."""
    seen = [one for one in ones if one.mask.any()]
    detections = Detections(
        masks=np.array([one.mask for one in seen], np.bool_).reshape(-1, *shape),
        boxes_px=np.array([outer_box(one.mask) for one in seen], np.float64).reshape(-1, 4),
        class_names=tuple(one.class_name for one in seen),
        scores=np.array([one.score for one in seen], np.float64),
    )
    return Found(detections=detections, names=tuple(one.name for one in seen))


@dataclass(frozen=True, slots=True, kw_only=True)
class Dice:
    """Where the random numbers of one frame come from."""

    seed: int
    frame_index: int

    def throw(self, fault: str, name: str = "", frames_ago: int = 0) -> np.random.Generator:
        """The generator of a fault for the detection `name`, in this frame or in one before it."""
        return child(self.seed, "fault", fault, self.frame_index - frames_ago, name)
