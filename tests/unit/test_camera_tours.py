"""Cameras that are carried through a room: by hand from stop to stop, on wheels, behind a person."""

import numpy as np
import pytest

from sim.camera_paths.tour import Stop, TourPath
from sim.camera_paths.wheeled import RAMP_S, FloorWay, FollowingPath, RobotPath
from sim.errors import CameraPathError
from sim.geometry import look_at, pose, rotation_z

STOPS = (
    Stop(time_s=0.0, position_world=(0, -2, 1.4), target_world=(0, 1, 1)),
    Stop(time_s=3.0, position_world=(1, -2, 1.5), target_world=(0, 1, 1), roll_rad=np.pi / 2),
    Stop(time_s=7.0, position_world=(1, -1, 1.2), target_world=(0.5, 1, 1), roll_rad=np.pi),
)


def path_of(kind):
    if kind == "tour":
        return TourPath(STOPS)
    if kind == "robot":
        return RobotPath(((0, 0), (1, 2), (0, 4)), speed_m_s=0.5, height_m=0.8)
    return FollowingPath(Circling(), distance_m=1.5, height_m=0.9, gaze_m=1.0, duration_s=20.0)


class Circling:
    """A person on a circle of 2 m radius, at 1 m/s."""

    def pose_at(self, time_s):
        angle = time_s / 2
        # The person faces -y of its own frame, and walks along the circle counter-clockwise.
        return pose(rotation_z(angle + np.pi), (2 * np.cos(angle), 2 * np.sin(angle), 0.0))

    def palette_at(self, time_s):
        return self.pose_at(time_s)[None]


class Starting:
    """A person who stands at the origin, walks along +x at 1 m/s from 2 s to 8 s, and stands again."""

    def pose_at(self, time_s):
        return pose(rotation_z(np.pi / 2), (np.clip(time_s - 2.0, 0.0, 6.0), 0.0, 0.0))

    def palette_at(self, time_s):
        return self.pose_at(time_s)[None]


@pytest.mark.parametrize("kind", ["tour", "robot", "follow"])
def test_every_pose_is_rigid_and_a_function_of_time(kind):
    path, again = path_of(kind), path_of(kind)
    for time_s in np.linspace(0.0, 15.0, 40):
        T = path.pose_at(time_s)
        assert T[:3, :3] @ T[:3, :3].T == pytest.approx(np.eye(3), abs=1e-9)
        assert np.linalg.det(T[:3, :3]) == pytest.approx(1.0)
        assert np.array_equal(T, again.pose_at(time_s))


@pytest.mark.parametrize("kind", ["tour", "robot", "follow"])
def test_a_path_is_smooth(kind):
    """The velocity jumps nowhere, not where a tour turns back either."""
    path = path_of(kind)
    times = np.arange(0.0, 17.0, 1 / 60)
    poses = np.array([path.pose_at(t) for t in times])
    assert np.abs(np.diff(poses[:, :3], n=2, axis=0)).max() * 60**2 < 12.0


def test_a_tour_without_shake_passes_its_stops():
    path = TourPath(STOPS, amplitude=0.0)
    for stop in STOPS:
        T = path.pose_at(stop.time_s)
        assert T[:3, 3] == pytest.approx(stop.position_world)
        forward = np.subtract(stop.target_world, stop.position_world)
        assert T[:3, 2] == pytest.approx(forward / np.linalg.norm(forward))
    assert path.pose_at(0.0) == pytest.approx(look_at((0, -2, 1.4), (0, 1, 1)))
    assert path.pose_at(7.0)[2, 1] > 0.9, "upside down, the image's down points up"


def test_a_rolled_camera_turns_clockwise_as_seen_from_behind():
    """At a quarter turn clockwise the image's right points down to the floor."""
    assert TourPath(STOPS, amplitude=0.0).pose_at(3.0)[:3, 0] == pytest.approx((0, 0, -1), abs=0.17)


def test_a_tour_goes_back_at_its_end_and_a_faster_one_takes_less_time():
    path, faster = TourPath(STOPS, amplitude=0.0), TourPath(STOPS, amplitude=0.0, speed=2.0)
    assert path.pose_at(8.5) == pytest.approx(path.pose_at(5.5))
    assert faster.pose_at(2.0) == pytest.approx(path.pose_at(4.0))


def test_the_shake_of_a_hand_is_small():
    still, held = TourPath(STOPS, amplitude=0.0), TourPath(STOPS)
    apart = [np.linalg.norm(still.pose_at(t)[:3, 3] - held.pose_at(t)[:3, 3]) for t in np.linspace(0, 7, 50)]
    assert 0.001 < max(apart) < 0.03


@pytest.mark.parametrize(
    ("stops", "message"),
    [
        (STOPS[:1], "at least 2 stops"),
        (STOPS[1:], "begin at 0"),
        ((STOPS[0], STOPS[0]), "increase"),
        ((STOPS[0], Stop(time_s=1, position_world=(0, -2, 1), target_world=(0, -2, 3))), "straight above"),
        ((STOPS[0], Stop(time_s=1, position_world=(0, -2, 1), target_world=(0, -2, 1.1))), "less than 0.2 m"),
    ],
)
def test_a_tour_that_cannot_be_gone_is_refused(stops, message):
    with pytest.raises(CameraPathError, match=message):
        TourPath(stops)


