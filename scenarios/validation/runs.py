"""Runs of several contenders on the same rendered frames, each in closed loop with odometry of its own."""

import os
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from dotmask.pipeline import ClosedLoop, FrameResult
from dotmask.profiles import PROFILES, PoseFeedback, Profile
from dotmask.slam.embedded import EmbeddedSlam
from scenarios.bridge import rgbd_frame_from_sim
from scenarios.faults.chain import Faults
from scenarios.judge import Judge
from scenarios.oracle import OracleSegmenter
from scenarios.registry import RENDERED_AS
from scenarios.registry import scenario as scenario_by_name
from scenarios.report import MethodReport
from scenarios.run import METHODS, one_opencv_thread
from scenarios.run_folder import RunFolder
from scenarios.sources import rendered_ahead
from scenarios.spec import Scenario, first_frames
from scenarios.world import build_simulator
from sim.records import SimFrame
from sim.simulator import Simulator

THREADS = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Contender:
    """The method with one set of parameters.

    Attributes:
        profile: parameters.
        pose_feedback: camera pose for the tracker.
        scenario: whose faults its segmenter has; None: none.
    """

    profile: Profile
    pose_feedback: PoseFeedback
    scenario: Scenario | None = None


def all_profiles(scenario: Scenario | None = None) -> dict[str, Contender]:
    """Every profile, with its own pose feedback, by name; the segmenter has the faults of `scenario`."""
    return {p.name: Contender(profile=p, pose_feedback=p.pose_feedback, scenario=scenario) for p in PROFILES}


def play(
    simulator: Simulator, contenders: Mapping[str, Contender], advance: Callable[[], None]
) -> Iterator[tuple[SimFrame, dict[str, FrameResult]]]:
    """Each frame with what each contender made of it.

    Args:
        simulator: renders the frames.
        contenders: by name.
        advance: called after every frame.
    """
    oracles = {
        name: OracleSegmenter() if c.scenario is None else OracleSegmenter(Faults(c.scenario))
        for name, c in contenders.items()
    }
    loops: dict[str, ClosedLoop] = {}
    with one_opencv_thread(), ThreadPoolExecutor(os.cpu_count()) as pool:
        for timed in rendered_ahead(simulator):
            frame, truth = rgbd_frame_from_sim(timed.frame), timed.frame.truth
            for oracle in oracles.values():
                oracle.show(frame.index, truth)
            if not loops:
                start = truth.T_world_camera
                loops = {
                    name: ClosedLoop(
                        METHODS["dotmask"](oracles[name], contender.profile),
                        EmbeddedSlam(frame.intrinsics, start),
                        contender.pose_feedback,
                        start,
                    )
                    for name, contender in contenders.items()
                }
            # Each contender has its own state, so the order in which they are done cannot matter.
            steps = pool.map(lambda loop, now=frame: loop.step(now), loops.values())
            yield timed.frame, dict(zip(loops, steps, strict=True))
            advance()


def judged(
    scenario: Scenario, contenders: Mapping[str, Contender], advance: Callable[[], None]
) -> dict[str, MethodReport]:
    """The report on each contender, on the frames of `scenario`."""
    judges = {name: Judge(name) for name in contenders}
    simulator = build_simulator(scenario, "numba", THREADS)
    with tempfile.TemporaryDirectory() as parent, RunFolder(Path(parent) / "run") as folder:
        for sim_frame, results in play(simulator, contenders, advance):
            for name, result in results.items():
                judges[name].see(sim_frame.truth, result, folder)
    return {name: judge.report() for name, judge in judges.items()}


class Runs:
    """Runs of named scenarios with all profiles; each is made once, for all sections.

    Args:
        frames: at most so many of each scenario.
        advance: called after every frame.
    """

    def __init__(self, frames: int, advance: Callable[[], None]) -> None:
        self.frames = frames
        self._advance = advance
        self._reports: dict[str, dict[str, MethodReport]] = {}

    def reports(self, names: Sequence[str]) -> dict[str, dict[str, MethodReport]]:
        """By scenario the report on each profile. Scenarios that differ in their faults alone are rendered once."""
        missing = [name for name in names if name not in self._reports]
        for rendered in dict.fromkeys(RENDERED_AS[name] for name in missing):
            alike = [scenario_by_name(name) for name in missing if RENDERED_AS[name] == rendered]
            scenarios = [first_frames(scenario, self.frames) for scenario in alike]
            contenders = {
                f"{scenario.name}/{profile}": contender
                for scenario in scenarios
                for profile, contender in all_profiles(scenario).items()
            }
            found = judged(scenarios[0], contenders, self._advance)
            for scenario in scenarios:
                self._reports[scenario.name] = {p.name: found[f"{scenario.name}/{p.name}"] for p in PROFILES}
        return {name: self._reports[name] for name in names}
