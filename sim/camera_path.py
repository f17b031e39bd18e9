"""Where the camera is over time: synthetic hand-held paths like those of the TUM RGB-D benchmark, and recorded ones.

Every path is a pure function of time. The synthetic ones follow the motions of the fr3/walking sequences (Sturm et
al., A Benchmark for the Evaluation of RGB-D SLAM Systems, IROS 2012) and match the mean speeds that the benchmark
states for them. They are sums of sines, hence smooth in every derivative.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Protocol

import numpy as np
import numpy.typing as npt

from sim.errors import CameraPathError
from sim.geometry import FloatArray, pose, rotation_z
from sim.quaternions import rotation_from_quaternion, slerp
from sim.randomness import child

HALFSPHERE_RADIUS_M = 0.5
HALFSPHERE_GAZE_M = 0.7
"""What the camera on the half sphere looks at lies this far before the nominal camera."""


class CameraPath(Protocol):
    """Where the camera is: a pure function of time."""

    def pose_at(self, time_s: float) -> FloatArray:
        """`T_world_camera` (4, 4)."""
        ...


@lru_cache(maxsize=64)
def _phases(seed: int, motion: str) -> FloatArray:
    """(3, 2) phases of `_sway`, different for every seed and motion."""
    phases = child(seed, "camera_path", motion).uniform(0.0, 2 * np.pi, (3, 2))
    # The beats of the three axes are a third of a period apart, so that the axes take turns.
    phases[:, 1] = phases[0, 1] + np.array([0.0, 1.0, 2.0]) * (np.pi / 3) + 0.2 * (phases[:, 1] - np.pi) / np.pi
    phases.setflags(write=False)
    return phases


def _sway(
    time_s: float, seed: int, motion: str, frequencies_hz: tuple[float, float, float], beat_hz: float
) -> FloatArray:
    """(3,) in -1..1: one oscillation per axis that swells and fades with the beat.

    `cos a · cos b` is the sum of two sines; with frequencies that have no common period it never repeats.
    """
    phases = _phases(seed, motion)
    carrier = np.sin(2 * np.pi * np.asarray(frequencies_hz) * time_s + phases[:, 0])
    swell = 0.62 + 0.38 * np.cos(2 * np.pi * 2 * beat_hz * time_s + 2 * phases[:, 1])
    return np.asarray(carrier * swell)


def _hand(time_s: float, seed: int) -> tuple[FloatArray, FloatArray]:
    """What a hand that tries to hold still does: offset (3,) in metres and rotation vector (3,) in radians."""
    slow_m = _sway(time_s, seed, "hand slow position", (0.231, 0.317, 0.273), 0.071)
    slow_rad = _sway(time_s, seed, "hand slow rotation", (0.287, 0.243, 0.351), 0.083)
    fast_m = _sway(time_s, seed, "hand fast position", (1.713, 2.131, 1.927), 0.197)
    fast_rad = _sway(time_s, seed, "hand fast rotation", (1.871, 1.637, 2.213), 0.173)
    return 0.0082 * slow_m + 0.00045 * fast_m, 0.0134 * slow_rad + 0.0013 * fast_rad


def _rotation(rotation_vector: FloatArray) -> FloatArray:
    """3x3 rotation about the direction of `rotation_vector` (3,) by its length in radians (Rodrigues)."""
    angle = math.sqrt(float(np.sum(rotation_vector**2)))
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = rotation_vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * (cross @ cross))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _HandHeldPath:
    """What the synthetic paths share.

    Attributes:
        T_world_camera: (4, 4) nominal pose, in the middle of the path.
        seed: of the path's phases.
        amplitude: factor on every offset and rotation; 1 is like the TUM sequence, 0 is a tripod.
        speed: the same path in 1/speed of the time; 1 is like the TUM sequence at amplitude 1.
    """

    T_world_camera: FloatArray
    seed: int = 0
    amplitude: float = 1.0
    speed: float = 1.0

    def __post_init__(self) -> None:
        """Refuse what is no path."""
        _check_nominal(self.T_world_camera)
        _check_speed(self.speed)
        if not (math.isfinite(self.amplitude) and self.amplitude >= 0):
            raise CameraPathError(f"camera path: the amplitude must be 0 or more, got {self.amplitude}")

    def pose_at(self, time_s: float) -> FloatArray:
        """`T_world_camera` (4, 4) at any time."""
        return np.asarray(self.T_world_camera @ self._T_nominal_camera(self.speed * time_s))

    def _T_nominal_camera(self, time_s: float) -> FloatArray:
        """(4, 4) in the nominal camera's axes, at speed 1."""
        offset, rotation = self._offset(time_s)
        return pose(_rotation(self.amplitude * rotation), self.amplitude * offset)

    def _offset(self, time_s: float) -> tuple[FloatArray, FloatArray]:
        """Offset (3,) in metres and rotation vector (3,) in radians at speed and amplitude 1."""
        return _hand(time_s, self.seed)


