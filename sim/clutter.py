"""Small things that lie about in an office. Rest frame: the origin below the thing, z up, front towards -y."""

import numpy as np

from sim import prints, textures
from sim.geometry import FloatArray, rotation_z
from sim.meshes import Mesh, box, lathe, merged, panel, rounded_box, tube
from sim.scene import Surface

Surfaces = tuple[Surface, ...]


def cup(rng: np.random.Generator) -> Surfaces:
    """A mug with a print and a handle."""
    ground = (int(rng.integers(90, 240)), int(rng.integers(90, 240)), int(rng.integers(90, 240)))
    body = lathe(
        [(0, 0), (0.036, 0), (0.04, 0.006), (0.041, 0.095), (0.038, 0.097), (0.036, 0.094), (0.035, 0.012), (0, 0.01)],
        segments=20,
    )
    arc = np.linspace(-1.25, 1.25, 7)
    bow = np.stack([0.036 + 0.03 * np.cos(arc), np.zeros(7), 0.05 + 0.032 * np.sin(arc)], axis=1)
    handle = tube(bow @ rotation_z(float(rng.uniform(0, 2 * np.pi))).T, 0.0055, segments=6)
    return (body.surface(prints.label(rng, ground)), handle.surface(textures.plain(rng, ground, 16)))


def bottle(rng: np.random.Generator) -> Surfaces:
    """A bottle with a label and a cap."""
    ground = (int(rng.integers(20, 120)), int(rng.integers(60, 160)), int(rng.integers(40, 150)))
    height = float(rng.uniform(0.22, 0.29))
    profile = [
        (0, 0), (0.032, 0), (0.036, 0.005), (0.036, 0.6 * height), (0.033, 0.68 * height), (0.016, 0.82 * height),
        (0.0135, 0.86 * height), (0.0135, 0.93 * height),
    ]  # fmt: skip
    cap = lathe([(0.0135, 0.92), (0.0155, 0.92), (0.0155, 1.0), (0, 1.0)], segments=12)
    cap = cap.bent(lambda p: p * np.array([1, 1, height]))
    return (
        lathe(profile, segments=18).surface(prints.label(rng, ground)),
        cap.surface(textures.plain(rng, (190, 60, 50), 16)),
    )


def keyboard(rng: np.random.Generator) -> Surfaces:
    """A keyboard, 0.45 m wide."""
    case = rounded_box((0, 0, 0.011), (0.45, 0.15, 0.022), 0.008, segments=2)
    keys = panel((0, 0, 0.0225), (0.217, 0, 0), (0, 0.067, 0))
    return (
        case.surface(textures.plain(rng, (44, 44, 48), 32)),
        keys.surface(prints.keyboard(rng)),
    )


def mouse(rng: np.random.Generator) -> Surfaces:
    """A mouse on its pad."""
    body = rounded_box((0, 0, 0.019), (0.06, 0.1, 0.034), 0.016, segments=2)
    pad = box((0, 0, 0.0015), (0.22, 0.18, 0.003))
    return (body.surface(textures.plain(rng, (52, 52, 58), 16)), pad.surface(prints.picture(rng, 128)))


def sheet(rng: np.random.Generator, *, height_m: float = 0.0012) -> Surfaces:
    """A printed page of A4; `height_m` above its support keeps sheets that overlap apart."""
    page = panel((0, 0, height_m), (0.105, 0, 0), (0, 0.1485, 0))
    return (page.surface(prints.paper(rng)),)


def book_stack(rng: np.random.Generator, books: int) -> Surfaces:
    """Books and magazines on top of each other, the top one with its cover."""
    spines = prints.book_spines(rng, 256, books)
    step = (1 - prints.BOOK_PAGES) / books
    parts, z = [], 0.0
    for index in range(books):
        size = np.array([rng.uniform(0.17, 0.24), rng.uniform(0.24, 0.3), rng.uniform(0.014, 0.042)])
        turn = rotation_z(float(rng.uniform(-0.35, 0.35)))
        parts.append(_lying_book(size, index * step, step).moved([0, 0, z], turn))
        z += float(size[2])
    cover = panel((0, 0, z + 0.0008), size[0] / 2 * np.array([0.97, 0, 0]), size[1] / 2 * np.array([0, 0.97, 0]))
    return (merged(*parts).surface(spines), cover.moved(rotation=turn).surface(prints.poster(rng, 128)))


def _lying_book(size: FloatArray, u0: float, step: float) -> Mesh:
    """A lying book whose spine, towards -y, shows the texture's columns from `u0` to `u0 + step`, turned to lie."""
    spine = panel((0, -size[1] / 2, size[2] / 2), (size[0] / 2, 0, 0), (0, 0, size[2] / 2))
    # The title runs down a standing spine: it runs right on a lying one.
    u = u0 + step * (1 - spine.uv[:, 1])
    spine = Mesh(
        vertices=spine.vertices, normals=spine.normals, uv=np.stack([u, spine.uv[:, 0]], axis=1), faces=spine.faces
    )
    rest = box((0, 0.0005, size[2] / 2), size - np.array([0, 0.001, 0]))
    colour = (u0 + 0.1 * step, u0 + 0.9 * step)
    covers = Mesh(
        vertices=rest.vertices, normals=rest.normals, uv=rest.mapped(colour, (0.0, 0.03)).uv, faces=rest.faces
    )
    return merged(spine, covers)


