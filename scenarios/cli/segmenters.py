"""The verb that judges a segmenter: evaluate-segmenter."""

from pathlib import Path
from typing import Annotated

import typer

from scenarios.cli.display import console, progress_bar
from scenarios.cli.options import Device, Frames, Overrides, Renderer, Seed, Threads, Weights, resolve
from scenarios.errors import ScenarioError


def evaluate_segmenter(
    name: Annotated[
        str,
        typer.Argument(
            help="A network (yolact, yolact++, mask_rcnn, compact), package.module:factory, or the oracle.",
            show_default=False,
        ),
    ],
    scenarios: Annotated[
        str,
        typer.Option(metavar="A,B,...", help="Comma-separated scenarios, or scenario.json files.", show_default=False),
    ],
    weights: Weights = None,
    device: Device = None,
    profile: Annotated[
        str, typer.Option(help="Whose threshold and number decide what is missed: paper, calibrated.")
    ] = "calibrated",
    every: Annotated[int, typer.Option(help="Look at every so many-th frame.")] = 1,
    overrides: Overrides = None,
    seed: Seed = None,
    frames: Frames = None,
    renderer: Renderer = "numba",
    threads: Threads = 2,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of the tables.")] = False,
) -> None:
    """How well a segmenter finds people and things: AP by class, overlaps, misses by circumstance, time.

    Examples:  dotmask evaluate-segmenter oracle --scenarios fault_missed --every 10

    dotmask evaluate-segmenter yolact --weights yolact_resnet50_54_800000.pth --scenarios fr3_walking_xyz,tilted
    """
    from scenarios.segmenter_evaluation.report import class_table, headline, miss_table, time_line
    from scenarios.segmenter_evaluation.run import evaluate_segmenter as evaluate
    from scenarios.segmenter_evaluation.run import frames_of
    from scenarios.segmenters import parse_segmenter

    network = parse_segmenter(name, weights, device)
    names = dict.fromkeys(part.strip() for part in scenarios.split(",") if part.strip())
    if not names:
        raise ScenarioError(f"--scenarios {scenarios}: name at least one; `dotmask list` does")
    chosen = [
        resolve(None, Path(one), overrides, seed, frames)
        if one.endswith(".json")
        else resolve(one, None, overrides, seed, frames)
        for one in names
    ]
    with progress_bar() as progress:
        total = sum(len(frames_of(scenario, max(every, 1))) for scenario in chosen)
        task = progress.add_task(f"evaluate {name}", total=total)
        evaluation = evaluate(
            name,
            network,
            chosen,
            profile=profile,
            every=every,
            renderer=renderer,
            threads=threads,
            advance=lambda: progress.advance(task),
        )
    if as_json:
        typer.echo(evaluation.to_json(), nl=False)
        return
    console().print(headline(evaluation), highlight=False)
    console().print(class_table(evaluation))
    console().print(miss_table(evaluation))
    console().print(time_line(evaluation), highlight=False)
