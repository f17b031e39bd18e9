"""The formats of the TUM RGB-D benchmark, both ways: trajectory files and sequence folders.

A trajectory is a text file of lines `timestamp tx ty tz qx qy qz qw` (`T_world_camera`, seconds and metres). A sequence
folder holds `rgb/*.png`, `depth/*.png` (16 bit, 5000 per metre, 0 = no return), the lists `rgb.txt`, `depth.txt` and
`associations.txt`, and `groundtruth.txt`. The format itself has no place for the intrinsics; the file
`intrinsics.json` is our addition.
"""

import json
import math
import os
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Self

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from dotmask.atomic_file import write_atomically
from dotmask.errors import SequenceFolderError, TrajectoryFileError
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
INTRINSICS_FILE = "intrinsics.json"
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
    """Writes a sequence folder frame by frame; the folder appears when all is written.

    ::

        with TumSequenceWriter(folder, intrinsics) as writer:
            for frame, T_world_camera in ...:
                writer.write(frame, T_world_camera)

    The frames go to a temporary folder beside the target, which is renamed at the end of the `with` block. When the
    block ends by an exception, the temporary folder is removed and nothing is left behind. Depth beyond
    `MAX_DEPTH_M` does not fit the format and becomes 0, no return.

    Args:
        folder: the target; it must not exist or be empty.
        intrinsics: of all frames; written to `intrinsics.json`.

    Raises:
        SequenceFolderError: (on entering the block) the target holds something already or is a file.
    """

    def __init__(self, folder: PathLike, intrinsics: Intrinsics) -> None:
        self._folder = Path(folder)
        self._intrinsics = intrinsics
        self._temporary: Path | None = None
        self._stamps: list[str] = []
        self._poses: list[str] = []

    def __enter__(self) -> Self:
        """Make the temporary folder."""
        if self._folder.exists() and not (self._folder.is_dir() and not any(self._folder.iterdir())):
            raise SequenceFolderError(f"{self._folder}: exists and is not an empty folder; choose another or remove it")
        parent = self._folder.absolute().parent
        parent.mkdir(parents=True, exist_ok=True)
        # mkdtemp gives a private folder; the sequence itself goes one level below, so that it gets usual permissions.
        self._temporary = Path(tempfile.mkdtemp(prefix=f".{self._folder.name}.", suffix=".tmp", dir=parent))
        for name in ("rgb", "depth"):
            (self._temporary / "sequence" / name).mkdir(parents=True)
        return self

    @property
    def path(self) -> Path:
        """The folder that is being written, for further files beside the images; only inside the `with` block."""
        if self._temporary is None:
            raise SequenceFolderError(f"{self._folder}: files can be written only inside the with block")
        return self._temporary / "sequence"

    def write(self, frame: RgbdFrame, T_world_camera: FloatArray | None = None) -> None:
        """Append one frame, and its line of `groundtruth.txt` where the true pose (4, 4) is given.

        Raises:
            ValueError: the frame's intrinsics are not those of the writer, or its time stamp is not at least a
                microsecond (the resolution of the file names) later than the one before.
            SequenceFolderError: called outside of the `with` block.
        """
        sequence = self.path
        if frame.intrinsics != self._intrinsics:
            raise ValueError(f"frame {frame.index}: its intrinsics are not those of the sequence")
        stamp = f"{frame.timestamp_s:.6f}"
        if self._stamps and float(stamp) <= float(self._stamps[-1]):
            raise ValueError(f"frame {frame.index}: time {stamp} is not later than the one before, {self._stamps[-1]}")
        (sequence / "rgb" / f"{stamp}.png").write_bytes(_png(frame.rgb[..., ::-1]))
        (sequence / "depth" / f"{stamp}.png").write_bytes(_png(_sixteen_bit_depth(frame.depth_m)))
        self._stamps.append(stamp)
        if T_world_camera is not None:
            pose = checked(T_world_camera, "T_world_camera", (4, 4), np.float64)
            check_finite(pose, "T_world_camera")
            self._poses.append(_pose_line(frame.timestamp_s, pose))

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Write the lists and rename the folder, or remove it after an exception."""
        assert self._temporary is not None
        temporary, self._temporary = self._temporary, None
        try:
            if kind is None:
                self._write_lists(temporary / "sequence")
                os.replace(temporary / "sequence", self._folder)
        finally:
            shutil.rmtree(temporary)

    def _write_lists(self, sequence: Path) -> None:
        for name in ("rgb", "depth"):
            lines = [f"{stamp} {name}/{stamp}.png\n" for stamp in self._stamps]
            (sequence / f"{name}.txt").write_text("# timestamp filename\n" + "".join(lines))
        lines = [f"{stamp} rgb/{stamp}.png {stamp} depth/{stamp}.png\n" for stamp in self._stamps]
        (sequence / "associations.txt").write_text("".join(lines))
        if self._poses:
            (sequence / "groundtruth.txt").write_text(TRAJECTORY_HEADER + "".join(self._poses))
        camera = {**asdict(self._intrinsics), "depth_per_metre": DEPTH_PER_METRE}
        (sequence / INTRINSICS_FILE).write_text(json.dumps(camera, indent=2) + "\n")


def read_sequence(folder: PathLike, intrinsics: Intrinsics | None = None) -> Iterator[RgbdFrame]:
    """The frames of a sequence folder, images read one by one as they are asked for.

    Colour and depth are paired with the nearest time stamp, at most 0.02 s apart; a frame has the time of its colour
    image. The lists are read at once, so a broken folder is reported here and not at the first frame.

    Args:
        folder: the sequence.
        intrinsics: of the camera; None to read `intrinsics.json`.

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
    """The intrinsics that `TumSequenceWriter` left in `intrinsics.json`.

    Raises:
        SequenceFolderError: the file is missing, is not such a file, or tells another scale of depth.
    """
    path = Path(folder) / INTRINSICS_FILE
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
    quaternion = Rotation.from_matrix(T_world_camera[:3, :3]).as_quat(canonical=True)
    return " ".join(repr(float(x)) for x in (time_s, *T_world_camera[:3, 3], *quaternion)) + "\n"


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


def _sixteen_bit_depth(depth_m: DepthImage) -> np.ndarray[tuple[int, ...], np.dtype[np.uint16]]:
    holds = (depth_m > 0) & (depth_m <= MAX_DEPTH_M)
    return np.rint(np.where(holds, depth_m, 0.0) * DEPTH_PER_METRE).astype(np.uint16)


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
