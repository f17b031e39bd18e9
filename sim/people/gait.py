"""Normal human gait as functions of the step phase, and how stride and cadence follow from the speed.

The phase counts steps: at an even number the right heel strikes, at an odd number the left one. A gait cycle is two
steps; in percent of it a foot is on the floor from 0 to 62.

Sources. The angle of the feet over the cycle, and how step length and cadence grow with speed: Koopman et al. 2014,
tables 2 to 5, see `sim.people.reference_gait`. Phases (loading response until 12 %, mid stance until 31 %, terminal
stance until 50 %, pre-swing until 62 %): Perry and Burnfield, Gait Analysis: Normal and Pathological Function, 2nd ed.,
2010. Length of the leg as a share of the body height: Winter, Biomechanics and Motor Control of Human Movement, 4th
ed., 2009, figure 4.1.

Hips and knees follow from the feet by inverse kinematics; the tests compare the angles that come out with the curves of
Koopman et al. The other curves (pelvis, trunk, arms, swing of the feet) are NOT copied from a table: their sizes were
chosen.
"""

import numpy as np
from scipy.interpolate import PchipInterpolator

from sim.geometry import FloatArray
from sim.people.reference_gait import joint_angles, step_ratio

STANCE_STEPS = 1.24
"""How long a foot is on the floor, in steps: 62 % of the cycle."""

LEG_SHARE = 0.530 - 0.039
"""Hip to ankle of a straight leg, as a share of the body height."""

REFERENCE_SPEED_M_S = 1.25
REFERENCE_HEIGHT_M = 1.75
"""The speed and the body height at which the amplitude of all curves is 1."""

SPEED_RANGE_M_S = (0.4, 2.0)

RAMPS = (0.30, 0.22)
"""Shares of the swing in which a foot gains and loses its speed."""

LIFT_SHARE = 0.13
"""Share of the swing in which a foot rises to its clearance, and comes down."""

FLAT_PERCENT = (10.0, 34.0)
"""Part of the cycle in which the foot stands flat."""

_TOE_OFF_PERCENT = 66.0
"""When the subjects of Koopman et al. lift their toes; people on a treadmill are on both feet for longer."""


def _pitch_knots() -> tuple[FloatArray, FloatArray]:
    """Percent of the cycle and degrees, at REFERENCE_SPEED_M_S and REFERENCE_HEIGHT_M.

    The angle of the foot to the floor follows from the joints: hip - knee + ankle. Stance and swing are stretched each
    so that toe-off is at the end of STANCE_STEPS. The zero is where the foot stands flat; since the published angles
    are means over people, it drifts by some degrees there, and drifts back until the next heel strike.
    """
    percent, toe_off = np.arange(0.0, 101.0, 2.0), 50.0 * STANCE_STEPS
    theirs = np.interp(percent, [0.0, toe_off, 100.0], [0.0, _TOE_OFF_PERCENT, 100.0])
    hip, knee, ankle = joint_angles(REFERENCE_SPEED_M_S, REFERENCE_HEIGHT_M, theirs)
    pitch = hip - knee + ankle
    start, end = FLAT_PERCENT
    first, last = pitch[percent == start][0], pitch[percent == end][0]
    zero = np.interp(percent, [0.0, start, end, 100.0], [first, first, last, first])
    return percent, np.where((percent >= start) & (percent <= end), 0.0, pitch - zero)


_percent, _pitch_deg = _pitch_knots()
_pitch_curve = PchipInterpolator(_percent / 50.0, np.radians(_pitch_deg))


def step_rate_hz(speed_m_s: FloatArray, leg_m: float) -> FloatArray:
    """(...) steps per second at a speed, for a leg (hip to ankle, straight) of `leg_m`."""
    return np.asarray(np.sqrt(speed_m_s / step_ratio(speed_m_s, leg_m / LEG_SHARE)))


def amplitude(speed_m_s: FloatArray) -> FloatArray:
    """Size of all movements: 0 when standing, 1 at REFERENCE_SPEED_M_S.

    Between 0.4 and 1.4 m/s this is within 0.1 of how the greatest angles of the foot grow in Koopman et al.
    """
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
