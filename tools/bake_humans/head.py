"""What is bare: head, neck, hands and eyes, as textured meshes."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse

from tools.bake_humans.body import BODY_VERTICES, Body
from tools.bake_humans.mesh import Array, Mesh, border_edges, simplify, smooth, vertex_normals
from tools.bake_humans.skin_paint import paint_skin
from tools.bake_humans.styles import Style
from tools.bake_humans.texture import bake_map, fill, sample

SKIN_FACES = 4600
INNER_MOUTH = (84, 36, 36)
EYE_RINGS, EYE_SIDES = 5, 10


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Textured:
    """A mesh with UVs and one image.

    Attributes:
        mesh: uv cuts have doubled vertices.
        uv: (n, 2).
        weld: (n,) vertices with the same number are one point.
        texture: (S, S, 3) uint8.
    """

    mesh: Mesh
    uv: Array
    weld: Array
    texture: Array


def make_skin(body: Body, style: Style, size: int) -> Textured:
    """Head, neck and hands: what the clothes cover is dropped, and the insides of the eye sockets."""
    v, w = body.vertices[:BODY_VERTICES], body.weights[:BODY_VERTICES]
    head = body.share(w, "Neck", "Head") > 0.05
    hand = body.share(w, "Hand", "Thumb", "Finger") > 0.3
    chest = (v[:, 2] > body.head("Neck")[2] - 0.06) & (np.abs(v[:, 0]) < 0.12)
    keep = (head | hand | chest)[body.faces["body"]].all(1)
    faces, uv_faces = body.faces["body"][keep], body.uv_faces["body"][keep]
    island = _islands(uv_faces, len(body.uv))
    socket = np.zeros(len(faces), bool)
    for number in np.unique(island):
        own = island == number
        centre = v[np.unique(faces[own])].mean(0)
        inner = np.abs(np.abs(centre[0]) - body.eye()[0]) < 0.012 and np.abs(centre[2] - body.eye()[2]) < 0.012
        socket |= own & bool(inner)
    faces, uv_faces, island = faces[~socket], uv_faces[~socket], island[~socket]

    pairs, corner = np.unique(np.stack([faces.ravel(), uv_faces.ravel()], 1), axis=0, return_inverse=True)
    corner = corner.reshape(-1, 3)
    uv = _pack(body.uv[pairs[:, 1]], corner, island)
    # Hollows (nostrils, eyelids, ears, between the fingers) are where the surface bends towards its normal.
    hollow = np.zeros(len(v))
    normals = vertex_normals(v, body.faces["body"])
    for steps, gain in ((1, 160.0), (4, 45.0), (12, 15.0)):
        hollow += gain * ((smooth(v, body.faces["body"], steps) - v) * normals).sum(1)
    values = np.c_[v[pairs[:, 0]], np.clip(hollow, -0.6, 1.2)[pairs[:, 0]], body.uv[pairs[:, 1]]]
    mapped, mask = bake_map(values, corner, uv, size)
    texels = mapped[mask]
    colours = paint_skin(texels[:, :3], texels[:, 3], sample(body.lips, texels[:, 4:]) / 255.0, body, style)
    colours[sample(body.mouth, texels[:, 4:]) > 127] = INNER_MOUTH
    counts = np.bincount(pairs[:, 0], minlength=len(v))
    seams = counts[pairs[:, 0]] > 1
    seams[border_edges(corner)] = True
    mesh, kept = simplify(Mesh(v[pairs[:, 0]], corner, w[pairs[:, 0]]), SKIN_FACES, seams)
    return Textured(mesh=mesh, uv=uv[kept], weld=pairs[kept, 0], texture=fill(colours, mask))


def make_eyes(body: Body, style: Style, size: int = 64) -> Textured:
    """Both eyeballs: the front cap of a sphere each, looking ahead."""
    meshes, uvs = [], []
    for side in ("left_eye", "right_eye"):
        points = body.vertices[np.unique(body.faces[side])]
        centre, radius = points.mean(0), np.linalg.norm(points - points.mean(0), axis=1).mean()
        polar = np.repeat(np.linspace(0, np.radians(100), EYE_RINGS + 1)[1:], EYE_SIDES)
        turn = np.tile(np.arange(EYE_SIDES) * 2 * np.pi / EYE_SIDES, EYE_RINGS)
        ring = np.stack([np.sin(polar) * np.cos(turn), -np.cos(polar), np.sin(polar) * np.sin(turn)], 1)
        unit_sphere = np.concatenate([[[0.0, -1.0, 0.0]], ring])
        k = np.arange(EYE_SIDES)
        after = (k + 1) % EYE_SIDES
        faces = [np.c_[np.zeros(EYE_SIDES, int), 1 + k, 1 + after]]
        for r in range(EYE_RINGS - 1):
            a, b = 1 + r * EYE_SIDES + k, 1 + r * EYE_SIDES + after
            faces += [np.c_[a, a + EYE_SIDES, b], np.c_[b, a + EYE_SIDES, b + EYE_SIDES]]
        weights = np.zeros((len(unit_sphere), len(body.names)))
        weights[:, body.names.index("Head")] = 1
        meshes.append(Mesh(centre + radius * unit_sphere, np.concatenate(faces), weights))
        uvs.append(0.5 + 0.45 * unit_sphere[:, [0, 2]] * [1, -1])
    x, y = np.meshgrid(*[((np.arange(size) + 0.5) / size - 0.5) / 0.45] * 2)
    radius = np.hypot(x, y)
    image = np.full((size, size, 3), (226, 220, 214), float)
    image[radius > 0.75] = (200, 176, 166)
    rays = 1 + 0.15 * np.cos(17 * np.arctan2(y, x))
    iris = radius < 0.43
    image[iris] = (np.array(style.iris, float) * rays[..., None])[iris]
    image[iris & (radius > 0.37)] *= 0.5
    image[radius < 0.19] = (12, 11, 12)
    image[np.hypot(x + 0.15, y + 0.17) < 0.075] = (250, 250, 250)
    left, right = meshes
    count = len(left.vertices)
    return Textured(
        mesh=Mesh(
            np.concatenate([left.vertices, right.vertices]),
            np.concatenate([left.faces, right.faces + count]),
            np.concatenate([left.weights, right.weights]),
        ),
        uv=np.concatenate(uvs),
        weld=np.arange(2 * count),
        texture=np.clip(image, 0, 255).astype(np.uint8),
    )


def _islands(uv_faces: Array, count: int) -> Array:
    """(m,) which connected piece of the UV layout each triangle belongs to."""
    ends = np.concatenate([uv_faces[:, [0, 1]], uv_faces[:, [1, 2]]]).T
    graph = scipy.sparse.coo_matrix((np.ones(ends.shape[1]), (ends[0], ends[1])), (count, count))
    label = scipy.sparse.csgraph.connected_components(graph, directed=False)[1]
    return np.asarray(label[uv_faces[:, 0]])


def _pack(uv: Array, faces: Array, island: Array) -> Array:
    """Head in the left half; the two hands, neck and mouth in the right one; the rest is tiny."""
    numbers, counts = np.unique(island, return_counts=True)
    ranked = numbers[np.argsort(-counts, kind="stable")]
    boxes = [
        (0.005, 0.005, 0.52, 0.99),
        (0.54, 0.26, 0.45, 0.36),
        (0.54, 0.63, 0.45, 0.36),
        (0.54, 0.005, 0.22, 0.245),
        (0.77, 0.005, 0.22, 0.245),
    ]
    spare = [(0.535 + 0.02 * k, 0.0, 0.01, 0.004) for k in range(max(0, len(ranked) - 5))]
    out = np.zeros_like(uv)
    for number, (x, y, width, height) in zip(ranked, boxes + spare, strict=False):
        own = np.unique(faces[island == number])
        low, span = uv[own].min(0), np.ptp(uv[own], axis=0)
        out[own] = (x, y) + (uv[own] - low) * min(width / span[0], height / span[1])
    return out
