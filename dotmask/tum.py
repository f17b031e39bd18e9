"""The formats of the TUM RGB-D benchmark, both ways: trajectory files and sequence folders.

A trajectory is a text file of lines `timestamp tx ty tz qx qy qz qw` (`T_world_camera`, seconds and metres). A sequence
folder holds `rgb/*.png`, `depth/*.png` (16 bit, 5000 per metre, 0 = no return), the lists `rgb.txt`, `depth.txt` and
`associations.txt`, and `groundtruth.txt`. The format itself has no place for the intrinsics; the file
`camera.json` is our addition.
"""

import json
import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from dotmask.atomic_file import write_atomically
from dotmask.errors import SequenceFolderError, TrajectoryFileError
from dotmask.partial_folder import GrowingFiles
from dotmask.records import (
    ColourImage,
    DepthImage,
    FloatArray,
    Intrinsics,
    RgbdFrame,
    Trajectory,
    check_finite,
    checked,
)
from dotmask.timestamps import nearest_pairs

PathLike = str | os.PathLike[str]

DEPTH_PER_METRE = 5000.0
MAX_DEPTH_M = np.iinfo(np.uint16).max / DEPTH_PER_METRE
"""13.107 m, the furthest depth that 16 bits hold."""

MAX_STAMP_DIFFERENCE_S = 0.02
CAMERA_FILE = "camera.json"
LIST_HEADER = "# timestamp filename\n"
TRAJECTORY_HEADER = "# timestamp tx ty tz qx qy qz qw\n"
MIN_QUATERNION_NORM = 1e-6


def format_trajectory(trajectory: Trajectory) -> str:
    """The content of a trajectory file.

    Times and positions have as many digits as it takes to read the same float64 back; of the two quaternions of a
    rotation, it is the one with positive `qw`.
    """
    lines = [
        _pose_line(time_s, T) for time_s, T in zip(trajectory.timestamps_s, trajectory.T_world_camera, strict=True)
    ]
    return TRAJECTORY_HEADER + "".join(lines)


def write_trajectory(path: PathLike, trajectory: Trajectory) -> None:
    """Write a trajectory file (`format_trajectory`), whole or not at all."""
    write_atomically(path, format_trajectory(trajectory))


def read_trajectory(path: PathLike) -> Trajectory:
    """Read a trajectory file.

    Lines that begin with `#` and empty lines are passed over; commas count as blanks. Quaternions are normalised, `q`
    and `-q` are the same rotation. A file without poses is an empty trajectory.

    Raises:
        TrajectoryFileError: the file is missing or no text, or a line has not eight finite numbers, a time that is
            not later than the one before, or a quaternion of norm 0. The message names file and line.
    """
    rows: list[list[float]] = []
    for place, words in _table(path, TrajectoryFileError):
        if len(words) != 8:
            raise TrajectoryFileError(
                f"{place}: expected 8 columns (timestamp tx ty tz qx qy qz qw), found {len(words)}"
            )
        row = [_number(word, place, TrajectoryFileError) for word in words]
        if rows and row[0] <= rows[-1][0]:
            raise TrajectoryFileError(
                f"{place}: time {row[0]!r} is not later than the one before, {rows[-1][0]!r}; sort the file by time"
            )
        if math.hypot(*row[4:]) < MIN_QUATERNION_NORM:
            raise TrajectoryFileError(f"{place}: quaternion of norm 0 is no rotation")
        rows.append(row)
    table = np.array(rows, dtype=np.float64).reshape(-1, 8)
    poses = np.tile(np.eye(4), (len(table), 1, 1))
    poses[:, :3, 3] = table[:, 1:4]
    if len(table):
        poses[:, :3, :3] = Rotation.from_quat(table[:, 4:]).as_matrix()
    return Trajectory(timestamps_s=table[:, 0], T_world_camera=poses)


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
            self._files.append("groundtruth.txt", _pose_line(frame.timestamp_s, pose))
        self._last_s = float(stamp)
        colour, depth = f"rgb/{stamp}.png", f"depth/{stamp}.png"
        self._files.write(colour, colour_png(frame.rgb))
        self._files.write(depth, depth_png(frame.depth_m, DEPTH_PER_METRE))
        self._files.append("rgb.txt", f"{stamp} {colour}\n")
        self._files.append("depth.txt", f"{stamp} {depth}\n")
        self._files.append("associations.txt", f"{stamp} {colour} {stamp} {depth}\n")


def camera_json(intrinsics: Intrinsics, depth_per_metre: float | None, facts: Mapping[str, object]) -> str:
    """The content of `camera.json`: intrinsics, the scale of the depth images (None without such) and other facts."""
    return json.dumps({**asdict(intrinsics), "depth_per_metre": depth_per_metre, **facts}, indent=2) + "\n"


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


def pose_columns(T_a_b: FloatArray) -> tuple[float, ...]:
    """`tx ty tz qx qy qz qw` of a pose (4, 4), with the quaternion of positive `qw`."""
    quaternion = Rotation.from_matrix(T_a_b[:3, :3]).as_quat(canonical=True)
    return tuple(float(x) for x in (*T_a_b[:3, 3], *quaternion))


