"""What a room is: what stands in it, what lights it, and what blocks the way."""

from dataclasses import dataclass

from sim.scene import Light, SceneObject


@dataclass(frozen=True, slots=True, kw_only=True)
class Obstacle:
    """A box that neither people nor things pass through.

    Attributes:
        centre_m: (3,) in the world.
        size_m: (3,) full extents.
        yaw_rad: about z.
    """

    centre_m: tuple[float, float, float]
    size_m: tuple[float, float, float]
    yaw_rad: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Room:
    """Everything that never moves.

    Attributes:
        objects: the shell with instance id 0, furniture with ids from FIRST_FURNITURE_ID.
        lights: near the ceiling.
        obstacles: walls and furniture, and the tops that things stand on.
    """

    objects: tuple[SceneObject, ...]
    lights: tuple[Light, ...]
    obstacles: tuple[Obstacle, ...]


FIRST_FURNITURE_ID = 100
