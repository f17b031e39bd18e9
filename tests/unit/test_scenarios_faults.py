"""Every fault is measured back: how often, how large, how late."""

import gc
import weakref
from collections import Counter
from itertools import groupby

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from dotmask.records import Detections, Intrinsics, RgbdFrame
from scenarios.errors import ScenarioError
from scenarios.faults.chain import Faults
from scenarios.faults.false_positives import Shown, false_positives
from scenarios.faults.found import Dice, Found
from scenarios.faults.labels import class_flips, order, scores
from scenarios.faults.missing import limit, missed, missed_bursts, roll_deg, tilted
from scenarios.faults.shapes import borders, merged, split
from scenarios.oracle import CLASSES, OracleSegmenter, true_detections
from scenarios.registry import RENDERED_AS, SCENARIOS, scenario
from scenarios.run import RunSettings, run
from scenarios.spec import (
    BordersSpec,
    ClassFlipsSpec,
    FalsePositivesSpec,
    FaultsSpec,
    LimitSpec,
    MergedSpec,
    MissedBurstsSpec,
    MissedSpec,
    OrderSpec,
    ScoresSpec,
    SplitSpec,
    TiltedSpec,
    scenario_from_json,
    with_overrides,
)
from scenarios.world import build_simulator
from sim.geometry import look_at
from sim.records import GroundTruth, ObjectTruth

HEIGHT, WIDTH = 120, 160
SMALL = {
    "camera.width": "160", "camera.height": "120", "camera.fx": "133.85", "camera.fy": "134.8",
    "camera.cx": "79.65", "camera.cy": "61.5",
}  # fmt: skip
UPRIGHT = look_at((0.0, 0.0, 1.4), (0.0, 3.0, 1.4))
WALL_M = 3.0

# u_min, v_min, u_max, v_max
LEFT, RIGHT, FAR = (10, 20, 39, 79), (60, 30, 99, 49), (120, 70, 149, 109)
THREE = (("person", LEFT), ("chair", RIGHT), ("cup", FAR))


def truth_of(*things: tuple[str, tuple[int, int, int, int]], T_world_camera: np.ndarray = UPRIGHT) -> GroundTruth:
    """A wall, and before it rectangles; the first has instance id 1."""
    ids = np.zeros((HEIGHT, WIDTH), np.uint16)
    for number, (_, (u_min, v_min, u_max, v_max)) in enumerate(things, start=1):
        ids[v_min : v_max + 1, u_min : u_max + 1] = number
    objects = tuple(
        ObjectTruth(
            name=f"thing {number}",
            class_name=class_name,
            instance_id=number,
            T_world_object=np.eye(4),
            centre_world=np.zeros(3),
            velocity_world=np.zeros(3),
            surface_speed_m_s=0.0,
            is_moving=False,
            visible_pixels=int(np.count_nonzero(ids == number)),
            occlusion=0.0,
            is_truncated=False,
            ideal_world=None,
        )
        for number, (class_name, _) in enumerate(things, start=1)
    )
    depth_m = np.full((HEIGHT, WIDTH), WALL_M, np.float32)
    return GroundTruth(T_world_camera=T_world_camera, depth_m=depth_m, instance_ids=ids, objects=objects)


def found_in(truth: GroundTruth) -> Found:
    return Found.by_truth(true_detections(truth), truth)


def dice(frame_index: int) -> Dice:
    return Dice(seed=0, frame_index=frame_index)


def faulty(**overrides: str) -> Faults:
    """The faults of a small scenario; `missed__probability` stands for faults.missed.probability."""
    keys = {f"faults.{key.replace('__', '.')}": value for key, value in overrides.items()}
    return Faults(with_overrides(scenario("smoke"), {**SMALL, **keys}))


def same(one: Detections, other: Detections) -> bool:
    return (
        np.array_equal(one.masks, other.masks)
        and np.array_equal(one.boxes_px, other.boxes_px)
        and one.class_names == other.class_names
        and np.array_equal(one.scores, other.scores)
    )


