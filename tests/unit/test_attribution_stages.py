"""The replaced stages on a flat wall with two boxes, one of which slides sideways."""

from collections.abc import Sequence

import numpy as np
import pytest

from dotmask.pipeline import FrontEndResult
from dotmask.profiles import profile
from dotmask.records import Detections, FloatArray, Intrinsics, MaskedDepth, Reason, RgbdFrame
from scenarios.attribution.true_stages import TrueDepth, TruePose, build_front_end
from scenarios.attribution.variants import STAGES, VARIANTS, Stage
from scenarios.attribution.witness import Sighting, Witness, look
from scenarios.oracle import OracleSegmenter
from sim.records import GroundTruth, ObjectTruth

CAMERA = Intrinsics(width=160, height=120, fx=130.0, fy=130.0, cx=79.5, cy=59.5)
WALL_M, BOX_M, RATE_HZ = 4.0, 2.0, 30.0
SLIDING, STANDING = 7, 9
PROFILE = profile("paper")


def masks_at(index: int) -> dict[int, np.ndarray]:
    masks = {i: np.zeros((CAMERA.height, CAMERA.width), bool) for i in (SLIDING, STANDING)}
    masks[SLIDING][20:60, 10 + 2 * index : 40 + 2 * index] = True
    masks[STANDING][70:110, 60:100] = True
    return masks


def actor(instance_id: int, pixels: int) -> ObjectTruth:
    return ObjectTruth(
        name=str(instance_id),
        class_name="chair",
        instance_id=instance_id,
        T_world_object=np.eye(4),
        centre_world=np.zeros(3),
        velocity_world=np.zeros(3),
        surface_speed_m_s=0.0,
        is_moving=instance_id == SLIDING,
        visible_pixels=pixels,
        occlusion=0.0,
        is_truncated=False,
        ideal_world=None,
    )


def truth_at(index: int, T_world_camera: FloatArray | None = None) -> GroundTruth:
    depth, ids = np.full((CAMERA.height, CAMERA.width), WALL_M, np.float32), np.zeros((120, 160), np.uint16)
    for instance, mask in masks_at(index).items():
        depth[mask], ids[mask] = BOX_M, instance
    return GroundTruth(
        T_world_camera=np.eye(4) if T_world_camera is None else T_world_camera,
        depth_m=depth,
        instance_ids=ids,
        objects=tuple(actor(i, int(m.sum())) for i, m in masks_at(index).items()),
    )


def frame_at(index: int, depth_offset_m: float = 0.0) -> RgbdFrame:
    """The sensor measures everything too far by an offset, and nothing in the first column."""
    depth = truth_at(index).depth_m + np.float32(depth_offset_m)
    depth[:, 0] = 0
    rgb = np.zeros((CAMERA.height, CAMERA.width, 3), np.uint8)
    return RgbdFrame(index=index, timestamp_s=index / RATE_HZ, rgb=rgb, depth_m=depth, intrinsics=CAMERA)


def detections(masks: Sequence[np.ndarray]) -> Detections:
    """Best first in the order of the masks, as the method sorts them."""
    boxes = [[np.flatnonzero(m.any(0))[k], np.flatnonzero(m.any(1))[k]] for m in masks for k in (0, -1)]
    return Detections(
        masks=np.array(masks, bool).reshape(-1, CAMERA.height, CAMERA.width),
        boxes_px=np.array(boxes, float).reshape(-1, 4),
        class_names=("chair",) * len(masks),
        scores=np.linspace(1.0, 0.9, len(masks)),
    )


def sighting(index: int, masks: Sequence[np.ndarray], instances: Sequence[int | None]) -> Sighting:
    return Sighting(frame_index=index, detections=detections(masks), instances=tuple(instances))


def exact(index: int) -> Sighting:
    return sighting(index, list(masks_at(index).values()), (SLIDING, STANDING))


class RecordingFrontEnd:
    """Remembers what it was given and cuts the sliding box out of it."""

    def __init__(self) -> None:
        self.poses: list[FloatArray] = []
        self.depths: list[np.ndarray] = []

    def step(self, frame: RgbdFrame, T_world_camera: FloatArray) -> FrontEndResult:
        self.poses.append(T_world_camera)
        self.depths.append(frame.depth_m)
        cut = frame.depth_m.copy()
        cut[masks_at(frame.index)[SLIDING]] = 0
        masked = MaskedDepth(mo_mdi_m=cut, mdi_m=cut)
        self.result = FrontEndResult(detections=None, observations=(), tracks=(), masked=masked, stage_seconds={})
        return self.result

    def refine(self, T_world_camera: FloatArray) -> FrontEndResult:
        self.poses.append(T_world_camera)
        return self.result


