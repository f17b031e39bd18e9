"""How a person moves over time: acts one after another, with small movements and what the hands do on top."""

from bisect import bisect_right
from dataclasses import dataclass, replace
from math import floor
from typing import Self

import numpy as np
from scipy.interpolate import CubicSpline

from sim.errors import MotionError
from sim.geometry import FloatArray, pose
from sim.people import kernels
from sim.people.body import Body, Posture
from sim.people.grip import PUSH_LEAN_RAD, Grip, push_palms, push_wrists
from sim.people.handling import ChairContact
from sim.people.idle import Idle
from sim.people.rows import SIZE, posture_from_row, root_from_row

SEAT_HOLDS = 0.75
"""By this share the small movements of a person who sits are smaller than of one who stands."""
FIDGET_SHARE = 2.5
"""The small movements of a stander are gone at a gait of size 1 / FIDGET_SHARE."""

FEET_APART_M = 0.12
"""The hips do not sway when one foot is so far ahead: the leg behind is straight then."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ActSpan:
    """When an act of a person begins and ends.

    Attributes:
        name: kind of the act, as in a scenario: "walk", "sit_down" ...
        start_s, end_s: seconds; the end of an endless act is infinite.
    """

    name: str
    start_s: float
    end_s: float

    @property
    def duration_s(self) -> float:
        """Seconds."""
        return self.end_s - self.start_s


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RowSpline:
    """Rows over time, see `sim.people.rows`.

    Attributes:
        times_s: (N + 1,) breakpoints, from 0 on.
        coefficients: (K, N, COLUMNS) of the polynomials between them, as SciPy's `PPoly` has them.
    """

    times_s: FloatArray
    coefficients: FloatArray

    @classmethod
    def of(cls, spline: CubicSpline) -> Self:
        """That of SciPy, which takes longer to evaluate than all else in a posture."""
        return cls(times_s=spline.x, coefficients=spline.c)

    def at(self, time_s: float) -> FloatArray:
        """(COLUMNS,) inside the breakpoints."""
        return np.asarray(kernels.spline_at(self.times_s, self.coefficients, time_s))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stretch:
    """A piece of a motion.

    Attributes:
        start_s: when it begins; it lasts until the next one begins.
        rows: see `sim.people.rows`: (COLUMNS,) of a person who stays, or their spline over the seconds from `start_s`.
        is_loop: whether the spline repeats itself for ever; else the person stays at its end.
    """

    start_s: float
    rows: RowSpline | FloatArray
    is_loop: bool = False

    @property
    def duration_s(self) -> float:
        """Seconds until it ends or repeats itself; 0 for a person who stays."""
        return float(self.rows.times_s[-1]) if isinstance(self.rows, RowSpline) else 0.0

    def row_at(self, time_s: float) -> FloatArray:
        """(COLUMNS,) at a time since time 0 of the motion."""
        if not isinstance(self.rows, RowSpline):
            return self.rows
        t, end = time_s - self.start_s, self.duration_s
        return self.rows.at(t - floor(t / end) * end if self.is_loop else min(max(t, 0.0), end))


@dataclass(frozen=True, slots=True, kw_only=True)
class Envelope:
    """A smooth function of time through values at times; constant before and after.

    Attributes:
        times_s: not falling.
        values: at these times; between two of them the change is slow at both ends.
    """

    times_s: tuple[float, ...]
    values: tuple[float, ...]

    def at(self, time_s: float) -> float:
        """The value."""
        k = bisect_right(self.times_s, time_s)
        if k == 0 or k == len(self.times_s):
            return self.values[max(k - 1, 0)]
        before, after = self.times_s[k - 1], self.times_s[k]
        x = (time_s - before) / (after - before)
        rise = x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
        return self.values[k - 1] + rise * (self.values[k] - self.values[k - 1])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PersonMotion:
    """A person's whole motion, made by `sim.people.script.Script`: a pure function of time.

    Attributes:
        body: of the person.
        acts: what the person does, one after another.
        stretches: of the body's movement, in order.
        idle: the small movements.
        liveliness: their size over time.
        gesturing: size of the gestures over time.
        sitting: 1 while the person sits, 0 on foot.
        pushing: 1 while the hands are at a chair, 0 without.
        pushes: see `sim.people.handling`.
        grip: how the carried thing is held; None: nothing is carried.
    """

    body: Body
    acts: tuple[ActSpan, ...]
    stretches: tuple[Stretch, ...]
    idle: Idle
    liveliness: Envelope
    gesturing: Envelope
    sitting: Envelope
    pushing: Envelope
    pushes: tuple[ChairContact, ...]
    grip: Grip | None

    def pose_at(self, time_s: float) -> FloatArray:
        """`T_world_object` (4, 4): on the floor under the person, who faces the frame's -y axis."""
        return root_from_row(self._row_at(time_s))

    def palette_at(self, time_s: float) -> FloatArray:
        """(B, 4, 4) rest frame to world."""
        row = self._row_at(time_s)
        return np.asarray(root_from_row(row) @ self.body.palette(self._posture(time_s, row)))

    def posture_at(self, time_s: float) -> Posture:
        """The posture in the root frame `pose_at(time_s)`."""
        return self._posture(time_s, self._row_at(time_s))

    def hands_at(self, time_s: float) -> FloatArray:
        """(2, 3) world, where the left and right palm touch the chair that is pushed.

        Raises:
            MotionError: no chair is pushed at this time.
        """
        if not any(push.start_s <= time_s <= push.end_s for push in self.pushes):
            raise MotionError(f"hands_at: no chair is pushed at {time_s} s")
        T_world_root = self.pose_at(time_s)
        return np.asarray(push_palms() @ T_world_root[:3, :3].T + T_world_root[:3, 3])

    def T_world_grip(self, time_s: float) -> FloatArray:
        """(4, 4) the foot of the carried thing; z up, -y ahead of the person.

        Raises:
            MotionError: the person carries nothing.
        """
        if self.grip is None:
            raise MotionError("T_world_grip: the person carries nothing")
        row = self._row_at(time_s)
        shift = self.grip.shift(self.body, self._posture(time_s, row))
        return np.asarray(root_from_row(row) @ pose(np.eye(3), self.grip.foot + shift))

    def _row_at(self, time_s: float) -> FloatArray:
        number = bisect_right([stretch.start_s for stretch in self.stretches], time_s)
        return self.stretches[max(number - 1, 0)].row_at(time_s)

    def _posture(self, time_s: float, row: FloatArray) -> Posture:
        posture = posture_from_row(row)
        stillness = max(1.0 - FIDGET_SHARE * float(row[SIZE]), 0.0) ** 2
        gestures = self.gesturing.at(time_s)
        if gestures > 0.0:
            posture = self.idle.gesturing(posture, time_s, gestures)
        sitting = self.sitting.at(time_s)
        amount = stillness * self.liveliness.at(time_s) * (1.0 - SEAT_HOLDS * sitting)
        if amount > 0.0:
            apart = abs(float(posture.ankles[0, 1] - posture.ankles[1, 1])) / FEET_APART_M
            sway = max(1.0 - apart, 0.0) * (1.0 - sitting)
            posture = self.idle.swayed(posture, time_s, amount, sway=sway)
        pushing = self.pushing.at(time_s)
        if pushing > 0.0:
            return replace(
                posture,
                chest=posture.chest + np.array([0.0, 0.0, pushing * PUSH_LEAN_RAD]),
                wrists=push_wrists(),
                held=np.full(2, pushing),
            )
        if self.grip is not None:
            wrists = self.grip.wrists.copy()
            wrists[:, :3, 3] += self.grip.shift(self.body, posture)
            return replace(posture, wrists=wrists, held=self.grip.held)
        return posture