def boxes_are_those_of_the_masks(detections: Detections) -> bool:
    for mask, box in zip(detections.masks, detections.boxes_px, strict=True):
        v, u = np.nonzero(mask)
        if box.tolist() != [u.min(), v.min(), u.max(), v.max()]:
            return False
    return True


# --- none


def test_without_faults_the_answer_is_the_very_object_of_the_oracle() -> None:
    faults, truth = faulty(), truth_of(*THREE)
    for index in range(12):
        exact = true_detections(truth)
        assert faults(index, truth, exact) is exact


def test_the_oracle_names_what_it_sees_and_leaves_out_what_is_too_small() -> None:
    truth = truth_of(*THREE, ("bottle", (5, 5, 12, 13)), ("box", (100, 0, 120, 20)))
    detections = true_detections(truth)
    assert detections.class_names == ("person", "chair", "cup")
    assert detections.boxes_px.tolist() == [list(box) for _, box in THREE]
    assert detections.masks.sum(axis=(1, 2)).tolist() == [30 * 60, 40 * 20, 30 * 40]
    assert found_in(truth).names == ("1", "2", "3")
    oracle = OracleSegmenter()
    frame = build_frame(4)
    with pytest.raises(RuntimeError, match="asked for frame 4, but was shown None"):
        oracle.segment(frame)
    oracle.show(4, truth)
    assert same(oracle.segment(frame), detections)


def build_frame(index: int) -> RgbdFrame:
    camera = Intrinsics(width=WIDTH, height=HEIGHT, fx=133.85, fy=134.8, cx=79.65, cy=61.5)
    rgb, depth_m = np.zeros((HEIGHT, WIDTH, 3), np.uint8), np.zeros((HEIGHT, WIDTH), np.float32)
    return RgbdFrame(index=index, timestamp_s=0.0, rgb=rgb, depth_m=depth_m, intrinsics=camera)


# --- what is left out


def test_missed_detections_are_as_many_as_asked_for_and_independent() -> None:
    found, spec, frames = found_in(truth_of(*THREE)), MissedSpec(probability=0.3), 2500
    lost = np.array(
        [[name not in missed(found, spec, dice(k)).names for name in found.names] for k in range(frames)], float
    )
    assert lost.mean(axis=0) == pytest.approx(0.3, abs=4 * np.sqrt(0.21 / frames))
    independent = 4 / np.sqrt(frames)
    for a, b in ((lost[1:, 0], lost[:-1, 0]), (lost[:, 0], lost[:, 1]), (lost[:, 1], lost[:, 2])):
        assert abs(np.corrcoef(a, b)[0, 1]) < independent


@pytest.mark.parametrize(("share", "mean_frames"), [(0.3, 5.0), (0.15, 2.0), (0.4, 1.0)])
def test_bursts_last_and_fill_as_asked_for(share: float, mean_frames: float) -> None:
    found, frames = found_in(truth_of(("person", LEFT))), 12000
    spec = MissedBurstsSpec(share=share, mean_frames=mean_frames)
    lost = [not missed_bursts(found, spec, dice(k)).names for k in range(frames)]
    bursts = [len(list(run)) for is_lost, run in groupby(lost) if is_lost][1:-1]
    # Errors of the mean of geometric lengths, and of the share of a chain with this correlation from frame to frame.
    length_error = np.sqrt(mean_frames * (mean_frames - 1) / len(bursts))
    keeps = 1 - 1 / mean_frames - share / (1 - share) / mean_frames
    share_error = np.sqrt(share * (1 - share) * (1 + keeps) / (1 - keeps) / frames)
    assert np.mean(bursts) == pytest.approx(mean_frames, abs=4 * length_error + 1e-9)
    assert np.mean(lost) == pytest.approx(share, abs=4 * share_error)


