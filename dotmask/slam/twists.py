"""Twists: small motions as six numbers, rotation in radians before translation in metres."""

import numpy as np

from dotmask.geometry import inverse, rotation_from_vector, vector_from_rotation
from dotmask.records import FloatArray


def exp(twist: FloatArray) -> FloatArray:
    """The rigid transform (4, 4) of a twist (6,)."""
    w, t = twist[:3], twist[3:]
    T = np.eye(4)
    T[:3, :3] = rotation_from_vector(w)
    T[:3, 3] = _left_jacobian(w) @ t
    return T


def log(T_a_b: FloatArray) -> FloatArray:
    """The twist (6,) of a rigid transform (4, 4) that turns by less than half a turn."""
    w = vector_from_rotation(T_a_b[:3, :3])
    return np.concatenate([w, np.linalg.solve(_left_jacobian(w), T_a_b[:3, 3])])


def halfway(T_a_b: FloatArray, other_T_a_b: FloatArray) -> FloatArray:
    """The transform (4, 4) in the middle of two."""
    return np.asarray(T_a_b @ exp(0.5 * log(inverse(T_a_b) @ other_T_a_b)))


def adjoint(T_a_b: FloatArray) -> FloatArray:
    """(6, 6) that takes a twist in the frame of b to the same motion in the frame of a."""
    R = T_a_b[:3, :3]
    A = np.zeros((6, 6))
    A[:3, :3] = A[3:, 3:] = R
    A[3:, :3] = cross(T_a_b[:3, 3]) @ R
    return A


def cross(vectors: FloatArray) -> FloatArray:
    """(..., 3, 3) matrices of the products `vector x ...` of vectors (..., 3)."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    return np.stack([np.stack([zero, -z, y], -1), np.stack([z, zero, -x], -1), np.stack([-y, x, zero], -1)], axis=-2)


def _left_jacobian(w: FloatArray) -> FloatArray:
    """(3, 3) how the translation of a twist turns with its rotation (Barfoot, State Estimation for Robotics, 7.1)."""
    angle = float(np.linalg.norm(w))
    W = cross(w)
    if angle < 1e-6:
        return np.asarray(np.eye(3) + 0.5 * W)
    first = (1 - np.cos(angle)) / angle**2
    second = (angle - np.sin(angle)) / angle**3
    return np.asarray(np.eye(3) + first * W + second * (W @ W))
