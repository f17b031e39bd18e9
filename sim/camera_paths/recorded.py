"""A recorded camera trajectory, and its replay."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from sim.camera_paths.path import check_nominal, check_speed
from sim.errors import CameraPathError
from sim.geometry import FloatArray, pose, rotation_z
from sim.quaternions import rotation_from_quaternion, slerp


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recording:
    """A camera trajectory as it was recorded.

    Attributes:
        times_s: (n,) strictly increasing, n at least 2.
        p_world: (n, 3) metres.
        q_world_xyzw: (n, 4) unit quaternions of `R_world_camera`.
    """

    times_s: FloatArray
    p_world: FloatArray
    q_world_xyzw: FloatArray

    @property
    def duration_s(self) -> float:
        """From the first pose to the last."""
        return float(self.times_s[-1] - self.times_s[0])

    def smoothed(self, sigma_s: float) -> "Recording":
        """The recording without the noise of the motion capture: Gaussian means over time of positions and rotations.

        Motion capture at 100 Hz shakes by a millimetre and some tenths of a degree from pose to pose; replayed as it
        is, the picture trembles as no hand does.

        Args:
            sigma_s: of the Gaussian, seconds, above 0; 0.05 takes most of the noise and little of the motion.
        """
        if not (math.isfinite(sigma_s) and sigma_s > 0):
            raise CameraPathError(f"recorded path: the smoothing must be above 0 s, got {sigma_s}")
        positions, quaternions = np.empty_like(self.p_world), np.empty_like(self.q_world_xyzw)
        first = np.searchsorted(self.times_s, self.times_s - 3 * sigma_s)
        last = np.searchsorted(self.times_s, self.times_s + 3 * sigma_s, side="right")
        for k, time_s in enumerate(self.times_s):
            window = slice(int(first[k]), int(last[k]))
            weights = np.exp(-0.5 * ((self.times_s[window] - time_s) / sigma_s) ** 2)[:, None]
            near = self.q_world_xyzw[window]
            same_side = np.where(np.sum(near * self.q_world_xyzw[k], axis=1, keepdims=True) < 0, -1.0, 1.0)
            positions[k] = np.sum(weights * self.p_world[window], axis=0) / np.sum(weights)
            mean = np.sum(weights * same_side * near, axis=0)
            quaternions[k] = mean / math.sqrt(float(np.sum(mean**2)))
        return Recording(times_s=self.times_s, p_world=positions, q_world_xyzw=quaternions)


def read_recorded(path: Path) -> Recording:
    """Read a trajectory file in TUM format: `timestamp tx ty tz qx qy qz qw` per line, `#` starts a comment.

    The poses are taken as they are; see `Recording.smoothed` for the noise of the motion capture.

    Raises:
        CameraPathError: the file cannot be read or a line is not as it must be; names file and line.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise CameraPathError(f"{path}: cannot be read as a trajectory file ({error})") from error
    rows: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        where = f"{path}, line {number}"
        if len(words) != 8:
            raise CameraPathError(f"{where}: expected 8 columns (timestamp tx ty tz qx qy qz qw), got {len(words)}")
        try:
            row = [float(word) for word in words]
        except ValueError as error:
            raise CameraPathError(f"{where}: {error}") from error
        if not all(math.isfinite(value) for value in row):
            raise CameraPathError(f"{where}: a value is not finite")
        if rows and row[0] <= rows[-1][0]:
            raise CameraPathError(
                f"{where}: time {row[0]} does not come after {rows[-1][0]}; "
                "sort the lines by time and drop repeated ones"
            )
        if math.hypot(*row[4:]) < 1e-6:
            raise CameraPathError(f"{where}: the quaternion is zero")
        rows.append(row)
    if len(rows) < 2:
        raise CameraPathError(f"{path}: a trajectory needs at least 2 poses, got {len(rows)}")
    data = np.array(rows)
    quaternions = data[:, 4:] / np.sqrt(np.sum(data[:, 4:] ** 2, axis=1, keepdims=True))
    return Recording(times_s=data[:, 0], p_world=data[:, 1:4], q_world_xyzw=quaternions)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RecordedPath:
    """A recording replayed from time 0: positions between poses are linear, rotations by slerp.

    Attributes:
        recording: what was recorded.
        T_world_recording: (4, 4) from the recording's world into the scene's: a turn about z and a shift, so that
            gravity stays.
        speed: factor; the replay takes 1/speed of the recorded time.
    """

    recording: Recording
    T_world_recording: FloatArray
    speed: float = 1.0

    def __post_init__(self) -> None:
        """Refuse what is no replay."""
        check_nominal(self.T_world_recording)
        check_speed(self.speed)

    @classmethod
    def placed(
        cls, recording: Recording, *, position_world: npt.ArrayLike, heading_rad: float, speed: float = 1.0
    ) -> "RecordedPath":
        """The recording, moved so that it plays around a place in the scene.

        Args:
            recording: what was recorded.
            position_world: (3,) where the mean of its positions shall be.
            heading_rad: where the mean of its viewing directions shall point about z; 0 is along +x.
            speed: factor.

        Raises:
            CameraPathError: the mean viewing direction is vertical, so it has no heading; or see above.
        """
        # The third column of the rotation matrix is the viewing direction; x, y of it for every pose.
        x, y, z, w = recording.q_world_xyzw.T
        looks = np.stack([2 * (x * z + y * w), 2 * (y * z - x * w)]).mean(axis=1)
        if math.hypot(*looks) < 1e-3:
            raise CameraPathError("recorded path: the camera looks straight up or down on average and has no heading")
        turn = rotation_z(heading_rad - math.atan2(looks[1], looks[0]))
        shift = np.asarray(position_world, float) - turn @ recording.p_world.mean(axis=0)
        return cls(recording=recording, T_world_recording=pose(turn, shift), speed=speed)

    @property
    def duration_s(self) -> float:
        """Of the replay."""
        return self.recording.duration_s / self.speed

    def pose_at(self, time_s: float) -> FloatArray:
        """`T_world_camera` (4, 4).

        Raises:
            CameraPathError: before time 0 or after `duration_s`.
        """
        if not -1e-9 <= time_s <= self.duration_s + 1e-9:
            raise CameraPathError(
                f"recorded path: time {time_s:.3f} s is outside the recording of {self.duration_s:.3f} s at speed "
                f"{self.speed:g}; ask for fewer frames or a lower speed"
            )
        times = self.recording.times_s
        recorded_s = times[0] + self.speed * time_s
        before = int(np.clip(np.searchsorted(times, recorded_s, side="right") - 1, 0, len(times) - 2))
        part = float(np.clip((recorded_s - times[before]) / (times[before + 1] - times[before]), 0.0, 1.0))
        p, q = self.recording.p_world, self.recording.q_world_xyzw
        R = rotation_from_quaternion(slerp(q[before], q[before + 1], part))
        T_recording_camera = pose(R, p[before] + part * (p[before + 1] - p[before]))
        return np.asarray(self.T_world_recording @ T_recording_camera)
