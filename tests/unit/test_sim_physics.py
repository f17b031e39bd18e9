"""Chairs: still until pushed, slowed by friction alone, stopped by obstacles, the same in every process."""

import hashlib
import subprocess
import sys

import numpy as np
import pytest

from sim.errors import MotionError
from sim.physics import (
    CHAIR_MASS_KG,
    GRAVITY_M_S2,
    ROLLING_FRICTION,
    ChairPush,
    ChairStart,
    KeyframeMotion,
    StaticBox,
    bake_chairs,
)

CODE = """
import hashlib
from sim.physics import *
motions = bake_chairs(
    [ChairStart(position_m=(0, 0), yaw_rad=0.3), ChairStart(position_m=(-1.0, 0.1))],
    [ChairPush(chair=0, time_s=0.5, impulse_n_s=(-12, 1, 0), offset_m=0.05)],
    [StaticBox(centre_m=(-1.9, 0, 0.5), size_m=(0.2, 3, 1))], 4.0)
arrays = [a.tobytes() for m in motions for a in (m.p_world, m.v_world, m.q_world_xyzw)]
print(hashlib.sha256(b"".join(arrays)).hexdigest())
"""


def one(push=None, *, obstacles=(), duration_s=5.0, yaw_rad=0.0, **options):
    pushes = () if push is None else (push,)
    (motion,) = bake_chairs(
        [ChairStart(position_m=(0.4, -0.3), yaw_rad=yaw_rad)], pushes, obstacles, duration_s, **options
    )
    return motion


def speeds(motion):
    return np.linalg.norm(motion.v_world, axis=1)


def yaws(motion):
    q = motion.q_world_xyzw
    return np.unwrap(2 * np.arctan2(q[:, 2], q[:, 3]))


@pytest.fixture(scope="module")
def pushed():
    return one(ChairPush(chair=0, time_s=1.0, impulse_n_s=(10.0, 0, 0)))


def test_chair_that_nothing_pushes_stands_exactly_still():
    motion = one(yaw_rad=0.7)
    first = motion.pose_at(0.0)
    assert first[:3, 3].tolist() == [0.4, -0.3, 0.0]
    assert np.arctan2(first[1, 0], first[0, 0]) == pytest.approx(0.7)
    for time_s in (-3.0, 0.01, 1.2345, 4.999, 60.0):
        assert np.array_equal(motion.pose_at(time_s), first)


def test_chair_is_exactly_still_before_the_push_and_after_it_came_to_rest(pushed):
    for time_s in (0.0, 0.5, 0.99):
        assert np.array_equal(pushed.pose_at(time_s), pushed.pose_at(0.0))
    for time_s in (4.5, 4.77, 5.0, 100.0):
        assert np.array_equal(pushed.pose_at(time_s), pushed.pose_at(4.4))
    assert not np.array_equal(pushed.pose_at(0.0), pushed.pose_at(4.4))


def test_push_and_friction_obey_newton(pushed):
    """Impulse less friction gives the speed; friction alone the deceleration; their ratio the way."""
    deceleration = ROLLING_FRICTION * GRAVITY_M_S2
    speed = 10.0 / CHAIR_MASS_KG - deceleration * 0.2
    assert speeds(pushed).max() == pytest.approx(speed, rel=0.03)
    rolling = (pushed.times_s > 1.3) & (pushed.times_s < 2.5)
    slope = np.polyfit(pushed.times_s[rolling], pushed.v_world[rolling, 0], 1)[0]
    assert slope == pytest.approx(-deceleration, rel=0.05)
    way = pushed.p_world[-1] - pushed.p_world[0]
    assert way == pytest.approx([0.5 * speed * 0.2 + speed**2 / (2 * deceleration), 0, 0], abs=0.03)


def test_push_rolls_the_chair_as_far_and_as_long_as_a_real_one(pushed):
    moving = pushed.times_s[speeds(pushed) > 0]
    assert 1.0 < moving[-1] - moving[0] < 3.0
    assert 0.5 < np.linalg.norm(pushed.p_world[-1] - pushed.p_world[0]) < 1.5


def test_kinetic_energy_only_falls_after_the_push(pushed):
    energy = 0.5 * CHAIR_MASS_KG * speeds(pushed)[pushed.times_s > 1.21] ** 2
    assert (np.diff(energy) <= 1e-4).all()
    assert energy[-1] == 0.0


@pytest.mark.parametrize(("offset_m", "sign"), [(0.1, -1), (-0.1, 1)])
def test_push_beside_the_axis_turns_the_chair(offset_m, sign):
    """Pushed on its left side along its way, it turns to the right, which is clockwise."""
    motion = one(ChairPush(chair=0, time_s=0.2, impulse_n_s=(6.0, 2.0, 0), offset_m=offset_m))
    assert sign * (yaws(motion)[-1] - yaws(motion)[0]) > np.deg2rad(15)


