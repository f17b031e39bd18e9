"""Runs for a table, on all cores. What is finished is kept: after an interruption the same command continues."""

import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import MofNCompleteColumn, Progress, TimeElapsedColumn, TimeRemainingColumn

from scenarios.finished_runs import FinishedRuns
from scenarios.report import Report
from scenarios.sweep.cells import Cell, CellResult, run_cell
from scenarios.sweep.executors import cores, run_local


def reports(cells: Sequence[Cell], out: Path) -> list[Report]:
    """The report of each cell, in their order; those that `out` has are not run again.

    Raises:
        SystemExit: a run failed; which, and why.
    """
    kept = FinishedRuns(out, CellResult)
    waiting = [cell for cell in cells if kept.load(cell.key) is None]
    columns = (*Progress.get_default_columns()[:2], MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), speed_estimate_period=3600) as progress:
        task = progress.add_task("runs", total=len(cells), completed=len(cells) - len(waiting))
        for cell, done in run_local(run_cell, waiting, cores()):
            if done.result.error is not None:
                sys.exit(f"{cell.scenario.name}, seed {cell.scenario.seed}: {done.result.error}")
            kept.save(cell.key, done.result)
            progress.advance(task)
    found = [kept.load(cell.key) for cell in cells]
    return [result.report for result in found if result is not None and result.report is not None]
