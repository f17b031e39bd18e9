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

from functools import lru_cache

from sim.rooms.builder import RoomBuilder, Shell, placed
from sim.rooms.room import Room
from sim.scene import Light, Surface
from sim.things import clutter, furniture, prints, textures

ROOM_MIN_M = (-3.5, -3.3, 0.0)
ROOM_MAX_M = (3.5, 2.7, 2.8)
CAMERA_PLACE = (0.0, -2.2, 1.4)
"""Where the camera is nominally; paths may leave it by 0.6 m to every side."""
CHAIR_PLACES = ((-1.0, 0.95), (1.0, 0.95))
"""Floor positions of chairs at the desks."""
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


@lru_cache(maxsize=2)
def build_office(seed: int) -> Room:
    """The room and everything in it that never moves; people and chairs are the caller's.

    The last two offices are kept, so that the scenes of one process share them.

    Args:
        seed: of every texture and every small difference.

    Returns:
        The room: its shell has the classes "floor", "ceiling" and "wall", its furniture COCO classes where there are
        any.
    """
    builder = RoomBuilder("office", seed)
    _build_shell(builder)
    _build_desks(builder)
    _build_desk_clutter(builder)
    _build_low_shelf(builder)
    _build_back_wall(builder)
    _build_sides(builder)
    _build_front_wall(builder)
    _build_lamps(builder)
    return builder.built(LIGHTS)


def _build_shell(builder: RoomBuilder) -> None:
    fine, coarse = (1024, 2048), (512, 1024)
    rng = builder.rng
    builder.shell(
        Shell(
            minimum_m=ROOM_MIN_M,
            maximum_m=ROOM_MAX_M,
            floor=(textures.carpet(rng("floor"), 2048),),
            ceiling=textures.ceiling(rng("ceiling"), 512),
            north=textures.plaster(rng("wall back"), fine),
            east=textures.plaster(rng("wall right"), fine, (204, 210, 206)),
            south=textures.plaster(rng("wall front"), coarse, (216, 208, 190)),
            west=textures.brick(rng("wall left"), fine, (ROOM_MAX_M[2] - ROOM_MIN_M[2], ROOM_MAX_M[1] - ROOM_MIN_M[1])),
        )
    )


def _build_desks(builder: RoomBuilder) -> None:
    for side, x in (("left", -_DESK_X_M), ("right", _DESK_X_M)):
        name = f"desk {side}"
        builder.desk(name, placed(x, _DESK_Y_M))
    for side, x, yaw in (("left", -0.72, 6.0), ("right", 0.5, -7.0)):
        name = f"monitor {side}"
        builder.put(name, "tv", furniture.monitor(builder.rng(name)), placed(x, 1.72, _DESK_TOP_M, yaw), blocks=True)


def _build_desk_clutter(builder: RoomBuilder) -> None:
    def put(name: str, class_name: str, surfaces: tuple[Surface, ...], x: float, y: float, yaw: float = 0.0) -> None:
        builder.put(name, class_name, surfaces, placed(x, y, _DESK_TOP_M, yaw))

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


def _build_low_shelf(builder: RoomBuilder) -> None:
    rng, top = builder.rng, _LOW_SHELF_M[2]
    builder.put(
        "low shelf", "shelf", furniture.shelf(rng("low shelf"), _LOW_SHELF_M, 1), placed(0, _LOW_SHELF_Y_M), blocks=True
    )
    for level, z in enumerate(furniture.shelf_levels(top, 1)):
        row = furniture.book_row(rng(f"low books {level}"), 0.9, 0.28, texture_size=512)
        builder.put(f"low books {level}", "book", row, placed(0, _LOW_SHELF_Y_M - 0.01, z))

    def put(name: str, class_name: str, surfaces: tuple[Surface, ...], x: float, dy: float, yaw: float = 0.0) -> None:
        builder.put(name, class_name, surfaces, placed(x, _LOW_SHELF_Y_M + dy, top, yaw))

    put("low sheet a", "paper", clutter.sheet(rng("low sheet a")), -0.12, 0.0, 80)
    put("low sheet b", "paper", clutter.sheet(rng("low sheet b"), height_m=0.002), 0.1, -0.01, 98)
    put("low cup", "cup", clutter.cup(rng("low cup")), -0.32, -0.04)
    put("low bottle", "bottle", clutter.bottle(rng("low bottle")), -0.42, 0.04, 200)
    put("low stack", "book", clutter.book_stack(rng("low stack"), 3), 0.38, 0.0, 84)
    put("low cup b", "cup", clutter.cup(rng("low cup b")), 0.16, 0.07)


