"""A person's acts, told one after another, become one motion."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import cos, inf, pi, sin

import numpy as np
from scipy.interpolate import CubicSpline

from sim.errors import MotionError
from sim.geometry import FloatArray
from sim.people.body import Body
from sim.people.grip import PUSH_AHEAD_M, PUSH_BEHIND_AXIS_M, Grip
from sim.people.handling import ChairContact
from sim.people.idle import Idle
from sim.people.motion import ActSpan, Envelope, PersonMotion, RowSpline, Stretch
from sim.people.rows import ROOT, YAW, standing_row
from sim.people.seat import Seat, place_before, seated_row, sitting_down_rows, standing_up_rows
from sim.people.steps import STEP_S, Steps
from sim.people.walk_path import WalkPath
from sim.people.walk_plan import WalkPlan
from sim.people.walk_steps import one_way_steps, steps_on_the_spot

FARTHEST_SHUFFLE_M = 0.8
"""To a seat or a chair that is not farther than this the person goes with small steps; it must walk there else."""

_SAME_HEADING_RAD = 0.02
_SAME_PLACE_M = 0.005
_SETTLE_S = 0.6
"""In this time small movements and gestures grow and fade."""
_REACH_S = 0.9
"""In this time the hands go to the back of a chair, and away."""


@dataclass(slots=True)
class _Keys:
    """An envelope that is being made."""

    times_s: list[float] = field(default_factory=lambda: [0.0])
    values: list[float] = field(default_factory=lambda: [0.0])

    def change(self, start_s: float, duration_s: float, value: float) -> None:
        """To `value`, from `start_s` on, in `duration_s`."""
        if value != self.values[-1]:
            self.times_s += [max(start_s, self.times_s[-1]), max(start_s, self.times_s[-1]) + duration_s]
            self.values += [self.values[-1], value]

    def envelope(self) -> Envelope:
        return Envelope(times_s=tuple(self.times_s), values=tuple(self.values))


class Script:
    """Takes the acts of a person in order and makes the motion of them.

    Every act begins where the one before has ended, standing at ease or sitting. After the last act the person stays
    there and goes on with its small movements.

    Args:
        body: of the person.
        position_world: (2,) metres, where it stands at time 0.
        heading_rad: where it faces then, from the world's x axis.
        seat: on which it sits at time 0; position and heading are then the seat's.
        grip: how it holds what it carries all the time.
        name: of the person.
        seed: of the scene; with the name it decides the small movements.
    """

    def __init__(
        self,
        body: Body,
        position_world: Sequence[float] = (0.0, 0.0),
        heading_rad: float = 0.0,
        *,
        seat: Seat | None = None,
        grip: Grip | None = None,
        name: str = "",
        seed: int = 0,
    ) -> None:
        self._body, self._seat, self._grip, self._idle = body, seat, grip, Idle(seed, name)
        row = standing_row(body, np.asarray(position_world, float), heading_rad)
        self._row = row if seat is None else seated_row(body, seat)
        self._time_s = 0.0
        self._acts: list[ActSpan] = []
        self._stretches = [Stretch(start_s=0.0, rows=self._row)]
        self._liveliness, self._gesturing, self._pushing = _Keys(values=[1.0]), _Keys(), _Keys()
        self._sitting = _Keys(values=[0.0 if seat is None else 1.0])
        self._pushes: list[ChairContact] = []

    # ---- the acts ------------------------------------------------------------------------------------

    def stand(self, duration_s: float, amplitude: float = 1.0) -> None:
        """Stand at ease.

        Args:
            duration_s: how long.
            amplitude: of breath, sway and glances, 0 (a statue) to 2; it stays so until another act sets it.

        Raises:
            MotionError: the person sits, or the amplitude is out of range.
        """
        self._needs_feet("stand")
        self._stay("stand", duration_s, amplitude)

    def sit(self, duration_s: float, amplitude: float = 1.0) -> None:
        """Sit, with gestures.

        Args:
            duration_s: how long.
            amplitude: of the gestures, as for `stand`; at 1 as in conversation.

        Raises:
            MotionError: the person does not sit, or the amplitude is out of range.
        """
        if self._seat is None:
            raise MotionError("sit: the person stands; let it sit down before")
        self._gesturing.change(self._time_s, min(_SETTLE_S, duration_s), amplitude)
        self._stay("sit", duration_s, amplitude)

    def walk_loop(
        self, waypoints_world: Sequence[Sequence[float]], speed_m_s: float, *, closed: bool, start_m: float
    ) -> None:
        """Walk for ever; the only act of a person.

        Args:
            waypoints_world: (N, 2) metres.
            speed_m_s: on straight parts.
            closed: whether the last waypoint leads to the first; else the person turns there and walks back.
            start_m: how far along the way it is at time 0.

        Raises:
            MotionError: the way cannot be walked, the speed is none of walking, or there was an act before.
        """
        if self._time_s > 0.0 or self._seat is not None:
            raise MotionError("walk_loop: no act goes before it, and the person stands")
        path = WalkPath(waypoints_world, way="loop" if closed else "there_and_back")
        plan = WalkPlan(path, speed_m_s, self._body.leg_m)
        self._stretches = [
            Stretch(start_s=-plan.time_of(start_m), rows=RowSpline.of(_loop_spline(plan, self._body)), is_loop=True)
        ]
        self._acts.append(ActSpan(name="walk_loop", start_s=0.0, end_s=inf))
        self._time_s = inf

    def walk(self, waypoints_world: Sequence[Sequence[float]], speed_m_s: float) -> None:
        """Walk to the last of the waypoints, along the others, and stop there.

        A person who faces elsewhere turns on the spot before; as the first act it faces the way from the beginning.

        Args:
            waypoints_world: (N, 2) metres, without the place where the person is.
            speed_m_s: on straight parts.

        Raises:
            MotionError: the way cannot be walked, or the speed is none of walking.
        """
        self._needs_feet("walk")
        path = WalkPath(np.vstack([self._row[ROOT], np.asarray(waypoints_world, float)]), way="one_way")
        heading = float(path.heading_at(np.zeros(1))[0])
        with_turn = self._time_s > 0.0
        start_s = self._time_s
        if with_turn:
            self._shuffle(self._row[ROOT], heading)
        else:
            self._row = standing_row(self._body, self._row[ROOT], heading)
        self._go(one_way_steps(path, speed_m_s, self._body.leg_m))
        self._end("walk", start_s)

    def turn(self, heading_rad: float) -> None:
        """Turn on the spot, with small steps.

        Args:
            heading_rad: where the person faces then, from the world's x axis.

        Raises:
            MotionError: the person sits.
        """
        self._needs_feet("turn")
        start_s = self._time_s
        self._shuffle(self._row[ROOT], heading_rad)
        self._end("turn", start_s)

    def sit_down(self, seat: Seat) -> None:
        """Sit down, with small steps to the right place before.

        Args:
            seat: not farther than FARTHEST_SHUFFLE_M.

        Raises:
            MotionError: the person sits, holds a box, or the seat is too far.
        """
        self._needs_feet("sit_down")
        self._needs_a_hand("sit_down")
        start_s = self._time_s
        self._shuffle(place_before(self._body, seat), seat.heading_rad)
        self._sitting.change(self._time_s, 1.0, 1.0)
        self._add(sitting_down_rows(self._body, seat))
        self._seat, self._row = seat, seated_row(self._body, seat)
        self._end("sit_down", start_s)

    def stand_up(self) -> None:
        """Stand up from the seat.

        Raises:
            MotionError: the person does not sit.
        """
        if self._seat is None:
            raise MotionError("stand_up: the person stands already")
        start_s, seat = self._time_s, self._seat
        self._gesturing.change(start_s, _SETTLE_S, 0.0)
        rows = standing_up_rows(self._body, seat)
        self._add(rows)
        self._sitting.change(self._time_s - 0.5, 0.5, 0.0)
        self._seat = None
        self._row = standing_row(self._body, place_before(self._body, seat), seat.heading_rad)
        self._end("stand_up", start_s)

    def push(
        self, chair: str, chair_world: Sequence[float], heading_rad: float, distance_m: float, speed_m_s: float
    ) -> None:
        """Push a chair straight ahead by its back with both hands, and let go.

        The person goes behind the chair with small steps before, so that it looks where the chair looks.

        Args:
            chair: its name.
            chair_world: (2,) metres, its axis.
            heading_rad: where who sits on it would look.
            distance_m: how far the person walks with it.
            speed_m_s: how fast.

        Raises:
            MotionError: the person sits or carries something, the chair is too far, or the walk is none.
        """
        self._needs_feet("push")
        if self._grip is not None:
            raise MotionError("push: the person carries something, it takes both hands")
        start_s = self._time_s
        ahead = np.array([cos(heading_rad), sin(heading_rad)])
        place = np.asarray(chair_world, float) - (PUSH_BEHIND_AXIS_M + PUSH_AHEAD_M) * ahead
        self._shuffle(place, heading_rad)
        self._pushing.change(self._time_s, _REACH_S, 1.0)
        self._wait(_REACH_S)
        path = WalkPath([place, place + distance_m * ahead], way="one_way")
        contact_s = self._time_s
        self._go(one_way_steps(path, speed_m_s, self._body.leg_m))
        self._pushes.append(ChairContact(chair=chair, start_s=contact_s, end_s=self._time_s))
        self._pushing.change(self._time_s, _REACH_S, 0.0)
        self._wait(_REACH_S)
        self._end("push", start_s)

    def motion(self) -> PersonMotion:
        """The whole motion."""
        return PersonMotion(
            body=self._body,
            acts=tuple(self._acts),
            stretches=tuple(self._stretches),
            idle=self._idle,
            liveliness=self._liveliness.envelope(),
            gesturing=self._gesturing.envelope(),
            sitting=self._sitting.envelope(),
            pushing=self._pushing.envelope(),
            pushes=tuple(self._pushes),
            grip=self._grip,
        )

    # ---- what they are made of -----------------------------------------------------------------------

    def _needs_feet(self, act: str) -> None:
        if self._seat is not None:
            raise MotionError(f"{act}: the person sits; let it stand up before")

    def _needs_a_hand(self, act: str) -> None:
        if self._grip is not None and self._grip.held.all():
            raise MotionError(f"{act}: the person holds a box with both hands")

    def _end(self, name: str, start_s: float) -> None:
        self._acts.append(ActSpan(name=name, start_s=start_s, end_s=self._time_s))
        self._stretches.append(Stretch(start_s=self._time_s, rows=self._row))

    def _wait(self, duration_s: float) -> None:
        self._stretches.append(Stretch(start_s=self._time_s, rows=self._row))
        self._time_s += duration_s

    def _stay(self, name: str, duration_s: float, amplitude: float) -> None:
        if not 0.0 <= amplitude <= 2.0:
            raise MotionError(f"amplitude: must be 0 (a statue) to 2, got {amplitude}")
        if duration_s <= 0.0:
            raise MotionError(f"duration_s: must be above 0, got {duration_s}")
        start_s = self._time_s
        self._liveliness.change(start_s, min(_SETTLE_S, duration_s), amplitude)
        self._wait(duration_s)
        self._end(name, start_s)

    def _shuffle(self, position_world: FloatArray, heading_rad: float) -> None:
        """Small steps to a place near by; none if the person stands there already."""
        here, heading = self._row[ROOT], float(self._row[YAW]) - pi / 2
        distance = float(np.hypot(*(position_world - here)))
        if distance > FARTHEST_SHUFFLE_M:
            x, y = position_world.tolist()
            raise MotionError(
                f"the person is {distance:.2f} m from where it must stand: walk to ({x:.2f}, {y:.2f}) before"
            )
        if distance > _SAME_PLACE_M or abs(np.sin((heading_rad - heading) / 2)) > _SAME_HEADING_RAD / 2:
            self._go(steps_on_the_spot(here, heading, position_world, heading_rad))

    def _go(self, steps: Steps) -> None:
        """On foot, to standing at ease."""
        self._add(steps.rows(self._body))
        self._row = standing_row(self._body, steps.root_world[-1], float(steps.heading[-1]))

    def _add(self, rows: FloatArray) -> None:
        """A movement from rest to rest, one row every STEP_S."""
        spline = CubicSpline(np.arange(len(rows)) * STEP_S, rows, bc_type="clamped")
        self._stretches.append(Stretch(start_s=self._time_s, rows=RowSpline.of(spline)))
        self._time_s += float(spline.x[-1])


def _loop_spline(plan: WalkPlan, body: Body) -> CubicSpline:
    """The spline through the rows of one loop. A loop may end a whole turn further: only the rest is periodic."""
    rows = plan.steps_of_a_loop().rows(body)
    t = np.linspace(0.0, plan.period_s, len(rows))
    turn = rows[-1, YAW] - rows[0, YAW]
    drift = turn * t / plan.period_s
    rows[:, YAW] -= drift
    rows[-1] = rows[0]
    spline = CubicSpline(t, rows, bc_type="periodic")
    spline.c[-2, :, YAW] += turn / plan.period_s
    spline.c[-1, :, YAW] += drift[:-1]
    return spline
