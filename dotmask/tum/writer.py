"""Writing sequence folders: images, their lists, `groundtruth.txt` and `camera.json`."""

import math
from collections.abc import Mapping

import cv2
import numpy as np

from dotmask.partial_folder import GrowingFiles
from dotmask.records import ColourImage, DepthImage, FloatArray, Intrinsics, RgbdFrame, check_finite, checked
from dotmask.tum.camera import CAMERA_FILE, DEPTH_PER_METRE, camera_json
from dotmask.tum.trajectory_file import TRAJECTORY_HEADER, pose_line

LIST_HEADER = "# timestamp filename\n"


class TumSequenceWriter:
    """Writes a sequence folder frame by frame.

    ::

        folder = PartialFolder.create(path, {})
        writer = TumSequenceWriter(folder.files, intrinsics)
        writer.begin()
        for frame, T_world_camera in ...:
            writer.write(frame, T_world_camera)
        folder.finish()

    Depth beyond `MAX_DEPTH_M` does not fit the format and becomes 0, no return.

    Args:
        files: of the folder.
        intrinsics: of all frames.
        facts: what else to note in `camera.json`.
    """

    def __init__(self, files: GrowingFiles, intrinsics: Intrinsics, facts: Mapping[str, object] | None = None) -> None:
        self._files, self._intrinsics, self._facts = files, intrinsics, dict(facts or {})
        self._last_s = -math.inf

    def begin(self) -> None:
        """Write the headers of the lists, and `camera.json`."""
        for name in ("rgb", "depth"):
            self._files.append(f"{name}.txt", LIST_HEADER)
        self._files.append("associations.txt", "")
        self._files.append("groundtruth.txt", TRAJECTORY_HEADER)
        self._files.write(CAMERA_FILE, camera_json(self._intrinsics, DEPTH_PER_METRE, self._facts))

    def write(self, frame: RgbdFrame, T_world_camera: FloatArray | None = None) -> None:
        """Append one frame, and its line of `groundtruth.txt` where the true pose (4, 4) is given.

        Raises:
            ValueError: the frame's intrinsics are not those of the writer, or its time stamp is not at least a
                microsecond (the resolution of the file names) later than the one before.
        """
        if frame.intrinsics != self._intrinsics:
            raise ValueError(f"frame {frame.index}: its intrinsics are not those of the sequence")
        stamp = stamp_text(frame.timestamp_s)
        if float(stamp) <= self._last_s:
            raise ValueError(f"frame {frame.index}: time {stamp} is not later than the one before, {self._last_s:.6f}")
        if T_world_camera is not None:
            pose = checked(T_world_camera, "T_world_camera", (4, 4), np.float64)
            check_finite(pose, "T_world_camera")
            self._files.append("groundtruth.txt", pose_line(frame.timestamp_s, pose))
        self._last_s = float(stamp)
        colour, depth = f"rgb/{stamp}.png", f"depth/{stamp}.png"
        self._files.write(colour, colour_png(frame.rgb))
        self._files.write(depth, depth_png(frame.depth_m, DEPTH_PER_METRE))
        self._files.append("rgb.txt", f"{stamp} {colour}\n")
        self._files.append("depth.txt", f"{stamp} {depth}\n")
        self._files.append("associations.txt", f"{stamp} {colour} {stamp} {depth}\n")


def stamp_text(timestamp_s: float) -> str:
    """A time stamp as in the names of images, in microseconds."""
    return f"{timestamp_s:.6f}"


def colour_png(rgb: ColourImage) -> bytes:
    """A colour image (H, W, 3) as the bytes of a PNG file."""
    return _png(rgb[..., ::-1])


def depth_png(depth_m: DepthImage, per_metre: float) -> bytes:
    """A depth image (H, W) in metres as a 16-bit PNG file; what 16 bits do not hold becomes 0, no return."""
    steps = np.rint(depth_m * per_metre)
    return ids_png(np.where((steps > 0) & (steps <= np.iinfo(np.uint16).max), steps, 0).astype(np.uint16))


def ids_png(ids: np.ndarray[tuple[int, ...], np.dtype[np.uint16]]) -> bytes:
    """An image of 16-bit numbers (H, W) as the bytes of a PNG file."""
    return _png(ids)


def _png(image: ColourImage | np.ndarray[tuple[int, ...], np.dtype[np.uint16]]) -> bytes:
    _, data = cv2.imencode(".png", image)
    return bytes(data)
