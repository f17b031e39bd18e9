"""Run what the plan says and is not there yet."""

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

from scenarios.report import Report
from scenarios.run import run
from scenarios.tables.plan import TablePlan
from scenarios.tables.store import ReportStore, run_key

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
    store = ReportStore(out)
    reports: dict[str, tuple[Report, ...]] = {}
    for scenario in plan.scenarios():
        key = run_key(plan, scenario)
        for repeat in range(1, plan.repeats + 1):
            report = store.load(key, repeat)
            if report is None:
                show(scenario.name + (f", run {repeat} of {plan.repeats}" if plan.repeats > 1 else ""))
                with tempfile.TemporaryDirectory(prefix="dotmask-tables-") as folder:
                    report = run(scenario, plan.settings, Path(folder) / "run", lambda: advance(1))
                store.save(key, repeat, report)
            else:
                advance(scenario.frames)
            reports[scenario.name] = (*reports.get(scenario.name, ()), report)
    return reports
