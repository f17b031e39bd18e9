import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from dotmask.evaluation.trajectory import absolute_trajectory_error, relative_pose_error
from dotmask.records import Trajectory
from dotmask.timestamps import nearest_pairs
from dotmask.tum import format_trajectory, read_trajectory

FEW = settings(max_examples=40, deadline=None)
numbers = st.floats(-50, 50, allow_subnormal=False)
rotations = st.tuples(*[st.floats(-3, 3)] * 3).map(lambda vector: Rotation.from_rotvec(vector).as_matrix())


@st.composite
def rigid(draw):
    T = np.eye(4)
    T[:3, :3] = draw(rotations)
    T[:3, 3] = draw(st.tuples(numbers, numbers, numbers))
    return T


@st.composite
def trajectories(draw, least=3):
    count = draw(st.integers(least, 12))
    steps = draw(st.lists(st.floats(0.05, 10), min_size=count, max_size=count))
    poses = np.array(draw(st.lists(rigid(), min_size=count, max_size=count))).reshape(-1, 4, 4)
    return Trajectory(timestamps_s=np.cumsum(steps), T_world_camera=poses)


def moved(T: np.ndarray, trajectory: Trajectory) -> Trajectory:
    return Trajectory(timestamps_s=trajectory.timestamps_s, T_world_camera=T @ trajectory.T_world_camera)


@FEW
@given(trajectories(), rigid())
def test_rigidly_moved_copy_has_no_error(trajectory, T):
    ate = absolute_trajectory_error(trajectory, moved(T, trajectory))
    rpe = relative_pose_error(trajectory, moved(T, trajectory))
    assert ate is not None
    assert ate.max_m < 1e-9
    assert rpe is not None
    assert rpe.trans_rmse_m < 1e-9
    assert rpe.rot_rmse_rad < 1e-9


@FEW
@given(trajectories(), rigid(), rigid(), st.integers(0, 2**32 - 1))
def test_errors_do_not_depend_on_where_the_world_is(truth, T, U, seed):
    noise = np.random.default_rng(seed)
    poses = truth.T_world_camera.copy()
    poses[:, :3, 3] += noise.normal(0, 0.3, (len(truth), 3))
    poses[:, :3, :3] = poses[:, :3, :3] @ Rotation.from_rotvec(noise.normal(0, 0.1, (len(truth), 3))).as_matrix()
    estimate = Trajectory(timestamps_s=truth.timestamps_s, T_world_camera=poses)
    ate, ate_moved = (
        absolute_trajectory_error(truth, estimate),
        absolute_trajectory_error(moved(T, truth), moved(U, estimate)),
    )
    rpe, rpe_moved = relative_pose_error(truth, estimate), relative_pose_error(moved(T, truth), moved(U, estimate))
    assert ate is not None
    assert ate_moved is not None
    assert ate_moved.rmse_m == pytest.approx(ate.rmse_m, abs=1e-9)
    assert rpe is not None
    assert rpe_moved is not None
    assert rpe_moved.trans_rmse_m == pytest.approx(rpe.trans_rmse_m, abs=1e-9)
    assert rpe_moved.rot_rmse_rad == pytest.approx(rpe.rot_rmse_rad, abs=1e-9)


@FEW
@given(trajectories(), st.integers(0, 2**32 - 1))
def test_swapping_the_sides_changes_no_ate(a, seed):
    poses = a.T_world_camera.copy()
    poses[:, :3, 3] += np.random.default_rng(seed).normal(0, 0.3, (len(a), 3))
    b = Trajectory(timestamps_s=a.timestamps_s, T_world_camera=poses)
    forward, backward = absolute_trajectory_error(a, b), absolute_trajectory_error(b, a)
    assert forward is not None
    assert backward is not None
    assert backward.rmse_m == pytest.approx(forward.rmse_m, abs=1e-9)


@FEW
@given(trajectories(least=0))
def test_file_round_trip_and_sign_of_the_quaternion(tmp_path_factory, trajectory):
    path = tmp_path_factory.mktemp("trajectory") / "t.txt"
    text = format_trajectory(trajectory)
    path.write_text(text)
    back = read_trajectory(path)
    np.testing.assert_array_equal(back.timestamps_s, trajectory.timestamps_s)
    np.testing.assert_allclose(back.T_world_camera, trajectory.T_world_camera, atol=1e-12)
    header, *lines = text.splitlines()
    rows = [[float(word) for word in line.split()] for line in lines]
    flipped = [" ".join(map(repr, row[:4] + [-q for q in row[4:]])) for row in rows]
    path.write_text("\n".join([header, *flipped]))
    np.testing.assert_allclose(read_trajectory(path).T_world_camera, back.T_world_camera, atol=1e-15)


@FEW
@given(
    st.lists(st.floats(0, 1), max_size=30, unique=True).map(sorted),
    st.lists(st.floats(0, 1), max_size=30, unique=True).map(sorted),
)
def test_pairs_are_in_order_used_once_and_no_free_pair_is_left(a, b):
    a_s, b_s = np.array(a, dtype=np.float64), np.array(b, dtype=np.float64)
    pairs = nearest_pairs(a_s, b_s, 0.02)
    assert (np.diff(pairs, axis=0) > 0).all()
    assert (np.abs(a_s[pairs[:, 0]] - b_s[pairs[:, 1]]) <= 0.02 + 1e-12).all()
    # Each unpaired pair of neighbours in time must cross or share with a chosen one.
    for i in range(len(a)):
        for j in range(len(b)):
            if abs(a[i] - b[j]) < 0.02 - 1e-12 and not any((p[0] == i) and (p[1] == j) for p in pairs):
                assert any((p[0] - i) * (p[1] - j) <= 0 for p in pairs)
