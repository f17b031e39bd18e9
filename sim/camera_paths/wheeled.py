"""A camera on a wheeled robot: it stays level, moves along a way on the floor, and trembles a little."""

import math

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from sim.camera_paths.path import check_factor, check_speed, rotation_from_vector, there_and_back
from sim.camera_paths.shake import wheel_shake
from sim.errors import CameraPathError
from sim.geometry import FloatArray, look_at, pose
from sim.scene import Motion

RAMP_S = 1.5
"""A robot takes this long to reach its speed, and to stop."""
_SPACING_M = 0.02
_SLOWEST_WALK_M_S = 0.4
_SAMPLE_S = 0.05
_SMOOTHING_S = 0.5
_AFTER_S = 2.0


class FloorWay:
    """A smooth way through points on the floor, by arc length.

    Args:
        points_world: (N, 2) metres, N at least 2, no two the same in a row.

    Raises:
        CameraPathError: fewer points, or two the same in a row.
    """

    def __init__(self, points_world: npt.ArrayLike) -> None:
        points = np.asarray(points_world, float)
        if points.ndim != 2 or points.shape[1] != 2 or len(points) < 2:
            raise CameraPathError(f"robot: needs at least 2 waypoints (x, y), got an array of shape {points.shape}")
        chords = np.sqrt(np.sum(np.diff(points, axis=0) ** 2, axis=1))
        if chords.min() < 1e-3:
            raise CameraPathError("robot: two waypoints in a row are the same: leave one out")
        through = CubicSpline(np.concatenate([[0.0], np.cumsum(chords)]), points)
        fine = through(np.linspace(0.0, chords.sum(), max(8, math.ceil(chords.sum() / _SPACING_M))))
        steps = np.sqrt(np.sum(np.diff(fine, axis=0) ** 2, axis=1))
        lengths = np.concatenate([[0.0], np.cumsum(steps)])
        self.length_m = float(lengths[-1])
        self._curve = CubicSpline(lengths, fine)
        self._slope = self._curve.derivative()

    def position_at(self, s_m: float) -> FloatArray:
        """(2,) metres, `s_m` metres along the way."""
        return np.asarray(self._curve(np.clip(s_m, 0.0, self.length_m)))

    def heading_at(self, s_m: float) -> float:
        """Radians from the world's x axis."""
        dx, dy = self._slope(np.clip(s_m, 0.0, self.length_m))
        return math.atan2(dy, dx)


class RobotPath:
    """A robot drives through waypoints and looks where it drives; at the end it backs up the same way, and so on.

    Args:
        waypoints_world: (N, 2) metres on the floor.
        speed_m_s: of the robot between starting and stopping.
        height_m: of the camera.
        tilt_rad: of the camera; positive looks down.
        seed: of the wheels' tremble.
        amplitude: factor on the tremble.
        speed: the same way in 1/speed of the time.

    Raises:
        CameraPathError: no way, or one too short to start and to stop on.
    """

    def __init__(
        self,
        waypoints_world: npt.ArrayLike,
        *,
        speed_m_s: float,
        height_m: float,
        tilt_rad: float = 0.0,
        seed: int = 0,
        amplitude: float = 1.0,
        speed: float = 1.0,
    ) -> None:
        check_factor("amplitude", amplitude)
        check_speed(speed)
        check_speed(speed_m_s)
        self.way = FloorWay(waypoints_world)
        if self.way.length_m < speed_m_s * RAMP_S:
            raise CameraPathError(
                f"robot: a way of {self.way.length_m:.2f} m is too short to start and to stop at {speed_m_s:g} m/s; "
                f"it needs {speed_m_s * RAMP_S:.2f} m"
            )
        self.duration_s = self.way.length_m / speed_m_s + RAMP_S
        self._speed_m_s, self._height_m, self._tilt_rad = speed_m_s, height_m, tilt_rad
        self._seed, self._amplitude, self._speed = seed, amplitude, speed

    def _driven_m(self, time_s: float) -> float:
        """Way since the start; the speed rises and falls as a cosine, so the acceleration has no jump but at rest."""
        left_s = self.duration_s - time_s
        if left_s < RAMP_S:
            return self.way.length_m - self._speed_m_s * _ramp_s(left_s)
        return self._speed_m_s * (_ramp_s(time_s) if time_s < RAMP_S else time_s - RAMP_S / 2)

    def pose_at(self, time_s: float) -> FloatArray:
        """`T_world_camera` (4, 4) at any time."""
        s_m = self._driven_m(there_and_back(self._speed * time_s, self.duration_s))
        heading = self.way.heading_at(s_m)
        eye = np.array([*self.way.position_at(s_m), self._height_m])
        level = math.cos(self._tilt_rad)
        forward = np.array([level * math.cos(heading), level * math.sin(heading), -math.sin(self._tilt_rad)])
        return _trembling(look_at(eye, eye + forward), self._speed * time_s, self._seed, self._amplitude)


