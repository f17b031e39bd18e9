"""Render once, run every method on the same bytes, judge each stage, leave a run folder."""

import hashlib
import json
import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, cast, get_args

import cv2

from dotmask.interfaces import Segmenter
from dotmask.mapping.settings import MappingSettings
from dotmask.original import OriginalDotMask
from dotmask.pipeline import ClosedLoop, DotMask, FrontEnd, MaskAll, Unmasked
from dotmask.profiles import ORIGINAL, PoseFeedback, Profile
from dotmask.profiles import profile as get_profile
from dotmask.records import FloatArray, RgbdFrame
from dotmask.slam.embedded import EmbeddedSlam
from dotmask.tum import format_trajectory
from scenarios.bridge import rgbd_frame_from_sim
from scenarios.errors import ScenarioError, unknown
from scenarios.faults.chain import Faults
from scenarios.judge import Judge
from scenarios.oracle import OracleSegmenter
from scenarios.report import Report, WorldTimes
from scenarios.run_folder import RunFolder, versions
from scenarios.spec import Scenario
from scenarios.video import PathsPanel, Video, write_picture
from scenarios.world import RENDERERS, build_simulator
from sim.records import SimFrame
from sim.simulator import Simulator

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

SEGMENTERS = ("oracle",)
SLAM_BACKENDS = ("embedded",)

FRAMES_AHEAD = 3
"""Frames rendered ahead of the methods: enough to keep both cores busy, few enough to keep memory flat."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSettings:
    """How a scenario is run; what happens in it is the scenario's own business."""

    methods: tuple[str, ...]
    segmenter: str
    slam: str
    profile: str
    pose_feedback: PoseFeedback
    renderer: str
    threads: int
    video: bool
    with_map: bool

    @classmethod
    def parse(
        cls,
        *,
        methods: str = "unmasked,mdi,dotmask",
        segmenter: str = "oracle",
        slam: str = "embedded",
        profile: str = "calibrated",
        pose_feedback: str | None = None,
        renderer: str = "numba",
        threads: int = 2,
        video: bool = False,
        with_map: bool = False,
    ) -> "RunSettings":
        """Settings from the words of a command line.

        Raises:
            ScenarioError: a name that does not exist, with near matches.
            dotmask.errors.ProfileError: no such profile.
        """
        chosen = tuple(dict.fromkeys(m.strip() for m in methods.split(",") if m.strip()))
        if not chosen:
            raise ScenarioError(f"--methods: name at least one of {', '.join(METHODS)}")
        feedback = pose_feedback if pose_feedback is not None else get_profile(profile).pose_feedback
        for kind, name, known in (
            *(("method", m, tuple(METHODS)) for m in chosen),
            ("segmenter", segmenter, SEGMENTERS),
            ("SLAM back end", slam, SLAM_BACKENDS),
            ("renderer", renderer, tuple(RENDERERS)),
            ("pose feedback", feedback, get_args(PoseFeedback)),
        ):
            if name not in known:
                raise unknown(kind, name, known)
        return cls(
            methods=chosen,
            segmenter=segmenter,
            slam=slam,
            profile=profile,
            pose_feedback=cast(PoseFeedback, feedback),
            renderer=renderer,
            threads=threads,
            video=video,
            with_map=with_map,
        )


def default_out(scenario: Scenario, prefix: str = "") -> Path:
    """`runs/PREFIXNAME-SEED`, or the first free `runs/PREFIXNAME-SEED-2` and so on."""
    base = Path("runs") / f"{prefix}{scenario.name}-{scenario.seed}"
    number, path = 1, base
    while path.exists():
        number += 1
        path = base.with_name(f"{base.name}-{number}")
    return path


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TimedFrame:
    """A frame and the wall time that making it took."""

    frame: SimFrame
    seconds: float


def rendered_ahead(simulator: Simulator, first: int = 0) -> Iterator[TimedFrame]:
    """The frames from `first` on in order, made by a second thread a few frames ahead of the consumer."""

    def make(index: int) -> TimedFrame:
        start = time.perf_counter()
        frame = simulator.frame(index)
        return TimedFrame(frame=frame, seconds=time.perf_counter() - start)

    pending: deque[Future[TimedFrame]] = deque()
    with ThreadPoolExecutor(max_workers=1, thread_name_prefix="render") as pool:
        try:
            for index in range(first, len(simulator)):
                pending.append(pool.submit(make, index))
                if len(pending) > FRAMES_AHEAD:
                    yield pending.popleft().result()
            while pending:
                yield pending.popleft().result()
        finally:
            for future in pending:
                future.cancel()


