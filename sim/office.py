"""The office: a room of 7 by 6 by 2.8 m with a double desk, after the place of the fr3 sequences of the TUM benchmark.

Seen from above (metres; x to the right, y away from the camera)::

    y =  2.70   back wall: shelves with books, whiteboard, posters, clock
    y =  1.20 .. 2.00   the desks, x from -1.5 to 1.5: monitors, keyboards, papers, cups, bottles, books
    y =  0.95   chairs stand about here, see CHAIR_PLACES
    y = -0.60 .. 0.70   walking area, x from -1.8 to 1.8: 1.6 to 2.9 m from the camera
    y = -0.90   low shelf with things on it, x from -0.5 to 0.5, 0.7 m high: close texture, below the camera's middle
    y = -1.55 .. -1.05   near walking lane: 0.7 to 1.2 m from the camera
    y = -2.20   the camera, at x = 0, z = 1.4, looking along +y and slightly down, see CAMERA_PLACE
    y = -3.30   wall behind the camera: door, board, posters

The left wall (x = -3.5) is of brick and has a window, the right one (x = 3.5) has a cork board. Nothing else stands
within x = -1.8 .. 1.8, y = -2.9 .. 1.2.
"""

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from sim import clutter, furniture, prints, textures
from sim.geometry import FloatArray, pose, rotation_z
from sim.meshes import panel
from sim.physics import StaticBox
from sim.randomness import child
from sim.scene import Light, Placed, SceneObject, Surface
from sim.textures import Image

ROOM_MIN_M = (-3.5, -3.3, 0.0)
ROOM_MAX_M = (3.5, 2.7, 2.8)
CAMERA_PLACE = (0.0, -2.2, 1.4)
"""Where the camera is nominally; paths may leave it by 0.6 m to every side."""
CHAIR_PLACES = ((-1.0, 0.95), (1.0, 0.95))
"""Floor positions of chairs at the desks."""
FIRST_INSTANCE_ID = 100
LIGHTS = (
    Light(position_world=(-1.4, 0.2, 2.6), power=3.0),
    Light(position_world=(1.5, 0.7, 2.6), power=3.0),
    Light(position_world=(0.1, -1.9, 2.6), power=2.4),
)

_DESK_X_M = furniture.DESK_SIZE_M[0] / 2
_DESK_Y_M = 1.6
_DESK_TOP_M = furniture.DESK_SIZE_M[2]
_LOW_SHELF_M = (1.0, 0.24, 0.7)
_LOW_SHELF_Y_M = -0.9


def _at(x: float, y: float, z: float = 0.0, yaw_deg: float = 0.0) -> FloatArray:
    return pose(rotation_z(np.deg2rad(yaw_deg)), [x, y, z])


class _Builder:
    """Collects things, each with its own generator, name and instance id in order."""

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self.objects: list[SceneObject] = []

    def rng(self, name: str) -> np.random.Generator:
        return child(self._seed, "office", name)

    def room(self, name: str, class_name: str, surfaces: tuple[Surface, ...]) -> None:
        self.objects.append(
            SceneObject(
                name=name, class_name=class_name, instance_id=0, surfaces=surfaces, motion=Placed(_at(0.0, 0.0))
            )
        )

    def thing(self, name: str, class_name: str, surfaces: tuple[Surface, ...], T_world_object: FloatArray) -> None:
        taken = sum(o.instance_id > 0 for o in self.objects)
        self.objects.append(
            SceneObject(
                name=name,
                class_name=class_name,
                instance_id=FIRST_INSTANCE_ID + taken,
                surfaces=surfaces,
                motion=Placed(T_world_object),
            )
        )


@lru_cache(maxsize=2)
def build_office(seed: int) -> tuple[SceneObject, ...]:
    """The room and everything in it that never moves; people and chairs are the caller's.

    The last two offices are kept, so that the scenes of one process share them.

    Args:
        seed: of every texture and every small difference.

    Returns:
        The room's shell with instance id 0 and the classes "floor", "ceiling" and "wall"; then furniture with ids from
        FIRST_INSTANCE_ID and COCO classes where there are any.
    """
    builder = _Builder(seed)
    _build_shell(builder)
    _build_desks(builder)
    _build_desk_clutter(builder)
    _build_low_shelf(builder)
    _build_back_wall(builder)
    _build_sides(builder)
    _build_front_wall(builder)
    _build_lamps(builder)
    return tuple(builder.objects)


