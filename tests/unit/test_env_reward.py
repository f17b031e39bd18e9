"""The terms of the reward, against values worked out by hand."""

import math

import numpy as np
import pytest

from dotmask.records import Intrinsics
from scenarios.envs.reward import VOXEL_M, Coverage, PoseError, RewardWeights
from sim.geometry import FloatArray, pose, rotation_z
from sim.records import GroundTruth

WEIGHTS = RewardWeights(error_per_m=100.0, error_per_rad=10.0, lost=3.0)
START = pose(rotation_z(0.3), [1.0, 2.0, 1.4])


def moved(T: FloatArray, metres: float, turn: float) -> FloatArray:
    return np.asarray(T @ pose(rotation_z(turn), [metres, 0, 0]))


def test_a_step_costs_its_own_error_and_not_that_of_the_pose() -> None:
    error, far = PoseError(), pose(rotation_z(1.0), [5.0, 5.0, 5.0])
    assert error.price(START, far, WEIGHTS) == 0
    # Both move by the same: the estimate is as far off as before.
    assert error.price(moved(START, 0.2, 0.1), moved(far, 0.2, 0.1), WEIGHTS) == pytest.approx(0, abs=1e-9)
    price = error.price(moved(START, 0.4, 0.1), moved(moved(far, 0.2, 0.1), 0.0, 0.0), WEIGHTS)
    assert price == pytest.approx(100 * np.linalg.norm(moved(START, 0.4, 0.1)[:3, 3] - moved(START, 0.2, 0.1)[:3, 3]))


def test_a_wrong_turn_is_paid_by_the_radian() -> None:
    error = PoseError()
    error.price(START, START, WEIGHTS)
    assert error.price(START, moved(START, 0, math.radians(2)), WEIGHTS) == pytest.approx(10 * math.radians(2))


def test_a_loss_costs_at_both_ends_and_is_counted() -> None:
    error = PoseError()
    prices = [error.price(START, e, WEIGHTS) for e in [START, None, None, START, START]]
    assert prices == pytest.approx([0, 3, 3, 3, 0], abs=1e-9)
    assert error.lost_frames == 0
    error.price(START, None, WEIGHTS)
    assert error.lost_frames == 1


def test_coverage_counts_a_wall_once_and_no_actor() -> None:
    intrinsics = Intrinsics(width=80, height=80, fx=40.0, fy=40.0, cx=39.5, cy=39.5)
    ids = np.zeros((80, 80), np.uint16)
    ids[:, 40:] = 7
    # A wall 1.1 m ahead fills the view of 90 degrees: 2.2 m to each side of it is what the pixels of id 0 show half of.
    truth = GroundTruth(
        T_world_camera=np.eye(4), depth_m=np.full((80, 80), 1.1, np.float32), instance_ids=ids, objects=()
    )
    half, whole = Coverage(intrinsics, (7,)), Coverage(intrinsics, ())
    sampled = np.arange(0, 80, 4)
    rows = len(np.unique(np.floor((sampled - 39.5) / 40 * 1.1 / VOXEL_M)))
    columns = len(np.unique(np.floor((sampled[:10] - 39.5) / 40 * 1.1 / VOXEL_M)))
    assert half.see(truth) == pytest.approx(rows * columns * VOXEL_M**2)
    assert half.see(truth) == 0
    assert whole.see(truth) == pytest.approx(rows * rows * VOXEL_M**2)
