"""Sweep the speeds of camera and people, pose feedback and frame rate, and write the blocks of docs/stress.md.

Examples::

    python -m tools.stress --write      # all of it: about an hour on two free cores; continues where it was stopped
    python -m tools.stress --quick      # a few short runs of `smoke`, to see that it works; prints alone
"""

import argparse
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.progress import MofNCompleteColumn, Progress, TimeElapsedColumn, TimeRemainingColumn

from scenarios.registry import scenario
from scenarios.spec import Scenario, first_frames
from scenarios.sweep.cells import run_cell
from scenarios.sweep.executors import cores, run_local
from scenarios.sweep.figures import NOTE, told
from scenarios.sweep.page import Analysis, analyse, breakdown_rows, draw, summary_header, summary_rows
from scenarios.sweep.plan import SweepPlan
from scenarios.sweep.run import sweep
from scenarios.sweep.statistics import Series, gain
from scenarios.tum_figures import camera_figures
from tools.doc_block import markdown_table, write_block

PAGE = Path(__file__).parent.parent / "docs" / "stress.md"
COMMAND = "python -m tools.stress --write"
BOUND_M = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Extent:
    """How much is run."""

    scenario: str
    frames: int
    seeds: int
    speeds: str
    rates_hz: str
    people: str


FULL = Extent(scenario="fr3_walking_xyz", frames=300, seeds=5, speeds="0.5,1,2,4,8", rates_hz="30,14,8", people="1,2")
QUICK = Extent(scenario="smoke", frames=12, seeds=2, speeds="1,4", rates_hz="30,8", people="1,2")


def measure(extent: Extent, chosen: Scenario, vary: list[str], out: Path) -> Analysis:
    """Run one sweep; both share a folder, so that the runs that both have are run once."""
    plan = SweepPlan.parse(chosen, vary=vary, seeds=extent.seeds)
    columns = (*Progress.get_default_columns()[:2], MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), speed_estimate_period=3600) as progress:
        task = progress.add_task(" x ".join(plan.varied), total=len(plan.cells))
        execute = partial(run_local, run_cell, jobs=cores())
        sweep(plan, out, execute, show=lambda now: progress.update(task, completed=now.done))
    return analyse(out, BOUND_M)


def answer(analysis: Analysis) -> str:
    """How fast the camera may move: up to where `dotmask` holds, and where it helps."""
    by_key = {(told(one.others), one.method): one for one in analysis.series}
    held = {(tuple(others), method): text for others, method, text in breakdown_rows(analysis)}
    header = [
        "pose feedback",
        "frames per second",
        "`unmasked` holds up to",
        "`mdi`",
        "`dotmask`",
        "`dotmask` helps at",
    ]
    rows = []
    for others in dict.fromkeys(others for others, _ in held):
        one = next(s for (_, method), s in by_key.items() if method == "dotmask" and _texts(s) == others)
        raw = by_key[told(one.others), "unmasked"]
        rows.append([*others, *(held[others, m] for m in ("unmasked", "mdi", "dotmask")), helps_at(one, raw)])
    return markdown_table(header, rows)


def _texts(one: Series) -> tuple[str, ...]:
    return tuple(f"{value:g}" if isinstance(value, float) else str(value) for value in one.others.values())


def helps_at(ours: Series, raw: Series) -> str:
    """The speeds at which the error is smaller than without masking, with 95 % confidence at each."""
    better = gain(ours, raw)
    least = better.factor if better.band is None else better.band[0]
    speeds = [x for x in ours.x if x in raw.x]
    helped = [x for x, factor in zip(speeds, least, strict=True) if factor > 1]
    if len(helped) == len(speeds):
        return "all that were run"
    return ", ".join(f"{x:g}" for x in helped) or "none"


def pictures(analysis: Analysis, folder: Path, prefix: str) -> str:
    """The plots as Markdown, relative to the page."""
    return "\n\n".join(
        f"![{title}]({folder.name}/{path.name})" for title, path in draw(analysis, folder, prefix).items()
    )


def blocks(extent: Extent, out: Path, plots: Path) -> dict[str, str]:
    """Run everything; the blocks of the page by name."""
    chosen = first_frames(scenario(extent.scenario), extent.frames)
    camera = camera_figures(chosen)
    feedback = ["pose_feedback=previous,refined", f"frame_rate_hz={extent.rates_hz}"]
    rates = measure(extent, chosen, [f"camera.speed={extent.speeds}", *feedback], out)
    what = (
        f"`{extent.scenario}`, the first {chosen.duration_s:.1f} s, {extent.seeds} seeds, profile `calibrated`, oracle "
        f"segmenter, embedded SLAM. At camera speed 1 the camera moves at {camera.speed_m_s:.2f} m/s and turns at "
        f"{camera.turn_deg_s:.0f} degrees a second on average; at the other speeds so many times as fast."
    )
    found = {
        "stress-answer": f"{what}\n\n{answer(rates)}",
        "stress-rates": pictures(rates, plots, "rates_") + f"\n\n{NOTE}\n\n" + _summary(rates),
    }
    both = measure(extent, chosen, [f"camera.speed={extent.speeds}", f"people.speed={extent.people}"], out)
    points = [[*others, f"`{method}`", text] for others, method, text in breakdown_rows(both)]
    found["stress-people"] = "\n\n".join(
        (
            pictures(both, plots, "people_"),
            markdown_table(["people's speed", "method", "holds up to camera speed"], points),
            _summary(both),
        )
    )
    return found


def _summary(analysis: Analysis) -> str:
    table = markdown_table(summary_header(analysis), list(summary_rows(analysis)))
    return f"<details><summary>Every median</summary>\n\n{table}\n\n</details>"


def main() -> None:
    """Measure, print, and write the page on request."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="few short runs, too few to learn anything from")
    parser.add_argument("--write", action="store_true", help="write docs/stress.md and its plots")
    parser.add_argument("--out", type=Path, help="folder of the sweeps; default: runs/stress")
    options = parser.parse_args()
    if options.quick and options.write:
        parser.error("--write: a page from a few short runs would mislead; leave out --quick or --write")
    out = options.out or Path("runs") / ("stress-quick" if options.quick else "stress")
    plots = PAGE.with_suffix("") if options.write else out / "plots"
    for name, text in blocks(QUICK if options.quick else FULL, out, plots).items():
        print(text, end="\n\n")
        if options.write:
            write_block(PAGE, name, COMMAND, text)


if __name__ == "__main__":
    main()
