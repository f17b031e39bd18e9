"""The masks in simulated scenes: each seed is a room of another look, with two people who walk through it."""

import pytest

from toy_front_end.masks import people


@pytest.mark.dotmask("smoke", seeds=8, frames=30)
def test_people_are_hidden_from_odometry(dotmask_run, dotmask_scenario):
    report = dotmask_run(mask=people)
    assert report.tracked_frames == dotmask_scenario.frames
    assert report.masks.waste < 0.2
