"""Normal human gait as functions of the step phase, and how stride and cadence follow from the speed.

The phase counts steps: at an even number the right heel strikes, at an odd number the left one. A gait cycle is two
steps; in percent of it a foot is on the floor from 0 to 62.

Sources of the characteristic values. Phases (loading response until 12 %, mid stance until 31 %, terminal stance until
50 %, pre-swing until 62 %), and the angles of the joints (knee about 20° in loading response and 60° in swing, hip from
about 30° of flexion to 10° of extension, ankle between about 10° of dorsiflexion and 20° of plantar flexion): Perry and
Burnfield, Gait Analysis: Normal and Pathological Function, 2nd ed., 2010; Winter, Biomechanics and Motor Control of
Human Movement, 4th ed., 2009. Change with speed: Pietraszewski et al., Acta of Bioengineering and Biomechanics 14(3),
2012. Constant ratio of step length to cadence: Sekiya and Nagasaki, Gait and Posture 7, 1998.

The knots below are NOT copied from a table of these works. They were chosen so that the feet, from which the legs
follow by inverse kinematics, give joint angles of the published shape; the tests compare the angles that come out with
the characteristic values above.
"""

import numpy as np
from scipy.interpolate import PchipInterpolator

from sim.geometry import FloatArray

STANCE_STEPS = 1.24
"""How long a foot is on the floor, in steps: 62 % of the cycle."""

WALK_RATIO_M_MIN = 0.0065
"""Step length divided by steps per minute, for a leg (hip to ankle, straight) of REFERENCE_LEG_M."""

REFERENCE_LEG_M = 0.86
REFERENCE_SPEED_M_S = 1.25
"""The speed at which the amplitude of all curves is 1."""

SPEED_RANGE_M_S = (0.4, 2.0)

RAMPS = (0.30, 0.22)
"""Shares of the swing in which a foot gains and loses its speed."""

LIFT_SHARE = 0.13
"""Share of the swing in which a foot rises to its clearance, and comes down."""

_FOOT_PITCH = (
    (0.0, 3.0, 6.5, 10.0, 33.0, 42.0, 50.0, 57.0, 62.0, 66.0, 72.0, 79.0, 86.0, 92.0, 97.0, 100.0),
    (20.0, 13.0, 4.0, 0.0, 0.0, -5.0, -17.0, -37.0, -55.0, -61.0, -50.0, -25.0, -4.0, 11.0, 19.0, 20.0),
)
_pitch_curve = PchipInterpolator(np.array(_FOOT_PITCH[0]) / 50.0, np.radians(_FOOT_PITCH[1]))


def step_rate_hz(speed_m_s: FloatArray, leg_m: float) -> FloatArray:
    """Steps per second at a speed: the constant walk ratio, scaled by leg length."""
    return np.asarray(np.sqrt(speed_m_s / (60.0 * WALK_RATIO_M_MIN * leg_m / REFERENCE_LEG_M)))


def amplitude(speed_m_s: FloatArray) -> FloatArray:
    """Size of all movements: 0 when standing, 1 at REFERENCE_SPEED_M_S, about as step length grows with speed."""
    return 1.6 * speed_m_s / (speed_m_s + 0.6 * REFERENCE_SPEED_M_S)


def foot_pitch(since_strike: FloatArray, size: FloatArray) -> FloatArray:
    """Angle of a foot to the floor, toes up positive, `since_strike` in [0, 2) steps after its heel strike."""
    return np.asarray(size * _pitch_curve(since_strike))


def _swing_share(since_strike: FloatArray) -> FloatArray:
    """0 on the floor, then 0 to 1 over the swing."""
    return np.asarray(np.clip((since_strike - STANCE_STEPS) / (2.0 - STANCE_STEPS), 0.0, 1.0))


def swing_progress(since_strike: FloatArray) -> FloatArray:
    """How far a foot has gone from one print to the next: 0 on the floor, then 0 to 1.

    The speed rises and falls as a raised cosine over RAMPS of the swing and is constant in between.
    """
    w = _swing_share(since_strike)
    start, end = RAMPS
    k, m = np.pi / start, np.pi / end
    rising, falling = np.minimum(w, start), np.clip(w - 1.0 + end, 0.0, end)
    risen = 0.5 * (rising - np.sin(k * rising) / k)
    fallen = 0.5 * (falling + np.sin(m * falling) / m)
    steady = np.clip(w, start, 1.0 - end) - start
    return np.asarray((risen + steady + fallen) / (1.0 - 0.5 * (start + end)))


def swing_clearance_m(since_strike: FloatArray, size: FloatArray) -> FloatArray:
    """Height of the lowest point of the sole over the floor: 0 on the floor, soft ends, about 2 cm in mid swing.

    The foot is lifted before it goes far and comes down after it has nearly stopped, so that it does not scrape.
    """
    w = _swing_share(since_strike)
    up = np.minimum(1.0, np.minimum(w, 1.0 - w) / LIFT_SHARE)
    return np.asarray((0.020 + 0.009 * size) * up * up * (3.0 - 2.0 * up))


def pelvis_angles(phase: FloatArray, size: FloatArray) -> FloatArray:
    """(n, 3) yaw, list and tilt: the leading side goes forward, the swinging side drops."""
    yaw = 4.5 * size * np.cos(np.pi * phase)
    lean = 3.5 * size * np.sin(np.pi * phase - 0.2)
    return np.radians(np.stack([yaw, lean, 2.0 * size], axis=-1))


def pelvis_shift_m(phase: FloatArray, size: FloatArray) -> FloatArray:
    """(n, 2) metres to the left and backwards: towards the carrying foot, and a little ahead of the ankles."""
    left = -0.018 * np.minimum(size, 1.0) * np.sin(np.pi * (phase - 0.12))
    return np.stack([left, np.full_like(left, -0.015)], axis=-1)


def mid_stance_drop_m(size: FloatArray) -> FloatArray:
    """How much lower than standing the hips stay over the carrying leg, whose knee is flexed then."""
    return np.asarray(0.004 + 0.010 * size)


def chest_angles(phase: FloatArray, size: FloatArray) -> FloatArray:
    """(n, 3) yaw, list and tilt: the chest turns against the pelvis and stays nearly level."""
    yaw = -4.0 * size * np.cos(np.pi * phase)
    lean = -0.8 * size * np.sin(np.pi * phase - 0.2)
    return np.radians(np.stack([yaw, lean, 1.0 + 2.0 * size], axis=-1))


def head_angles(phase: FloatArray, size: FloatArray) -> FloatArray:
    """(n, 3) yaw, list and tilt: the eyes stay ahead."""
    yaw = -0.8 * size * np.cos(np.pi * phase)
    return np.radians(np.stack([yaw, 0.0 * yaw, 1.0 + 0.0 * yaw], axis=-1))


def arm_angles(phase: FloatArray, size: FloatArray) -> FloatArray:
    """(n, 2, 4) of the left and right arm: flexion and abduction of the shoulder, flexion and inward turn of the elbow.

    Each arm swings with the opposite leg, a little behind it.
    """
    left_ahead = np.cos(np.pi * phase - 0.25)
    arms = []
    for ahead in (left_ahead, -left_ahead):
        shoulder = 1.0 + size * (19.0 * ahead - 2.0)
        elbow = 12.0 + size * (7.0 + 8.0 * ahead)
        arms.append(np.stack([shoulder, 5.0 + 0.0 * size, elbow, 2.0 + 0.0 * size], axis=-1))
    return np.radians(np.stack(arms, axis=-2))
