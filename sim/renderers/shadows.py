"""Shadow maps: what each light sees, 1/z per pixel of a camera that looks straight down from the light.

The static part is drawn once. Actors are drawn every frame, by a simplified mesh: finer than a pixel of the map or its
soft edge shows nothing.
"""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from sim.geometry import FloatArray
from sim.renderers import kernels, shading_kernels

CASTER_CELL_M = 0.02
"""Vertices of an actor in one cell of this size, with normals in one octant, cast their shadow as one vertex."""

Float32Array = npt.NDArray[np.float32]
FaceArray = npt.NDArray[np.uint32]
Bands = Callable[[Callable[[int, int], None], int], None]


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


def simplified(
    vertices: Float32Array, normals: Float32Array, faces: FaceArray, groups: npt.NDArray[np.int32]
) -> tuple[npt.NDArray[np.int64], FaceArray]:
    """A coarser mesh by vertex clustering (Rossignac and Borrel, "Multi-resolution 3D approximations", 1993).

    Args:
        vertices: (n, 3) at rest, metres.
        normals: (n, 3) at rest; the two sides of a thin sheet stay apart.
        faces: (m, 3).
        groups: (n,) a number per vertex; vertices of different groups stay apart.

    Returns:
        The vertices that are kept (k,), and faces (l, 3) that count in them.
    """
    if not len(faces):
        return np.zeros(0, np.int64), np.zeros((0, 3), np.uint32)
    cells = np.floor(vertices / np.float32(CASTER_CELL_M)).astype(np.int64)
    octant = (normals > 0).astype(np.int64)
    keys = np.column_stack([groups, cells, octant])
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
        self._numbers = np.zeros((size, size), np.int32)
        self._coverage = np.zeros((size, size), np.uint32)
        self.maps = np.zeros((len(lights), size, size), np.float32)

    def draw_static(self, attributes: Float32Array, faces: FaceArray) -> None:
        """Draw what never moves; `attributes` (n, 8) as `kernels.pose_vertices` leaves them."""
        self._draw(self._static, attributes, faces)

    def draw(self, attributes: Float32Array, faces: FaceArray) -> None:
        """Make `maps` anew: the static part, and `faces` over it."""
        if self._size:
            np.copyto(self.maps, self._static)
            self._draw(self.maps, attributes, faces)

    def _draw(self, targets: Float32Array, attributes: Float32Array, faces: FaceArray) -> None:
        if not self._size:
            return
        focal, centre = self._size * 0.5 / shading_kernels.SHADOW_TANGENT, (self._size - 1) * 0.5
        lens, near = (focal, focal, centre, centre), float(shading_kernels.SHADOW_NEAR)
        camera = np.zeros((len(attributes), 6), np.float32)
        for light, target in zip(self._lights, targets, strict=True):
            T_world_light = np.diag([1.0, -1.0, -1.0, 1.0])  # x right, y "down" = -y of the world, looks along -z
            T_world_light[:3, 3] = light[:3]
            project(attributes, T_world_light, lens, near, camera)

            def draw(first: int, last: int, target: Float32Array = target) -> None:
                kernels.rasterise(
                    camera,
                    faces,
                    0,
                    len(faces),
                    *lens,
                    first,
                    last,
                    near,
                    target,
                    self._numbers,
                    self._coverage,
                    np.uint32(0),
                )

            self._in_bands(draw, self._size)