def test_a_floor_way_is_measured_by_arc_length():
    angles = np.linspace(0, np.pi, 25)
    way = FloorWay(np.stack([np.cos(angles), np.sin(angles)], axis=1))
    assert way.length_m == pytest.approx(np.pi, rel=1e-3)
    assert way.position_at(np.pi / 2) == pytest.approx((0, 1), abs=2e-3)
    assert abs(way.heading_at(np.pi / 2)) == pytest.approx(np.pi, abs=5e-3)


def test_a_robot_keeps_its_speed_stays_level_and_looks_ahead():
    path = RobotPath(((0, 0), (0, 3), (0.5, 6)), speed_m_s=0.5, height_m=0.8, amplitude=0.0)
    start, end = RAMP_S, path.duration_s - RAMP_S
    for time_s in np.linspace(start, end - 0.02, 30):
        T, later = path.pose_at(time_s), path.pose_at(time_s + 0.01)
        step = (later[:3, 3] - T[:3, 3]) / 0.01
        assert np.linalg.norm(step) == pytest.approx(0.5, abs=0.003)
        assert T[2, 3] == pytest.approx(0.8)
        assert T[:3, 2] @ step / 0.5 == pytest.approx(1.0, abs=1e-3)
        assert T[2, 0] == pytest.approx(0.0)
        assert T[2, 2] == pytest.approx(0.0, abs=1e-12)
    assert path.pose_at(path.duration_s)[:2, 3] == pytest.approx((0.5, 6.0), abs=1e-6)
    assert path.pose_at(0.0)[:2, 3] == pytest.approx((0.0, 0.0), abs=1e-6)


def test_a_robot_trembles_a_little():
    still, rolling = (RobotPath(((0, 0), (0, 4)), speed_m_s=0.5, height_m=0.8, amplitude=a) for a in (0.0, 1.0))
    apart = [np.linalg.norm(still.pose_at(t)[:3, 3] - rolling.pose_at(t)[:3, 3]) for t in np.linspace(0, 6, 60)]
    assert 1e-4 < max(apart) < 2e-3


def test_a_robot_needs_a_way():
    with pytest.raises(CameraPathError, match="at least 2 waypoints"):
        RobotPath(((0, 0),), speed_m_s=0.5, height_m=0.8)
    with pytest.raises(CameraPathError, match="the same"):
        RobotPath(((0, 0), (0, 0), (1, 1)), speed_m_s=0.5, height_m=0.8)
    with pytest.raises(CameraPathError, match="too short"):
        RobotPath(((0, 0), (0.5, 0)), speed_m_s=0.5, height_m=0.8)


def test_a_follower_goes_the_way_of_the_person_at_the_same_speed():
    path = FollowingPath(Circling(), distance_m=1.5, height_m=0.9, gaze_m=1.0, duration_s=20.0, amplitude=0.0)
    for time_s in np.linspace(1.0, 19.0, 25):
        T, person = path.pose_at(time_s), Circling().pose_at(time_s)
        radius = np.linalg.norm(T[:2, 3])
        assert radius == pytest.approx(2.0, abs=0.08)  # smoothing cuts the curve a little
        behind = np.arctan2(person[1, 3], person[0, 3]) - np.arctan2(T[1, 3], T[0, 3])
        assert behind % (2 * np.pi) == pytest.approx(0.75, abs=0.03)
        to_person = person[:3, 3] + [0, 0, 1.0] - T[:3, 3]
        assert T[:3, 2] @ to_person / np.linalg.norm(to_person) > 0.998
        speed = np.linalg.norm(path.pose_at(time_s + 0.1)[:3, 3] - T[:3, 3]) / 0.1
        assert speed == pytest.approx(1.0, abs=0.06)


def test_a_follower_waits_behind_a_person_who_stands():
    path = FollowingPath(Starting(), distance_m=1.5, height_m=0.9, gaze_m=1.0, duration_s=12.0, amplitude=0.0)
    assert path.pose_at(0.0)[:3, 3] == pytest.approx((-1.5, 0, 0.9), abs=0.02)
    assert path.pose_at(5.0)[:3, 3] == pytest.approx((1.5, 0, 0.9), abs=0.05)
    assert path.pose_at(12.0)[:3, 3] == pytest.approx((4.5, 0, 0.9), abs=0.05)


@pytest.mark.parametrize("change", [{"distance_m": 0.0}, {"duration_s": float("nan")}, {"amplitude": -1.0}])
def test_a_follower_refuses_nonsense(change):
    good = {"distance_m": 1.0, "height_m": 0.8, "gaze_m": 1.0, "duration_s": 5.0}
    with pytest.raises(CameraPathError):
        FollowingPath(Circling(), **(good | change))
