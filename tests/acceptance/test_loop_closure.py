"""A camera goes around two desk islands and sees its beginning again: the loops are found, right, and close the map."""

from pathlib import Path

import pytest

from scenarios.registry import scenario
from scenarios.run import RunSettings, run
from scenarios.spec import Scenario
from scenarios.spec.scenario import with_overrides

pytestmark = pytest.mark.acceptance


def clean(**overrides: str) -> Scenario:
    given = {key.replace("__", "."): value for key, value in overrides.items()}
    return with_overrides(scenario("fr3_long_office_household"), {"sensor.model": "ideal", **given})


def test_a_quick_round_at_a_quarter_of_the_pixels(tmp_path: Path) -> None:
    quick = clean(
        frames="660",
        camera__speed="4",
        camera__width="320",
        camera__height="240",
        camera__fx="267.7",
        camera__fy="269.6",
        camera__cx="159.8",
        camera__cy="123.55",
    )
    report = run(quick, RunSettings.parse(methods="unmasked"), tmp_path / "quick", lambda: None).methods["unmasked"]
    assert report.loops.count >= 1
    assert report.loops.false_count == 0
    assert report.loops.trans_error_m < 0.003
    assert report.ate_optimised_rmse_m < 0.6 * report.ate_rmse_m


@pytest.mark.slow
def test_the_whole_round(tmp_path: Path) -> None:
    report = run(clean(), RunSettings.parse(methods="unmasked"), tmp_path / "whole", lambda: None).methods["unmasked"]
    assert report.loops.count >= 5
    assert report.loops.false_count == 0
    assert report.loops.trans_error_m < 0.005
    assert report.ate_optimised_rmse_m < 0.004
