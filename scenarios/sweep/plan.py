"""What a sweep runs: every combination of the varied values, each with every seed. All of it is checked beforehand."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from dotmask.segmentation.networks import NETWORKS
from scenarios.errors import ScenarioError
from scenarios.finished_runs import run_name
from scenarios.run import RunSettings
from scenarios.spec import Scenario, with_overrides
from scenarios.sweep.cells import Cell

RUN_KEYS = ("segmenter", "weights", "device", "slam", "slam_parameters", "profile", "pose_feedback", "renderer")
"""Settings of the run, which can be varied beside the keys of the scenario."""

OTHER_WAYS = {"seed": "use --seeds or --seed", "methods": "use --methods; methods share the frames of a cell"}
"""Keys that `--vary` does not take, and what to do."""

EXAMPLE = "for example camera.speed=0.5,1,2"


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepPlan:
    """A sweep.

    Attributes:
        scenario: the name of what is varied.
        varied: key to its values, as they are in the table; the first key varies slowest.
        seeds: that every combination is run with.
        methods: that are compared.
        cells: in order: by the values as they were given, then by the seeds.
    """

    scenario: str
    varied: Mapping[str, tuple[Any, ...]]
    seeds: tuple[int, ...]
    methods: tuple[str, ...]
    cells: tuple[Cell, ...]

    @classmethod
    def parse(
        cls,
        scenario: Scenario,
        *,
        vary: Sequence[str],
        seeds: int | None = None,
        seed: str | None = None,
        methods: str | None = None,
        words: Mapping[str, str] | None = None,
    ) -> "SweepPlan":
        """The plan of the command line.

        A cell that changes `frame_rate_hz`, and not `frames`, lasts as long as the scenario does: it has more or fewer
        frames. What the scenario counts in frames, as the delay of a late mask, stays in frames.

        Args:
            scenario: what is varied.
            vary: `KEY=V1,V2,...` each: a key of the scenario or one of `RUN_KEYS`; values as JSON or plain text.
            seeds: how many, from the scenario's own on; 1 where neither this nor `seed` is given.
            seed: a list of them instead.
            methods: as `RunSettings.parse`.
            words: the settings of all runs, by the names in `RUN_KEYS`, as `RunSettings.parse` takes them.

        Raises:
            ScenarioError, DotmaskError: an unknown key, no values, a value that is not possible in one of the cells, or
                two cells that are the same.
        """
        grid = _grid(vary)
        chosen = _seeds(scenario, seeds, seed)
        given = dict(words or {})
        cells = []
        for values in product(*grid.values()):
            texts = dict(zip(grid, values, strict=True))
            settings = _settings(methods, given, texts)
            varied = _scenario(scenario, texts)
            for one in chosen:
                seeded = with_overrides(varied, {"seed": str(one)})
                cells.append(Cell(scenario=seeded, settings=settings, varied=_values(seeded, settings, texts)))
        _check_all_differ(cells)
        return cls(
            scenario=scenario.name,
            varied={key: tuple(dict.fromkeys(cell.varied[key] for cell in cells)) for key in grid},
            seeds=chosen,
            methods=cells[0].settings.methods,
            cells=tuple(cells),
        )

    def to_json(self) -> str:
        """The plan for people and for `dotmask plot`; the cells follow from it and the program."""
        facts = {
            "scenario": self.scenario,
            "varied": self.varied,
            "seeds": self.seeds,
            "methods": self.methods,
            "cells": len(self.cells),
        }
        return json.dumps(facts, indent=2) + "\n"


def _grid(vary: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Key to the texts of its values."""
    grid: dict[str, tuple[str, ...]] = {}
    for text in vary:
        key, sign, values = (part.strip() for part in text.partition("="))
        if not sign or not key:
            raise ScenarioError(f"--vary {text}: expected KEY=VALUE,VALUE,..., {EXAMPLE}")
        if key in grid:
            raise ScenarioError(f"--vary {text}: {key} is varied twice; give all its values at once")
        if key in OTHER_WAYS:
            raise ScenarioError(f"--vary {text}: {OTHER_WAYS[key]}")
        found = tuple(_split(values))
        if not found or "" in found:
            raise ScenarioError(f"--vary {text}: a value is missing; {EXAMPLE}")
        if len(set(found)) != len(found):
            raise ScenarioError(f"--vary {text}: a value is given twice")
        grid[key] = found
    if not grid:
        raise ScenarioError(f"--vary: name at least one key with its values, {EXAMPLE}")
    return grid


def _split(values: str) -> Iterator[str]:
    """Values at the commas between them, but not at those inside of JSON lists."""
    try:
        parsed = json.loads(f"[{values}]")
    except json.JSONDecodeError:
        yield from (value.strip() for value in values.split(","))
    else:
        yield from (json.dumps(value) for value in parsed)


def _seeds(scenario: Scenario, count: int | None, listed: str | None) -> tuple[int, ...]:
    if listed is None:
        if count is not None and count < 1:
            raise ScenarioError(f"--seeds {count}: run at least one")
        return tuple(range(scenario.seed, scenario.seed + (1 if count is None else count)))
    if count is not None:
        raise ScenarioError("give --seeds, how many, or --seed, which, not both")
    try:
        chosen = tuple(int(part) for part in listed.split(","))
    except ValueError:
        raise ScenarioError(f"--seed {listed}: expected whole numbers, for example 0,1,2") from None
    if len(set(chosen)) != len(chosen):
        raise ScenarioError(f"--seed {listed}: a seed is given twice")
    return chosen


def _settings(methods: str | None, given: Mapping[str, str], texts: Mapping[str, str]) -> RunSettings:
    words = {**given, **{key: text.strip('"') for key, text in texts.items() if key in RUN_KEYS}}
    if "segmenter" in texts and words["segmenter"] not in NETWORKS:
        # Among varied segmenters, weights and device are for those that have them.
        words = {key: word for key, word in words.items() if key not in ("weights", "device")}
    return RunSettings.parse(methods=methods, threads=1, **words)  # type: ignore[arg-type]  # all of them are texts


def _scenario(scenario: Scenario, texts: Mapping[str, str]) -> Scenario:
    changes = {key: text for key, text in texts.items() if key not in RUN_KEYS}
    try:
        varied = with_overrides(scenario, changes)
        if "frame_rate_hz" in changes and "frames" not in changes:
            frames = round(scenario.duration_s * varied.frame_rate_hz) + 1
            varied = with_overrides(varied, {"frames": str(frames)})
    except ScenarioError as error:
        raise ScenarioError(str(error).replace("--set", "--vary", 1)) from error
    return varied


def _values(scenario: Scenario, settings: RunSettings, texts: Mapping[str, str]) -> dict[str, Any]:
    """The varied values as the run has them: `1` for a speed is 1.0."""
    found: dict[str, Any] = {}
    tree = scenario.model_dump(mode="json")
    for key, text in texts.items():
        if key in RUN_KEYS:
            found[key] = getattr(settings, key, text.strip('"'))
            continue
        value: Any = tree
        for part in key.split("."):
            value = value[int(part)] if isinstance(value, list) else value[part]
        found[key] = json.dumps(value) if isinstance(value, dict | list) else value
    return found


def _check_all_differ(cells: Sequence[Cell]) -> None:
    seen: dict[str, Cell] = {}
    for cell in cells:
        name = run_name(cell.key)
        if name in seen:
            raise ScenarioError(f"--vary: {cell.title} and {seen[name].title} are the same run")
        seen[name] = cell
