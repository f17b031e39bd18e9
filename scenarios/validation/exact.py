"""Shapes whose images and ideal observations are known in closed form: a plate that faces the camera, and a sphere.

An ideal observation is what an estimator of `dotmask.tracking.measurement` gives at infinite resolution without noise.
Here it comes from integrals over the silhouette and not from pixels, so it is a second implementation.
"""

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from dotmask.records import FloatArray, Intrinsics
from sim.records import RenderedImages

Statistic = Literal["box", "mask"]
"""What is measured: the box's centre with the mean depth, or the mask's centroid with the median depth."""

CAMERA = Intrinsics(width=640, height=480, fx=535.4, fy=539.2, cx=320.1, cy=247.6)
"""The fr3 camera of the TUM benchmark."""

_RINGS, _SPOKES = 100, 16


class Shape(Protocol):
    """A rigid shape, known by its place in the camera frame."""

    def ideal(self, place_camera: FloatArray, statistic: Statistic) -> FloatArray:
        """(3,) the ideal observation, metres, of the shape at `place_camera` (3,)."""
        ...

    def extent(self, place_camera: FloatArray) -> tuple[float, float, float, float]:
        """u_min, v_min, u_max, v_max of the silhouette: exact, not on the pixel grid."""
        ...

    def render(self, place_camera: FloatArray, window: Intrinsics) -> RenderedImages:
        """Perfect images of the shape before nothing."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Plate:
    """A rectangle that always faces the camera: its depth is the same everywhere.

    Attributes:
        width_m, height_m: of the rectangle.
        turn_rad: about the camera's axis; at 0 the sides lie along rows and columns.
    """

    width_m: float
    height_m: float
    turn_rad: float = 0.0

    def ideal(self, place_camera: FloatArray, statistic: Statistic) -> FloatArray:
        """See Shape: its own centre, whatever the statistic."""
        return place_camera

    def extent(self, place_camera: FloatArray) -> tuple[float, float, float, float]:
        """See Shape: by the corners."""
        x, y, z = (float(value) for value in place_camera)
        c, s = abs(np.cos(self.turn_rad)), abs(np.sin(self.turn_rad))
        w = 0.5 * float(c * self.width_m + s * self.height_m)
        h = 0.5 * float(s * self.width_m + c * self.height_m)
        (u_min, u_max), (v_min, v_max) = (
            (f * (a - half) / z + centre, f * (a + half) / z + centre)
            for f, a, half, centre in ((CAMERA.fx, x, w, CAMERA.cx), (CAMERA.fy, y, h, CAMERA.cy))
        )
        return u_min, v_min, u_max, v_max

    def render(self, place_camera: FloatArray, window: Intrinsics) -> RenderedImages:
        """See Shape."""
        ray_x, ray_y = _rays(window)
        x, y, z = place_camera
        c, s = np.cos(self.turn_rad), np.sin(self.turn_rad)
        across, down = ray_x * z - x, ray_y * z - y
        is_within = np.abs(c * across + s * down) <= 0.5 * self.width_m
        inside = is_within & (np.abs(c * down - s * across) <= 0.5 * self.height_m)
        normals = np.zeros((*inside.shape, 3), np.float32)
        normals[inside] = 0.0, 0.0, -1.0
        return _images(np.where(inside, z, 0.0), normals)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sphere:
    """A ball."""

    radius_m: float

    def ideal(self, place_camera: FloatArray, statistic: Statistic) -> FloatArray:
        """See Shape: by a sum over the cone of rays that meet the sphere, weighted by their area in the image."""
        distance = float(np.linalg.norm(place_camera))
        axis = place_camera / distance
        across = np.cross(axis, (0.0, 1.0, 0.0))
        across /= np.linalg.norm(across)
        # share = (sin of the angle from the axis / sin of the cone's half angle)², by rings of one area.
        share = (np.arange(_RINGS) + 0.5) / _RINGS
        sine = np.sqrt(share) * self.radius_m / distance
        cosine = np.sqrt(1.0 - sine**2)
        turn = (np.arange(_SPOKES) + 0.5) * (2 * np.pi / _SPOKES)
        around = np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * np.cross(axis, across)
        rays = cosine[:, None, None] * axis + sine[:, None, None] * around
        length = distance * cosine - self.radius_m * np.sqrt(1.0 - share)
        depth = (length[:, None] * rays[..., 2]).ravel()
        # A solid angle covers 1 / z³ of the image plane, and a ring of one `share` 1 / cosine of solid angle.
        weight = ((1.0 / cosine)[:, None] / rays[..., 2] ** 3).ravel()
        weight /= weight.sum()
        if statistic == "box":
            u_min, v_min, u_max, v_max = self.extent(place_camera)
            z = float(weight @ depth)
            u, v = 0.5 * (u_min + u_max), 0.5 * (v_min + v_max)
            return np.array([(u - CAMERA.cx) / CAMERA.fx * z, (v - CAMERA.cy) / CAMERA.fy * z, z])
        order = np.argsort(depth, kind="stable")
        reached = np.cumsum(weight[order]) - 0.5 * weight[order]
        z = float(np.interp(0.5, reached, depth[order]))
        flat = (rays[..., :2] / rays[..., 2:]).reshape(-1, 2)
        return np.array([*(weight @ flat) * z, z])

    def extent(self, place_camera: FloatArray) -> tuple[float, float, float, float]:
        """See Shape: by the tangents in the planes of x and z, and of y and z."""
        x, y, z = (float(value) for value in place_camera)
        sides = []
        for a, f, c in ((x, CAMERA.fx, CAMERA.cx), (y, CAMERA.fy, CAMERA.cy)):
            middle, half = np.arctan2(a, z), np.arcsin(self.radius_m / np.hypot(a, z))
            sides.append((float(f * np.tan(middle - half) + c), float(f * np.tan(middle + half) + c)))
        (u_min, u_max), (v_min, v_max) = sides
        return u_min, v_min, u_max, v_max

    def render(self, place_camera: FloatArray, window: Intrinsics) -> RenderedImages:
        """See Shape."""
        ray_x, ray_y = _rays(window)
        x, y, z = place_camera
        squared = ray_x**2 + ray_y**2 + 1.0
        along = ray_x * x + ray_y * y + z
        rest = along**2 - squared * (place_camera @ place_camera - self.radius_m**2)
        inside = rest >= 0
        depth = np.where(inside, (along - np.sqrt(np.maximum(rest, 0.0))) / squared, 0.0)
        points = np.stack([ray_x * depth, np.broadcast_to(ray_y, depth.shape) * depth, depth], axis=-1)
        normals = np.where(inside[..., None], (points - place_camera) / self.radius_m, 0.0)
        return _images(depth, normals.astype(np.float32))


def placed(shape: Shape, ideal_camera: FloatArray, statistic: Statistic) -> FloatArray:
    """(3,) where `shape` must be, camera frame, for its ideal observation to be `ideal_camera` (3,)."""
    place = ideal_camera
    for _ in range(4):  # the offset hardly depends on the place: each round gains a digit or more
        place = place + ideal_camera - shape.ideal(place, statistic)
    return place


def window_around(shape: Shape, place_camera: FloatArray, margin_px: int = 12) -> Intrinsics:
    """The part of the image around the silhouette, as a camera of its own, with pixels on the same grid.

    It may reach over the border of the image: nothing cuts the silhouette.
    """
    u_min, v_min, u_max, v_max = shape.extent(place_camera)
    u0, v0 = int(np.floor(u_min)) - margin_px, int(np.floor(v_min)) - margin_px
    return Intrinsics(
        width=int(np.ceil(u_max)) + margin_px - u0 + 1,
        height=int(np.ceil(v_max)) + margin_px - v0 + 1,
        fx=CAMERA.fx,
        fy=CAMERA.fy,
        cx=CAMERA.cx - u0,
        cy=CAMERA.cy - v0,
    )


def _rays(window: Intrinsics) -> tuple[FloatArray, FloatArray]:
    """(1, W) and (H, 1): x and y of the rays through the pixel centres, at z = 1."""
    ray_x = (np.arange(window.width, dtype=np.float64) - window.cx) / window.fx
    ray_y = (np.arange(window.height, dtype=np.float64) - window.cy) / window.fy
    return ray_x[None, :], ray_y[:, None]


def _images(depth_m: FloatArray, normals: np.ndarray[tuple[int, ...], np.dtype[np.float32]]) -> RenderedImages:
    return RenderedImages(
        rgb=np.zeros((*depth_m.shape, 3), np.uint8),
        depth_m=depth_m.astype(np.float32),
        instance_ids=(depth_m > 0).astype(np.uint16),
        normals_camera=normals,
    )