@pytest.mark.parametrize(("share", "mean_frames"), [(0.3, 6.0), (0.42, 1.0), (0.5, 2.0)])
def test_a_burst_asked_alone_is_that_of_the_chain_run_from_long_ago(share: float, mean_frames: float) -> None:
    """The second implementation steps through the frames with the same numbers; what it starts from is forgotten."""
    found = found_in(truth_of(("person", LEFT)))
    spec = MissedBurstsSpec(share=share, mean_frames=mean_frames)
    stay, start = 1 - 1 / mean_frames, share / (1 - share) / mean_frames
    for first in (False, True):
        is_lost = first
        for index in range(-300, 300):
            is_lost = dice(index).throw("missed bursts", "1").random() < (stay if is_lost else start)
            if index >= 0:
                assert is_lost == (not missed_bursts(found, spec, dice(index)).names), index


def test_instances_have_bursts_of_their_own() -> None:
    found, spec = found_in(truth_of(*THREE)), MissedBurstsSpec(share=0.5, mean_frames=3.0)
    kept = Counter(len(missed_bursts(found, spec, dice(k)).names) for k in range(600))
    # Binomial with 3 and one half: all, none, and those between.
    for count, share in ((0, 1 / 8), (1, 3 / 8), (2, 3 / 8), (3, 1 / 8)):
        assert kept[count] / 600 == pytest.approx(share, abs=0.1)


def test_bursts_that_cannot_be_are_refused() -> None:
    with pytest.raises(ScenarioError, match=r"faults\.missed_bursts: .*bursts of 1 frames can take 0.444"):
        faulty(missed_bursts__share="0.5", missed_bursts__mean_frames="1")


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, -50.0, 90.0, -120.0, 179.0])
@pytest.mark.parametrize("target", [(0.0, 3.0, 1.4), (2.0, -1.0, 0.3), (1.0, 1.0, 2.5)])
def test_people_are_not_found_beyond_an_angle(angle_deg: float, target: tuple[float, float, float]) -> None:
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    T_world_camera = look_at((0.0, 0.0, 1.4), target)
    T_world_camera[:3, :3] = T_world_camera[:3, :3] @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    assert roll_deg(T_world_camera) == pytest.approx(abs(angle_deg), abs=1e-6)
    found = found_in(truth_of(*THREE, T_world_camera=T_world_camera))
    for beyond in (20.0, 45.0, 100.0, 180.0):
        seen = tilted(found, TiltedSpec(beyond_deg=beyond), T_world_camera).detections.class_names
        assert seen == (("chair", "cup") if abs(angle_deg) > beyond else ("person", "chair", "cup"))


def test_the_largest_are_kept_in_their_order() -> None:
    found = found_in(truth_of(("chair", RIGHT), ("person", LEFT), ("cup", FAR), ("bottle", (60, 60, 99, 79))))
    names = {most: limit(found, LimitSpec(most=most)).names for most in (1, 2, 3, 4, 9)}
    assert names == {1: ("2",), 2: ("2", "3"), 3: ("1", "2", "3"), 4: found.names, 9: found.names}


# --- masks


@pytest.mark.parametrize("pixels", [-9, -3, -1, 1, 4, 8])
def test_borders_move_by_the_pixels_asked_for(pixels: int) -> None:
    found = found_in(truth_of(*THREE))
    changed = borders(found, BordersSpec(pixels=pixels)).detections
    assert boxes_are_those_of_the_masks(changed)
    expected = [[u - pixels, v - pixels, w + pixels, x + pixels] for _, (u, v, w, x) in THREE]
    assert changed.boxes_px.tolist() == expected
    for before, after, (_, (u, v, w, x)) in zip(found.detections.masks, changed.masks, THREE, strict=True):
        if pixels < 0:  # a rectangle shrunk by a disc is a smaller rectangle
            assert np.count_nonzero(after) == (w - u + 1 + 2 * pixels) * (x - v + 1 + 2 * pixels)
        else:  # within a pixel of all that lies as near as that
            distance = distance_transform_edt(~before)
            assert after[distance <= pixels - 1].all()
            assert not after[distance > pixels + 1].any()


