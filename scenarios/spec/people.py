"""The people of a scenario, and what they do one after another."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from scenarios.spec.base import Metres2, NotNegative, Positive, Spec

WalkingSpeed = Annotated[float, Field(ge=0.4, le=2.0)]


class WalkLoopAct(Spec):
    """Walk for ever; the only act of a person.

    Attributes:
        waypoints_m: floor positions, from the person's own position on; that position is the first of the loop.
        closed: whether the way leads from the last waypoint to the first; else the person turns there and walks back.
        speed_m_s: on straight parts.
        start_m: how far along the way the person is at time 0.
    """

    kind: Literal["walk_loop"] = "walk_loop"
    waypoints_m: Annotated[tuple[Metres2, ...], Field(min_length=1)]
    closed: bool = True
    speed_m_s: WalkingSpeed = 1.1
    start_m: NotNegative = 0.0


class WalkAct(Spec):
    """Walk to the last of the waypoints, along the others, and stop there.

    A person who faces elsewhere turns on the spot before; as the first act it faces the way from the beginning.
    """

    kind: Literal["walk"] = "walk"
    waypoints_m: Annotated[tuple[Metres2, ...], Field(min_length=1)]
    speed_m_s: WalkingSpeed = 1.1


class StandAct(Spec):
    """Stand at ease; `amplitude` 0 is a statue, 1 breathes and sways. It stays so until another act sets it."""

    kind: Literal["stand"] = "stand"
    duration_s: Positive
    amplitude: Annotated[float, Field(ge=0, le=2)] = 1.0


class TurnAct(Spec):
    """Turn on the spot, with small steps, to face `heading_deg` (0 is along +x)."""

    kind: Literal["turn"] = "turn"
    heading_deg: float


class SitDownAct(Spec):
    """Sit down on a chair where it stands at the beginning, with small steps to the right place before.

    The person must stand within 0.8 m of that place, which is about 0.3 m before the axis of the chair.
    """

    kind: Literal["sit_down"] = "sit_down"
    chair: str


class SitAct(Spec):
    """Sit; `amplitude` is the size of the gestures, 0 is a statue."""

    kind: Literal["sit"] = "sit"
    duration_s: Positive
    amplitude: Annotated[float, Field(ge=0, le=2)] = 1.0


class StandUpAct(Spec):
    """Stand up from the chair."""

    kind: Literal["stand_up"] = "stand_up"


class PushAct(Spec):
    """Push a chair straight ahead by its back with both hands, and let go.

    The person goes behind the chair with small steps before: it must stand within 0.8 m of the place 0.77 m behind the
    axis of the chair where it stands at the beginning.
    """

    kind: Literal["push"] = "push"
    chair: str
    distance_m: Positive
    speed_m_s: WalkingSpeed = 0.8


Act = Annotated[
    WalkLoopAct | WalkAct | StandAct | TurnAct | SitDownAct | SitAct | StandUpAct | PushAct,
    Field(discriminator="kind"),
]


class PersonSpec(Spec):
    """One person.

    Attributes:
        name: unique in the scene.
        character, outfit: see `sim.people.characters.CHARACTERS`.
        position_m: floor position at time 0.
        heading_deg: where the person faces at time 0; 0 is along +x. A walking person faces the way.
        seated_on: name of the chair that the person sits on at time 0; position and heading are then the chair's.
        carries: name of a cup or a box that the person holds all the time.
        acts: what the person does one after another; after the last one the person stands or sits on, at ease.
            `walk_loop` stands alone.
    """

    name: str
    character: str
    outfit: str
    position_m: Metres2 = (0.0, 0.0)
    heading_deg: float = 0.0
    seated_on: str | None = None
    carries: str | None = None
    acts: Annotated[tuple[Act, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _loops_alone(self) -> Self:
        if len(self.acts) > 1 and any(isinstance(act, WalkLoopAct) for act in self.acts):
            raise ValueError("a walk_loop is the only act of a person; use walk for a way that ends")
        return self


class PeopleSpec(Spec):
    """All people. `speed` is a factor on everybody's walking speed."""

    speed: Positive = 1.0
    cast: tuple[PersonSpec, ...] = ()
