"""Walking from one place to another, and small steps on the spot: from standing at ease to standing at ease."""

import numpy as np
from scipy.ndimage import gaussian_filter1d

from sim.errors import MotionError
from sim.geometry import FloatArray
from sim.people import gait
from sim.people.steps import STEP_S, Steps
from sim.people.walk_path import WalkPath
from sim.people.walk_plan import (
    ACCELERATION_M_S2,
    DISTANCE_STEP_M,
    PRINT_PHASE,
    RATE_SMOOTHING_S,
    SLOWEST_STEP_HZ,
    SMOOTHING_S,
    TURN_PER_STEP_RAD,
    check_speed,
    speed_limit,
)

SHORTEST_WALK_M = 0.6
STILL_M_S = 0.02

CLOSING_S = 0.55
"""In this time the second foot is drawn up after the walker has come to a stop."""

REST_PHASE = 0.12
"""How far the phase is past a whole number while the person stands: both feet are on the floor then."""

SPOT_STEP_HZ = 1.8
SPOT_TURN_PER_STEP_RAD = 0.62
SPOT_STEP_M = 0.16
SPOT_SIZE = 0.3
"""Size of the gait in small steps on the spot."""
SPOT_RAMP = 0.2
LOOK_AHEAD_RAD = 0.6
"""Who turns looks so far ahead of the body."""


def one_way_steps(path: WalkPath, speed_m_s: float, leg_m: float) -> Steps:
    """From standing at the start of `path` to standing at its end.

    Args:
        path: one way.
        speed_m_s: on straight parts; the walker speeds up and slows down at ACCELERATION_M_S2, also for turns.
        leg_m: length of the leg, see `Body`.

    Raises:
        MotionError: the way is too short, or the speed is not one of walking.
    """
    check_speed(speed_m_s)
    if path.length_m < SHORTEST_WALK_M:
        raise MotionError(f"a walk of {path.length_m:.2f} m is too short: {SHORTEST_WALK_M} m or more, or leave it out")
    speed = _speed_over_time(path, speed_m_s)
    distance = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))]) * STEP_S
    speed *= path.length_m / distance[-1]
    distance *= path.length_m / distance[-1]
    turn_rate = np.abs(path.curvature_at(distance)) * speed
    wanted = np.hypot(gait.step_rate_hz(speed, leg_m), turn_rate / TURN_PER_STEP_RAD)
    stepping = speed > STILL_M_S
    last = len(speed) - int(np.argmax(stepping[::-1]))
    stepping[last : last + round(CLOSING_S / STEP_S)] = True
    rate = np.where(stepping, np.maximum(wanted, SLOWEST_STEP_HZ), 0.0)
    rate = gaussian_filter1d(rate, RATE_SMOOTHING_S / STEP_S, mode="constant")
    phase = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]))]) * STEP_S
    count = max(2, round(float(phase[-1])))
    phase = REST_PHASE + phase * (count / phase[-1])
    number = np.arange(-1, count + 1)
    at = np.interp(number + PRINT_PHASE, phase, distance)
    at[:2], at[-2:] = 0.0, path.length_m
    size = np.interp(at, distance, gait.amplitude(speed))
    size[:2], size[-2:] = 0.0, 0.0
    return Steps(
        root_world=path.position_at(distance),
        heading=np.unwrap(path.heading_at(distance)),
        size=gait.amplitude(speed),
        phase=phase,
        look=np.zeros(len(phase)),
        first=-1,
        print_world=path.position_at(at),
        print_heading=path.heading_at(at),
        print_size=size,
        is_loop=False,
    )


