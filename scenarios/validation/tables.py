"""Tables over runs of named scenarios, a row for each scenario and profile."""

from collections.abc import Callable, Mapping, Sequence

from scenarios.report import MethodReport
from scenarios.validation.section import Context, markdown_table

Column = tuple[str, Callable[[MethodReport], str]]


def reports_of(context: Context, names: Sequence[str]) -> dict[str, dict[str, MethodReport]]:
    """By scenario and profile; of a quick page the first scenario alone."""
    return context.runs.reports(names[:1] if context.is_quick else names)


def scenario_table(reports: Mapping[str, Mapping[str, MethodReport]], columns: Sequence[Column]) -> str:
    """A table with the scenario, the profile and `columns`."""
    header = ["scenario", "profile", *(heading for heading, _ in columns)]
    rows = [
        [f"`{scenario}`", profile, *(cell(report) for _, cell in columns)]
        for scenario, by_profile in reports.items()
        for profile, report in by_profile.items()
    ]
    return markdown_table(header, rows, texts=2)
