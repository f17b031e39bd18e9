"""The closed loop on a flat wall with one box that slides sideways."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import pytest

from dotmask.geometry import inverse, transform
from dotmask.mask_geometry import dilate
from dotmask.masking import growth_px
from dotmask.pipeline import ClosedLoop, DotMask, MaskAll, StageClock, Unmasked, extrapolate
from dotmask.profiles import MaskGrowth, PoseFeedback, profile
from dotmask.records import (
    Detections,
    FloatArray,
    Intrinsics,
    MaskedDepth,
    PoseEstimate,
    Reason,
    RgbdFrame,
    SlamResult,
    SlamStatus,
    TrackPhase,
    Verdict,
)
from dotmask.tracking.association import Association

CAMERA = Intrinsics(width=160, height=120, fx=130.0, fy=130.0, cx=79.5, cy=59.5)
WALL_M, BOX_M, RATE_HZ = 4.0, 2.0, 30.0


def mask_at(index: int, step_px: float) -> np.ndarray:
    mask = np.zeros((CAMERA.height, CAMERA.width), bool)
    left = 20 + round(index * step_px)
    mask[40:90, left : left + 30] = True
    return mask


def frame_at(index: int, step_px: float) -> RgbdFrame:
    depth = np.full((CAMERA.height, CAMERA.width), WALL_M, np.float32)
    depth[mask_at(index, step_px)] = BOX_M
    rgb = np.zeros((CAMERA.height, CAMERA.width, 3), np.uint8)
    return RgbdFrame(index=index, timestamp_s=index / RATE_HZ, rgb=rgb, depth_m=depth, intrinsics=CAMERA)


class BoxSegmenter:
    def __init__(self, step_px: float, missing: Sequence[int] = ()) -> None:
        self._step_px, self._missing = step_px, missing

    def segment(self, frame: RgbdFrame) -> Detections:
        masks = [] if frame.index in self._missing else [mask_at(frame.index, self._step_px)]
        boxes = [[m.any(0).argmax(), m.any(1).argmax(), m.any(0).argmax() + 29, m.any(1).argmax() + 49] for m in masks]
        return Detections(
            masks=np.array(masks, bool).reshape(-1, CAMERA.height, CAMERA.width),
            boxes_px=np.array(boxes, float).reshape(-1, 4),
            class_names=("chair",) * len(masks),
            scores=np.ones(len(masks)),
        )


class PlaybackSlam:
    """Answers with poses from a list, None = lost, and remembers what it was given."""

    def __init__(self, poses: Sequence[FloatArray | None]) -> None:
        self.poses, self.seen = poses, []
        self.mapped: tuple[int, ...] = ()

    def track(self, frame: RgbdFrame, masked: MaskedDepth) -> PoseEstimate:
        self.seen.append(masked)
        pose = self.poses[frame.index]
        status = SlamStatus.LOST if pose is None else SlamStatus.TRACKED
        return PoseEstimate(timestamp_s=frame.timestamp_s, T_world_camera=pose, status=status, inliers=0)

    def update_map(self, frame: RgbdFrame, masked: MaskedDepth) -> None:
        self.mapped = (*self.mapped, frame.index)

    def finish(self) -> SlamResult:
        raise NotImplementedError


def at(x_m: float) -> FloatArray:
    pose = np.eye(4)
    pose[0, 3] = x_m
    return pose


def loop(front_end, poses, feedback: PoseFeedback = "previous") -> ClosedLoop:
    return ClosedLoop(front_end, PlaybackSlam(poses), feedback, np.eye(4))


@pytest.mark.parametrize("name", ["paper", "calibrated"])
@pytest.mark.parametrize(("step_px", "moves"), [(0.0, False), (2.0, True)])
def test_a_moving_box_leaves_odometry_and_an_idle_one_stays(name: str, step_px: float, moves: bool) -> None:
    method = loop(DotMask(BoxSegmenter(step_px), profile(name)), [np.eye(4)] * 30)
    for index in range(30):
        result = method.step(frame_at(index, step_px))
    box = mask_at(29, step_px)
    masked = result.front_end.masked
    assert (masked.mdi_m[box] == 0).all(), "the map must never see an object of interest"
    assert (masked.mo_mdi_m[box] == 0).all() == moves
    assert len(result.front_end.tracks) == 1
    speed = np.linalg.norm(result.front_end.tracks[0].velocity_world)
    assert speed == pytest.approx(step_px * RATE_HZ * BOX_M / CAMERA.fx, abs=0.12)


def test_mask_all_removes_idle_objects_too() -> None:
    result = loop(MaskAll(BoxSegmenter(0.0), profile("paper")), [np.eye(4)]).step(frame_at(0, 0.0))
    masked = result.front_end.masked
    assert (masked.mo_mdi_m[mask_at(0, 0.0)] == 0).all()
    np.testing.assert_array_equal(masked.mo_mdi_m, masked.mdi_m)


def test_unmasked_hands_over_the_raw_depth() -> None:
    frame = frame_at(0, 0.0)
    masked = loop(Unmasked(), [np.eye(4)]).step(frame).front_end.masked
    np.testing.assert_array_equal(masked.mo_mdi_m, frame.depth_m)
    np.testing.assert_array_equal(masked.mdi_m, frame.depth_m)


def test_the_fed_back_pose_is_the_last_or_the_extrapolated_one() -> None:
    poses = [at(0.1 * k) for k in range(4)]
    for feedback, expected in (("previous", 0.2), ("constant_velocity", 0.3)):
        method = loop(Unmasked(), poses, feedback)
        results = [method.step(frame_at(k, 0.0)) for k in range(4)]
        assert results[0].T_world_camera_predicted[0, 3] == 0.0
        assert results[3].T_world_camera_predicted[0, 3] == pytest.approx(expected)


def test_refined_beliefs_use_the_pose_of_odometry() -> None:
    # The camera jumps: what was predicted is 0.1 m off, odometry knows better.
    poses = [at(0.0), at(0.0), at(0.1)]
    beliefs = {}
    for feedback in ("constant_velocity", "refined"):
        method = loop(DotMask(BoxSegmenter(0.0), profile("paper")), poses, feedback)
        results = [method.step(frame_at(k, 0.0)) for k in range(3)]
        beliefs[feedback] = results[-1].front_end.tracks[0].position_world[0]
    assert beliefs["refined"] - beliefs["constant_velocity"] > 0.01


def test_while_slam_is_lost_the_last_known_pose_is_used_and_nothing_is_made_up() -> None:
    method = loop(Unmasked(), [at(0.1), None, None])
    results = [method.step(frame_at(k, 0.0)) for k in range(3)]
    assert results[1].pose.T_world_camera is None
    assert results[1].pose.status is SlamStatus.LOST
    assert results[2].T_world_camera_predicted[0, 3] == pytest.approx(0.1)


def test_a_step_that_raises_leaves_the_state_as_it_was() -> None:
    method = DotMask(BoxSegmenter(2.0), profile("paper"))
    for index in range(5):
        before = method.step(frame_at(index, 2.0), np.eye(4))
    with pytest.raises(ValueError, match="later"):
        method.step(frame_at(2, 2.0), np.eye(4))  # a stamp of the past
    after = method.step(frame_at(5, 2.0), np.eye(4))
    assert [t.track_id for t in after.tracks] == [t.track_id for t in before.tracks]
    assert after.tracks[0].hits == before.tracks[0].hits + 1


def test_refine_before_the_first_frame_is_refused() -> None:
    with pytest.raises(ValueError, match="no frame has been processed yet"):
        DotMask(BoxSegmenter(0.0), profile("paper")).refine(np.eye(4))


def test_extrapolation_keeps_a_straight_path_and_a_steady_turn() -> None:
    def pose(t: float) -> FloatArray:
        c, s = np.cos(0.4 * t), np.sin(0.4 * t)
        return np.array([[c, -s, 0, 2 * t], [s, c, 0, -t], [0, 0, 1, 0.5 * t], [0, 0, 0, 1.0]])

    np.testing.assert_allclose(extrapolate((0.0, pose(0.0)), (0.1, pose(0.1)), 0.25), pose(0.25), atol=1e-12)


def test_stages_are_timed() -> None:
    result = loop(DotMask(BoxSegmenter(0.0), profile("paper")), [np.eye(4)]).step(frame_at(0, 0.0))
    assert set(result.stage_seconds) == {"segment", "track", "classify", "mask", "odometry", "map"}


TEXTURE = cv2.GaussianBlur(np.random.default_rng(4).integers(0, 256, (50, 30), np.uint8), (0, 0), 1.2)


def textured(index: int, step_px: float) -> RgbdFrame:
    """The box carries its texture with it."""
    frame = frame_at(index, step_px)
    rgb = np.zeros_like(frame.rgb)
    rgb[mask_at(index, step_px)] = np.repeat(TEXTURE.reshape(-1, 1), 3, axis=1)
    return replace(frame, rgb=rgb)


def test_a_walking_box_that_is_missed_is_cut_out_where_it_goes_and_not_for_ever() -> None:
    profile_ = profile("calibrated")
    last = 20 + profile_.coasting_mask_frames
    missing = range(20, last + 3)
    method = loop(DotMask(BoxSegmenter(2.0, missing), profile_), [np.eye(4)] * 40)
    for index in range(last + 3):
        result = method.step(textured(index, 2.0)).front_end
        box, masked = mask_at(index, 2.0), result.masked
        if index < last:
            assert (masked.mo_mdi_m[box] == 0).all(), index
            assert (masked.mdi_m[box] == 0).all(), index
        else:
            assert (masked.mdi_m[box] == BOX_M).all(), index
    assert [t.phase for t in result.tracks] == [TrackPhase.COASTING]


def test_a_box_that_is_seen_once_and_missed_is_forgotten() -> None:
    method = loop(DotMask(BoxSegmenter(2.0, [1]), profile("calibrated")), [np.eye(4)] * 2)
    assert len(method.step(textured(0, 2.0)).front_end.tracks) == 1
    result = method.step(textured(1, 2.0)).front_end
    assert result.tracks == ()
    assert (result.masked.mdi_m == textured(1, 2.0).depth_m).all()


def test_a_surface_that_moves_and_one_that_the_camera_passes() -> None:
    shift_m = 2 * BOX_M / CAMERA.fx
    for poses, speed in (([np.eye(4)] * 20, shift_m * RATE_HZ), ([at(-k * shift_m) for k in range(20)], 0.0)):
        method = loop(DotMask(BoxSegmenter(2.0), profile("calibrated")), poses, "refined")
        for index in range(20):
            result = method.step(textured(index, 2.0))
        [track] = result.front_end.tracks
        assert track.surface is not None
        assert track.surface.moving_share == (1.0 if speed else 0.0)
        np.testing.assert_allclose(track.surface.velocity_world, [speed, 0, 0], atol=0.03)
        np.testing.assert_allclose(track.velocity_world, [speed, 0, 0], atol=0.05)
        assert track.verdict is not None
        assert track.verdict.reason is (Reason.SPEED if speed else Reason.IDLE)


def test_surfaces_are_seen_from_the_pose_of_odometry() -> None:
    """The camera jumps in frame 6 and the picture does not change: the object went along, and then both stand."""
    poses = [at(0.0)] * 6 + [at(0.1)] * 4
    velocities: dict[PoseFeedback, list[float]] = {"constant_velocity": [], "refined": []}
    for feedback, found in velocities.items():
        method = loop(DotMask(BoxSegmenter(0.0), profile("calibrated")), poses, feedback)
        for index in range(10):
            [track] = method.step(textured(index, 0.0)).front_end.tracks
            found.append(0.0 if track.surface is None else track.surface.velocity_world[0])
    jump = 0.1 * RATE_HZ / 3  # over the last 0.1 s
    assert velocities["refined"] == pytest.approx([0.0] * 6 + [jump] * 3 + [0.0], abs=0.02)
    assert velocities["constant_velocity"][6] == pytest.approx(0.0, abs=1e-6), "it did not know yet"


def test_masks_grow_by_the_way_of_the_camera_during_the_delay() -> None:
    growth = MaskGrowth(base_px=1.0, depth_delay_s=0.1)
    method = DotMask(BoxSegmenter(0.0), replace(profile("calibrated"), growth=growth))
    radii = []
    for index, pose in enumerate([at(0.0), at(0.02)]):  # 0.6 m/s
        result = method.step(frame_at(index, 0.0), pose)
        [track] = result.tracks
        p_camera = transform(inverse(pose), track.position_world)
        drift = track.velocity_world - np.array([0.6 * index, 0, 0])
        radii.append(growth_px(p_camera, drift, CAMERA, growth))
        np.testing.assert_array_equal(result.masked.mdi_m == 0, dilate(mask_at(index, 0.0), radii[-1]))
    assert radii[0] == 1, "in the first frame nothing is known of the camera's motion"
    assert radii[1] >= 3


def test_the_paper_follows_no_points() -> None:
    method = loop(DotMask(BoxSegmenter(2.0), profile("paper")), [np.eye(4)] * 3)
    for index in range(3):
        result = method.step(textured(index, 2.0))
    assert [t.surface for t in result.front_end.tracks] == [None]


def test_association_and_classification_can_be_replaced() -> None:
    def never(tracks, observations, *_):
        every = (tuple(range(len(x))) for x in (tracks, observations))
        return Association(pairs=(), unmatched_tracks=next(every), unmatched_observations=next(every))

    def always(track, *_):
        return Verdict(is_moving=True, reason=Reason.NEW, speed_m_s=float(track.track_id), mask_iou=None)

    method = loop(DotMask(BoxSegmenter(0.0), profile("paper"), associate=never, classify=always), [np.eye(4)] * 3)
    for index in range(3):
        result = method.step(frame_at(index, 0.0)).front_end
    assert [t.track_id for t in result.tracks] == [1, 2, 3]
    assert [t.verdict and t.verdict.speed_m_s for t in result.tracks] == [1.0, 2.0, 3.0]
    assert (result.masked.mo_mdi_m[mask_at(2, 0.0)] == 0).all(), "idle, but said to move"


def test_what_slam_has_done_elsewhere_counts() -> None:
    class Elsewhere:
        cpu_elsewhere_s = 1.0

    part, clock = Elsewhere(), StageClock()
    with clock("odometry", part):
        part.cpu_elsewhere_s += 7.0
    with clock("map", object()):
        pass
    assert 7.0 <= clock.seconds["odometry"] < 7.5
    assert clock.seconds["map"] < 0.5
