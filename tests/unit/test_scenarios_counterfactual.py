from pathlib import Path

import pytest

from scenarios.counterfactual import compare, run_triplet
from scenarios.errors import ScenarioError
from scenarios.registry import scenario
from scenarios.run import RunSettings

ATE = {
    "empty": {"unmasked": 0.001, "mdi": 0.002, "dotmask": 0.004},
    "frozen": {"unmasked": 0.008, "mdi": 0.016, "dotmask": 0.032},
    "moving": {"unmasked": 0.064, "mdi": 0.128, "dotmask": 0.256},
}


def test_each_cost_is_the_difference_that_it_says() -> None:
    costs = compare(ATE)
    in_mm = {name: round(1e3 * value) for name, value in costs.model_dump().items()}
    assert in_mm == {
        "people_m": 8 - 1,
        "motion_m": 64 - 8,
        "not_masking_m": 64 - 1,
        "masking_all_m": 16 - 8,
        "method_frozen_m": 32 - 8,
        "method_empty_m": 4 - 1,
        "method_moving_m": 256 - 1,
    }
    assert costs.people_m + costs.motion_m == pytest.approx(costs.not_masking_m)


def test_without_an_error_there_is_no_cost() -> None:
    costs = compare({**ATE, "frozen": {"unmasked": None, "mdi": 0.1, "dotmask": 0.1}})
    assert costs.people_m is costs.motion_m is costs.masking_all_m is costs.method_frozen_m is None
    assert costs.not_masking_m == pytest.approx(0.063)


def test_a_scenario_that_is_a_counterfactual_already_is_refused(tmp_path: Path) -> None:
    frozen = scenario("smoke").model_copy(update={"variant": "frozen"})
    with pytest.raises(ScenarioError, match="leave variant=frozen out"):
        run_triplet(frozen, RunSettings.parse(), tmp_path / "out", lambda: None)
    assert list(tmp_path.iterdir()) == []
