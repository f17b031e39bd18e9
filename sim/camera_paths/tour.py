"""A camera that is carried from stop to stop and looks at one thing after another."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from sim.camera_paths.path import check_factor, check_speed, rotation_from_vector, there_and_back
from sim.camera_paths.shake import hand_shake
from sim.errors import CameraPathError
from sim.geometry import FloatArray, look_at, pose

STEEPEST = 0.98
"""Sine of the steepest way up or down that the camera may look: an upright camera has no heading at 1."""
NEAREST_GAZE_M = 0.2
_CHECKED_EVERY_S = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Stop:
    """Where the camera is at one time.

    Attributes:
        time_s: when.
        position_world: (3,) metres.
        target_world: (3,) metres, what it looks at.
        roll_rad: about the viewing direction, clockwise as the camera sees itself turn; 0 is upright.
    """

    time_s: float
    position_world: tuple[float, float, float]
    target_world: tuple[float, float, float]
    roll_rad: float = 0.0


class TourPath:
    """A smooth way through stops: position, target and roll are cubic splines of time, with two smooth derivatives.

    The camera starts and ends at rest; after the last stop it goes back the same way, and so on.

    Args:
        stops: at least two, the first at time 0, in the order of time.
        seed: of the hand's shake.
        amplitude: factor on the hand's shake; 0 is a crane.
        speed: the same way in 1/speed of the time.

    Raises:
        CameraPathError: too few stops, times that do not increase from 0, a target too near to the camera, or straight
            above or below it, anywhere on the way.
    """

    def __init__(self, stops: Sequence[Stop], *, seed: int = 0, amplitude: float = 1.0, speed: float = 1.0) -> None:
        check_factor("amplitude", amplitude)
        check_speed(speed)
        times = np.array([stop.time_s for stop in stops], float)
        if len(stops) < 2 or times[0] != 0 or not np.all(np.diff(times) > 0):
            raise CameraPathError("tour: needs at least 2 stops with times that begin at 0 and increase")
        rows = [(*stop.position_world, *stop.target_world, stop.roll_rad) for stop in stops]
        self._curve = CubicSpline(times, np.array(rows, float), bc_type="clamped")
        self._seed, self._amplitude, self._speed = seed, amplitude, speed
        self.duration_s = float(times[-1])
        self._check()

    def _check(self) -> None:
        for time_s in np.append(np.arange(0.0, self.duration_s, _CHECKED_EVERY_S), self.duration_s):
            row = self._curve(time_s)
            forward = row[3:6] - row[:3]
            distance = float(np.sqrt(np.sum(forward**2)))
            if distance < NEAREST_GAZE_M or abs(float(forward[2])) > STEEPEST * distance:
                raise CameraPathError(
                    f"tour: after {time_s:.1f} s the target is less than {NEAREST_GAZE_M:g} m from the camera, or "
                    "almost straight above or below it; move the stops around that time"
                )

    def pose_at(self, time_s: float) -> FloatArray:
        """`T_world_camera` (4, 4) at any time."""
        row = self._curve(there_and_back(self._speed * time_s, self.duration_s))
        offset, shake = hand_shake(self._speed * time_s, self._seed)
        roll = rotation_from_vector(np.array([0.0, 0.0, float(row[6])]))
        T_world_upright = look_at(row[:3], row[3:6])
        T_upright_camera = pose(roll @ rotation_from_vector(self._amplitude * shake), self._amplitude * offset)
        return np.asarray(T_world_upright @ T_upright_camera)
