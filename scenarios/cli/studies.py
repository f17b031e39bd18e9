"""The verbs of many runs: tables, validate, sweep, plot."""

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
    Segmenter,
    Slam,
    SlamParameters,
    SlamSet,
    Source,
    Threads,
    Weights,
    resolve,
)
from scenarios.errors import ScenarioError


def tables(
    slam: Slam = "embedded",
    slam_parameters: SlamParameters = None,
    slam_set: SlamSet = None,
    segmenter: Segmenter = "oracle",
    weights: Weights = None,
    device: Device = None,
    profile: Profile = "calibrated",
    quick: Annotated[bool, typer.Option("--quick", help="The first 150 frames of each sequence.")] = False,
    repeat: Annotated[
        int | None,
        typer.Option(help="Runs of each sequence. Default: 5 for rtabmap, which differs from run to run, else 1."),
    ] = None,
    threads: Threads = 2,
    out: Annotated[Path | None, typer.Option(help="Folder of finished runs. Default: runs/tables-SLAM.")] = None,
    write: Annotated[bool, typer.Option("--write", help="Write docs/results.md of this checkout too.")] = False,
) -> None:
    """The paper's Tables II to IV on the six sequences, its figures beside ours.

    A finished run is kept in OUT: after an interruption the same command continues.

    Examples:  dotmask tables --quick

    dotmask tables --slam embedded --write

    dotmask tables --slam rtabmap --slam-parameters refined --write
    """
    from scenarios.tables.measure import measure
    from scenarios.tables.page import docs_of_checkout, section_text, write_page
    from scenarios.tables.plan import TablePlan

    plan = TablePlan.parse(
        slam=slam,
        slam_parameters=slam_parameters,
        slam_changes=slam_set or (),
        segmenter=segmenter,
        weights=weights,
        device=device,
        profile=profile,
        threads=threads,
        repeats=repeat,
        is_quick=quick,
    )
    pages = [out or Path("runs") / f"tables-{plan.back_end}{'-quick' if quick else ''}"]
    if write:
        pages.append(docs_of_checkout(plan))
    with progress_bar() as progress:
        task = progress.add_task("tables", total=plan.total_frames())
        try:
            reports = measure(
                plan,
                pages[0],
                show=lambda title: progress.update(task, description=title),
                advance=lambda frames: progress.advance(task, frames),
            )
        except KeyboardInterrupt:
            progress.stop()
            typer.echo(
                f"dotmask: interrupted; finished runs are kept in {pages[0]}, the same command continues", err=True
            )
            raise typer.Exit(130) from None
    text = section_text(plan, reports)
    typer.echo(text)
    for folder in pages:
        typer.echo(f"written: {write_page(folder, plan, text)}", err=True)


