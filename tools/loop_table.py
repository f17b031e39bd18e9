"""Run every scenario with several seeds and write the table of loop closures into docs/slam.md.

    python -m tools.loop_table [--seeds 3] [--write] [NAME ...]

A quarter of the pixels, as in `smoke`: a test of what is accepted as a loop, in less than an hour and not in a day.
What is finished is kept in runs/loops: after an interruption the same command continues.
"""

import argparse
from pathlib import Path

from scenarios.registry import RENDERED_AS, SCENARIOS, scenario
from scenarios.report import Report
from scenarios.run import RunSettings
from scenarios.spec import Scenario, with_overrides
from scenarios.sweep.cells import Cell
from tools.doc_block import markdown_table, write_block
from tools.finished_cells import reports

PAGE = Path(__file__).parent.parent / "docs" / "slam.md"
METHOD = "dotmask"
HEADER = [
    "scenario", "frames", "lost", "loops", "false", "error, mm", "largest, mm", "ATE odometry, mm", "optimised, mm",
]  # fmt: skip


def quarter(name: str, seed: int) -> Scenario:
    """The scenario with another seed and half the width and height; `smoke` is that small already."""
    chosen = with_overrides(scenario(name), {"seed": str(seed)})
    camera = chosen.camera
    if camera.width < 640:
        return chosen
    halved = {
        "camera.width": str(camera.width // 2),
        "camera.height": str(camera.height // 2),
        "camera.fx": str(camera.fx / 2),
        "camera.fy": str(camera.fy / 2),
        # Pixel centres are at integers: the middle of the first two pixels is 0.5.
        "camera.cx": str((camera.cx - 0.5) / 2),
        "camera.cy": str((camera.cy - 0.5) / 2),
    }
    return with_overrides(chosen, halved)


def row(name: str, reports: list[Report]) -> list[str]:
    """One line of the table: sums, worst cases and mean errors over the seeds."""
    of_seeds = [report.methods[METHOD] for report in reports]
    found = [m.loops for m in of_seeds if m.loops.count]
    count = sum(loops.count or 0 for loops in found)
    means = [(loops.count or 0) * (loops.trans_error_m or 0.0) for loops in found]
    largest = max((loops.trans_error_max_m or 0.0 for loops in found), default=None)
    ates = [[m.ate_rmse_m for m in of_seeds], [m.ate_optimised_rmse_m for m in of_seeds]]
    return [
        f"`{name}`",
        " + ".join(str(report.frames) for report in reports),
        str(sum(r.frames - m.tracked_frames for r, m in zip(reports, of_seeds, strict=True))),
        str(count),
        str(sum(loops.false_count or 0 for loops in found)),
        f"{1e3 * sum(means) / count:.1f}" if count else "-",
        "-" if largest is None else f"{1e3 * largest:.1f}",
        *(" / ".join("-" if ate is None else f"{1e3 * ate:.1f}" for ate in of_kind) for of_kind in ates),
    ]


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="default: all with frames of their own")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--write", action="store_true", help="put the table into docs/slam.md")
    options = parser.parse_args()
    names = options.names or [name for name in SCENARIOS if RENDERED_AS[name] == name]
    settings = RunSettings.parse(methods=METHOD, threads=1)
    cells = [
        Cell(scenario=quarter(name, seed), settings=settings, varied={})
        for name in names
        for seed in range(options.seeds)
    ]
    found = reports(cells, Path("runs") / "loops")
    rows = [row(name, found[k * options.seeds : (k + 1) * options.seeds]) for k, name in enumerate(names)]
    seeds = ", ".join(map(str, range(options.seeds)))
    text = f"Seeds {seeds}, half the width and height.\n\n{markdown_table(HEADER, rows)}"
    print(text)
    if options.write:
        write_block(PAGE, "loops", "python -m tools.loop_table --write", text)


if __name__ == "__main__":
    main()