def _build_back_wall(builder: RoomBuilder) -> None:
    rng, wall = builder.rng, ROOM_MAX_M[1]
    for side, x, size, boards in (("left", -2.05, (1.15, 0.34, 1.95), 4), ("right", 2.2, (1.25, 0.34, 1.6), 3)):
        y = wall - size[1] / 2 - 0.01
        builder.put(
            f"shelf {side}", "shelf", furniture.shelf(rng(f"shelf {side}"), size, boards), placed(x, y), blocks=True
        )
        levels = furniture.shelf_levels(size[2], boards)
        for level, z in enumerate(levels):
            name = f"books {side} {level}"
            row = furniture.book_row(rng(name), size[0] - 0.08, levels[1] - levels[0] - 0.03)
            builder.put(name, "book", row, placed(x, y - 0.03, z))
    builder.put("shelf plant", "potted plant", clutter.plant(rng("shelf plant"), 0.45), placed(1.85, wall - 0.26, 1.6))
    builder.put(
        "shelf carton", "box", clutter.carton(rng("shelf carton"), (0.42, 0.28, 0.26)), placed(2.4, wall - 0.19, 1.6, 7)
    )
    board = furniture.hung(prints.whiteboard(rng("whiteboard")), 1.5, 0.95, rng("whiteboard frame"), (150, 152, 156))
    builder.put("whiteboard", "whiteboard", board, placed(0.0, wall, 1.72))
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
        builder.hang(f"poster back {name}", (width, height), placed(x, wall, z))
    builder.put("clock", "clock", furniture.clock(rng("clock")), placed(1.0, wall, 2.36))


def _build_sides(builder: RoomBuilder) -> None:
    rng, left, right = builder.rng, ROOM_MIN_M[0], ROOM_MAX_M[0]
    builder.put("window", "window", furniture.window(rng("window"), 1.7, 1.2), placed(left, -0.2, 1.6, 90))
    builder.put(
        "radiator", "radiator", furniture.radiator(rng("radiator"), 1.5), placed(left + 0.1, -0.2, 0, 90), blocks=True
    )
    for name, y, z, width, height in (
        ("a", 1.35, 1.6, 0.6, 0.84),
        ("b", -1.75, 1.7, 0.7, 0.7),
        ("c", 2.25, 1.55, 0.5, 0.7),
    ):
        builder.hang(f"poster left {name}", (width, height), placed(left, y, z, 90))
    cork = furniture.hung(prints.cork_board(rng("cork board")), 1.5, 1.05, rng("cork frame"), (132, 92, 58))
    builder.put("cork board", "board", cork, placed(right, 0.35, 1.6, -90))
    for name, y, z, width, height in (
        ("a", 1.75, 1.7, 0.7, 0.9),
        ("b", -1.0, 1.65, 0.6, 0.84),
        ("c", -2.2, 1.6, 0.8, 0.6),
    ):
        builder.hang(f"poster right {name}", (width, height), placed(right, y, z, -90))
    builder.put("plant", "potted plant", clutter.plant(rng("plant"), 1.25), placed(-2.25, 1.38), blocks=True)
    builder.put("plant b", "potted plant", clutter.plant(rng("plant b"), 0.95), placed(3.0, -2.05), blocks=True)
    cabinet = furniture.cabinet(rng("cabinet"), (0.46, 0.5, 0.74), (150, 156, 160), 3)
    builder.put("cabinet", "cabinet", cabinet, placed(2.1, 1.35, 0, -28), blocks=True)
    builder.put(
        "printer",
        "printer",
        clutter.carton(rng("printer"), (0.38, 0.36, 0.24)),
        placed(2.1, 1.35, 0.74, -24),
        blocks=True,
    )
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
        builder.put(name, "box", clutter.carton(rng(name), size), placed(x, y, z, yaw), blocks=True)
    builder.put("bin", "bin", clutter.bin_with_paper(rng("bin")), placed(1.72, 1.9), blocks=True)
    tall = furniture.cabinet(rng("cabinet tall"), (0.8, 0.45, 1.35), (120, 132, 124), 4)
    builder.put("cabinet tall", "cabinet", tall, placed(right - 0.24, -1.15, 0, -90), blocks=True)


def _build_front_wall(builder: RoomBuilder) -> None:
    rng, wall = builder.rng, ROOM_MIN_M[1]
    builder.put("door", "door", furniture.door(rng("door")), placed(-1.9, wall, 0, 180))
    board = furniture.hung(prints.whiteboard(rng("board front"), 256), 1.3, 0.9, rng("board frame"), (150, 152, 156))
    builder.put("board front", "whiteboard", board, placed(1.6, wall, 1.5, 180))
    for name, x, z, width, height in (
        ("a", -0.55, 1.6, 0.6, 0.84),
        ("b", 0.35, 1.7, 0.5, 0.7),
        ("c", 2.85, 1.6, 0.6, 0.8),
        ("d", -0.15, 0.85, 0.5, 0.4),
        ("e", -3.0, 1.6, 0.5, 0.7),
        ("f", 0.4, 2.4, 0.6, 0.34),
    ):
        builder.hang(f"poster front {name}", (width, height), placed(x, wall, z, 180))


def _build_lamps(builder: RoomBuilder) -> None:
    rng, top = builder.rng, ROOM_MAX_M[2]
    for index, light in enumerate(LIGHTS):
        name = f"ceiling lamp {index}"
        builder.put(
            name, "lamp", furniture.ceiling_lamp(rng(name)), placed(*light.position_world[:2], top, 90.0 * index)
        )
    for index, (x, y, length) in enumerate(((-0.68, -0.3, 0.76), (0.8, 1.0, 0.72), (-0.2, 2.1, 0.62))):
        name = f"pendant lamp {index}"
        builder.put(name, "lamp", furniture.pendant_lamp(rng(name), length), placed(x, y, top))
