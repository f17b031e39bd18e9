"""The big desk: a room of 7.2 by 7.2 by 3 m with one desk in the middle, after fr2/desk of the TUM benchmark.

The desk, 1.5 by 1.6 m (two desks back to back), stands around the origin, full of things. Chairs stand at y = -1.2 and
y = 1.2. A ring of 1.5 to 2.6 m around the desk is free, so that a camera can go around it.
"""

from functools import lru_cache

from sim.rooms import household
from sim.rooms.builder import RoomBuilder, Shell, placed
from sim.rooms.furnishing import DESK_TOP_M, bookshelf, ceiling_lamps, pictures, workplace
from sim.rooms.room import Room
from sim.scene import Light
from sim.things import clutter, furniture, prints, textures

ROOM_MIN_M = (-3.6, -3.6, 0.0)
ROOM_MAX_M = (3.6, 3.6, 3.0)
LIGHTS = (
    Light(position_world=(-1.5, -1.3, 2.8), power=3.3),
    Light(position_world=(1.7, -0.9, 2.8), power=3.3),
    Light(position_world=(0.1, 1.9, 2.8), power=3.3),
)


@lru_cache(maxsize=2)
def build_desk_room(seed: int) -> Room:
    """The room and everything in it that never moves; people, chairs and what moves are the caller's."""
    builder = RoomBuilder("desk", seed)
    _build_shell(builder)
    _build_desk(builder)
    _build_clutter(builder)
    _build_walls(builder)
    ceiling_lamps(builder, LIGHTS, ROOM_MAX_M[2], 20.0)
    return builder.built(LIGHTS)


def _build_shell(builder: RoomBuilder) -> None:
    rng, shape = builder.rng, (512, 1024)
    builder.shell(
        Shell(
            minimum_m=ROOM_MIN_M,
            maximum_m=ROOM_MAX_M,
            floor=tuple(textures.carpet(rng(f"floor {k}"), 1024, (118, 100, 86)) for k in range(2)),
            ceiling=textures.ceiling(rng("ceiling"), 512),
            north=textures.plaster(rng("wall back"), shape),
            east=textures.plaster(rng("wall right"), shape, (208, 206, 196)),
            south=textures.plaster(rng("wall front"), shape, (198, 208, 214)),
            west=textures.brick(rng("wall left"), shape, (3.0, 7.2)),
        )
    )


def _build_desk(builder: RoomBuilder) -> None:
    builder.desk("desk front", placed(0.0, -0.4))
    builder.desk("desk back", placed(0.0, 0.4, 0.0, 180.0))
    workplace(builder, "front", (-0.1, -0.38, 4.0))
    workplace(builder, "back", (0.2, 0.42, 176.0))


def _build_clutter(builder: RoomBuilder) -> None:
    rng = builder.rng

    def put(name: str, class_name: str, surfaces: household.Surfaces, x: float, y: float, yaw: float = 0.0) -> None:
        builder.put(name, class_name, surfaces, placed(x, y, DESK_TOP_M, yaw))

    put("teddy", "teddy bear", household.teddy_bear(rng("teddy")), 0.52, -0.2, 35)
    put("teddy small", "teddy bear", household.teddy_bear(rng("teddy small")), -0.6, 0.5, 200)
    put("globe", "globe", household.globe(rng("globe")), -0.58, -0.12, 60)
    put("ball", "sports ball", household.ball(rng("ball"), 0.075), 0.62, 0.62)
    put("desk lamp", "lamp", clutter.desk_lamp(rng("desk lamp")), 0.6, 0.12, -60)
    put("desk plant", "potted plant", clutter.plant(rng("desk plant"), 0.36), -0.56, 0.2)
    for name, x, y, yaw, count in (("a", 0.58, -0.58, 70, 5), ("b", -0.52, 0.68, 15, 3), ("c", -0.62, -0.4, -80, 4)):
        put(f"books {name}", "book", clutter.book_stack(rng(f"books {name}"), count), x, y, yaw)
    for name, x, y in (("a", 0.3, -0.56), ("b", -0.36, 0.62), ("c", 0.36, 0.3)):
        put(f"cup {name}", "cup", clutter.cup(rng(f"cup {name}")), x, y)
    for name, x, y in (("a", 0.38, -0.05), ("b", -0.38, 0.05), ("c", 0.66, 0.38)):
        put(f"bottle {name}", "bottle", clutter.bottle(rng(f"bottle {name}")), x, y, 70.0 * ord(name))
    for index, (x, y, yaw) in enumerate(
        ((-0.35, -0.64, 12), (0.05, 0.06, -8), (0.32, 0.66, 160), (-0.12, 0.68, 190), (0.4, -0.36, 100))
    ):
        page = clutter.sheet(rng(f"page {index}"), height_m=0.0035 + 0.001 * index)
        put(f"page {index}", "paper", page, x, y, yaw)


