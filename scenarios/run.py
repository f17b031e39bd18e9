"""Make each frame once, run every method on the same bytes, judge each stage, leave a run folder."""

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, cast, get_args

import cv2
import numpy as np

from dotmask.interfaces import Segmenter, SlamBackend
from dotmask.mapping.settings import MappingSettings
from dotmask.original import OriginalDotMask
from dotmask.pipeline import ClosedLoop, DotMask, FrameResult, FrontEnd, MaskAll, Unmasked
from dotmask.profiles import ORIGINAL, PoseFeedback, Profile
from dotmask.profiles import profile as get_profile
from dotmask.records import FloatArray, Intrinsics, RgbdFrame
from dotmask.segmentation.networks import NetworkChoice
from dotmask.slam.embedded import EmbeddedSlam
from dotmask.slam.rtabmap.backend import RtabmapSlam
from dotmask.slam.rtabmap.library import core
from dotmask.slam.rtabmap.settings import RtabmapSettings, rtabmap_settings
from dotmask.tum import format_trajectory
from scenarios.errors import ScenarioError, unknown
from scenarios.judge import Judge
from scenarios.report import Report, WorldTimes
from scenarios.run_folder import RunFolder, versions
from scenarios.segmenters import FrameSegmenter, load_segmenter, parse_segmenter, segmenter_report, segmenter_threads
from scenarios.sources import Simulated, Source
from scenarios.spec import Scenario
from scenarios.video import PathsPanel, Video, write_picture
from scenarios.world import RENDERERS

if TYPE_CHECKING:
    from scenarios.mapping import MapMaker


def _method(segmenter: Segmenter, chosen: Profile) -> FrontEnd:
    """The method; the profile `original` is another program."""
    return OriginalDotMask(segmenter) if chosen is ORIGINAL else DotMask(segmenter, chosen)


METHODS: dict[str, Callable[[Segmenter, Profile], FrontEnd]] = {
    "unmasked": lambda segmenter, chosen: Unmasked(),
    "mdi": MaskAll,
    "dotmask": _method,
}
"""What may be compared: raw depth to both, all objects of interest removed from both, the method."""

BESIDE = "oracle"
"""`METHOD-oracle` is a method that the oracle segments for, beside those that another segmenter does."""

