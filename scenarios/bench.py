"""What `dotmask bench` measures: CPU time by stage on one core, against the budgets of the design."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from rich.table import Table

from dotmask.pipeline import DotMask
from dotmask.profiles import profile
from dotmask.slam.embedded import EmbeddedSlam
from scenarios.bridge import intrinsics_from_camera, rgbd_frame_from_sim
from scenarios.oracle import OracleSegmenter
from scenarios.registry import scenario
from scenarios.run import one_opencv_thread
from scenarios.world import build_simulator

SCENARIO = "fr3_walking_xyz"
WARM_UP_FRAMES = 3

BUDGETS_MS = {"render": 30.0, "truth and sensor": 12.0, "method without segmentation": 3.0, "odometry": 20.0}
"""CPU milliseconds per frame at 640x480. The method is all from observing the detections to the masked depth."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """CPU time of one stage: median and 95th percentile, milliseconds per frame."""

    stage: str
    median_ms: float
    p95_ms: float


def measure(frames: int, advance: Callable[[], None]) -> list[Timing]:
    """Time every stage over `frames` frames of the office with two walking people, one thread.

    OpenCV's own threads are switched off for the time of the measurement.
    """
    with one_opencv_thread():
        return _measure(frames, advance)


def _measure(frames: int, advance: Callable[[], None]) -> list[Timing]:
    simulator = build_simulator(scenario(SCENARIO), "numba", 1)
    oracle = OracleSegmenter()
    method = DotMask(oracle, profile("calibrated"))
    seconds: dict[str, list[float]] = {stage: [] for stage in BUDGETS_MS}
    slam = EmbeddedSlam(intrinsics_from_camera(simulator.camera), simulator.frame(0).truth.T_world_camera)
    for index in range(frames + WARM_UP_FRAMES):
        clock = [time.process_time()]
        simulator.render(index)
        clock.append(time.process_time())
        sim_frame = simulator.frame(index)
        clock.append(time.process_time())
        frame = rgbd_frame_from_sim(sim_frame)
        oracle.show(frame.index, sim_frame.truth)
        clock.append(time.process_time())
        result = method.step(frame, sim_frame.truth.T_world_camera)
        clock.append(time.process_time())
        slam.track(frame, result.masked)
        clock.append(time.process_time())
        render, whole_frame, _, step, odometry = np.diff(clock)
        if index >= WARM_UP_FRAMES:
            spent = (render, whole_frame - render, step - result.stage_seconds["segment"], odometry)
            for stage, value in zip(BUDGETS_MS, spent, strict=True):
                seconds[stage].append(float(value))
        advance()
    return [
        Timing(stage=stage, median_ms=1e3 * float(np.median(v)), p95_ms=1e3 * float(np.percentile(v, 95)))
        for stage, v in seconds.items()
    ]


def bench_table(quick: bool, advance: Callable[[], None]) -> Table:
    """The table that `dotmask bench` prints."""
    frames = 40 if quick else 240
    drawn = Table(title=f"{SCENARIO}, 640x480, {frames} frames, one thread: CPU ms per frame", title_justify="left")
    for heading, side in (("stage", "left"), ("median", "right"), ("p95", "right"), ("budget", "right"), ("", "left")):
        drawn.add_column(heading, justify="left" if side == "left" else "right")
    for timing in measure(frames, advance):
        budget = BUDGETS_MS[timing.stage]
        verdict = "within" if timing.median_ms <= budget else "[bold red]over[/]"
        drawn.add_row(timing.stage, f"{timing.median_ms:.1f}", f"{timing.p95_ms:.1f}", f"{budget:.0f}", verdict)
    return drawn
