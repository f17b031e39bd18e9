"""From a posture to the matrices of all bones. Compiled by numba: of arrays this small, NumPy's calls are the cost.

Loops over elements, and not whole arrays: those take seconds to compile.
"""

# mypy: ignore-errors
# (numba infers the types of these functions from their arguments; numpy's own annotations do not describe them)

from math import cos, radians, sin, sqrt, tanh

import numpy as np
from numba import njit

KERNEL = {"cache": True, "error_model": "numpy"}

TOE_BEND_RAD = radians(30.0)
"""How far the toes bend up at most when the heel rises."""

HIPS, PELVIS, CHEST, HEAD, SHOULDERS, ELBOWS, ANKLES, FOOT_YAW, FOOT_PITCH, SIZE = 0, 3, 6, 9, 12, 16, 20, 26, 28, 30
"""Where the arrays of a `Posture` begin, one after another, and how many numbers they are."""
WITH_CHEST, PELVIS_TO_CHEST, CHEST_TO_HEAD = 0, 1, 2
"""How a bone turns that belongs to no limb."""
ARM, FORE_ARM, THIGH, SHIN, FOOT, TOES = 0, 1, 2, 3, 4, 5
"""Bones of a side that turn on their own."""


@njit(**KERNEL)
def spline_at(x, c, t):
    """(D,) value at `t`, between the first and the last of `x`, of a SciPy `PPoly` with these `x` and `c` (K, N, D)."""
    piece = min(max(np.searchsorted(x, t, side="right") - 1, 0), len(x) - 2)
    value, power = np.zeros(c.shape[2]), 1.0
    for k in range(len(c) - 1, -1, -1):
        for d in range(len(value)):
            value[d] += c[k, piece, d] * power
        power *= t - x[piece]
    return value


@njit(**KERNEL)
def toe_pitch(foot_pitch):
    """Pitch of the toes: they stay on the floor while the heel rises, until they cannot bend further."""
    return foot_pitch - TOE_BEND_RAD * tanh(min(foot_pitch, 0.0) / TOE_BEND_RAD)


@njit(**KERNEL)
def rotation(yaw, lean, tilt):
    """(3, 3) a turn by `yaw` about z, after a list about y, after a tilt about x; scalars."""
    cz, sz, cy, sy, cx, sx = cos(yaw), sin(yaw), cos(lean), sin(lean), cos(tilt), sin(tilt)
    R = np.empty((3, 3))
    R[0, 0], R[0, 1], R[0, 2] = cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx
    R[1, 0], R[1, 1], R[1, 2] = sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx
    R[2, 0], R[2, 1], R[2, 2] = -sy, cy * sx, cy * cx
    return R


@njit(**KERNEL)
def product(A, B):
    """(3, 3) A @ B, with a sum in a fixed order."""
    C = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            C[i, j] = A[i, 0] * B[0, j] + A[i, 1] * B[1, j] + A[i, 2] * B[2, j]
    return C


@njit(**KERNEL)
def dot(a, b):
    """A @ b of (3,), with a sum in a fixed order."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(**KERNEL)
def cross(a, b):
    """Cross product of two (3,) vectors."""
    c = np.empty(3)
    c[0], c[1], c[2] = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    return c


@njit(**KERNEL)
def unit(a):
    """(3,) of length 1."""
    length, b = sqrt(dot(a, a)), np.empty(3)
    for i in range(3):
        b[i] = a[i] / length
    return b


@njit(**KERNEL)
def limb_frame(along, hinge):
    """(3, 3) with columns: the limb's direction, its hinge axis near `hinge`, their cross product."""
    x, y = unit(along), np.empty(3)
    for i in range(3):
        y[i] = hinge[i] - dot(hinge, x) * x[i]
    y = unit(y)
    z, frame = cross(x, y), np.empty((3, 3))
    for i in range(3):
        frame[i, 0], frame[i, 1], frame[i, 2] = x[i], y[i], z[i]
    return frame


@njit(**KERNEL)
def two_bones(reach, upper_m, lower_m, bend):
    """Where a limb of two bones bends to span `reach`, and where it ends.

    Args:
        reach: (3,) from its start to its wanted end.
        upper_m: length of the first bone.
        lower_m: length of the second bone.
        bend: (3,) unit vector across `reach`, to which the middle joint goes.

    Returns:
        (3,) the middle joint and (3,) the end, from the start. A reach that is too long gives a straight limb.
    """
    length = sqrt(dot(reach, reach))
    distance = min(max(length, abs(upper_m - lower_m) + 1e-6), upper_m + lower_m - 1e-9)
    share = (upper_m * upper_m - lower_m * lower_m + distance * distance) / (2.0 * distance)
    across = sqrt(max(upper_m * upper_m - share * share, 0.0))
    middle, end = np.empty(3), np.empty(3)
    for i in range(3):
        middle[i] = share * (reach[i] / length) + across * bend[i]
        end[i] = distance * (reach[i] / length)
    return middle, end


@njit(**KERNEL)
def put(A, matrices, number):
    """Store A (3, 3) as `matrices[number]`."""
    for i in range(3):
        for j in range(3):
            matrices[number, i, j] = A[i, j]


