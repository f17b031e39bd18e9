"""Reading sequence folders: lists are checked at once, images are read one by one as they are asked for."""

from collections.abc import Iterator
from pathlib import Path, PurePosixPath

import cv2
import numpy as np
import numpy.typing as npt

from dotmask.errors import SequenceFolderError
from dotmask.records import ColourImage, DepthImage, FloatArray, RgbdFrame, Trajectory
from dotmask.timestamps import nearest_pairs
from dotmask.tum.camera import RecordedCamera, find_camera
from dotmask.tum.image_file import read_colour, read_depth
from dotmask.tum.text_lines import PathLike, finite_number, table_lines
from dotmask.tum.trajectory_file import read_trajectory

MAX_STAMP_DIFFERENCE_S = 0.02
"""Colour, depth and true pose belong together up to here, as in the benchmark's `associate.py`."""

LONG_GAP_S = 1.0
"""A longer time without a frame is worth a note: SLAM may lose the camera in it."""


def read_sequence(folder: PathLike, camera: RecordedCamera | None = None) -> "TumSequence":
    """Open a sequence folder.

    Colour and depth are paired with the nearest time stamp, at most 0.02 s apart; a frame has the time of its colour
    image. Both lists are read and all files looked for at once, so that a broken folder is reported here and not after
    half of the frames.

    Args:
        folder: the sequence.
        camera: that took it; None to look for it (`find_camera`).

    Raises:
        SequenceFolderError: no such folder, a list or a listed file is missing, a line cannot be read, leads out of the
            folder or is not later than the one before, no pair of stamps is near enough, no true pose is near to any
            frame, or nothing tells the camera.
        TrajectoryFileError: `groundtruth.txt` is there and cannot be read.
    """
    root = Path(folder)
    if not root.is_dir():
        raise SequenceFolderError(f"{root}: no such folder")
    if not (root / "rgb.txt").exists() and not (root / "depth.txt").exists():
        raise SequenceFolderError(f"{root}: has neither rgb.txt nor depth.txt; expected a folder as TUM RGB-D has them")
    colour_s, colour_files = _read_list(root, "rgb.txt")
    depth_s, depth_files = _read_list(root, "depth.txt")
    pairs = nearest_pairs(colour_s, depth_s, MAX_STAMP_DIFFERENCE_S)
    if len(pairs) == 0:
        raise SequenceFolderError(
            f"{root}: no colour and depth image within {MAX_STAMP_DIFFERENCE_S} s of each other; "
            "check the stamps in rgb.txt and depth.txt"
        )
    return TumSequence(
        camera=camera or find_camera(root),
        timestamps_s=colour_s[pairs[:, 0]],
        colour_files=[colour_files[i] for i in pairs[:, 0].tolist()],
        depth_files=[depth_files[j] for j in pairs[:, 1].tolist()],
        truth=_read_truth(root),
        root=root,
    )


class TumSequence:
    """A recorded sequence; `read_sequence` opens one.

    Without `groundtruth.txt`, or with an empty one, no frame has a true pose. With it, the sequence begins at the first
    frame that has one, so that it can fix the world of an estimate.

    Attributes:
        root: the folder.
        camera: that took it.
        timestamps_s: (N,) of the frames, rising.
        true_poses: for each frame `T_world_camera` (4, 4) with the nearest stamp, None without one within 0.02 s.
        has_truth: whether `groundtruth.txt` holds poses.
        notes: what a user should know about the recording, a line each.
    """

    def __init__(
        self,
        *,
        root: Path,
        camera: RecordedCamera,
        timestamps_s: FloatArray,
        colour_files: list[Path],
        depth_files: list[Path],
        truth: Trajectory | None,
    ) -> None:
        poses = _poses_at(timestamps_s, truth)
        first, notes = 0, []
        if truth is not None:
            first = next((k for k, pose in enumerate(poses) if pose is not None), -1)
            if first < 0:
                raise SequenceFolderError(
                    f"{root / 'groundtruth.txt'}: no pose within {MAX_STAMP_DIFFERENCE_S} s of any frame; "
                    "check its stamps, or move it away to run without truth"
                )
            if first:
                notes.append(f"{root}: the first {first} frames are left out: they are before the first true pose")
            lacking = sum(pose is None for pose in poses[first:])
            if lacking:
                notes.append(f"{root}: {lacking} of {len(poses) - first} frames have no true pose and are not judged")
        self.root, self.camera, self.has_truth = root, camera, truth is not None
        self.timestamps_s, self.true_poses = timestamps_s[first:], tuple(poses[first:])
        self._colour_files, self._depth_files = colour_files[first:], depth_files[first:]
        self.notes = (*notes, *_gap_notes(root, self.timestamps_s))
        self._maps = _undistortion(camera)

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.timestamps_s)

    def __iter__(self) -> Iterator[RgbdFrame]:
        """The frames in the order of time."""
        return (self.frame(index) for index in range(len(self)))

    @property
    def frame_rate_hz(self) -> float:
        """From the median time between frames; 30 with fewer than two."""
        return float(1 / np.median(np.diff(self.timestamps_s))) if len(self) > 1 else 30.0

    def frame(self, index: int) -> RgbdFrame:
        """Read one frame, and take the lens's distortion out of it.

        Raises:
            SequenceFolderError: an image cannot be read, is damaged, is not of the expected kind, or not of the size of
                the other one and of the camera.
        """
        intrinsics = self.camera.intrinsics
        colour_file, depth_file = self._colour_files[index], self._depth_files[index]
        rgb, depth_m = read_colour(colour_file), read_depth(depth_file)
        if rgb.shape[:2] != depth_m.shape:
            raise SequenceFolderError(f"{depth_file}: is {_size(depth_m)} pixels, {colour_file} is {_size(rgb)}")
        if depth_m.shape != (intrinsics.height, intrinsics.width):
            wanted = f"{intrinsics.width} x {intrinsics.height}"
            raise SequenceFolderError(
                f"{colour_file}: is {_size(rgb)} pixels, camera {self.camera.source} has {wanted}"
            )
        if self._maps is not None:
            # Depths on both sides of an edge must not be mixed.
            rgb = np.asarray(cv2.remap(rgb, *self._maps, cv2.INTER_LINEAR), np.uint8)
            depth_m = np.asarray(cv2.remap(depth_m, *self._maps, cv2.INTER_NEAREST), np.float32)
        stamp = float(self.timestamps_s[index])
        return RgbdFrame(index=index, timestamp_s=stamp, rgb=rgb, depth_m=depth_m, intrinsics=intrinsics)


