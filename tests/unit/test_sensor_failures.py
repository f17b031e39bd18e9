"""Failures of the sensor: which frames they act on, and what is left of the others."""

import numpy as np
import pytest

from scenarios.errors import ScenarioError
from scenarios.registry import scenario
from scenarios.spec import with_overrides
from scenarios.world import build_simulator
from sim.sensor.failures import SensorFailure, delivered, failed

RGB, DEPTH = np.full((2, 3, 3), 7, np.uint8), np.full((2, 3), 1.5, np.float32)


def test_missing_frames_are_not_delivered() -> None:
    failures = (SensorFailure(kind="missing", first=3, frames=2), SensorFailure(kind="black", first=1, frames=1))
    assert delivered(np.array([0, 1, 3, 4, 5]), failures).tolist() == [0, 1, 5]


@pytest.mark.parametrize(("kind", "grey", "depth_m"), [("black", 0, 1.5), ("no_depth", 7, 0.0)])
def test_images_fail_within_the_range_alone(kind: str, grey: int, depth_m: float) -> None:
    failures = (SensorFailure(kind=kind, first=4, frames=2),)
    for captured in (3, 6):
        rgb, depth = failed(RGB, DEPTH, captured, failures)
        assert rgb is RGB
        assert depth is DEPTH
    for captured in (4, 5):
        rgb, depth = failed(RGB, DEPTH, captured, failures)
        assert (rgb == grey).all()
        assert (depth == np.float32(depth_m)).all()


def test_failures_of_one_moment_add_up() -> None:
    failures = tuple(SensorFailure(kind=kind, first=1, frames=9) for kind in ("black", "no_depth"))
    rgb, depth = failed(RGB, DEPTH, 2, failures)
    assert not rgb.any()
    assert not depth.any()


def test_the_other_frames_keep_their_bytes() -> None:
    plain = with_overrides(scenario("smoke"), {"frames": "8"})
    failures = '[{"kind": "missing", "first": 2, "frames": 3}, {"kind": "black", "first": 6}]'
    whole, failing = (
        build_simulator(s, "numba", 1) for s in (plain, with_overrides(plain, {"sensor.failures": failures}))
    )
    assert len(failing) == 5
    for index, captured in enumerate((0, 1, 5, 6, 7)):
        seen, reference = failing.frame(index), whole.frame(captured)
        assert seen.timestamp_s == reference.timestamp_s
        np.testing.assert_array_equal(seen.depth_m, reference.depth_m)
        assert (not seen.rgb.any()) == (captured == 6)
        if captured != 6:
            np.testing.assert_array_equal(seen.rgb, reference.rgb)


def test_the_first_frame_cannot_fail() -> None:
    with pytest.raises(ValueError, match="first frame"):
        SensorFailure(kind="black", first=0, frames=1)
    with pytest.raises(ScenarioError, match=r"sensor\.failures\.0\.first"):
        with_overrides(scenario("smoke"), {"sensor.failures": '[{"kind": "black", "first": 0}]'})
