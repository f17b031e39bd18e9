"""Trajectory files: lines `timestamp tx ty tz qx qy qz qw` (`T_world_camera`, seconds and metres)."""

import math

import numpy as np
from scipy.spatial.transform import Rotation

from dotmask.atomic_file import write_atomically
from dotmask.errors import TrajectoryFileError
from dotmask.records import FloatArray, Trajectory
from dotmask.tum.text_lines import PathLike, finite_number, table_lines

TRAJECTORY_HEADER = "# timestamp tx ty tz qx qy qz qw\n"
MIN_QUATERNION_NORM = 1e-6


def format_trajectory(trajectory: Trajectory) -> str:
    """The content of a trajectory file.

    Times and positions have as many digits as it takes to read the same float64 back; of the two quaternions of a
    rotation, it is the one with positive `qw`.
    """
    lines = [pose_line(time_s, T) for time_s, T in zip(trajectory.timestamps_s, trajectory.T_world_camera, strict=True)]
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
    for place, words in table_lines(path, TrajectoryFileError):
        if len(words) != 8:
            raise TrajectoryFileError(
                f"{place}: expected 8 columns (timestamp tx ty tz qx qy qz qw), found {len(words)}"
            )
        row = [finite_number(word, place, TrajectoryFileError) for word in words]
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


def pose_columns(T_a_b: FloatArray) -> tuple[float, ...]:
    """`tx ty tz qx qy qz qw` of a pose (4, 4), with the quaternion of positive `qw`."""
    quaternion = Rotation.from_matrix(T_a_b[:3, :3]).as_quat(canonical=True)
    return tuple(float(x) for x in (*T_a_b[:3, 3], *quaternion))


def pose_line(time_s: float, T_world_camera: FloatArray) -> str:
    """One line of a trajectory file."""
    return " ".join(repr(x) for x in (float(time_s), *pose_columns(T_world_camera))) + "\n"
