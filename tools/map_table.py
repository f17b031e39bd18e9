"""Map scenarios as they are and without people, and write the table and the picture of docs/mapping.md.

Examples::

    python -m tools.map_table                      # the walking scenarios, whole
    python -m tools.map_table --frames 300 crowd   # others, shorter; prints without writing
"""

import argparse
import sys
from pathlib import Path

from rich.progress import track

from scenarios.registry import scenario
from scenarios.report import MapReport
from scenarios.run import RunSettings
from scenarios.spec import first_frames, with_overrides
from scenarios.sweep.cells import Cell, Done, run_and_keep
from scenarios.sweep.executors import cores, run_local
from tools.doc_block import figure, markdown_table, write_block

PAGE = Path(__file__).parent.parent / "docs" / "mapping.md"
PICTURE = PAGE.with_name("map.png")
SCENARIOS = ("fr3_walking_xyz", "fr3_walking_static", "fr3_walking_halfsphere")
HEADER = [
    "scenario",
    "frames",
    "ghosts unmasked, %",
    "ghosts dotmask, %",
    "off by, unmasked, mm",
    "off by, dotmask, mm",
    "complete, dotmask, %",
    "complete without people, %",
    "points dotmask",
]


def cell(name: str, frames: int | None, variant: str, methods: str) -> Cell:
    """A run with maps; `varied` says which."""
    settings = RunSettings.parse(methods=methods, with_map=True, threads=1)
    varied = {"scenario": name, "variant": variant}
    return Cell(
        scenario=with_overrides(first_frames(scenario(name), frames), {"variant": variant}),
        settings=settings,
        varied=varied,
    )


def maps(done: Done) -> dict[str, MapReport]:
    """The figures of the maps by method."""
    assert done.result.report is not None
    return {method: figures.map for method, figures in done.result.report.methods.items()}


def row(name: str, frames: int, people: dict[str, MapReport], empty: MapReport) -> list[str]:
    """One line of the table."""
    unmasked, ours = people["unmasked"], people["dotmask"]
    return [
        f"`{name}`",
        str(frames),
        figure(unmasked.ghost_fraction, 1e2, 2),
        figure(ours.ghost_fraction, 1e2, 2),
        figure(unmasked.accuracy_m, 1e3, 1),
        figure(ours.accuracy_m, 1e3, 1),
        figure(ours.completeness, 1e2, 1),
        figure(empty.completeness, 1e2, 1),
        f"{ours.points}",
    ]


def main() -> None:
    """Run and print; without arguments, write into the page as well."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help=f"scenarios; default: {', '.join(SCENARIOS)}")
    parser.add_argument("--frames", type=int, help="only the first frames of each")
    options = parser.parse_args()
    names = options.names or SCENARIOS
    cells = [
        cell(name, options.frames, *rest)
        for name in names
        for rest in (("moving", "unmasked,dotmask"), ("empty", "dotmask"))
    ]
    finished = {}
    for one, done in track(run_local(run_and_keep, cells, cores()), "runs", total=len(cells)):
        if done.result.error is not None:
            sys.exit(f"{one.title}: {done.result.error}")
        finished[one.varied["scenario"], one.varied["variant"]] = done
    rows = []
    for name in names:
        people, empty = finished[name, "moving"], finished[name, "empty"]
        assert people.result.report is not None
        rows.append(row(name, people.result.report.frames, maps(people), maps(empty)["dotmask"]))
    table = markdown_table(HEADER, rows)
    print(table)
    if not options.names and options.frames is None:
        PICTURE.write_bytes(finished[SCENARIOS[0], "moving"].files["map.png"])
        write_block(PAGE, "maps", "python -m tools.map_table", table)


if __name__ == "__main__":
    main()