def run(scenario: Scenario, settings: RunSettings, out: Path, advance: Callable[[], None]) -> Report:
    """Run a scenario and write the run folder `out`.

    Args:
        scenario: what happens.
        settings: how it is run.
        out: a new or empty folder.
        advance: called after every frame.

    Raises:
        ScenarioError, SimError, DotmaskError: bad input; nothing is left in `out`.
    """
    with RunFolder(out) as folder, one_opencv_thread(), ThreadPoolExecutor(len(settings.methods)) as pool:
        folder.write("scenario.json", scenario.to_json())
        simulator = build_simulator(scenario, settings.renderer, settings.threads)
        oracle = OracleSegmenter(Faults(scenario))
        loops: dict[str, ClosedLoop] = {}
        judges = {name: Judge(name) for name in settings.methods}
        digest, render_seconds = hashlib.sha256(), 0.0
        paths = PathsPanel(640, 480, settings.methods)
        maker = _map_maker(simulator, settings) if settings.with_map else None
        video = Video(folder.path / "video.mp4", scenario, settings.methods) if settings.video else None
        for timed in rendered_ahead(simulator):
            sim_frame = timed.frame
            render_seconds += timed.seconds
            digest.update(sim_frame.rgb.tobytes())
            digest.update(sim_frame.depth_m.tobytes())
            frame = rgbd_frame_from_sim(sim_frame)
            oracle.show(frame.index, sim_frame.truth)
            if not loops:
                # The first true pose fixes the world of the estimates, as the alignment of a trajectory would.
                start = sim_frame.truth.T_world_camera
                chosen = get_profile(settings.profile)
                loops = {
                    name: closed_loop(METHODS[name](oracle, chosen), settings, frame, start)
                    for name in settings.methods
                }
            # Each method has its own state, so the order in which they are done cannot matter.
            steps = pool.map(lambda loop, now=frame: loop.step(now), loops.values())
            results = dict(zip(loops, steps, strict=True))
            for name, result in results.items():
                judges[name].see(sim_frame.truth, result, folder)
            if maker is not None:
                maker.see(sim_frame.truth, results)
            paths.add(sim_frame, results)
            if video is not None:
                video.add(sim_frame, results, paths)
            advance()
        if video is not None:
            video.close()
        slam_results = {name: loop.finish() for name, loop in loops.items()}
        of_maps = {} if maker is None else maker.finish(slam_results, folder)
        report = Report(
            scenario=scenario.name,
            seed=scenario.seed,
            frames=len(simulator),
            renderer=settings.renderer,
            segmenter=settings.segmenter,
            slam=settings.slam,
            profile=settings.profile,
            frame_hash=digest.hexdigest(),
            methods={name: judge.report(slam_results[name], of_maps.get(name)) for name, judge in judges.items()},
            time_ms=WorldTimes(render=1e3 * render_seconds / len(simulator)),
        )
        folder.write("trajectory_truth.txt", format_trajectory(judges[settings.methods[0]].truth_trajectory()))
        for name, judge in judges.items():
            folder.write(f"trajectory_{name}.txt", format_trajectory(judge.estimated_trajectory()))
            folder.write(f"trajectory_{name}_optimised.txt", format_trajectory(slam_results[name].trajectory))
        write_picture(folder.path / "trajectories.png", paths.draw())
        folder.write("versions.json", json.dumps(versions(), indent=2) + "\n")
        folder.write("report.json", report.to_json())
    return report


def _map_maker(simulator: Simulator, settings: RunSettings) -> "MapMaker":
    from scenarios.mapping import MapMaker  # loads what is needed by those who want a map alone
    from scenarios.static_world import StaticWorld

    return MapMaker(settings.methods, StaticWorld(simulator.scene, simulator.camera), MappingSettings())


def closed_loop(front_end: FrontEnd, settings: RunSettings, first: RgbdFrame, T_world_camera: FloatArray) -> ClosedLoop:
    """The front end in a loop with the SLAM of the settings.

    Args:
        front_end: what masks the depth.
        settings: how the scenario is run.
        first: the first frame.
        T_world_camera: (4, 4) its true pose, which fixes the world of the estimates.
    """
    return ClosedLoop(front_end, EmbeddedSlam(first.intrinsics, T_world_camera), settings.pose_feedback, T_world_camera)


@contextmanager
def one_opencv_thread() -> Iterator[None]:
    """OpenCV's own threads are off inside the block: the methods and the renderer keep the cores busy already."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)