@njit(**KERNEL)
def turned_bones(
    posture, follows, shares, limbs, hands, arms_down, hip_offsets, thigh_m, shin_m, thigh_frames, shin_frames, splay
):
    """(B, 3, 3) how far each bone has turned from rest, with the arms at their angles.

    Args:
        posture: (SIZE,) see `sim.people.body.Posture`.
        follows: (B,) `WITH_CHEST`, `PELVIS_TO_CHEST` or `CHEST_TO_HEAD`.
        shares: (B,) how far of the way from the one to the other.
        limbs: (2, 6) bones of the left and the right side, from `ARM` to `TOES`.
        hands: (2, K) all bones of the hand.
        arms_down: (2, 2, 3, 3) of upper arm and forearm, from rest to hanging beside the body.
        hip_offsets: (2, 3) metres, from the root bone to the hip joints.
        thigh_m: (2,) length.
        shin_m: (2,) length.
        thigh_frames: (2, 3, 3) inverse of the `limb_frame` at rest.
        shin_frames: (2, 3, 3) the same of the shin.
        splay: (2,) yaw of the feet at rest.
    """
    R_pelvis = rotation(posture[PELVIS], posture[PELVIS + 1], posture[PELVIS + 2])
    R_chest = rotation(posture[CHEST], posture[CHEST + 1], posture[CHEST + 2])
    R, angles = np.empty((len(follows), 3, 3)), np.empty(3)
    for bone in range(len(follows)):
        if follows[bone] == WITH_CHEST:
            put(R_chest, R, bone)
            continue
        first, second = (PELVIS, CHEST) if follows[bone] == PELVIS_TO_CHEST else (CHEST, HEAD)
        for i in range(3):
            angles[i] = posture[first + i] + shares[bone] * (posture[second + i] - posture[first + i])
        put(rotation(angles[0], angles[1], angles[2]), R, bone)
    for side in range(2):
        outward = 1.0 - 2.0 * side
        flexion, abduction = posture[SHOULDERS + 2 * side], posture[SHOULDERS + 2 * side + 1]
        elbow, inward = posture[ELBOWS + 2 * side], posture[ELBOWS + 2 * side + 1]
        R_shoulder = product(R_chest, rotation(0.0, -outward * abduction, -flexion))
        R_elbow = product(R_shoulder, rotation(-outward * inward, 0.0, -elbow))
        put(product(R_shoulder, arms_down[side, 0]), R, limbs[side, ARM])
        R_fore = product(R_elbow, arms_down[side, 1])
        put(R_fore, R, limbs[side, FORE_ARM])
        for k in range(hands.shape[1]):
            put(R_fore, R, hands[side, k])

        # The leg: two-bone inverse kinematics, knee ahead. A posture out of reach is a fault of whoever made it; the
        # leg is then straight and points at the ankle.
        yaw, pitch = posture[FOOT_YAW + side], posture[FOOT_PITCH + side]
        reach, ahead, shin = np.empty(3), np.zeros(3), np.empty(3)
        for i in range(3):
            reach[i] = posture[ANKLES + 3 * side + i] - (posture[HIPS + i] + dot(R_pelvis[i], hip_offsets[side]))
        along, knee_yaw = unit(reach), 0.5 * (posture[PELVIS] + yaw)
        ahead[0], ahead[1] = sin(knee_yaw), -cos(knee_yaw)
        left = unit(cross(ahead, along))
        knee, end = two_bones(reach, thigh_m[side], shin_m[side], cross(along, left))
        for i in range(3):
            shin[i] = end[i] - knee[i]
        put(product(limb_frame(knee, left), thigh_frames[side]), R, limbs[side, THIGH])
        put(product(limb_frame(shin, left), shin_frames[side]), R, limbs[side, SHIN])
        put(foot_rotation(splay[side], yaw, pitch), R, limbs[side, FOOT])
        put(foot_rotation(splay[side], yaw, toe_pitch(pitch)), R, limbs[side, TOES])
    return R


@njit(**KERNEL)
def foot_rotation(splay, yaw, pitch):
    """(3, 3) of a foot (or its toes) that turns by `yaw` and pitches about its own cross axis; `splay` is at rest."""
    return product(rotation(yaw + splay, 0.0, -pitch), rotation(-splay, 0.0, 0.0))


@njit(**KERNEL)
def forward_kinematics(parents, heads, R_body_rest, root_body):
    """Skinning matrices (B, 4, 4) of turned bones, see `sim.people.skeleton.Skeleton.palette`."""
    matrices = np.zeros((len(parents), 4, 4))
    places, step = np.empty((len(parents), 3)), np.empty(3)
    for bone in range(len(parents)):
        R, parent = R_body_rest[bone], parents[bone]
        for i in range(3):
            step[i] = heads[bone, i] - heads[parent, i]
        for i in range(3):
            places[bone, i] = places[parent, i] + dot(R_body_rest[parent, i], step) if bone > 0 else root_body[i]
            for j in range(3):
                matrices[bone, i, j] = R[i, j]
            matrices[bone, i, 3] = places[bone, i] - dot(R[i], heads[bone])
        matrices[bone, 3, 3] = 1.0
    return matrices
