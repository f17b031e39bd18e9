"""The named scenarios."""

import json
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from scenarios.catalog import (
    faults,
    fr2,
    fr3_household,
    fr3_sitting,
    fr3_walking,
    gatherings,
    hard_views,
    losses,
    movers,
    original_failures,
    robot,
    smoke,
)
from scenarios.errors import ScenarioError, unknown
from scenarios.spec import Scenario, with_overrides

MODULES = (
    smoke,
    fr3_walking,
    fr3_sitting,
    fr2,
    fr3_household,
    robot,
    gatherings,
    hard_views,
    losses,
    movers,
    faults,
    original_failures,
)


def _collect() -> dict[str, Scenario]:
    named: dict[str, Scenario] = {}
    for module in MODULES:
        for scenario in module.SCENARIOS:
            if scenario.name in named:
                raise ValueError(f"two scenarios are called {scenario.name}")
            named[scenario.name] = scenario
    return named


SCENARIOS: Mapping[str, Scenario] = MappingProxyType(_collect())
"""All scenarios by name."""


def _first_with_its_frames(scenario: Scenario) -> str:
    return next(name for name, other in SCENARIOS.items() if scenario.has_frames_of(other))


RENDERED_AS: Mapping[str, str] = MappingProxyType({n: _first_with_its_frames(s) for n, s in SCENARIOS.items()})
"""For every scenario the first one with the same frames: itself, but for scenarios that differ in their faults alone.
What looks at frames (checks, contact sheets, tests of the rendering) looks once for all that share them."""


def scenario(name: str) -> Scenario:
    """The scenario called `name`.

    Raises:
        ScenarioError: there is none; the message names near matches.
    """
    if name not in SCENARIOS:
        raise unknown("scenario", name, SCENARIOS)
    return SCENARIOS[name]


def chosen_scenario(asked: str | Scenario, overrides: Mapping[str, Any]) -> Scenario:
    """The scenario of that name, or the given one, with values replaced.

    Args:
        asked: a name, see `dotmask list`, or a scenario.
        overrides: dotted keys to values, as for `dotmask run --set`.

    Raises:
        ScenarioError: no such scenario, an unknown key, or a value of the wrong type.
    """
    chosen = scenario(asked) if isinstance(asked, str) else asked
    texts = {key: value if isinstance(value, str) else _json(key, value) for key, value in overrides.items()}
    return with_overrides(chosen, texts) if texts else chosen


def _json(key: str, value: Any) -> str:
    try:
        return json.dumps(value)
    except TypeError as error:
        raise ScenarioError(f"overrides: {key}: {error}") from error
