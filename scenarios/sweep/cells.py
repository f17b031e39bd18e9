"""One cell of a sweep: a run, and what comes of it."""

import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict

from scenarios.errors import ScenarioError
from scenarios.finished_runs import run_key, run_name
from scenarios.report import Report
from scenarios.run import RunSettings, run
from scenarios.spec import Scenario


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One run of a sweep.

    Attributes:
        scenario: what happens, with its seed.
        settings: how it is run.
        varied: key to value, of what the sweep varies.
    """

    scenario: Scenario
    settings: RunSettings
    varied: Mapping[str, Any]

    @cached_property
    def key(self) -> dict[str, Any]:
        """All that decides the figures, as this process has it."""
        return run_key(self.scenario, self.settings)

    @property
    def name(self) -> str:
        """Of the cell's files; decided by the key."""
        return run_name(self.key)

    @property
    def title(self) -> str:
        """For messages."""
        return ", ".join([*(f"{key}={value}" for key, value in self.varied.items()), f"seed {self.scenario.seed}"])


class CellResult(BaseModel):
    """What came of a cell: a report, or the error that ended it.

    Attributes:
        report: of the run; None where it failed.
        error: one line; None where it did not fail.
        wall_s: how long it took.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    report: Report | None = None
    error: str | None = None
    wall_s: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Done:
    """What a worker hands back.

    Attributes:
        result: for the table.
        files: of the run folder, by name; empty unless they are kept.
    """

    result: CellResult
    files: Mapping[str, bytes] = field(default_factory=dict)


def failed(error: str) -> Done:
    """A cell that ended with an error."""
    return Done(result=CellResult(error=" ".join(error.split())))


def run_cell(cell: Cell) -> Done:
    """Run a cell; whatever goes wrong is its result."""
    return _run(cell, keep_files=False)


def run_and_keep(cell: Cell) -> Done:
    """The same, with the files of the run folder."""
    return _run(cell, keep_files=True)


def _run(cell: Cell, keep_files: bool) -> Done:
    start = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="dotmask-sweep-") as folder:
        out = Path(folder) / "run"
        try:
            if run_key(cell.scenario, cell.settings) != cell.key:
                raise ScenarioError(
                    "where this cell ran the program, its libraries or the recorded trajectory are not those that the "
                    "sweep was started with"
                )
            report = run(cell.scenario, cell.settings, out, lambda: None)
            files = {path.name: path.read_bytes() for path in sorted(out.iterdir())} if keep_files else {}
        except Exception as error:
            return failed(f"{type(error).__name__}: {error}")
    return Done(result=CellResult(report=report, wall_s=time.perf_counter() - start), files=files)