def read_sequence(folder: PathLike, intrinsics: Intrinsics | None = None) -> Iterator[RgbdFrame]:
    """The frames of a sequence folder, images read one by one as they are asked for.

    Colour and depth are paired with the nearest time stamp, at most 0.02 s apart; a frame has the time of its colour
    image. The lists are read at once, so a broken folder is reported here and not at the first frame.

    Args:
        folder: the sequence.
        intrinsics: of the camera; None to read `camera.json`.

    Raises:
        SequenceFolderError: a list, an image or the intrinsics are missing or cannot be read, no pair of stamps is
            near enough, or an image has another size than the intrinsics say.
    """
    root = Path(folder)
    if not root.is_dir():
        raise SequenceFolderError(f"{root}: no such folder")
    camera = read_intrinsics(root) if intrinsics is None else intrinsics
    colour_times_s, colour_files = _read_list(root / "rgb.txt")
    depth_times_s, depth_files = _read_list(root / "depth.txt")
    pairs = nearest_pairs(colour_times_s, depth_times_s, MAX_STAMP_DIFFERENCE_S)
    if len(pairs) == 0:
        raise SequenceFolderError(
            f"{root}: no colour and depth image within {MAX_STAMP_DIFFERENCE_S} s of each other; check both lists"
        )

    def frames() -> Iterator[RgbdFrame]:
        for index, (i, j) in enumerate(pairs.tolist()):
            yield RgbdFrame(
                index=index,
                timestamp_s=float(colour_times_s[i]),
                rgb=_read_colour(root / colour_files[i], camera),
                depth_m=_read_depth(root / depth_files[j], camera),
                intrinsics=camera,
            )

    return frames()


def read_intrinsics(folder: PathLike) -> Intrinsics:
    """The intrinsics that `TumSequenceWriter` left in `camera.json`.

    Raises:
        SequenceFolderError: the file is missing, is not such a file, or tells another scale of depth.
    """
    path = Path(folder) / CAMERA_FILE
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
        scale = float(values.get("depth_per_metre", DEPTH_PER_METRE))
        camera = Intrinsics(
            width=int(values["width"]),
            height=int(values["height"]),
            **{name: float(values[name]) for name in ("fx", "fy", "cx", "cy")},
        )
    except FileNotFoundError as error:
        raise SequenceFolderError(f"{path}: missing; give the intrinsics of the camera") from error
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise SequenceFolderError(
            f"{path}: cannot be read ({error!r}); it must hold width, height, fx, fy, cx and cy"
        ) from error
    if scale != DEPTH_PER_METRE:
        raise SequenceFolderError(f"{path}: depth_per_metre is {scale:g}; only {DEPTH_PER_METRE:g} is known")
    return camera


def _pose_line(time_s: float, T_world_camera: FloatArray) -> str:
    return " ".join(repr(x) for x in (float(time_s), *pose_columns(T_world_camera))) + "\n"


def _table(path: PathLike, error_type: type[Exception]) -> Iterator[tuple[str, list[str]]]:
    """`file:line` and the words of every line that is neither empty nor a comment."""
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
    except FileNotFoundError as error:
        raise error_type(f"{os.fspath(path)}: no such file") from error
    except (OSError, UnicodeDecodeError) as error:
        raise error_type(f"{os.fspath(path)}: cannot be read as text ({error})") from error
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.replace(",", " ").split()
        if words and not words[0].startswith("#"):
            yield f"{os.fspath(path)}:{number}", words


def _number(word: str, place: str, error_type: type[Exception]) -> float:
    try:
        value = float(word)
    except ValueError as error:
        raise error_type(f"{place}: {word!r} is not a number") from error
    if not math.isfinite(value):
        raise error_type(f"{place}: {word!r} is not finite")
    return value


def _read_list(path: Path) -> tuple[FloatArray, list[str]]:
    """Times and file names of `rgb.txt` or `depth.txt`, in the order of time."""
    entries: list[tuple[float, str]] = []
    for place, words in _table(path, SequenceFolderError):
        if len(words) != 2:
            raise SequenceFolderError(f"{place}: expected 2 columns (timestamp filename), found {len(words)}")
        entries.append((_number(words[0], place, SequenceFolderError), words[1]))
    entries.sort()
    return np.array([time_s for time_s, _ in entries], dtype=np.float64), [name for _, name in entries]


def _png(image: ColourImage | np.ndarray[tuple[int, ...], np.dtype[np.uint16]]) -> bytes:
    _, data = cv2.imencode(".png", image)
    return bytes(data)


def _read_colour(path: Path, camera: Intrinsics) -> ColourImage:
    bgr = _read_image(path, camera)
    if bgr.dtype != np.uint8 or bgr.ndim != 3:
        raise SequenceFolderError(f"{path}: expected a colour image of 8 bits, found {bgr.dtype} {bgr.shape}")
    return np.ascontiguousarray(bgr[..., 2::-1], dtype=np.uint8)


def _read_depth(path: Path, camera: Intrinsics) -> DepthImage:
    image = _read_image(path, camera)
    if image.dtype != np.uint16 or image.ndim != 2:
        raise SequenceFolderError(f"{path}: expected a grey image of 16 bits, found {image.dtype} {image.shape}")
    return np.asarray(image / DEPTH_PER_METRE, dtype=np.float32)


def _read_image(path: Path, camera: Intrinsics) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8 | np.uint16]]:
    try:
        data = np.fromfile(path, dtype=np.uint8)
    except OSError as error:
        raise SequenceFolderError(f"{path}: cannot be read ({error.strerror})") from error
    image = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if len(data) else None
    if image is None:
        raise SequenceFolderError(f"{path}: is not an image")
    if image.shape[:2] != (camera.height, camera.width):
        found = f"{image.shape[1]} x {image.shape[0]}"
        raise SequenceFolderError(f"{path}: is {found} pixels, the intrinsics say {camera.width} x {camera.height}")
    return np.asarray(image)
