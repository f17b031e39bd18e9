"""Errors of an estimated camera trajectory: ATE and RPE.

Definitions of the TUM RGB-D benchmark (Sturm et al., "A Benchmark for the Evaluation of RGB-D SLAM Systems",
IROS 2012, section IV): the absolute trajectory error after the best rigid alignment without scale (Horn 1987;
Umeyama 1991), and the relative pose error of the motion over a fixed distance in time.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from dotmask.geometry import inverse, vector_from_rotation
from dotmask.records import FloatArray, Trajectory
from dotmask.timestamps import nearest_pairs

MIN_POSES_ATE = 3
"""With fewer poses the alignment can explain any error away."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AteResult:
    """Absolute trajectory error, metres.

    Attributes:
        rmse_m: root of the mean square.
        mean_m: mean.
        median_m: median.
        max_m: largest.
        poses: number of pose pairs it was taken over.
    """

    rmse_m: float
    mean_m: float
    median_m: float
    max_m: float
    poses: int


@dataclass(frozen=True, slots=True, kw_only=True)
class RpeResult:
    """Relative pose error.

    Attributes:
        trans_rmse_m: root of the mean square of the translation part, metres per step.
        rot_rmse_rad: the same of the rotation angle, radians per step.
        pairs: number of steps it was taken over.
    """

    trans_rmse_m: float
    rot_rmse_rad: float
    pairs: int


def associate(truth: Trajectory, estimate: Trajectory, max_difference_s: float = 0.02) -> tuple[Trajectory, Trajectory]:
    """The parts of both trajectories that belong together: equally many poses, pairwise nearest in time.

    Each pose is used once. Each side keeps its own time stamps.

    Args:
        truth: reference poses, of any rate.
        estimate: estimated poses.
        max_difference_s: poses further apart in time than this are not paired.
    """
    pairs = nearest_pairs(truth.timestamps_s, estimate.timestamps_s, max_difference_s)
    return _selected(truth, pairs[:, 0]), _selected(estimate, pairs[:, 1])


def align(estimate: Trajectory, truth: Trajectory) -> FloatArray:
    """`T_truth_estimate` (4, 4): the rigid motion that brings the estimated positions nearest to the true ones.

    Least squares over the positions, without scale and never a reflection. Where the positions leave it open (all
    on one line), it is one of the best.

    Args:
        estimate: N poses.
        truth: N poses, paired with them (`associate`).

    Raises:
        ValueError: the two differ in length or are empty.
    """
    if len(estimate) != len(truth) or len(truth) == 0:
        raise ValueError(f"align: needs equally many poses and at least one, got {len(estimate)} and {len(truth)}")
    source, target = estimate.T_world_camera[:, :3, 3], truth.T_world_camera[:, :3, 3]
    source_mean, target_mean = source.mean(axis=0), target.mean(axis=0)
    U, _, Vt = np.linalg.svd((target - target_mean).T @ (source - source_mean))
    handedness = np.array([1.0, 1.0, np.sign(np.linalg.det(U) * np.linalg.det(Vt))])
    R = (U * handedness) @ Vt
    T_truth_estimate = np.eye(4)
    T_truth_estimate[:3, :3] = R
    T_truth_estimate[:3, 3] = target_mean - R @ source_mean
    return T_truth_estimate


def absolute_trajectory_error(
    truth: Trajectory, estimate: Trajectory, max_difference_s: float = 0.02
) -> AteResult | None:
    """ATE of the positions after association and rigid alignment.

    Returns:
        The error, or None with fewer than 3 paired poses.
    """
    truth, estimate = associate(truth, estimate, max_difference_s)
    if len(truth) < MIN_POSES_ATE:
        return None
    T_truth_estimate = align(estimate, truth)
    aligned = estimate.T_world_camera[:, :3, 3] @ T_truth_estimate[:3, :3].T + T_truth_estimate[:3, 3]
    error_m = np.linalg.norm(aligned - truth.T_world_camera[:, :3, 3], axis=1)
    return AteResult(
        rmse_m=_root_mean_square(error_m),
        mean_m=float(error_m.mean()),
        median_m=float(np.median(error_m)),
        max_m=float(error_m.max()),
        poses=len(truth),
    )