def _build_walls(builder: RoomBuilder) -> None:
    rng, (east, north, _) = builder.rng, ROOM_MAX_M
    west, south, _ = ROOM_MIN_M
    bookshelf(builder, "north", (1.2, 0.34, 1.9), 4, (-2.1, north - 0.18, 0.0))
    bookshelf(builder, "east", (1.4, 0.34, 1.5), 3, (east - 0.18, 1.4, -90.0))
    bookshelf(builder, "south", (1.1, 0.34, 1.75), 3, (2.3, south + 0.18, 180.0))
    board = furniture.hung(prints.whiteboard(rng("whiteboard")), 1.6, 1.0, rng("whiteboard frame"), (150, 152, 156))
    builder.put("whiteboard", "whiteboard", board, placed(0.2, north, 1.6))
    cork = furniture.hung(prints.cork_board(rng("cork board")), 1.5, 1.05, rng("cork frame"), (132, 92, 58))
    builder.put("cork board", "board", cork, placed(east, -1.2, 1.6, -90.0))
    builder.put("window", "window", furniture.window(rng("window"), 1.7, 1.2), placed(west, 0.6, 1.7, 90.0))
    radiator = furniture.radiator(rng("radiator"), 1.5)
    builder.put("radiator", "radiator", radiator, placed(west + 0.1, 0.6, 0.0, 90.0), blocks=True)
    builder.put("door", "door", furniture.door(rng("door")), placed(-1.6, south, 0.0, 180.0))
    pictures(
        builder,
        "north",
        placed(0.0, north),
        (
            (1.55, 1.7, 0.6, 0.84),
            (2.4, 1.5, 0.5, 0.6),
            (-1.15, 1.5, 0.5, 0.7),
            (2.9, 2.2, 0.5, 0.4),
            (0.1, 2.5, 0.7, 0.4),
            (1.7, 0.85, 0.5, 0.4),
        ),
    )
    pictures(
        builder,
        "east",
        placed(east, 0.0, 0.0, -90.0),
        ((0.2, 1.7, 0.5, 0.7), (2.6, 1.6, 0.7, 0.9), (-2.7, 1.7, 0.6, 0.5), (-1.4, 2.25, 0.7, 0.5)),
    )
    pictures(
        builder,
        "south",
        placed(0.0, south, 0.0, 180.0),
        (
            (-0.9, 1.6, 0.6, 0.84),
            (-0.1, 1.7, 0.5, 0.7),
            (0.65, 1.5, 0.6, 0.6),
            (2.75, 1.6, 0.7, 0.9),
            (-2.2, 2.35, 0.6, 0.5),
        ),
    )
    pictures(
        builder,
        "west",
        placed(west, 0.0, 0.0, 90.0),
        ((-2.4, 1.6, 0.8, 0.6), (-1.1, 1.6, 0.6, 0.84), (2.3, 1.7, 0.6, 0.84), (-1.7, 2.4, 0.4, 0.5)),
    )
    cabinet = furniture.cabinet(rng("cabinet"), (0.8, 0.45, 1.3), (120, 132, 124), 4)
    builder.put("cabinet", "cabinet", cabinet, placed(east - 0.24, -2.8, 0.0, -90.0), blocks=True)
    low = furniture.cabinet(rng("cabinet low"), (0.46, 0.5, 0.74), (168, 150, 128), 3)
    builder.put("cabinet low", "cabinet", low, placed(0.4, south + 0.27, 0.0, 180.0), blocks=True)
    teddy = household.teddy_bear(rng("teddy cabinet"))
    builder.put("teddy cabinet", "teddy bear", teddy, placed(0.4, south + 0.3, 0.74, 170.0))
    builder.put("plant", "potted plant", clutter.plant(rng("plant"), 1.3), placed(-3.0, -2.9), blocks=True)
    builder.put("plant b", "potted plant", clutter.plant(rng("plant b"), 1.0), placed(3.05, 3.05), blocks=True)
    builder.put("bin", "bin", clutter.bin_with_paper(rng("bin")), placed(-1.0, north - 0.3), blocks=True)
    for index, (x, y, size, yaw) in enumerate(
        (
            (-3.1, 2.6, (0.5, 0.4, 0.36), 24.0),
            (3.0, -0.1, (0.55, 0.4, 0.42), -75.0),
            (-0.7, south + 0.35, (0.4, 0.3, 0.3), 9.0),
        )
    ):
        carton = clutter.carton(rng(f"carton {index}"), size)
        builder.put(f"carton {index}", "box", carton, placed(x, y, 0.0, yaw), blocks=True)
    clock = furniture.clock(rng("clock"))
    builder.put("clock", "clock", clock, placed(1.0, south, 2.4, 180.0))
