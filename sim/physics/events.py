"""What moves things: hits, the hands of people who push, and people who stand in the way."""

from collections.abc import Callable
from dataclasses import dataclass

from sim.geometry import FloatArray
from sim.physics.bodies import Body, Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """A thing at time 0.

    Attributes:
        body: see Body.
        position_m: of its foot in the world.
        yaw_rad: about z.
        held: it stays where it is, whatever happens.
    """

    body: Body
    position_m: Vector
    yaw_rad: float = 0.0
    held: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Hit:
    """An impulse that acts at once.

    Attributes:
        thing: index of the thing.
        time_s: when.
        impulse_n_s: (3,) in the world.
        height_m: from the foot of the thing along its axis, where it acts.
        offset_m: how far beside the thing's middle it acts, to the left of the impulse's direction.
    """

    thing: int
    time_s: float
    impulse_n_s: Vector
    height_m: float
    offset_m: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pusher:
    """Hands that push a thing; nothing stops them.

    Attributes:
        thing: index of the thing that is pushed; the hands pass through all others.
        start_s, end_s: when they touch it.
        points_at: (n, 3) places of the hands in the world at a time.
    """

    thing: int
    start_s: float
    end_s: float
    points_at: Callable[[float], FloatArray]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bystander:
    """A person as an upright pillar that nothing stops.

    Attributes:
        place_at: (2,) the pillar's axis on the floor at a time.
        ignores: indices of things that it does not touch: the chair that the person uses, the cup in the hand.
    """

    place_at: Callable[[float], FloatArray]
    ignores: tuple[int, ...] = ()
