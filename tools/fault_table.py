"""Run the scenarios whose segmenter makes mistakes, and write the table of docs/faults.md.

Every line stands beside that of the same frames without a fault.

Examples::

    python -m tools.fault_table                             # all, and into the document: some minutes
    python -m tools.fault_table fault_missed --frames 60    # prints without writing
"""

import argparse
import tempfile
from pathlib import Path

from rich.progress import track

from scenarios.registry import RENDERED_AS, SCENARIOS, scenario
from scenarios.report import Report
from scenarios.run import RunSettings, run
from scenarios.spec import Scenario, with_overrides
from tools.doc_block import markdown_table, write_block
from tools.result_table import figure

PAGE = Path(__file__).parent.parent / "docs" / "faults.md"
HEADER = ["scenario", "ATE, mm", "MOC precision", "MOC recall", "leak, %", "waste, %"]


def row(label: str, report: Report) -> list[str]:
    """One line of the table."""
    ours = report.methods["dotmask"]
    return [
        label,
        figure(ours.ate_rmse_m, 1e3, 1),
        figure(ours.moc.precision, 1, 3),
        figure(ours.moc.recall, 1, 3),
        figure(ours.masks.leak, 1e2, 1),
        figure(ours.masks.waste, 1e2, 1),
    ]


def lines(names: list[str]) -> list[tuple[str, Scenario]]:
    """What is run, with its label: each scenario, and the same frames without a fault before the first with them."""
    found: list[tuple[str, Scenario]] = []
    firsts: set[str] = set()
    order = list(SCENARIOS)
    for name in sorted(names, key=lambda name: order.index(RENDERED_AS[name])):
        first = RENDERED_AS[name]
        if first not in firsts:
            firsts.add(first)
            found.append((f"no fault, the frames of `{first}`", scenario(first).without_faults()))
        found.append((f"`{name}`", scenario(name)))
    return found


def main() -> None:
    """Run and print; without arguments, write into the document as well."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="scenarios; default: those tagged 'faults'")
    parser.add_argument("--frames", type=int, help="only the first frames of each")
    options = parser.parse_args()
    settings = RunSettings.parse(methods="dotmask", profile="calibrated")
    rows = []
    for label, chosen in track(lines(options.names or [s.name for s in SCENARIOS.values() if "faults" in s.tags])):
        if options.frames is not None:
            chosen = with_overrides(chosen, {"frames": str(min(options.frames, chosen.frames))})
        with tempfile.TemporaryDirectory() as folder:
            rows.append(row(label, run(chosen, settings, Path(folder) / "run", lambda: None)))
    table = markdown_table(HEADER, rows)
    print(table)
    if not options.names and options.frames is None:
        write_block(PAGE, "faults", "python -m tools.fault_table", table)


if __name__ == "__main__":
    main()
