"""Furniture of an office. Rest frame: the origin on the floor below the thing, z up, front towards -y.

Hanging things (pictures, boards, windows) have their origin in the middle of their back, against the wall.
"""

import numpy as np

from sim.geometry import FloatArray
from sim.scene import Surface
from sim.things import prints, textures
from sim.things.meshes import Mesh, box, lathe, merged, panel, rounded_box, tube
from sim.things.textures import Colour, Image

Surfaces = tuple[Surface, ...]

DESK_SIZE_M = (1.5, 0.8, 0.74)
"""Width, depth and height of a desk."""


DESK_LEG_X_M = DESK_SIZE_M[0] / 2 - 0.12
"""A desk's legs stand at this distance to both sides of its middle."""
PRINT = (0.006, 0.994)
"""Part of a print's texture that is shown: at its border the texture's repetition would shine through."""


def _boards(rng: np.random.Generator, *boards: tuple[tuple[float, float, float], tuple[float, float, float]]) -> Mesh:
    """Boxes (centre, size) of one wood, each from another place of its grain."""
    return merged(
        *(
            box(centre, size, texture_m=1.7, texture_offset=(float(rng.random()), float(rng.random())))
            for centre, size in boards
        )
    )


def desk(rng: np.random.Generator) -> Surfaces:
    """A desk with a wooden top on two steel legs."""
    width, depth, height = DESK_SIZE_M
    top = _boards(rng, ((0, 0, height - 0.015), (width, depth, 0.03)))
    legs = []
    for x in (-DESK_LEG_X_M, DESK_LEG_X_M):
        legs.append(box((x, 0.05, (height - 0.03 + 0.04) / 2), (0.05, 0.09, height - 0.07)))
        legs.append(rounded_box((x, 0.02, 0.02), (0.06, 0.62, 0.04), 0.012, segments=1))
        legs.append(box((x, 0, height - 0.045), (0.05, 0.66, 0.03)))
    legs.append(box((0, 0.1, 0.6), (2 * DESK_LEG_X_M - 0.04, 0.02, 0.16)))
    return (
        top.surface(textures.wood(rng)),
        merged(*legs).surface(textures.plain(rng, (128, 130, 134), 64, 0.05)),
    )


def monitor(rng: np.random.Generator) -> Surfaces:
    """A monitor with a picture 0.57 m wide: an editor, or a desktop with windows."""
    case = merged(
        rounded_box((0, 0.02, 0.33), (0.6, 0.034, 0.37), 0.008, segments=2),
        rounded_box((0, 0.05, 0.33), (0.3, 0.04, 0.2), 0.015, segments=1),
        rounded_box((0, 0.06, 0.16), (0.06, 0.03, 0.32), 0.01, segments=1),
        rounded_box((0, 0.04, 0.008), (0.24, 0.18, 0.016), 0.006, segments=1),
    )
    picture = panel((0, 0.0024, 0.335), (0.285, 0, 0), (0, 0, 0.168)).mapped(PRINT, PRINT)
    return (
        case.surface(textures.plain(rng, (40, 40, 44), 64, 0.04)),
        picture.surface(prints.screen(rng) if rng.random() < 0.6 else prints.desktop(rng)),
    )


def shelf(rng: np.random.Generator, size: tuple[float, float, float], boards: int) -> Surfaces:
    """An open shelf with a back of `size` (width, depth, height) and `boards` boards besides top and bottom."""
    width, depth, height = size
    t = 0.022
    parts = [((x, 0.0, height / 2), (t, depth, height)) for x in (-(width - t) / 2, (width - t) / 2)]
    for z in shelf_levels(height, boards):
        parts.append(((0.0, 0.0, z - t / 2), (width - 2 * t, depth - 0.01, t)))
    parts.append(((0.0, 0.0, height - t / 2), (width - 2 * t, depth - 0.01, t)))
    parts.append(((0.0, depth / 2 - 0.004, height / 2), (width - 2 * t, 0.006, height - 0.02)))
    return (_boards(rng, *parts).surface(textures.wood(rng, 256)),)


def shelf_levels(height_m: float, boards: int) -> tuple[float, ...]:
    """Heights of the upper sides of a shelf's boards, from the bottom one."""
    return tuple(0.08 + (height_m - 0.1) * k / (boards + 1) for k in range(boards + 1))