def relative_pose_error(
    truth: Trajectory,
    estimate: Trajectory,
    *,
    delta_frames: int = 1,
    delta_s: float | None = None,
    max_difference_s: float = 0.02,
) -> RpeResult | None:
    """RPE: by how much the estimated motion over a step differs from the true one, `(Q_i⁻¹ Q_j)⁻¹ (P_i⁻¹ P_j)`.

    Every paired pose starts a step (overlapping steps). Steps in frames count paired poses, as the TUM tools do: a
    step over frames without a pose counts as one.

    Args:
        truth: reference poses Q, of any rate.
        estimate: estimated poses P.
        delta_frames: length of a step in paired poses; not used when `delta_s` is given.
        delta_s: length of a step in seconds of the estimate; it ends at the pose nearest to that time, if there is
            one within `max_difference_s`.
        max_difference_s: for the association, see `associate`.

    Returns:
        The error, or None when there is no step.

    Raises:
        ValueError: the step is not positive.
    """
    if delta_frames < 1 or (delta_s is not None and not delta_s > 0):
        raise ValueError("relative_pose_error: the step must be positive")
    truth, estimate = associate(truth, estimate, max_difference_s)
    if delta_s is None:
        start = np.arange(max(len(estimate) - delta_frames, 0))
        end = start + delta_frames
    else:
        start, end = _steps_in_time(estimate.timestamps_s, delta_s, max_difference_s)
    if len(start) == 0:
        return None
    true_step = _relative(truth.T_world_camera[start], truth.T_world_camera[end])
    estimated_step = _relative(estimate.T_world_camera[start], estimate.T_world_camera[end])
    error = _relative(true_step, estimated_step)
    return RpeResult(
        trans_rmse_m=_root_mean_square(np.linalg.norm(error[:, :3, 3], axis=1)),
        rot_rmse_rad=_root_mean_square(Rotation.from_matrix(error[:, :3, :3]).magnitude()),
        pairs=len(start),
    )


def step_error(
    truth_before: FloatArray, truth: FloatArray, estimate_before: FloatArray, estimate: FloatArray
) -> tuple[float, float]:
    """The error of one step of `relative_pose_error`, metres and radians, from four poses `T_world_camera` (4, 4)."""
    error = inverse(inverse(truth_before) @ truth) @ inverse(estimate_before) @ estimate
    return float(np.linalg.norm(error[:3, 3])), float(np.linalg.norm(vector_from_rotation(error[:3, :3])))


def _steps_in_time(
    times_s: FloatArray, delta_s: float, tolerance_s: float
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Indices of both ends of the steps of `delta_s`."""
    wanted = times_s + delta_s
    right = np.searchsorted(times_s, wanted).clip(1, max(len(times_s) - 1, 1))
    if len(times_s) < 2:
        return np.zeros(0, np.intp), np.zeros(0, np.intp)
    left_is_nearer = wanted - times_s[right - 1] <= times_s[right] - wanted
    end = np.where(left_is_nearer, right - 1, right)
    start = np.flatnonzero((np.abs(times_s[end] - wanted) <= tolerance_s) & (end > np.arange(len(times_s))))
    return start, end[start]


def _relative(T_w_a: FloatArray, T_w_b: FloatArray) -> FloatArray:
    """`T_a_b` (N, 4, 4) of two series of poses."""
    R_a_w = T_w_a[:, :3, :3].transpose(0, 2, 1)
    T_a_b = np.tile(np.eye(4), (len(T_w_a), 1, 1))
    T_a_b[:, :3, :3] = R_a_w @ T_w_b[:, :3, :3]
    T_a_b[:, :3, 3:] = R_a_w @ (T_w_b[:, :3, 3:] - T_w_a[:, :3, 3:])
    return T_a_b


def _selected(trajectory: Trajectory, indices: npt.NDArray[np.intp]) -> Trajectory:
    return Trajectory(timestamps_s=trajectory.timestamps_s[indices], T_world_camera=trajectory.T_world_camera[indices])


def _root_mean_square(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
