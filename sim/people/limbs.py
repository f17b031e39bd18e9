"""Rotations of limbs: about an axis, the shortest turn, part of the way between two."""

from math import acos, atan2, cos, sin, sqrt

import numpy as np

from sim.geometry import FloatArray
from sim.people.kernels import cross, unit


def rotation_about(axis: FloatArray, angle: float) -> FloatArray:
    """Rodrigues' formula about a unit axis."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + sin(angle) * K + (1.0 - cos(angle)) * (K @ K))


def shortest_rotation(a: FloatArray, b: FloatArray) -> FloatArray:
    """The smallest rotation that turns direction a into direction b."""
    a, b = unit(a), unit(b)
    axis = cross(a, b)
    sine = sqrt(axis @ axis)
    return np.eye(3) if sine < 1e-9 else rotation_about(axis / sine, atan2(sine, float(a @ b)))


def between(first: FloatArray, second: FloatArray, share: float) -> FloatArray:
    """The rotation at `share` (0..1) of the way from one to the other, on the shortest arc."""
    turn = second @ first.T
    angle = acos(min(max(0.5 * (float(np.trace(turn)) - 1.0), -1.0), 1.0))
    if angle < 1e-9:
        return second
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / (2.0 * sin(angle))
    return rotation_about(axis, share * angle) @ first


def twist_angle(turn: FloatArray, axis: FloatArray) -> float:
    """How far the rotation `turn` (3, 3) turns about the unit `axis`: its swing-twist decomposition."""
    vector = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    # Half of it over the cosine of the half angle is the quaternion (v, w), up to a common factor.
    return 2.0 * atan2(float(vector @ axis), 1.0 + float(np.trace(turn)))