def book_row(rng: np.random.Generator, width_m: float, height_m: float, *, texture_size: int = 256) -> Surfaces:
    """Standing books, some leaning, with a gap here and there; `height_m` is the free height."""
    count = 22
    spines = prints.book_spines(rng, texture_size, count)
    step = (1 - prints.BOOK_PAGES) / count
    parts, x, index = [], -width_m / 2, 0
    while index < count:
        thick = float(rng.uniform(0.018, 0.05))
        if x + thick > width_m / 2:
            break
        size = np.array([thick, rng.uniform(0.14, 0.2), height_m * rng.uniform(0.66, 0.93)])
        parts.append(
            _standing_book(size, index * step, step).moved([x + thick / 2, float(rng.uniform(-0.012, 0.012)), 0])
        )
        x += thick + 0.001 + (float(rng.uniform(0.03, 0.12)) if rng.random() < 0.1 else 0.0)
        index += 1
    return (merged(*parts).surface(spines),)


def _standing_book(size: FloatArray, u0: float, step: float) -> Mesh:
    """A book whose spine, towards -y, shows the texture's columns from `u0` to `u0 + step`."""
    w, d, h = size / 2
    cover, pages = (u0 + 0.2 * step, u0 + 0.8 * step), (1 - 0.8 * prints.BOOK_PAGES, 1 - 0.2 * prints.BOOK_PAGES)
    return merged(
        panel((0, -d, h), (w, 0, 0), (0, 0, h)).mapped((u0, u0 + step)),
        panel((w, 0, h), (0, d, 0), (0, 0, h)).mapped(cover, (0.0, 0.04)),
        panel((-w, 0, h), (0, -d, 0), (0, 0, h)).mapped(cover, (0.0, 0.04)),
        panel((0, d, h), (-w, 0, 0), (0, 0, h)).mapped(pages),
        panel((0, 0, 2 * h), (w, 0, 0), (0, d, 0)).mapped(pages),
    )


def cabinet(rng: np.random.Generator, size: tuple[float, float, float], colour: Colour, drawers: int) -> Surfaces:
    """A steel cabinet with drawers, handles and a note on its front."""
    width, depth, height = size
    parts = [rounded_box((0, 0, height / 2), size, 0.008, segments=1)]
    pitch = (height - 0.06) / drawers
    handles = []
    for k in range(drawers):
        z = 0.04 + (k + 0.5) * pitch
        parts.append(rounded_box((0, -depth / 2 - 0.004, z), (width - 0.03, 0.02, pitch - 0.012), 0.006, segments=1))
        bow = np.array([[-0.06, 0.0, z], [-0.055, -0.025, z], [0.055, -0.025, z], [0.06, 0.0, z]])
        handles.append(tube(bow, 0.006, segments=6).moved([0, -depth / 2 - 0.014, 0]))
    u = float(rng.uniform(-0.1, 0.1)) * width
    note = panel((u, -depth / 2 - 0.0155, height * 0.72), (0.06, 0, 0), (0, 0, 0.08))
    return (
        merged(*parts).surface(textures.plain(rng, colour, 128, 0.05)),
        merged(*handles).surface(textures.plain(rng, (60, 60, 64), 16)),
        note.surface(prints.paper(rng, 128)),
    )


def hung(
    image: Image, width_m: float, height_m: float, rng: np.random.Generator, frame: Colour | None = None
) -> Surfaces:
    """A picture against a wall, with a frame of that colour around it or none."""
    w, h = width_m / 2, height_m / 2
    front = panel((0, -0.014, 0), (w, 0, 0), (0, 0, h)).mapped(PRINT, PRINT).surface(image)
    edge = box((0, -0.0065, 0), (width_m, 0.013, height_m)).surface(textures.plain(rng, (216, 214, 208), 16))
    if frame is None:
        return (front, edge)
    bars = merged(
        *(box((s * (w + 0.008), -0.012, 0), (0.032, 0.024, height_m + 0.048)) for s in (-1, 1)),
        *(box((0, -0.012, s * (h + 0.008)), (width_m - 0.016, 0.024, 0.032)) for s in (-1, 1)),
    )
    return (front, edge, bars.surface(textures.plain(rng, frame, 32, 0.05)))


def window(rng: np.random.Generator, width_m: float, height_m: float) -> Surfaces:
    """A window with a view, a cross bar and a sill."""
    frame = hung(prints.outdoors(rng), width_m, height_m, rng, (232, 232, 228))
    bars = merged(
        box((0.1 * width_m, -0.02, 0), (0.05, 0.022, height_m)),
        box((0, -0.07, -height_m / 2 - 0.035), (width_m + 0.16, 0.14, 0.03)),
    )
    return (*frame, bars.surface(textures.plain(rng, (226, 226, 222), 32)))


