"""Joint angles of healthy people who walk, at any speed: the regression of Koopman and colleagues.

Koopman, van Asseldonk and van der Kooij, Speed-dependent reference joint trajectory generation for robotic gait
support, Journal of Biomechanics 47 (2014) 1447-1458, doi 10.1016/j.jbiomech.2014.01.037. Fifteen subjects walked on a
treadmill at 0.5 to 5 km/h. Six key events per joint lie on its curve; their time, angle, angular velocity and
acceleration are regressed on speed and body height (table 2 hip, table 3 knee, table 4 ankle), and fifth-order
polynomials join them. Step length divided by step frequency is in table 5, equation 3.

The coefficients were taken from a public transcription of these tables, not from the printed page. Two cells are empty
in it and stand for 0: the square of the speed for the velocity at the last event of the knee, and the body height for
the time of the second event of the ankle.
"""

from dataclasses import dataclass

import numpy as np

from sim.geometry import FloatArray

SPEED_RANGE_M_S = (0.5 / 3.6, 5.0 / 3.6)
"""Speeds at which the subjects walked; outside the curves are those of the nearest one."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Table:
    """Regressions (6, 4) on 1, speed in km/h, its square, body height in metres: one row per key event.

    Attributes:
        percent: when, in percent of the gait cycle.
        angle: degrees, flexion positive.
        velocity: degrees per percent.
        acceleration: degrees per percent squared.
    """

    percent: FloatArray
    angle: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


_ZERO = (0.0, 0.0, 0.0, 0.0)
_HIP = _Table(
    percent=np.array(
        [
            _ZERO,
            (-10.809, 0.0, 0.0, 11.762),
            (24.512, -2.021, 0.195, 5.109),
            (48.879, -3.854, 0.355, 9.891),
            (80.562, -6.432, 0.885, 0.0),
            (94.280, -0.601, 0.0, 0.0),
        ]
    ),
    angle=np.array(
        [
            (20.354, 1.934, 0.0, 0.0),
            (18.917, 2.583, 0.0, 0.0),
            (4.845, 1.718, 0.0, 0.0),
            (-2.026, -2.090, 0.0, 0.0),
            (20.030, 0.0, 0.0, -7.732),
            (21.447, 2.318, 0.0, 0.0),
        ]
    ),
    velocity=np.array(
        [(-2.062, 0.0, 0.0, 1.112), _ZERO, (-0.240, -0.224, 0.0, 0.0), _ZERO, (0.472, 0.096, 0.0, 0.633), _ZERO]
    ),
    acceleration=np.array(
        [
            (-0.068, 0.031, 0.0, 0.0),
            (-0.112, 0.0, 0.0, 0.0),
            (0.026, -0.010, 0.0, 0.0),
            (-0.117, 0.059, -0.007, 0.098),
            _ZERO,
            (-0.083, 0.0, -0.002, 0.0),
        ]
    ),
)
_KNEE = _Table(
    percent=np.array(
        [
            _ZERO,
            (17.103, 0.0, 0.0, 0.0),
            (48.542, -0.998, 0.0, 0.0),
            (68.947, -6.096, 0.611, 5.967),
            (85.816, -4.480, 0.519, 0.0),
            (92.489, 0.0, 0.0, 0.0),
        ]
    ),
    angle=np.array(
        [
            (31.595, -4.311, 0.494, -13.050),
            (5.995, 3.028, 0.0, 0.0),
            (-10.037, 0.0, 0.0, 7.594),
            (29.618, 3.803, -0.486, 0.0),
            (38.110, 9.744, -1.105, 0.0),
            (24.631, -0.967, 0.0, 0.0),
        ]
    ),
    velocity=np.array(
        [(-3.581, 0.0, 0.0, 1.977), _ZERO, _ZERO, (3.276, 0.0, 0.0, 0.0), _ZERO, (-0.446, -0.032, 0.0, -1.696)]
    ),
    acceleration=np.array(
        [
            (0.301, 0.073, 0.0, 0.0),
            (-0.094, 0.0, -0.005, 0.0),
            (0.042, 0.0, 0.004, 0.0),
            _ZERO,
            (-0.784, 0.225, -0.026, 0.0),
            _ZERO,
        ]
    ),
)
_ANKLE = _Table(
    percent=np.array(
        [
            _ZERO,
            (8.145, 0.331, 0.0, 0.0),
            (12.005, 0.0, 0.0, 13.754),
            (67.686, -5.469, 0.493, 0.0),
            (73.460, -6.699, 0.744, 6.463),
            (87.621, 0.0, 0.132, 0.0),
        ]
    ),
    angle=np.array(
        [
            (18.645, 0.554, 0.0, -13.246),
            (17.309, 0.0, 0.0, -14.173),
            (0.836, 0.812, 0.0, 0.0),
            (-15.523, 0.0, 0.0, 14.494),
            (21.984, -3.425, 0.0, -12.522),
            (4.860, -0.655, 0.0, 0.0),
        ]
    ),
    velocity=np.array([(-0.145, 0.0, -0.020, 0.0), _ZERO, (-0.991, 0.0, 0.0, 0.620), _ZERO, _ZERO, _ZERO]),
    acceleration=np.array(
        [
            (0.145, -0.137, 0.015, 0.0),
            (-0.556, 0.0, 0.0, 0.492),
            _ZERO,
            (0.055, -0.019, 0.0, -0.089),
            (0.433, 0.0, 0.0, 0.0),
            (0.412, 0.087, -0.012, -0.425),
        ]
    ),
)
_STEP_RATIO = np.array([-0.532, 0.020, 0.0, 0.470])


def joint_angles(speed_m_s: float, height_m: float, percent: FloatArray) -> FloatArray:
    """(3, n) degrees of hip, knee and ankle in the sagittal plane; flexion and dorsiflexion are positive.

    Args:
        speed_m_s: of walking; beyond SPEED_RANGE_M_S as at its nearer end.
        height_m: of the body.
        percent: (n,) of the gait cycle, 0 and 100 at heel strike.
    """
    return np.stack([_curve(table, speed_m_s, height_m, percent) for table in (_HIP, _KNEE, _ANKLE)])


def step_ratio(speed_m_s: FloatArray, height_m: float) -> FloatArray:
    """(...) metre seconds: step length divided by steps per second.

    Beyond SPEED_RANGE_M_S as at its nearer end: in free walking the ratio is constant (Sekiya and Nagasaki,
    Reproducibility of the walking patterns of normal young adults, Gait and Posture 7, 1998).
    """
    b0, b1, _, b3 = _STEP_RATIO
    return np.asarray(b0 + b1 * 3.6 * np.clip(speed_m_s, *SPEED_RANGE_M_S) + b3 * height_m)


def _curve(table: _Table, speed_m_s: float, height_m: float, percent: FloatArray) -> FloatArray:
    """(n,) degrees: fifth-order polynomials with the values and two derivatives of the key events."""
    low, high = SPEED_RANGE_M_S
    v = 3.6 * min(max(speed_m_s, low), high)
    terms = np.array([1.0, v, v * v, height_m])
    x, y, dy, ddy = (
        np.sum(part * terms, axis=1) for part in (table.percent, table.angle, table.velocity, table.acceleration)
    )
    x, y, dy, ddy = (np.append(part, end) for part, end in ((x, 100.0), (y, y[0]), (dy, dy[0]), (ddy, ddy[0])))
    at = np.mod(percent, 100.0)
    k = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(x) - 2)
    h = x[k + 1] - x[k]
    s = (at - x[k]) / h
    # Quintic Hermite basis on 0..1.
    r = 1.0 - s
    return np.asarray(
        y[k] * r**3 * (1.0 + 3.0 * s + 6.0 * s * s)
        + y[k + 1] * s**3 * (1.0 + 3.0 * r + 6.0 * r * r)
        + h * (dy[k] * s * r**3 * (1.0 + 3.0 * s) - dy[k + 1] * r * s**3 * (1.0 + 3.0 * r))
        + h * h * 0.5 * (ddy[k] * s * s * r**3 + ddy[k + 1] * r * r * s**3)
    )
