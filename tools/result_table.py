"""Run scenarios with `unmasked` and `dotmask`, and write the table of the README.

Examples::

    python -m tools.result_table                       # the walking scenarios, whole
    python -m tools.result_table --frames 300 crowd    # others, shorter; prints without writing

What is finished is kept in runs/results: after an interruption the same command continues.
"""

import argparse
from pathlib import Path

from scenarios.registry import SCENARIOS, scenario
from scenarios.report import Report
from scenarios.run import RunSettings
from scenarios.spec import first_frames
from scenarios.sweep.cells import Cell
from tools.doc_block import figure, markdown_table, write_block
from tools.finished_cells import reports

PAGE = Path(__file__).parent.parent / "README.md"
HEADER = [
    "scenario",
    "frames",
    "ATE unmasked, mm",
    "ATE dotmask, mm",
    "optimised, mm",
    "loops",
    "MOC precision",
    "MOC recall",
    "leak, %",
    "waste, %",
]


def row(report: Report) -> list[str]:
    """One line of the table."""
    ours = report.methods["dotmask"]
    return [
        f"`{report.scenario}`",
        str(report.frames),
        figure(report.methods["unmasked"].ate_rmse_m, 1e3, 1),
        figure(ours.ate_rmse_m, 1e3, 1),
        figure(ours.ate_optimised_rmse_m, 1e3, 1),
        figure(ours.loops.count, 1, 0),
        figure(ours.moc.precision, 1, 3),
        figure(ours.moc.recall, 1, 3),
        figure(ours.masks.leak, 1e2, 1),
        figure(ours.masks.waste, 1e2, 1),
    ]


def main() -> None:
    """Run and print; without names, write into the README as well."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="scenarios; default: those tagged 'walking'")
    parser.add_argument("--frames", type=int, help="only the first frames of each")
    options = parser.parse_args()
    names = options.names or [s.name for s in SCENARIOS.values() if "walking" in s.tags]
    settings = RunSettings.parse(methods="unmasked,dotmask", threads=1)
    cells = [
        Cell(scenario=first_frames(scenario(name), options.frames), settings=settings, varied={}) for name in names
    ]
    rows = [row(report) for report in reports(cells, Path("runs") / "results")]
    table = markdown_table(HEADER, rows)
    print(table)
    if not options.names and options.frames is None:
        write_block(PAGE, "results", "python -m tools.result_table", table)


if __name__ == "__main__":
    main()
