"""The regression of Koopman et al. 2014 against what is known about normal gait, and against its own key events."""

import numpy as np
import pytest

from sim.people.reference_gait import joint_angles, step_ratio

PERCENT = np.arange(0.0, 100.0, 0.1)


def test_the_curves_have_the_values_and_slopes_of_the_key_events():
    """The greatest flexion of the knee in swing (table 3, fifth event), by hand at 3.6 km/h and 1.8 m."""
    at = 85.816 - 4.480 * 3.6 + 0.519 * 3.6**2
    peak = 38.110 + 9.744 * 3.6 - 1.105 * 3.6**2
    before, there, after = joint_angles(1.0, 1.8, np.array([at - 0.01, at, at + 0.01]))[1]
    assert there == pytest.approx(peak, abs=1e-9)
    assert (after - before) / 0.02 == pytest.approx(0.0, abs=1e-6)
    curvature = (after - 2 * there + before) / 0.01**2
    assert curvature == pytest.approx(-0.784 + 0.225 * 3.6 - 0.026 * 3.6**2, abs=1e-3)


@pytest.mark.parametrize("speed", [0.4, 0.8, 1.25])
def test_the_curves_are_smooth_and_periodic(speed):
    curves = joint_angles(speed, 1.75, PERCENT)
    np.testing.assert_allclose(joint_angles(speed, 1.75, PERCENT + 100.0), curves, atol=1e-9)
    slope = np.diff(np.concatenate([curves, curves[:, :2]], axis=1), axis=1) / 0.1
    assert np.abs(slope).max() < 6.0  # degrees per percent
    assert np.abs(np.diff(slope, axis=1)).max() < 0.15


def test_at_a_comfortable_speed_they_look_like_normal_gait():
    """Perry and Burnfield 2010: knee 60 deg in swing and 20 deg in loading, hip 30 to -10, ankle 10 to -20, +-10."""
    hip, knee, ankle = joint_angles(1.25, 1.75, PERCENT)
    assert knee.max() == pytest.approx(60, abs=10)
    assert knee[PERCENT < 30].max() == pytest.approx(20, abs=6)
    assert (hip.max(), hip.min()) == (pytest.approx(30, abs=10), pytest.approx(-10, abs=10))
    assert (ankle.max(), ankle.min()) == (pytest.approx(10, abs=10), pytest.approx(-20, abs=10))
    assert PERCENT[np.argmax(knee)] == pytest.approx(73, abs=5)


def test_faster_walkers_take_longer_steps_and_move_more():
    assert step_ratio(np.array(1.2), 1.75) > step_ratio(np.array(0.6), 1.75)
    assert step_ratio(np.array(1.0), 1.9) > step_ratio(np.array(1.0), 1.6)
    slow, fast = joint_angles(0.6, 1.75, PERCENT), joint_angles(1.3, 1.75, PERCENT)
    assert (np.ptp(fast, axis=1) > np.ptp(slow, axis=1)).all()
