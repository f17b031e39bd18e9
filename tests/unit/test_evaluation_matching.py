import numpy as np
import pytest

from dotmask.evaluation.matching import mask_ious, match_detections


def test_ious_are_those_of_a_naive_count() -> None:
    rng = np.random.default_rng(0)
    ids = rng.choice(np.array([0, 3, 4, 9], np.uint16), (20, 30))
    masks = rng.random((3, 20, 30)) < [[[0.1]], [[0.5]], [[0.0]]]
    ious = mask_ious(masks, ids)
    assert ious.shape == (3, 10)
    for row, mask in zip(ious, masks, strict=True):
        for instance in range(1, 10):
            one = ids == instance
            assert row[instance] == pytest.approx((one & mask).sum() / max((one | mask).sum(), 1), abs=1e-15)
    assert not ious[:, 0].any(), "the background is nothing to be found"
    assert mask_ious(masks[:0], ids).shape == (0, 10)


def test_detections_are_matched_by_overlap() -> None:
    ids = np.zeros((20, 30), np.uint16)
    ids[2:10, 2:10], ids[2:10, 15:25] = 7, 9
    good, poor, other, background = np.zeros((4, 20, 30), bool)
    good[2:10, 2:9], poor[2:10, 2:5], other[2:10, 14:25] = True, True, True
    background[12:18] = True
    assert match_detections(mask_ious(np.array([other, poor, good, background]), ids)) == (9, None, 7, None)
    assert match_detections(mask_ious(np.array([good & False]), ids)) == (None,)


def test_the_better_of_two_detections_has_the_instance() -> None:
    assert match_detections(np.array([[0, 0.75, 0.1], [0, 0.8, 0]])) == (None, 1)
    assert match_detections(np.array([[0, 0.75, 0.1], [0, 0.7, 0.2]])) == (1, None)


def test_the_least_overlap_is_a_match_and_less_is_none() -> None:
    assert match_detections(np.array([[0, 0.5], [0, 0.4999]])) == (1, None)
    assert match_detections(np.array([[0, 0.4999]]), min_iou=0.4) == (1,)
