"""Runs of several contenders on the same rendered frames, each in closed loop with odometry of its own."""

import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from dotmask.pipeline import ClosedLoop, DotMask, FrameResult
from dotmask.profiles import PROFILES, PoseFeedback, Profile
from dotmask.slam.embedded import EmbeddedSlam
from scenarios.bridge import rgbd_frame_from_sim
from scenarios.judge import Judge
from scenarios.oracle import OracleSegmenter
from scenarios.registry import scenario as scenario_by_name
from scenarios.report import MethodReport
from scenarios.run import one_opencv_thread, rendered_ahead
from scenarios.run_folder import RunFolder
from scenarios.spec import Scenario, with_overrides
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
    """

    profile: Profile
    pose_feedback: PoseFeedback


def all_profiles() -> dict[str, Contender]:
    """Every profile, with its own pose feedback; the best last."""
    return {p.name: Contender(profile=p, pose_feedback=p.pose_feedback) for p in PROFILES}


def play(
    simulator: Simulator, contenders: Mapping[str, Contender], advance: Callable[[], None]
) -> Iterator[tuple[SimFrame, dict[str, FrameResult]]]:
    """Each frame with what each contender made of it.

    Args:
        simulator: renders the frames.
        contenders: by name.
        advance: called after every frame.
    """
    oracle = OracleSegmenter()
    loops: dict[str, ClosedLoop] = {}
    with one_opencv_thread():
        for timed in rendered_ahead(simulator):
            frame, truth = rgbd_frame_from_sim(timed.frame), timed.frame.truth
            oracle.show(frame.index, truth)
            if not loops:
                start = truth.T_world_camera
                loops = {
                    name: ClosedLoop(
                        DotMask(oracle, contender.profile),
                        EmbeddedSlam(frame.intrinsics, start),
                        contender.pose_feedback,
                        start,
                    )
                    for name, contender in contenders.items()
                }
            yield timed.frame, {name: loop.step(frame) for name, loop in loops.items()}
            advance()


def judged(
    scenario: Scenario, contenders: Mapping[str, Contender], advance: Callable[[], None]
) -> dict[str, MethodReport]:
    """The report on each contender."""
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

    def reports(self, name: str) -> dict[str, MethodReport]:
        """The report on each profile."""
        if name not in self._reports:
            self._reports[name] = judged(self.shortened(scenario_by_name(name)), all_profiles(), self._advance)
        return self._reports[name]

    def shortened(self, scenario: Scenario) -> Scenario:
        """`scenario` with no more frames than are wanted."""
        return with_overrides(scenario, {"frames": str(min(self.frames, scenario.frames))})
