"""What holds for every camera path, and for rotations between any two quaternions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from sim.camera_paths.hand_held import HalfspherePath, RpyPath, StaticPath, XyzPath
from sim.camera_paths.recorded import RecordedPath, Recording
from sim.geometry import look_at
from sim.quaternions import rotation_from_quaternion, slerp

times = st.floats(-100, 1000)
seeds = st.integers(0, 2**32)
kinds = st.sampled_from([StaticPath, XyzPath, RpyPath, HalfspherePath])
quaternions = st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 1e-3)


@settings(max_examples=60, deadline=None)
@given(kinds, seeds, times, st.floats(0, 2), st.floats(0.1, 10))
def test_every_pose_is_rigid(kind, seed, time_s, amplitude, speed):
    T = kind(T_world_camera=look_at((0, -2, 1.4), (0, 1, 1)), seed=seed, amplitude=amplitude, speed=speed).pose_at(
        time_s
    )
    assert T[:3, :3] @ T[:3, :3].T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1.0)
    assert T[3].tolist() == [0, 0, 0, 1]


@settings(max_examples=40, deadline=None)
@given(kinds, seeds, st.floats(0, 60), st.tuples(*[st.floats(-3, 3)] * 3), st.floats(-3, 3))
def test_path_moves_with_its_nominal_pose(kind, seed, time_s, shift, yaw):
    """The path in the nominal camera's axes does not depend on where that camera is."""
    first = look_at((0, -2, 1.4), (0, 1, 1))
    second = look_at(shift, np.add(shift, [np.cos(yaw), np.sin(yaw), -0.2]))
    paths = [kind(T_world_camera=T, seed=seed) for T in (first, second)]
    local = [np.linalg.inv(p.T_world_camera) @ p.pose_at(time_s) for p in paths]
    assert local[0] == pytest.approx(local[1], abs=1e-9)


@settings(max_examples=200, deadline=None)
@given(quaternions, quaternions, st.floats(0, 1))
def test_slerp_agrees_with_scipy(first, second, part):
    a, b = (np.array(q) / np.linalg.norm(q) for q in (first, second))
    if abs(a @ b) < 1e-3:
        return  # half a turn apart: both ways are equally short
    exact = Slerp([0, 1], Rotation.from_quat([a, b]))(part).as_matrix()
    assert rotation_from_quaternion(slerp(a, b, part)) == pytest.approx(exact, abs=1e-9)


@settings(max_examples=60, deadline=None)
@given(quaternions)
def test_rotation_agrees_with_scipy(q):
    unit = np.array(q) / np.linalg.norm(q)
    assert rotation_from_quaternion(unit) == pytest.approx(Rotation.from_quat(unit).as_matrix(), abs=1e-12)


@settings(max_examples=40, deadline=None)
@given(st.integers(2, 12), st.integers(0, 10_000), st.floats(0, 1), st.floats(0.2, 5))
def test_replay_stays_within_its_recording(count, seed, part, speed):
    rng = np.random.default_rng(seed)
    recording = Recording(
        times_s=1000 + np.cumsum(rng.uniform(0.01, 0.5, count)),
        p_world=rng.normal(size=(count, 3)),
        q_world_xyzw=Rotation.random(count, random_state=seed).as_quat(),
    )
    path = RecordedPath(recording=recording, T_world_recording=np.eye(4), speed=speed)
    T = path.pose_at(part * path.duration_s)
    assert T[:3, :3] @ T[:3, :3].T == pytest.approx(np.eye(3), abs=1e-9)
    assert (T[:3, 3] >= recording.p_world.min(axis=0) - 1e-9).all()
    assert (T[:3, 3] <= recording.p_world.max(axis=0) + 1e-9).all()
