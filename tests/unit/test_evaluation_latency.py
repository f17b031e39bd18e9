import pytest

from dotmask.evaluation.classification import ClassificationRecord
from dotmask.evaluation.latency import LatencyScores, latency_scores

REST, MOTION = "-" * 12, "M" * 12


def history(truth: str, flags: str, instance_id: int = 1) -> list[ClassificationRecord]:
    """One letter per frame: M moving, B moving in place (breathing), F flagged, '-' neither, ' ' no record."""
    return [
        ClassificationRecord(
            frame=k,
            instance_id=instance_id,
            class_name="person",
            is_moving=moving in "MB",
            true_speed_m_s={"M": 1.0, "B": 0.03, "-": 0.0}[moving],
            is_flagged=flag == "F",
            speed_m_s=None,
        )
        for k, (moving, flag) in enumerate(zip(truth, flags, strict=True))
        if moving != " "
    ]


def test_latencies_count_from_the_change_of_the_truth() -> None:
    scores = latency_scores(history(REST + MOTION + REST, "-" * 15 + "F" * 13 + "-" * 8))
    assert scores == LatencyScores(
        flag_median_frames=3,
        unflag_median_frames=(0 + 4) / 2,  # the rest at the beginning is answered at once
        unanswered=0,
        starts=1,
        missed_starts=0,
        start_median_frames=3,
        start_max_frames=3,
    )


def test_an_object_that_appears_in_motion_is_no_start() -> None:
    scores = latency_scores(history(MOTION, "-" + "F" * 11) + history(MOTION, "-" * 12, instance_id=2))
    assert (scores.flag_median_frames, scores.unflag_median_frames, scores.unanswered) == (1, None, 1)
    assert (scores.starts, scores.start_median_frames, scores.start_max_frames) == (0, None, None)


def test_a_moment_of_rest_before_the_motion_makes_no_start() -> None:
    scores = latency_scores(history("---" + MOTION, "-" * 5 + "F" * 10))
    assert (scores.starts, scores.flag_median_frames) == (0, 2)


def test_the_longest_start_and_the_missed_one_are_seen() -> None:
    records = [
        r
        for k, wait in enumerate((1, 2, 9))
        for r in history(REST + MOTION, "-" * (12 + wait) + "F" * (12 - wait), instance_id=k)
    ] + history(REST + MOTION, "-" * 24, instance_id=8)
    scores = latency_scores(records)
    assert (scores.starts, scores.missed_starts) == (4, 1)
    assert (scores.start_median_frames, scores.start_max_frames) == (2, 9)


def test_an_object_that_is_flagged_while_it_rests_is_no_start_but_answered_at_once() -> None:
    scores = latency_scores(history(REST + MOTION, "--" + "F" * 22))
    assert (scores.starts, scores.flag_median_frames) == (0, 0)


def test_what_is_flagged_shortly_before_it_sets_off_has_no_latency() -> None:
    scores = latency_scores(history(REST + MOTION, "---" + "F" * 21))
    assert (scores.starts, scores.start_max_frames) == (1, 0)
    fallen_back = latency_scores(history(REST + MOTION, "---" + "F" * 6 + "-" * 5 + "F" * 10))
    assert (fallen_back.starts, fallen_back.start_max_frames) == (1, 2)


def test_a_start_counts_from_where_the_centre_sets_off() -> None:
    scores = latency_scores(history(REST + "B" * 30 + MOTION, "-" * 44 + "F" * 10))
    assert (scores.flag_median_frames, scores.starts, scores.start_max_frames) == (32, 1, 2)
    in_place = latency_scores(history(REST + "B" * 30 + REST, "-" * 54))
    assert (in_place.starts, in_place.unanswered) == (0, 1)


def test_a_start_that_is_flagged_after_the_motion_is_missed() -> None:
    scores = latency_scores(history(REST + MOTION + REST, "-" * 24 + "F" * 12))
    assert (scores.starts, scores.missed_starts) == (1, 1)


def test_an_object_that_returns_in_motion_is_no_start() -> None:
    scores = latency_scores(history(REST + "     " + MOTION, "-" * 19 + "F" * 10))
    assert (scores.starts, scores.flag_median_frames) == (0, 2)


@pytest.mark.parametrize(
    ("flicker", "begins"), [("M", 0), ("M" * 9, 0), ("M" * 10, 1)], ids=["1 frame", "9 frames", "10 frames"]
)
def test_a_motion_lasts_ten_frames(flicker: str, begins: int) -> None:
    truth = REST + flicker + REST
    scores = latency_scores(history(truth, "-" * len(truth)))
    assert scores.starts == begins
    assert scores.unflag_median_frames == 0
    assert scores.unanswered == begins


def test_flicker_neither_ends_a_motion_nor_delays_what_counts() -> None:
    # A motion with one frame of rest in it: no rest is waited for, and no second motion begins.
    scores = latency_scores(history(MOTION + "-" + MOTION, "-" * 14 + "F" * 11))
    assert (scores.flag_median_frames, scores.unflag_median_frames, scores.unanswered) == (14, None, 0)


def test_a_gap_does_not_end_a_motion() -> None:
    scores = latency_scores(history("MMMMM   MMMMM", "-----   ---FF"))
    assert (scores.flag_median_frames, scores.unanswered) == (11, 0)


def test_an_object_that_is_seen_for_a_moment_begins_nothing() -> None:
    scores = latency_scores(history("M" * 9, "-" * 9) + history(MOTION, "F" * 12, instance_id=2))
    assert (scores.flag_median_frames, scores.unanswered) == (0, 0)


def test_order_of_the_records_does_not_matter() -> None:
    records = history(REST + MOTION, "-" * 15 + "F" * 9) + history(MOTION, "--" + "F" * 10, instance_id=2)
    assert latency_scores(records) == latency_scores(records[::-1])


def test_nothing_measured_is_none() -> None:
    scores = latency_scores([])
    assert scores.flag_median_frames is scores.unflag_median_frames is scores.start_max_frames is None
    assert (scores.unanswered, scores.starts, scores.missed_starts) == (0, 0, 0)