def steps_on_the_spot(
    start_world: FloatArray, start_heading: float, end_world: FloatArray, end_heading: float
) -> Steps:
    """From standing at one place and heading to standing at another one near by, the shorter way round.

    Args:
        start_world: (2,) metres.
        start_heading: radians, from the world's x axis.
        end_world: (2,) metres.
        end_heading: radians.
    """
    turn = float(np.mod(end_heading - start_heading + np.pi, 2.0 * np.pi) - np.pi)
    way = np.asarray(end_world, float) - start_world
    least = max(abs(turn) / SPOT_TURN_PER_STEP_RAD, float(np.hypot(*way)) / SPOT_STEP_M)
    count = max(2, int(np.ceil(least)) + 1)
    to_left = float(way @ [-np.sin(start_heading), np.cos(start_heading)])
    left_first = turn > 0.0 if abs(turn) > abs(to_left) else to_left > 0.0
    n = round((count / (1.0 - SPOT_RAMP) / SPOT_STEP_HZ) / STEP_S)
    share = np.linspace(0.0, 1.0, n + 1)
    first = -1 if left_first else 0  # the foot that stands on the lower number steps first
    begin = first + 1 + REST_PHASE
    phase = begin + count * eased(share, SPOT_RAMP)

    def moved(at: FloatArray) -> FloatArray:  # the body is there before the last but one foot is put down
        return eased(np.asarray(np.clip((at - begin - 0.1) / (count - 0.75), 0.0, 1.0)), SPOT_RAMP)

    number = np.arange(first, first + count + 2, dtype=float)
    done = moved(number + PRINT_PHASE)
    done[:2], done[-2:] = 0.0, 1.0
    going = moved(phase)
    busy = np.minimum(1.0, np.minimum(share, 1.0 - share) / SPOT_RAMP)
    gone = start_world + going[:, None] * way
    left = turn * (1.0 - going)
    look = np.clip(left, -LOOK_AHEAD_RAD, LOOK_AHEAD_RAD) * eased(np.clip((phase - begin) / 0.8, 0.0, 1.0), 0.5)
    return Steps(
        root_world=gone,
        heading=start_heading + going * turn,
        size=SPOT_SIZE * busy * busy * (3.0 - 2.0 * busy),
        phase=phase,
        look=gaussian_filter1d(look, 0.08 / STEP_S, mode="nearest"),
        first=first,
        print_world=start_world + done[:, None] * way,
        print_heading=start_heading + done * turn,
        print_size=np.zeros(len(number)),
        is_loop=False,
    )


def eased(share: FloatArray, ramp: float) -> FloatArray:
    """0..1 for 0..1: the rate rises and falls as a raised cosine over `ramp` (at most 0.5) and is constant between."""
    rising, falling = np.minimum(share, ramp), np.clip(share - 1.0 + ramp, 0.0, ramp)
    k = np.pi / ramp
    risen = 0.5 * (rising - np.sin(k * rising) / k)
    fallen = 0.5 * (falling + np.sin(k * falling) / k)
    steady = np.clip(share, ramp, 1.0 - ramp) - ramp
    return np.asarray((risen + steady + fallen) / (1.0 - ramp))


def _speed_over_time(path: WalkPath, speed_m_s: float) -> FloatArray:
    """(n,) m/s every STEP_S: from 0 to 0, and 0 until the second foot has been drawn up."""
    count = round(path.length_m / DISTANCE_STEP_M)
    step = path.length_m / count
    s = np.linspace(0.0, path.length_m, count + 1)
    square = speed_limit(path, speed_m_s, s) ** 2
    square[0] = square[-1] = 0.0
    gain = 2.0 * ACCELERATION_M_S2 * step
    for k in range(1, count + 1):
        square[k] = min(square[k], square[k - 1] + gain)
    for k in range(count - 1, -1, -1):
        square[k] = min(square[k], square[k + 1] + gain)
    speed = np.sqrt(square)
    arrival = np.concatenate([[0.0], np.cumsum(2.0 * step / (speed[1:] + speed[:-1]))])
    before = 3.0 * max(SMOOTHING_S, RATE_SMOOTHING_S)
    even = np.arange(0.0, before + arrival[-1] + before + CLOSING_S, STEP_S)
    sampled = np.interp(even - before, arrival, speed)
    return np.asarray(gaussian_filter1d(sampled, SMOOTHING_S / STEP_S, mode="constant", truncate=3.0))
