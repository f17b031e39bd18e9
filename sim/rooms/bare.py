"""The bare room: 6 by 5 by 2.7 m of painted walls and a plain floor, where a camera finds few corners to hold on to.

What there is: a door, a window, a radiator, one small picture, a carton. The middle is free.
"""

from functools import lru_cache

import numpy as np

from sim.rooms.builder import RoomBuilder, Shell, placed
from sim.rooms.furnishing import ceiling_lamps
from sim.rooms.room import Room
from sim.scene import Light
from sim.things import clutter, furniture, textures

ROOM_MIN_M = (-3.0, -2.5, 0.0)
ROOM_MAX_M = (3.0, 2.5, 2.7)
LIGHTS = (
    Light(position_world=(-1.3, 0.6, 2.5), power=2.6),
    Light(position_world=(1.5, -0.3, 2.5), power=2.6),
)


@lru_cache(maxsize=2)
def build_bare(seed: int) -> Room:
    """The room and the little in it that never moves; people, chairs and what moves are the caller's."""
    builder = RoomBuilder("bare", seed)
    rng = builder.rng
    builder.shell(
        Shell(
            minimum_m=ROOM_MIN_M,
            maximum_m=ROOM_MAX_M,
            floor=(textures.plain(rng("floor"), (132, 126, 118), 1024, 0.02),),
            ceiling=textures.plain(rng("ceiling"), (224, 224, 220), 256, 0.01),
            north=_painted(rng("wall back"), (206, 202, 190)),
            east=_painted(rng("wall right"), (198, 202, 200)),
            south=_painted(rng("wall front"), (206, 202, 190)),
            west=_painted(rng("wall left"), (198, 202, 200)),
        )
    )
    (west, south, _), (east, north, top) = ROOM_MIN_M, ROOM_MAX_M
    builder.put("door", "door", furniture.door(rng("door")), placed(-2.1, north, 0.0))
    builder.put("window", "window", furniture.window(rng("window"), 1.5, 1.1), placed(east, 0.4, 1.6, -90.0))
    radiator = furniture.radiator(rng("radiator"), 1.3)
    builder.put("radiator", "radiator", radiator, placed(east - 0.1, 0.4, 0.0, -90.0), blocks=True)
    builder.hang("picture", (0.4, 0.5), placed(0.9, north, 1.6))
    builder.put(
        "carton", "box", clutter.carton(rng("carton"), (0.45, 0.35, 0.4)), placed(2.4, 2.1, 0.0, -20.0), blocks=True
    )
    builder.hang("picture south", (0.5, 0.4), placed(0.4, south, 1.6, 180.0))
    builder.hang("picture west", (0.4, 0.5), placed(west, 0.5, 1.6, 90.0))
    ceiling_lamps(builder, LIGHTS, top, 0.0)
    return builder.built(LIGHTS)


def _painted(rng: np.random.Generator, colour: textures.Colour) -> textures.Image:
    """A painted wall of two squares: slightly uneven, without a mark."""
    return textures.tinted(colour, 1 + np.float32(0.012) * textures.noise(rng, (512, 1024), 4, octaves=3))
