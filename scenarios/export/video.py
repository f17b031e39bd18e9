"""An mp4 of a rendered sequence: colour, depth and masks side by side."""

import struct
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from dotmask.partial_folder import PartialFolder
from scenarios.video import Picture, VideoFile, truth_picture
from sim.records import SimFrame
from sim.simulator import Simulator

VIDEO_FILE, PICTURES_PART = "video.mp4", "pictures"
JPEG_QUALITY = 95
_LENGTH = struct.Struct("<I")


class VideoExport:
    """Collects a picture a frame, and makes `video.mp4` of them at the end.

    A video cannot be lengthened once it is closed. So the pictures wait as JPEG in one growing file, which can be cut
    back to a checkpoint.

    Args:
        folder: to fill.
        simulator: what is rendered.
        frame_rate_hz: of the video.

    Raises:
        ScenarioError: OpenCV has no encoder for it here.
    """

    def __init__(self, folder: PartialFolder, simulator: Simulator, frame_rate_hz: float) -> None:
        self._folder, self._rate = folder, frame_rate_hz
        self._size = (3 * simulator.camera.width, simulator.camera.height)
        self._actors = tuple(actor.instance_id for actor in simulator.scene.actors)
        with VideoFile(folder.files.path(VIDEO_FILE), self._rate, self._size):
            pass  # fails here, and not after an hour

    def begin(self) -> None:
        """Begin the file of pictures."""
        self._folder.parts.append(PICTURES_PART, b"")

    def add(self, frame: SimFrame) -> None:
        """Append the picture of a frame."""
        bgr = cv2.cvtColor(truth_picture(frame, self._actors), cv2.COLOR_RGB2BGR)
        _, data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        self._folder.parts.append(PICTURES_PART, _LENGTH.pack(len(data)) + data.tobytes())

    def finish(self) -> None:
        """Make the video."""
        with VideoFile(self._folder.files.path(VIDEO_FILE), self._rate, self._size) as video:
            for picture in _pictures(self._folder.parts.path(PICTURES_PART)):
                video.add(picture)


def _pictures(path: Path) -> Iterator[Picture]:
    with path.open("rb") as file:
        while length := file.read(_LENGTH.size):
            data = np.frombuffer(file.read(*_LENGTH.unpack(length)), np.uint8)
            picture = cv2.imdecode(data, cv2.IMREAD_COLOR)
            assert picture is not None
            yield np.asarray(picture[..., ::-1], np.uint8)