def _build_shell(builder: _Builder) -> None:
    (x0, y0, z0), (x1, y1, z1) = ROOM_MIN_M, ROOM_MAX_M
    x, y, z = (x1 - x0) / 2, (y1 - y0) / 2, (z1 - z0) / 2
    mx, my = (x0 + x1) / 2, (y0 + y1) / 2
    floor = panel((mx, my, z0), (x, 0, 0), (0, y, 0))
    builder.room("floor", "floor", (floor.surface(textures.carpet(builder.rng("floor"), 2048)),))
    ceiling = panel((mx, my, z1), (x, 0, 0), (0, -y, 0))
    builder.room("ceiling", "ceiling", (ceiling.surface(textures.ceiling(builder.rng("ceiling"), 512)),))
    fine, coarse = (1024, 2048), (512, 1024)
    north = textures.plaster(builder.rng("wall back"), fine)
    east = textures.plaster(builder.rng("wall right"), fine, (204, 210, 206))
    south = textures.plaster(builder.rng("wall front"), coarse, (216, 208, 190))
    west = textures.brick(builder.rng("wall left"), fine, (z1 - z0, y1 - y0))
    builder.room("wall back", "wall", tuple(_wall((mx, y1, z), (x, 0, 0), (0, 0, z), north)))
    builder.room("wall right", "wall", tuple(_wall((x1, my, z), (0, -y, 0), (0, 0, z), east)))
    builder.room("wall front", "wall", tuple(_wall((mx, y0, z), (-x, 0, 0), (0, 0, z), south)))
    builder.room("wall left", "wall", tuple(_wall((x0, my, z), (0, y, 0), (0, 0, z), west)))


def _wall(
    centre: tuple[float, float, float],
    right: tuple[float, float, float],
    up: tuple[float, float, float],
    image: Image,
) -> Iterator[Surface]:
    """A wall of two square textures side by side that continue each other; never a repeated one."""
    middle, half = np.asarray(centre), np.asarray(right) / 2
    size = image.shape[0]
    for index, sign in enumerate((-1.0, 1.0)):
        part = np.ascontiguousarray(image[:, index * size : (index + 1) * size])
        yield panel(middle + sign * half, half, up).mapped((0.5 / size, 1 - 0.5 / size)).surface(part)


def _build_desks(builder: _Builder) -> None:
    for side, x in (("left", -_DESK_X_M), ("right", _DESK_X_M)):
        name = f"desk {side}"
        builder.thing(name, "dining table", furniture.desk(builder.rng(name)), _at(x, _DESK_Y_M))
    for side, x, yaw in (("left", -0.72, 6.0), ("right", 0.5, -7.0)):
        name = f"monitor {side}"
        builder.thing(name, "tv", furniture.monitor(builder.rng(name)), _at(x, 1.72, _DESK_TOP_M, yaw))


