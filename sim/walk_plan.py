"""When a walker is where: distance and step phase over time, and the footprints, planned once for a whole loop."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicHermiteSpline
from scipy.ndimage import gaussian_filter1d

from sim import gait
from sim.errors import MotionError
from sim.geometry import FloatArray
from sim.walk_path import WalkPath

TIME_STEP_S = 0.005
DISTANCE_STEP_M = 0.01
SMOOTHING_S = 0.12
ACCELERATION_M_S2 = 1.3
TURN_RATE_RAD_S = 1.4
SIDEWAYS_M_S2 = 1.2
TURN_PER_STEP_RAD = 0.75
SLOWEST_STEP_HZ = 1.3
STILL_M_S = 0.02
CLOSING_S = 0.55
RATE_SMOOTHING_S = 0.08
SHORTEST_PAUSE_S = 1.5

REST_PHASE = 0.12
"""How far the phase is past a whole number while the walker stands: both feet are on the floor then."""

PRINT_PHASE = 0.475
"""A foot is put down where the pelvis will be this many steps after its heel strike."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pause:
    """A stop on the way.

    Attributes:
        waypoint: index of the waypoint near which the walker stops.
        seconds: how long it stands, at least 1.5.
    """

    waypoint: int
    seconds: float


class WalkPlan:
    """Distance and phase as smooth periodic functions of time, and the footprints.

    The speed is the asked one wherever the path is straight, less in turns (TURN_RATE_RAD_S, SIDEWAYS_M_S2) and near
    pauses. The number of steps of a loop is even, so that the loop closes; cadence gives way for this, not speed.

    Attributes:
        period_s: time of one loop.
        steps: number of steps of one loop, even.
        print_world: (steps, 2) metres, the walker's centre line beside each footprint; even numbers are right feet.
        print_heading: (steps,) radians.
    """

    def __init__(
        self,
        path: WalkPath,
        waypoints_world: npt.ArrayLike,
        speed_m_s: float,
        leg_m: float,
        pauses: tuple[Pause, ...] = (),
    ) -> None:
        low, high = gait.SPEED_RANGE_M_S
        if not low <= speed_m_s <= high:
            raise MotionError(f"speed_m_s: people walk at {low} to {high} m/s, got {speed_m_s}")
        waypoints = np.asarray(waypoints_world, float)
        for pause in pauses:
            if pause.seconds < SHORTEST_PAUSE_S or not 0 <= pause.waypoint < len(waypoints):
                raise MotionError(f"{pause}: {SHORTEST_PAUSE_S} s or more, at one of the {len(waypoints)} waypoints")
        self.path = path
        pauses_at = tuple((path.nearest(waypoints[p.waypoint]), p.seconds) for p in pauses)
        speed = _speed_over_time(path, speed_m_s, pauses_at)
        n = len(speed)
        self.period_s = n * TIME_STEP_S
        ring = np.append(speed, speed[0])
        distance = np.zeros(n + 1)
        distance[1:] = np.cumsum(0.5 * (ring[1:] + ring[:-1])) * TIME_STEP_S
        ring *= path.length_m / distance[-1]
        distance *= path.length_m / distance[-1]
        time = np.arange(n + 1) * TIME_STEP_S
        self._distance = CubicHermiteSpline(time, distance, ring)
        turn_rate = np.abs(path.curvature_at(distance[:-1])) * speed
        rate = np.hypot(gait.step_rate_hz(speed, leg_m), turn_rate / TURN_PER_STEP_RAD)
        phase, rate = _phase_over_time(speed, rate)
        self.steps = round(float(phase[-1] - phase[0]))
        self._phase = CubicHermiteSpline(time, phase, np.append(rate, rate[0]))
        self._speed = CubicHermiteSpline(time, ring, np.gradient(ring, TIME_STEP_S))
        first = phase[0]
        numbers = np.arange(self.steps)
        laps = np.ceil((first - (numbers + PRINT_PHASE)) / self.steps)
        at = np.interp(numbers + PRINT_PHASE + laps * self.steps, phase, time)
        s = self._distance(at)
        self.print_world = path.position_at(s)
        self.print_heading = path.heading_at(s)
        self.print_size = gait.amplitude(np.maximum(self._speed(at), 0.0))

    def distance_at(self, time_s: FloatArray) -> FloatArray:
        """(...) metres along the path, growing by its length with every loop."""
        laps = np.floor(time_s / self.period_s)
        return np.asarray(self._distance(time_s - laps * self.period_s) + laps * self.path.length_m)

    def phase_at(self, time_s: FloatArray) -> FloatArray:
        """(...) step phase, growing by `steps` with every loop."""
        laps = np.floor(time_s / self.period_s)
        return np.asarray(self._phase(time_s - laps * self.period_s) + laps * self.steps)

    def speed_at(self, time_s: FloatArray) -> FloatArray:
        """(...) m/s along the path."""
        laps = np.floor(time_s / self.period_s)
        return np.asarray(np.maximum(self._speed(time_s - laps * self.period_s), 0.0))

    def time_of(self, distance_m: float) -> float:
        """A time in the first loop at which the walker is `distance_m` along the path."""
        time = np.arange(round(self.period_s / TIME_STEP_S) + 1) * TIME_STEP_S
        return float(np.interp(np.mod(distance_m, self.path.length_m), self._distance(time), time))


