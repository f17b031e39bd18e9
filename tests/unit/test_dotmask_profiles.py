from dataclasses import replace

import pytest

from dotmask.errors import ProfileError
from dotmask.profiles import CALIBRATED, PAPER, PROFILES, MaskGrowth, profile


def test_paper_profile_holds_table_one() -> None:
    person, chair = PAPER.class_model("person"), PAPER.class_model("chair")
    assert PAPER.max_misses == 10
    assert PAPER.score_threshold == 0.1
    assert PAPER.max_observations == 5
    assert person.speed_threshold_m_s == 0.01
    assert chair.speed_threshold_m_s == 0.1
    assert person.acceleration_sigma_m_s2 == 0.62
    assert chair.acceleration_sigma_m_s2 == 1.0


@pytest.mark.parametrize("each", PROFILES, ids=lambda p: p.name)
def test_every_profile_knows_the_papers_objects_of_interest(each) -> None:
    assert [model.name for model in each.classes] == ["person", "chair", "cup", "bottle"]
    assert [model.name for model in each.classes if model.is_non_rigid] == ["person"]
    assert profile(each.name) is each


def test_unknown_profile_names_the_nearest() -> None:
    with pytest.raises(ProfileError, match="did you mean 'calibrated'"):
        profile("calibrate")
    with pytest.raises(ProfileError, match="choose one of paper, calibrated"):
        profile("zzz")


def test_unknown_class_is_refused() -> None:
    with pytest.raises(ValueError, match="'dog' is not an object of interest of profile paper"):
        PAPER.class_model("dog")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"max_misses": 0}, "max_misses must be at least 1"),
        ({"gate_probability": 1.0}, "probabilities"),
        ({"confirming_hits": 0}, "confirming_hits must be at least 1"),
        ({"proof_frames": 0}, "proof_frames must be at least 1"),
        ({"calm_frames": 0}, "calm_frames must be at least 1"),
        ({"coasting_mask_frames": -1}, "not be negative"),
    ],
)
def test_values_out_of_range_are_refused(change, message) -> None:
    with pytest.raises(ValueError, match=message):
        replace(CALIBRATED, **change)


def test_class_model_refuses_a_zero_sigma() -> None:
    with pytest.raises(ValueError, match="sigmas must be positive"):
        replace(PAPER.classes[0], acceleration_sigma_m_s2=0.0)


@pytest.mark.parametrize("name", ["base_px", "margin_m", "depth_delay_s"])
def test_masks_do_not_shrink(name) -> None:
    with pytest.raises(ValueError, match="must not be negative"):
        MaskGrowth(**{"base_px": 1.0, name: -0.1})


def test_the_papers_profile_leaves_out_what_is_not_in_the_paper() -> None:
    assert PAPER.surface is None
    assert (PAPER.reappearance_m, PAPER.least_mask_likelihood, PAPER.coasting_mask_frames) == (0.0, 1.0, 0)
    assert (PAPER.aligns_masks, PAPER.speed_confidence) == (False, 0.0)
    assert (PAPER.proof_frames, PAPER.calm_frames) == (1, 1)
    assert all(m.slide_sigma_m == 0 and m.shape_sigma_m == (0, 0, 0) for m in PAPER.classes)


def test_to_become_moving_asks_for_no_less_of_a_surface_than_to_stay_so() -> None:
    for model in CALIBRATED.classes:
        assert 0 < model.still_moving_share < model.moving_share < 1
    assert all(model.moving_points == (2 if model.is_non_rigid else 1) for model in CALIBRATED.classes)


def test_tracks_wait_for_three_and_five_seconds_at_30_hz() -> None:
    assert (CALIBRATED.max_misses, CALIBRATED.max_misses_idle) == (90, 150)
    assert PAPER.max_misses == PAPER.max_misses_idle
