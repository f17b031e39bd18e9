"""The command line. Each verb checks its input, calls one function and prints its result.

stdout is for results, stderr for progress and errors. Exit codes: 0 done, 1 a threshold was missed, 2 usage or
environment, 3 a bug. Heavy modules are imported inside the verbs, so that `--help` is quick.
"""

import math
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from scenarios.errors import ScenarioError

if TYPE_CHECKING:
    from rich.progress import Progress

    from scenarios.spec import Scenario

app = typer.Typer(
    name="dotmask",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    help="Does masking moving objects help your visual SLAM, when does it break, and which stage is to blame?",
    epilog="Start with:  dotmask list,  dotmask run smoke,  dotmask run fr3_walking_xyz --frames 300 --out runs/a",
)

Name = Annotated[str, typer.Argument(help="A scenario; `dotmask list` names them.", show_default=False)]
OptionalName = Annotated[str | None, typer.Argument(help="A scenario; `dotmask list` names them.", show_default=False)]
Source = Annotated[Path | None, typer.Option("--from", help="Repeat the scenario.json of another run or render.")]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change one value, e.g. camera.speed=2. May be repeated."),
]
Seed = Annotated[int | None, typer.Option(help="Another seed for the office's looks and the sensor's noise.")]
Frames = Annotated[int | None, typer.Option(help="Number of frames.")]
Feedback = Annotated[
    str | None, typer.Option(help="Pose for the tracker: previous, constant_velocity, refined. Default: profile's.")
]
Renderer = Annotated[str, typer.Option(help="Renderer: numba, pyrender.")]
SlamParameters = Annotated[
    str | None, typer.Option(help="Parameters of RTAB-Map: default, refined.", show_default="default")
]
SlamSet = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME=VALUE", help="Change one of them, e.g. Vis/MinInliers=12. May be repeated."),
]
Threads = Annotated[int, typer.Option(min=1, max=64, help="How many threads may work. The bytes do not depend on it.")]


def _console(stderr: bool = False) -> Console:
    return Console(stderr=stderr, soft_wrap=False)


@contextmanager
def _progress(unit: str = "frames", remembered_s: float = 30.0) -> Iterator["Progress"]:
    """A progress bar that counts `unit`; what is left follows from what the last `remembered_s` seconds brought."""
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        ProgressColumn,
        Task,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    from rich.text import Text

    class Rate(ProgressColumn):
        def render(self, task: Task) -> Text:
            speed = task.finished_speed or task.speed
            return Text("-/s" if speed is None else f"{speed:.1f}/s")

    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=20),
        MofNCompleteColumn(),
        TextColumn(unit),
        Rate(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=_console(stderr=True), speed_estimate_period=remembered_s) as progress:
        yield progress


def _vary(scenario: "Scenario", overrides: list[str] | None, seed: int | None, frames: int | None) -> "Scenario":
    from scenarios.spec import with_overrides

    changes: dict[str, str] = {}
    for text in overrides or []:
        key, sign, value = text.partition("=")
        if not sign or not key:
            raise ScenarioError(f"--set {text}: expected KEY=VALUE, for example camera.speed=2")
        changes[key.strip()] = value.strip()
    for option, number in (("seed", seed), ("frames", frames)):
        if number is not None:
            changes[option] = str(number)
    return with_overrides(scenario, changes) if changes else scenario


def _resolve(
    name: str | None, source: Path | None, overrides: list[str] | None, seed: int | None, frames: int | None
) -> "Scenario":
    """The scenario that the arguments ask for: by name or from a file, then varied."""
    from scenarios.registry import scenario
    from scenarios.spec import scenario_from_json

    if (name is None) == (source is None):
        raise ScenarioError("give the name of a scenario, or --from a scenario.json, not both")
    if source is not None:
        try:
            chosen = scenario_from_json(source.read_text(encoding="utf-8"), str(source))
        except (OSError, UnicodeDecodeError) as error:
            raise ScenarioError(f"--from {source}: cannot be read ({error})") from error
    else:
        assert name is not None
        chosen = scenario(name)
    return _vary(chosen, overrides, seed, frames)


def _is_folder(name: str) -> bool:
    """Whether `name` means a recorded folder: it is a path, or there is no such scenario and such a folder."""
    from scenarios.registry import SCENARIOS

    return name not in SCENARIOS and (Path(name).is_dir() or "/" in name)


@app.command("list")
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
    _console().print(table)


@app.command()
def show(name: Name, overrides: Overrides = None) -> None:
    """A scenario as JSON, with every value it has.

    Example:  dotmask show fr3_walking_xyz --set camera.speed=2 > fast.json
    """
    typer.echo(_resolve(name, None, overrides, None, None).to_json(), nl=False)


