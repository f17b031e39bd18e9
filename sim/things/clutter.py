"""Small things that lie about in an office. Rest frame: the origin below the thing, z up, front towards -y."""

import numpy as np

from sim.geometry import FloatArray, rotation_z
from sim.scene import Surface
from sim.things import boxes, prints, textures, vessels
from sim.things.meshes import Mesh, box, lathe, merged, panel, rounded_box, tube

Surfaces = tuple[Surface, ...]


def cup(rng: np.random.Generator) -> Surfaces:
    """A mug of some look."""
    return vessels.cup(rng, vessels.CUP_LOOKS[int(rng.integers(len(vessels.CUP_LOOKS)))])


def bottle(rng: np.random.Generator) -> Surfaces:
    """A bottle of some look."""
    return vessels.bottle(rng, vessels.BOTTLE_LOOKS[int(rng.integers(len(vessels.BOTTLE_LOOKS)))])


def keyboard(rng: np.random.Generator) -> Surfaces:
    """A keyboard, 0.45 m wide."""
    case = rounded_box((0, 0, 0.011), (0.45, 0.15, 0.022), 0.008, segments=2)
    keys = panel((0, 0, 0.0225), (0.217, 0, 0), (0, 0.067, 0))
    return (
        case.surface(textures.plain(rng, (44, 44, 48), 32)),
        keys.surface(prints.keyboard(rng)),
    )


def mouse(rng: np.random.Generator) -> Surfaces:
    """A mouse with two buttons and a wheel, on its pad."""
    grey = int(rng.integers(40, 70))
    hull = rounded_box((0, 0, 0), (0.06, 0.106, 0.034), 0.0165, segments=3, spans=4)

    def palm(p: FloatArray) -> FloatArray:
        x, y, z = p.T
        hump = 1 - 5.5 * np.clip(y - 0.012, 0, None) ** 1.2 - 90 * np.clip(-y - 0.005, 0, None) ** 2
        waist = 1 - 0.06 * np.exp(-((y / 0.025) ** 2))
        return np.stack([x * waist, y, np.where(z > 0, z * hump, z)], axis=1)

    body = hull.bent(palm).moved([0, 0, 0.02])
    split = box((0, -0.034, 0.0315), (0.0012, 0.034, 0.004))
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    wheel = lathe([(0, -0.0035), (0.008, -0.0035), (0.008, 0.0035), (0, 0.0035)], segments=14).moved(rotation=turn)
    pad = box((0, 0, 0.0015), (0.22, 0.18, 0.003))
    return (
        body.surface(textures.plain(rng, (grey, grey, grey + 4), 16)),
        merged(split, wheel.moved([0, -0.03, 0.0298])).surface(textures.plain(rng, (18, 18, 20), 16)),
        pad.surface(prints.picture(rng, 128)),
    )


def laptop(rng: np.random.Generator) -> Surfaces:
    """An open laptop, 0.33 m wide, that shows an editor or a picture."""
    shade = int(rng.integers(0, 2))
    metal = ((176, 178, 182), (62, 64, 70))[shade]
    width, depth, lean = 0.33, 0.23, float(rng.uniform(0.2, 0.4))
    c, s = np.cos(lean), np.sin(lean)
    back = np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])
    hinge = np.array([0.0, depth / 2 - 0.006, 0.014])
    lid = rounded_box((0, 0.004, 0.11), (width, 0.008, 0.22), 0.0035, segments=2).moved(hinge, back)
    bezel = panel((0, -0.0004, 0.11), (width / 2 - 0.004, 0, 0), (0, 0, 0.106)).moved(hinge, back)
    screen = panel((0, -0.0010, 0.112), (width / 2 - 0.012, 0, 0), (0, 0, 0.096)).mapped((0.006, 0.994), (0.006, 0.994))
    case = rounded_box((0, 0, 0.008), (width, depth, 0.016), 0.006, segments=2)
    keys = panel((0, 0.028, 0.0166), (0.142, 0, 0), (0, 0.052, 0))
    pad = panel((0, -0.07, 0.0166), (0.05, 0, 0), (0, 0.032, 0))
    return (
        merged(case, lid).surface(textures.plain(rng, metal, 32, 0.02)),
        bezel.surface(textures.plain(rng, (20, 20, 22), 16)),
        screen.moved(hinge, back).surface(prints.desktop(rng, 256) if rng.random() < 0.5 else prints.screen(rng, 256)),
        keys.surface(prints.keyboard(rng)),
        pad.surface(textures.plain(rng, (metal[0] - 22, metal[1] - 22, metal[2] - 22), 16)),
    )


