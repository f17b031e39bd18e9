"""Where in a room somebody can stand, a chair or a cup can be put, and a camera can look from."""

import math
from collections.abc import Sequence

import numpy as np

from scenarios.envs.drive import FreeSpace
from sim.geometry import FloatArray, look_at, pose, rotation_z
from sim.rooms.room import Obstacle, Room

TRIES = 40
DESK_TOPS_M = (0.6, 0.9)
"""Between these heights lies the top of a desk."""
STEEPEST_RAD = math.radians(65)
CAMERA_RADIUS_M = 0.15
"""So far a camera stays away from people."""

Disc = tuple[float, float, float]
"""x, y and radius of what is taken on the floor, metres."""


class Places:
    """The free places of a room.

    Args:
        room: with a background object called "floor".
    """

    def __init__(self, room: Room) -> None:
        (floor,) = (thing for thing in room.objects if thing.name == "floor")
        points = np.concatenate([surface.vertices for surface in floor.surfaces])
        self._low, self._high = points[:, :2].min(axis=0).astype(float), points[:, :2].max(axis=0).astype(float)
        self._space = FreeSpace(room.obstacles)
        self._obstacles = room.obstacles
        self._desks = [o for o in room.obstacles if _is_desk_top(o)]

    def on_floor(self, rng: np.random.Generator, radius_m: float, taken: Sequence[Disc]) -> Disc | None:
        """A disc of this radius that touches neither furniture nor what is taken; None where none was found."""
        for _ in range(TRIES):
            x, y = rng.uniform(self._low, self._high).tolist()
            if self.is_free(x, y, radius_m) and is_apart((x, y, radius_m), taken):
                return x, y, radius_m
        return None

    def is_free(self, x: float, y: float, radius_m: float, *, under_desks: bool = False) -> bool:
        """Whether a disc on the floor touches no furniture and no wall; `under_desks` leaves tops of desks out."""
        for obstacle in self._obstacles:
            if under_desks and obstacle in self._desks:
                continue
            local = rotation_z(-obstacle.yaw_rad)[:2, :2] @ (np.array([x, y]) - obstacle.centre_m[:2])
            outside = np.maximum(np.abs(local) - np.array(obstacle.size_m[:2]) / 2, 0.0)
            if math.hypot(*outside) < radius_m:
                return False
        return bool(np.all(self._low < (x, y)) and np.all(self._high > (x, y)))

    def at_desk(self, rng: np.random.Generator) -> tuple[float, float, float] | None:
        """x, y, heading in radians of a chair before or partly under a desk, about facing it."""
        if not self._desks:
            return None
        for _ in range(TRIES):
            desk = self._desks[int(rng.integers(len(self._desks)))]
            along = rng.uniform(-0.35, 0.35) * desk.size_m[0]
            away = desk.size_m[1] / 2 + rng.uniform(-0.05, 0.35)
            x, y = rotation_z(desk.yaw_rad)[:2, :2] @ (along, -away) + desk.centre_m[:2]
            if self.is_free(float(x), float(y), 0.2, under_desks=True):
                return float(x), float(y), desk.yaw_rad + math.pi / 2 + float(rng.normal(0.0, 0.6))
        return None

    def on_desk(self, rng: np.random.Generator) -> tuple[float, float, float] | None:
        """A point on the top of a desk."""
        if not self._desks:
            return None
        desk = self._desks[int(rng.integers(len(self._desks)))]
        across = rng.uniform(-0.42, 0.42, 2) * desk.size_m[:2]
        x, y = rotation_z(desk.yaw_rad)[:2, :2] @ across + desk.centre_m[:2]
        return float(x), float(y), desk.centre_m[2] + desk.size_m[2] / 2

    def camera(
        self,
        rng: np.random.Generator,
        target_world: FloatArray,
        distances_m: tuple[float, float],
        people: Sequence[Disc],
    ) -> FloatArray | None:
        """`T_world_camera` (4, 4) of an upright camera that looks about at a target (3,); None where none was found.

        Heights are 0.2 to 1.8 m, half of them about 1.35 m, as of a hand-held camera.

        Args:
            rng: of the draw.
            target_world: that it looks at.
            distances_m: least and greatest, horizontally; the logarithm is drawn evenly.
            people: that the camera must not be in.
        """
        for _ in range(TRIES):
            distance = math.exp(rng.uniform(*np.log(distances_m)))
            angle = rng.uniform(0, 2 * math.pi)
            height = rng.uniform(0.2, 1.8) if rng.random() < 0.5 else float(np.clip(rng.normal(1.35, 0.15), 0.2, 1.8))
            eye = np.array([*target_world[:2], height])
            eye[:2] += distance * np.array([math.cos(angle), math.sin(angle)])
            # Targets lie anywhere in the middle half of the image, more or less.
            gaze = target_world + rng.normal(0.0, 0.17, 3) * distance
            ahead = gaze - eye
            if (
                self.holds(eye)
                and is_apart((eye[0], eye[1], CAMERA_RADIUS_M), people)
                and abs(ahead[2]) < math.tan(STEEPEST_RAD) * math.hypot(ahead[0], ahead[1])
            ):
                return look_at(eye, gaze)
        return None

    def holds(self, position_world: FloatArray) -> bool:
        """Whether a camera may be at a position (3,): in the room, and not in its furniture."""
        is_inside = bool(np.all(self._low < position_world[:2]) and np.all(self._high > position_world[:2]))
        return is_inside and self._space.holds(position_world)


def is_apart(disc: Disc, taken: Sequence[Disc]) -> bool:
    """Whether a disc touches none of those that are taken."""
    return all(math.hypot(disc[0] - x, disc[1] - y) > disc[2] + radius for x, y, radius in taken)


def rolled(T_world_camera: FloatArray, angle_rad: float) -> FloatArray:
    """The camera (4, 4), turned about its viewing direction."""
    return np.asarray(T_world_camera @ pose(rotation_z(angle_rad), [0.0, 0.0, 0.0]))


def _is_desk_top(obstacle: Obstacle) -> bool:
    top = obstacle.centre_m[2] + obstacle.size_m[2] / 2
    return DESK_TOPS_M[0] < top < DESK_TOPS_M[1] and obstacle.size_m[2] < 0.1 and min(obstacle.size_m[:2]) > 0.4
