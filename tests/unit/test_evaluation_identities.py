import json
from pathlib import Path

import numpy as np
import pytest

from dotmask.evaluation.identities import FrameIdentities, clear_scores, hota_scores, idf1

STORED = json.loads((Path(__file__).parents[1] / "golden" / "trackeval.json").read_text())


def frame(instances: tuple[int, ...], tracks: dict[int, int | None], similarity: float = 1.0) -> FrameIdentities:
    """`tracks`: for each track id the instance that it follows."""
    fit = [[similarity * (instance == followed) for followed in tracks.values()] for instance in instances]
    shape = (len(instances), len(tracks))
    return FrameIdentities(
        instances=instances, tracks=tuple(tracks), similarity=np.array(fit, np.float64).reshape(shape)
    )


@pytest.mark.parametrize("index", range(len(STORED["cases"])))
def test_figures_agree_with_trackeval(index: int) -> None:
    stored = STORED["cases"][index]
    frames = [
        FrameIdentities(
            instances=tuple(f["instances"]),
            tracks=tuple(f["tracks"]),
            similarity=np.array(f["similarity"], np.float64).reshape(len(f["instances"]), len(f["tracks"])),
        )
        for f in stored["frames"]
    ]
    theirs, clear, hota = stored["trackeval"], clear_scores(frames), hota_scores(frames)
    assert hota is not None
    assert (hota.hota, hota.detection, hota.association) == pytest.approx(
        (theirs["HOTA"], theirs["DetA"], theirs["AssA"]), abs=1e-12
    )
    assert clear.mota == pytest.approx(theirs["MOTA"], abs=1e-12)
    assert idf1(frames) == pytest.approx(theirs["IDF1"], abs=1e-12)
    assert (clear.switches, clear.misses, clear.false_positives) == (
        theirs["IDSW"], theirs["CLR_FN"], theirs["CLR_FP"],
    )  # fmt: skip


def test_perfect_tracking() -> None:
    frames = [frame((1, 2), {10: 1, 11: 2})] * 5
    assert (clear_scores(frames).mota, clear_scores(frames).switches, idf1(frames)) == (1.0, 0, 1.0)
    hota = hota_scores(frames)
    assert hota is not None
    assert (hota.hota, hota.detection, hota.association) == (1.0, 1.0, 1.0)


def test_misses_false_positives_and_switches_by_hand() -> None:
    frames = [
        frame((1, 2), {10: 1, 11: 2}),
        frame((1, 2), {10: 1}),  # one miss
        frame((1, 2), {10: 1, 12: 2, 13: None}),  # a switch, a false positive
        frame((1, 2), {10: 1, 14: 1, 12: 2}),  # a second track on instance 1
    ]
    scores = clear_scores(frames)
    assert (scores.misses, scores.false_positives, scores.switches) == (1, 2, 1)
    assert scores.mota == pytest.approx(1 - 4 / 8)
    assert idf1(frames) == pytest.approx(2 * (4 + 2) / (8 + 9))  # naming 10 = 1, 12 = 2


def test_a_track_that_follows_something_unasked_is_a_false_positive() -> None:
    assert clear_scores([frame((1,), {10: 1, 11: 5})]).false_positives == 1


def test_a_pair_stays_together_though_another_track_fits_better() -> None:
    better = FrameIdentities(instances=(1,), tracks=(10, 11), similarity=np.array([[0.6, 0.9]]))
    assert clear_scores([frame((1,), {10: 1}), better]).switches == 0
    assert clear_scores([frame((1,), {12: 1}), better]).switches == 1


def test_hota_of_a_life_cut_in_two_by_hand() -> None:
    # One instance of 8 frames; track 10 has the first 6 of them, track 11 the last 2. Every frame is found (DetA 1);
    # the association of a frame is its track's share of the life: (6 * 6/8 + 2 * 2/8) / 8 = 5/8.
    frames = [frame((1,), {10: 1})] * 6 + [frame((1,), {11: 1})] * 2
    scores = hota_scores(frames)
    assert scores is not None
    assert scores.detection == 1.0
    assert scores.association == pytest.approx(5 / 8)
    assert scores.hota == pytest.approx(np.sqrt(5 / 8))


def test_hota_counts_the_thresholds_that_a_loose_mask_passes() -> None:
    # IoU 0.5 passes 0.05, 0.10, ..., 0.50: 10 of 19.
    scores = hota_scores([frame((1,), {10: 1}, similarity=0.5)] * 4)
    assert scores is not None
    assert (scores.hota, scores.detection, scores.association) == pytest.approx((10 / 19,) * 3)


def test_hota_of_misses_and_false_positives_by_hand() -> None:
    # 4 frames, 2 instances; instance 2 is never found, a stray track is there twice: 4 / (4 + 4 + 2).
    frames = [frame((1, 2), {10: 1})] * 2 + [frame((1, 2), {10: 1, 11: None})] * 2
    scores = hota_scores(frames)
    assert scores is not None
    assert scores.detection == pytest.approx(0.4)
    assert scores.association == 1.0


def test_nothing_to_track_is_none_and_nothing_tracked_is_zero() -> None:
    for frames in ([], [frame((), {10: None})]):
        assert clear_scores(frames).mota is idf1(frames) is hota_scores(frames) is None
    lost = [frame((1, 2), {})] * 3
    scores = hota_scores(lost)
    assert scores is not None
    assert (clear_scores(lost).mota, idf1(lost), scores.hota, scores.association) == (0.0, 0.0, 0.0, 0.0)


def test_an_id_twice_in_a_frame_is_refused() -> None:
    with pytest.raises(ValueError, match="tracks: an id comes twice"):
        FrameIdentities(instances=(1,), tracks=(2, 2), similarity=np.ones((1, 2)))
    with pytest.raises(ValueError, match="similarity: expected shape"):
        FrameIdentities(instances=(1,), tracks=(2,), similarity=np.ones((1, 2)))