def _build_desk_clutter(builder: _Builder) -> None:
    def put(name: str, class_name: str, surfaces: tuple[Surface, ...], x: float, y: float, yaw: float = 0.0) -> None:
        builder.thing(name, class_name, surfaces, _at(x, y, _DESK_TOP_M, yaw))

    rng = builder.rng
    put("keyboard left", "keyboard", clutter.keyboard(rng("keyboard left")), -0.72, 1.38, 3)
    put("keyboard right", "keyboard", clutter.keyboard(rng("keyboard right")), 0.46, 1.36, -5)
    put("mouse left", "mouse", clutter.mouse(rng("mouse left")), -0.34, 1.38, 8)
    put("mouse right", "mouse", clutter.mouse(rng("mouse right")), 0.84, 1.36, -4)
    for name, x, y in (("a", -1.08, 1.42), ("b", 0.28, 1.56), ("c", 0.98, 1.53)):
        put(f"cup {name}", "cup", clutter.cup(rng(f"cup {name}")), x, y)
    for name, x, y in (("a", -1.22, 1.72), ("b", 0.13, 1.74), ("c", 1.08, 1.72), ("d", -0.2, 1.86)):
        put(f"bottle {name}", "bottle", clutter.bottle(rng(f"bottle {name}")), x, y, 40.0 * ord(name))
    for name, count, x, y, yaw in (("a", 5, -1.33, 1.5, 20), ("b", 4, 1.33, 1.56, -15), ("c", 7, -0.05, 1.62, 8)):
        put(f"books {name}", "book", clutter.book_stack(rng(f"books {name}"), count), x, y, yaw)
    place = rng("sheets")
    for index, (x, y) in enumerate(
        ((-1.25, 1.32), (-0.12, 1.32), (0.06, 1.38), (1.12, 1.36), (1.3, 1.32), (-1.06, 1.6))
    ):
        surfaces = clutter.sheet(rng(f"sheet {index}"), height_m=0.001 * (index + 1))
        put(f"sheet {index}", "paper", surfaces, x, y, float(place.uniform(-40, 40)))
    put("desk lamp", "lamp", clutter.desk_lamp(rng("desk lamp")), -1.36, 1.86, -25)
    put("desk plant", "potted plant", clutter.plant(rng("desk plant"), 0.42), 0.98, 1.88)
    put("carton desk", "box", clutter.carton(rng("carton desk"), (0.3, 0.22, 0.2)), 1.3, 1.86, 12)


def _build_low_shelf(builder: _Builder) -> None:
    rng, top = builder.rng, _LOW_SHELF_M[2]
    builder.thing("low shelf", "shelf", furniture.shelf(rng("low shelf"), _LOW_SHELF_M, 1), _at(0, _LOW_SHELF_Y_M))
    for level, z in enumerate(furniture.shelf_levels(top, 1)):
        row = furniture.book_row(rng(f"low books {level}"), 0.9, 0.28, texture_size=512)
        builder.thing(f"low books {level}", "book", row, _at(0, _LOW_SHELF_Y_M - 0.01, z))

    def put(name: str, class_name: str, surfaces: tuple[Surface, ...], x: float, dy: float, yaw: float = 0.0) -> None:
        builder.thing(name, class_name, surfaces, _at(x, _LOW_SHELF_Y_M + dy, top, yaw))

    put("low sheet a", "paper", clutter.sheet(rng("low sheet a")), -0.12, 0.0, 80)
    put("low sheet b", "paper", clutter.sheet(rng("low sheet b"), height_m=0.002), 0.1, -0.01, 98)
    put("low cup", "cup", clutter.cup(rng("low cup")), -0.32, -0.04)
    put("low bottle", "bottle", clutter.bottle(rng("low bottle")), -0.42, 0.04, 200)
    put("low stack", "book", clutter.book_stack(rng("low stack"), 3), 0.38, 0.0, 84)
    put("low cup b", "cup", clutter.cup(rng("low cup b")), 0.16, 0.07)


def _build_back_wall(builder: _Builder) -> None:
    rng, wall = builder.rng, ROOM_MAX_M[1]
    for side, x, size, boards in (("left", -2.05, (1.15, 0.34, 1.95), 4), ("right", 2.2, (1.25, 0.34, 1.6), 3)):
        y = wall - size[1] / 2 - 0.01
        builder.thing(f"shelf {side}", "shelf", furniture.shelf(rng(f"shelf {side}"), size, boards), _at(x, y))
        levels = furniture.shelf_levels(size[2], boards)
        for level, z in enumerate(levels):
            name = f"books {side} {level}"
            row = furniture.book_row(rng(name), size[0] - 0.08, levels[1] - levels[0] - 0.03)
            builder.thing(name, "book", row, _at(x, y - 0.03, z))
    builder.thing("shelf plant", "potted plant", clutter.plant(rng("shelf plant"), 0.45), _at(1.85, wall - 0.26, 1.6))
    builder.thing(
        "shelf carton", "box", clutter.carton(rng("shelf carton"), (0.42, 0.28, 0.26)), _at(2.4, wall - 0.19, 1.6, 7)
    )
    board = furniture.hung(prints.whiteboard(rng("whiteboard")), 1.5, 0.95, rng("whiteboard frame"), (150, 152, 156))
    builder.thing("whiteboard", "whiteboard", board, _at(0.0, wall, 1.72))
    for name, x, z, width, height in (
        ("a", -1.15, 1.62, 0.5, 0.72),
        ("b", 1.12, 1.68, 0.5, 0.7),
        ("c", -0.98, 2.42, 0.4, 0.4),
        ("d", 0.3, 2.48, 0.62, 0.34),
        ("e", 3.16, 1.7, 0.46, 0.64),
        ("f", -3.04, 1.5, 0.6, 0.84),
        ("g", -1.22, 0.85, 0.4, 0.55),
        ("h", 1.2, 0.9, 0.5, 0.5),
        ("i", 0.1, 0.95, 0.6, 0.42),
    ):
        _hang_picture(builder, f"poster back {name}", (width, height), _at(x, wall, z))
    builder.thing("clock", "clock", furniture.clock(rng("clock")), _at(1.0, wall, 2.36))