def test_the_border_of_the_image_shrinks_nothing_and_an_empty_mask_is_not_reported() -> None:
    found = found_in(truth_of(("person", (0, 0, 39, 119)), ("cup", (60, 20, 99, 25))))
    changed = borders(found, BordersSpec(pixels=-3))
    assert changed.names == ("1",)
    assert changed.detections.boxes_px.tolist() == [[0, 0, 36, 119]]
    assert len(borders(found, BordersSpec(pixels=-50)).detections) == 0


def test_a_pair_of_one_class_that_touches_becomes_one() -> None:
    near, apart, chair = (40, 50, 59, 110), (41, 50, 59, 110), (35, 20, 60, 90)
    touching = found_in(truth_of(("person", LEFT), ("person", near)))
    one = merged(touching, MergedSpec(probability=1.0), dice(0))
    assert one.names == ("1",)
    assert one.detections.boxes_px.tolist() == [[10, 20, 59, 110]]
    assert np.array_equal(one.detections.masks[0], touching.detections.masks.any(axis=0))
    turned = merged(found_in(truth_of(("person", near), ("person", LEFT))), MergedSpec(probability=1.0), dice(0))
    assert turned.detections.boxes_px.tolist() == [[10, 20, 59, 110]]
    for others in ((("person", LEFT), ("person", apart)), (("person", LEFT), ("chair", chair))):
        two = found_in(truth_of(*others))
        assert merged(two, MergedSpec(probability=1.0), dice(0)) is two
    row = found_in(truth_of(*(("person", (10 + 20 * k, 20, 29 + 20 * k, 60)) for k in range(3))))
    assert merged(row, MergedSpec(probability=1.0), dice(0)).names == ("1", "3"), "each is merged with one at most"


def test_merging_and_splitting_happen_as_often_as_asked_for() -> None:
    frames, near = 1500, found_in(truth_of(("person", LEFT), ("person", (30, 15, 59, 100))))
    merges = sum(len(merged(near, MergedSpec(probability=0.4), dice(k)).names) == 1 for k in range(frames))
    assert merges / frames == pytest.approx(0.4, abs=4 * np.sqrt(0.24 / frames))
    three = found_in(truth_of(*THREE))
    parts = sum(len(split(three, SplitSpec(probability=0.3), dice(k)).names) - 3 for k in range(frames))
    assert parts / (3 * frames) == pytest.approx(0.3, abs=4 * np.sqrt(0.21 / (3 * frames)))


def test_the_parts_of_a_split_are_the_whole_and_both_are_there() -> None:
    tiny = (("cup", (2, 2, 3, 101)), ("bottle", (20, 3, 99, 3)))
    found, cuts = found_in(truth_of(*THREE, *tiny)), []
    for index in range(60):
        parts = split(found, SplitSpec(probability=1.0), dice(index))
        assert parts.names == tuple(n + end for n in found.names for end in ("", "/2"))
        assert boxes_are_those_of_the_masks(parts.detections)
        for whole, first, second in zip(
            found.detections.masks, parts.detections.masks[::2], parts.detections.masks[1::2], strict=True
        ):
            assert np.array_equal(first | second, whole)
            assert not (first & second).any()
        cuts.append(parts.detections.boxes_px[1, 1])
        assert parts.detections.boxes_px[0, [0, 2]].tolist() == [10, 39], "the person is cut across"
        assert parts.detections.boxes_px[2, [1, 3]].tolist() == [30, 49], "the wide chair is cut along"
    assert 20 + 0.25 * 59 - 1 <= min(cuts) < 42
    assert 58 < max(cuts) <= 20 + 0.75 * 59 + 1


# --- what is said about them


def test_classes_flip_as_often_as_asked_for_to_any_other() -> None:
    found, frames = found_in(truth_of(*THREE)), 2000
    said = [class_flips(found, ClassFlipsSpec(probability=0.3), dice(k)).detections.class_names for k in range(frames)]
    for index, true_name in enumerate(found.detections.class_names):
        counts = Counter(names[index] for names in said)
        assert counts[true_name] / frames == pytest.approx(0.7, abs=4 * np.sqrt(0.21 / frames))
        for other in set(CLASSES) - {true_name}:
            assert counts[other] / frames == pytest.approx(0.1, abs=4 * np.sqrt(0.09 / frames))


