"""The verbs that look at a scenario: list, show, render, check."""

from pathlib import Path
from typing import Annotated

import typer

from scenarios.cli.display import console, progress_bar
from scenarios.cli.options import Frames, Name, OptionalName, Overrides, Renderer, Seed, Source, Threads, resolve
from scenarios.errors import ScenarioError


def list_scenarios() -> None:
    """The scenarios, one a line.

    Example:  dotmask list
    """
    from rich.table import Table

    from scenarios.registry import SCENARIOS

    table = Table(box=None, pad_edge=False)
    for heading in ("scenario", "frames", "size", "what happens"):
        table.add_column(heading, no_wrap=heading != "what happens")
    for scenario in SCENARIOS.values():
        size = f"{scenario.camera.width}x{scenario.camera.height}"
        table.add_row(scenario.name, str(scenario.frames), size, scenario.description)
    console().print(table)


def show(name: Name, overrides: Overrides = None) -> None:
    """A scenario as JSON, with every value it has.

    Example:  dotmask show fr3_walking_xyz --set camera.speed=2 > fast.json
    """
    typer.echo(resolve(name, None, overrides, None, None).to_json(), nl=False)


def render(
    out: Annotated[Path, typer.Option(help="New or empty folder for the sequence.", show_default=False)],
    name: OptionalName = None,
    source: Source = None,
    format_name: Annotated[
        str, typer.Option("--format", help="tum (RGB-D benchmark), coco (annotations) or kitti (odometry).")
    ] = "tum",
    overrides: Overrides = None,
    seed: Seed = None,
    frames: Frames = None,
    renderer: Renderer = "numba",
    threads: Threads = 2,
    video: Annotated[bool, typer.Option(help="Write video.mp4 too: colour, depth and masks side by side.")] = False,
    resume: Annotated[bool, typer.Option("--resume", help="Continue an interrupted render of the same.")] = False,
) -> None:
    """Render a scenario into a folder of images with the complete truth beside them.

    Examples:  dotmask render smoke --out sequences/smoke --video

    dotmask render fr3_walking_xyz --format coco --out data/walking
    """
    from scenarios.export.render import render_sequence

    scenario = resolve(name, source, overrides, seed, frames)
    done: int | None = None
    with progress_bar() as progress:
        task = progress.add_task(f"render {scenario.name}", total=scenario.frames)

        def show(frames_done: int) -> None:
            nonlocal done
            if done is None:  # frames of an earlier process say nothing about this one's speed
                progress.reset(task, completed=frames_done)
            progress.update(task, completed=frames_done)
            done = frames_done

        try:
            render_sequence(
                scenario,
                out,
                format_name=format_name,
                renderer=renderer,
                threads=threads,
                video=video,
                resume=resume,
                show=show,
            )
        except KeyboardInterrupt:
            progress.stop()
            kept = f"{done} frames are kept; continue with --resume" if done else "nothing was written"
            typer.echo(f"dotmask: interrupted; {kept}", err=True)
            raise typer.Exit(130) from None
    typer.echo(str(out))


def check(
    names: Annotated[
        list[str] | None, typer.Argument(help="Scenarios; `dotmask list` names them.", show_default=False)
    ] = None,
    everything: Annotated[bool, typer.Option("--all", help="Every scenario that has frames of its own.")] = False,
    frames: Annotated[int, typer.Option(min=1, help="How many frames of each to look at.")] = 3,
    overrides: Overrides = None,
    seed: Seed = None,
    renderer: Renderer = "numba",
    threads: Threads = 2,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of the table.")] = False,
) -> None:
    """Check that the truth explains itself: depth, poses, flow, ids, normals, velocities, keypoints.

    Exit code 1 when it does not.

    Examples:  dotmask check smoke

    dotmask check --all --frames 5
    """
    from scenarios.check.run import check_scenario, findings_json, table
    from scenarios.registry import RENDERED_AS

    if bool(names) == everything:
        raise ScenarioError("give names of scenarios, or --all, not both")
    chosen = [resolve(name, None, overrides, seed, None) for name in names or dict.fromkeys(RENDERED_AS.values())]
    findings = []
    with progress_bar() as progress:
        task = progress.add_task("check", total=frames * len(chosen))
        for scenario in chosen:
            progress.update(task, description=f"check {scenario.name}")
            findings += check_scenario(scenario, frames, renderer, threads, lambda: progress.advance(task))
    if as_json:
        typer.echo(findings_json(findings), nl=False)
    else:
        console().print(table(findings))
    failed = [finding for finding in findings if not finding.passes]
    for finding in failed:
        typer.echo(f"FAILED {finding.scenario}, {finding.check.name}: {finding.check.what}", err=True)
    if failed:
        raise typer.Exit(1)
