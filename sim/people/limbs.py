"""Rotations of limbs: frames along a limb, the shortest turn, two-bone inverse kinematics."""

from math import acos, atan2, cos, sin, sqrt

import numpy as np

from sim.geometry import FloatArray


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross product of two (3,) vectors; np.cross takes ten times as long for one pair."""
    ax, ay, az = a.tolist()
    bx, by, bz = b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def unit(a: FloatArray) -> FloatArray:
    """(3,) of length 1."""
    return np.asarray(a / sqrt(a @ a))


def limb_frame(along: FloatArray, hinge: FloatArray) -> FloatArray:
    """3x3 with columns: the limb's direction, its hinge axis near `hinge`, their cross product."""
    x = unit(along)
    y = unit(hinge - (hinge @ x) * x)
    return np.array([x, y, cross(x, y)]).T


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


def two_bones(reach: FloatArray, upper_m: float, lower_m: float, bend: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where a limb of two bones bends to span `reach`, and where it ends.

    Args:
        reach: (3,) from its start to its wanted end.
        upper_m: length of the first bone.
        lower_m: length of the second bone.
        bend: (3,) unit vector across `reach`, to which the middle joint goes.

    Returns:
        (3,) the middle joint and (3,) the end, from the start. A reach that is too long gives a straight limb.
    """
    length = sqrt(reach @ reach)
    distance = min(max(length, abs(upper_m - lower_m) + 1e-6), upper_m + lower_m - 1e-9)
    along = reach / length
    share = (upper_m * upper_m - lower_m * lower_m + distance * distance) / (2.0 * distance)
    return share * along + sqrt(max(upper_m * upper_m - share * share, 0.0)) * bend, distance * along