def _speed_over_time(path: WalkPath, speed_m_s: float, pauses_at: tuple[tuple[float, float], ...]) -> FloatArray:
    """(n,) m/s every TIME_STEP_S over one loop, pauses included, smooth and periodic."""
    count = round(path.length_m / DISTANCE_STEP_M)
    step = path.length_m / count
    s = np.linspace(0.0, path.length_m, count, endpoint=False)
    curvature = np.abs(path.curvature_at(s)) + 1e-9
    limit = np.minimum(speed_m_s, np.minimum(TURN_RATE_RAD_S / curvature, np.sqrt(SIDEWAYS_M_S2 / curvature)))
    square = limit**2
    stops: dict[int, float] = {}
    for at, seconds in sorted(pauses_at):
        k = round(at / step) % count
        stops[k] = stops.get(k, 0.0) + seconds
        square[k] = 0.0
    gain = 2.0 * ACCELERATION_M_S2 * step
    for before in (-1, 1):  # speed up no faster than ACCELERATION_M_S2, then the same for slowing down
        for k in range(2 * count) if before < 0 else range(2 * count, 0, -1):
            square[k % count] = min(square[k % count], square[(k + before) % count] + gain)
    speed = np.sqrt(square)
    ring = np.append(speed, speed[0])
    arrival = np.concatenate([[0.0], np.cumsum(2.0 * step / (ring[1:] + ring[:-1]))])
    for k, seconds in stops.items():
        arrival[k + 1 :] += seconds
    leaving = np.array([arrival[k] + seconds for k, seconds in stops.items()])
    times, speeds = np.append(arrival, leaving), np.append(ring, np.zeros(len(leaving)))
    order = np.argsort(times, kind="stable")
    n = int(np.ceil(arrival[-1] / TIME_STEP_S))
    even = np.linspace(0.0, arrival[-1], n, endpoint=False)
    sampled = np.interp(even, times[order], speeds[order])
    return np.asarray(gaussian_filter1d(sampled, SMOOTHING_S / TIME_STEP_S, mode="wrap"))


def _phase_over_time(speed: FloatArray, rate: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n + 1,) phase over one loop and (n,) its rate. Between two pauses the phase grows by a whole number."""
    n = len(speed)
    moving = speed > STILL_M_S
    stepping = moving.copy()
    left = 0  # samples left to draw the second foot up after the walker has come to a stop
    for k in range(2 * n):
        left = round(CLOSING_S / TIME_STEP_S) if moving[k % n] else left - 1
        stepping[k % n] |= left > 0
    rate = np.where(stepping, np.maximum(rate, SLOWEST_STEP_HZ), 0.0)
    rate = gaussian_filter1d(rate, RATE_SMOOTHING_S / TIME_STEP_S, mode="wrap")
    rate[rate < 1e-4] = 0.0
    rest = rate == 0.0
    starts = np.flatnonzero(~rest & np.roll(rest, 1))
    bouts = [np.arange(n)] if not rest.any() else []
    for start in starts.tolist():
        ring = (start + np.arange(n)) % n
        bouts.append(ring[: int(np.argmax(rest[ring]))])
    totals = [float(np.sum(rate[bout])) * TIME_STEP_S for bout in bouts]
    steps = [max(1, round(total)) for total in totals]
    longest = int(np.argmax(totals))
    if sum(steps) % 2:
        steps[longest] += 1 if totals[longest] > steps[longest] or steps[longest] == 1 else -1
    for bout, wanted, total in zip(bouts, steps, totals, strict=True):
        rate[bout] *= wanted / total
    closed = np.append(rate, rate[0])
    phase = np.concatenate([[0.0], np.cumsum(0.5 * (closed[1:] + closed[:-1]))]) * TIME_STEP_S
    if rest.any():
        phase += REST_PHASE - phase[int(np.argmax(rest))]
    return phase, rate
