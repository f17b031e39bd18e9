"""Run scenarios with `compact` in place of the oracle and beside it, and write the table of docs/segmenters.md.

Examples::

    python -m tools.segmenter_table                                       # prints
    python -m tools.segmenter_table --write                               # whole sequences, into the page
    python -m tools.segmenter_table --weights runs/segmenter/compact.safetensors --frames 200 smoke

What is finished is kept in runs/segmenter_table: after an interruption the same command continues.
"""

import argparse
from pathlib import Path

from scenarios.registry import scenario
from scenarios.report import Report
from scenarios.run import RunSettings
from scenarios.spec import first_frames
from scenarios.sweep.cells import Cell
from tools.doc_block import figure, markdown_table, write_block
from tools.finished_cells import reports

PAGE = Path(__file__).parent.parent / "docs" / "segmenters.md"
NAMES = ("fr3_walking_static", "fr3_walking_xyz", "fr3_walking_rpy", "fr3_walking_halfsphere", "tilted")
HEADER = [
    "scenario",
    "frames",
    "ATE unmasked, mm",
    "with the oracle, mm",
    "with `compact`, mm",
    "allowed, mm",
    "optimised, mm",
    "IoU of the masks",
    "leak, %",
    "waste, %",
    "MOC precision",
    "MOC recall",
]
ALLOWED_FACTOR, ALLOWED_MORE_M = 1.5, 0.003
"""What a network may cost: so many times the oracle's error, and so much more."""


def row(report: Report) -> list[str]:
    """One line of the table."""
    oracle, network = report.methods["dotmask-oracle"], report.methods["dotmask"]
    allowed_m = None if oracle.ate_rmse_m is None else ALLOWED_FACTOR * oracle.ate_rmse_m + ALLOWED_MORE_M
    return [
        f"`{report.scenario}`",
        str(report.frames),
        figure(report.methods["unmasked"].ate_rmse_m, 1e3, 1),
        figure(oracle.ate_rmse_m, 1e3, 1),
        figure(network.ate_rmse_m, 1e3, 1),
        figure(allowed_m, 1e3, 1),
        figure(network.ate_optimised_rmse_m, 1e3, 1),
        figure(network.masks.iou, 1, 3),
        figure(network.masks.leak, 1e2, 1),
        figure(network.masks.waste, 1e2, 1),
        figure(network.moc.precision, 1, 3),
        figure(network.moc.recall, 1, 3),
    ]


def main() -> None:
    """Run and print; with --write into the page as well."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help=f"scenarios; default: {', '.join(NAMES)}")
    parser.add_argument("--frames", type=int, help="only the first frames of each")
    parser.add_argument("--weights", type=Path, help="of compact; default: those of the assets")
    parser.add_argument("--write", action="store_true", help="into docs/segmenters.md; needs the defaults")
    options = parser.parse_args()
    if options.write and (options.names or options.frames is not None or options.weights is not None):
        parser.error("--write goes with whole sequences of the default scenarios and the weights of the assets")
    settings = RunSettings.parse(
        methods="unmasked,dotmask-oracle,dotmask", segmenter="compact", weights=options.weights, threads=1
    )
    cells = [
        Cell(scenario=first_frames(scenario(name), options.frames), settings=settings, varied={})
        for name in options.names or NAMES
    ]
    table = markdown_table(HEADER, [row(report) for report in reports(cells, Path("runs") / "segmenter_table")])
    print(table)
    if options.write:
        write_block(PAGE, "closed loop", "python -m tools.segmenter_table --write", table)


if __name__ == "__main__":
    main()
