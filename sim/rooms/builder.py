"""Puts a room together: each thing with its own generator, name and instance id, and with the boxes that it blocks."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from sim.geometry import FloatArray, pose, rotation_z
from sim.randomness import child
from sim.rooms.room import FIRST_FURNITURE_ID, Obstacle, Room
from sim.scene import Light, Placed, SceneObject, Surface
from sim.things import furniture, prints
from sim.things.meshes import panel
from sim.things.textures import Image

WALL_M = 0.2
"""Thickness of the walls as obstacles."""


def placed(x: float, y: float, z: float = 0.0, yaw_deg: float = 0.0) -> FloatArray:
    """`T_world_object` (4, 4) of a thing that stands upright."""
    return pose(rotation_z(np.deg2rad(yaw_deg)), [x, y, z])


@dataclass(frozen=True, slots=True, kw_only=True)
class Shell:
    """What encloses a room: a box, each side of square textures next to each other, never a repeated one.

    Attributes:
        minimum_m, maximum_m: (3,) corners.
        floor: one (S, S, 3) or more, next to each other along y.
        ceiling: (S, S, 3).
        north, east, south, west: (S, n S, 3) of the walls at the greatest y, greatest x, least y and least x.
    """

    minimum_m: tuple[float, float, float]
    maximum_m: tuple[float, float, float]
    floor: tuple[Image, ...]
    ceiling: Image
    north: Image
    east: Image
    south: Image
    west: Image


class RoomBuilder:
    """Collects what stands in a room.

    Args:
        name: of the room; part of the seed of everything in it.
        seed: of the scenario.
    """

    def __init__(self, name: str, seed: int) -> None:
        self._name, self._seed = name, seed
        self._objects: list[SceneObject] = []
        self._obstacles: list[Obstacle] = []

    def rng(self, name: str) -> np.random.Generator:
        """The generator of a thing's looks."""
        return child(self._seed, self._name, name)

    def built(self, lights: tuple[Light, ...]) -> Room:
        """The room."""
        return Room(objects=tuple(self._objects), lights=lights, obstacles=tuple(self._obstacles))

    def put(
        self,
        name: str,
        class_name: str,
        surfaces: tuple[Surface, ...],
        T_world_object: FloatArray,
        *,
        blocks: bool = False,
    ) -> None:
        """Add a thing; if it `blocks`, its bounding box is an obstacle."""
        self._add(name, class_name, FIRST_FURNITURE_ID + self._things(), surfaces, T_world_object)
        if blocks:
            points = np.concatenate([surface.vertices for surface in surfaces])
            self._block(points.astype(np.float64), T_world_object)

    def desk(self, name: str, T_world_object: FloatArray) -> None:
        """Add a desk. Its top and its legs are obstacles, so that a chair rolls under it."""
        surfaces = furniture.desk(self.rng(name))
        self._add(name, "dining table", FIRST_FURNITURE_ID + self._things(), surfaces, T_world_object)
        top, legs = (surface.vertices.astype(np.float64) for surface in surfaces)
        self._block(top, T_world_object)
        for side in (-1, 1):
            leg = legs[(np.sign(legs[:, 0]) == side) & (np.abs(legs[:, 0]) > furniture.DESK_LEG_X_M - 0.04)]
            self._block(leg, T_world_object)

    def hang(self, name: str, size_m: tuple[float, float], T_world_object: FloatArray) -> None:
        """Add a poster without frame or a framed painting, as it comes."""
        rng = self.rng(name)
        if rng.random() < 0.6:
            surfaces = furniture.hung(prints.poster(rng, 256), *size_m, rng)
        else:
            surfaces = furniture.hung(prints.picture(rng, 256), *size_m, rng, (88, 66, 46))
        self.put(name, "poster", surfaces, T_world_object)

    def shell(self, shell: Shell) -> None:
        """Add floor, ceiling and walls."""
        (x0, y0, z0), (x1, y1, z1) = shell.minimum_m, shell.maximum_m
        x, y, z = (x1 - x0) / 2, (y1 - y0) / 2, (z1 - z0) / 2
        mx, my, mz = (x0 + x1) / 2, (y0 + y1) / 2, (z0 + z1) / 2
        part = y / len(shell.floor)
        tiles = (
            panel((mx, y0 + (2 * k + 1) * part, z0), (x, 0, 0), (0, part, 0)).surface(image)
            for k, image in enumerate(shell.floor)
        )
        self._background("floor", "floor", tuple(tiles))
        self._background("ceiling", "ceiling", (panel((mx, my, z1), (x, 0, 0), (0, -y, 0)).surface(shell.ceiling),))
        self._background("wall back", "wall", tuple(_wall((mx, y1, mz), (x, 0, 0), (0, 0, z), shell.north)))
        self._background("wall right", "wall", tuple(_wall((x1, my, mz), (0, -y, 0), (0, 0, z), shell.east)))
        self._background("wall front", "wall", tuple(_wall((mx, y0, mz), (-x, 0, 0), (0, 0, z), shell.south)))
        self._background("wall left", "wall", tuple(_wall((x0, my, mz), (0, y, 0), (0, 0, z), shell.west)))
        for sign, edge in ((-1, y0), (1, y1)):
            centre = (mx, edge + sign * WALL_M / 2, mz)
            self._obstacles.append(Obstacle(centre_m=centre, size_m=(x1 - x0, WALL_M, z1 - z0)))
        for sign, edge in ((-1, x0), (1, x1)):
            centre = (edge + sign * WALL_M / 2, my, mz)
            self._obstacles.append(Obstacle(centre_m=centre, size_m=(WALL_M, y1 - y0, z1 - z0)))

    def _things(self) -> int:
        return sum(o.instance_id > 0 for o in self._objects)

    def _background(self, name: str, class_name: str, surfaces: tuple[Surface, ...]) -> None:
        self._add(name, class_name, 0, surfaces, placed(0.0, 0.0))

    def _add(
        self, name: str, class_name: str, instance_id: int, surfaces: tuple[Surface, ...], T_world_object: FloatArray
    ) -> None:
        self._objects.append(
            SceneObject(
                name=name,
                class_name=class_name,
                instance_id=instance_id,
                surfaces=surfaces,
                motion=Placed(T_world_object),
            )
        )

    def _block(self, points_object: FloatArray, T_world_object: FloatArray) -> None:
        """Add the box around points (n, 3) of an upright thing."""
        low, high = points_object.min(axis=0), points_object.max(axis=0)
        R = T_world_object[:3, :3]
        centre = R @ ((low + high) / 2) + T_world_object[:3, 3]
        x, y, z = (high - low).tolist()
        self._obstacles.append(
            Obstacle(
                centre_m=(float(centre[0]), float(centre[1]), float(centre[2])),
                size_m=(x, y, z),
                yaw_rad=float(np.arctan2(R[1, 0], R[0, 0])),
            )
        )


def _wall(
    centre: tuple[float, float, float],
    right: tuple[float, float, float],
    up: tuple[float, float, float],
    image: Image,
) -> Iterator[Surface]:
    """A wall of square textures that continue each other, from left to right as its viewer sees it."""
    size = image.shape[0]
    count = image.shape[1] // size
    middle, half = np.asarray(centre), np.asarray(right) / count
    for index in range(count):
        part = np.ascontiguousarray(image[:, index * size : (index + 1) * size])
        offset = (2 * index + 1 - count) * half
        yield panel(middle + offset, half, up).mapped((0.5 / size, 1 - 0.5 / size)).surface(part)