def _hang_picture(builder: _Builder, name: str, size_m: tuple[float, float], T_world_object: FloatArray) -> None:
    """A poster without frame or a framed painting, as it comes."""
    rng = builder.rng(name)
    if rng.random() < 0.6:
        surfaces = furniture.hung(prints.poster(rng, 256), *size_m, rng)
    else:
        surfaces = furniture.hung(prints.picture(rng, 256), *size_m, rng, (88, 66, 46))
    builder.thing(name, "poster", surfaces, T_world_object)


def _build_sides(builder: _Builder) -> None:
    rng, left, right = builder.rng, ROOM_MIN_M[0], ROOM_MAX_M[0]
    builder.thing("window", "window", furniture.window(rng("window"), 1.7, 1.2), _at(left, -0.2, 1.6, 90))
    builder.thing("radiator", "radiator", furniture.radiator(rng("radiator"), 1.5), _at(left + 0.1, -0.2, 0, 90))
    for name, y, z, width, height in (
        ("a", 1.35, 1.6, 0.6, 0.84),
        ("b", -1.75, 1.7, 0.7, 0.7),
        ("c", 2.25, 1.55, 0.5, 0.7),
    ):
        _hang_picture(builder, f"poster left {name}", (width, height), _at(left, y, z, 90))
    cork = furniture.hung(prints.cork_board(rng("cork board")), 1.5, 1.05, rng("cork frame"), (132, 92, 58))
    builder.thing("cork board", "board", cork, _at(right, 0.35, 1.6, -90))
    for name, y, z, width, height in (
        ("a", 1.75, 1.7, 0.7, 0.9),
        ("b", -1.0, 1.65, 0.6, 0.84),
        ("c", -2.2, 1.6, 0.8, 0.6),
    ):
        _hang_picture(builder, f"poster right {name}", (width, height), _at(right, y, z, -90))
    builder.thing("plant", "potted plant", clutter.plant(rng("plant"), 1.25), _at(-2.25, 1.38))
    builder.thing("plant b", "potted plant", clutter.plant(rng("plant b"), 0.95), _at(3.0, -2.05))
    cabinet = furniture.cabinet(rng("cabinet"), (0.46, 0.5, 0.74), (150, 156, 160), 3)
    builder.thing("cabinet", "cabinet", cabinet, _at(2.1, 1.35, 0, -28))
    builder.thing("printer", "printer", clutter.carton(rng("printer"), (0.38, 0.36, 0.24)), _at(2.1, 1.35, 0.74, -24))
    for index, (x, y, z, size, yaw) in enumerate(
        (
            (-2.7, 0.65, 0.0, (0.5, 0.4, 0.36), 24.0),
            (-2.68, 0.68, 0.36, (0.4, 0.32, 0.28), 8.0),
            (-2.3, 0.1, 0.0, (0.36, 0.3, 0.3), -17.0),
            (2.75, 0.4, 0.0, (0.55, 0.4, 0.42), -31.0),
            (2.78, 0.42, 0.42, (0.42, 0.34, 0.3), -12.0),
        )
    ):
        name = f"carton {index}"
        builder.thing(name, "box", clutter.carton(rng(name), size), _at(x, y, z, yaw))
    builder.thing("bin", "bin", clutter.bin_with_paper(rng("bin")), _at(1.72, 1.9))
    tall = furniture.cabinet(rng("cabinet tall"), (0.8, 0.45, 1.35), (120, 132, 124), 4)
    builder.thing("cabinet tall", "cabinet", tall, _at(right - 0.24, -1.15, 0, -90))


