"""The pose graph: a square that does not close, loops that close it, and loops that are wrong."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from dotmask.geometry import inverse
from dotmask.slam.pose_graph import Edge, OptimisedGraph, optimise
from dotmask.slam.twists import exp

REJECTION = 1e-4
SIDE, STEP_M = 10, 0.2
ODOMETRY_SIGMAS = np.array([0.002] * 3 + [0.004] * 3)
LOOP_SIGMAS = np.array([0.001] * 3 + [0.002] * 3)


def square() -> list[np.ndarray]:
    """Poses along a square of 2 m, back to its start and some steps on."""
    poses = [np.eye(4)]
    for k in range(4 * SIDE + 5):
        turn = np.pi / 2 if k % SIDE == SIDE - 1 else 0.0
        poses.append(poses[-1] @ exp(np.array([0, 0, 0, STEP_M, 0, 0])) @ exp(np.array([0, 0, turn, 0, 0, 0])))
    return poses


def edge(a: int, b: int, T_a_b: np.ndarray, sigmas: np.ndarray) -> Edge:
    return Edge(a=a, b=b, T_a_b=T_a_b, covariance=np.diag(sigmas**2))


def drifted(truth: list[np.ndarray], drift: np.ndarray) -> tuple[list[np.ndarray], list[Edge]]:
    """Poses and edges of an odometry that errs by the twist `drift` in every step."""
    poses, edges = [truth[0]], []
    for k in range(len(truth) - 1):
        T = inverse(truth[k]) @ truth[k + 1] @ exp(drift)
        edges.append(edge(k, k + 1, T, ODOMETRY_SIGMAS))
        poses.append(poses[-1] @ T)
    return poses, edges


def loop(truth: list[np.ndarray], later: int, earlier: int, wrong: np.ndarray | None = None) -> Edge:
    T = inverse(truth[later]) @ truth[earlier]
    return edge(later, earlier, T if wrong is None else T @ exp(wrong), LOOP_SIGMAS)


def errors_m(found: OptimisedGraph, truth: list[np.ndarray]) -> np.ndarray:
    return np.linalg.norm(found.T_world_node[:, :3, 3] - np.array(truth)[:, :3, 3], axis=1)


DRIFT = np.array([0.0003, -0.0002, 0.001, 0.001, 0.0005, -0.0008])
TRUTH = square()


def test_one_exact_loop_closes_the_square():
    poses, odometry = drifted(TRUTH, DRIFT)
    before = np.linalg.norm(poses[40][:3, 3])
    assert before > 0.04
    found = optimise(poses, odometry, [loop(TRUTH, 40, 0)], REJECTION)
    assert found.is_accepted.tolist() == [True]
    np.testing.assert_allclose(found.T_world_node[0], poses[0], atol=1e-6)
    # The loop is nearly exact, so its ends meet; what is left of the drift lies between them.
    assert errors_m(found, TRUTH)[40] < 0.1 * before
    drift_m = np.linalg.norm(np.array(poses)[:, :3, 3] - np.array(TRUTH)[:, :3, 3], axis=1)
    assert errors_m(found, TRUTH).mean() < 0.5 * drift_m.mean()


def test_two_measurements_meet_at_their_weighted_mean():
    # Along one axis: odometry says 1.00 m with sigma 4 mm, a loop 1.01 m with 2 mm.
    forward = exp(np.array([0, 0, 0, 1.0, 0, 0]))
    odometry = [edge(0, 1, forward, ODOMETRY_SIGMAS)]
    measured = edge(1, 0, inverse(exp(np.array([0, 0, 0, 1.01, 0, 0]))), LOOP_SIGMAS)
    found = optimise([np.eye(4), forward], odometry, [measured], REJECTION)
    weights = 1 / np.array([0.004, 0.002]) ** 2
    assert found.T_world_node[1, 0, 3] == pytest.approx(weights @ [1.00, 1.01] / weights.sum(), abs=1e-5)


@pytest.mark.parametrize("wrong", [[0, 0, 0, 1.0, 0, 0], [0, 0, 0.5, 0, 0, 0], [0.1, 0, 0, 0, -0.15, 0]])
def test_a_false_loop_is_rejected_and_leaves_no_trace(wrong):
    poses, odometry = drifted(TRUTH, DRIFT)
    good = [loop(TRUTH, 40, 0), loop(TRUTH, 42, 2)]
    without = optimise(poses, odometry, good, REJECTION)
    found = optimise(poses, odometry, [good[0], loop(TRUTH, 30, 10, np.array(wrong)), good[1]], REJECTION)
    assert found.is_accepted.tolist() == [True, False, True]
    np.testing.assert_array_equal(found.T_world_node, without.T_world_node)


def test_odometry_stays_when_every_loop_is_rejected():
    poses, odometry = drifted(TRUTH, DRIFT)
    found = optimise(poses, odometry, [loop(TRUTH, 40, 0, np.array([0, 0, 0, 1.0, 0, 0]))], REJECTION)
    assert found.is_accepted.tolist() == [False]
    np.testing.assert_array_equal(found.T_world_node, poses)


def test_false_loops_that_agree_with_each_other_are_outnumbered_by_odometry():
    poses, odometry = drifted(TRUTH, DRIFT)
    wrong = np.array([0, 0, 0, 1.0, 0, 0])
    false = [loop(TRUTH, 20 + k, k, wrong) for k in range(3)]
    found = optimise(poses, odometry, [*false, loop(TRUTH, 40, 0)], REJECTION)
    assert found.is_accepted.tolist() == [False, False, False, True]


def test_nothing_moves_without_loops():
    poses, odometry = drifted(TRUTH, DRIFT)
    found = optimise(poses, odometry, [], REJECTION)
    np.testing.assert_array_equal(found.T_world_node, poses)
    assert len(found.is_accepted) == 0
    assert optimise([], [], [], REJECTION).T_world_node.shape == (0, 4, 4)


def hashed() -> str:
    poses, odometry = drifted(TRUTH, DRIFT)
    rng = np.random.default_rng(0)
    loops = [loop(TRUTH, 40 + k, k, rng.normal(0, 0.001, 6)) for k in range(5)]
    loops.insert(2, loop(TRUTH, 30, 10, np.array([0, 0, 0, 1.0, 0, 0])))
    return hashlib.sha256(optimise(poses, odometry, loops, REJECTION).T_world_node.tobytes()).hexdigest()


def test_processes_agree_to_the_last_bit_for_any_threads():
    folder = str(Path(__file__).parent)
    code = f"import sys; sys.path.insert(0, {folder!r}); import test_slam_pose_graph as t; print(t.hashed())"
    answers = {hashed()}
    for threads in ("1", "3"):
        environment = {**os.environ, "OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads}
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
        answers.add(done.stdout.strip())
    assert len(answers) == 1
