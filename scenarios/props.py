"""The things of a scenario as objects of the scene, moved by physics and by people."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

from scenarios.errors import ScenarioError, unknown
from scenarios.spec import PersonSpec, PushAct, Scenario, SitDownAct, ThingSpec
from sim.geometry import FloatArray
from sim.people.handling import Handler
from sim.physics.bake import bake, stand
from sim.physics.events import Bystander, Hit, Pusher, Start
from sim.rooms.room import Obstacle
from sim.scene import Motion, SceneObject
from sim.things.movables import KINDS, Movable, movable

FIRST_THING_ID = 51


@dataclass(frozen=True, slots=True, eq=False)
class Carried:
    """The motion of a thing in somebody's hands.

    Attributes:
        holder: who holds it.
    """

    holder: Handler

    def pose_at(self, time_s: float) -> FloatArray:
        """`T_world_object` (4, 4): the foot of the thing is where the hands hold it."""
        return self.holder.T_world_grip(time_s)

    def palette_at(self, time_s: float) -> FloatArray:
        """(1, 4, 4) rest frame to world."""
        return self.pose_at(time_s)[None]


def build_props(
    scenario: Scenario, people: Sequence[SceneObject], obstacles: Sequence[Obstacle]
) -> tuple[SceneObject, ...]:
    """The things, in order.

    In the variants "frozen" and "empty" nothing moves them; what a person carries is in the hands in "frozen", and at
    its own place in "empty".

    Args:
        scenario: what happens.
        people: its people, who push and carry things.
        obstacles: what things run into and stand on.

    Raises:
        ScenarioError: no such look of a thing, a size that its kind has not, or a push of a low chair.
        SimError: a motion cannot be built.
    """
    made = [_movable(scenario, thing) for thing in scenario.things]
    carried = {} if scenario.variant == "empty" else _carried(scenario, people)
    motions: dict[str, Motion] = dict(carried)
    free = [k for k, thing in enumerate(scenario.things) if thing.name not in carried]
    if scenario.variant == "moving":
        motions |= _simulated(scenario, people, obstacles, [(scenario.things[k], made[k]) for k in free])
    else:
        for k in free:
            motions[scenario.things[k].name] = made[k].motion(stand(_start(scenario.things[k], made[k])))
    return tuple(
        SceneObject(
            name=thing.name,
            class_name=thing.kind,
            instance_id=FIRST_THING_ID + number,
            surfaces=made[number].surfaces,
            motion=motions[thing.name],
            is_actor=True,
        )
        for number, thing in enumerate(scenario.things)
    )


def _movable(scenario: Scenario, thing: ThingSpec) -> Movable:
    if thing.size_m is not None and thing.kind != "box":
        raise ScenarioError(f"{thing.name}: a {thing.kind} has its own size; leave size_m away")
    _, looks = KINDS[thing.kind]
    if thing.look not in (*looks, "default"):
        raise unknown(f"look of a {thing.kind}", thing.look, looks)
    return movable(thing.kind, thing.look, scenario.seed, thing.size_m)


def _carried(scenario: Scenario, people: Sequence[SceneObject]) -> dict[str, Motion]:
    """The motions of what people hold, by name."""
    return {
        spec.carries: Carried(cast(Handler, person.motion))
        for spec, person in zip(scenario.people.cast, people, strict=True)
        if spec.carries is not None
    }


def _simulated(
    scenario: Scenario,
    people: Sequence[SceneObject],
    obstacles: Sequence[Obstacle],
    things: Sequence[tuple[ThingSpec, Movable]],
) -> dict[str, Motion]:
    """The motions of things that physics moves, by name."""
    if not things:
        return {}
    number = {thing.name: k for k, (thing, _) in enumerate(things)}
    duration_s = max(scenario.duration_s, 1.0)
    pushers, bystanders, sat_on = [], [], set()
    for spec, person in zip(scenario.people.cast, people, strict=True):
        used = _used(spec)
        if any(isinstance(act, PushAct) for act in spec.acts):
            handler = cast(Handler, person.motion)
            pushers += [
                Pusher(thing=number[push.chair], start_s=push.start_s, end_s=push.end_s, points_at=handler.hands_at)
                for push in handler.pushes
                if push.start_s < duration_s
            ]
        sat_on |= {act.chair for act in spec.acts if isinstance(act, SitDownAct)} | {spec.seated_on}
        ignored = tuple(number[name] for name in used if name in number)
        bystanders.append(Bystander(place_at=_Footing(person.motion), ignores=ignored))
    pushed = {things[push.thing][0].name for push in pushers}
    for thing, made in things:
        if thing.name in pushed and made.body.top is None:
            raise ScenarioError(
                f"{thing.name}: its back is too low to be pushed by hand; give it the look of an office chair"
            )
    starts = [
        _start(thing, made, held=thing.name in sat_on and not thing.impulses and thing.name not in pushed)
        for thing, made in things
    ]
    hits = [
        Hit(
            thing=k,
            time_s=hit.time_s,
            impulse_n_s=hit.impulse_n_s,
            height_m=hit.height_m,
            offset_m=hit.offset_m,
        )
        for k, (thing, _) in enumerate(things)
        for hit in thing.impulses
        if hit.time_s < duration_s
    ]
    baked = bake(
        starts,
        obstacles,
        duration_s,
        names=[thing.name for thing, _ in things],
        hits=hits,
        pushers=pushers,
        bystanders=bystanders,
    )
    return {thing.name: made.motion(motion) for (thing, made), motion in zip(things, baked, strict=True)}


@dataclass(frozen=True, slots=True, eq=False)
class _Footing:
    """Where a person stands, as physics asks for it."""

    motion: Motion

    def __call__(self, time_s: float) -> FloatArray:
        return self.motion.pose_at(time_s)[:2, 3]


def _used(spec: PersonSpec) -> list[str]:
    """The chairs that a person sits on or pushes."""
    chairs = [act.chair for act in spec.acts if isinstance(act, SitDownAct | PushAct)]
    return chairs if spec.seated_on is None else [*chairs, spec.seated_on]


def _start(thing: ThingSpec, made: Movable, *, held: bool = False) -> Start:
    """A thing at yaw 0 faces -y, at heading 0 it faces +x."""
    yaw_rad = math.radians(thing.heading_deg + 90.0)
    return Start(body=made.body, position_m=thing.position_m, yaw_rad=yaw_rad, held=held)
