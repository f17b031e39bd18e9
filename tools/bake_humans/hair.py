"""Hair: a thin cap on the scalp, and on it locks that grow along the head and fall."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from tools.bake_humans.body import BODY_VERTICES, Body
from tools.bake_humans.mesh import Array, Mesh, clip, compact, simplify, smooth, unit, vertex_normals
from tools.bake_humans.styles import HairCut, Style
from tools.bake_humans.texture import generator, noise

STRANDS = 8
"""Columns of the hair texture; each lock shows one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cut:
    """How a hair cut is built.

    Attributes:
        cap_faces: triangles of the cap.
        lift_m: of the cap over the skin, away from the hairline.
        lumps_m: how much the cap goes up and down.
        locks: how many grow from the scalp.
        steps: of each lock's path; a lock has 6 steps - 3 triangles.
        gravity: how fast a lock turns downwards.
    """

    cap_faces: int
    lift_m: float
    lumps_m: float
    locks: int
    steps: int
    gravity: float


CUTS: dict[HairCut, Cut] = {
    "short": Cut(cap_faces=600, lift_m=0.008, lumps_m=0.0, locks=400, steps=2, gravity=0.25),
    "cropped": Cut(cap_faces=1900, lift_m=0.009, lumps_m=0.0022, locks=230, steps=2, gravity=0.0),
    "long": Cut(cap_faces=500, lift_m=0.010, lumps_m=0.0, locks=138, steps=5, gravity=0.55),
    "ponytail": Cut(cap_faces=800, lift_m=0.006, lumps_m=0.0, locks=100, steps=4, gravity=0.0),
}
TAIL_LOCKS, TAIL_STEPS = 26, 7
FRINGE_LOCKS, TEMPLE_LOCKS, TEMPLE_STEPS = 16, 3, 4
"""Of a ponytail: the tail itself, the fringe, and on each side the thin locks that escaped it."""


def above_hairline(p: Array, body: Body, style: Style) -> Array:
    """Metres inside the hair, negative on the bare skin."""
    eye = body.eye()
    x, back, z = np.abs(p[:, 0]), p[:, 1] - eye[1], p[:, 2] - eye[2]
    # Height of the hairline over the eyes, from the forehead over the temple and behind the ear to the nape.
    line = np.interp(
        back,
        [-0.03, 0.02, 0.045, 0.058, 0.080, 0.092, 0.112, 0.125, 0.20],
        [0.064, 0.058, 0.036, -0.010, -0.018, 0.012, 0.006, -0.035, -0.075],
    )
    if style.is_combed_down:
        line = line + np.interp(back, [0.0, 0.06, 0.09], [-0.004, -0.004, 0.0])
    recede = 0.010 * np.exp(-(((x - 0.045) / 0.015) ** 2)) * (back < 0.06)
    return np.asarray(z - line - recede)


def make_hair(body: Body, style: Style) -> tuple[Mesh, Array, Array]:
    """The cap and the locks as one mesh; uv (n, 2), v runs from the root (0) to the tip (1); and normals (n, 3).

    The normals of the locks are drawn to those of the head below, so that light sees a head of hair, not leaves.
    """
    v, w = body.vertices[:BODY_VERTICES], body.weights[:BODY_VERTICES]
    is_head = body.share(w, "Neck", "Head") > 0.9
    head = compact(Mesh(v, body.faces["body"][is_head[body.faces["body"]].all(1)], w))
    surface = smooth(head.vertices, head.faces, 2)
    ears_gone = smooth(head.vertices, head.faces, 25)  # the cap and the locks must not follow the ears' folds
    normals = vertex_normals(ears_gone, head.faces)

    scalp = clip(
        Mesh(surface, head.faces, np.c_[head.weights, normals]),
        lambda p, _: above_hairline(p, body, style) + 0.004 * noise(p, 40, style.seed, "cap edge", octaves=2) - 0.002,
    )
    cut = CUTS[style.hair_cut]
    depth = np.clip(above_hairline(scalp.vertices, body, style) / 0.03, 0, 1)
    lumps = cut.lumps_m * noise(scalp.vertices, 32, style.seed, "lumps", octaves=2)
    lift = 0.0015 + (cut.lift_m + lumps) * depth
    cap = Mesh(scalp.vertices + scalp.weights[:, -3:] * lift[:, None], scalp.faces, scalp.weights[:, :-3])
    cap = simplify(cap, cut.cap_faces)[0]
    cap_uv = np.stack([cap.vertices[:, 0] * 9, 0.25 + 0.0 * cap.vertices[:, 1]], 1)
    cap_uv[:, 0] += cap.vertices[:, 1] * 5
    locks, lock_uv, lock_ups = _Growth(body, style, scalp, lift).mesh()
    mesh = Mesh(
        np.concatenate([cap.vertices, locks.vertices]),
        np.concatenate([cap.faces, locks.faces + len(cap.vertices)]),
        np.concatenate([cap.weights, locks.weights]),
    )
    lock_normals = unit(vertex_normals(locks.vertices, locks.faces) * 0.45 + lock_ups)
    cap_normals = vertex_normals(cap.vertices, cap.faces)
    return mesh, np.concatenate([cap_uv, lock_uv]), np.concatenate([cap_normals, lock_normals])


