"""The corridor: 3.2 by 17 by 2.7 m, y from -1 to 16, where a robot drives among chairs and people.

Doors, boards and posters hang on the long walls; low things stand along them. The middle, |x| < 1.1, is free.
"""

from functools import lru_cache

from sim.rooms.builder import RoomBuilder, Shell, placed
from sim.rooms.furnishing import bookshelf, ceiling_lamps, pictures
from sim.rooms.room import Room
from sim.scene import Light
from sim.things import clutter, furniture, prints, textures

ROOM_MIN_M = (-1.6, -1.0, 0.0)
ROOM_MAX_M = (1.6, 16.0, 2.7)
LIGHTS = tuple(
    Light(position_world=(x, y, 2.5), power=3.0) for x, y in ((0.1, 1.2), (-0.1, 5.3), (0.1, 9.6), (-0.05, 13.9))
)


@lru_cache(maxsize=2)
def build_corridor(seed: int) -> Room:
    """The corridor and everything in it that never moves; people, chairs and what moves are the caller's."""
    builder = RoomBuilder("corridor", seed)
    _build_shell(builder)
    _build_east(builder)
    _build_west(builder)
    _build_ends(builder)
    ceiling_lamps(builder, LIGHTS, ROOM_MAX_M[2], 90.0)
    return builder.built(LIGHTS)


def _build_shell(builder: RoomBuilder) -> None:
    rng = builder.rng
    builder.shell(
        Shell(
            minimum_m=ROOM_MIN_M,
            maximum_m=ROOM_MAX_M,
            floor=tuple(textures.carpet(rng(f"floor {k}"), 1024, (124, 116, 104)) for k in range(5)),
            ceiling=textures.ceiling(rng("ceiling"), 512),
            north=textures.plaster(rng("wall back"), (512, 512), (206, 196, 170)),
            east=textures.plaster(rng("wall right"), (512, 3072)),
            south=textures.plaster(rng("wall front"), (512, 512), (206, 196, 170)),
            west=textures.plaster(rng("wall left"), (512, 3072), (198, 208, 206)),
        )
    )


def _build_east(builder: RoomBuilder) -> None:
    """The wall to the right of who looks along +y: its frame's x runs towards -y."""
    rng, east = builder.rng, ROOM_MAX_M[0]
    for name, y in (("a", 1.6), ("b", 6.2), ("c", 11.4)):
        builder.put(f"door {name}", "door", furniture.door(rng(f"door {name}")), placed(east, y, 0.0, -90.0))
    cork = furniture.hung(prints.cork_board(rng("cork board")), 1.6, 1.05, rng("cork frame"), (132, 92, 58))
    builder.put("cork board", "board", cork, placed(east, 4.0, 1.55, -90.0))
    board = furniture.hung(prints.whiteboard(rng("whiteboard")), 1.4, 0.9, rng("board frame"), (150, 152, 156))
    builder.put("whiteboard", "whiteboard", board, placed(east, 8.6, 1.55, -90.0))
    pictures(
        builder,
        "east",
        placed(east, 0.0, 0.0, -90.0),
        (
            (-0.3, 1.6, 0.6, 0.84), (0.5, 1.5, 0.5, 0.6), (-2.6, 1.6, 0.5, 0.7), (-5.3, 1.7, 0.5, 0.5),
            (-7.3, 1.6, 0.6, 0.84), (-10.0, 1.6, 0.7, 0.9), (-12.6, 1.5, 0.6, 0.7),
            (-13.6, 1.6, 0.5, 0.84), (-14.7, 1.6, 0.8, 0.6),
        ),
    )  # fmt: skip
    low = furniture.cabinet(rng("cabinet low"), (0.8, 0.4, 0.8), (120, 132, 124), 3)
    builder.put("cabinet low", "cabinet", low, placed(east - 0.21, 7.6, 0.0, -90.0), blocks=True)
    builder.put(
        "cabinet plant", "potted plant", clutter.plant(rng("cabinet plant"), 0.42), placed(east - 0.2, 7.75, 0.8)
    )
    builder.put("bin", "bin", clutter.bin_with_paper(rng("bin")), placed(east - 0.2, 2.4), blocks=True)
    bookshelf(builder, "east", (1.1, 0.3, 1.3), 2, (east - 0.16, 13.1, -90.0))
    carton = clutter.carton(rng("carton east"), (0.5, 0.36, 0.4))
    builder.put("carton east", "box", carton, placed(east - 0.24, 10.1, 0.0, -84.0), blocks=True)


