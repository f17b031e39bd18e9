"""The two places where another program can be put in: the segmenter and the SLAM back end."""

from typing import Protocol

from dotmask.records import Detections, MaskedDepth, PoseEstimate, RgbdFrame


class Segmenter(Protocol):
    """Finds object instances in an image."""

    def segment(self, frame: RgbdFrame) -> Detections:
        """All instances found in `frame.rgb`, of any class and score."""
        ...


class SlamBackend(Protocol):
    """Follows the camera through a sequence of frames."""

    def track(self, frame: RgbdFrame, masked: MaskedDepth) -> PoseEstimate:
        """Pose of the camera at `frame`.

        Features for odometry come from where `masked.mo_mdi_m` is not 0, the map and its keyframes from
        `masked.mdi_m`. Frames must be given in the order of time.
        """
        ...
