"""What people read of figures and comparisons: the message of a failure, and the Markdown page of a session."""

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pytest_dotmask.baseline import RunFigures
from pytest_dotmask.judgement import Change, Compared, Judgement
from pytest_dotmask.metrics import METRICS


def message(compared: Compared, count: int, baseline: Path) -> tuple[str, str] | None:
    """Why a comparison failed: the gist, and all of it; None where it did not.

    Args:
        compared: what is said of a run.
        count: of figures that were compared together.
        baseline: the file.
    """
    if compared.problem is not None:
        return (
            f"dotmask: {compared.problem}",
            f"{compared.test}, run '{compared.name}', {baseline}:\n{compared.problem}",
        )
    worse = compared.worse
    if not worse:
        return None
    gist = "; ".join(f"{change.metric.name} {change.text}" for change in worse)
    width = max(len(change.metric.name) for change in worse)
    lines = [
        f"Worse than {baseline}, with 95 % confidence for all {count} figures that were compared together.",
        f"Scenario {compared.scenario}, run '{compared.name}':",
        *(f"  {change.metric.name:{width}}  {change.text}, {_where(change)}" for change in worse),
        "Every seed's run folder lies in its test's tmp_path. If the change is meant: --dotmask-update-baseline",
    ]
    return f"worse: {gist}", "\n".join(lines)


def _where(change: Change) -> str:
    """In which seeds it is worse."""
    seeds = change.worse_seeds
    if len(seeds) == len(change.seeds):
        return f"worse in all {len(seeds)} seeds"
    return f"worse in {len(seeds)} of {len(change.seeds)} seeds ({', '.join(map(str, seeds))})"


def markdown(runs: Sequence[RunFigures], judgement: Judgement | None) -> str:
    """The page of a session: a table of the figures, or with a baseline one of the changes."""
    lines = ["## dotmask", ""]
    if not runs:
        lines += ["No test used `dotmask_run`.", ""]
    elif judgement is None:
        lines += ["| test | run | seeds | figure | mean | worst |", "| --- | --- | --- | --- | --- | --- |"]
        groups: dict[tuple[str, str], list[RunFigures]] = defaultdict(list)
        for run in runs:
            groups[run.test, run.name].append(run)
        for (test, name), members in groups.items():
            for metric in METRICS:
                given = [run.figures.get(metric.name) for run in members]
                values = np.array([value for value in given if value is not None])
                if len(values):
                    worst = values.max() if metric.worse == "more" else values.min()
                    cells = metric.value_text(metric.middle(values)), metric.value_text(float(worst))
                    lines.append(_row(f"`{test}`", name, str(len(values)), f"`{metric.name}`", *cells))
        lines.append("")
    else:
        worse = sum(len(compared.worse) for compared in judgement.compared)
        lines += [f"{judgement.count} figures compared with the baseline: {worse} worse, with 95 % confidence.", ""]
        lines += [
            "| test | run | seeds | figure | change, with its interval | |",
            "| --- | --- | --- | --- | --- | --- |",
        ]
        for compared in judgement.compared:
            start = f"`{compared.test}`", compared.name
            if compared.problem is not None or compared.is_skipped:
                told = compared.problem or "not compared: too few of its seeds were run"
                lines.append(_row(*start, "", "", told, "**fails**" if compared.problem else ""))
            for change in compared.changes:
                verdict = change.verdict
                word = "**worse**" if verdict.is_worse else "better" if verdict.is_better else ""
                lines.append(_row(*start, str(len(change.seeds)), f"`{change.metric.name}`", change.text, word))
        lines += [
            "",
            "Intervals hold together, with 95 %. A change below 5 %, or half a percentage point, is none.",
            "",
        ]
    return "\n".join(lines)


def _row(*cells: str) -> str:
    return f"| {' | '.join(cell.replace('|', '&#124;') for cell in cells)} |"
