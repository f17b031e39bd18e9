from dataclasses import replace

import numpy as np
import pytest

from dotmask.masking import dilate, mask_depth
from dotmask.profiles import CALIBRATED, PAPER
from dotmask.records import Detections, Reason, Track, Verdict

SHAPE = (60, 80)


def rectangle(u0, v0, u1, v1):
    mask = np.zeros(SHAPE, bool)
    mask[v0 : v1 + 1, u0 : u1 + 1] = True
    return mask


def detect(*masks) -> Detections:
    return Detections(
        masks=np.array(masks, bool).reshape(-1, *SHAPE),
        boxes_px=np.zeros((len(masks), 4)),
        class_names=("person",) * len(masks),
        scores=np.ones(len(masks)),
    )


def coasting(mask, misses, is_moving) -> Track:
    return Track(
        track_id=1,
        class_name="person",
        timestamp_s=0.0,
        mean=np.zeros(6),
        covariance=np.eye(6),
        age_frames=9,
        misses=misses,
        detection_index=None,
        mask=mask,
        mask_timestamp_s=0.0,
        partial_timestamp_s=0.0,
        verdict=Verdict(is_moving=is_moving, reason=Reason.SPEED, speed_m_s=1.0, mask_iou=None),
    )


DEPTH = np.full(SHAPE, 2.0, np.float32)
SHARP = replace(PAPER, dilation_px=0)
LEFT, RIGHT = rectangle(5, 10, 20, 40), rectangle(40, 10, 60, 40)


def test_mo_mdi_loses_the_movers_and_mdi_all() -> None:
    masked = mask_depth(DEPTH, detect(LEFT, RIGHT), [False, True], (), SHARP)
    np.testing.assert_array_equal(masked.mo_mdi_m, np.where(RIGHT, 0, DEPTH))
    np.testing.assert_array_equal(masked.mdi_m, np.where(LEFT | RIGHT, 0, DEPTH))
    assert (DEPTH == 2).all()


def test_a_static_object_survives_whatever_its_place_in_the_list() -> None:
    for order in ([0, 1], [1, 0]):
        masks, moving = [LEFT, RIGHT], [False, True]
        masked = mask_depth(DEPTH, detect(*(masks[i] for i in order)), [moving[i] for i in order], (), SHARP)
        assert (masked.mo_mdi_m[LEFT] == 2).all()
        assert (masked.mo_mdi_m[RIGHT] == 0).all()


@pytest.mark.parametrize("radius", [0, 1, 4, 9])
def test_dilation_is_a_disc_by_its_definition(radius) -> None:
    point = rectangle(40, 30, 40, 30)
    grown = dilate(point, radius)
    v, u = np.mgrid[0:60, 0:80]
    distance = np.hypot(u - 40, v - 30)
    assert grown[distance <= radius - 0.5].all() if radius else grown[30, 40]
    assert not grown[distance > radius + 0.5].any()


def test_dilation_stops_at_the_image_border() -> None:
    grown = dilate(rectangle(0, 0, 3, 3), 4)
    assert grown[0, :8].all()
    assert grown[:8, 0].all()
    assert np.count_nonzero(grown) < 64
    assert not dilate(np.zeros(SHAPE, bool), 4).any()


def test_masks_grow_by_the_profiles_radius() -> None:
    masked = mask_depth(DEPTH, detect(LEFT), [True], (), replace(PAPER, dilation_px=3))
    np.testing.assert_array_equal(masked.mo_mdi_m == 0, dilate(LEFT, 3))


def test_the_last_mask_of_an_unseen_mover_is_cut_out_for_a_while() -> None:
    frames = CALIBRATED.coasting_mask_frames
    profile = replace(CALIBRATED, dilation_px=0)
    just_lost, long_lost, still = (
        coasting(LEFT, frames, True),
        coasting(LEFT, frames + 1, True),
        coasting(LEFT, 1, False),
    )
    assert (mask_depth(DEPTH, detect(), [], [just_lost], profile).mo_mdi_m[LEFT] == 0).all()
    assert (mask_depth(DEPTH, detect(), [], [just_lost], profile).mdi_m[LEFT] == 0).all()
    assert (mask_depth(DEPTH, detect(), [], [long_lost, still], profile).mo_mdi_m == DEPTH).all()
    assert (mask_depth(DEPTH, detect(), [], [just_lost], SHARP).mo_mdi_m == DEPTH).all()


def test_one_decision_per_detection() -> None:
    with pytest.raises(ValueError, match="moving: 1 values for 2 detections"):
        mask_depth(DEPTH, detect(LEFT, RIGHT), [True], (), SHARP)


def test_a_track_that_was_seen_is_masked_by_its_detection_alone() -> None:
    seen = replace(coasting(LEFT, 0, True), detection_index=0)
    masked = mask_depth(DEPTH, detect(RIGHT), [False], [seen], replace(CALIBRATED, dilation_px=0))
    np.testing.assert_array_equal(masked.mo_mdi_m, DEPTH)
