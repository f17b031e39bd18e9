"""The masks in simulated scenes: each seed is a room of another look, with the same people."""

import pytest

from toy_front_end.masks import people

pytestmark = pytest.mark.dotmask("smoke", seeds=6, frames=30)


def test_people_are_hidden_from_odometry(dotmask_run):
    report = dotmask_run(mask=people)
    assert report.masks.leak < 0.3
    assert report.ate_rmse_m < 0.05
