"""What several rooms have: shelves full of books, desks full of things, walls full of pictures."""

from sim.geometry import FloatArray
from sim.rooms import household
from sim.rooms.builder import RoomBuilder, placed
from sim.scene import Light
from sim.things import clutter, furniture

DESK_TOP_M = furniture.DESK_SIZE_M[2]

Place = tuple[float, float, float]
"""x, y in metres and the turn about z in degrees."""
Picture = tuple[float, float, float, float]
"""Where along a wall, how high its middle, its width and its height, in metres."""


def bookshelf(builder: RoomBuilder, name: str, size: tuple[float, float, float], boards: int, at: Place) -> None:
    """A shelf of `size` (width, depth, height) with books on every board."""
    T_world_shelf = placed(at[0], at[1], 0.0, at[2])
    builder.put(
        f"shelf {name}",
        "shelf",
        furniture.shelf(builder.rng(f"shelf {name}"), size, boards),
        T_world_shelf,
        blocks=True,
    )
    levels = furniture.shelf_levels(size[2], boards)
    for level, z in enumerate(levels):
        row_name = f"books {name} {level}"
        row = furniture.book_row(builder.rng(row_name), size[0] - 0.08, levels[1] - levels[0] - 0.03)
        builder.put(row_name, "book", row, T_world_shelf @ placed(0.0, -0.03, z))


def workplace(builder: RoomBuilder, name: str, at: Place) -> None:
    """A monitor, keyboard, mouse, cup and papers on a desk at `at`, for who sits at its front (-y)."""
    T_world_desk = placed(at[0], at[1], DESK_TOP_M, at[2])
    rng = builder.rng(f"workplace {name}")

    def put(kind: str, surfaces: household.Surfaces, x: float, y: float, turn: float, *, blocks: bool = False) -> None:
        dx, dy, extra = (float(v) for v in rng.uniform((-0.03, -0.02, -6.0), (0.03, 0.02, 6.0)))
        T_world_object = T_world_desk @ placed(x + dx, y + dy, 0.0, turn + extra)
        builder.put(f"{kind} {name}", kind, surfaces, T_world_object, blocks=blocks)

    put("tv", furniture.monitor(builder.rng(f"monitor {name}")), -0.1, 0.16, 0.0, blocks=True)
    put("keyboard", clutter.keyboard(builder.rng(f"keyboard {name}")), -0.1, -0.18, 0.0)
    put("mouse", clutter.mouse(builder.rng(f"mouse {name}")), 0.3, -0.18, 0.0)
    put("cup", clutter.cup(builder.rng(f"cup {name}")), 0.48, 0.02, 0.0)
    put("paper", clutter.sheet(builder.rng(f"sheet {name}")), -0.52, -0.2, 20.0)


def pictures(builder: RoomBuilder, wall: str, T_world_wall: FloatArray, which: tuple[Picture, ...]) -> None:
    """Posters and paintings on a wall whose frame has x along it, z up and -y into the room."""
    for index, (x, z, width, height) in enumerate(which):
        builder.hang(f"poster {wall} {index}", (width, height), T_world_wall @ placed(x, 0.0, z))


def ceiling_lamps(builder: RoomBuilder, lights: tuple[Light, ...], top_m: float, yaw_deg: float) -> None:
    """A flat lamp above every light."""
    for index, light in enumerate(lights):
        name = f"ceiling lamp {index}"
        x, y, _ = light.position_world
        builder.put(name, "lamp", furniture.ceiling_lamp(builder.rng(name)), placed(x, y, top_m, yaw_deg))
