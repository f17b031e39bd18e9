"""Triangle meshes at bake time: positions and skin weights per vertex, and the operations that cut clothes."""

import heapq
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse

Array = npt.NDArray[Any]

BORDER_WEIGHT = 3.0
"""Of the planes that hold a border, against those of the faces."""


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """Triangles, counter-clockwise seen from outside.

    Attributes:
        vertices: (n, 3).
        faces: (m, 3).
        weights: (n, B) skin weights; any other values per vertex may ride along.
    """

    vertices: Array
    faces: Array
    weights: Array


def unit(v: Array) -> Array:
    """Rows scaled to length 1; zero rows stay zero."""
    return v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-12)


def vertex_normals(vertices: Array, faces: Array, weld: Array | None = None) -> Array:
    """(n, 3) area-weighted normals; vertices with the same number in `weld` (n,) share theirs, unless they cancel."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    face_normal = np.cross(b - a, c - a)
    place = np.arange(len(vertices)) if weld is None else weld
    total = np.zeros((int(place.max()) + 1, 3))
    for k in range(3):
        np.add.at(total, place[faces[:, k]], face_normal)
    shared = unit(total[place])
    flat = np.linalg.norm(shared, axis=1) < 0.5 if weld is not None else np.zeros(len(place), bool)
    if flat.any():  # a fold so thin that nothing is between its two sides
        shared[flat] = vertex_normals(vertices, faces)[flat]
    return shared


def compact(mesh: Mesh) -> Mesh:
    """Without the vertices that no face uses."""
    used, faces = np.unique(mesh.faces, return_inverse=True)
    return Mesh(mesh.vertices[used], faces.reshape(mesh.faces.shape), mesh.weights[used])


def join(*meshes: Mesh) -> Mesh:
    """One after the other."""
    starts = np.cumsum([0] + [len(m.vertices) for m in meshes])
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.faces + start for m, start in zip(meshes, starts[:-1], strict=True)]),
        np.concatenate([m.weights for m in meshes]),
    )


def weld(mesh: Mesh) -> Mesh:
    """Vertices at the same place (to 1 µm) become one."""
    _, first, place = np.unique(np.rint(mesh.vertices * 1e6), axis=0, return_index=True, return_inverse=True)
    return Mesh(mesh.vertices[first], place.ravel()[mesh.faces], mesh.weights[first])


def edges_of(faces: Array) -> Array:
    """(3m, 2) undirected edges, lower index first; inner edges appear twice."""
    return np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), 1)


def subdivide(mesh: Mesh) -> Mesh:
    """Each triangle into four at the middles of its edges."""
    edges, index = np.unique(edges_of(mesh.faces), axis=0, return_inverse=True)
    ab, bc, ca = index.reshape(3, -1) + len(mesh.vertices)
    a, b, c = mesh.faces.T
    return Mesh(
        np.concatenate([mesh.vertices, mesh.vertices[edges].mean(1)]),
        np.concatenate([np.c_[a, ab, ca], np.c_[b, bc, ab], np.c_[c, ca, bc], np.c_[ab, bc, ca]]),
        np.concatenate([mesh.weights, mesh.weights[edges].mean(1)]),
    )


def smooth(values: Array, faces: Array, iterations: int, amount: float = 0.5) -> Array:
    """Values (n, k) drawn towards the mean of their neighbours."""
    n = len(values)
    edges = edges_of(faces)
    row, column = np.r_[edges[:, 0], edges[:, 1]], np.r_[edges[:, 1], edges[:, 0]]
    adjacency = scipy.sparse.coo_matrix((np.ones(len(row)), (row, column)), (n, n)).tocsr()
    adjacency.data[:] = 1
    mean = scipy.sparse.diags(1 / np.maximum(np.asarray(adjacency.sum(1)).ravel(), 1)) @ adjacency
    for _ in range(iterations):
        values = values + amount * (mean @ values - values)
    return values


def clip(mesh: Mesh, field: Callable[[Array, Array], Array]) -> Mesh:
    """The part where `field(vertices, weights)` (n,) is positive, cut along its zero line."""
    value = field(mesh.vertices, mesh.weights)
    inside = value > 0
    count = inside[mesh.faces].sum(1)
    kept = [mesh.faces[count == 3]]
    cut: dict[tuple[int, int], int] = {}
    ends: list[tuple[int, int]] = []

    def crossing(i: int, j: int) -> int:
        key = (min(i, j), max(i, j))
        if key not in cut:
            cut[key] = len(mesh.vertices) + len(ends)
            ends.append(key)
        return cut[key]

    added = []
    for face in mesh.faces[(count == 1) | (count == 2)].tolist():
        alone = inside[face].sum() == 1
        k = next(k for k in range(3) if inside[face[k]] == alone)
        a, b, c = face[k], face[(k + 1) % 3], face[(k + 2) % 3]
        ab, ca = crossing(a, b), crossing(c, a)
        added += [(a, ab, ca)] if alone else [(ab, b, c), (ab, c, ca)]
    if not ends:
        return compact(replace(mesh, faces=kept[0]))
    i, j = np.array(ends).T
    t = (value[i] / (value[i] - value[j]))[:, None]
    return compact(
        Mesh(
            np.concatenate([mesh.vertices, mesh.vertices[i] * (1 - t) + mesh.vertices[j] * t]),
            np.concatenate([*kept, np.array(added)]),
            np.concatenate([mesh.weights, mesh.weights[i] * (1 - t) + mesh.weights[j] * t]),
        )
    )


def border_edges(faces: Array) -> Array:
    """(k, 2) directed edges that belong to one face only, in that face's direction."""
    directed = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    _, index, count = np.unique(np.sort(directed, 1), axis=0, return_inverse=True, return_counts=True)
    return directed[count[index.ravel()] == 1]


