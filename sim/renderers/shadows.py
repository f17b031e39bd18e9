"""Shadow maps: what each light sees, 1/z per pixel of a camera that looks straight down from the light.

The static part is drawn once. Actors are drawn every frame, by a simplified mesh: finer than a pixel of the map or its
soft edge shows nothing.
"""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from sim.geometry import FloatArray
from sim.renderers import kernels, shading_kernels

RIGID_CELL_M, SKINNED_CELL_M = 0.03, 0.045
"""Vertices of an actor in one cell of this size cast their shadow as one vertex. A rigid thing can have thin legs."""

Float32Array = npt.NDArray[np.float32]
FaceArray = npt.NDArray[np.uint32]
Bands = Callable[[Callable[[int, int], None], int, int], None]


def project(
    attributes: Float32Array,
    T_world_camera: FloatArray,
    lens: tuple[float, float, float, float],
    near: float,
    camera: Float32Array,
) -> None:
    """Fill `camera` (n, 6) by `kernels.project`; `lens` is fx, fy, cx, cy.

    The inverse of the pose is written out, and not left to BLAS, which differs between processors.
    """
    R, p = T_world_camera[:3, :3].T, T_world_camera[:3, 3]
    t = -(R[:, 0] * p[0] + R[:, 1] * p[1] + R[:, 2] * p[2])
    fx, fy, cx, cy = (np.float32(value) for value in lens)
    R32, t32 = np.ascontiguousarray(R, np.float32), t.astype(np.float32)
    kernels.project(attributes, R32, t32, fx, fy, cx, cy, np.float32(near), camera)


def screen_box(camera: Float32Array, near: float, width: int, height: int) -> tuple[int, int, int, int]:
    """First row, last + 1, first column, last + 1 of the pixels that a mesh can cover; empty: first = last.

    Args:
        camera: (n, 6) its vertices as `kernels.project` leaves them.
        near: what is closer is not drawn. A mesh that reaches through there can cover every pixel.
        width: of the image, pixels.
        height: of the image, pixels.
    """
    if not len(camera):
        return 0, 0, 0, 0
    z, u, v = np.ascontiguousarray(camera[:, 2:5].T)  # contiguous: a reduction over columns is many times slower
    if z.max() < near:
        return 0, 0, 0, 0
    if z.min() < near:
        return 0, height, 0, width
    # A pixel to each side: rasterisation rounds in another way than `kernels.project`.
    left, right = (min(max(int(edge), 0), width) for edge in (np.floor(u.min()) - 1, np.ceil(u.max()) + 2))
    top, bottom = (min(max(int(edge), 0), height) for edge in (np.floor(v.min()) - 1, np.ceil(v.max()) + 2))
    return (top, bottom, left, right) if top < bottom and left < right else (0, 0, 0, 0)


def simplified(
    vertices: Float32Array, faces: FaceArray, groups: npt.NDArray[np.int32], cells_m: Float32Array
) -> tuple[npt.NDArray[np.int64], FaceArray]:
    """A coarser mesh by vertex clustering (Rossignac and Borrel, "Multi-resolution 3D approximations", 1993).

    The two sides of a thin sheet may fall together; both stay, and the one that faces the light casts the shadow.

    Args:
        vertices: (n, 3) at rest, metres.
        faces: (m, 3).
        groups: (n,) a number per vertex; vertices of different groups stay apart.
        cells_m: (n,) side of the cells for each vertex, the same within a group.

    Returns:
        The vertices that are kept (k,), and faces (l, 3) that count in them.
    """
    if not len(faces):
        return np.zeros(0, np.int64), np.zeros((0, 3), np.uint32)
    cells = np.floor(vertices / cells_m[:, None]).astype(np.int64)
    keys = np.column_stack([groups, cells])
    _, first, cluster = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    coarse = cluster.reshape(-1)[faces.astype(np.int64)]
    distinct = (coarse[:, 0] != coarse[:, 1]) & (coarse[:, 1] != coarse[:, 2]) & (coarse[:, 2] != coarse[:, 0])
    coarse = coarse[distinct]
    start = coarse.argmin(axis=1)[:, None]  # the smallest index first, the winding kept: equal faces become equal rows
    coarse = np.unique(np.take_along_axis(coarse, (start + np.arange(3)) % 3, axis=1), axis=0)
    used, compact = np.unique(coarse, return_inverse=True)
    return first[used], compact.reshape(-1, 3).astype(np.uint32)


class ShadowMaps:
    """The shadow maps of all lights.

    Args:
        lights: (L, 4) float32 position and power.
        size: side of each map in pixels, 0 = no shadows.
        in_bands: calls a function on bands of rows, perhaps in threads.
    """

    def __init__(self, lights: Float32Array, size: int, in_bands: Bands) -> None:
        self._lights, self._size, self._in_bands = lights, size, in_bands
        self._static = np.zeros((len(lights), size, size), np.float32)
        self.maps = np.zeros((len(lights), size, size), np.float32)
        # The box of each map (first row, last + 1, first column, last + 1) where `maps` is not `_static`.
        self._changed = [(0, size, 0, size)] * len(lights)

    def draw_static(self, attributes: Float32Array, faces: FaceArray) -> None:
        """Draw what never moves; `attributes` (n, 8) as `kernels.pose_vertices` leaves them."""
        camera = np.zeros((len(attributes), 6), np.float32)
        for light, target in zip(self._lights, self._static, strict=True):
            self._draw(light, target, attributes, faces, camera)
        np.copyto(self.maps, self._static)

    def draw(self, attributes: Float32Array, faces: FaceArray) -> None:
        """Make `maps` anew: the static part, and `faces` over it."""
        camera = np.zeros((len(attributes), 6), np.float32)
        for number, (light, target) in enumerate(zip(self._lights, self.maps, strict=True)):
            top, bottom, left, right = self._changed[number]
            target[top:bottom, left:right] = self._static[number, top:bottom, left:right]
            self._changed[number] = self._draw(light, target, attributes, faces, camera)

    def _draw(
        self,
        light: Float32Array,
        target: Float32Array,
        attributes: Float32Array,
        faces: FaceArray,
        camera: Float32Array,
    ) -> tuple[int, int, int, int]:
        """Draw into one map, and return the box of it that can have changed."""
        if not self._size or not len(faces):
            return 0, 0, 0, 0
        focal, centre = self._size * 0.5 / shading_kernels.SHADOW_TANGENT, (self._size - 1) * 0.5
        lens, near = (focal, focal, centre, centre), float(shading_kernels.SHADOW_NEAR)
        T_world_light = np.diag([1.0, -1.0, -1.0, 1.0])  # x right, y "down" = -y of the world, looks along -z
        T_world_light[:3, 3] = light[:3]
        project(attributes, T_world_light, lens, near, camera)
        top, bottom, left, right = screen_box(camera, near, self._size, self._size)

        def draw(first: int, last: int) -> None:
            kernels.rasterise(
                camera,
                faces,
                0,
                len(faces),
                *lens,
                max(first, top),
                min(last, bottom),
                near,
                target,
                None,
                None,
                np.uint32(0),
            )

        if top < bottom:
            self._in_bands(draw, 0, self._size)
        return top, bottom, left, right
