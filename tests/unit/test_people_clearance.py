"""The room that people take up, against distances that can be worked out by hand."""

import numpy as np
import pytest

from sim.geometry import pose, rotation_z
from sim.people.clearance import HALF_DEPTH_M, SHOULDER_HALF_WIDTH_M, clearances, outline
from sim.rooms.room import Obstacle


class Going:
    """Goes along x at 1 m/s, facing -y when `yaw` is 0."""

    def __init__(self, start, speed=1.0, yaw=0.0):
        self.start, self.speed, self.yaw = start, speed, yaw

    def pose_at(self, time_s):
        x, y = self.start
        return pose(rotation_z(self.yaw), (x + self.speed * time_s, y, 0.0))


def test_a_person_is_as_wide_as_its_shoulders():
    ring = outline(Going((1.0, 2.0), yaw=np.pi / 2), 0.0)
    np.testing.assert_allclose(ring.mean(axis=0), [1.0, 2.0], atol=1e-12)
    np.testing.assert_allclose(np.ptp(ring, axis=0) / 2, [HALF_DEPTH_M, SHOULDER_HALF_WIDTH_M], atol=1e-12)


@pytest.mark.parametrize("yaw", [0.0, 0.7])
def test_distance_to_a_box_in_passing(yaw):
    turn = rotation_z(yaw)[:2, :2]
    box = Obstacle(centre_m=(*(turn @ [2.0, 1.0]), 0.4), size_m=(1.0, 0.6, 0.8), yaw_rad=yaw)

    class Turned(Going):
        def pose_at(self, time_s):
            return pose(rotation_z(yaw), (0, 0, 0)) @ super().pose_at(time_s)

    (found,) = clearances({"anton": Turned((0.0, 0.0))}, {"desk": box}, np.arange(0.0, 4.0, 0.05))
    assert (found.person, found.other) == ("anton", "desk")
    assert found.distance_m == pytest.approx(0.7 - HALF_DEPTH_M, abs=1e-3)
    assert 1.4 < found.time_s < 2.6


def test_who_walks_through_something_has_no_distance():
    wall = Obstacle(centre_m=(2.0, 0.0, 1.0), size_m=(0.1, 3.0, 2.0))
    times = np.arange(0.0, 4.0, 0.05)
    (found,) = clearances({"anton": Going((0.0, 0.0))}, {"wall": wall}, times)
    assert found.distance_m == 0.0
    assert found.time_s == pytest.approx((1.95 - SHOULDER_HALF_WIDTH_M), abs=0.051)
    inside = Obstacle(centre_m=(0.0, 0.0, 1.0), size_m=(9.0, 9.0, 2.0))
    assert clearances({"anton": Going((0.0, 0.0))}, {"around": inside}, [0.0])[0].distance_m == 0.0


def test_two_people_meet():
    people = {"anton": Going((-2.0, 0.0)), "berta": Going((2.0, 0.5), speed=-1.0)}
    (found,) = clearances(people, {}, np.arange(0.0, 4.0, 0.01))
    assert found.distance_m == pytest.approx(0.5 - 2 * HALF_DEPTH_M, abs=1e-3)
    assert found.time_s == pytest.approx(2.0, abs=0.06)


def test_carpets_and_lamps_are_in_nobodys_way():
    carpet = Obstacle(centre_m=(0.0, 0.0, 0.02), size_m=(3.0, 3.0, 0.04))
    lamp = Obstacle(centre_m=(0.0, 0.0, 2.2), size_m=(1.0, 1.0, 0.4))
    assert clearances({"anton": Going((0.0, 0.0))}, {"carpet": carpet, "lamp": lamp}, [0.0]) == ()


def test_the_nearest_pair_comes_first():
    boxes = {
        name: Obstacle(centre_m=(0.0, y, 0.5), size_m=(1.0, 0.2, 1.0)) for name, y in (("far", 3.0), ("near", 1.0))
    }
    found = clearances({"anton": Going((0.0, 0.0), speed=0.0)}, boxes, [0.0])
    assert [pair.other for pair in found] == ["near", "far"]


def test_many_times_at_once_give_the_least_of_each_time_alone():
    """Times that cannot be the nearest ones are left out; what comes back and goes again must not be."""

    class Weaving:
        def __init__(self, rate, reach):
            self.rate, self.reach = rate, reach

        def pose_at(self, time_s):
            at = (np.cos(self.rate * time_s) * self.reach, np.sin(1.7 * self.rate * time_s), 0.0)
            return pose(rotation_z(2.0 * time_s), at)

    people = {"anton": Weaving(0.9, 3.0), "berta": Weaving(1.3, 2.0)}
    boxes = {
        f"box{k}": Obstacle(
            centre_m=(1.7 * np.cos(k), 2.2 * np.sin(k), 0.5), size_m=(0.2 + 0.2 * k, 0.3, 1.0), yaw_rad=k
        )
        for k in range(4)
    }
    times = np.arange(0.0, 9.0, 0.15)
    alone = [{(p.person, p.other): p.distance_m for p in clearances(people, boxes, [t])} for t in times]
    for pair in clearances(people, boxes, times):
        key = (pair.person, pair.other)
        assert pair.distance_m == min(found[key] for found in alone)
        assert pair.time_s == times[[found[key] for found in alone].index(pair.distance_m)]