SLAM_BACKENDS = ("embedded", "rtabmap")


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSettings:
    """How a sequence is run; what happens in it is the scenario's own business.

    Attributes:
        methods: of `METHODS`, or one of them with `-oracle`: fed by the oracle, beside another segmenter. `NAME-2` and
            so on are further runs of the same one, see `method_of`. Any name of a front end that the caller brings,
            see `Parts`.
        segmenter: of `scenarios.segmenters.SEGMENTERS`, `package.module:factory`, or the name of one that the caller
            brings along, see `Parts`.
        slam: of `SLAM_BACKENDS`, or likewise.
        profile: name of the method's parameters.
        pose_feedback: see `ClosedLoop`.
        renderer: of `RENDERERS`.
        threads: that a run uses: one for the methods, the others render ahead; with 1 all is done by one thread.
        video: whether `video.mp4` is written.
        rtabmap: parameters of RTAB-Map, None with another SLAM back end.
        network: weights and device of a segmenter that is a network, None with another one.
    """

    methods: tuple[str, ...]
    segmenter: str
    slam: str
    profile: str
    pose_feedback: PoseFeedback
    renderer: str
    threads: int
    video: bool
    with_map: bool = False
    rtabmap: RtabmapSettings | None = None
    network: NetworkChoice | None = None

    @classmethod
    def parse(
        cls,
        *,
        methods: str | None = None,
        segmenter: str = "oracle",
        weights: str | Path | None = None,
        device: str | None = None,
        has_truth: bool = False,
        slam: str = "embedded",
        profile: str = "calibrated",
        pose_feedback: str | None = None,
        renderer: str = "numba",
        threads: int = 2,
        video: bool = False,
        with_map: bool = False,
        slam_parameters: str | None = None,
        slam_changes: Sequence[str] = (),
        repeats: int = 1,
    ) -> "RunSettings":
        """Settings from the words of a command line.

        With `repeats` every method is run so often, on the same frames: for what differs from run to run. Without
        `methods` all are run, and where the frames are known to have a truth (`has_truth`) the oracle stands beside
        another segmenter; with the segmenter `none`, which leaves nothing to mask, `unmasked` alone is run.

        Raises:
            ScenarioError: a name that does not exist, with near matches; or methods that mask without a segmenter.
            dotmask.errors.SegmenterError: the network cannot run here.
            dotmask.errors.ProfileError: no such profile.
            dotmask.errors.SlamError: RTAB-Map cannot run here, or has no such parameter.
        """
        if methods is None:
            methods = "unmasked" if segmenter == "none" else ",".join(METHODS)
            if has_truth and segmenter not in ("none", "oracle"):
                methods = methods.replace("dotmask", f"dotmask-{BESIDE},dotmask")
        chosen = tuple(dict.fromkeys(m.strip() for m in methods.split(",") if m.strip()))
        if not chosen:
            raise ScenarioError(f"--methods: name at least one of {', '.join(METHODS)}")
        if repeats < 1:
            raise ScenarioError(f"--repeat {repeats}: run each method at least once")
        feedback = pose_feedback if pose_feedback is not None else get_profile(profile).pose_feedback
        for kind, name, known in (
            *(("method", m.removesuffix(f"-{BESIDE}"), tuple(METHODS)) for m in chosen),
            ("SLAM back end", slam, SLAM_BACKENDS),
            ("renderer", renderer, tuple(RENDERERS)),
            ("pose feedback", feedback, get_args(PoseFeedback)),
        ):
            if name not in known:
                raise unknown(kind, name, known)
        network = parse_segmenter(segmenter, weights, device)
        if segmenter == BESIDE and any(is_beside(m) for m in chosen):
            raise ScenarioError(f"--methods {methods}: the oracle is the segmenter of all methods already")
        if segmenter == "none" and chosen != ("unmasked",):
            raise ScenarioError(f"--methods {methods}: without a segmenter nothing is masked; leave only unmasked")
        rtabmap = rtabmap_settings(slam_parameters or "default", slam_changes, core()) if slam == "rtabmap" else None
        if rtabmap is None and (slam_parameters is not None or slam_changes):
            raise ScenarioError(f"--slam-parameters and --slam-set are for --slam rtabmap, not {slam}")
        return cls(
            methods=tuple(m if n == 1 else f"{m}-{n}" for n in range(1, repeats + 1) for m in chosen),
            segmenter=segmenter,
            slam=slam,
            profile=profile,
            pose_feedback=cast(PoseFeedback, feedback),
            renderer=renderer,
            threads=threads,
            video=video,
            with_map=with_map,
            rtabmap=rtabmap,
            network=network,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Parts:
    """Parts that the caller brings along, each in the place of the one that the settings name.

    Attributes:
        segmenter: in place of `RunSettings.segmenter`.
        front_end: makes what masks the depth of such a camera, in place of every one of `RunSettings.methods`.
        slam: makes the SLAM back end from the camera and the true pose (4, 4) `T_world_camera` of the first frame,
            which fixes the world of its estimates; in place of `RunSettings.slam`.
    """

    segmenter: Segmenter | None = None
    front_end: Callable[[Intrinsics], FrontEnd] | None = None
    slam: Callable[[Intrinsics, FloatArray], SlamBackend] | None = None


def method_of(name: str) -> str:
    """The method that a name in a report stands for: `dotmask` for `dotmask`, `dotmask-2`, `dotmask-oracle`."""
    return name.partition("-")[0]


def is_beside(name: str) -> bool:
    """Whether a name in a report stands for a method that the oracle segments for, beside another segmenter."""
    return BESIDE in name.split("-")[1:]


def default_out(scenario: Scenario, prefix: str = "") -> Path:
    """`runs/PREFIXNAME-SEED`, or the first free `runs/PREFIXNAME-SEED-2` and so on."""
    return free_folder(f"{prefix}{scenario.name}-{scenario.seed}")


def free_folder(name: str) -> Path:
    """`runs/NAME`, or the first free `runs/NAME-2` and so on."""
    base = Path("runs") / name
    number, path = 1, base
    while path.exists():
        number += 1
        path = base.with_name(f"{base.name}-{number}")
    return path


def run(scenario: Scenario, settings: RunSettings, out: Path, advance: Callable[[], None]) -> Report:
    """Run a scenario and write the run folder `out`; see `run_source`."""
    return run_source(Simulated(scenario, settings.renderer, settings.threads), settings, out, advance)


def run_source(
    source: Source, settings: RunSettings, out: Path, advance: Callable[[], None], parts: Parts | None = None
) -> Report:
    """Run the methods on the frames of a source and write the run folder `out`.

    Args:
        source: a simulated scenario or a recorded folder.
        settings: how it is run; the renderer is the source's business.
        out: a new or empty folder.
        advance: called after every frame.
        parts: of the caller; the settings' names of them are what the report says.

    Raises:
        ScenarioError, SimError, DotmaskError: bad input; nothing is left in `out`.
    """
    parts = parts or Parts()
    segmenter = (
        load_segmenter(settings.segmenter, settings.network, source)
        if parts.segmenter is None
        else FrameSegmenter(parts.segmenter, settings.segmenter)
    )
    beside = load_segmenter(BESIDE, None, source) if any(map(is_beside, settings.methods)) else None
    at_once = 1 if settings.threads == 1 else len(settings.methods)
    with (
        RunFolder(out) as folder,
        one_opencv_thread(),
        segmenter_threads(settings.network, settings.threads),
        ThreadPoolExecutor(at_once) as pool,
    ):
        source.describe(folder)
        loops: dict[str, ClosedLoop] = {}
        judges = {name: Judge(name) for name in settings.methods}
        digest, seconds = hashlib.sha256(), 0.0
        paths = PathsPanel(640, 480, settings.methods)
        maker = _map_maker(source, settings) if settings.with_map else None
        video: Video | None = None
        for timed in source.frames():
            frame, truth = timed.frame.frame, timed.frame.truth
            seconds += timed.seconds
            digest.update(frame.rgb.tobytes())
            digest.update(frame.depth_m.tobytes())
            segmenter.see(frame, truth)
            if beside is not None:
                beside.see(frame, truth)
            if not loops:
                # The first true pose fixes the world of the estimates, as the alignment of a trajectory would.
                start = np.eye(4) if truth.T_world_camera is None else truth.T_world_camera
                front_ends = {
                    name: _front_end(name, _fed_by(name, segmenter, beside), settings, frame, parts)
                    for name in settings.methods
                }
                loops = {
                    name: closed_loop(front_end, settings, frame, start, folder.path / name, parts.slam)
                    for name, front_end in front_ends.items()
                }
                if settings.video:
                    size = (frame.intrinsics.width, frame.intrinsics.height)
                    video = Video(folder.path / "video.mp4", source.frame_rate_hz, size, settings.methods)
            # Each method has its own state, so the order in which they are done cannot matter.
            steps = pool.map(lambda loop, now=frame: loop.step(now), loops.values())
            results = {
                name: _charged(result, _fed_by(name, segmenter, beside))
                for name, result in zip(loops, steps, strict=True)
            }
            for name, result in results.items():
                judges[name].see(truth, result, folder)
            if maker is not None:
                maker.see(truth, results)
            paths.add(truth.T_world_camera, results)
            if video is not None:
                video.add(results, paths)
            advance()
        if video is not None:
            video.close()
        slam_results = {name: loop.finish() for name, loop in loops.items()}
        of_maps = {} if maker is None else maker.finish(slam_results, folder)
        report = Report(
            scenario=source.name,
            seed=source.seed,
            frames=len(source),
            renderer=source.renderer,
            segmenter=segmenter_report(settings.segmenter, settings.network),
            slam=settings.slam,
            slam_parameters={} if settings.rtabmap is None else dict(settings.rtabmap.parameters),
            profile=settings.profile,
            frame_hash=digest.hexdigest(),
            methods={name: judge.report(slam_results[name], of_maps.get(name)) for name, judge in judges.items()},
            time_ms=WorldTimes(render=None if source.renderer is None else 1e3 * seconds / len(source)),
        )
        folder.write("trajectory_truth.txt", format_trajectory(judges[settings.methods[0]].truth_trajectory()))
        for name, judge in judges.items():
            folder.write(f"trajectory_{name}.txt", format_trajectory(judge.estimated_trajectory()))
            folder.write(f"trajectory_{name}_optimised.txt", format_trajectory(slam_results[name].trajectory))
        write_picture(folder.path / "trajectories.png", paths.draw())
        folder.write("versions.json", json.dumps(versions(), indent=2) + "\n")
        folder.write("report.json", report.to_json())
    return report


def _fed_by(name: str, segmenter: FrameSegmenter, beside: FrameSegmenter | None) -> FrameSegmenter:
    """The segmenter of the method called `name`."""
    return beside if beside is not None and is_beside(name) else segmenter


def _charged(result: FrameResult, segmenter: FrameSegmenter) -> FrameResult:
    """The result with the time that the segmenter took for all methods, where this one asked it."""
    if segmenter.seconds is None or "segment" not in result.stage_seconds:
        return result
    return replace(result, stage_seconds={**result.stage_seconds, "segment": segmenter.seconds})


def _front_end(name: str, segmenter: Segmenter, settings: RunSettings, first: RgbdFrame, parts: Parts) -> FrontEnd:
    """What masks the depth for the method called `name`."""
    if parts.front_end is not None:
        return parts.front_end(first.intrinsics)
    return METHODS[method_of(name)](segmenter, get_profile(settings.profile))


def _map_maker(source: Source, settings: RunSettings) -> "MapMaker":
    from scenarios.mapping import MapMaker  # loads what is needed by those who want a map alone

    return MapMaker(settings.methods, source.static_world(), MappingSettings())


def closed_loop(
    front_end: FrontEnd,
    settings: RunSettings,
    first: RgbdFrame,
    T_world_camera: FloatArray,
    files: Path,
    make_slam: Callable[[Intrinsics, FloatArray], SlamBackend] | None = None,
) -> ClosedLoop:
    """The front end in a loop with the SLAM of the settings.

    Args:
        front_end: what masks the depth.
        settings: how the scenario is run.
        first: the first frame.
        T_world_camera: (4, 4) its true pose, which fixes the world of the estimates.
        files: folder and stem of the files that SLAM leaves.
        make_slam: see `Parts.slam`.
    """
    slam: SlamBackend
    if make_slam is not None:
        slam = make_slam(first.intrinsics, T_world_camera)
    elif settings.rtabmap is None:
        slam = EmbeddedSlam(first.intrinsics, T_world_camera)
    else:
        database, log = (files.with_name(f"rtabmap_{files.name}.{kind}") for kind in ("db", "log"))
        slam = RtabmapSlam(first.intrinsics, T_world_camera, settings.rtabmap, database, log)
    return ClosedLoop(front_end, slam, settings.pose_feedback, T_world_camera)


@contextmanager
def one_opencv_thread() -> Iterator[None]:
    """OpenCV's own threads are off inside the block: the methods and the renderer keep the cores busy already."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)