def _read_truth(root: Path) -> Trajectory | None:
    """What `groundtruth.txt` holds, None where it is missing or has no pose."""
    path = root / "groundtruth.txt"
    truth = read_trajectory(path) if path.exists() else None
    return truth if truth is not None and len(truth) else None


def _poses_at(times_s: FloatArray, truth: Trajectory | None) -> list[FloatArray | None]:
    poses: list[FloatArray | None] = [None] * len(times_s)
    if truth is not None:
        for frame, pose in nearest_pairs(times_s, truth.timestamps_s, MAX_STAMP_DIFFERENCE_S).tolist():
            poses[frame] = truth.T_world_camera[pose]
    return poses


def _gap_notes(root: Path, times_s: FloatArray) -> list[str]:
    steps_s = np.diff(times_s)
    count = int(np.count_nonzero(steps_s > LONG_GAP_S))
    if count == 0:
        return []
    longest = int(np.argmax(steps_s))
    where = f"{steps_s[longest]:.1f} s after {times_s[longest]:.6f}"
    return [f"{root}: no frame for {where}" + (f", and {count - 1} more gaps over {LONG_GAP_S:g} s" * (count > 1))]


def _undistortion(camera: RecordedCamera) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]] | None:
    """For each pixel where it is taken from (u and v); None for a lens without distortion."""
    if not any(camera.distortion):
        return None
    K, size = camera.intrinsics.matrix, (camera.intrinsics.width, camera.intrinsics.height)
    u, v = cv2.initUndistortRectifyMap(K, np.array(camera.distortion), np.eye(3), K, size, cv2.CV_32FC1)
    return np.asarray(u, np.float32), np.asarray(v, np.float32)


def _size(image: ColourImage | DepthImage) -> str:
    return f"{image.shape[1]} x {image.shape[0]}"


def _read_list(root: Path, name: str) -> tuple[FloatArray, list[Path]]:
    """Times and files of `rgb.txt` or `depth.txt`."""
    times_s: list[float] = []
    files: list[Path] = []
    for place, words in table_lines(root / name, SequenceFolderError):
        if len(words) != 2:
            raise SequenceFolderError(f"{place}: expected 2 columns (timestamp filename), found {len(words)}")
        time_s, relative = finite_number(words[0], place, SequenceFolderError), PurePosixPath(words[1])
        if times_s and time_s == times_s[-1]:
            raise SequenceFolderError(f"{place}: time {words[0]} stands there twice; remove one of the lines")
        if times_s and time_s < times_s[-1]:
            raise SequenceFolderError(f"{place}: time {words[0]} is before {times_s[-1]:.6f}; sort the list by time")
        if relative.is_absolute() or ".." in relative.parts:
            raise SequenceFolderError(f"{place}: {words[1]} leads out of the folder; names must be relative to {root}")
        if not (root / relative).is_file():
            raise SequenceFolderError(f"{place}: {root / relative} does not exist")
        times_s.append(time_s)
        files.append(root / relative)
    if not files:
        raise SequenceFolderError(f"{root / name}: lists no image")
    return np.array(times_s, np.float64), files
