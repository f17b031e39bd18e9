"""What the replaced stages may ask: the truth of this frame, and who is who."""

from dataclasses import dataclass

import numpy as np

from dotmask.evaluation.matching import mask_ious, match_detections
from dotmask.interfaces import Segmenter
from dotmask.pipeline import FrontEndResult
from dotmask.profiles import Profile
from dotmask.records import Detections, RgbdFrame, Track
from dotmask.segmentation.selection import select_detections
from sim.records import GroundTruth


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sighting:
    """What a segmenter found in one frame, and what that is.

    Attributes:
        frame_index: number of the frame.
        detections: those that go on into the method, in its order.
        instances: for each of them the true instance, or None: a false detection, or too poor a mask.
    """

    frame_index: int
    detections: Detections
    instances: tuple[int | None, ...]


def look(segmenter: Segmenter, frame: RgbdFrame, truth: GroundTruth, profile: Profile) -> Sighting:
    """Segment a frame once for all variants; detections and instances are matched as the judge does."""
    detections = select_detections(segmenter.segment(frame), profile)
    return Sighting(
        frame_index=frame.index,
        detections=detections,
        instances=match_detections(mask_ious(detections.masks, truth.instance_ids)),
    )


class Witness:
    """Tells the stages of one variant the truth, and is its segmenter: it hands out the sighting that it was shown."""

    def __init__(self) -> None:
        self._followed: dict[int, int | None] = {}

    def show(self, truth: GroundTruth, sighting: Sighting) -> None:
        """Hand over the frame that is processed next."""
        self.truth, self._sighting = truth, sighting
        self._moving = {actor.instance_id: actor.is_moving for actor in truth.objects}

    def segment(self, frame: RgbdFrame) -> Detections:
        """See `dotmask.interfaces.Segmenter`.

        Raises:
            RuntimeError: another frame was shown.
        """
        if self._sighting.frame_index != frame.index:
            raise RuntimeError(f"witness: asked for frame {frame.index}, but was shown {self._sighting.frame_index}")
        return self._sighting.detections

    def note(self, result: FrontEndResult) -> None:
        """Remember which instance each track follows, from the detections that they were updated with.

        Raises:
            RuntimeError: the front end did not keep the order of the detections, so nobody knows who is who.
        """
        shown = self._sighting.detections
        if result.detections is None or not np.array_equal(result.detections.boxes_px, shown.boxes_px):
            raise RuntimeError("witness: the front end has other detections than were shown")
        for track in result.tracks:
            if track.detection_index is not None:
                self._followed[track.track_id] = self.instance_of_detection(track.detection_index)

    def instance_of_detection(self, index: int) -> int | None:
        """The true instance of a detection of this frame; None for a false one."""
        return self._sighting.instances[index]

    def instance_of_track(self, track: Track) -> int | None:
        """The true instance of the track's detection in this frame; not seen in it, of its last detection."""
        if track.detection_index is not None:
            return self.instance_of_detection(track.detection_index)
        return self._followed.get(track.track_id)

    def is_moving(self, instance_id: int) -> bool:
        """Whether an instance truly moves in this frame."""
        return self._moving[instance_id]