def largest_component(mesh: Mesh) -> Mesh:
    """Without the pieces that a cut left hanging in the air."""
    n = len(mesh.vertices)
    edges = edges_of(mesh.faces)
    graph = scipy.sparse.coo_matrix((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), (n, n))
    label = scipy.sparse.csgraph.connected_components(graph, directed=False)[1]
    size = np.bincount(label[mesh.faces[:, 0]])
    return compact(replace(mesh, faces=mesh.faces[label[mesh.faces[:, 0]] == size.argmax()]))


def fold_hems(mesh: Mesh, depth: float, border: Array | None = None) -> Mesh:
    """Turn the `border` (k, 2) (default: every border) inwards by `depth`.

    So the cloth looks thick and hides its missing inside.
    """
    normals = unit(smooth(vertex_normals(mesh.vertices, mesh.faces), mesh.faces, 3))
    if border is None:
        border = border_edges(mesh.faces)
    rim, place = np.unique(border, return_inverse=True)
    a, b = place.reshape(border.shape).T + len(mesh.vertices)
    inner = len(rim)
    # The rim's vertices are doubled: the fold is a sharp edge.
    return Mesh(
        np.concatenate([mesh.vertices, mesh.vertices[rim], mesh.vertices[rim] - depth * normals[rim]]),
        np.concatenate([mesh.faces, np.c_[b, a, a + inner], np.c_[b, a + inner, b + inner]]),
        np.concatenate([mesh.weights, mesh.weights[rim], mesh.weights[rim]]),
    )


