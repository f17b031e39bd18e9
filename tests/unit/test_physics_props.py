"""Things in a scenario: what people push and carry, what is hit, and what the counterfactuals leave."""

import numpy as np
import pytest

from scenarios.cast import build_cast
from scenarios.errors import ScenarioError
from scenarios.props import build_props
from scenarios.spec import (
    ImpulseSpec,
    PeopleSpec,
    PersonSpec,
    PushAct,
    Scenario,
    SitAct,
    StandAct,
    ThingSpec,
    WalkLoopAct,
)
from sim.rooms.room import Obstacle

DESK = Obstacle(centre_m=(0.0, 2.0, 0.37), size_m=(1.5, 0.8, 0.74))


def person(name, *acts, **more):
    return PersonSpec(name=name, character="man", outfit="plaid", acts=acts, **more)


def scenario(*things, cast=(), seconds=6.0, **more):
    frames = round(seconds * 30) + 1
    return Scenario(
        name="x", description="x", frames=frames, things=things, people=PeopleSpec(cast=tuple(cast)), **more
    )


def props(spec):
    return {p.name: p for p in build_props(spec, build_cast(spec), [DESK])}


CHAIR = ThingSpec(name="chair", kind="chair", position_m=(0.0, 0.0, 0.0), heading_deg=0.0)
CUP = ThingSpec(name="cup", kind="cup", look="red", position_m=(0.3, 2.0, 0.74))


def test_every_kind_is_an_actor_of_its_class():
    things = [
        ThingSpec(name=kind, kind=kind, position_m=(k, -2.0, 0.0))
        for k, kind in enumerate(("chair", "box", "cup", "bottle"))
    ]
    made = props(scenario(*things))
    assert [p.class_name for p in made.values()] == ["chair", "box", "cup", "bottle"]
    assert [p.instance_id for p in made.values()] == [51, 52, 53, 54]
    assert all(p.is_actor for p in made.values())
    assert len(made["chair"].motion.palette_at(0.0)) == 7


@pytest.mark.parametrize(("kind", "look", "near"), [("cup", "whte", "white"), ("chair", "blu", "blue")])
def test_an_unknown_look_names_near_ones(kind, look, near):
    with pytest.raises(ScenarioError, match=f"unknown look of a {kind} '{look}'. Did you mean {near}"):
        props(scenario(ThingSpec(name="it", kind=kind, look=look, position_m=(0, 0, 0))))


def test_only_a_box_has_a_size():
    with pytest.raises(ScenarioError, match="a cup has its own size"):
        props(scenario(ThingSpec(name="it", kind="cup", position_m=(0, 0, 0), size_m=(1, 1, 1))))


def test_heading_is_where_the_front_faces():
    made = props(scenario(ThingSpec(name="it", kind="chair", position_m=(0, 0, 0), heading_deg=30.0)))
    front = made["it"].motion.pose_at(0.0)[:3, :3] @ [0, -1, 0]
    assert np.rad2deg(np.arctan2(front[1], front[0])) == pytest.approx(30.0)


def test_a_person_pushes_a_chair_and_it_rolls_on():
    """Straight ahead by the way of the hands, and by what friction leaves after they let go."""
    pusher = person(
        "p", StandAct(duration_s=0.5), PushAct(chair="chair", distance_m=1.2), position_m=(-0.9, 0.0), heading_deg=0.0
    )
    spec = scenario(CHAIR, cast=[pusher], seconds=10.0)
    people = build_cast(spec)
    (push,) = people[0].motion.pushes
    chair = {p.name: p for p in build_props(spec, people, [])}["chair"].motion
    start, end, later = (chair.pose_at(t)[:3, 3] for t in (push.start_s - 0.05, push.end_s, 10.0))
    assert np.array_equal(start, [0, 0, 0])
    assert 0.9 < end[0] < 1.8
    assert later[0] >= end[0] - 0.01
    assert abs(later[1]) < 0.3
    palms = [people[0].motion.hands_at(t).mean(axis=0) for t in np.linspace(push.start_s, push.end_s, 20)]
    back = [chair.pose_at(t) @ [0, 0.31, 0.9, 1] for t in np.linspace(push.start_s, push.end_s, 20)]
    gaps = [b[0] - p[0] for b, p in zip(back, palms, strict=True)]
    assert min(gaps) > -0.06  # the hands do not go through the back
    assert np.allclose(chair.pose_at(9.9), chair.pose_at(10.0))