def at(x_m: float) -> FloatArray:
    pose = np.eye(4)
    pose[0, 3] = x_m
    return pose


def run_frames(stages: set[Stage], sightings: Sequence[Sighting], depth_offset_m: float = 0.0) -> list[FrontEndResult]:
    witness = Witness()
    front_end = build_front_end(stages, witness, PROFILE)
    results = []
    for index, seen in enumerate(sightings):
        witness.show(truth_at(index), seen)
        front_end.step(frame_at(index, depth_offset_m), np.eye(4))
        results.append(front_end.refine(np.eye(4)))
    return results


def test_every_stage_is_once_alone_and_once_the_only_one_left_out() -> None:
    sets = [v.true_stages for v in VARIANTS]
    assert len(sets) == len(set(sets)) == len({v.name for v in VARIANTS}) == 2 + 2 * len(STAGES)
    assert {len(s) for s in sets} == {0, 1, len(STAGES) - 1, len(STAGES)}


def test_the_true_pose_reaches_the_front_end_in_both_looks() -> None:
    inner, witness = RecordingFrontEnd(), Witness()
    witness.show(truth_at(0, at(0.5)), exact(0))
    front_end = TruePose(inner, witness)
    front_end.step(frame_at(0), at(0.1))
    front_end.refine(at(0.2))
    assert [pose[0, 3] for pose in inner.poses] == [0.5, 0.5]


def test_the_true_pose_moves_the_beliefs() -> None:
    positions = {}
    for stages in ({"pose"}, set()):
        witness = Witness()
        witness.show(truth_at(0, at(0.5)), exact(0))
        result = build_front_end(stages, witness, PROFILE).step(frame_at(0), np.eye(4))
        positions[bool(stages)] = result.tracks[0].position_world[0]
    assert positions[True] - positions[False] == pytest.approx(0.5)


def test_with_true_depth_the_front_end_measures_the_truth_and_slam_gets_the_sensors_values() -> None:
    inner, witness = RecordingFrontEnd(), Witness()
    witness.show(truth_at(0), exact(0))
    frame = frame_at(0, depth_offset_m=0.3)
    front_end = TrueDepth(inner, witness)
    stepped, refined = front_end.step(frame, np.eye(4)), front_end.refine(np.eye(4))
    np.testing.assert_array_equal(inner.depths[0], truth_at(0).depth_m)
    expected = np.where(masks_at(0)[SLIDING], 0, frame.depth_m)
    for result in (stepped, refined):
        for depth in (result.masked.mo_mdi_m, result.masked.mdi_m):
            np.testing.assert_array_equal(depth, expected)


@pytest.mark.parametrize(("stages", "error_m"), [(set(), 0.3), ({"depth"}, 0.0)])
def test_true_depth_changes_what_is_measured(stages: set[Stage], error_m: float) -> None:
    result = run_frames(stages, [exact(0)], depth_offset_m=0.3)[0]
    assert [o.position_camera[2] - BOX_M for o in result.observations] == pytest.approx([error_m] * 2, abs=1e-6)


class FaultySegmenter:
    """Finds half of the standing box, and a box where there is none."""

    def segment(self, frame: RgbdFrame) -> Detections:
        half, ghost = masks_at(frame.index)[STANDING].copy(), np.zeros((CAMERA.height, CAMERA.width), bool)
        half[:, 75:], ghost[5:15, 120:150] = False, True
        return detections([half, ghost])


def test_true_masks_are_exact_whatever_the_segmenter_finds() -> None:
    oracle, truth, frame = OracleSegmenter(), truth_at(3), frame_at(3)
    oracle.show(3, truth)
    true, found = (look(segmenter, frame, truth, PROFILE) for segmenter in (oracle, FaultySegmenter()))
    assert sorted(true.instances) == [SLIDING, STANDING]
    for mask, instance in zip(true.detections.masks, true.instances, strict=True):
        np.testing.assert_array_equal(mask, masks_at(3)[instance])
    assert found.instances == (None, None), "half a box is too poor a mask, and nothing is behind the ghost"