class FollowingPath:
    """A robot that drives behind a person on the person's own way, at the person's own speed, and looks at the person.

    The person's way is smoothed over half a second. Where the person has not come from anywhere, at the start, the
    robot comes straight from behind.

    Args:
        person: whom to follow.
        distance_m: how far behind, along the way.
        height_m: of the camera.
        gaze_m: height above the floor that it looks at.
        duration_s: how long.
        seed: of the wheels' tremble.
        amplitude: factor on the tremble.

    Raises:
        CameraPathError: a value that is no such distance or time.
    """

    def __init__(
        self,
        person: Motion,
        *,
        distance_m: float,
        height_m: float,
        gaze_m: float,
        duration_s: float,
        seed: int = 0,
        amplitude: float = 1.0,
    ) -> None:
        check_factor("amplitude", amplitude)
        for name, value in (("distance", distance_m), ("duration", duration_s)):
            if not (math.isfinite(value) and value > 0):
                raise CameraPathError(f"follow: the {name} must be above 0, got {value}")
        # The robot may start where the person was this long ago: at the slowest walk, and half as far again.
        before_s = 1.5 * distance_m / _SLOWEST_WALK_M_S
        times = np.arange(-before_s, duration_s + _AFTER_S, _SAMPLE_S)
        places = np.array([person.pose_at(float(t))[:2, 3] for t in times])
        places = gaussian_filter1d(places, _SMOOTHING_S / _SAMPLE_S, axis=0, mode="nearest")
        steps = np.sqrt(np.sum(np.diff(places, axis=0) ** 2, axis=1))
        walked = np.concatenate([[0.0], np.cumsum(steps)])
        facing = -person.pose_at(float(times[0]))[:2, 1]
        back_m = np.arange(math.ceil(distance_m / _SPACING_M), 0, -1) * _SPACING_M
        behind = places[0] - facing * back_m[:, None]
        # One point of the way for every _SPACING_M: a person who stands adds none.
        passed = np.concatenate([[True], np.diff(np.floor(walked / _SPACING_M)) > 0])
        self._way = FloorWay(np.concatenate([behind, places[passed]]))
        self._walked_m = CubicSpline(times, back_m[0] + walked)
        self._person = CubicSpline(times, places)
        self._distance_m, self._height_m, self._gaze_m = distance_m, height_m, gaze_m
        self._seed, self._amplitude = seed, amplitude
        self._first_s, self._last_s = float(times[0]), float(times[-1])

    def pose_at(self, time_s: float) -> FloatArray:
        """`T_world_camera` (4, 4); after `duration_s` it soon stands still."""
        moved_s = min(max(time_s, self._first_s), self._last_s)
        eye = np.array([*self._way.position_at(float(self._walked_m(moved_s)) - self._distance_m), self._height_m])
        target = np.array([*self._person(moved_s), self._gaze_m])
        return _trembling(look_at(eye, target), time_s, self._seed, self._amplitude)


def _ramp_s(time_s: float) -> float:
    """Integral over 0..time_s of a speed that rises from 0 to 1 over RAMP_S as a cosine."""
    return 0.5 * (time_s - RAMP_S / math.pi * math.sin(math.pi * time_s / RAMP_S))


def _trembling(T_world_camera: FloatArray, time_s: float, seed: int, amplitude: float) -> FloatArray:
    offset, rotation = wheel_shake(time_s, seed)
    return np.asarray(T_world_camera @ pose(rotation_from_vector(amplitude * rotation), amplitude * offset))