@app.command()
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

    scenario = _resolve(name, source, overrides, seed, frames)
    done: int | None = None
    with _progress() as progress:
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


@app.command()
def run(
    name: Annotated[
        str | None,
        typer.Argument(help="A scenario (`dotmask list`), or a folder in TUM RGB-D format.", show_default=False),
    ] = None,
    source: Source = None,
    methods: Annotated[
        str | None,
        typer.Option(help="Comma-separated: unmasked, mdi, dotmask. Default: all that have something to mask."),
    ] = None,
    segmenter: Annotated[
        str | None, typer.Option(help="Segmenter: oracle, none. Default: oracle, of a folder none.")
    ] = None,
    slam: Annotated[str, typer.Option(help="SLAM back end: embedded, rtabmap.")] = "embedded",
    slam_parameters: SlamParameters = None,
    slam_set: SlamSet = None,
    profile: Annotated[
        str, typer.Option(help="Parameters of the method: paper, calibrated. original: as the authors' program is.")
    ] = "calibrated",
    pose_feedback: Feedback = None,
    renderer: Renderer = "numba",
    seed: Seed = None,
    frames: Frames = None,
    overrides: Overrides = None,
    threads: Threads = 2,
    out: Annotated[
        Path | None, typer.Option(help="New or empty folder for the results. Default: runs/NAME-SEED.")
    ] = None,
    expect: Annotated[
        list[str] | None,
        typer.Option(metavar="FIGURE<NUMBER", help="Fail with exit code 1 unless it holds, e.g. ate_rmse_m<0.03."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print report.json instead of the table.")] = False,
    video: Annotated[bool, typer.Option(help="Write video.mp4: colour, masks, MO-MDI, trajectories.")] = False,
    repeat: Annotated[
        int, typer.Option(help="Run every method so often on the same frames, for a SLAM that differs from run to run.")
    ] = 1,
    camera: Annotated[str | None, typer.Option(help="Camera of a folder: fr1, fr2, fr3. Default: by its name.")] = None,
    intrinsics: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Camera of a folder: JSON with width, height, fx, fy, cx, cy.")
    ] = None,
    with_map: Annotated[
        bool, typer.Option("--map", help="Build, judge and draw the maps: map_METHOD.ply, mesh_METHOD.ply, map.png.")
    ] = False,
) -> None:
    """Render once, run every method on the same bytes, and compare each stage with the truth.

    Examples:  dotmask run smoke

    dotmask run fr3_walking_xyz --frames 300 --set camera.speed=2 --out runs/fast --expect 'ate_rmse_m<0.03'

    dotmask run fr3_walking_xyz --methods unmasked,dotmask --map --out runs/mapped

    dotmask run --from runs/fast/scenario.json --out runs/again

    dotmask run data/rgbd_dataset_freiburg3_walking_xyz

    dotmask run smoke --slam rtabmap --slam-parameters refined --slam-set Vis/MinInliers=12
    """
    from scenarios.report import expectation, maps, table, times
    from scenarios.run import RunSettings, default_out, free_folder, run_source
    from scenarios.sources import Recorded, Simulated, Source

    is_folder = source is None and name is not None and _is_folder(name)
    settings = RunSettings.parse(
        methods=methods,
        segmenter=segmenter or ("none" if is_folder else "oracle"),
        slam=slam,
        slam_parameters=slam_parameters,
        slam_changes=slam_set or (),
        profile=profile,
        pose_feedback=pose_feedback,
        renderer=renderer,
        threads=threads,
        video=video,
        with_map=with_map,
        repeats=repeat,
    )
    expectations = [expectation(text, settings.methods) for text in expect or []]
    sequence: Source
    if is_folder:
        assert name is not None
        if overrides or seed is not None:
            raise ScenarioError(f"{name} is a recorded folder: --set and --seed change scenarios only")
        sequence = recorded = Recorded(Path(name), camera, intrinsics, frames)
        folder = out or free_folder(recorded.name)
        for note in recorded.notes:
            typer.echo(f"dotmask: {note}", err=True)
    else:
        if camera is not None or intrinsics is not None:
            raise ScenarioError(
                "--camera and --intrinsics tell the camera of a recorded folder; a scenario has its own"
            )
        scenario = _resolve(name, source, overrides, seed, frames)
        sequence = Simulated(scenario, settings.renderer, settings.threads)
        folder = out or default_out(scenario)
    with _progress() as progress:
        task = progress.add_task(f"run {sequence.name}", total=len(sequence))
        report = run_source(sequence, settings, folder, lambda: progress.advance(task))
    if as_json:
        typer.echo(report.to_json(), nl=False)
    else:
        _console().print(table(report))
        _console().print(times(report), highlight=False)
        of_maps = maps(report)
        if of_maps is not None:
            _console().print(of_maps, highlight=False)
        _console().print(f"frame hash {report.frame_hash[:16]}, results in {folder}", highlight=False)
    missed = False
    for wanted in expectations:
        holds, value = wanted.verdict(report)
        missed |= not holds
        measured = "not measured" if value is None else f"{value:.6g}"
        typer.echo(f"{'holds ' if holds else 'MISSED'} {wanted.method}.{wanted.text}: {measured}", err=True)
    if missed:
        raise typer.Exit(1)


@app.command()
def attribute(
    name: OptionalName = None,
    source: Source = None,
    segmenter: Annotated[str, typer.Option(help="Segmenter: oracle.")] = "oracle",
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

    scenario = _resolve(name, source, overrides, seed, frames)
    settings = RunSettings.parse(
        methods="dotmask",
        segmenter=segmenter,
        profile=profile,
        pose_feedback=pose_feedback,
        renderer=renderer,
        threads=threads,
    )
    folder = out or default_out(scenario, "attribute-")
    with _progress() as progress:
        label = f"attribute {scenario.name}, {len(VARIANTS)} variants"
        task = progress.add_task(label, total=scenario.frames * len(VARIANTS))
        attribution = attribute_scenario(scenario, settings, folder, lambda: progress.advance(task))
    if as_json:
        typer.echo(attribution.to_json(), nl=False)
        return
    _console().print(headline(attribution), highlight=False)
    _console().print(figures_table(attribution))
    _console().print(blame_table(attribution))
    _console().print(f"frame hash {attribution.frame_hash[:16]}, results in {folder}", highlight=False)


@app.command()
def counterfactual(
    name: OptionalName = None,
    source: Source = None,
    segmenter: Annotated[str, typer.Option(help="Segmenter: oracle.")] = "oracle",
    profile: Annotated[str, typer.Option(help="Parameters of the method: paper, calibrated.")] = "calibrated",
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

    scenario = _resolve(name, source, overrides, seed, frames)
    settings = RunSettings.parse(
        segmenter=segmenter, profile=profile, pose_feedback=pose_feedback, renderer=renderer, threads=threads
    )
    folder = out or default_out(scenario, "counterfactual-")
    with _progress() as progress:
        label = f"counterfactual {scenario.name}, {len(WORLDS)} worlds"
        task = progress.add_task(label, total=scenario.frames * len(WORLDS))
        triplet = run_triplet(scenario, settings, folder, lambda: progress.advance(task))
    if as_json:
        typer.echo(triplet.to_json(), nl=False)
        return
    _console().print(headline(triplet), highlight=False)
    _console().print(ate_table(triplet))
    _console().print(costs_table(triplet))
    _console().print(f"{false_alarms(triplet)}; results in {folder}", highlight=False)


@app.command()
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
    chosen = [_resolve(name, None, overrides, seed, None) for name in names or dict.fromkeys(RENDERED_AS.values())]
    findings = []
    with _progress() as progress:
        task = progress.add_task("check", total=frames * len(chosen))
        for scenario in chosen:
            progress.update(task, description=f"check {scenario.name}")
            findings += check_scenario(scenario, frames, renderer, threads, lambda: progress.advance(task))
    if as_json:
        typer.echo(findings_json(findings), nl=False)
    else:
        _console().print(table(findings))
    failed = [finding for finding in findings if not finding.passes]
    for finding in failed:
        typer.echo(f"FAILED {finding.scenario}, {finding.check.name}: {finding.check.what}", err=True)
    if failed:
        raise typer.Exit(1)


@app.command()
def bench(
    quick: Annotated[bool, typer.Option("--quick", help="Fewer frames: under a minute.")] = False,
) -> None:
    """Time every stage on this machine, one core, against its budget and a peer in the same run.

    Example:  dotmask bench --quick
    """
    from scenarios.bench import bench_table

    with _progress() as progress:
        task = progress.add_task("bench", total=None)
        drawn = bench_table(quick, lambda: progress.advance(task))
    _console().print(drawn)


@app.command()
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

    with _progress() as progress:
        task = progress.add_task("validate", total=None)
        page = write_page(
            out,
            is_quick=quick,
            only=only or [],
            show=lambda title: progress.update(task, description=title),
            advance=lambda: progress.advance(task),
        )
    typer.echo(str(page))


@app.command()
def tables(
    slam: Annotated[str, typer.Option(help="SLAM back end: embedded, rtabmap.")] = "embedded",
    slam_parameters: SlamParameters = None,
    slam_set: SlamSet = None,
    segmenter: Annotated[str, typer.Option(help="Segmenter: oracle.")] = "oracle",
    profile: Annotated[str, typer.Option(help="Parameters of the method: paper, calibrated.")] = "calibrated",
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
        profile=profile,
        threads=threads,
        repeats=repeat,
        is_quick=quick,
    )
    pages = [out or Path("runs") / f"tables-{plan.back_end}{'-quick' if quick else ''}"]
    if write:
        pages.append(docs_of_checkout(plan))
    with _progress() as progress:
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


@app.command("eval")
def evaluate(
    truth: Annotated[Path, typer.Argument(metavar="TRUTH", help="A TUM trajectory, or a TUM RGB-D folder.")],
    estimate: Annotated[Path, typer.Argument(metavar="ESTIMATE", help="A TUM trajectory: what your SLAM says.")],
    max_difference_s: Annotated[
        float, typer.Option("--max-difference", min=0.0, help="Poses further apart in time are not compared, seconds.")
    ] = 0.02,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, in metres and radians.")] = False,
) -> None:
    """ATE and RPE of a trajectory, as the tools of the TUM RGB-D benchmark define them.

    Examples:  dotmask eval data/sequence/groundtruth.txt trajectory.txt

    dotmask eval runs/x/trajectory_truth.txt runs/x/trajectory_dotmask.txt --json
    """
    import json
    from dataclasses import asdict

    from dotmask.evaluation.trajectory import absolute_trajectory_error, relative_pose_error
    from dotmask.tum import read_trajectory

    known = read_trajectory(truth / "groundtruth.txt" if truth.is_dir() else truth)
    found = read_trajectory(estimate)
    ate = absolute_trajectory_error(known, found, max_difference_s)
    rpe = relative_pose_error(known, found, max_difference_s=max_difference_s)
    if ate is None or rpe is None:
        raise ScenarioError(
            f"{estimate}: fewer than three of its {len(found)} poses are within {max_difference_s:g} s of one of the "
            f"{len(known)} true ones; are the stamps of the same clock?"
        )
    if as_json:
        figures = {"truth_poses": len(known), "estimate_poses": len(found), "ate": asdict(ate), "rpe": asdict(rpe)}
        typer.echo(json.dumps(figures, indent=2))
        return
    typer.echo(
        f"ATE {1e3 * ate.rmse_m:.1f} mm RMSE (mean {1e3 * ate.mean_m:.1f}, median {1e3 * ate.median_m:.1f}, "
        f"largest {1e3 * ate.max_m:.1f}) over {ate.poses} of {len(known)} true poses\n"
        f"RPE {1e3 * rpe.trans_rmse_m:.1f} mm, {math.degrees(rpe.rot_rmse_rad):.2f} deg RMSE from pose to pose"
    )


@app.command()
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
    segmenter: Annotated[str, typer.Option(help="Segmenter: oracle, none.")] = "oracle",
    slam: Annotated[str, typer.Option(help="SLAM back end: embedded, rtabmap.")] = "embedded",
    slam_parameters: SlamParameters = None,
    profile: Annotated[
        str, typer.Option(help="Parameters of the method: paper, calibrated. original: as the authors' program is.")
    ] = "calibrated",
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
        "slam": slam,
        "slam_parameters": slam_parameters,
        "profile": profile,
        "pose_feedback": pose_feedback,
        "renderer": renderer,
    }
    plan = SweepPlan.parse(
        _resolve(name, source, overrides, None, frames),
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
    with _progress("cells", remembered_s=3600) as progress:
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


@app.command()
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
        _console().print(drawn)
    typer.echo(str(written))


@app.command()
def doctor() -> None:
    """Check that everything this program needs is here and unharmed.

    Example:  dotmask doctor
    """
    from scenarios.doctor import examine

    findings = examine()
    for finding in findings:
        mark = "ok " if finding.is_well else ("BAD" if finding.is_needed else "-  ")
        typer.echo(f"{mark} {finding.what}: {finding.said}")
    if any(f.is_needed and not f.is_well for f in findings):
        raise typer.Exit(2)


def main() -> None:
    """Entry point: turns errors into one line and an exit code."""
    from dotmask.errors import DotmaskError
    from sim.errors import SimError

    try:
        app()
    except (ScenarioError, SimError, DotmaskError) as error:
        typer.echo(f"dotmask: {error}", err=True)
        sys.exit(2)
    except KeyboardInterrupt:
        typer.echo("dotmask: interrupted; nothing was written", err=True)
        sys.exit(130)
    except Exception:
        traceback.print_exc()
        typer.echo("dotmask: this is a bug; please report the lines above", err=True)
        sys.exit(3)


if __name__ == "__main__":
    main()
