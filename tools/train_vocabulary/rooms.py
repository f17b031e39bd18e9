"""Random rooms: walls, furniture and clutter of the simulator in sizes, looks and places that no scenario has."""

from collections.abc import Callable, Sequence

import numpy as np

from sim.geometry import FloatArray, look_at
from sim.rooms import household
from sim.rooms.builder import RoomBuilder, Shell, placed
from sim.rooms.furnishing import bookshelf, ceiling_lamps, workplace
from sim.rooms.room import Room
from sim.scene import Light, Surface
from sim.things import clutter, furniture, prints, textures

Maker = Callable[[np.random.Generator], tuple[Surface, ...]]

SMALL: Sequence[tuple[str, Maker]] = (
    ("cup", clutter.cup),
    ("bottle", clutter.bottle),
    ("keyboard", clutter.keyboard),
    ("laptop", clutter.laptop),
    ("backpack", clutter.backpack),
    ("paper", clutter.sheet),
    ("book", lambda rng: clutter.book_stack(rng, int(rng.integers(2, 8)))),
    ("potted plant", lambda rng: clutter.plant(rng, float(rng.uniform(0.2, 0.6)))),
    ("lamp", clutter.desk_lamp),
    ("box", lambda rng: clutter.carton(rng, tuple(rng.uniform(0.12, 0.4, 3).tolist()))),
    ("teddy bear", household.teddy_bear),
    ("globe", household.globe),
    ("sports ball", household.ball),
)
"""What lies about on desks and on the floor."""

HEIGHT_M = 2.7


def random_room(number: int, seed: int) -> Room:
    """Room `number`: 4 to 9 m long and wide, with desks, shelves, pictures and things lying about."""
    builder = RoomBuilder(f"vocabulary {number}", seed)
    rng, half = builder.rng("plan"), _half_size(builder)
    builder.shell(_shell(builder, rng, half))
    for index in range(int(rng.integers(2, 6))):
        x, y = rng.uniform(-0.7, 0.7, 2) * half
        turn = float(rng.uniform(0, 360))
        builder.desk(f"desk {index}", placed(x, y, 0.0, turn))
        workplace(builder, f"{index}", (x, y, turn))
        for thing in range(int(rng.integers(3, 9))):
            dx, dy = rng.uniform((-0.7, -0.35), (0.7, 0.35))
            at = placed(x, y, furniture.DESK_SIZE_M[2], turn) @ placed(dx, dy, 0.0, float(rng.uniform(0, 360)))
            _put_small(builder, rng, f"thing {index} {thing}", at)
    for index in range(int(rng.integers(3, 9))):
        x, y = rng.uniform(-0.85, 0.85, 2) * half
        _put_small(builder, rng, f"floor {index}", placed(x, y, 0.0, float(rng.uniform(0, 360))))
    for wall in range(4):
        _furnish_wall(builder, rng, wall, half)
    lights = tuple(
        Light(position_world=(float(x), float(y), HEIGHT_M - 0.2), power=float(power))
        for x, y, power in rng.uniform((-0.7, -0.7, 2.0), (0.7, 0.7, 3.2), (4, 3)) * (*half, 1.0)
    )
    ceiling_lamps(builder, lights, HEIGHT_M, 0.0)
    return builder.built(lights)


def random_views(number: int, seed: int, count: int) -> list[FloatArray]:
    """`T_world_camera` (4, 4) of `count` cameras in room `number`, 0.7 to 1.8 m above the floor."""
    builder = RoomBuilder(f"vocabulary {number}", seed)
    rng, half, views = builder.rng("views"), _half_size(builder), []
    for _ in range(count):
        eye = np.array([*(rng.uniform(-0.8, 0.8, 2) * half), rng.uniform(0.7, 1.8)])
        angle = rng.uniform(0, 2 * np.pi)
        views.append(look_at(eye, eye + np.array([np.cos(angle), np.sin(angle), rng.uniform(-0.6, 0.15)])))
    return views


