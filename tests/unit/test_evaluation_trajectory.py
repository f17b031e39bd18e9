import os

os.environ.setdefault("MPLBACKEND", "Agg")

import numpy as np
import pytest
from evo.core import metrics, sync
from evo.core.trajectory import PoseTrajectory3D
from scipy.spatial.transform import Rotation

from dotmask.evaluation.trajectory import (
    absolute_trajectory_error,
    align,
    associate,
    relative_pose_error,
)
from dotmask.records import Trajectory


def smooth_trajectory(seed: int, count: int) -> Trajectory:
    rng = np.random.default_rng(seed)
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, :3] = Rotation.from_rotvec(np.cumsum(rng.normal(0, 0.05, (count, 3)), axis=0)).as_matrix()
    poses[:, :3, 3] = np.cumsum(rng.normal(0, 0.1, (count, 3)), axis=0)
    return Trajectory(timestamps_s=1000 + np.arange(count) / 30, T_world_camera=poses)


def disturbed(trajectory: Trajectory, seed: int) -> Trajectory:
    """Moved as a whole, with noise on every pose and jitter of up to 2 ms on the times."""
    rng = np.random.default_rng(seed)
    count = len(trajectory)
    poses = trajectory.T_world_camera.copy()
    poses[:, :3, :3] = poses[:, :3, :3] @ Rotation.from_rotvec(rng.normal(0, 0.02, (count, 3))).as_matrix()
    poses[:, :3, 3] += rng.normal(0, 0.05, (count, 3))
    whole = np.eye(4)
    whole[:3, :3] = Rotation.random(rng=rng).as_matrix()
    whole[:3, 3] = rng.normal(0, 5, 3)
    return Trajectory(
        timestamps_s=trajectory.timestamps_s + rng.uniform(-0.002, 0.002, count), T_world_camera=whole @ poses
    )


def evo_trajectory(trajectory: Trajectory) -> PoseTrajectory3D:
    return PoseTrajectory3D(poses_se3=list(trajectory.T_world_camera), timestamps=trajectory.timestamps_s)


def part(trajectory: Trajectory, indices) -> Trajectory:
    return Trajectory(timestamps_s=trajectory.timestamps_s[indices], T_world_camera=trajectory.T_world_camera[indices])


@pytest.mark.parametrize("seed", range(5))
def test_ate_agrees_with_evo(seed):
    truth = smooth_trajectory(seed, 80)
    estimate = part(disturbed(truth, 100 + seed), np.r_[3:40, 45:80])
    a, b = sync.associate_trajectories(evo_trajectory(truth), evo_trajectory(estimate), max_diff=0.02)
    b.align(a)
    ape = metrics.APE(metrics.PoseRelation.translation_part)
    ape.process_data((a, b))
    ours = absolute_trajectory_error(truth, estimate)
    assert ours is not None
    assert ours.poses == 72
    for name, value in (("rmse", ours.rmse_m), ("mean", ours.mean_m), ("median", ours.median_m), ("max", ours.max_m)):
        assert value == pytest.approx(ape.get_statistic(metrics.StatisticsType(name)), abs=1e-9)


@pytest.mark.parametrize("delta", [1, 5])
@pytest.mark.parametrize("seed", range(3))
def test_rpe_agrees_with_evo(seed, delta):
    truth = smooth_trajectory(seed, 60)
    estimate = disturbed(truth, 200 + seed)
    a, b = sync.associate_trajectories(evo_trajectory(truth), evo_trajectory(estimate), max_diff=0.02)
    ours = relative_pose_error(truth, estimate, delta_frames=delta)
    assert ours is not None
    assert ours.pairs == 60 - delta
    for relation, value in (
        (metrics.PoseRelation.translation_part, ours.trans_rmse_m),
        (metrics.PoseRelation.rotation_angle_rad, ours.rot_rmse_rad),
    ):
        rpe = metrics.RPE(relation, delta=delta, delta_unit=metrics.Unit.frames, all_pairs=True)
        rpe.process_data((a, b))
        assert value == pytest.approx(rpe.get_statistic(metrics.StatisticsType.rmse), abs=1e-9)


