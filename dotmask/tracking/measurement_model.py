"""What an observation measures of a point in the camera frame: h and its Jacobian (paper, Tracking Using EKF, Update).

A measurement model maps a point in the camera frame to what is measured; the camera's pose, which maps the world into
the camera frame, is the same for all of them (see `dotmask.tracking.ekf`).
"""

from dataclasses import dataclass

import numpy as np

from dotmask.records import FloatArray, Intrinsics

NEAREST_M = 0.05
"""A point nearer than this, or behind the camera, is projected as if it were so far: no number is infinite, and its
depth puts it out of every gate."""

_IDENTITY = np.eye(3)


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraPoint:
    """`h(p) = p`, metres: the paper's z, whose errors are those of the back-projected pixel and depth."""

    def measured(self, points_camera: FloatArray) -> FloatArray:
        """`h`: the points (..., 3) themselves."""
        return points_camera

    def jacobian(self, points_camera: FloatArray) -> FloatArray:
        """`dh/dp` (..., 3, 3), the identity."""
        return np.broadcast_to(_IDENTITY, (*points_camera.shape, 3))


CAMERA_POINT = CameraPoint()


@dataclass(frozen=True, slots=True, kw_only=True)
class PixelDepth:
    """`h(p) = (fx x / z + cx, fy y / z + cy, z)`: pixels and metres, as the sensor measures: not linear."""

    intrinsics: Intrinsics

    def measured(self, points_camera: FloatArray) -> FloatArray:
        """`h`: (..., 3) u, v (pixels) and z (metres) of points (..., 3)."""
        camera, z = self.intrinsics, points_camera[..., 2]
        inverse_z = 1.0 / np.maximum(z, NEAREST_M)
        u = camera.fx * points_camera[..., 0] * inverse_z + camera.cx
        v = camera.fy * points_camera[..., 1] * inverse_z + camera.cy
        return np.stack([u, v, z], axis=-1)

    def jacobian(self, points_camera: FloatArray) -> FloatArray:
        """`dh/dp` (..., 3, 3) at points (..., 3)."""
        camera, inverse_z = self.intrinsics, 1.0 / np.maximum(points_camera[..., 2], NEAREST_M)
        J = np.zeros((*points_camera.shape, 3))
        J[..., 0, 0] = camera.fx * inverse_z
        J[..., 1, 1] = camera.fy * inverse_z
        J[..., 0, 2] = -J[..., 0, 0] * points_camera[..., 0] * inverse_z
        J[..., 1, 2] = -J[..., 1, 1] * points_camera[..., 1] * inverse_z
        J[..., 2, 2] = 1.0
        return J
