"""Rigid transforms of the simulator. `T_a_b` maps points of b into a; the world has z up, metres."""

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

POSE_GRID = 2.0**-22
"""Poses are rounded to this grid (0.24 micrometres) before rendering, so that a last-bit difference of a sine
between two machines does not reach a pixel."""


def on_grid(matrices: FloatArray) -> FloatArray:
    """`matrices` rounded to POSE_GRID."""
    return np.asarray(np.round(matrices / POSE_GRID) * POSE_GRID)


def rotation_z(angle_rad: float) -> FloatArray:
    """3x3 rotation about z, counter-clockwise seen from above."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def pose(R_a_b: FloatArray, p_a: npt.ArrayLike) -> FloatArray:
    """`T_a_b` (4, 4) from its rotation (3, 3) and the origin of b in a (3,)."""
    T_a_b = np.zeros((4, 4))
    T_a_b[:3, :3] = R_a_b
    T_a_b[:3, 3] = p_a
    T_a_b[3, 3] = 1.0
    return T_a_b


def inverse(T_a_b: FloatArray) -> FloatArray:
    """`T_b_a` of a rigid transform (4, 4)."""
    R_b_a = T_a_b[:3, :3].T
    return pose(R_b_a, -R_b_a @ T_a_b[:3, 3])


def look_at(eye_world: npt.ArrayLike, target_world: npt.ArrayLike) -> FloatArray:
    """`T_world_camera` of an upright camera (x right, y down, z forward) at `eye_world` that faces `target_world`.

    Raises:
        ValueError: the target is the eye, or straight above or below it.
    """
    eye = np.asarray(eye_world, float)
    forward = np.asarray(target_world, float) - eye
    right = np.cross(forward, [0.0, 0.0, 1.0])
    if np.linalg.norm(right) < 1e-9:
        raise ValueError("look_at: the target is the eye, or straight above or below it")
    forward = forward / np.linalg.norm(forward)
    right = right / np.linalg.norm(right)
    return pose(np.stack([right, np.cross(forward, right), forward], axis=1), eye)