def test_hard_push_at_the_top_does_not_tip_the_chair():
    motion = one(ChairPush(chair=0, time_s=0.2, impulse_n_s=(15.0, 0, 0), height_m=1.0))
    assert (motion.p_world[:, 2] == 0).all()  # what sinks or tips raises instead
    assert np.linalg.norm(motion.p_world[-1] - motion.p_world[0]) > 0.8


def test_wall_stops_the_chair():
    wall = StaticBox(centre_m=(1.3, 0, 0.5), size_m=(0.2, 3.0, 1.0))
    motion = one(ChairPush(chair=0, time_s=0.2, impulse_n_s=(12.0, 0, 0)), obstacles=[wall])
    reach = motion.p_world[:, 0].max()
    assert 1.2 - 0.36 < reach < 1.2 - 0.2


def test_chair_hits_a_chair():
    chairs = [ChairStart(position_m=(0, 0)), ChairStart(position_m=(0.9, 0.0)), ChairStart(position_m=(0, 3))]
    first, second, third = bake_chairs(chairs, [ChairPush(chair=0, time_s=0.5, impulse_n_s=(14.0, 0, 0))], [], 4.0)
    assert second.p_world[-1, 0] > 1.0
    assert second.times_s[np.flatnonzero(speeds(second))[0]] > 0.6
    assert first.p_world[-1, 0] < second.p_world[-1, 0] - 0.5
    assert (speeds(third) == 0).all()


def test_motion_between_keyframes_follows_the_velocity():
    """The derivative of the pose is the stated velocity, away from the push's beginning and end."""
    motion = one(ChairPush(chair=0, time_s=0.2, impulse_n_s=(9.0, 3.0, 0)), keyframe_rate_hz=60)
    for index in range(30, 60, 5):
        t = float(motion.times_s[index])
        slope = (motion.pose_at(t + 1e-4) - motion.pose_at(t - 1e-4))[:3, 3] / 2e-4
        assert slope == pytest.approx(motion.v_world[index], abs=0.01)


def test_same_bytes_in_two_processes():
    digests = {
        subprocess.run(
            [sys.executable, "-c", CODE], check=True, capture_output=True, text=True, env={"PYTHONHASHSEED": h}
        ).stdout
        for h in ("1", "2")
    }
    assert len(digests) == 1
    assert len(digests.pop().strip()) == 64


def test_same_bytes_after_another_bake():
    def digest():
        m = one(ChairPush(chair=0, time_s=0.1, impulse_n_s=(8.0, 1.0, 0), offset_m=0.05), duration_s=3.0)
        return hashlib.sha256(m.p_world.tobytes() + m.q_world_xyzw.tobytes()).hexdigest()

    first = digest()
    one(ChairPush(chair=0, time_s=0.1, impulse_n_s=(-3.0, 1.0, 0)), duration_s=1.0)
    assert digest() == first


def test_a_longer_bake_begins_like_a_shorter_one():
    push = ChairPush(chair=0, time_s=0.3, impulse_n_s=(8.0, 1.0, 0), offset_m=0.05)
    short, long = one(push, duration_s=1.0), one(push, duration_s=3.0)
    count = len(short.times_s)
    assert np.array_equal(short.p_world, long.p_world[:count])
    assert np.array_equal(short.q_world_xyzw, long.q_world_xyzw[:count])


def test_bake_prints_nothing(capfd):
    one(duration_s=0.1)
    out, err = capfd.readouterr()
    assert (out, err) == ("", "")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"keyframe_rate_hz": 100}, "240 Hz must be a multiple of the keyframe rate, got 100"),
        ({"keyframe_rate_hz": 0}, "multiple of the keyframe rate"),
        ({"duration_s": 0.0}, "duration must be above 0"),
        ({"push": ChairPush(chair=1, time_s=0, impulse_n_s=(1, 0, 0))}, "push 0 is for chair 1, but there are 1"),
        ({"push": ChairPush(chair=0, time_s=9, impulse_n_s=(1, 0, 0))}, r"push 0 at 9 s is outside the 5\.0 s"),
        ({"push": ChairPush(chair=0, time_s=1, impulse_n_s=(float("nan"), 0, 0))}, "push 0 has a value"),
        ({"push": ChairPush(chair=0, time_s=1, impulse_n_s=(1, 0, 0), duration_s=0)}, "push 0 has a value"),
        ({"yaw_rad": float("inf")}, "chair 0 has a start"),
    ],
)
def test_refuses_nonsense(options, message):
    with pytest.raises(MotionError, match=message):
        one(**options)


def test_keyframes_must_fit_together():
    with pytest.raises(MotionError, match="times must increase"):
        KeyframeMotion(
            times_s=np.zeros(2), p_world=np.zeros((2, 3)), v_world=np.zeros((2, 3)), q_world_xyzw=np.eye(4)[:2]
        )
    with pytest.raises(MotionError, match="need times"):
        KeyframeMotion(
            times_s=np.zeros(2), p_world=np.zeros((1, 3)), v_world=np.zeros((2, 3)), q_world_xyzw=np.eye(4)[:2]
        )