def test_scores_lie_in_their_range_and_their_order_says_nothing() -> None:
    found, frames = found_in(truth_of(*THREE)), 1500
    drawn = np.array(
        [scores(found, ScoresSpec(lowest=0.4, highest=0.9), dice(k)).detections.scores for k in range(frames)]
    )
    assert 0.4 <= drawn.min() < 0.41
    assert 0.89 < drawn.max() <= 0.9
    assert drawn.mean(axis=0) == pytest.approx(0.65, abs=4 * 0.5 / np.sqrt(12 * frames))
    assert (drawn[:, 0] > drawn[:, 1]).mean() == pytest.approx(0.5, abs=2 / np.sqrt(frames))
    with pytest.raises(ScenarioError, match=r"faults\.scores: .*lowest 0.9 is above highest 0.4"):
        faulty(scores__lowest="0.9", scores__highest="0.4")


def test_every_order_is_as_likely_as_the_others_and_nothing_is_lost() -> None:
    found, frames = found_in(truth_of(*THREE)), 3000
    seen = Counter(order(found, OrderSpec(is_shuffled=True), dice(k)).names for k in range(frames))
    assert len(seen) == 6
    for names, count in seen.items():
        assert sorted(names) == ["1", "2", "3"]
        assert count / frames == pytest.approx(1 / 6, abs=4 * np.sqrt(5 / 36 / frames))
    shuffled = order(found, OrderSpec(is_shuffled=True), dice(1))
    for name, mask, class_name in zip(
        shuffled.names, shuffled.detections.masks, shuffled.detections.class_names, strict=True
    ):
        at = found.names.index(name)
        assert class_name == found.detections.class_names[at]
        assert np.array_equal(mask, found.detections.masks[at])


# --- false positives


def test_false_positives_are_as_many_as_asked_for_and_stay_as_long() -> None:
    frames, truth = 3000, truth_of()
    faults = faulty(false_positives__per_frame="0.8", false_positives__frames="5")
    counts, classes = [], Counter()
    for index in range(frames):
        answer = faults(index, truth, true_detections(truth))
        counts.append(len(answer))
        classes.update(answer.class_names)
        assert boxes_are_those_of_the_masks(answer)
    # A sum over five frames of Poisson numbers: as many independent ones as a fifth of the frames.
    assert np.mean(counts[5:]) == pytest.approx(0.8, abs=4 * np.sqrt(0.8 * 5 / frames))
    assert set(classes) == set(CLASSES)
    # One at a time: each is seen in exactly five frames.
    rare = faulty(false_positives__per_frame="0.05", false_positives__frames="5")
    runs = [
        len(list(run))
        for seen, run in groupby(bool(len(rare(k, truth, true_detections(truth)))) for k in range(900))
        if seen
    ]
    assert len(runs) >= 4
    assert Counter(runs).most_common(1)[0][0] == 5
    assert min(runs) == 5


def test_a_false_positive_lies_on_what_stands_still_and_at_one_point_of_the_world() -> None:
    """The camera moves along the wall: the blob moves the other way, by focal length times way over distance."""
    step_m, moved = 0.03, []
    faults = faulty(false_positives__per_frame="0.7", false_positives__frames="10")
    before: Detections | None = None
    for index in range(300):
        T_world_camera = UPRIGHT.copy()
        T_world_camera[0, 3] += step_m * index
        truth = truth_of(("person", LEFT), T_world_camera=T_world_camera)
        answer = faults(index, truth, true_detections(truth))
        assert answer.class_names[0] == "person"
        assert not answer.masks[1:, truth.instance_ids == 1].any()
        if before is not None and len(answer) == len(before) == 2:
            inside = (answer.boxes_px[1, 0] > 45) & (before.boxes_px[1, 2] < WIDTH - 3)
            if inside and answer.class_names == before.class_names:
                moved.append(answer.boxes_px[1, 0] - before.boxes_px[1, 0])
        before = answer
    assert len(moved) > 20
    assert np.mean(moved) == pytest.approx(-133.85 * step_m / WALL_M, abs=0.15)


