"""Hair: a thin cap on the scalp, and on it locks that grow along the head and fall."""

import numpy as np
from scipy.spatial import cKDTree

from tools.bake_humans.body import BODY_VERTICES, Body
from tools.bake_humans.mesh import Array, Mesh, clip, compact, simplify, smooth, unit, vertex_normals
from tools.bake_humans.styles import Style
from tools.bake_humans.texture import generator, noise

CAP_FACES = 900
STRANDS = 8
"""Columns of the hair texture; each lock shows one."""


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
    if style.has_long_hair:
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
    depth = np.clip(above_hairline(scalp.vertices, body, style) / 0.03, 0, 1)
    lift = 0.0015 + (0.010 if style.has_long_hair else 0.008) * depth
    cap = Mesh(scalp.vertices + scalp.weights[:, -3:] * lift[:, None], scalp.faces, scalp.weights[:, :-3])
    cap = simplify(cap, CAP_FACES)[0]
    cap_uv = np.stack([cap.vertices[:, 0] * 9, 0.25 + 0.0 * cap.vertices[:, 1]], 1)
    cap_uv[:, 0] += cap.vertices[:, 1] * 5
    locks, lock_uv, lock_ups = _grow(body, style, scalp, lift)
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


def _grow(body: Body, style: Style, scalp: Mesh, lift: Array) -> tuple[Mesh, Array, Array]:
    """Locks from roots spread evenly over the scalp: mesh, uv and the direction away from the head at each vertex."""
    rng = generator(style.seed, "locks")
    count, steps = (170, 8) if style.has_long_hair else (300, 3)
    inside = np.flatnonzero(above_hairline(scalp.vertices, body, style) > 0.002)
    roots = _spread(scalp.vertices[inside], count, rng)
    chosen = inside[roots]
    points, normals = scalp.vertices + scalp.weights[:, -3:] * lift[:, None], scalp.weights[:, -3:]
    obstacles, outward = _obstacles(body)
    tree = cKDTree(obstacles)
    level_z = body.eye()[2] - 0.02
    head_centre = scalp.vertices.mean(0)
    vertices, faces, uvs, away = [], [], [], []
    total = 0
    for number, i in enumerate(chosen):
        root, normal = points[i], unit(normals[i : i + 1])[0]
        direction, length, width, margin = _start(root, normal, head_centre, body, style, rng)
        path, ups = [root - 0.004 * normal], [normal]
        position, step = root.copy(), length / steps
        for k in range(1, steps + 1):
            gravity = (0.55 if style.has_long_hair else 0.25) * min(1.0, k / 2)
            direction = unit((direction + gravity * np.array([0.0, 0.0, -1.0]))[None])[0]
            position = position + direction * step
            distance, near = tree.query(position, k=4)
            up = unit(outward[near].mean(0)[None])[0]
            height = ((position - obstacles[near]) @ up).mean()
            want = margin * (1 if style.has_long_hair else 0.7 + 0.5 * np.sin(np.pi * k / steps))
            if distance.min() < 0.06 and height < want:
                position = position + up * (want - height)
            elif style.has_long_hair and position[2] > level_z:  # lies on the head down to the cheek, then hangs
                position = position - up * 0.8 * (height - want)
            direction = unit((position - path[-1])[None])[0]
            path.append(position.copy())
            ups.append(up if distance.min() < 0.06 else ups[-1])
        lock, faces_lock, uv = _lock(np.array(path), np.array(ups), width, number % STRANDS)
        vertices.append(lock)
        faces.append(faces_lock + total)
        uvs.append(uv)
        away.append(np.concatenate([np.tile(np.array(ups)[:-1], (3, 1)), ups[-1:]]))
        total += len(lock)
    weights = np.zeros((total, len(body.names)))
    weights[:, body.names.index("Head")] = 1
    return (
        Mesh(np.concatenate(vertices), np.concatenate(faces), weights),
        np.concatenate(uvs),
        unit(np.concatenate(away)),
    )


def _start(
    root: Array, normal: Array, centre: Array, body: Body, style: Style, rng: np.random.Generator
) -> tuple[Array, float, float, float]:
    """First direction, length, width and height over the skin of the lock at `root`."""
    eye = body.eye()
    jitter = rng.normal(size=3)
    if style.has_long_hair:
        side = np.sign(root[0] - 0.018) or 1.0  # parted a little to the left
        front = np.clip((eye[1] + 0.11 - root[1]) / 0.07, 0, 1)
        flow = np.array([side * (0.25 + 0.75 * front), 0.15 + 0.75 * front, -0.5]) + 0.10 * jitter
        to_shoulder = root[2] - (body.head("Neck")[2] + 0.035)
        length = 1.12 * to_shoulder + 0.02 * rng.uniform() + 0.25 * abs(root[0] - centre[0])
        width, margin = rng.uniform(0.026, 0.040), rng.uniform(0.008, 0.018)
    else:
        top = np.clip((root[2] - eye[2] - 0.05) / 0.05, 0, 1)
        # Combed to the side and back on top, downwards at the sides and the back.
        flow = np.array([-0.55 * top, 0.25 + 0.35 * top, -0.9 * (1 - top) + 0.15 * top]) + 0.20 * jitter
        length = (0.024 + 0.026 * top) * rng.uniform(0.8, 1.2)
        width, margin = rng.uniform(0.014, 0.022), 0.005 + 0.009 * top * rng.uniform(0.6, 1.3)
    flow = flow - normal * (flow @ normal) + 0.10 * normal * (not style.has_long_hair)
    return unit(flow[None])[0], float(length), float(width), float(margin)


def _lock(path: Array, ups: Array, width: float, column: int) -> tuple[Array, Array, Array]:
    """A closed blade of triangular section along `path` (k, 3), its ridge towards `ups`, ending in a point."""
    n = len(path)
    t = np.linspace(0, 1, n)
    tangent = unit(np.gradient(path, axis=0))
    across = unit(np.cross(tangent, ups))
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
