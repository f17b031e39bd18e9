"""Mesh construction: boxes, cushions, pictures, tubes and turned shapes, with normals and texture coordinates.

Faces are counter-clockwise seen from outside. Coordinates are rounded to `sim.geometry.POSE_GRID`, so that a
last-bit difference of a sine between two machines does not reach a vertex.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sim.geometry import FloatArray, on_grid
from sim.scene import Surface

IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mesh:
    """A textured triangle mesh without its texture.

    Attributes:
        vertices: (n, 3) metres.
        normals: (n, 3) outward, unit length.
        uv: (n, 2), v = 0 is the texture's first image row.
        faces: (m, 3) indices, counter-clockwise seen from outside.
    """

    vertices: FloatArray
    normals: FloatArray
    uv: FloatArray
    faces: IntArray

    def moved(self, offset: npt.ArrayLike = (0.0, 0.0, 0.0), rotation: FloatArray | None = None) -> "Mesh":
        """The mesh turned by `rotation` (3, 3) about the origin, then shifted by `offset` (3,)."""
        R = np.eye(3) if rotation is None else rotation
        return Mesh(
            vertices=self.vertices @ R.T + np.asarray(offset, float),
            normals=self.normals @ R.T,
            uv=self.uv,
            faces=self.faces,
        )

    def bent(self, bend: Callable[[FloatArray], FloatArray]) -> "Mesh":
        """The mesh with `bend` applied to its vertices (n, 3) and smooth normals computed anew."""
        vertices = bend(self.vertices)
        return Mesh(vertices=vertices, normals=smooth_normals(vertices, self.faces), uv=self.uv, faces=self.faces)

    def mapped(self, u_range: tuple[float, float], v_range: tuple[float, float] = (0.0, 1.0)) -> "Mesh":
        """The mesh with its texture coordinates 0..1 mapped into a part of the texture."""
        low = np.array([u_range[0], v_range[0]])
        high = np.array([u_range[1], v_range[1]])
        return Mesh(vertices=self.vertices, normals=self.normals, uv=low + self.uv * (high - low), faces=self.faces)

    def two_sided(self) -> "Mesh":
        """The mesh and its back side, for leaves and sheets that are seen from both."""
        back = Mesh(vertices=self.vertices, normals=-self.normals, uv=self.uv, faces=self.faces[:, ::-1])
        return merged(self, back)

    def surface(self, texture: npt.NDArray[np.uint8]) -> Surface:
        """The mesh with its texture, as a renderer takes it."""
        return Surface(
            vertices=on_grid(self.vertices).astype(np.float32),
            normals=on_grid(self.normals).astype(np.float32),
            uv=on_grid(self.uv).astype(np.float32),
            faces=self.faces.astype(np.int32),
            texture=texture,
        )


def merged(*meshes: Mesh) -> Mesh:
    """One mesh of several."""
    starts = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    return Mesh(
        vertices=np.concatenate([m.vertices for m in meshes]),
        normals=np.concatenate([m.normals for m in meshes]),
        uv=np.concatenate([m.uv for m in meshes]),
        faces=np.concatenate([m.faces + start for m, start in zip(meshes, starts[:-1], strict=True)]),
    )


def smooth_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """(n, 3) unit normals: area-weighted over the faces at each place; vertices closer than 1 µm share one normal."""
    _, place = np.unique(np.round(vertices * 1e6).astype(np.int64), axis=0, return_inverse=True)
    place = place.reshape(-1)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    area_normals = np.cross(b - a, c - a)
    sums = np.zeros((place.max() + 1, 3))
    for k in range(3):
        np.add.at(sums, place[faces[:, k]], area_normals)
    normals = sums[place]
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def panel(centre: npt.ArrayLike, right: npt.ArrayLike, up: npt.ArrayLike) -> Mesh:
    """A flat picture seen from one side.

    Args:
        centre: (3,) its middle.
        right: (3,) half extent to the right, as its viewer sees it.
        up: (3,) half extent upwards; the picture faces along `right x up`.
    """
    m, r, u = (np.asarray(v, float) for v in (centre, right, up))
    (rx, ry, rz), (ux, uy, uz) = r.tolist(), u.tolist()
    normal = np.array([[ry * uz - rz * uy, rz * ux - rx * uz, rx * uy - ry * ux]])
    return Mesh(
        vertices=np.array([m - r - u, m + r - u, m + r + u, m - r + u]),
        normals=np.repeat(normal / np.sqrt(np.sum(normal**2)), 4, axis=0),
        uv=_PANEL_UV,
        faces=_PANEL_FACES,
    )


_PANEL_UV = np.array([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]])
_PANEL_FACES = np.array([[0, 1, 2], [0, 2, 3]])


def box(
    centre: npt.ArrayLike,
    size: npt.ArrayLike,
    *,
    texture_m: float | None = None,
    texture_offset: tuple[float, float] = (0.0, 0.0),
) -> Mesh:
    """A box along the axes.

    Args:
        centre: (3,) its middle.
        size: (3,) full extents.
        texture_m: metres that the whole texture spans on every face; None: each face shows all of it.
        texture_offset: shift of the texture, in textures, so that two boards do not show the same grain.
    """
    m, h = np.asarray(centre, float), np.asarray(size, float) / 2
    x, y, z = np.diag(h)
    sides = [(-y, x, z), (y, -x, z), (x, y, z), (-x, -y, z), (z, x, y), (-z, x, -y)]
    parts = []
    for index, (out, right, up) in enumerate(sides):
        part = panel(m + out, right, up)
        if texture_m is not None:
            u0 = texture_offset[0] + 0.37 * index
            v0 = texture_offset[1] + 0.23 * index
            width, height = 2 * np.abs(right).sum() / texture_m, 2 * np.abs(up).sum() / texture_m
            part = part.mapped((u0, u0 + width), (v0, v0 + height))
        parts.append(part)
    return merged(*parts)


def rounded_box(
    centre: npt.ArrayLike,
    size: npt.ArrayLike,
    radius: float,
    *,
    segments: int = 3,
    spans: int = 1,
    texture_m: float = 1.0,
) -> Mesh:
    """A box with round edges and corners, smooth-shaded.

    Args:
        centre: (3,) its middle.
        size: (3,) full extents.
        radius: of the edges, at most half of the smallest extent.
        segments: per 45 degrees of an edge.
        spans: pieces of each flat part, for shapes that are bent afterwards.
        texture_m: metres that the whole texture spans.

    Raises:
        ValueError: the radius does not fit.
    """
    m, h = np.asarray(centre, float), np.asarray(size, float) / 2
    if not 0 < radius <= h.min() + 1e-12:
        raise ValueError(f"rounded_box: the radius must be above 0 and at most {h.min():.4g}, got {radius:.4g}")
    # Seen from a face, an edge runs from 45 degrees (where the faces meet) to 0 (where it is flat).
    edge = radius * (1 - np.tan(np.linspace(np.pi / 4, 0, segments + 1)))
    parts = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            right, up = (axis + 1) % 3, (axis + 2) % 3
            if sign < 0:
                right, up = up, right  # keeps right x up outward
            steps = [
                np.concatenate(
                    [-h[k] + edge, np.linspace(-h[k] + radius, h[k] - radius, spans + 1), (h[k] - edge)[::-1]]
                )
                for k in (right, up)
            ]
            steps = [s[np.concatenate([[True], np.diff(s) > 1e-9])] for s in steps]
            a, b = np.meshgrid(steps[0], steps[1])
            points = np.empty((a.size, 3))
            points[:, axis], points[:, right], points[:, up] = sign * h[axis], a.ravel(), b.ravel()
            inner = np.clip(points, radius - h, h - radius)
            normals = points - inner
            normals /= np.linalg.norm(normals, axis=1, keepdims=True)
            parts.append(
                Mesh(
                    vertices=m + inner + radius * normals,
                    normals=normals,
                    uv=np.stack([points[:, right] + h[right], h[up] - points[:, up]], axis=1) / texture_m,
                    faces=_grid_faces(len(steps[1]), len(steps[0])),
                )
            )
    return merged(*parts)


def _grid_faces(rows: int, columns: int) -> IntArray:
    """Two triangles per cell of a row-major grid of vertices; columns run right, rows run up."""
    start = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    a, b, c, d = start, start + 1, start + columns + 1, start + columns
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def lathe(profile: Sequence[tuple[float, float]], *, segments: int = 24, crease_deg: float = 35.0) -> Mesh:
    """A turned shape about z.

    Args:
        profile: (radius, z) from the bottom over the outside to the top; walking on, the outside is to the right.
        segments: of the circle.
        crease_deg: the profile is smooth-shaded where it turns by less.
    """
    points = np.asarray(profile, float)
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    outward = np.stack([steps[:, 1], -steps[:, 0]], axis=1) / lengths[:, None]
    travelled = np.concatenate([[0.0], np.cumsum(lengths)]) / lengths.sum()
    smooth = np.sum(outward[:-1] * outward[1:], axis=1) > np.cos(np.deg2rad(crease_deg))
    mean = outward.copy()
    angles = np.linspace(0.0, 2 * np.pi, segments + 1)
    cos, sin = np.cos(angles), np.sin(angles)
    cos[-1], sin[-1] = cos[0], sin[0]
    parts = []
    for k in range(len(steps)):
        rings = []
        for end, neighbour in ((k, k - 1), (k + 1, k + 1)):
            joined = 0 < end < len(steps) and bool(smooth[end - 1])
            n = outward[k] + outward[neighbour] if joined else mean[k]
            n = n / np.linalg.norm(n)
            r, z = points[end]
            rings.append(
                (
                    np.stack([r * cos, r * sin, np.full_like(cos, z)], axis=1),
                    np.stack([n[0] * cos, n[0] * sin, np.full_like(cos, n[1])], axis=1),
                    np.stack([angles / (2 * np.pi), np.full_like(cos, 1 - travelled[end])], axis=1),
                )
            )
        parts.append(_strip(rings, keep_lower=points[k, 0] > 0, keep_upper=points[k + 1, 0] > 0))
    return merged(*parts)


def _strip(rings: list[tuple[FloatArray, FloatArray, FloatArray]], *, keep_lower: bool, keep_upper: bool) -> Mesh:
    """The band between two rings of (vertices, normals, uv), without the triangles that end in a point."""
    faces = _grid_faces(2, len(rings[0][0]))
    first, second = np.split(faces, 2)  # the first has its edge on the lower ring, the second on the upper
    faces = np.concatenate([f for f, keep in ((first, keep_lower), (second, keep_upper)) if keep])
    vertices, normals, uv = (np.concatenate([ring[k] for ring in rings]) for k in range(3))
    return Mesh(vertices=vertices, normals=normals, uv=uv, faces=faces)


def tube(path: npt.ArrayLike, radius: float | Sequence[float], *, segments: int = 10, texture_m: float = 1.0) -> Mesh:
    """A round bar along a polyline, closed at both ends.

    Args:
        path: (n, 3) its middle line, neighbours apart.
        radius: of the bar, or one per point.
        segments: of the circle.
        texture_m: metres that the whole texture spans.
    """
    p = np.asarray(path, float)
    radii = np.broadcast_to(np.asarray(radius, float), (len(p),))
    directions = np.diff(p, axis=0)
    lengths = np.linalg.norm(directions, axis=1)
    directions = directions / lengths[:, None]
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    tangents = np.concatenate([directions[:1], directions[:-1] + directions[1:], directions[-1:]])
    tangents = tangents / np.linalg.norm(tangents, axis=1, keepdims=True)
    side = np.cross(tangents[0], np.eye(3)[np.argmin(np.abs(tangents[0]))])
    angles = np.linspace(0.0, 2 * np.pi, segments + 1)
    angles[-1] = 0.0
    vertices, normals, uv = [], [], []
    for k, t in enumerate(tangents):
        side = side - t * (side @ t)  # carried along without twist
        side = side / np.linalg.norm(side)
        around = np.cos(angles)[:, None] * side + np.sin(angles)[:, None] * np.cross(t, side)
        vertices.append(p[k] + radii[k] * around)
        normals.append(around)
        turn = np.linspace(0.0, 2 * np.pi * radii[k], segments + 1)
        uv.append(np.stack([turn, np.full_like(turn, along[k])], axis=1) / texture_m)
    body = Mesh(
        vertices=np.concatenate(vertices),
        normals=np.concatenate(normals),
        uv=np.concatenate(uv),
        faces=_grid_faces(len(p), segments + 1),
    )
    ends = []
    for k, out in ((0, -tangents[0]), (-1, tangents[-1])):
        ring = vertices[k][:-1]
        fan = np.stack([np.zeros(segments), 1 + np.arange(segments), 1 + (np.arange(segments) + 1) % segments], axis=1)
        faces = fan.astype(np.int64)
        ends.append(
            Mesh(
                vertices=np.concatenate([p[[k]], ring]),
                normals=np.tile(out, (segments + 1, 1)),
                uv=np.concatenate([uv[k][:1], uv[k][:-1]]),
                faces=faces if k == -1 else faces[:, ::-1],
            )
        )
    return merged(body, *ends)