class StaticPath(_HandHeldPath):
    """Held still by hand: 0.012 m/s and 1.4 deg/s on average, like fr3/walking_static."""

    __slots__ = ()


class XyzPath(_HandHeldPath):
    """Moves along the camera's three axes by up to 0.5 m: 0.21 m/s and 5.5 deg/s, like fr3/walking_xyz."""

    __slots__ = ()

    def _offset(self, time_s: float) -> tuple[FloatArray, FloatArray]:
        offset, rotation = _hand(time_s, self.seed)
        main = _sway(time_s, self.seed, "xyz", (0.101, 0.113, 0.089), 0.017)
        tilt = _sway(time_s, self.seed, "xyz tilt", (0.191, 0.163, 0.223), 0.041)
        return offset + np.array([0.48, 0.36, 0.42]) * main, rotation + np.array([0.104, 0.104, 0.082]) * tilt


class RpyPath(_HandHeldPath):
    """Turns about the camera's three axes by up to 0.44 rad: 0.091 m/s and 20.9 deg/s, like fr3/walking_rpy."""

    __slots__ = ()

    def _offset(self, time_s: float) -> tuple[FloatArray, FloatArray]:
        offset, rotation = _hand(time_s, self.seed)
        main = _sway(time_s, self.seed, "rpy", (0.193, 0.157, 0.211), 0.027)
        drift = _sway(time_s, self.seed, "rpy drift", (0.171, 0.229, 0.149), 0.037)
        return offset + np.array([0.11, 0.085, 0.098]) * drift, rotation + np.array([0.30, 0.44, 0.40]) * main


class HalfspherePath(_HandHeldPath):
    """On a half sphere of one metre diameter: 0.221 m/s and 18.3 deg/s, like fr3/walking_halfsphere.

    The nominal pose is the sphere's pole, and the scene lies behind the sphere. The camera looks through the sphere at
    a point a little behind its centre, which gives the benchmark's ratio of 0.7 m between the two speeds.
    """

    __slots__ = ()

    def _T_nominal_camera(self, time_s: float) -> FloatArray:
        sway = _sway(time_s, self.seed, "halfsphere", (0.173, 0.131, 0.191), 0.029)
        up, right = self.amplitude * 0.55 * float(sway[0]), self.amplitude * 1.0 * float(sway[1])
        radius = HALFSPHERE_RADIUS_M + self.amplitude * 0.02 * float(sway[2])
        outward = np.array([math.cos(up) * math.sin(right), -math.sin(up), -math.cos(up) * math.cos(right)])
        place = np.array([0.0, 0.0, HALFSPHERE_RADIUS_M]) + radius * outward
        forward = np.array([0.0, 0.0, HALFSPHERE_GAZE_M]) - place
        forward = forward / math.sqrt(float(np.sum(forward**2)))
        across = np.cross([0.0, 1.0, 0.0], forward)
        across = across / math.sqrt(float(np.sum(across**2)))
        looking = np.stack([across, np.cross(forward, across), forward], axis=1)
        offset, rotation = self._offset(time_s)
        return pose(looking @ _rotation(self.amplitude * rotation), place + self.amplitude * offset)


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
        _check_nominal(self.T_world_recording)
        _check_speed(self.speed)

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


def _check_nominal(T_world_camera: FloatArray) -> None:
    shape = np.shape(T_world_camera)
    if shape != (4, 4) or not np.all(np.isfinite(T_world_camera)):
        raise CameraPathError(f"camera path: the nominal pose must be a finite 4x4 matrix, got shape {shape}")
    R = T_world_camera[:3, :3]
    if np.abs(R @ R.T - np.eye(3)).max() > 1e-6 or np.linalg.det(R) < 0:
        raise CameraPathError("camera path: the nominal pose's upper left 3x3 block must be a rotation")


def _check_speed(speed: float) -> None:
    if not (math.isfinite(speed) and speed > 0):
        raise CameraPathError(f"camera path: the speed factor must be above 0, got {speed}")
