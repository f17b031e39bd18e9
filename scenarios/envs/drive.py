"""How an agent drives a camera: limits on speed and acceleration, and what the camera cannot go into."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dotmask.records import FloatArray
from dotmask.slam.twists import exp
from sim.geometry import rotation_z
from sim.rooms.room import Obstacle

CLEARANCE_M = 0.15
"""The camera keeps this distance from walls, floor, ceiling and furniture."""
STEEPEST_RAD = math.radians(75)
"""The camera looks no steeper up or down than this: beyond it a picture has no upright."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveLimits:
    """What the action 1 means, and how fast it is reached.

    Attributes:
        speed_m_s, turn_rad_s: greatest speeds, whatever the direction.
        acceleration_m_s2, turn_acceleration_rad_s2: greatest changes of them a second.
    """

    speed_m_s: float = 1.0
    turn_rad_s: float = 1.5
    acceleration_m_s2: float = 2.0
    turn_acceleration_rad_s2: float = 6.0

    def __post_init__(self) -> None:
        """Refuse what is no limit."""
        for name in self.__slots__:
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise ValueError(f"{name}: expected a finite number above 0, got {getattr(self, name)}")


class FreeSpace:
    """Where in a room the camera may be.

    People and things that move do not stop it: they are what it looks at, and the scenario moves them.

    Args:
        obstacles: walls and furniture; the highest end at the ceiling, and the floor is at z = 0.
    """

    def __init__(self, obstacles: Sequence[Obstacle]) -> None:
        self._centres = np.array([o.centre_m for o in obstacles], float)
        self._halves = np.array([o.size_m for o in obstacles], float) / 2 + CLEARANCE_M
        self._turns = np.array([rotation_z(-o.yaw_rad) for o in obstacles])
        self._top_m = max(o.centre_m[2] + o.size_m[2] / 2 for o in obstacles) - CLEARANCE_M

    def holds(self, position_world: FloatArray) -> bool:
        """Whether the camera may be at a position (3,), metres."""
        if not CLEARANCE_M <= position_world[2] <= self._top_m:
            return False
        inside = np.einsum("nij,nj->ni", self._turns, position_world - self._centres)
        return not bool((np.abs(inside) < self._halves).all(axis=1).any())


class Drive:
    """A camera that follows commands as well as its limits and the room let it.

    Args:
        limits: of speed and acceleration.
        space: where it may be.
        T_world_camera: (4, 4) where it starts, at rest.

    Attributes:
        T_world_camera: (4, 4) where it is.
        velocity: (3,) metres per second, camera axes.
        turn_rate: (3,) radians per second, camera axes.
        is_blocked: whether the last step was cut short by the room, or by the steepest view.
    """

    def __init__(self, limits: DriveLimits, space: FreeSpace, T_world_camera: FloatArray) -> None:
        self._limits, self._space = limits, space
        self.T_world_camera = T_world_camera
        self.velocity, self.turn_rate = np.zeros(3), np.zeros(3)
        self.is_blocked = False

    def twist(self) -> FloatArray:
        """(6,) the present velocity and turn rate as shares of the greatest, -1..1."""
        return np.concatenate([self.velocity / self._limits.speed_m_s, self.turn_rate / self._limits.turn_rad_s])

    def step(self, action: FloatArray, duration_s: float) -> FloatArray:
        """Go on for `duration_s`, and return the new pose `T_world_camera` (4, 4).

        Velocity and turn rate go towards the commanded ones and are then kept for the whole step, in camera axes.
        At a wall the camera slides along it; a turn that would look too steep is not made.

        Args:
            action: (6,) in -1..1: wanted velocity along x, y, z and turn rate about x, y, z of the camera (x right,
                y down, z forward), as shares of the greatest.
            duration_s: seconds.
        """
        limits, T_before = self._limits, self.T_world_camera
        self.velocity = _towards(
            self.velocity, limits.speed_m_s * action[:3], limits.speed_m_s, limits.acceleration_m_s2 * duration_s
        )
        self.turn_rate = _towards(
            self.turn_rate,
            limits.turn_rad_s * action[3:],
            limits.turn_rad_s,
            limits.turn_acceleration_rad_s2 * duration_s,
        )
        T_after = T_before @ exp(np.concatenate([self.turn_rate, self.velocity]) * duration_s)
        self.is_blocked = False
        if _steepness(T_after) > max(STEEPEST_RAD, _steepness(T_before)):
            T_after[:3, :3] = T_before[:3, :3]
            self.turn_rate, self.is_blocked = np.zeros(3), True
        reached = self._reached(T_before[:3, 3], T_after[:3, 3])
        if not np.array_equal(reached, T_after[:3, 3]):
            T_after[:3, 3] = reached
            self.velocity = T_after[:3, :3].T @ (reached - T_before[:3, 3]) / duration_s
            self.is_blocked = True
        self.T_world_camera = T_after
        return T_after

    def _reached(self, start: FloatArray, wanted: FloatArray) -> FloatArray:
        """(3,) how far the camera gets: along each world axis to the end or not at all.

        A camera that starts where it may not be, as a scenario can have it, may leave that place.
        """
        if self._space.holds(wanted) or not self._space.holds(start):
            return wanted
        reached = start
        for axis in range(3):
            tried = reached.copy()
            tried[axis] = wanted[axis]
            if self._space.holds(tried):
                reached = tried
        return reached


def _towards(now: FloatArray, wanted: FloatArray, greatest: float, most_change: float) -> FloatArray:
    """(3,) `wanted`, cut to the length `greatest`, or as near to it as a change of length `most_change` gets."""
    change = _cut(wanted, greatest) - now
    return np.asarray(now + _cut(change, most_change))


def _cut(vector: FloatArray, longest: float) -> FloatArray:
    length = float(np.linalg.norm(vector))
    return vector if length <= longest else vector * (longest / length)


def _steepness(T_world_camera: FloatArray) -> float:
    """Radians between the viewing direction and the horizontal."""
    return abs(math.asin(max(-1.0, min(1.0, float(T_world_camera[2, 2])))))
