"""The long office: 9 by 6.2 by 2.8 m with two desk islands, after fr3/long_office_household of TUM.

Two islands of two desks back to back stand around (-0.85, 0) and (0.85, 0), with a screen between them at x = 0: an
office to the left, a household's things to the right. An aisle of more than 1.2 m leads around them; chairs stand at
(+-0.85, +-1.15).
"""

from functools import lru_cache

from sim.rooms import household
from sim.rooms.builder import RoomBuilder, Shell, placed
from sim.rooms.furnishing import DESK_TOP_M, bookshelf, ceiling_lamps, pictures, workplace
from sim.rooms.room import Room
from sim.scene import Light
from sim.things import clutter, furniture, prints, textures

ROOM_MIN_M = (-4.5, -3.1, 0.0)
ROOM_MAX_M = (4.5, 3.1, 2.8)
LIGHTS = (
    Light(position_world=(-2.9, -1.0, 2.6), power=2.8),
    Light(position_world=(-0.4, 1.4, 2.6), power=2.8),
    Light(position_world=(0.7, -1.6, 2.6), power=2.8),
    Light(position_world=(2.9, 0.7, 2.6), power=2.8),
)


@lru_cache(maxsize=2)
def build_long_office(seed: int) -> Room:
    """The room and everything in it that never moves; people, chairs and what moves are the caller's."""
    builder = RoomBuilder("long office", seed)
    _build_shell(builder)
    _build_office_island(builder)
    _build_household_island(builder)
    _build_long_walls(builder)
    _build_short_walls(builder)
    ceiling_lamps(builder, LIGHTS, ROOM_MAX_M[2], 90.0)
    return builder.built(LIGHTS)


def _build_shell(builder: RoomBuilder) -> None:
    rng = builder.rng
    builder.shell(
        Shell(
            minimum_m=ROOM_MIN_M,
            maximum_m=ROOM_MAX_M,
            floor=(textures.carpet(rng("floor"), 2048, (92, 104, 112)),),
            ceiling=textures.ceiling(rng("ceiling"), 512),
            north=textures.plaster(rng("wall back"), (512, 1536)),
            east=textures.plaster(rng("wall right"), (512, 1024), (222, 206, 178)),
            south=textures.plaster(rng("wall front"), (512, 1536), (196, 206, 196)),
            west=textures.brick(rng("wall left"), (512, 1024), (2.8, 6.2)),
        )
    )


def _build_office_island(builder: RoomBuilder) -> None:
    rng = builder.rng
    builder.desk("desk a", placed(-0.85, -0.4))
    builder.desk("desk b", placed(-0.85, 0.4, 0.0, 180.0))
    workplace(builder, "a", (-0.85, -0.38, 0.0))
    workplace(builder, "b", (-0.8, 0.42, 180.0))
    screen = household.partition(rng("partition"), 1.6, 1.35)
    builder.put("partition", "screen", screen, placed(0.0, 0.0, 0.0, 90.0), blocks=True)

    def put(name: str, class_name: str, surfaces: household.Surfaces, x: float, y: float, yaw: float = 0.0) -> None:
        builder.put(name, class_name, surfaces, placed(x, y, DESK_TOP_M, yaw))

    put("desk lamp", "lamp", clutter.desk_lamp(rng("desk lamp")), -1.45, -0.1, -50)
    put("office books a", "book", clutter.book_stack(rng("office books a"), 6), -1.36, 0.3, 20)
    put("office books b", "book", clutter.book_stack(rng("office books b"), 3), -0.25, -0.56, 80)
    put("office bottle", "bottle", clutter.bottle(rng("office bottle")), -1.3, -0.05, 30)
    put("office carton", "box", clutter.carton(rng("office carton"), (0.26, 0.2, 0.17)), -0.3, 0.1, 15)
    put("office cup", "cup", clutter.cup(rng("office cup")), -0.42, 0.34)
    for index, (x, y, yaw) in enumerate(((-1.2, -0.6, 10), (-0.38, -0.22, -14), (-1.4, 0.62, 170), (-0.3, 0.6, 200))):
        page = clutter.sheet(rng(f"page {index}"), height_m=0.0035 + 0.001 * index)
        put(f"page {index}", "paper", page, x, y, yaw)


