"""Map scenarios as they are and without people, and write the table and the picture of docs/mapping.md.

Examples::

    python -m tools.map_table                      # the walking scenarios, their first 300 frames
    python -m tools.map_table --frames 900 crowd   # others; prints without writing
"""

import argparse
import shutil
import tempfile
from pathlib import Path

from rich.progress import track

from scenarios.registry import scenario
from scenarios.report import MapReport
from scenarios.run import RunSettings, run
from scenarios.spec import with_overrides
from tools.doc_block import markdown_table, write_block

PAGE = Path(__file__).parent.parent / "docs" / "mapping.md"
PICTURE = PAGE.with_name("map.png")
SCENARIOS = ("fr3_walking_xyz", "fr3_walking_static", "fr3_walking_halfsphere")
FRAMES = 300
HEADER = [
    "scenario",
    "ghosts unmasked, %",
    "ghosts dotmask, %",
    "off by, unmasked, mm",
    "off by, dotmask, mm",
    "complete, dotmask, %",
    "complete without people, %",
    "points dotmask",
]


def mapped(name: str, frames: int, variant: str, methods: str, picture: Path | None = None) -> dict[str, MapReport]:
    """The figures of the maps by method; the picture of the maps goes to `picture`."""
    chosen = scenario(name)
    chosen = with_overrides(chosen, {"frames": str(min(frames, chosen.frames)), "variant": variant})
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "run"
        report = run(chosen, RunSettings.parse(methods=methods, with_map=True), out, lambda: None)
        if picture is not None:
            shutil.copy(out / "map.png", picture)
    return {method: figures.map for method, figures in report.methods.items()}


def figure(value: float | None, scale: float, digits: int) -> str:
    """A number as the table shows it; "-" when it was not measured."""
    return "-" if value is None else f"{scale * value:.{digits}f}"


def row(name: str, frames: int, picture: Path | None) -> list[str]:
    """One line of the table."""
    people = mapped(name, frames, "moving", "unmasked,dotmask", picture)
    unmasked, ours = people["unmasked"], people["dotmask"]
    empty = mapped(name, frames, "empty", "dotmask")["dotmask"]
    return [
        f"`{name}`",
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
    parser.add_argument("--frames", type=int, default=FRAMES, help=f"of each scenario; default: {FRAMES}")
    options = parser.parse_args()
    names = options.names or SCENARIOS
    is_page = not options.names and options.frames == FRAMES
    rows = [
        row(name, options.frames, PICTURE if is_page and name == SCENARIOS[0] else None)
        for name in track(names, "scenarios")
    ]
    table = markdown_table(HEADER, rows)
    print(table)
    if is_page:
        write_block(PAGE, "maps", "python -m tools.map_table", f"The first {FRAMES} frames of each:\n\n{table}")


if __name__ == "__main__":
    main()
