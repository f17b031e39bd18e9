"""A scenario's people become motions: acts by name, seats, carried things, one clear line when it cannot be."""

import numpy as np
import pytest

from scenarios.cast import HIPS_BEHIND_SEAT_M, build_cast
from scenarios.errors import ScenarioError
from scenarios.spec import (
    PeopleSpec,
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

CHAIR = ThingSpec(name="blue_chair", kind="chair", look="blue", position_m=(2.0, 0.0, 0.0), heading_deg=90)
CUP = ThingSpec(name="mug", kind="cup", position_m=(0.0, 0.0, 0.0))
BOX = ThingSpec(name="parcel", kind="box", position_m=(0.0, 0.0, 0.0), size_m=(0.3, 0.2, 0.2))


def scenario(*acts, speed=1.0, things=(CHAIR, CUP, BOX), **changes):
    person = PersonSpec(name="anton", character="man", outfit="plaid", acts=acts, **changes)
    return Scenario(name="x", description="", things=things, people=PeopleSpec(speed=speed, cast=(person,)))


def motion(*acts, **changes):
    (anton,) = build_cast(scenario(*acts, **changes))
    return anton.motion


def test_a_person_has_keypoints_and_an_id():
    (anton,) = build_cast(scenario(StandAct(duration_s=1.0)))
    assert (anton.class_name, anton.instance_id, anton.is_actor) == ("person", 1, True)
    assert anton.keypoints.points.shape == (17, 3)


def test_every_act_is_performed_under_its_name():
    acts = (
        StandAct(duration_s=1.0),
        WalkAct(waypoints_m=((1.0, 0.5), (2.0, 0.5))),
        TurnAct(heading_deg=45.0),
        SitDownAct(chair="blue_chair"),
        SitAct(duration_s=2.0),
        StandUpAct(),
        WalkAct(waypoints_m=((1.0, 0.4), (1.0, -0.7), (2.0, -0.9))),
        PushAct(chair="blue_chair", distance_m=1.0),
    )
    found = motion(*acts)
    assert [act.name for act in found.acts] == [act.kind for act in acts]
    assert [push.chair for push in found.pushes] == ["blue_chair"]
    sat = found.acts[4].end_s
    np.testing.assert_allclose(found.pose_at(sat)[:3, 3], [2.0, -HIPS_BEHIND_SEAT_M, 0.0], atol=1e-9)


def test_who_is_seated_sits_where_the_chair_looks():
    found = motion(SitAct(duration_s=2.0), seated_on="blue_chair")
    np.testing.assert_allclose(found.pose_at(0.0)[:3, 3], [2.0, -HIPS_BEHIND_SEAT_M, 0.0], atol=1e-9)
    np.testing.assert_allclose(-found.pose_at(0.0)[:2, 1], [0.0, 1.0], atol=1e-9)


def test_the_speed_of_people_is_a_factor_on_walks_and_loops():
    way = ((4.0, 0.0), (4.0, 2.0), (0.0, 2.0))
    slow, fast = (motion(WalkAct(waypoints_m=way, speed_m_s=1.0), speed=s).acts[0].duration_s for s in (0.8, 1.4))
    assert slow > 1.25 * fast
    loops = [motion(WalkLoopAct(waypoints_m=way, speed_m_s=1.0), speed=s).stretches[0].duration_s for s in (0.8, 1.4)]
    assert loops[0] > 1.25 * loops[1]


def test_things_are_carried_in_one_hand_or_two():
    assert motion(StandAct(duration_s=1.0), carries="mug").grip.held.tolist() == [0.0, 1.0]
    wrists = motion(StandAct(duration_s=1.0), carries="parcel").grip.wrists[:, 0, 3]
    assert wrists[0] - wrists[1] == pytest.approx(0.344)


@pytest.mark.parametrize(
    ("acts", "changes", "message"),
    [
        ((SitAct(duration_s=1.0),), {}, "anton: sit: the person stands"),
        ((WalkAct(waypoints_m=((1.0, 0.0),)),), {"seated_on": "blue_chair"}, "anton: walk: the person sits"),
        ((SitDownAct(chair="blue_chair"),), {}, r"anton: the person is .* m from where it must stand: walk to \(2.00,"),
        ((WalkAct(waypoints_m=((3.0, 0.0),)),), {"speed": 2.0}, "anton: speed_m_s: people walk at"),
        ((PushAct(chair="blue_chair", distance_m=1.0),), {"carries": "mug"}, "anton: push: the person carries"),
    ],
)
def test_acts_that_do_not_follow_are_one_clear_line(acts, changes, message):
    with pytest.raises(ScenarioError, match=message):
        motion(*acts, **changes)


def test_a_loop_stands_alone():
    with pytest.raises(ValueError, match="only act"):
        scenario(StandAct(duration_s=1.0), WalkLoopAct(waypoints_m=((1.0, 0.0), (1.0, 1.0))))
