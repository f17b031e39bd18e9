"""Unit quaternions (x, y, z, w) of rotations: interpolation and conversion."""

import math

import numpy as np

from sim.geometry import FloatArray


def slerp(first_xyzw: FloatArray, second_xyzw: FloatArray, part: float) -> FloatArray:
    """The rotation at `part` (0..1) of the shorter way from the first (4,) to the second; constant rotation speed."""
    cosine = float(np.sum(first_xyzw * second_xyzw))
    if cosine < 0:
        second_xyzw, cosine = -second_xyzw, -cosine
    if cosine > 1 - 1e-10:  # less than 30 microradians apart: the chord is the arc
        mixed = first_xyzw + part * (second_xyzw - first_xyzw)
    else:
        angle = math.acos(cosine)
        mixed = math.sin((1 - part) * angle) * first_xyzw + math.sin(part * angle) * second_xyzw
    return np.asarray(mixed / math.sqrt(float(np.sum(mixed**2))))


def rotation_from_quaternion(q_a_b_xyzw: FloatArray) -> FloatArray:
    """`R_a_b` (3, 3) of a unit quaternion (4,)."""
    x, y, z, w = (float(value) for value in q_a_b_xyzw)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
