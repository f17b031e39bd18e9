"""The two places where another program can be put in: the segmenter and the SLAM back end."""

from typing import Protocol, runtime_checkable

from dotmask.records import Detections, MaskedDepth, PoseEstimate, RgbdFrame, SlamResult


class Segmenter(Protocol):
    """Finds object instances in an image."""

    def segment(self, frame: RgbdFrame) -> Detections:
        """All instances found in `frame.rgb`, of any class and score."""
        ...


class SlamBackend(Protocol):
    """Follows the camera through a sequence of frames and maps where it went."""

    def track(self, frame: RgbdFrame, masked: MaskedDepth) -> PoseEstimate:
        """Odometry: the pose of the camera at `frame`, from features where `masked.mo_mdi_m` is not 0.

        Frames must be given in the order of time.
        """
        ...

    def update_map(self, frame: RgbdFrame, masked: MaskedDepth) -> None:
        """Mapping and loop closure, from features where `masked.mdi_m` is not 0; called after `track` of this frame."""
        ...

    def finish(self) -> SlamResult:
        """The optimised trajectory and the loops; called once, after the last frame."""
        ...


@runtime_checkable
class WorksElsewhere(Protocol):
    """A part that has work done by another process, whose CPU time is to be counted too."""

    @property
    def cpu_elsewhere_s(self) -> float:
        """CPU time that the other process has spent on that work so far, seconds."""
        ...
