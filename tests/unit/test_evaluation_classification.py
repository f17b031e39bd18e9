import numpy as np
import pytest
from scipy.stats import mannwhitneyu

from dotmask.evaluation.classification import ClassificationRecord, Confusion, confusion, roc


def record(is_moving: bool, is_flagged: bool) -> ClassificationRecord:
    return ClassificationRecord(
        frame=0,
        instance_id=1,
        class_name="person",
        is_moving=is_moving,
        true_speed_m_s=0.0,
        is_flagged=is_flagged,
        speed_m_s=0.0,
    )


def test_confusion_by_hand() -> None:
    counts = confusion(
        [record(True, True)] * 4 + [record(False, True)] + [record(True, False)] * 2 + [record(False, False)] * 3
    )
    assert counts == Confusion(true_positive=4, false_positive=1, false_negative=2, true_negative=3)
    assert counts.precision == pytest.approx(4 / 5)
    assert counts.recall == pytest.approx(4 / 6)
    assert counts.idle_flag_rate == pytest.approx(1 / 4)


def test_nothing_measured_is_none() -> None:
    nothing = confusion([])
    assert nothing.precision is nothing.recall is nothing.idle_flag_rate is None
    still = confusion([record(False, False)])
    assert (still.precision, still.recall, still.idle_flag_rate) == (None, None, 0.0)


def test_roc_by_hand() -> None:
    curve = roc(np.array([0.1, 0.4, 0.4, 0.8]), np.array([False, True, False, True]))
    assert curve is not None
    assert curve.thresholds == pytest.approx([np.inf, 0.8, 0.4, 0.1])
    assert curve.true_positive_rate == pytest.approx([0, 0.5, 1, 1])
    assert curve.false_positive_rate == pytest.approx([0, 0, 0.5, 1])
    assert curve.auc == pytest.approx(3.5 / 4)  # of four pairs three in the right order, one tie


@pytest.mark.parametrize("seed", range(3))
def test_area_is_the_rank_statistic_and_rates_are_counts(seed: int) -> None:
    rng = np.random.default_rng(seed)
    is_moving = rng.random(200) < 0.3
    scores = np.round(rng.gamma(1 + is_moving, 0.2), 2)  # with ties
    curve = roc(scores, is_moving)
    assert curve is not None
    pairs = is_moving.sum() * (~is_moving).sum()
    assert curve.auc == pytest.approx(mannwhitneyu(scores[is_moving], scores[~is_moving]).statistic / pairs)
    for threshold, hit, false in zip(
        curve.thresholds, curve.true_positive_rate, curve.false_positive_rate, strict=True
    ):
        called = scores >= threshold
        assert hit == pytest.approx((called & is_moving).sum() / is_moving.sum())
        assert false == pytest.approx((called & ~is_moving).sum() / (~is_moving).sum())


def test_perfect_and_useless_scores() -> None:
    is_moving = np.array([True, False, True, False])
    perfect, useless = roc(is_moving.astype(float), is_moving), roc(np.zeros(4), is_moving)
    assert perfect is not None
    assert useless is not None
    assert (perfect.auc, useless.auc) == (1.0, 0.5)
    assert roc(np.zeros(2), np.array([True, True])) is None