def _build_west(builder: RoomBuilder) -> None:
    rng, west = builder.rng, ROOM_MIN_M[0]
    for name, y in (("a", 3.1), ("b", 13.0)):
        builder.put(
            f"window {name}", "window", furniture.window(rng(f"window {name}"), 1.7, 1.2), placed(west, y, 1.6, 90.0)
        )
        radiator = furniture.radiator(rng(f"radiator {name}"), 1.5)
        builder.put(f"radiator {name}", "radiator", radiator, placed(west + 0.1, y, 0.0, 90.0), blocks=True)
    for name, y in (("d", 5.5), ("e", 9.0)):
        builder.put(f"door {name}", "door", furniture.door(rng(f"door {name}")), placed(west, y, 0.0, 90.0))
    pictures(
        builder,
        "west",
        placed(west, 0.0, 0.0, 90.0),
        (
            (0.0, 1.6, 0.6, 0.84), (1.1, 1.5, 0.7, 0.6), (4.55, 1.6, 0.5, 0.7), (6.5, 1.6, 0.6, 0.84),
            (7.3, 1.6, 0.5, 0.6), (8.1, 1.7, 0.4, 0.6), (10.1, 1.6, 0.7, 0.9), (11.2, 1.5, 0.6, 0.6),
            (14.6, 1.6, 0.6, 0.84), (15.4, 1.7, 0.5, 0.5),
        ),
    )  # fmt: skip
    builder.put("plant", "potted plant", clutter.plant(rng("plant"), 0.9), placed(west + 0.47, 4.6), blocks=True)
    tall = furniture.cabinet(rng("cabinet tall"), (0.8, 0.42, 1.4), (140, 126, 110), 4)
    builder.put("cabinet tall", "cabinet", tall, placed(west + 0.22, 7.0, 0.0, 90.0), blocks=True)
    for index, (y, z, size, yaw) in enumerate(
        ((11.1, 0.0, (0.5, 0.36, 0.36), 85.0), (11.1, 0.36, (0.4, 0.3, 0.26), 96.0))
    ):
        carton = clutter.carton(rng(f"carton west {index}"), size)
        builder.put(f"carton west {index}", "box", carton, placed(west + 0.24, y, z, yaw), blocks=True)


def _build_ends(builder: RoomBuilder) -> None:
    rng, north, south = builder.rng, ROOM_MAX_M[1], ROOM_MIN_M[1]
    builder.put("door end", "door", furniture.door(rng("door end")), placed(-0.4, north, 0.0))
    clock = furniture.clock(rng("clock"))
    builder.put("clock", "clock", clock, placed(-0.4, north, 2.4))
    pictures(builder, "north", placed(0.0, north), ((0.7, 1.6, 0.6, 0.84), (-1.25, 1.6, 0.5, 0.7)))
    builder.put(
        "plant end", "potted plant", clutter.plant(rng("plant end"), 1.0), placed(1.05, north - 0.55), blocks=True
    )
    builder.put(
        "window south", "window", furniture.window(rng("window south"), 1.6, 1.2), placed(0.0, south, 1.6, 180.0)
    )
    radiator = furniture.radiator(rng("radiator south"), 1.4)
    builder.put("radiator south", "radiator", radiator, placed(0.0, south + 0.1, 0.0, 180.0), blocks=True)