def _half_size(builder: RoomBuilder) -> FloatArray:
    """(2,) metres along x and y."""
    return builder.rng("size").uniform(2.0, 4.5, 2)


def _shell(builder: RoomBuilder, rng: np.random.Generator, half: FloatArray) -> Shell:
    walls = {side: _wall(builder.rng(side), rng.random() < 0.3, half) for side in ("north", "east", "south", "west")}
    carpet = textures.carpet(builder.rng("floor"), 1024, _colour(rng, 80, 150))
    wood = textures.wood(builder.rng("floor"), 1024)
    return Shell(
        minimum_m=(-half[0], -half[1], 0.0),
        maximum_m=(half[0], half[1], HEIGHT_M),
        floor=(carpet if rng.random() < 0.7 else wood,),
        ceiling=textures.ceiling(builder.rng("ceiling"), 512),
        **walls,
    )


def _wall(rng: np.random.Generator, is_brick: bool, half: FloatArray) -> textures.Image:
    if is_brick:
        return textures.brick(rng, (512, 1024), (HEIGHT_M, 2 * float(half.max())))
    return textures.plaster(rng, (512, 1024), _colour(rng, 180, 225))


def _furnish_wall(builder: RoomBuilder, rng: np.random.Generator, wall: int, half: FloatArray) -> None:
    """Something every 1.3 m along a wall: a shelf of books, a cupboard, a board, a window, pictures."""
    along, away = (half[0], half[1]) if wall % 2 == 0 else (half[1], half[0])
    T_world_wall = placed(0.0, 0.0, 0.0, -90.0 * wall) @ placed(0.0, float(away))
    for index, x in enumerate(np.arange(-along + 0.8, along - 0.7, 1.3)):
        name, choice = f"{wall} {index}", rng.random()
        spot = T_world_wall @ placed(float(x), 0.0)
        looks = builder.rng(f"wall {name}")
        if choice < 0.25:
            place = T_world_wall @ placed(float(x), -0.18)
            boards = int(rng.integers(2, 5))
            size = (float(rng.uniform(0.8, 1.2)), 0.32, 0.4 * boards)
            bookshelf(builder, name, size, boards, (place[0, 3], place[1, 3], -90.0 * wall))
        elif choice < 0.4:
            size = (float(rng.uniform(0.6, 1.1)), 0.42, float(rng.uniform(0.7, 1.3)))
            cabinet = furniture.cabinet(looks, size, _colour(rng, 90, 190), int(rng.integers(2, 5)))
            builder.put(f"cabinet {name}", "cabinet", cabinet, spot @ placed(0.0, -0.22))
        elif choice < 0.5:
            builder.put(f"window {name}", "window", furniture.window(looks, 1.1, 1.2), spot @ placed(0.0, 0.0, 1.6))
        elif choice < 0.6:
            print_of = prints.whiteboard if rng.random() < 0.5 else prints.cork_board
            board = furniture.hung(print_of(looks), 1.1, 0.8, looks, (150, 152, 156))
            builder.put(f"board {name}", "whiteboard", board, spot @ placed(0.0, 0.0, 1.5))
        elif choice < 0.65:
            builder.put(f"door {name}", "door", furniture.door(looks), spot)
        else:
            for picture in range(int(rng.integers(1, 4))):
                size_m = (float(rng.uniform(0.3, 0.6)), float(rng.uniform(0.3, 0.8)))
                dx, z = float(rng.uniform(-0.35, 0.35)), float(rng.uniform(0.9, 2.1))
                builder.hang(f"picture {name} {picture}", size_m, spot @ placed(dx, 0.0, z))


def _put_small(builder: RoomBuilder, rng: np.random.Generator, name: str, T_world_object: FloatArray) -> None:
    class_name, make = SMALL[int(rng.integers(len(SMALL)))]
    builder.put(name, class_name, make(builder.rng(name)), T_world_object)


def _colour(rng: np.random.Generator, low: int, high: int) -> textures.Colour:
    red, green, blue = (int(v) for v in rng.integers(low, high, 3))
    return red, green, blue
