"""From keyframes to corrected poses: which keyframes are tried, and where the correction goes."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from dotmask.geometry import inverse
from dotmask.records import FloatArray, Intrinsics, LoopKind
from dotmask.slam import loop_closing as module
from dotmask.slam.coarse_depth import CoarseDepth
from dotmask.slam.keyframes import Keyframe
from dotmask.slam.loop_closing import ClosedLoops, LoopClosing, Node, odometry_edge
from dotmask.slam.loop_verification import VerifiedLoop
from dotmask.slam.settings import LoopSettings, OdometrySettings
from dotmask.slam.twists import exp, log
from dotmask.slam.vocabulary import Vocabulary

CAMERA = Intrinsics(width=64, height=48, fx=50.0, fy=50.0, cx=31.5, cy=23.5)
VOCABULARY = Vocabulary(levels=(np.zeros((64, 32), np.uint8),), idf=np.ones(64, np.float32))
SETTINGS = LoopSettings(recent_keyframes=3)
DEPTH = CoarseDepth.of(np.ones((48, 64), np.float32), CAMERA)


def at(x_m: float, y_m: float = 0.0) -> FloatArray:
    T = exp(np.array([0, 0, 0.3, 0, 0, 0]))
    T[:2, 3] = x_m, y_m
    return T


def keyframe(number: int, T_world_camera: FloatArray, place: int) -> Keyframe:
    """A keyframe that shows the words of a place; those of neighbouring places overlap by half."""
    words = (4 * place + np.arange(8)) % 64
    return Keyframe(
        number=number,
        frame_index=10 * number,
        timestamp_s=float(number),
        T_world_camera=T_world_camera,
        covariance=1e-6 * np.eye(6),
        pixels=np.zeros((8, 2), np.float32),
        p_camera=np.ones((8, 3), np.float32),
        descriptors=np.zeros((8, 32), np.uint8),
        words=words,
        depth=DEPTH,
    )


@dataclass
class TrueVerifier:
    """Knows where the keyframes are; remembers what it was asked."""

    truth: dict[int, FloatArray]
    asked: list[tuple[int, int]]
    refuses: frozenset[int] = frozenset()

    def verify(self, later: Keyframe, earlier: Keyframe) -> VerifiedLoop | None:
        self.asked.append((later.number, earlier.number))
        if earlier.number in self.refuses:
            return None
        T_from_to = inverse(self.truth[later.number]) @ self.truth[earlier.number]
        return VerifiedLoop(T_from_to=T_from_to, covariance=1e-6 * np.eye(6), inliers=100)


@pytest.fixture
def verifier(monkeypatch: pytest.MonkeyPatch) -> TrueVerifier:
    made = TrueVerifier(truth={}, asked=[])
    monkeypatch.setattr(module, "LoopVerifier", lambda *arguments: made)
    return made


def closing(settings: LoopSettings = SETTINGS) -> LoopClosing:
    return LoopClosing(CAMERA, VOCABULARY, OdometrySettings(), settings)


def test_a_place_that_looks_the_same_is_a_global_loop_and_corrects_the_drift(verifier):
    # Ten places in a row and back at the first; odometry has drifted 2 cm by then.
    loops, drift = closing(), exp(np.array([0, 0, 0, 0, 0.002, 0]))
    T = at(0.0)
    odometry = []
    for number in range(11):
        verifier.truth[number] = at(0.4 * number) if number < 10 else at(0.0)
        if number:
            T = T @ inverse(verifier.truth[number - 1]) @ verifier.truth[number] @ drift
        odometry.append(T)
        loops.add(keyframe(number, T, number if number < 10 else 0), None)
    closed = loops.close()
    (loop,) = closed.loops
    assert (loop.from_index, loop.to_index, loop.kind) == (100, 0, LoopKind.GLOBAL)
    before = np.linalg.norm(odometry[10][:3, 3] - verifier.truth[10][:3, 3])
    assert before > 0.015
    optimised = closed.corrected(closed.frame_indices, odometry)
    assert np.linalg.norm(optimised[10][:3, 3] - verifier.truth[10][:3, 3]) < 0.1 * before
    assert np.linalg.norm(optimised[5][:3, 3] - verifier.truth[5][:3, 3]) < 0.01


def test_a_place_that_is_near_is_a_proximity_loop_where_looks_say_nothing(verifier):
    loops = closing()
    for number, x_m in enumerate([0.0, 1.0, 2.0, 3.0, 4.0, 0.1]):
        verifier.truth[number] = at(x_m)
        loops.add(keyframe(number, at(x_m), 2 * number), None)
    (loop,) = loops.close().loops
    assert (loop.from_index, loop.to_index, loop.kind) == (50, 0, LoopKind.PROXIMITY)
    assert verifier.asked == [(5, 0)]


def test_recent_and_far_keyframes_are_not_tried(verifier):
    loops = closing()
    for number, x_m in enumerate([0.0, 1.0, 2.0, 3.0, 3.0, 3.0]):
        verifier.truth[number] = at(x_m)
        loops.add(keyframe(number, at(x_m), 2 * number), None)
    assert verifier.asked == []


def test_a_refused_look_alike_gives_way_to_the_nearest(verifier):
    loops = closing()
    verifier.refuses = frozenset([1])
    places = [0, 4, 8, 12, 14, 4]
    for number, x_m in enumerate([0.0, 5.0, 2.0, 3.0, 4.0, 0.1]):
        verifier.truth[number] = at(x_m)
        loops.add(keyframe(number, at(x_m), places[number]), None)
    assert verifier.asked == [(5, 1), (5, 0)]
    assert [loop.kind for loop in loops.close().loops] == [LoopKind.PROXIMITY]


def test_a_dropped_keyframe_is_not_tried_and_its_pose_stays_in_the_graph(verifier):
    loops, made = closing(), []
    for number, x_m in enumerate([0.0, 1.0, 2.0, 3.0, 4.0, 5.0]):
        verifier.truth[number] = at(x_m)
        made.append(keyframe(number, at(x_m), 2 * number))
        loops.add(made[-1], made[1] if number == 5 else None)
    verifier.truth[6] = at(1.0)
    loops.add(keyframe(6, at(1.0), 2), None)
    assert verifier.asked == []
    assert loops.close().frame_indices == (0, 10, 20, 30, 40, 50, 60)


def test_frames_move_with_the_last_keyframe_not_after_them():
    shifts = np.array([np.eye(4), exp(np.array([0, 0, 0, 0, 0, 1.0])), exp(np.array([0, 0, 0, 0, 0, 2.0]))])
    closed = ClosedLoops(frame_indices=(0, 10, 20), T_world_odometry=shifts, loops=())
    frames = [0, 9, 10, 11, 19, 20, 500]
    found = closed.corrected(frames, [at(1.0)] * len(frames))
    assert found[:, 2, 3].tolist() == [0.0, 0.0, 1.0, 1.0, 1.0, 2.0, 2.0]
    # What is put before a pose moves it in the world, whatever way the camera looks.
    np.testing.assert_allclose(found[3], shifts[1] @ at(1.0))
    assert closed.corrected([], []).shape == (0, 4, 4)


def test_the_covariance_of_a_motion_is_that_of_both_its_ends():
    rng = np.random.default_rng(2)
    ends = []
    for index in range(2):
        spread = rng.normal(size=(6, 6)) * [1e-3, 1e-3, 1e-3, 2e-3, 2e-3, 2e-3]
        covariance = spread.T @ spread + 1e-7 * np.eye(6)
        pose = exp(rng.normal(0, 0.7, 6))
        ends.append(Node(frame_index=index, T_world_camera=pose, covariance=covariance))
    edge = odometry_edge(0, *ends, scale=1.5)
    # Errors are drawn at both ends, and those of the relative pose counted.
    before, after = (rng.multivariate_normal(np.zeros(6), end.covariance, 4000) for end in ends)
    errors = [
        log(inverse(edge.T_a_b) @ inverse(ends[0].T_world_camera @ exp(b)) @ ends[1].T_world_camera @ exp(a))
        for b, a in zip(before, after, strict=True)
    ]
    nees = [error @ np.linalg.solve(edge.covariance, error) for error in errors]
    assert np.mean(nees) == pytest.approx(6 / 1.5, rel=0.05)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"recent_keyframes": 0}, "recent_keyframes"),
        ({"min_inliers": 5}, "min_inliers"),
        ({"odometry_covariance_scale": 0.0}, "odometry_covariance_scale"),
        ({"rejection_probability": 0.0}, "rejection_probability"),
    ],
)
def test_settings_refuse_what_cannot_work(wrong, message):
    with pytest.raises(ValueError, match=message):
        replace(SETTINGS, **wrong)