def validate(
    out: Annotated[Path, typer.Option(help="Folder for plots; the page is written beside it.", show_default=False)],
    only: Annotated[
        list[str] | None, typer.Option(metavar="SECTION", help="Make this section alone. May be repeated.")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Few frames and seeds: only to see that it runs.")] = False,
) -> None:
    """Measure every stage against the truth and write OUT.md: consistency, errors, latencies, identities, masks.

    With --only, the other sections stay as they are in the folder.

    Examples:  dotmask validate --out docs/validation

    dotmask validate --quick --out runs/validation --only consistency
    """
    from scenarios.validation.page import validate as write_page

    with progress_bar() as progress:
        task = progress.add_task("validate", total=None)
        page = write_page(
            out,
            is_quick=quick,
            only=only or [],
            show=lambda title: progress.update(task, description=title),
            advance=lambda: progress.advance(task),
        )
    typer.echo(str(page))


def sweep(
    out: Annotated[
        Path, typer.Option(help="Folder of the sweep: new, or that of a sweep to continue.", show_default=False)
    ],
    name: OptionalName = None,
    source: Source = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY=V1,V2,...",
            help="Values of one key of the scenario, or of segmenter, slam, slam_parameters, profile, pose_feedback, "
            "renderer. May be repeated: every combination is run.",
        ),
    ] = None,
    seeds: Annotated[
        int | None, typer.Option(help="So many seeds, from the scenario's own on.", show_default="1")
    ] = None,
    seed: Annotated[str | None, typer.Option(metavar="A,B,...", help="These seeds instead.")] = None,
    methods: Annotated[
        str | None, typer.Option(help="Comma-separated: unmasked, mdi, dotmask. Default: all of them.")
    ] = None,
    executor: Annotated[str, typer.Option(help="Where the cells run: local, ray.")] = "local",
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Runs at a time with --executor local.", show_default="one a core")
    ] = None,
    address: Annotated[
        str | None, typer.Option(help="Ray cluster, e.g. auto or ray://HOST:10001. Default: one on this machine.")
    ] = None,
    keep_runs: Annotated[bool, typer.Option("--keep-runs", help="Keep the run folders in OUT/runs.")] = False,
    retry_failed: Annotated[
        bool, typer.Option("--retry-failed", help="Run the cells again that failed in an earlier command.")
    ] = False,
    segmenter: Segmenter = "oracle",
    weights: Weights = None,
    device: Device = None,
    slam: Slam = "embedded",
    slam_parameters: SlamParameters = None,
    profile: Profile = "calibrated",
    pose_feedback: Feedback = None,
    renderer: Renderer = "numba",
    frames: Frames = None,
    overrides: Overrides = None,
) -> None:
    """Run every combination of varied values with every seed, and leave one table, OUT/table.parquet.

    A finished run is kept at once: after an interruption of any kind the same command continues. A run that fails is a
    row with its error. A varied frame_rate_hz keeps the duration. Exit code 1 when a run failed.

    Examples:  dotmask sweep smoke --vary camera.speed=1,2,4 --seeds 3 --out runs/speeds

    dotmask sweep fr3_walking_xyz --vary camera.speed=0.5,1,2,4,8 --vary people.speed=0.5,1,2 --seeds 5 --out runs/both

    dotmask sweep crowd --vary pose_feedback=previous,refined --vary frame_rate_hz=30,14,8 --keep-runs --out runs/rates

    dotmask sweep crowd --vary camera.speed=1,2 --executor ray --address auto --out runs/cluster
    """
    from functools import partial

    from scenarios.errors import unknown
    from scenarios.sweep.cells import run_and_keep, run_cell
    from scenarios.sweep.executors import cores, run_local, run_ray
    from scenarios.sweep.plan import SweepPlan
    from scenarios.sweep.run import Executor, Progress
    from scenarios.sweep.run import sweep as run_sweep
    from scenarios.sweep.table import TABLE

    words = {
        "segmenter": segmenter,
        "weights": None if weights is None else str(weights),
        "device": device,
        "slam": slam,
        "slam_parameters": slam_parameters,
        "profile": profile,
        "pose_feedback": pose_feedback,
        "renderer": renderer,
    }
    plan = SweepPlan.parse(
        resolve(name, source, overrides, None, frames),
        vary=vary or (),
        seeds=seeds,
        seed=seed,
        methods=methods,
        words={key: word for key, word in words.items() if word is not None},
    )
    if executor not in ("local", "ray"):
        raise unknown("executor", executor, ("local", "ray"))
    if (executor == "local" and address is not None) or (executor == "ray" and jobs is not None):
        raise ScenarioError("--address is for --executor ray, --jobs for --executor local")
    work = run_and_keep if keep_runs else run_cell
    execute: Executor
    execute = (
        partial(run_local, work, jobs=jobs or cores())
        if executor == "local"
        else partial(run_ray, work, address=address)
    )
    with progress_bar("cells", remembered_s=3600) as progress:
        task = progress.add_task(f"sweep {plan.scenario}", total=len(plan.cells))
        has_begun = False

        def show(now: Progress) -> None:
            nonlocal has_begun
            if not has_begun:  # cells of an earlier command say nothing about this one's speed
                progress.reset(task, completed=now.done)
            has_begun = True
            failed = f", [red]{now.failed} failed[/red]" if now.failed else ""
            progress.update(task, completed=now.done, description=f"sweep {plan.scenario}{failed}")

        try:
            end = run_sweep(plan, out, execute, keep_runs=keep_runs, retry_failed=retry_failed, show=show)
        except KeyboardInterrupt:
            progress.stop()
            typer.echo(f"dotmask: interrupted; finished cells are kept in {out}, the same command continues", err=True)
            raise typer.Exit(130) from None
    typer.echo(str(out / TABLE))
    if end.failed:
        typer.echo(f"dotmask: {end.failed} of {end.done} cells failed; the column `error` says why", err=True)
        raise typer.Exit(1)


def plot(
    folder: Annotated[Path, typer.Argument(help="Folder of a sweep, finished or not.", show_default=False)],
    bound: Annotated[float, typer.Option(help="ATE in metres above which a method counts as broken down.")] = 0.05,
) -> None:
    """Plots and breakdown points of a sweep, in one page that needs no network: FOLDER/report.html.

    The first varied parameter with numbers is the axis of the plots; each combination of the others has a panel.

    Examples:  dotmask plot runs/speeds

    dotmask plot runs/both --bound 0.1
    """
    from rich.table import Table

    from scenarios.sweep.page import analyse, breakdown_rows, write_report

    written = write_report(folder, bound)
    analysis = analyse(folder, bound)
    if analysis.axes.is_numeric:
        drawn = Table(
            title=f"{analysis.axes.x} at which the median ATE exceeds {bound:g} m", title_justify="left", box=None
        )
        for heading in (*analysis.axes.others, "method", "breakdown [95 % interval]"):
            drawn.add_column(heading)
        for others, method, text in breakdown_rows(analysis):
            drawn.add_row(*others, method, text.replace("[", r"\["))
        console().print(drawn)
    typer.echo(str(written))
