"""Run the attribution and the counterfactual triplet of `smoke`, and write their tables into docs/attribution.md.

Example::

    python -m tools.attribution_tables
"""

import io
import tempfile
from collections.abc import Iterable
from pathlib import Path

from rich.console import Console, RenderableType
from rich.progress import Progress

from scenarios import counterfactual
from scenarios.attribution import report
from scenarios.attribution.run import attribute
from scenarios.attribution.variants import VARIANTS
from scenarios.registry import scenario
from scenarios.run import RunSettings
from tools.doc_block import write_block

PAGE = Path(__file__).parent.parent / "docs" / "attribution.md"
COMMAND = "python -m tools.attribution_tables"


def as_text(parts: Iterable[RenderableType]) -> str:
    """What the command line prints, as a block of a document."""
    console = Console(file=io.StringIO(), width=100, record=True)
    for part in parts:
        console.print(part, highlight=False)
    lines = [line.rstrip() for line in console.export_text().splitlines()]
    return "```\n" + "\n".join(lines).strip("\n") + "\n```"


def main() -> None:
    """Run both and write both tables."""
    smoke = scenario("smoke")
    with tempfile.TemporaryDirectory() as folder, Progress(transient=True) as progress:
        worlds = counterfactual.WORLDS
        task = progress.add_task("smoke", total=smoke.frames * (len(VARIANTS) + len(worlds)))
        settings = RunSettings.parse(methods="dotmask", profile="paper")
        blamed = attribute(smoke, settings, Path(folder) / "blame", lambda: progress.advance(task))
        triplet = counterfactual.run_triplet(
            smoke, RunSettings.parse(), Path(folder) / "triplet", lambda: progress.advance(task)
        )
    blame = as_text([report.headline(blamed), report.figures_table(blamed), report.blame_table(blamed)])
    costs = as_text(
        [
            counterfactual.headline(triplet),
            counterfactual.ate_table(triplet),
            counterfactual.costs_table(triplet),
            counterfactual.false_alarms(triplet),
        ]
    )
    print(blame, costs, sep="\n\n")
    write_block(PAGE, "blame", COMMAND, blame)
    write_block(PAGE, "costs", COMMAND, costs)


if __name__ == "__main__":
    main()