def test_false_positives_depend_neither_on_what_was_found_nor_on_frames_before_their_time() -> None:
    spec, seen, truth = FalsePositivesSpec(per_frame=20.0, frames=2), [], truth_of(*THREE)
    past = [Shown(frame_index=index, truth=truth) for index in (5, 6, 7)]
    for found, remembered in ((found_in(truth), past), (found_in(truth).keep([False] * 3), past[1:])):
        answer = false_positives(found, spec, remembered, 0, build_frame(0).intrinsics)
        seen.append(answer.detections.select(range(len(found.names), len(answer.names))))
    assert len(seen[0]) > 5
    assert same(*seen)


# --- lateness, memory, order of calls


@pytest.mark.parametrize("frames", [1, 4, 10])
def test_answers_come_as_late_as_asked_for(frames: int) -> None:
    faults, made = faulty(late__frames=str(frames)), []
    for index in range(25):
        truth = truth_of(("person", (index, 20, index + 30, 80)))
        made.append(true_detections(truth))
        answer = faults(index, truth, made[-1])
        if index < frames:
            assert answer.masks.shape == (0, HEIGHT, WIDTH)
        else:
            assert answer is made[index - frames]


def test_a_late_answer_has_the_faults_of_its_own_frame() -> None:
    truth = truth_of(*THREE)
    late = faulty(missed__probability="0.5", late__frames="3")
    now = faulty(missed__probability="0.5")
    answers = [now(k, truth, true_detections(truth)) for k in range(20)]
    delayed = [late(k, truth, true_detections(truth)) for k in range(20)]
    assert all(same(a, b) for a, b in zip(answers, delayed[3:], strict=False))
    assert len({len(a) for a in answers}) > 1


def test_no_more_than_ten_frames_are_remembered() -> None:
    faults = faulty(late__frames="10", false_positives__per_frame="1", false_positives__frames="10")
    images = []
    for index in range(40):
        truth = truth_of(*THREE)
        exact = true_detections(truth)
        faults(index, truth, exact)
        images.append((weakref.ref(truth.instance_ids), weakref.ref(exact.masks.base)))
    del truth, exact
    gc.collect()
    alive = [sum(ref() is not None for ref in refs) for refs in zip(*images, strict=True)]
    assert alive[0] == 10
    assert alive[1] <= 11


MEMORYLESS = {
    "missed__probability": "0.3",
    "missed_bursts__share": "0.3",
    "split__probability": "0.3",
    "class_flips__probability": "0.3",
    "scores__lowest": "0.5",
    "order__is_shuffled": "true",
    "merged__probability": "0.5",
}


@pytest.mark.parametrize("key", MEMORYLESS)
def test_a_frame_asked_alone_has_the_answer_it_has_in_order(key: str) -> None:
    truth = truth_of(*THREE, ("chair", (95, 45, 119, 60)))
    one, other = faulty(**{key: MEMORYLESS[key]}), faulty(**{key: MEMORYLESS[key]})
    forwards = {k: one(k, truth, true_detections(truth)) for k in range(30)}
    backwards = {k: other(k, truth, true_detections(truth)) for k in reversed(range(30))}
    assert all(same(forwards[k], backwards[k]) for k in forwards)
    assert any(not same(forwards[0], forwards[k]) for k in range(1, 30))


def test_a_decision_does_not_depend_on_the_other_faults() -> None:
    """Who is missed, and which class is given, stays the same whatever else is on."""
    truth = truth_of(*THREE)
    alone = faulty(missed__probability="0.3", class_flips__probability="0.4")
    amid = faulty(
        **{**MEMORYLESS, "missed_bursts__share": "0", "split__probability": "0", "class_flips__probability": "0.4"}
    )
    for index in range(60):
        a, b = (faults(index, truth, true_detections(truth)) for faults in (alone, amid))
        assert sorted(zip(a.boxes_px.tolist(), a.class_names, strict=True)) == sorted(
            zip(b.boxes_px.tolist(), b.class_names, strict=True)
        )