def door(rng: np.random.Generator) -> Surfaces:
    """A closed door, 0.95 by 2.05 m, with frame, handle and a notice; its origin is at its foot."""
    leaf = merged(
        box((0, -0.02, 1.02), (0.95, 0.04, 2.04), texture_m=2.2),
    )
    frame = merged(
        *(box((s * 0.51, -0.03, 1.05), (0.07, 0.06, 2.1)) for s in (-1, 1)), box((0, -0.03, 2.075), (0.95, 0.06, 0.07))
    )
    handle = tube([[0.39, -0.04, 1.03], [0.39, -0.085, 1.03], [0.27, -0.085, 1.03]], 0.01, segments=8)
    notice = panel((-0.05, -0.041, 1.5), (0.15, 0, 0), (0, 0, 0.21))
    return (
        leaf.surface(textures.wood(rng, 256, light=(206, 176, 132), dark=(164, 128, 88))),
        frame.surface(textures.plain(rng, (210, 208, 200), 32)),
        handle.surface(textures.plain(rng, (170, 172, 176), 16)),
        notice.surface(prints.poster(rng, 256)),
    )


def clock(rng: np.random.Generator) -> Surfaces:
    """A round wall clock."""
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # the axis points towards -y
    rim = lathe([(0.16, 0), (0.16, 0.03), (0.145, 0.035), (0.14, 0.02)], segments=28, crease_deg=60).moved(
        rotation=turn
    )
    angles = np.linspace(0, 2 * np.pi, 28, endpoint=False)
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    ring = np.stack([0.145 * circle[:, 0], np.full(28, -0.02), 0.145 * circle[:, 1]], axis=1)
    following = 1 + (np.arange(28) + 1) % 28
    face = Mesh(
        vertices=np.concatenate([[[0.0, -0.02, 0.0]], ring]),
        normals=np.tile([0.0, -1.0, 0.0], (29, 1)),
        uv=0.5 + 0.5 * np.concatenate([[[0.0, 0.0]], circle * [1, -1]]),
        faces=np.stack([np.zeros(28, np.int64), 1 + np.arange(28), following], axis=1),
    )
    return (rim.surface(textures.plain(rng, (60, 62, 68), 16)), face.surface(prints.clock_face(rng)))


def pendant_lamp(rng: np.random.Generator, length_m: float) -> Surfaces:
    """A lamp that hangs `length_m` down from its origin in the ceiling, with a printed shade."""
    z = -length_m
    shade = lathe([(0.21, z), (0.19, z + 0.12), (0.12, z + 0.22), (0.03, z + 0.26)], segments=28).two_sided()
    cord = tube(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, z + 0.25]]), 0.006, segments=6)
    bulb = lathe([(0, z + 0.03), (0.035, z + 0.05), (0.045, z + 0.09), (0.02, z + 0.16), (0, z + 0.17)], segments=12)
    return (
        shade.surface(prints.picture(rng, 256)),
        cord.surface(textures.plain(rng, (40, 40, 44), 16)),
        bulb.surface(textures.plain(rng, (255, 252, 238), 16, 0.0)),
    )


def ceiling_lamp(rng: np.random.Generator) -> Surfaces:
    """A flat lamp of 1.2 by 0.3 m against the ceiling; its origin is in the ceiling."""
    case = box((0, 0, -0.035), (1.24, 0.34, 0.07))
    glow = panel((0, 0, -0.0715), (0.59, 0, 0), (0, -0.14, 0))
    return (
        case.surface(textures.plain(rng, (176, 178, 182), 32)),
        glow.surface(textures.plain(rng, (255, 254, 246), 16, 0.0)),
    )


def radiator(rng: np.random.Generator, width_m: float) -> Surfaces:
    """A ribbed radiator, 0.6 m high."""
    ribs = [
        rounded_box((x, 0, 0.42), (0.045, 0.09, 0.58), 0.02, segments=1)
        for x in np.arange(-width_m / 2 + 0.03, width_m / 2 - 0.02, 0.06).tolist()
    ]
    return (merged(*ribs).surface(textures.plain(rng, (224, 224, 220), 64, 0.05)),)
