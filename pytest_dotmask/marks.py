"""From `@pytest.mark.dotmask(...)` to scenarios with seeds, and the names of tests that are run on them."""

import inspect
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import pytest

from scenarios.errors import ScenarioError
from scenarios.registry import chosen_scenario
from scenarios.spec import Scenario


def chosen(mark: pytest.Mark) -> list[Scenario]:
    """Every scenario of a marker with each of its seeds, in order.

    Raises:
        pytest.UsageError: an argument is not possible, in one line.
    """
    try:
        inspect.signature(_seeded).bind(*mark.args, **mark.kwargs)
    except TypeError as error:
        raise pytest.UsageError(f"@pytest.mark.dotmask: {error}") from error
    try:
        return _seeded(*mark.args, **mark.kwargs)
    except ScenarioError as error:
        raise pytest.UsageError(f"@pytest.mark.dotmask: {error}") from error


def _seeded(
    *scenarios: str | Scenario,
    seeds: int | Sequence[int] = 1,
    frames: int | None = None,
    overrides: Mapping[str, Any] | None = None,
) -> list[Scenario]:
    if not scenarios:
        raise ScenarioError('name a scenario, for example @pytest.mark.dotmask("smoke", seeds=8)')
    changes = {**(overrides or {}), **({} if frames is None else {"frames": frames})}
    if "seed" in changes:
        raise ScenarioError("overrides: the seed is set by seeds=")
    found = []
    for asked in scenarios:
        if not isinstance(asked, str | Scenario):
            raise ScenarioError(f"expected names of scenarios or Scenario objects, got {asked!r}")
        scenario = chosen_scenario(asked, changes)
        found += [_same(chosen_scenario(scenario, {"seed": seed})) for seed in _numbers(seeds, scenario.seed)]
    names = [seed_id(scenario) for scenario in found]
    for name in names:
        if names.count(name) > 1:
            raise ScenarioError(f"{name} is there twice; scenarios that differ need names that do")
    return found


def _numbers(seeds: Any, first: int) -> Sequence[int]:
    """The seeds: so many from the scenario's own on, or those given."""
    if isinstance(seeds, int) and not isinstance(seeds, bool) and seeds >= 1:
        return range(first, first + seeds)
    if isinstance(seeds, Sequence) and seeds and all(type(seed) is int for seed in seeds):
        return seeds
    raise ScenarioError(f"seeds: expected a number of seeds, 1 or more, or a list of them; got {seeds!r}")


@cache
def _same(scenario: Scenario) -> Scenario:
    """One object for equal scenarios: pytest keeps a fixture while its parameter is the same object."""
    return scenario


def seed_id(scenario: Scenario) -> str:
    """How a test's name tells the scenario and the seed."""
    return f"{scenario.name}-seed{scenario.seed}"


def without_seed(nodeid: str, scenario: Scenario) -> str:
    """The name of a test that is run on `scenario`, the same for all seeds: `test_a.py::test[smoke]`."""
    test, bracket, parameters = nodeid.partition("[")
    return test + bracket + parameters.replace(seed_id(scenario), scenario.name, 1)