def test_another_seed_makes_other_decisions() -> None:
    truth, spec = truth_of(*THREE), {"faults.missed.probability": "0.5", **SMALL}
    one, other = (Faults(with_overrides(scenario("smoke"), {**spec, "seed": seed})) for seed in ("0", "1"))
    assert any(
        not same(one(k, truth, true_detections(truth)), other(k, truth, true_detections(truth))) for k in range(9)
    )


# --- part of the scenario


def test_faults_are_part_of_the_scenario_and_of_its_json() -> None:
    varied = with_overrides(scenario("smoke"), {"faults.missed.probability": "0.3", "faults.limit.most": "2"})
    assert (varied.faults.missed.probability, varied.faults.limit.most) == (0.3, 2)
    assert scenario_from_json(varied.to_json(), "x") == varied
    assert varied.has_frames_of(scenario("smoke"))
    assert varied.without_faults() == scenario("smoke")
    old = scenario("smoke").model_dump_json(exclude={"faults"})
    assert scenario_from_json(old, "a scenario of before there were faults") == scenario("smoke")


def test_every_fault_is_off_by_default_and_has_a_scenario_in_which_it_acts_alone() -> None:
    assert all(not s.faults.model_dump(exclude_defaults=True) for s in SCENARIOS.values() if "faults" not in s.tags)
    acting = {n: tuple(s.faults.model_dump(exclude_defaults=True)) for n, s in SCENARIOS.items() if "faults" in s.tags}
    assert all(len(names) == 1 for names in acting.values())
    assert {names[0] for names in acting.values()} == set(FaultsSpec.model_fields)


def test_the_fault_scenarios_have_the_frames_of_fr3_walking_xyz_but_for_two() -> None:
    others = {"fault_tilted": "tilted", "fault_merged": "crowd"}
    for name, chosen in SCENARIOS.items():
        if "faults" in chosen.tags:
            base = scenario(others.get(name, "fr3_walking_xyz"))
            assert chosen.has_frames_of(base.model_copy(update={"frames": chosen.frames}))
            assert RENDERED_AS[name] == (name if name in others else "fault_missed")
        else:
            assert RENDERED_AS[name] == name
    frames = [
        build_simulator(with_overrides(scenario(n), SMALL), "numba", 1).frame(100)
        for n in ("fault_split", "fr3_walking_xyz")
    ]
    assert np.array_equal(frames[0].rgb, frames[1].rgb)
    assert np.array_equal(frames[0].depth_m, frames[1].depth_m)


def test_a_run_with_faults_has_the_hash_of_one_without_and_can_be_repeated(tmp_path) -> None:
    settings, base = (
        RunSettings.parse(methods="mdi,dotmask"),
        with_overrides(scenario("smoke"), {**SMALL, "frames": "12"}),
    )
    variants = {
        "none": base,
        "missed": with_overrides(base, {"faults.missed.probability": "0.5"}),
        "shuffled": with_overrides(base, {"faults.order.is_shuffled": "true"}),
    }
    reports = {name: run(s, settings, tmp_path / name, lambda: None) for name, s in variants.items()}
    stored = scenario_from_json((tmp_path / "missed" / "scenario.json").read_text(), "x")
    reports["again"] = run(stored, settings, tmp_path / "again", lambda: None)
    assert len({report.frame_hash for report in reports.values()}) == 1

    def figures(name: str) -> dict:
        return {m: r.model_dump(exclude={"time_ms"}) for m, r in reports[name].methods.items()}

    assert figures("again") == figures("missed")
    assert figures("missed") != figures("none")
    assert figures("shuffled") == figures("none"), "the method depends on the order of the detections"
