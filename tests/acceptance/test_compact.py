"""The network that comes trained, in the closed loop, on people, chairs and a room that its training did not have."""

from pathlib import Path

import pytest

from scenarios.registry import scenario
from scenarios.run import RunSettings, run
from scenarios.spec import with_overrides

pytestmark = pytest.mark.acceptance


def test_with_compact_odometry_is_about_as_good_as_with_the_oracle(tmp_path: Path) -> None:
    walking = with_overrides(scenario("fr3_walking_xyz"), {"frames": "300"})
    settings = RunSettings.parse(methods="unmasked,dotmask-oracle,dotmask", segmenter="compact")
    methods = run(walking, settings, tmp_path / "run", lambda: None).methods
    unmasked, oracle, network = (methods[name] for name in ("unmasked", "dotmask-oracle", "dotmask"))
    assert network.ate_rmse_m <= 1.5 * oracle.ate_rmse_m + 0.003
    assert network.ate_rmse_m < unmasked.ate_rmse_m / 5
    assert network.masks.iou > 0.75
    assert network.masks.leak < 0.05
