import numpy as np
import pytest

from dotmask.evaluation.tracking import (
    FrameIdentities,
    chi_square_mean_bounds,
    filter_errors,
    identity_scores,
    match_detections,
)


def test_detections_are_matched_by_overlap() -> None:
    ids = np.zeros((20, 30), np.uint16)
    ids[2:10, 2:10], ids[2:10, 15:25] = 7, 9
    good, poor, other = np.zeros((3, 20, 30), bool)
    good[2:10, 2:9], poor[2:10, 2:5], other[2:10, 14:25] = True, True, True
    background = np.zeros((20, 30), bool)
    background[12:18] = True
    assert match_detections(np.array([other, poor, good, background]), ids) == (9, None, 7, None)
    assert match_detections(np.array([good & False]), ids) == (None,)


def test_the_better_of_two_detections_has_the_instance() -> None:
    ids = np.zeros((20, 30), np.uint16)
    ids[2:10, 2:10] = 7
    good, better = np.zeros((2, 20, 30), bool)
    good[2:10, 2:8], better[2:10, 2:9] = True, True
    assert match_detections(np.array([good, better]), ids) == (None, 7)


def test_chi_square_bounds_hold_95_percent_of_the_means() -> None:
    low, high = chi_square_mean_bounds(3, 50)
    means = np.random.default_rng(0).chisquare(3, (4000, 50)).mean(axis=1)
    assert np.mean((means > low) & (means < high)) == pytest.approx(0.95, abs=0.012)


def test_errors_of_a_consistent_filter() -> None:
    rng = np.random.default_rng(1)
    count = 3000
    root = rng.normal(size=(6, 6))
    P = 0.01 * root @ root.T + 1e-4 * np.eye(6)
    errors = rng.multivariate_normal(np.zeros(6), P, count)
    truth = rng.normal(size=(count, 6))
    ideals = truth[:, :3] + [0.1, 0, 0]
    ideals[:10] = np.nan
    nis = rng.chisquare(3, count)
    nis[0] = np.nan
    result = filter_errors(truth + errors, np.tile(P, (count, 1, 1)), truth[:, :3], truth[:, 3:], ideals, nis)
    assert result.samples == count
    assert result.position_rmse_m == pytest.approx(np.sqrt(np.trace(P[:3, :3])), rel=0.05)
    assert result.velocity_rmse_m_s == pytest.approx(np.sqrt(np.trace(P[3:, 3:])), rel=0.05)
    assert result.position_rmse_ideal_m == pytest.approx(np.sqrt(np.trace(P[:3, :3]) + 0.01), rel=0.05)
    assert result.nees is not None
    assert result.nees_bounds is not None
    assert result.nees_bounds[0] < result.nees < result.nees_bounds[1]
    assert result.nis is not None
    assert result.nis_bounds is not None
    assert result.nis_bounds[0] < result.nis < result.nis_bounds[1]


def test_bias_is_signed_and_the_ideal_leaves_it_out() -> None:
    truth = np.zeros((5, 6))
    means = truth + np.array([0.1, -0.2, 0, 0, 0, 0.3])
    result = filter_errors(means, np.tile(np.eye(6), (5, 1, 1)), truth[:, :3], truth[:, 3:], means[:, :3], np.ones(5))
    assert result.position_bias_m == pytest.approx((0.1, -0.2, 0))
    assert result.velocity_bias_m_s == pytest.approx((0, 0, 0.3))
    assert result.position_rmse_ideal_m == 0
    assert result.nees == pytest.approx(0.14)
    assert result.nees_ideal == 0


def test_no_samples_give_none_and_not_zero() -> None:
    empty = np.zeros((0, 3))
    result = filter_errors(np.zeros((0, 6)), np.zeros((0, 6, 6)), empty, empty, empty, np.zeros(0))
    assert result.samples == 0
    assert result.position_rmse_m is result.nees is result.nis is result.nees_bounds is result.position_bias_m is None
    assert identity_scores([]).mota is None


def test_perfect_tracking() -> None:
    frames = [FrameIdentities(instances=(1, 2), tracks=((10, 1), (11, 2)))] * 5
    scores = identity_scores(frames)
    assert (scores.mota, scores.idf1, scores.switches) == (1.0, 1.0, 0)


def test_misses_false_positives_and_switches_by_hand() -> None:
    frames = [
        FrameIdentities(instances=(1, 2), tracks=((10, 1), (11, 2))),
        FrameIdentities(instances=(1, 2), tracks=((10, 1),)),  # one miss
        FrameIdentities(instances=(1, 2), tracks=((10, 1), (12, 2), (13, None))),  # a switch, a false positive
        FrameIdentities(instances=(1, 2), tracks=((10, 1), (14, 1), (12, 2))),  # a second track on instance 1
    ]
    scores = identity_scores(frames)
    assert (scores.misses, scores.false_positives, scores.switches) == (1, 2, 1)
    assert scores.mota == pytest.approx(1 - 4 / 8)
    assert scores.idf1 == pytest.approx(2 * (4 + 2) / (8 + 9))  # naming 10 = 1, 12 = 2


def test_a_track_that_follows_something_unasked_is_a_false_positive() -> None:
    scores = identity_scores([FrameIdentities(instances=(1,), tracks=((10, 1), (11, 5)))])
    assert scores.false_positives == 1
