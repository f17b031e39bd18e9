"""Run what the plan says and is not there yet."""

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

from scenarios.finished_runs import FinishedRuns, run_key
from scenarios.report import MethodReport, Report
from scenarios.run import method_of, run
from scenarios.tables.plan import TablePlan

Reports = Mapping[str, tuple[Report, ...]]
"""By sequence, the reports of its repeats."""


def measure(plan: TablePlan, out: Path, show: Callable[[str], None], advance: Callable[[int], None]) -> Reports:
    """The reports of all runs; finished ones are read from `out`, and every new one is kept there at once.

    Args:
        plan: what to run.
        out: folder of finished runs.
        show: called with a line about each run when it begins.
        advance: called with the number of frames that are done since the last call.

    Raises:
        ScenarioError, SimError, DotmaskError: bad settings, or `out` cannot be written to.
    """
    finished = FinishedRuns(out, Report)
    reports: dict[str, tuple[Report, ...]] = {}
    for scenario in plan.scenarios():
        key = run_key(scenario, plan.settings)
        report = finished.load(key)
        if report is None:
            show(scenario.name)
            with tempfile.TemporaryDirectory(prefix="dotmask-tables-") as folder:
                report = run(scenario, plan.settings, Path(folder) / "run", lambda: advance(1))
            finished.save(key, report)
        else:
            advance(scenario.frames)
        reports[scenario.name] = split_repeats(report)
    return reports


def split_repeats(report: Report) -> tuple[Report, ...]:
    """One report for each time that the methods were run, each with their plain names."""
    runs: list[dict[str, MethodReport]] = []
    for name, method in report.methods.items():
        plain = method_of(name)
        if not runs or plain in runs[-1]:
            runs.append({})
        runs[-1][plain] = method
    return tuple(report.model_copy(update={"methods": methods}) for methods in runs)