def backpack(rng: np.random.Generator) -> Surfaces:
    """A backpack that stands, 0.44 m high: a front pocket, a handle, two straps behind."""
    colour = ((44, 62, 92), (62, 66, 70), (104, 48, 44), (62, 84, 58))[int(rng.integers(4))]
    dark = (colour[0] * 2 // 3, colour[1] * 2 // 3, colour[2] * 2 // 3)
    sack = rounded_box((0, 0, 0), (0.3, 0.17, 0.44), 0.07, segments=3, spans=4, texture_m=0.5)

    def filled(p: FloatArray) -> FloatArray:
        x, y, z = p.T
        slim = 1 - 0.16 * np.clip(z / 0.22, 0, 1) ** 2
        belly = 1 + 0.12 * (1 - (z / 0.22) ** 2) * (y < 0)
        return np.stack([x * slim, y * slim * belly, np.where(z < -0.17, -0.17 + 0.5 * (z + 0.17), z)], axis=1)

    bag = sack.bent(filled).moved([0, 0, 0.195])
    pocket = rounded_box((0, -0.095, 0.12), (0.23, 0.07, 0.18), 0.028, segments=3, texture_m=0.5)
    zips = merged(
        tube([[-0.1, -0.118, 0.208], [0.1, -0.118, 0.208]], 0.004, segments=6),
        tube(
            [[-0.115, -0.07, 0.3], [-0.08, -0.078, 0.355], [0.08, -0.078, 0.355], [0.115, -0.07, 0.3]],
            0.004,
            segments=6,
        ),
        tube([[-0.03, 0.05, 0.4], [-0.025, 0.05, 0.445], [0.025, 0.05, 0.445], [0.03, 0.05, 0.4]], 0.007, segments=8),
    )
    straps = [
        tube([[x, 0.06, 0.39], [1.2 * x, 0.125, 0.34], [1.4 * x, 0.13, 0.2], [1.5 * x, 0.085, 0.06]], 0.02, segments=8)
        for x in (-0.07, 0.07)
    ]
    flat = merged(*straps).bent(lambda p: np.stack([p[:, 0], p[:, 1] * 0.75 + 0.022, p[:, 2]], axis=1))
    return (
        merged(bag, pocket).surface(textures.cloth(rng, colour)),
        zips.surface(textures.plain(rng, (28, 28, 30), 16)),
        flat.surface(textures.cloth(rng, dark, 64)),
    )


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
    w, d, h = size / 2
    colour = (u0 + 0.1 * step, u0 + 0.9 * step)
    covers = merged(
        panel((0, 0, 2 * h), (w, 0, 0), (0, d, 0)),
        panel((0, 0, 0), (w, 0, 0), (0, -d, 0)),
    ).mapped(colour, (0.0, 0.03))
    thin = 0.003
    boards = merged(
        *(
            edge
            for z in (thin / 2, 2 * h - thin / 2)
            for edge in (
                panel((w, 0, z), (0, d, 0), (0, 0, thin / 2)),
                panel((-w, 0, z), (0, -d, 0), (0, 0, thin / 2)),
                panel((0, d, z), (-w, 0, 0), (0, 0, thin / 2)),
            )
        )
    ).mapped(colour, (0.0, 0.03))
    pages = merged(
        panel((w - thin, 0, h), (0, d - thin, 0), (0, 0, h - thin)),
        panel((thin - w, 0, h), (0, thin - d, 0), (0, 0, h - thin)),
        panel((0, d - thin, h), (thin - w, 0, 0), (0, 0, h - thin)),
    ).mapped((1 - 0.8 * prints.BOOK_PAGES, 1 - 0.2 * prints.BOOK_PAGES))
    return merged(spine, covers, boards, pages)


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
    """A closed cardboard box, taped or plain."""
    return boxes.carton(rng, size, "taped" if rng.random() < 0.7 else "plain")


def bin_with_paper(rng: np.random.Generator) -> Surfaces:
    """A waste-paper basket with crumpled sheets."""
    basket = lathe(
        [(0, 0), (0.11, 0), (0.14, 0.3), (0.148, 0.3), (0.145, 0.305), (0.134, 0.29), (0.12, 0.15)], segments=24
    )
    rings = [
        lathe([(r, z), (r + 0.003, z + 0.005), (r + 0.001, z + 0.01)], segments=24)
        for r, z in ((0.1205, 0.1), (0.1265, 0.16), (0.1325, 0.22))
    ]
    balls = []
    for _ in range(7):
        at = np.array([*rng.uniform(-0.07, 0.07, 2), float(rng.uniform(0.24, 0.28))])
        dents = rng.uniform(0.78, 1.12, 8)
        ball = rounded_box((0, 0, 0), (0.075, 0.075, 0.075), 0.03, segments=1, spans=2)

        def crumpled(p: FloatArray, dents: FloatArray = dents) -> FloatArray:
            corner = (p[:, 0] > 0).astype(int) + 2 * (p[:, 1] > 0) + 4 * (p[:, 2] > 0)
            return np.asarray(p * dents[corner][:, None])

        balls.append(ball.bent(crumpled).moved(at, rotation_z(float(rng.uniform(0, 6.28)))))
    grey = int(rng.integers(52, 84))
    return (
        merged(basket, *rings).surface(textures.plain(rng, (grey, grey + 2, grey + 6), 32, 0.04)),
        merged(*balls).surface(prints.paper(rng, 128)),
    )
