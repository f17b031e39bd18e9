"""The people of a scenario as objects of the scene."""

import math
from collections.abc import Mapping

from scenarios.errors import ScenarioError, unknown
from scenarios.spec import (
    Act,
    PersonSpec,
    PushAct,
    Scenario,
    SitAct,
    SitDownAct,
    StandAct,
    StandUpAct,
    ThingSpec,
    TurnAct,
    WalkAct,
    WalkLoopAct,
)
from sim.errors import MotionError
from sim.people.body import Body, Soles
from sim.people.characters import CHARACTERS, Character, load_character
from sim.people.grip import Grip, box_grip, cup_grip
from sim.people.motion import PersonMotion
from sim.people.script import Script
from sim.people.seat import Seat
from sim.scene import SceneObject
from sim.things.boxes import DEFAULT_SIZE_M
from sim.things.chairs import SEAT_HEIGHT_M

FIRST_PERSON_ID = 1

HIPS_BEHIND_SEAT_M = 0.065
"""The hip joints of a sitting person are this far behind the middle of the seat."""


def build_cast(scenario: Scenario) -> tuple[SceneObject, ...]:
    """The people, in order; every motion is a `sim.people.motion.PersonMotion`.

    Raises:
        ScenarioError: no such character or outfit, or acts that do not follow on each other.
        SimError: a motion cannot be built.
    """
    things = {thing.name: thing for thing in scenario.things}
    return tuple(
        _person(person, scenario, things, FIRST_PERSON_ID + number)
        for number, person in enumerate(scenario.people.cast)
    )


def _person(spec: PersonSpec, scenario: Scenario, things: Mapping[str, ThingSpec], instance_id: int) -> SceneObject:
    if spec.character not in CHARACTERS:
        raise unknown("character", spec.character, CHARACTERS)
    if spec.outfit not in CHARACTERS[spec.character]:
        raise unknown(f"outfit of {spec.character}", spec.outfit, CHARACTERS[spec.character])
    character = load_character(spec.character, spec.outfit)
    return SceneObject(
        name=spec.name,
        class_name="person",
        instance_id=instance_id,
        surfaces=character.surfaces,
        motion=_motion(spec, scenario, things, character),
        is_actor=True,
        keypoints=character.keypoints,
    )


def _motion(
    spec: PersonSpec, scenario: Scenario, things: Mapping[str, ThingSpec], character: Character
) -> PersonMotion:
    body = Body(character.skeleton, Soles.of(character))
    script = Script(
        body,
        spec.position_m,
        math.radians(spec.heading_deg),
        seat=None if spec.seated_on is None else seat_of(things[spec.seated_on]),
        grip=None if spec.carries is None else _grip(body, things[spec.carries]),
        name=spec.name,
        seed=scenario.seed,
    )
    for act in spec.acts:
        try:
            _perform(script, act, spec, scenario.people.speed, things)
        except MotionError as error:
            raise ScenarioError(f"{spec.name}: {error}") from error
    return script.motion()


def _perform(script: Script, act: Act, spec: PersonSpec, speed: float, things: Mapping[str, ThingSpec]) -> None:
    """Add one act of a scenario to the script."""
    match act:
        case WalkLoopAct():
            way = (spec.position_m, *act.waypoints_m)
            script.walk_loop(way, act.speed_m_s * speed, closed=act.closed, start_m=act.start_m)
        case WalkAct():
            script.walk(act.waypoints_m, act.speed_m_s * speed)
        case StandAct():
            script.stand(act.duration_s, act.amplitude)
        case TurnAct():
            script.turn(math.radians(act.heading_deg))
        case SitDownAct():
            script.sit_down(seat_of(things[act.chair]))
        case SitAct():
            script.sit(act.duration_s, act.amplitude)
        case StandUpAct():
            script.stand_up()
        case PushAct():
            chair = things[act.chair]
            heading = math.radians(chair.heading_deg)
            script.push(act.chair, chair.position_m[:2], heading, act.distance_m, act.speed_m_s * speed)


def seat_of(chair: ThingSpec) -> Seat:
    """The seat of an office chair where it stands at the beginning."""
    heading = math.radians(chair.heading_deg)
    x, y, foot = chair.position_m
    return Seat(
        position_world=(x - HIPS_BEHIND_SEAT_M * math.cos(heading), y - HIPS_BEHIND_SEAT_M * math.sin(heading)),
        heading_rad=heading,
        height_m=foot + SEAT_HEIGHT_M,
    )


def _grip(body: Body, thing: ThingSpec) -> Grip:
    return cup_grip(body) if thing.kind == "cup" else box_grip(body, thing.size_m or DEFAULT_SIZE_M)