def test_the_witness_hands_out_the_frame_it_was_shown_and_no_other() -> None:
    witness = Witness()
    witness.show(truth_at(0), exact(0))
    with pytest.raises(RuntimeError, match="asked for frame 1, but was shown 0"):
        witness.segment(frame_at(1))


def test_a_front_end_that_reorders_the_detections_is_noticed() -> None:
    witness = Witness()
    one, other = masks_at(0).values()
    seen = sighting(0, [one, other], (SLIDING, STANDING))
    reordered = Sighting(frame_index=0, detections=seen.detections.select([1, 0]), instances=(STANDING, SLIDING))
    witness.show(truth_at(0), reordered)
    with pytest.raises(RuntimeError, match="other detections"):
        build_front_end(set(), witness, PROFILE).step(frame_at(0), np.eye(4))


def test_the_true_verdict_is_whether_the_instance_moves() -> None:
    verdicts = [
        {t.position_world[0] < 0: t.verdict for t in result.tracks}
        for result in run_frames({"moc"}, [exact(i) for i in range(4)])
    ]
    assert [(v[True].is_moving, v[False].is_moving) for v in verdicts] == [(True, False)] * 4
    assert verdicts[0][True].reason is Reason.SPEED
    own = run_frames(set(), [exact(0)])[0].tracks
    assert not any(t.verdict.is_moving for t in own), "by itself the method cannot know in the first frame"


def test_a_track_that_is_not_seen_is_answered_by_its_last_instance_and_a_false_one_by_the_method() -> None:
    ghost = np.zeros((CAMERA.height, CAMERA.width), bool)
    ghost[5:15, 120:150] = True
    first = sighting(0, [masks_at(0)[SLIDING], ghost], (SLIDING, None))
    results = run_frames({"moc"}, [first, sighting(1, [], ())])
    for result in results:
        assert [t.verdict.is_moving for t in result.tracks] == [True, False]
    assert [t.misses for t in results[1].tracks] == [1, 1]


def swapped(index: int) -> Sighting:
    """From frame 1 on the two boxes have changed places at once: only the truth knows who is who."""
    one, other = masks_at(0).values()
    return sighting(index, [one, other] if index == 0 else [other, one], (SLIDING, STANDING))


@pytest.mark.parametrize(("stages", "keeps"), [(set(), False), ({"association"}, True)])
def test_true_association_follows_the_instance_wherever_it_jumps(stages: set[Stage], keeps: bool) -> None:
    results = run_frames(stages, [swapped(0), swapped(1)])
    before, after = ({t.detection_index: t.track_id for t in r.tracks} for r in results)
    assert (before == after) is keeps


def test_true_association_lets_an_instance_that_comes_back_have_its_track() -> None:
    away = sighting(1, [masks_at(0)[STANDING]], (STANDING,))
    results = run_frames({"association"}, [exact(0), away, exact(2)])
    assert [t.track_id for t in results[2].tracks] == [1, 2]
    assert [t.misses for t in results[2].tracks] == [0, 0]


def test_false_detections_are_paired_among_themselves() -> None:
    ghost = np.zeros((CAMERA.height, CAMERA.width), bool)
    ghost[5:15, 120:150] = True
    seen = [
        sighting(
            i, [*masks_at(i).values(), ghost][: 2 if i == 1 else 3], (SLIDING, STANDING, None)[: 2 if i == 1 else 3]
        )
        for i in range(3)
    ]
    results = run_frames({"association"}, seen)
    assert [{t.track_id: t.detection_index for t in r.tracks} for r in results] == [
        {1: 0, 2: 1, 3: 2},
        {1: 0, 2: 1, 3: None},
        {1: 0, 2: 1, 3: 2},
    ]


def test_all_true_leaves_nothing_of_what_moves_and_everything_of_what_stands() -> None:
    for index, result in enumerate(run_frames(set(STAGES), [exact(i) for i in range(5)], depth_offset_m=0.3)):
        masks, frame = masks_at(index), frame_at(index, 0.3)
        assert (result.masked.mo_mdi_m[masks[SLIDING]] == 0).all()
        np.testing.assert_array_equal(result.masked.mo_mdi_m[masks[STANDING]], frame.depth_m[masks[STANDING]])
        assert (result.masked.mdi_m[masks[STANDING]] == 0).all()