def _build_household_island(builder: RoomBuilder) -> None:
    rng = builder.rng
    builder.desk("desk c", placed(0.85, -0.4))
    builder.desk("desk d", placed(0.85, 0.4, 0.0, 180.0))

    def put(name: str, class_name: str, surfaces: household.Surfaces, x: float, y: float, yaw: float = 0.0) -> None:
        builder.put(name, class_name, surfaces, placed(x, y, DESK_TOP_M, yaw))

    for name, x, y, yaw in (("a", 0.45, -0.45, -10), ("b", 1.3, -0.2, 60), ("c", 0.85, 0.5, 165), ("d", 1.4, 0.6, 120)):
        put(f"teddy {name}", "teddy bear", household.teddy_bear(rng(f"teddy {name}")), x, y, yaw)
    put("globe", "globe", household.globe(rng("globe")), 0.4, 0.25, 40)
    put("ball a", "sports ball", household.ball(rng("ball a")), 0.9, -0.1)
    put("ball b", "sports ball", household.ball(rng("ball b"), 0.06), 1.15, 0.3)
    put("house plant", "potted plant", clutter.plant(rng("house plant"), 0.42), 1.38, 0.15)
    put("house plant b", "potted plant", clutter.plant(rng("house plant b"), 0.3), 0.28, -0.12)
    for name, x, y in (("a", 0.75, -0.6), ("b", 0.95, -0.52), ("c", 0.5, 0.62), ("d", 1.2, -0.62), ("e", 0.62, 0.18)):
        put(f"house cup {name}", "cup", clutter.cup(rng(f"house cup {name}")), x, y)
    for name, x, y in (("a", 0.7, -0.3), ("b", 1.05, 0.62), ("c", 1.48, -0.5), ("d", 0.2, 0.5), ("e", 1.0, 0.12)):
        put(f"house bottle {name}", "bottle", clutter.bottle(rng(f"house bottle {name}")), x, y, 50.0 * ord(name))
    for name, x, y, yaw, count in (("a", 1.42, -0.66, 80, 4), ("b", 0.22, -0.66, 5, 5), ("c", 0.28, 0.68, 190, 2)):
        put(f"house books {name}", "book", clutter.book_stack(rng(f"house books {name}"), count), x, y, yaw)
    put("house box", "box", clutter.carton(rng("house box"), (0.3, 0.2, 0.12)), 1.05, -0.36, 24)


def _build_long_walls(builder: RoomBuilder) -> None:
    rng, north, south = builder.rng, ROOM_MAX_M[1], ROOM_MIN_M[1]
    bookshelf(builder, "north a", (1.2, 0.32, 1.9), 4, (-3.2, north - 0.17, 0.0))
    bookshelf(builder, "north b", (1.3, 0.32, 1.2), 2, (2.2, north - 0.17, 0.0))
    bookshelf(builder, "south a", (1.25, 0.32, 1.6), 3, (-1.9, south + 0.17, 180.0))
    teddy = household.teddy_bear(rng("teddy shelf"))
    builder.put("teddy shelf", "teddy bear", teddy, placed(2.0, north - 0.2, 1.2, -12.0))
    builder.put("globe shelf", "globe", household.globe(rng("globe shelf")), placed(2.5, north - 0.18, 1.2, 80.0))
    board = furniture.hung(prints.whiteboard(rng("whiteboard")), 1.6, 1.0, rng("whiteboard frame"), (150, 152, 156))
    builder.put("whiteboard", "whiteboard", board, placed(-0.6, north, 1.6))
    builder.put("window", "window", furniture.window(rng("window"), 1.9, 1.2), placed(1.3, south, 1.65, 180.0))
    radiator = furniture.radiator(rng("radiator"), 1.6)
    builder.put("radiator", "radiator", radiator, placed(1.3, south + 0.1, 0.0, 180.0), blocks=True)
    builder.put("clock", "clock", furniture.clock(rng("clock")), placed(0.7, north, 2.35))
    pictures(
        builder,
        "north",
        placed(0.0, north),
        (
            (-2.1, 1.6, 0.6, 0.84),
            (1.0, 1.6, 0.6, 0.8),
            (3.4, 1.6, 0.7, 0.9),
            (4.1, 1.7, 0.5, 0.5),
            (-4.1, 1.5, 0.5, 0.7),
            (2.2, 2.1, 0.9, 0.5),
            (-1.7, 2.4, 0.5, 0.4),
        ),
    )
    pictures(
        builder,
        "south",
        placed(0.0, south, 0.0, 180.0),
        (
            (0.15, 1.6, 0.6, 0.84),
            (-2.8, 1.6, 0.6, 0.8),
            (-3.6, 1.7, 0.6, 0.5),
            (0.8, 1.5, 0.4, 0.6),
            (2.9, 1.6, 0.5, 0.7),
            (3.7, 1.6, 0.7, 0.9),
            (1.9, 2.1, 0.8, 0.5),
        ),
    )
    cabinet = furniture.cabinet(rng("cabinet"), (0.8, 0.42, 1.1), (120, 132, 124), 3)
    builder.put("cabinet", "cabinet", cabinet, placed(-0.1, south + 0.23, 0.0, 180.0), blocks=True)
    builder.put(
        "printer", "printer", clutter.carton(rng("printer"), (0.42, 0.34, 0.25)), placed(-0.1, south + 0.23, 1.1, 176.0)
    )
    low = furniture.cabinet(rng("cabinet low"), (0.9, 0.42, 0.75), (170, 156, 132), 2)
    builder.put("cabinet low", "cabinet", low, placed(0.9, north - 0.23, 0.0, 0.0), blocks=True)
    builder.put("low plant", "potted plant", clutter.plant(rng("low plant"), 0.4), placed(0.65, north - 0.24, 0.75))
    builder.put("low books", "book", clutter.book_stack(rng("low books"), 5), placed(1.1, north - 0.24, 0.75, 82.0))
    builder.put("bin", "bin", clutter.bin_with_paper(rng("bin")), placed(-2.25, north - 0.25), blocks=True)