def plant(rng: np.random.Generator, height_m: float) -> Surfaces:
    """A potted plant with broad bent leaves."""
    r = 0.16 * height_m + 0.02
    outline = ((0, 0), (0.72, 0), (1, 1.6), (1.06, 1.6), (1.06, 1.75), (0.92, 1.75), (0.9, 1.55), (0, 1.55))
    pot = lathe([(r * x, r * z) for x, z in outline], segments=18)
    leaves, stems = [], []
    for _ in range(26):
        azimuth, rise = float(rng.uniform(0, 2 * np.pi)), float(rng.uniform(0.35, 1.0))
        reach = float(rng.uniform(0.2, 0.4)) * height_m * (1.15 - 0.6 * rise)
        turn = rotation_z(azimuth)
        top = 1.5 * r + (height_m - 1.5 * r) * rise
        joint = np.array([0.35 * reach, 0.0, 0.85 * top])
        stems.append(tube([[0, 0, 1.4 * r], turn @ joint], 0.004, segments=5))
        leaves.append(_leaf(joint, reach, 0.1 * height_m * float(rng.uniform(0.7, 1.2)), top).moved(rotation=turn))
    return (
        pot.surface(textures.plain(rng, (186, 112, 82), 64, 0.09)),
        merged(*leaves).two_sided().surface(textures.leaf(rng)),
        merged(*stems).surface(textures.plain(rng, (84, 112, 56), 16)),
    )


def _leaf(start: FloatArray, reach: float, half_width: float, top: float) -> Mesh:
    """A leaf from `start` outwards along +x that rises to `top` and droops."""
    t = np.linspace(0.0, 1.0, 6)
    width = half_width * np.sin(np.pi * (0.08 + 0.9 * t)) ** 0.7
    x = start[0] + reach * t
    z = start[2] + (top - start[2]) * np.sin(np.pi * 0.72 * t) - 0.12 * reach * t**2
    side = np.array([-1.0, 0.0, 1.0])
    vertices = np.stack(
        [
            np.repeat(x, 3),
            (width[:, None] * side).ravel(),
            (z[:, None] + 0.25 * width[:, None] * np.abs(side)).ravel(),
        ],
        axis=1,
    )
    uv = np.stack([np.tile(0.5 + 0.5 * side, 6), np.repeat(1 - t, 3)], axis=1)
    a = (np.arange(5)[:, None] * 3 + np.arange(2)).ravel()
    faces = np.concatenate([np.stack([a, a + 3, a + 4], axis=1), np.stack([a, a + 4, a + 1], axis=1)])
    flat = Mesh(vertices=vertices, normals=np.zeros_like(vertices), uv=uv, faces=faces)
    return flat.bent(lambda p: p)


def desk_lamp(rng: np.random.Generator) -> Surfaces:
    """A lamp on a bent arm."""
    metal = merged(
        lathe([(0, 0), (0.085, 0), (0.08, 0.02), (0.02, 0.03), (0, 0.03)], segments=20),
        tube([[0, 0, 0.02], [0.0, 0.05, 0.3], [0.0, -0.16, 0.5]], 0.009, segments=8),
    )
    shade = lathe([(0.085, 0.0), (0.05, 0.09), (0.02, 0.11), (0, 0.11)], segments=18).two_sided()
    tilt = np.array([[1.0, 0.0, 0.0], [0.0, 0.9, -0.436], [0.0, 0.436, 0.9]])
    tilt[1:] /= np.sqrt(np.sum(tilt[1:] ** 2, axis=1, keepdims=True))
    colour = (int(rng.integers(120, 220)), int(rng.integers(40, 120)), int(rng.integers(30, 90)))
    return (
        metal.surface(textures.plain(rng, (70, 70, 76), 32)),
        shade.moved([0, -0.17, 0.43], tilt).surface(textures.plain(rng, colour, 32)),
    )


def carton(rng: np.random.Generator, size: tuple[float, float, float]) -> Surfaces:
    """A cardboard box with a print on its sides."""
    shell = box((0, 0, size[2] / 2), size)
    return (shell.surface(prints.label(rng, (178, 138, 92))),)


def bin_with_paper(rng: np.random.Generator) -> Surfaces:
    """A waste-paper basket."""
    basket = lathe([(0, 0), (0.11, 0), (0.14, 0.3), (0.148, 0.3), (0.145, 0.305), (0.13, 0.29), (0, 0.24)], segments=20)
    return (basket.surface(prints.label(rng, (70, 84, 96))),)
