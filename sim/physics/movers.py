"""What nothing stops: the hands of people who push, and people who stand in the way."""

import math
from collections.abc import Sequence

import numpy as np

from sim.geometry import FloatArray
from sim.physics.bodies import Part, Vector
from sim.physics.bullet import BulletWorld, State
from sim.physics.events import Bystander, Pusher

HAND_RADIUS_M = 0.035
PILLAR_RADIUS_M, PILLAR_HEIGHT_M = 0.17, 1.7
"""A person as the things feel it."""
_HAND_FRICTION, _PILLAR_FRICTION = 0.8, 0.4
LOOK_UP_S = 0.1
_HAND_SAMPLE_S = 1 / 60
MARGIN_M = 0.03
"""Things nearer than this may touch within a step."""


class Hand:
    """One hand of a pusher; it may begin inside the thing that it grips, and then stays behind by as much."""

    def __init__(self, world: BulletWorld, pusher: Pusher, places: FloatArray, things: int) -> None:
        others = [thing for thing in range(things) if thing != pusher.thing]
        size = 2 * HAND_RADIUS_M
        ball = Part(kind="sphere", centre_m=(0.0, 0.0, 0.0), size_m=(size, size, size))
        self.pusher, self._places = pusher, places
        self._speeds = np.diff(places, axis=0, append=places[-1:]) / _HAND_SAMPLE_S
        self._world, self._mover = world, world.add_mover(ball, _HAND_FRICTION, others)
        self._behind: FloatArray | None = None

    def is_at_work(self, time_s: float) -> bool:
        """Whether it touches its thing."""
        return self.pusher.start_s <= time_s < self.pusher.end_s

    def place(self, time_s: float) -> None:
        """Move it for the step that begins at a time."""
        if not self.is_at_work(time_s):
            self._world.place_mover(self._mover, None)
            return
        if self._behind is None:
            self._behind = self._depth()
        since_s = time_s - self.pusher.start_s
        k = min(int(since_s / _HAND_SAMPLE_S), len(self._places) - 1)
        here = self._places[k] + (since_s - k * _HAND_SAMPLE_S) * self._speeds[k] + self._behind
        self._world.place_mover(self._mover, _vector(here), _vector(self._speeds[k]))

    def _depth(self) -> FloatArray:
        """(3,) how far the hand must stay behind so as to touch the thing only."""
        self._world.place_mover(self._mover, _vector(self._places[0]))
        way = self._places[-1] - self._places[0]
        length = math.sqrt(float(np.sum(way**2)))
        depth = self._world.overlap_m(self._mover, self.pusher.thing)
        return np.asarray(-depth / max(length, 1e-6) * way)


def hands(world: BulletWorld, pusher: Pusher, things: int) -> list[Hand]:
    """The hands of a pusher; between samples of their places they move evenly."""
    count = math.ceil((pusher.end_s - pusher.start_s) / _HAND_SAMPLE_S) + 1
    times = [min(pusher.start_s + k * _HAND_SAMPLE_S, pusher.end_s) for k in range(count)]
    places = np.stack([pusher.points_at(time_s) for time_s in times])
    return [Hand(world, pusher, places[:, number], things) for number in range(places.shape[1])]


class Pillar:
    """A bystander; between looks at where the person is, it moves evenly."""

    def __init__(self, world: BulletWorld, bystander: Bystander) -> None:
        size = (2 * PILLAR_RADIUS_M, 2 * PILLAR_RADIUS_M, PILLAR_HEIGHT_M)
        part = Part(kind="cylinder", centre_m=(0.0, 0.0, 0.0), size_m=size)
        self._world, self._bystander = world, bystander
        self._mover = world.add_mover(part, _PILLAR_FRICTION, bystander.ignores)
        self._looked, self._from, self._to = -1, np.zeros(2), np.zeros(2)

    def _look(self, time_s: float) -> float:
        """Look where the person is; how much of the interval between two looks has passed."""
        number = int(time_s / LOOK_UP_S)
        if number != self._looked:
            follows = number == self._looked + 1 and number > 0
            self._from = self._to if follows else self._bystander.place_at(number * LOOK_UP_S)
            self._to = self._bystander.place_at((number + 1) * LOOK_UP_S)
            self._looked = number
        return time_s / LOOK_UP_S - number

    def is_near(self, time_s: float, states: Sequence[State], reaches: Sequence[float]) -> bool:
        """Whether it can touch one of the things in this interval."""
        self._look(time_s)
        places = [state.p_world for state in states]
        return any(
            self.touches(k, *place[:2], reach) for k, (place, reach) in enumerate(zip(places, reaches, strict=True))
        )

    def touches(self, k: int, x: float, y: float, reach_m: float) -> bool:
        """Whether it can touch the thing `k` at (x, y) in the interval that was looked up."""
        if k in self._bystander.ignores:
            return False
        (x0, y0), (x1, y1) = self._from.tolist(), self._to.tolist()
        reach = reach_m + PILLAR_RADIUS_M + math.hypot(x1 - x0, y1 - y0) + MARGIN_M
        return (x - x0) ** 2 + (y - y0) ** 2 < reach * reach

    def place(self, time_s: float) -> None:
        """Move it for the step that begins at a time."""
        part = self._look(time_s)
        x, y = (self._from + part * (self._to - self._from)).tolist()
        vx, vy = ((self._to - self._from) / LOOK_UP_S).tolist()
        self._world.place_mover(self._mover, (x, y, PILLAR_HEIGHT_M / 2 + 0.005), (vx, vy, 0.0))


def _vector(values: FloatArray) -> Vector:
    x, y, z = (float(value) for value in values)
    return (x, y, z)