def _build_short_walls(builder: RoomBuilder) -> None:
    rng, west, east = builder.rng, ROOM_MIN_M[0], ROOM_MAX_M[0]
    builder.put("door", "door", furniture.door(rng("door")), placed(east, -1.9, 0.0, -90.0))
    cork = furniture.hung(prints.cork_board(rng("cork board")), 1.5, 1.05, rng("cork frame"), (132, 92, 58))
    builder.put("cork board", "board", cork, placed(west, 0.3, 1.6, 90.0))
    bookshelf(builder, "east", (1.3, 0.32, 1.8), 3, (east - 0.17, 1.0, -90.0))
    pictures(
        builder,
        "east",
        placed(east, 0.0, 0.0, -90.0),
        (
            (0.2, 1.6, 0.6, 0.84),
            (0.95, 1.7, 0.5, 0.6),
            (-2.3, 1.6, 0.6, 0.84),
            (2.75, 1.6, 0.4, 0.6),
            (-0.4, 2.4, 0.5, 0.4),
        ),
    )
    pictures(
        builder,
        "west",
        placed(west, 0.0, 0.0, 90.0),
        (
            (-1.3, 1.6, 0.6, 0.84),
            (-2.3, 1.7, 0.7, 0.6),
            (1.7, 1.6, 0.6, 0.8),
            (2.5, 1.5, 0.5, 0.7),
            (0.2, 2.45, 0.6, 0.35),
        ),
    )
    tall = furniture.cabinet(rng("cabinet tall"), (0.8, 0.45, 1.5), (132, 120, 110), 4)
    builder.put("cabinet tall", "cabinet", tall, placed(west + 0.24, -2.2, 0.0, 90.0), blocks=True)
    builder.put("plant", "potted plant", clutter.plant(rng("plant"), 1.25), placed(-3.88, 2.48), blocks=True)
    builder.put("plant b", "potted plant", clutter.plant(rng("plant b"), 1.05), placed(3.95, 2.55), blocks=True)
    for index, (x, y, size, yaw) in enumerate(
        (
            (4.15, -0.9, (0.5, 0.4, 0.36), 80.0),
            (-4.15, -1.2, (0.5, 0.4, 0.42), 95.0),
            (3.9, -2.8, (0.45, 0.35, 0.3), 8.0),
        )
    ):
        carton = clutter.carton(rng(f"carton {index}"), size)
        builder.put(f"carton {index}", "box", carton, placed(x, y, 0.0, yaw), blocks=True)