def paint_hair(style: Style, size: int) -> Array:
    """(size, size, 3) strands: columns of slightly different tone, darker at the root."""
    rng = generator(style.seed, "strands")
    if style.hair_cut == "cropped":  # curls, the same in all directions
        curls = sum(gaussian_filter(rng.normal(size=(size, size)), s, mode="wrap") * 2 * s for s in (1.0, 2.5))
        return np.clip(np.array(style.hair, float) * (1.1 + 0.34 * curls)[..., None], 0, 255).astype(np.uint8)
    column = np.arange(size) * STRANDS // size
    tone = rng.uniform(0.86, 1.14, STRANDS)[column]
    fine = np.repeat(rng.normal(size=size // 2), 2)
    coarse = np.convolve(np.tile(rng.normal(size=size), 3), np.ones(9) / 9, "same")[size : 2 * size] * 3
    along = np.linspace(0, 1, size)[:, None]
    wave = rng.normal(size=(size, size))
    wave = np.stack([np.convolve(np.tile(c, 3), np.ones(25) / 5, "same")[size : 2 * size] for c in wave.T], 1)
    shade = tone * (1 + 0.13 * fine + 0.14 * coarse) * (0.72 + 0.42 * along) * (1 + 0.07 * wave)
    # A soft sheen a third down the lock.
    shade = shade * (1 + 0.22 * np.exp(-(((along - 0.38) / 0.16) ** 2)))
    return np.clip(np.array(style.hair, float) * shade[..., None], 0, 255).astype(np.uint8)


class _Growth:
    """The locks of one head."""

    def __init__(self, body: Body, style: Style, scalp: Mesh, lift: Array) -> None:
        self.body, self.style, self.cut = body, style, CUTS[style.hair_cut]
        self.rng = generator(style.seed, "locks")
        inside = np.flatnonzero(above_hairline(scalp.vertices, body, style) > 0.002)
        chosen = inside[_spread(scalp.vertices[inside], self.cut.locks, self.rng)]
        self.normals = scalp.weights[chosen, -3:]
        self.roots = scalp.vertices[chosen] + self.normals * lift[chosen, None]
        self.centre = scalp.vertices.mean(0)
        self.obstacles, self.outward = _obstacles(body)
        self.tree = cKDTree(self.obstacles)
        back = scalp.vertices[np.abs(scalp.vertices[:, 2] - body.eye()[2] - 0.035) < 0.02]
        self.tie = back[back[:, 1].argmax()] * [0, 1, 1] + [0, 0.016, 0]
        """Where a ponytail is bound."""
        self.vertices: list[Array] = []
        self.faces: list[Array] = []
        self.uvs: list[Array] = []
        self.away: list[Array] = []

    def mesh(self) -> tuple[Mesh, Array, Array]:
        """All locks; uv (n, 2); and the direction away from the head at each vertex (n, 3)."""
        for root, normal in zip(self.roots, self.normals, strict=True):
            if self.style.hair_cut == "ponytail":
                self._comb_to_tie(root, normal)
            else:
                self._fall(root, normal)
        if self.style.hair_cut == "ponytail":
            self._bind_tail()
        starts = np.cumsum([0] + [len(v) for v in self.vertices])
        weights = np.zeros((starts[-1], len(self.body.names)))
        weights[:, self.body.names.index("Head")] = 1
        faces = np.concatenate([f + start for f, start in zip(self.faces, starts[:-1], strict=True)])
        return (
            Mesh(np.concatenate(self.vertices), faces, weights),
            np.concatenate(self.uvs),
            unit(np.concatenate(self.away)),
        )

    def _fall(self, root: Array, normal: Array) -> None:
        """A lock that starts along the head and is drawn down."""
        direction, length, width, margin = self._start(root, normal)
        hangs = self.style.hair_cut == "long"
        level_z = self.body.eye()[2] - 0.02
        path, ups = [root - 0.004 * normal], [normal]
        position, steps = root.copy(), self.cut.steps
        for k in range(1, steps + 1):
            fall = self.cut.gravity * min(1.0, k / 2)
            direction = unit((direction + fall * np.array([0.0, 0.0, -1.0]))[None])[0]
            position = position + direction * length / steps
            up, height, near = self._over_skin(position)
            want = margin * (1 if hangs else 0.7 + 0.5 * np.sin(np.pi * k / steps))
            if near and height < want:
                position = position + up * (want - height)
            elif hangs and position[2] > level_z:  # lies on the head down to the cheek, then hangs
                position = position - up * 0.8 * (height - want)
            direction = unit((position - path[-1])[None])[0]
            path.append(position.copy())
            ups.append(up if near else ups[-1])
        self._add(path, ups, width)

    def _comb_to_tie(self, root: Array, normal: Array) -> None:
        """A lock that follows the head to where the ponytail is bound."""
        width, margin = self.rng.uniform(0.020, 0.030), self.rng.uniform(0.007, 0.012)
        path, ups = [root - 0.003 * normal], [normal]
        for k in range(1, self.cut.steps + 1):
            share = min(1.0, 1.15 * k / self.cut.steps)
            position = root * (1 - share) + self.tie * share
            up, height, _ = self._over_skin(position)
            path.append(position + up * (max(height, margin * (0.4 + 0.6 * share)) - height))
            ups.append(up)
        self._add(path, ups, width)

    def _bind_tail(self) -> None:
        """The tail, and a few thin locks in front of the ears."""
        down = np.array([0.0, 0.0, -1.0])
        for _ in range(TAIL_LOCKS):
            spread = self.rng.normal(size=3)
            direction = unit((np.array([0.0, 0.75, 0.05]) + 0.13 * spread)[None])[0]
            position = self.tie + 0.007 * self.rng.normal(size=3) - [0, 0.012, 0]
            path, ups = [position], [np.array([0.0, 0.6, 0.8])]
            length = self.rng.uniform(0.20, 0.29)
            for _ in range(TAIL_STEPS):
                direction = unit((direction + 0.75 * down)[None])[0]
                position = position + direction * length / TAIL_STEPS
                up, height, near = self._over_skin(position)
                if near and height < 0.018:
                    position = position + up * (0.018 - height)
                path.append(position)
                ups.append(unit((np.array([0.0, 0.8, 0.3]) + 0.5 * spread * [1, 0, 0])[None])[0])
            self._add(path, ups, self.rng.uniform(0.016, 0.026))
        eye = self.body.eye()
        front = self.roots[np.argsort(self.roots[:, 1] - 0.5 * self.roots[:, 2], kind="stable")[:FRINGE_LOCKS]]
        for root in front:  # the fringe is swept to the left
            position, path, ups = root + np.array([0, 0.012, 0.004]), [], []
            for k in range(TEMPLE_STEPS + 1):
                up, height, _ = self._over_skin(position)
                position = position + up * (0.009 - height)
                path.append(position)
                ups.append(up)
                position = position + np.array([0.013, -0.004 + 0.001 * k, -0.011]) * self.rng.uniform(0.9, 1.1)
            self._add(path, ups, self.rng.uniform(0.016, 0.024))
        for side in (-1.0, 1.0):
            for number in range(TEMPLE_LOCKS):
                position = np.array([side * 0.066, eye[1] + 0.040 + 0.008 * number, eye[2] + 0.020])
                length = self.rng.uniform(0.06, 0.11)
                path, ups = [], []
                for _ in range(TEMPLE_STEPS + 1):
                    up, height, _ = self._over_skin(position)
                    position = position + up * (0.006 - height)
                    path.append(position)
                    ups.append(up)
                    position = position + down * length / TEMPLE_STEPS + [side * 0.002, 0.002, 0]
                self._add(path, ups, self.rng.uniform(0.005, 0.010))

    def _start(self, root: Array, normal: Array) -> tuple[Array, float, float, float]:
        """First direction, length, width and height over the skin of a falling lock."""
        eye, rng = self.body.eye(), self.rng
        jitter = rng.normal(size=3)
        if self.style.hair_cut == "long":
            side = np.sign(root[0] - 0.018) or 1.0  # parted a little to the left
            front = np.clip((eye[1] + 0.11 - root[1]) / 0.07, 0, 1)
            flow = np.array([side * (0.25 + 0.75 * front), 0.15 + 0.75 * front, -0.5]) + 0.10 * jitter
            to_shoulder = root[2] - (self.body.head("Neck")[2] + 0.035)
            length = 1.12 * to_shoulder + 0.02 * rng.uniform() + 0.25 * abs(root[0] - self.centre[0])
            width, margin, rise = rng.uniform(0.028, 0.044), rng.uniform(0.008, 0.018), 0.0
        elif self.style.hair_cut == "cropped":
            flow, rise = 0.8 * jitter, 0.6
            length, width, margin = rng.uniform(0.010, 0.017), rng.uniform(0.010, 0.015), 0.006
        else:
            top = np.clip((root[2] - eye[2] - 0.05) / 0.05, 0, 1)
            # Combed to the side and back on top, downwards at the sides and the back.
            flow = np.array([-0.55 * top, 0.25 + 0.35 * top, -0.9 * (1 - top) + 0.15 * top]) + 0.20 * jitter
            length = (0.024 + 0.026 * top) * rng.uniform(0.8, 1.2)
            width, margin, rise = rng.uniform(0.013, 0.021), 0.005 + 0.009 * top * rng.uniform(0.6, 1.3), 0.10
        flow = flow - normal * (flow @ normal) + rise * normal
        return unit(flow[None])[0], float(length), float(width), float(margin)

    def _over_skin(self, position: Array) -> tuple[Array, float, bool]:
        """Direction away from the head, height over it, and whether it is near at all."""
        distance, near = self.tree.query(position, k=4)
        up = unit(self.outward[near].mean(0)[None])[0]
        return up, float(((position - self.obstacles[near]) @ up).mean()), bool(distance.min() < 0.06)

    def _add(self, path: list[Array], ups: list[Array], width: float) -> None:
        lock, faces, uv = _lock(np.array(path), np.array(ups), width, len(self.vertices) % STRANDS)
        self.vertices.append(lock)
        self.faces.append(faces)
        self.uvs.append(uv)
        self.away.append(np.concatenate([np.tile(np.array(ups)[:-1], (3, 1)), ups[-1][None]]))


def _lock(path: Array, ups: Array, width: float, column: int) -> tuple[Array, Array, Array]:
    """A closed blade of triangular section along `path` (k, 3), its ridge towards `ups`, ending in a point."""
    n = len(path)
    t = np.linspace(0, 1, n)
    tangent = unit(np.gradient(path, axis=0))
    across = unit(np.cross(tangent, ups))
    for k in range(1, n):  # a lock that stands up must not turn over
        across[k] *= np.sign(across[k] @ across[k - 1]) or 1.0
    over = np.cross(across, tangent)
    half = (0.5 * width * np.clip(np.minimum(0.55 + 2.0 * t, 1.9 * (1 - t) ** 0.6 + 0.0), 0, 1))[:-1, None]
    core = path[:-1]
    left, right = core - across[:-1] * half, core + across[:-1] * half
    ridge = core + over[:-1] * half * 0.40
    vertices = np.concatenate([left, ridge, right, path[-1:]])
    m = n - 1
    i = np.arange(m - 1)
    faces = []
    for a, b in ((0, m), (m, 2 * m), (2 * m, 0)):
        faces += [np.c_[a + i, b + i, b + i + 1], np.c_[a + i, b + i + 1, a + i + 1]]
        faces.append(np.array([[a + m - 1, b + m - 1, 3 * m]]))
    u = (column + np.array([0.12, 0.5, 0.88])) / STRANDS
    uv = np.concatenate([np.c_[np.full(m, u[k]), 0.98 * t[:-1]] for k in range(3)] + [[[u[1], 0.98]]])
    return vertices, np.concatenate(faces), uv


def _obstacles(body: Body) -> tuple[Array, Array]:
    """Points and normals of head, neck and shoulders (without the folds of the ears): hair stays outside."""
    v = body.vertices[:BODY_VERTICES]
    near = v[:, 2] > body.head("Neck")[2] - 0.14
    mesh = compact(Mesh(v, body.faces["body"][near[body.faces["body"]].all(1)], body.weights[:BODY_VERTICES]))
    vertices = smooth(mesh.vertices, mesh.faces, 3)
    return vertices, unit(smooth(vertex_normals(vertices, mesh.faces), mesh.faces, 12))


def _spread(points: Array, count: int, rng: np.random.Generator) -> Array:
    """Indices of `count` points, each as far as possible from those before it."""
    chosen = [int(rng.integers(len(points)))]
    distance = np.linalg.norm(points - points[chosen[0]], axis=1)
    while len(chosen) < min(count, len(points)):
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return np.array(chosen)
