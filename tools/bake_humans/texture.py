"""Texture space: charts, maps of values under each texel, and noise in space.

Every texel knows its rest position, so a pattern is a function of a 3-D point and needs no care at chart borders.
"""

import hashlib
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from scipy.ndimage import distance_transform_edt

from tools.bake_humans.mesh import Mesh

Array = npt.NDArray[Any]


def generator(seed: int, *names: str | int) -> np.random.Generator:
    """The random numbers of one consumer, independent of all others."""
    key = hashlib.sha256("/".join(str(n) for n in (seed, *names)).encode()).digest()
    return np.random.default_rng(np.frombuffer(key[:16], np.uint64))


def unwrap(mesh: Mesh) -> tuple[Mesh, Array, Array]:
    """Cut into charts with xatlas: the mesh with doubled vertices at cuts, uv (n, 2), and each vertex's origin (n,)."""
    import xatlas

    origin, faces, uv = xatlas.parametrize(mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32))
    origin = origin.astype(np.int64)
    cut = Mesh(mesh.vertices[origin], faces.astype(np.int64), mesh.weights[origin])
    return cut, uv.astype(float), origin


def bake_map(values: Array, faces: Array, uv: Array, size: int) -> tuple[Array, Array]:
    """Interpolate `values` (n, k) over the charts: (size, size, k), and the (size, size) mask of covered texels."""
    image = np.zeros((size, size, values.shape[1]))
    mask = np.zeros((size, size), bool)
    for face in faces:
        p = uv[face] * size
        x0, y0 = np.maximum(np.floor(p.min(0)).astype(int) - 1, 0)
        x1, y1 = np.minimum(np.ceil(p.max(0)).astype(int) + 2, size)
        (ux, uy), (vx, vy) = p[1] - p[0], p[2] - p[0]
        area = ux * vy - vx * uy
        if x1 <= x0 or y1 <= y0 or abs(area) < 1e-9:
            continue
        x, y = np.arange(x0, x1) + 0.5 - p[0, 0], (np.arange(y0, y1) + 0.5 - p[0, 1])[:, None]
        b = (x * vy - vx * y) / area
        c = (ux * y - x * uy) / area
        margin = 1.5 / max(np.sqrt(abs(area)), 1) + 0.02  # a little over the border, against gaps
        inside = (b > -margin) & (c > -margin) & (b + c < 1 + margin)
        # Inside its own triangle a texel is final; beyond its border it only fills what is still empty.
        own = (b >= 0) & (c >= 0) & (b + c <= 1)
        write = inside & (own | ~mask[y0:y1, x0:x1])
        corner = values[face]
        # Beyond the border the nearest point of the triangle counts: slivers would extrapolate wildly.
        b, c = np.maximum(b[write], 0)[:, None], np.maximum(c[write], 0)[:, None]
        over = np.maximum(b + c, 1)
        b, c = b / over, c / over
        image[y0:y1, x0:x1][write] = (1 - b - c) * corner[0] + b * corner[1] + c * corner[2]
        mask[y0:y1, x0:x1] |= inside
    return image, mask


def fill(colours: Array, mask: Array) -> Array:
    """(size, size, 3) uint8 from the covered texels' colours (k, 3); the rest takes its nearest neighbour.

    Without it the coarse mip levels would show dark seams.
    """
    image = np.zeros((*mask.shape, 3))
    image[mask] = colours
    row, column = distance_transform_edt(~mask, return_distances=False, return_indices=True)
    return np.clip(np.rint(image[row, column]), 0, 255).astype(np.uint8)


def noise(points: Array, frequency: float, seed: int, name: str, octaves: int = 3) -> Array:
    """Smooth noise in space (n,): random plane waves, about unit variance in its first octave.

    Args:
        points: (n, 3) metres.
        frequency: of the first octave, about cycles per metre.
        seed: of the character.
        name: two names give two independent noises.
        octaves: each with twice the frequency and 0.6 of the strength of the one before.
    """
    rng = generator(seed, "noise", name)
    total = np.zeros(len(points))
    for octave in range(octaves):
        waves = rng.normal(size=(20, 3)) * frequency * 2**octave * np.pi
        phase = rng.uniform(0, 2 * np.pi, 20)
        total += np.cos(points @ waves.T + phase).sum(1) * np.sqrt(2 / 20) * 0.6**octave
    return total


def sample(image: Array, uv: Array) -> Array:
    """Nearest texel of `image` at uv (n, 2)."""
    h, w = image.shape[:2]
    x = np.clip((uv[:, 0] * w).astype(int), 0, w - 1)
    y = np.clip((uv[:, 1] * h).astype(int), 0, h - 1)
    return np.asarray(image[y, x])


def jpeg(image: Array, quality: int) -> Array:
    """RGB image as JPEG bytes (k,) uint8."""
    return np.asarray(cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])[1]).ravel()
