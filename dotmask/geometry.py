"""Rigid transforms and the pinhole camera. `T_a_b` maps points of b into a."""

from math import atan2, sqrt

import cv2
import numpy as np

from dotmask.records import FloatArray, Intrinsics


def inverse(T_a_b: FloatArray) -> FloatArray:
    """`T_b_a` of a rigid transform (4, 4)."""
    R_b_a = T_a_b[:3, :3].T
    T_b_a = np.empty((4, 4))
    T_b_a[:3, :3] = R_b_a
    T_b_a[:3, 3] = -R_b_a @ T_a_b[:3, 3]
    T_b_a[3] = (0.0, 0.0, 0.0, 1.0)
    return T_b_a


def rotation_from_vector(vector: FloatArray) -> FloatArray:
    """(3, 3) the rotation about the axis along `vector` (3,) by its length, radians."""
    return np.asarray(cv2.Rodrigues(vector)[0])


def vector_from_rotation(R_a_b: FloatArray) -> FloatArray:
    """The inverse of `rotation_from_vector`, for less than half a turn.

    For single rotations: SciPy's `Rotation` takes many times as long for one, and is quick for many.
    """
    (a, b, c), (d, e, f), (g, h, i) = R_a_b.tolist()
    x, y, z = 0.5 * (h - f), 0.5 * (c - g), 0.5 * (d - b)  # the axis times the sine
    sine = sqrt(x * x + y * y + z * z)
    stretch = atan2(sine, 0.5 * (a + e + i - 1.0)) / sine if sine > 0.0 else 1.0
    return np.array([stretch * x, stretch * y, stretch * z])


def transform(T_a_b: FloatArray, points_b: FloatArray) -> FloatArray:
    """Points (N, 3) of frame b in frame a."""
    return np.asarray(points_b @ T_a_b[:3, :3].T + T_a_b[:3, 3])


def back_project(pixels: FloatArray, depth_m: FloatArray, intrinsics: Intrinsics) -> FloatArray:
    """Camera-frame points (N, 3) in metres of pixels (N, 2) `u, v` at z-depths (N,)."""
    x = (pixels[:, 0] - intrinsics.cx) / intrinsics.fx * depth_m
    y = (pixels[:, 1] - intrinsics.cy) / intrinsics.fy * depth_m
    return np.stack([x, y, depth_m], axis=1)


def project(points_camera: FloatArray, intrinsics: Intrinsics) -> FloatArray:
    """Pixels (N, 2) `u, v` of camera-frame points (N, 3); NaN for points at or behind the camera."""
    z = np.where(points_camera[:, 2] > 0, points_camera[:, 2], np.nan)
    u = intrinsics.fx * points_camera[:, 0] / z + intrinsics.cx
    v = intrinsics.fy * points_camera[:, 1] / z + intrinsics.cy
    return np.stack([u, v], axis=1)
