"""The verbs that ask why: attribute, counterfactual."""

from pathlib import Path
from typing import Annotated

import typer

from scenarios.cli.display import console, progress_bar
from scenarios.cli.options import (
    Device,
    Feedback,
    Frames,
    OptionalName,
    Overrides,
    Profile,
    Renderer,
    Seed,
    Segmenter,
    Source,
    Threads,
    Weights,
    resolve,
)


def attribute(
    name: OptionalName = None,
    source: Source = None,
    segmenter: Segmenter = "oracle",
    weights: Weights = None,
    device: Device = None,
    profile: Annotated[str, typer.Option(help="Parameters of the method: paper, calibrated.")] = "calibrated",
    pose_feedback: Feedback = None,
    renderer: Renderer = "numba",
    seed: Seed = None,
    frames: Frames = None,
    overrides: Overrides = None,
    threads: Threads = 2,
    out: Annotated[
        Path | None, typer.Option(help="New or empty folder for the results. Default: runs/attribute-NAME-SEED.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print attribution.json instead of the tables.")] = False,
) -> None:
    """Which stage is to blame: replace each stage of the method by the truth, alone, and all but one.

    Masks, measured depth, the tracker's camera pose, association, classification; all variants see the same bytes.

    Examples:  dotmask attribute smoke

    dotmask attribute fr3_walking_xyz --set camera.speed=2 --pose-feedback previous --out runs/blame
    """
    from scenarios.attribution.report import blame_table, figures_table, headline
    from scenarios.attribution.run import attribute as attribute_scenario
    from scenarios.attribution.variants import VARIANTS
    from scenarios.run import RunSettings, default_out

    scenario = resolve(name, source, overrides, seed, frames)
    settings = RunSettings.parse(
        methods="dotmask",
        segmenter=segmenter,
        weights=weights,
        device=device,
        profile=profile,
        pose_feedback=pose_feedback,
        renderer=renderer,
        threads=threads,
    )
    folder = out or default_out(scenario, "attribute-")
    with progress_bar() as progress:
        label = f"attribute {scenario.name}, {len(VARIANTS)} variants"
        task = progress.add_task(label, total=scenario.frames * len(VARIANTS))
        attribution = attribute_scenario(scenario, settings, folder, lambda: progress.advance(task))
    if as_json:
        typer.echo(attribution.to_json(), nl=False)
        return
    console().print(headline(attribution), highlight=False)
    console().print(figures_table(attribution))
    console().print(blame_table(attribution))
    console().print(f"frame hash {attribution.frame_hash[:16]}, results in {folder}", highlight=False)


def counterfactual(
    name: OptionalName = None,
    source: Source = None,
    segmenter: Segmenter = "oracle",
    weights: Weights = None,
    device: Device = None,
    profile: Profile = "calibrated",
    pose_feedback: Feedback = None,
    renderer: Renderer = "numba",
    seed: Seed = None,
    frames: Frames = None,
    overrides: Overrides = None,
    threads: Threads = 2,
    out: Annotated[
        Path | None, typer.Option(help="New or empty folder for the results. Default: runs/counterfactual-NAME-SEED.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print counterfactual.json instead of the tables.")] = False,
) -> None:
    """What motion, masking and the method cost: the scenario as it is, with everything frozen, and without people.

    Camera and seed are the same in all three; unmasked, mdi and dotmask run on each.

    Examples:  dotmask counterfactual smoke

    dotmask counterfactual crowd --frames 300 --out runs/crowd-triplet
    """
    from scenarios.counterfactual import WORLDS, ate_table, costs_table, false_alarms, headline, run_triplet
    from scenarios.run import RunSettings, default_out

    scenario = resolve(name, source, overrides, seed, frames)
    settings = RunSettings.parse(
        segmenter=segmenter,
        weights=weights,
        device=device,
        profile=profile,
        pose_feedback=pose_feedback,
        renderer=renderer,
        threads=threads,
    )
    folder = out or default_out(scenario, "counterfactual-")
    with progress_bar() as progress:
        label = f"counterfactual {scenario.name}, {len(WORLDS)} worlds"
        task = progress.add_task(label, total=scenario.frames * len(WORLDS))
        triplet = run_triplet(scenario, settings, folder, lambda: progress.advance(task))
    if as_json:
        typer.echo(triplet.to_json(), nl=False)
        return
    console().print(headline(triplet), highlight=False)
    console().print(ate_table(triplet))
    console().print(costs_table(triplet))
    console().print(f"{false_alarms(triplet)}; results in {folder}", highlight=False)