def _build_front_wall(builder: _Builder) -> None:
    rng, wall = builder.rng, ROOM_MIN_M[1]
    builder.thing("door", "door", furniture.door(rng("door")), _at(-1.9, wall, 0, 180))
    board = furniture.hung(prints.whiteboard(rng("board front"), 256), 1.3, 0.9, rng("board frame"), (150, 152, 156))
    builder.thing("board front", "whiteboard", board, _at(1.6, wall, 1.5, 180))
    for name, x, z, width, height in (
        ("a", -0.55, 1.6, 0.6, 0.84),
        ("b", 0.35, 1.7, 0.5, 0.7),
        ("c", 2.85, 1.6, 0.6, 0.8),
        ("d", -0.15, 0.85, 0.5, 0.4),
        ("e", -3.0, 1.6, 0.5, 0.7),
        ("f", 0.4, 2.4, 0.6, 0.34),
    ):
        _hang_picture(builder, f"poster front {name}", (width, height), _at(x, wall, z, 180))


def _build_lamps(builder: _Builder) -> None:
    rng, top = builder.rng, ROOM_MAX_M[2]
    for index, light in enumerate(LIGHTS):
        name = f"ceiling lamp {index}"
        builder.thing(
            name, "lamp", furniture.ceiling_lamp(rng(name)), _at(*light.position_world[:2], top, 90.0 * index)
        )
    for index, (x, y, length) in enumerate(((-0.68, -0.3, 0.76), (0.8, 1.0, 0.72), (-0.2, 2.1, 0.62))):
        name = f"pendant lamp {index}"
        builder.thing(name, "lamp", furniture.pendant_lamp(rng(name), length), _at(x, y, top))


def chair_obstacles() -> tuple[StaticBox, ...]:
    """What a rolling chair runs into: walls, desk legs, shelves and cabinets."""
    (x0, y0, _), (x1, y1, z1) = ROOM_MIN_M, ROOM_MAX_M
    mx, my, thick = (x0 + x1) / 2, (y0 + y1) / 2, 0.2
    boxes = [
        StaticBox(centre_m=(mx, y0 - thick / 2, z1 / 2), size_m=(x1 - x0, thick, z1)),
        StaticBox(centre_m=(mx, y1 + thick / 2, z1 / 2), size_m=(x1 - x0, thick, z1)),
        StaticBox(centre_m=(x0 - thick / 2, my, z1 / 2), size_m=(thick, y1 - y0, z1)),
        StaticBox(centre_m=(x1 + thick / 2, my, z1 / 2), size_m=(thick, y1 - y0, z1)),
        StaticBox(centre_m=(0.0, _LOW_SHELF_Y_M, _LOW_SHELF_M[2] / 2), size_m=_LOW_SHELF_M),
        StaticBox(centre_m=(-2.05, 2.52, 0.97), size_m=(1.15, 0.34, 1.95)),
        StaticBox(centre_m=(2.2, 2.52, 0.8), size_m=(1.25, 0.34, 1.6)),
        StaticBox(centre_m=(2.1, 1.35, 0.37), size_m=(0.46, 0.5, 0.74), yaw_rad=float(np.deg2rad(-28.0))),
        StaticBox(centre_m=(-2.25, 1.38, 0.2), size_m=(0.44, 0.44, 0.4)),
    ]
    for desk_x in (-_DESK_X_M, _DESK_X_M):
        for side in (-furniture.DESK_LEG_X_M, furniture.DESK_LEG_X_M):
            leg = (desk_x + side, _DESK_Y_M + 0.02, 0.35)
            boxes.append(StaticBox(centre_m=leg, size_m=(0.06, 0.62, 0.7)))
    return tuple(boxes)
