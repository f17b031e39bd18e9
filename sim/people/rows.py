"""A person's posture and place at one moment as a row of numbers, so that whole movements are tables and splines."""

import numpy as np

from sim.geometry import FloatArray, pose, rotation_z
from sim.people import gait
from sim.people.body import Body, Posture

# Columns of a row.
ROOT, YAW, SIZE = slice(0, 2), 2, 3
"""Place on the floor in the world, how far the root frame is turned about z, size of the gait (0 = standing)."""
HIPS, PELVIS, CHEST, HEAD = slice(4, 7), slice(7, 10), slice(10, 13), slice(13, 16)
ARMS, ANKLES, FOOT_YAW, FOOT_PITCH, COLUMNS = slice(16, 24), slice(24, 30), slice(30, 32), slice(32, 34), 34
"""As in `Posture`; per arm: flexion and abduction of the shoulder, flexion and inward turn of the elbow."""

STRAIGHTEST = 0.9985
"""Largest share of the leg's length between hip and ankle: 6° of knee flexion remain."""


def posture_from_row(row: FloatArray) -> Posture:
    """The posture in the root frame."""
    arms = row[ARMS].reshape(2, 4)
    return Posture(
        hips=row[HIPS],
        ankles=row[ANKLES].reshape(2, 3),
        foot_yaw=row[FOOT_YAW],
        foot_pitch=row[FOOT_PITCH],
        pelvis=row[PELVIS],
        chest=row[CHEST],
        head=row[HEAD],
        shoulders=arms[:, :2],
        elbows=arms[:, 2:],
    )


def root_from_row(row: FloatArray) -> FloatArray:
    """`T_world_root` (4, 4)."""
    return pose(rotation_z(row[YAW]), [row[0], row[1], 0.0])


def half_width_m(body: Body, size: FloatArray) -> FloatArray:
    """Half the distance between the feet across the way: as wide as the hips in standing, narrower in walking."""
    hip = abs(float(body.hip_offset[0, 0]))
    return np.asarray(hip * (0.85 - 0.25 * np.minimum(size, 1.0)))


def standing_height_m(body: Body) -> float:
    """Height of the root bone when standing with nearly straight legs."""
    return float(np.min(body.ankle_rest[:, 2] - body.hip_offset[:, 2])) + STRAIGHTEST * body.leg_m


def standing_row(body: Body, position_world: FloatArray, heading_rad: float) -> FloatArray:
    """(COLUMNS,) a person who stands at ease, feet side by side beneath the root: acts on foot begin and end so.

    Args:
        body: of the person.
        position_world: (2,) metres.
        heading_rad: where it faces, from the world's x axis.
    """
    still = np.zeros(1)
    row = np.zeros(COLUMNS)
    row[ROOT] = position_world
    row[YAW] = heading_rad + np.pi / 2  # the body faces the root frame's -y axis
    row[HIPS][:2] = gait.pelvis_shift_m(still, still)[0]
    row[HIPS][2] = standing_height_m(body) - float(gait.mid_stance_drop_m(still)[0])
    row[CHEST], row[HEAD] = gait.chest_angles(still, still)[0], gait.head_angles(still, still)[0]
    row[ARMS] = gait.arm_angles(still, still).reshape(8)
    width = float(half_width_m(body, still)[0])
    row[ANKLES] = [width, 0.0, body.ankle_rest[0, 2], -width, 0.0, body.ankle_rest[1, 2]]
    return row