def test_rpe_in_seconds_is_rpe_in_frames_at_a_fixed_rate():
    truth = smooth_trajectory(0, 40)
    estimate = Trajectory(timestamps_s=truth.timestamps_s, T_world_camera=disturbed(truth, 1).T_world_camera)
    assert relative_pose_error(truth, estimate, delta_s=0.2) == relative_pose_error(truth, estimate, delta_frames=6)


def test_rpe_in_seconds_leaves_out_steps_that_end_in_a_gap():
    truth = smooth_trajectory(0, 40)
    estimate = part(truth, np.r_[0:10, 20:40])
    result = relative_pose_error(truth, estimate, delta_s=1 / 30)
    assert result is not None
    assert result.pairs == 9 + 19


def test_known_errors():
    # A line along x; the estimate is 0.1 m off to both sides in turn, which no rigid motion takes away.
    poses = np.tile(np.eye(4), (40, 1, 1))
    poses[:, 0, 3] = np.arange(40) % 20
    poses[20:, 2, 3] = 3.0
    truth = Trajectory(timestamps_s=np.arange(40.0), T_world_camera=poses)
    shifted = poses.copy()
    shifted[:, 1, 3] = 0.1 * np.tile([1, -1, -1, 1], 10)
    estimate = Trajectory(timestamps_s=np.arange(40.0), T_world_camera=shifted)
    ate = absolute_trajectory_error(truth, estimate)
    assert ate is not None
    assert ate.rmse_m == pytest.approx(0.1, abs=1e-9)
    assert ate.max_m == pytest.approx(0.1, abs=1e-9)
    rpe = relative_pose_error(truth, estimate)
    assert rpe is not None
    assert rpe.trans_rmse_m == pytest.approx(0.2 * np.sqrt(20 / 39), abs=1e-9)
    assert rpe.rot_rmse_rad == 0


def test_alignment_is_a_rotation_even_for_a_mirror_image():
    truth = smooth_trajectory(3, 30)
    mirrored = truth.T_world_camera.copy()
    mirrored[:, 0, 3] *= -1
    T = align(Trajectory(timestamps_s=truth.timestamps_s, T_world_camera=mirrored), truth)
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1)
    np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-12)


def test_alignment_has_no_scale():
    truth = smooth_trajectory(4, 30)
    larger = truth.T_world_camera.copy()
    larger[:, :3, 3] *= 2
    ate = absolute_trajectory_error(truth, Trajectory(timestamps_s=truth.timestamps_s, T_world_camera=larger))
    spread = truth.T_world_camera[:, :3, 3] - truth.T_world_camera[:, :3, 3].mean(axis=0)
    assert ate is not None
    assert ate.rmse_m == pytest.approx(np.sqrt((spread**2).sum(axis=1).mean()), abs=1e-9)


def test_too_few_poses_are_no_result():
    truth = smooth_trajectory(0, 10)
    assert absolute_trajectory_error(truth, part(truth, [0, 1])) is None
    assert absolute_trajectory_error(truth, part(truth, [0, 1, 2])) is not None
    assert relative_pose_error(truth, part(truth, [0])) is None
    assert relative_pose_error(truth, part(truth, [0]), delta_s=0.1) is None
    assert relative_pose_error(truth, part(truth, [])) is None
    assert relative_pose_error(truth, part(truth, []), delta_s=0.1) is None
    assert relative_pose_error(truth, part(truth, [0, 1])) is not None


def test_association_uses_each_pose_once():
    truth = smooth_trajectory(0, 10)
    dense = Trajectory(timestamps_s=truth.timestamps_s[0] + np.arange(10) * 0.004, T_world_camera=truth.T_world_camera)
    a, b = associate(truth, dense)
    assert len(a) == len(b) == 2
    np.testing.assert_array_equal(a.timestamps_s, truth.timestamps_s[:2])
    np.testing.assert_allclose(b.timestamps_s - truth.timestamps_s[0], [0, 0.032], atol=1e-9)


def test_wrong_use_is_refused():
    truth = smooth_trajectory(0, 10)
    with pytest.raises(ValueError, match="equally many"):
        align(truth, part(truth, [0, 1]))
    with pytest.raises(ValueError, match="must be positive"):
        relative_pose_error(truth, truth, delta_frames=0)
    with pytest.raises(ValueError, match="must be positive"):
        relative_pose_error(truth, truth, delta_s=0.0)