def test_a_chair_with_a_low_back_cannot_be_pushed():
    pusher = person("p", PushAct(chair="chair", distance_m=1.0), position_m=(-0.9, 0.0), heading_deg=0.0)
    with pytest.raises(ScenarioError, match="chair: its back is too low"):
        props(scenario(CHAIR.model_copy(update={"look": "red_visitor"}), cast=[pusher]))


def test_a_carried_cup_is_where_the_hand_holds_it():
    carrier = person("p", WalkLoopAct(waypoints_m=((1.0, -1.0), (1.0, 0.5))), position_m=(-1.0, -1.0), carries="cup")
    spec = scenario(CUP, cast=[carrier])
    people = build_cast(spec)
    cup = build_props(spec, people, [])[0].motion
    for t in (0.0, 1.3, 4.0):
        assert np.array_equal(cup.pose_at(t), people[0].motion.T_world_grip(t))
    assert not np.allclose(cup.pose_at(0.0), cup.pose_at(2.0), atol=0.1)


def test_what_was_carried_stands_at_its_own_place_when_nobody_is_there():
    carrier = person("p", WalkLoopAct(waypoints_m=((1.0, -1.0), (1.0, 0.5))), position_m=(-1.0, -1.0), carries="cup")
    empty = props(scenario(CUP, cast=[carrier], variant="empty"))["cup"].motion
    frozen = props(scenario(CUP, cast=[carrier], variant="frozen"))["cup"].motion
    assert np.allclose(empty.pose_at(0.0)[:3, 3], CUP.position_m)
    assert frozen.pose_at(0.0)[2, 3] > 0.8
    assert not np.allclose(frozen.pose_at(0.0)[:2, 3], CUP.position_m[:2])


@pytest.mark.parametrize("variant", ["frozen", "empty"])
def test_nothing_is_hit_in_the_counterfactuals(variant):
    hit = ImpulseSpec(time_s=0.5, impulse_n_s=(5.0, 0.0, 0.0))
    spec = scenario(CHAIR.model_copy(update={"impulses": (hit,)}), variant=variant)
    motion = props(spec)["chair"].motion
    assert np.array_equal(motion.palette_at(0.0), motion.palette_at(5.0))
    assert np.array_equal(
        motion.palette_at(0.0), props(spec.model_copy(update={"variant": "moving"}))["chair"].motion.palette_at(0.0)
    )


def test_a_bottle_is_knocked_off_the_desk():
    hit = ImpulseSpec(time_s=1.0, impulse_n_s=(0.0, -0.5, 0.0), height_m=0.15)
    bottle = ThingSpec(name="bottle", kind="bottle", position_m=(0.0, 1.75, 0.74), impulses=(hit,))
    motion = props(scenario(bottle, CUP))["bottle"].motion
    assert motion.pose_at(0.99)[2, 3] == 0.74
    assert motion.pose_at(6.0)[2, 3] < 0.1


def test_a_chair_that_somebody_sits_on_is_not_rolled_away():
    hit = ImpulseSpec(time_s=0.5, impulse_n_s=(12.0, 0.0, 0.0))
    thrown = ThingSpec(name="thrown", kind="chair", position_m=(-1.0, 0.0, 0.0), impulses=(hit,))
    sitter = person("p", SitAct(duration_s=99.0), seated_on="chair")
    made = props(scenario(CHAIR, thrown, cast=[sitter]))
    assert np.array_equal(made["chair"].motion.palette_at(0.0), made["chair"].motion.palette_at(6.0))
    assert -0.9 < made["thrown"].motion.pose_at(6.0)[0, 3] < -0.3


def test_casters_fall_in_behind_their_pins():
    """Pulled along +x for long enough, every caster's wheels point to -x: contact behind the pin."""
    hit = ImpulseSpec(time_s=0.5, impulse_n_s=(14.0, 0.0, 0.0))
    motion = props(scenario(CHAIR.model_copy(update={"impulses": (hit,)})))["chair"].motion
    for bone in range(2, 7):
        trail = motion.palette_at(2.0)[bone, :3, :3] @ [1.0, 0.0, 0.0]
        assert trail[0] < -0.95