def simplify(mesh: Mesh, target_faces: int, locked: Array | None = None) -> tuple[Mesh, Array]:
    """Fewer triangles by half-edge collapses in the order of the quadric error (Garland and Heckbert 1997).

    Vertices never move, so whatever belongs to them (weights, UVs) stays right. A border vertex collapses along the
    border only, and planes through the border edges hold its line (section 6 there).

    Args:
        mesh: to simplify.
        target_faces: stop there.
        locked: (n,) vertices that must stay.

    Returns:
        The mesh, and the index (k,) of each of its vertices in the old one.
    """
    v = mesh.vertices
    n = len(v)
    faces: list[list[int] | None] = mesh.faces.tolist()
    around: list[set[int]] = [set() for _ in range(n)]
    for f, face in enumerate(mesh.faces.tolist()):
        for corner in face:
            around[corner].add(f)
    fixed = np.zeros(n, bool) if locked is None else locked
    border = border_edges(mesh.faces)
    on_border = np.zeros(n, bool)
    on_border[border] = True
    quadric = np.zeros((n, 4, 4))
    a, b, c = (v[mesh.faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1, keepdims=True)
    plane = np.c_[normal / np.maximum(area, 1e-15), -(normal * a).sum(1, keepdims=True) / np.maximum(area, 1e-15)]
    q = area[:, :, None] * plane[:, :, None] * plane[:, None, :]
    for k in range(3):
        np.add.at(quadric, mesh.faces[:, k], q)
    along = v[border[:, 1]] - v[border[:, 0]]
    wall = unit(np.cross(along, unit(vertex_normals(v, mesh.faces)[border].sum(1))))
    wall = np.c_[wall, -(wall * v[border[:, 0]]).sum(1)]
    q = BORDER_WEIGHT * (along**2).sum(1)[:, None, None] * wall[:, :, None] * wall[:, None, :]
    for k in range(2):
        np.add.at(quadric, border[:, k], q)
    homogeneous = np.c_[v, np.ones(n)]
    version = [0] * n

    def neighbours(i: int) -> set[int]:
        return {corner for f in around[i] for corner in faces[f] or () if corner != i}

    def cost(i: int, j: int) -> float:
        p = homogeneous[j]
        # The small term prefers short edges where the surface is flat, which keeps triangles well shaped.
        return float(p @ (quadric[i] + quadric[j]) @ p) + 1e-9 * float(((v[i] - v[j]) ** 2).sum())

    heap = [(cost(i, j), i, j, 0, 0) for i in range(n) if not fixed[i] for j in sorted(neighbours(i))]
    heapq.heapify(heap)
    alive = len(faces)
    while heap and alive > target_faces:
        _, i, j, vi, vj = heapq.heappop(heap)
        if version[i] != vi or version[j] != vj or not around[i]:
            continue
        shared = around[i] & around[j]
        sides = 1 if on_border[i] else 2  # a border vertex moves along a border edge, which has one face
        if (
            len(shared) != sides
            or len(neighbours(i) & neighbours(j)) != sides
            or _flips(v, faces, around[i] - shared, i, j)
        ):
            continue
        for f in shared:
            for corner in faces[f] or ():
                around[corner].discard(f)
            faces[f] = None
        for f in around[i]:
            faces[f] = [j if corner == i else corner for corner in faces[f] or ()]
            around[j].add(f)
        around[i] = set()
        quadric[j] += quadric[i]
        version[i] += 1
        version[j] += 1
        alive -= len(shared)
        for k in sorted(neighbours(j)):
            if not fixed[j]:
                heapq.heappush(heap, (cost(j, k), j, k, version[j], version[k]))
            if not fixed[k]:
                heapq.heappush(heap, (cost(k, j), k, j, version[k], version[j]))
    left = np.array([face for face in faces if face is not None])
    used, index = np.unique(left, return_inverse=True)
    return Mesh(v[used], index.reshape(left.shape), mesh.weights[used]), used


def _flips(v: Array, faces: list[list[int] | None], touched: set[int], i: int, j: int) -> bool:
    """Whether moving vertex i onto j turns one of the `touched` faces by more than about 65 degrees."""
    if not touched:
        return True
    old = np.array([faces[f] for f in sorted(touched)])
    new = np.where(old == i, j, old)
    before = np.cross(v[old[:, 1]] - v[old[:, 0]], v[old[:, 2]] - v[old[:, 0]])
    after = np.cross(v[new[:, 1]] - v[new[:, 0]], v[new[:, 2]] - v[new[:, 0]])
    lengths = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    return bool(((before * after).sum(1) < 0.42 * lengths + 1e-16).any())
