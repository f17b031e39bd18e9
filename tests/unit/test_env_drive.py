"""Driving: limits, the room, and the path that grows with every step."""

import math

import numpy as np
import pytest

from scenarios.envs.drive import CLEARANCE_M, STEEPEST_RAD, Drive, DriveLimits, FreeSpace
from sim.camera_paths.driven import DrivenPath
from sim.errors import CameraPathError
from sim.geometry import look_at, pose, rotation_z
from sim.rooms.bare import ROOM_MAX_M, ROOM_MIN_M, build_bare
from sim.rooms.room import Obstacle

STEP_S = 1 / 30
LIMITS = DriveLimits(speed_m_s=1.0, turn_rad_s=1.5, acceleration_m_s2=2.0, turn_acceleration_rad_s2=6.0)
MIDDLE = look_at([0, 0, 1.4], [0, 1, 1.4])


@pytest.fixture(scope="module")
def space() -> FreeSpace:
    return FreeSpace(build_bare(0).obstacles)


def driven(space: FreeSpace, action: tuple[float, ...], steps: int, start: np.ndarray = MIDDLE) -> Drive:
    drive = Drive(LIMITS, space, start)
    for _ in range(steps):
        drive.step(np.array(action, float), STEP_S)
    return drive


def test_forward_is_where_the_camera_looks_and_speed_rises_with_the_acceleration(space: FreeSpace) -> None:
    drive = driven(space, (0, 0, 1, 0, 0, 0), 15)
    # Speeds 2 k / 30 m/s for k = 1..15, each held for 1/30 s.
    assert np.allclose(drive.T_world_camera[:3, 3], [0, sum(2 * k for k in range(1, 16)) / 900, 1.4])
    assert np.allclose(drive.velocity, [0, 0, 1])
    assert np.array_equal(drive.T_world_camera[:3, :3], MIDDLE[:3, :3])


def test_speed_ends_at_its_limit_whatever_the_direction(space: FreeSpace) -> None:
    drive = driven(space, (1, -1, 1, 0, 0, 0), 17)
    assert np.isclose(np.linalg.norm(drive.velocity), 1.0)
    assert np.isclose(np.linalg.norm(drive.twist()[:3]), 1.0)


def test_a_turn_about_y_looks_to_the_right(space: FreeSpace) -> None:
    drive = driven(space, (0, 0, 0, 0, 1, 0), 30)
    # 6 rad/s² for a quarter of a second, then 1.5 rad/s: the steps' rates are 0.2, 0.4, ... 1.4, 1.5, 1.5, ...
    angle = (sum(0.2 * k for k in range(1, 8)) + 23 * 1.5) * STEP_S
    assert np.allclose(drive.T_world_camera[:3, 2], [math.sin(angle), math.cos(angle), 0])


def test_driving_and_turning_at_once_is_an_arc(space: FreeSpace) -> None:
    drive = driven(space, (0, 0, 0.5, 0, 0.5, 0), 60)
    steady = driven(space, (0, 0, 0.5, 0, 0.5, 0), 30)
    start = steady.T_world_camera
    radius = 0.5 / 0.75
    centre = start[:3, 3] + radius * start[:3, 0]
    assert np.isclose(np.linalg.norm(drive.T_world_camera[:3, 3] - centre), radius)


def test_at_a_wall_the_camera_stops_and_slides_along_it(space: FreeSpace) -> None:
    drive = driven(space, (0, 0, 1, 0, 0, 0), 200, look_at([0, 0, 1.4], [1, 1, 1.4]))
    x, y, z = drive.T_world_camera[:3, 3]
    assert drive.is_blocked
    assert 0 <= ROOM_MAX_M[1] - CLEARANCE_M - y < 0.04
    assert 0 <= ROOM_MAX_M[0] - CLEARANCE_M - x < 0.04
    assert z == pytest.approx(1.4)
    assert np.allclose(drive.velocity, 0)


@pytest.mark.parametrize(("down", "height"), [(1, CLEARANCE_M), (-1, ROOM_MAX_M[2] - CLEARANCE_M)])
def test_floor_and_ceiling_stop_it(space: FreeSpace, down: float, height: float) -> None:
    drive = driven(space, (0, down, 0, 0, 0, 0), 120)
    assert abs(drive.T_world_camera[2, 3] - height) < 0.04
    assert ROOM_MIN_M[2] < drive.T_world_camera[2, 3]


def test_a_turned_obstacle_is_avoided_where_it_is() -> None:
    walls = Obstacle(centre_m=(0, 9, 1.35), size_m=(1, 1, 2.7))
    space = FreeSpace([walls, Obstacle(centre_m=(1, 0, 1), size_m=(2.0, 0.2, 1.0), yaw_rad=math.pi / 4)])
    along = rotation_z(math.pi / 4) @ np.array([0.9, 0, 0])
    assert not space.holds(np.array([1, 0, 1.0]) + along)
    assert space.holds(np.array([1, 0, 1.0]) + along * [1, -1, 1])


def test_it_looks_no_steeper_than_the_limit(space: FreeSpace) -> None:
    drive = driven(space, (0, 0, 0, 1, 0, 0), 90)
    assert 0 <= STEEPEST_RAD - math.asin(drive.T_world_camera[2, 2]) < 0.06
    assert drive.is_blocked


def test_a_camera_that_starts_inside_furniture_may_leave() -> None:
    space = FreeSpace([Obstacle(centre_m=(0, 0, 1.35), size_m=(1, 1, 2.7))])
    drive = Drive(LIMITS, space, look_at([0, 0, 1.4], [0, 1, 1.4]))
    for _ in range(60):
        drive.step(np.array([0, 0, 1.0, 0, 0, 0]), STEP_S)
    assert drive.T_world_camera[1, 3] > 1


def test_the_path_knows_the_poses_that_were_given_and_no_others() -> None:
    path = DrivenPath(MIDDLE, 14.0)
    path.append(pose(MIDDLE[:3, :3], [0, 1, 1]))
    assert path.pose_at(1 / 14)[1, 3] == 1
    for time_s in (2 / 14, 0.5 / 14, -1 / 14):
        with pytest.raises(CameraPathError, match="2 poses are known"):
            path.pose_at(time_s)
    path.restart()
    assert len(path) == 1
    with pytest.raises(CameraPathError, match="rotation"):
        path.append(2 * MIDDLE)


@pytest.mark.parametrize("value", [0.0, -1.0, math.inf, math.nan])
def test_a_limit_is_a_finite_number_above_0(value: float) -> None:
    with pytest.raises(ValueError, match="turn_rad_s"):
        DriveLimits(turn_rad_s=value)
