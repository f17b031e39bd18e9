"""The verbs that judge one trajectory or run: run, eval."""

import math
from pathlib import Path
from typing import Annotated

import typer

from scenarios.cli.display import console, progress_bar
from scenarios.cli.options import (
    Device,
    Feedback,
    Frames,
    Overrides,
    Profile,
    Renderer,
    Seed,
    Slam,
    SlamParameters,
    SlamSet,
    Source,
    Threads,
    Weights,
    is_folder_name,
    resolve,
)
from scenarios.errors import ScenarioError


def run(
    name: Annotated[
        str | None,
        typer.Argument(help="A scenario (`dotmask list`), or a folder in TUM RGB-D format.", show_default=False),
    ] = None,
    source: Source = None,
    methods: Annotated[
        str | None,
        typer.Option(
            help="Comma-separated: unmasked, mdi, dotmask; dotmask-oracle beside another segmenter. Default: all that "
            "have something to mask."
        ),
    ] = None,
    segmenter: Annotated[
        str | None,
        typer.Option(
            help="Segmenter: oracle, none, a network (yolact, yolact++, mask_rcnn, compact) or package.module:factory. "
            "Default: oracle, of a folder none."
        ),
    ] = None,
    weights: Weights = None,
    device: Device = None,
    slam: Slam = "embedded",
    slam_parameters: SlamParameters = None,
    slam_set: SlamSet = None,
    profile: Profile = "calibrated",
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

    dotmask run fr3_walking_xyz --segmenter yolact --weights yolact_resnet50_54_800000.pth

    dotmask run data/rgbd_dataset_freiburg3_walking_xyz

    dotmask run smoke --slam rtabmap --slam-parameters refined --slam-set Vis/MinInliers=12
    """
    from scenarios.report import expectation, maps, table, times
    from scenarios.run import RunSettings, default_out, free_folder, run_source
    from scenarios.sources import Recorded, Simulated, Source

    is_folder = source is None and name is not None and is_folder_name(name)
    settings = RunSettings.parse(
        methods=methods,
        segmenter=segmenter or ("none" if is_folder else "oracle"),
        weights=weights,
        device=device,
        has_truth=not is_folder,
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
        scenario = resolve(name, source, overrides, seed, frames)
        sequence = Simulated(scenario, settings.renderer, settings.threads)
        folder = out or default_out(scenario)
    with progress_bar() as progress:
        task = progress.add_task(f"run {sequence.name}", total=len(sequence))
        report = run_source(sequence, settings, folder, lambda: progress.advance(task))
    if as_json:
        typer.echo(report.to_json(), nl=False)
    else:
        console().print(table(report))
        console().print(times(report), highlight=False)
        of_maps = maps(report)
        if of_maps is not None:
            console().print(of_maps, highlight=False)
        console().print(f"frame hash {report.frame_hash[:16]}, results in {folder}", highlight=False)
    missed = False
    for wanted in expectations:
        holds, value = wanted.verdict(report)
        missed |= not holds
        measured = "not measured" if value is None else f"{value:.6g}"
        typer.echo(f"{'holds ' if holds else 'MISSED'} {wanted.method}.{wanted.text}: {measured}", err=True)
    if missed:
        raise typer.Exit(1)


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
