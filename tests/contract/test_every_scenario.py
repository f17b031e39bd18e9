"""What holds for every registered scenario; those that share all their frames are rendered once."""

import hashlib

import numpy as np
import pytest

from scenarios.cast import build_cast
from scenarios.registry import RENDERED_AS, SCENARIOS
from scenarios.spec import Scenario, with_overrides
from scenarios.world import build_simulator
from sim.records import SimFrame
from sim.simulator import Simulator


def small(name: str, **overrides: str) -> Scenario:
    """The scenario at a quarter of its size, for speed."""
    quarter = {"camera.width": "160", "camera.height": "120", "camera.fx": "133.85", "camera.fy": "134.8"}
    centre = {"camera.cx": "79.65", "camera.cy": "61.5"}
    return with_overrides(SCENARIOS[name], {**quarter, **centre, **overrides})


def simulator_of(name: str) -> Simulator:
    return build_simulator(small(name), "numba", 1)


def digest(frame: SimFrame) -> str:
    return hashlib.sha256(frame.rgb.tobytes() + frame.depth_m.tobytes()).hexdigest()


@pytest.mark.parametrize("name", sorted(set(RENDERED_AS.values())))
def test_a_frame_is_complete_and_the_same_every_time(name: str) -> None:
    middle = SCENARIOS[name].frames // 2
    simulator = simulator_of(name)
    frame = simulator.frame(middle)
    simulator.frame(0)
    assert digest(frame) == digest(simulator.frame(middle)), "a frame depends on what was rendered before it"

    truth = frame.truth
    assert np.isfinite(frame.depth_m).all()
    assert (truth.depth_m > 0).all(), "a hole in the room"
    np.testing.assert_allclose(truth.T_world_camera[:3, :3] @ truth.T_world_camera[:3, :3].T, np.eye(3), atol=1e-6)
    for actor in truth.objects:
        pixels = truth.instance_ids == actor.instance_id
        assert actor.visible_pixels == np.count_nonzero(pixels)
        assert 0 <= actor.occlusion <= 1
        assert actor.is_moving == (actor.surface_speed_m_s > 0.02)
        assert (actor.ideal_world is None) == (actor.visible_pixels == 0)
        assert 0 < actor.centre_world[2] < 1.3, f"the centre of {actor.name} is not above the floor"
        if actor.ideal_world is not None and actor.occlusion < 0.1 and not actor.is_truncated:
            assert np.linalg.norm(actor.ideal_world - actor.centre_world) < 0.5


def test_another_simulator_with_two_threads_gives_the_same_bytes_and_another_seed_gives_others() -> None:
    one = digest(simulator_of("smoke").frame(3))
    assert one == digest(build_simulator(small("smoke"), "numba", 2).frame(3))
    assert one != digest(build_simulator(small("smoke", seed="1"), "numba", 1).frame(3))


@pytest.mark.parametrize("name", [n for n in SCENARIOS if "walking" in n])
def test_walking_people_always_move_and_stay_in_the_room(name: str) -> None:
    people = build_cast(SCENARIOS[name])
    assert len(people) == 2
    for person in people:
        for time_s in np.linspace(0, SCENARIOS[name].duration_s, 40):
            x, y, z = person.motion.pose_at(time_s)[:3, 3]
            assert abs(x) < 3.2
            assert -2.1 < y < 2.5
            assert abs(z) < 1e-6
    one, other = (person.motion for person in people)
    for time_s in np.linspace(0, 10, 60):
        gap = one.pose_at(time_s)[:2, 3] - other.pose_at(time_s)[:2, 3]
        assert np.linalg.norm(gap) > 0.6, "two people walk through each other"
