"""Walking round and round: distance and step phase over time, and the footprints, planned once for a whole loop."""

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.ndimage import gaussian_filter1d

from sim.errors import MotionError
from sim.geometry import FloatArray
from sim.people import gait
from sim.people.steps import STEP_S, Steps
from sim.people.walk_path import WalkPath

DISTANCE_STEP_M = 0.01
SMOOTHING_S = 0.12
ACCELERATION_M_S2 = 1.3
TURN_RATE_RAD_S = 1.4
SIDEWAYS_M_S2 = 1.2
TURN_PER_STEP_RAD = 0.75
SLOWEST_STEP_HZ = 1.3
RATE_SMOOTHING_S = 0.08

PRINT_PHASE = 0.475
"""A foot is put down where the pelvis will be this many steps after its heel strike."""


class WalkPlan:
    """Distance and phase as smooth periodic functions of time, and the footprints.

    The speed is the asked one wherever the path is straight, and less in turns (TURN_RATE_RAD_S, SIDEWAYS_M_S2). The
    number of steps of a loop is even, so that the loop closes; cadence gives way for this, not speed.

    Args:
        path: a loop.
        speed_m_s: on straight parts.
        leg_m: length of the leg, see `Body`.

    Attributes:
        period_s: time of one loop.
        steps: number of steps of one loop, even.
        print_world: (steps, 2) metres, the walker's centre line beside each footprint; even numbers are right feet.
        print_heading: (steps,) radians.
        print_size: (steps,) size of the gait there.

    Raises:
        MotionError: the speed is not one of walking.
    """

    def __init__(self, path: WalkPath, speed_m_s: float, leg_m: float) -> None:
        check_speed(speed_m_s)
        self.path = path
        speed = _speed_over_time(path, speed_m_s)
        n = len(speed)
        self.period_s = n * STEP_S
        ring = np.append(speed, speed[0])
        distance = np.zeros(n + 1)
        distance[1:] = np.cumsum(0.5 * (ring[1:] + ring[:-1])) * STEP_S
        ring *= path.length_m / distance[-1]
        distance *= path.length_m / distance[-1]
        time = np.arange(n + 1) * STEP_S
        self._distance = CubicHermiteSpline(time, distance, ring)
        turn_rate = np.abs(path.curvature_at(distance[:-1])) * speed
        rate = np.hypot(gait.step_rate_hz(speed, leg_m), turn_rate / TURN_PER_STEP_RAD)
        phase, rate = _phase_over_time(rate)
        self.steps = round(float(phase[-1] - phase[0]))
        self._phase = CubicHermiteSpline(time, phase, np.append(rate, rate[0]))
        self._speed = CubicHermiteSpline(time, ring, np.gradient(ring, STEP_S))
        first = phase[0]
        numbers = np.arange(self.steps)
        laps = np.ceil((first - (numbers + PRINT_PHASE)) / self.steps)
        at = np.interp(numbers + PRINT_PHASE + laps * self.steps, phase, time)
        s = self._distance(at)
        self.print_world = path.position_at(s)
        self.print_heading = path.heading_at(s)
        self.print_size = gait.amplitude(np.maximum(self._speed(at), 0.0))

    def steps_of_a_loop(self) -> Steps:
        """One loop from time 0, sampled evenly over `period_s`."""
        n = int(np.ceil(self.period_s / STEP_S))
        t = np.linspace(0.0, self.period_s, n + 1)
        distance = self.distance_at(t)
        return Steps(
            root_world=self.path.position_at(distance),
            heading=np.unwrap(self.path.heading_at(distance)),
            size=gait.amplitude(self.speed_at(t)),
            phase=self.phase_at(t),
            look=np.zeros(n + 1),
            first=0,
            print_world=self.print_world,
            print_heading=self.print_heading,
            print_size=self.print_size,
            is_loop=True,
        )

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
        time = np.arange(round(self.period_s / STEP_S) + 1) * STEP_S
        return float(np.interp(np.mod(distance_m, self.path.length_m), self._distance(time), time))


def speed_limit(path: WalkPath, speed_m_s: float, s: FloatArray) -> FloatArray:
    """(n,) m/s at the distances `s`: the asked speed, less in turns."""
    curvature = np.abs(path.curvature_at(s)) + 1e-9
    return np.minimum(speed_m_s, np.minimum(TURN_RATE_RAD_S / curvature, np.sqrt(SIDEWAYS_M_S2 / curvature)))


def check_speed(speed_m_s: float) -> None:
    """Refuse what is no walking.

    Raises:
        MotionError: the speed is out of range.
    """
    low, high = gait.SPEED_RANGE_M_S
    if not low <= speed_m_s <= high:
        raise MotionError(f"speed_m_s: people walk at {low} to {high} m/s, got {speed_m_s}")


def _speed_over_time(path: WalkPath, speed_m_s: float) -> FloatArray:
    """(n,) m/s every STEP_S over one loop, smooth and periodic."""
    count = round(path.length_m / DISTANCE_STEP_M)
    step = path.length_m / count
    s = np.linspace(0.0, path.length_m, count, endpoint=False)
    square = speed_limit(path, speed_m_s, s) ** 2
    gain = 2.0 * ACCELERATION_M_S2 * step
    for before in (-1, 1):  # speed up no faster than ACCELERATION_M_S2, then the same for slowing down
        for k in range(2 * count) if before < 0 else range(2 * count, 0, -1):
            square[k % count] = min(square[k % count], square[(k + before) % count] + gain)
    speed = np.sqrt(square)
    ring = np.append(speed, speed[0])
    arrival = np.concatenate([[0.0], np.cumsum(2.0 * step / (ring[1:] + ring[:-1]))])
    n = int(np.ceil(arrival[-1] / STEP_S))
    even = np.linspace(0.0, arrival[-1], n, endpoint=False)
    return np.asarray(gaussian_filter1d(np.interp(even, arrival, ring), SMOOTHING_S / STEP_S, mode="wrap"))


def _phase_over_time(rate: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n + 1,) phase over one loop and (n,) its rate: an even number of steps, as near to `rate` as can be."""
    rate = gaussian_filter1d(np.maximum(rate, SLOWEST_STEP_HZ), RATE_SMOOTHING_S / STEP_S, mode="wrap")
    total = float(np.sum(rate)) * STEP_S
    steps = max(1, round(total))
    if steps % 2:
        steps += 1 if total > steps or steps == 1 else -1
    rate = rate * (steps / total)
    closed = np.append(rate, rate[0])
    return np.concatenate([[0.0], np.cumsum(0.5 * (closed[1:] + closed[:-1]))]) * STEP_S, rate
