import pytest

from dotmask.evaluation.classification import ClassificationRecord, classification_scores


def history(truth: str, flags: str, instance_id=1, start=0):
    """One letter per frame: M moving, F flagged, '-' neither, ' ' no record."""
    return [
        ClassificationRecord(
            frame=start + k, instance_id=instance_id, is_moving=truth[k] == "M", is_flagged=flags[k] == "F"
        )
        for k in range(len(truth))
        if truth[k] != " "
    ]


def test_precision_and_recall_by_hand() -> None:
    scores = classification_scores(history("MMMM----", "FFF-F---"))
    assert scores.precision == pytest.approx(3 / 4)
    assert scores.recall == pytest.approx(3 / 4)


def test_latencies_count_from_the_change_of_the_truth() -> None:
    scores = classification_scores(history("---MMMMMMM-----", "------FFFFFFFF-"))
    assert scores.flag_latency_frames == 3
    assert scores.unflag_latency_frames == pytest.approx((0 + 4) / 2)  # the rest at the start is answered at once
    assert scores.unanswered == 0


def test_an_object_that_appears_in_motion_counts_as_a_start() -> None:
    records = history("MMM", "-FF", instance_id=1) + history("MMM", "---", instance_id=2)
    scores = classification_scores(records)
    assert (scores.flag_latency_frames, scores.unflag_latency_frames, scores.unanswered) == (1, None, 1)


def test_a_gap_does_not_end_a_motion() -> None:
    assert classification_scores(history("MM   MM", "--   FF")).flag_latency_frames == 5


def test_order_of_the_records_does_not_matter() -> None:
    records = history("--MMM--", "---FFF-") + history("MMMM", "--FF", instance_id=2)
    assert classification_scores(records) == classification_scores(records[::-1])


def test_nothing_measured_is_none() -> None:
    scores = classification_scores([])
    assert (scores.precision, scores.recall, scores.flag_latency_frames) == (None, None, None)
    still = classification_scores(history("---", "---"))
    assert (still.precision, still.recall, still.unflag_latency_frames) == (None, None, 0)
