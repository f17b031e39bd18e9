"""SLAM against real RTAB-Map on the same masked frames, and the whole closed loop. Prints a table in Markdown.

    python -m benchmarks.slam [--frames 300] [--write docs/slam.md]

Both are given the same images with the true masks of all objects of interest. CPU time is that of one thread, and that
of all threads of RTAB-Map's own process. Where RTAB-Map cannot run, its rows say why.
"""

import argparse
import resource
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from dotmask.errors import SlamError
from dotmask.evaluation.trajectory import absolute_trajectory_error
from dotmask.interfaces import SlamBackend
from dotmask.pipeline import MaskAll
from dotmask.profiles import CALIBRATED
from dotmask.records import FloatArray, MaskedDepth, RgbdFrame, Trajectory
from dotmask.slam.embedded import EmbeddedSlam
from dotmask.slam.rtabmap.backend import RtabmapSlam
from dotmask.slam.rtabmap.library import core
from dotmask.slam.rtabmap.settings import rtabmap_settings
from scenarios.oracle import OracleSegmenter
from scenarios.registry import scenario
from scenarios.run import RunSettings, one_opencv_thread, run
from scenarios.sources import Simulated
from scenarios.spec import with_overrides
from sim.records import GroundTruth
from tools.doc_block import markdown_table, write_block

SCENARIO = "fr3_walking_xyz"
WARM_UP_FRAMES = 5
ODOMETRY_BUDGET_MS, KEYFRAME_BUDGET_MS, LOOP_BUDGET_HZ, MEMORY_BUDGET_MB = 20.0, 20.0, 20.0, 1000.0
COMMAND = "python -m benchmarks.slam --write docs/slam.md"
HEADER = ["SLAM", "odometry, CPU ms", "keyframe, CPU ms", "ATE of odometry, mm", "ATE optimised, mm"]


class _Contender:
    """One back end, and what it took."""

    def __init__(self, name: str, slam: SlamBackend) -> None:
        self.name, self._slam = name, slam
        self._odometry_s: list[float] = []
        self._keyframe_s: list[float] = []
        self._poses: list[tuple[float, FloatArray]] = []

    def see(self, frame: RgbdFrame, masked: MaskedDepth) -> None:
        start = self._clock()
        pose = self._slam.track(frame, masked)
        tracked = self._clock()
        before = self._mapped() if frame.index else None
        self._slam.update_map(frame, masked)
        if pose.T_world_camera is not None:
            self._poses.append((frame.timestamp_s, pose.T_world_camera))
        if frame.index >= WARM_UP_FRAMES:
            self._odometry_s.append(tracked - start)
            if self._mapped() != before:
                self._keyframe_s.append(self._clock() - tracked)

    def _clock(self) -> float:
        return time.thread_time() + self._elsewhere()  # another thread renders meanwhile

    def _elsewhere(self) -> float:
        return self._slam.cpu_elsewhere_s if isinstance(self._slam, RtabmapSlam) else 0.0

    def _mapped(self) -> object:
        """Something that differs when the map has got a new keyframe; RTAB-Map is asked then alone."""
        return self._slam.keyframes[-1].number if isinstance(self._slam, EmbeddedSlam) else self._elsewhere()

    def row(self, truth: Trajectory) -> list[str]:
        online = Trajectory.from_poses(self._poses)
        errors = [absolute_trajectory_error(truth, t) for t in (online, self._slam.finish().trajectory)]
        return [
            self.name,
            _quartiles(self._odometry_s),
            _quartiles(self._keyframe_s),
            *("-" if error is None else f"{1e3 * error.rmse_m:.1f} / {error.poses} poses" for error in errors),
        ]


def _quartiles(seconds: list[float]) -> str:
    if not seconds:
        return "-"  # so few frames hold no keyframe
    low, middle, high = 1e3 * np.percentile(seconds, [25, 50, 75])
    return f"{middle:.1f} ({low:.1f} to {high:.1f})"


def compare(frames: int) -> str:
    """The table of back ends."""
    source = Simulated(with_overrides(scenario(SCENARIO), {"frames": str(frames)}), "numba", 1)
    assert source.oracle is not None
    front_end = MaskAll(source.oracle, CALIBRATED)
    contenders: list[_Contender] = []
    truth: list[tuple[float, FloatArray]] = []
    missing: list[list[str]] = []
    with tempfile.TemporaryDirectory(prefix="dotmask-benchmark-") as folder, one_opencv_thread():
        for frame, true in _frames(source, source.oracle):
            if not contenders:
                contenders.append(_Contender("embedded", EmbeddedSlam(frame.intrinsics, true.T_world_camera)))
                for name in ("default", "refined"):
                    try:
                        settings = rtabmap_settings(name, (), core())
                        files = (Path(folder) / f"{name}.{kind}" for kind in ("db", "log"))
                        slam = RtabmapSlam(frame.intrinsics, true.T_world_camera, settings, *files)
                        contenders.append(_Contender(f"RTAB-Map, {name}", slam))
                    except SlamError as error:
                        missing.append([f"RTAB-Map, {name}", f"not measured: {error}", "", "", ""])
            masked = front_end.step(frame, true.T_world_camera).masked
            truth.append((frame.timestamp_s, true.T_world_camera))
            for contender in contenders:
                contender.see(frame, masked)
        known = Trajectory.from_poses(truth)
        rows = [contender.row(known) for contender in contenders]
    budget = ["budget", f"{ODOMETRY_BUDGET_MS:.0f}", f"{KEYFRAME_BUDGET_MS:.0f}", "", ""]
    return (
        f"`{SCENARIO}`, {frames} frames, all objects of interest masked; median (middle half):\n\n"
        f"{markdown_table(HEADER, [*rows, *missing, budget])}"
    )


def _frames(source: Simulated, oracle: OracleSegmenter) -> Iterator[tuple[RgbdFrame, GroundTruth]]:
    for timed in source.frames():
        frame, truth = timed.frame.frame, timed.frame.truth
        assert isinstance(truth, GroundTruth)
        oracle.show(frame.index, truth)
        yield frame, truth


def closed_loop(frames: int) -> str:
    """A line on the closed loop, from rendering to the report, and one on its memory."""
    peak_mb: list[float] = []
    chosen = with_overrides(scenario(SCENARIO), {"frames": str(frames)})
    with tempfile.TemporaryDirectory(prefix="dotmask-benchmark-") as folder:
        start = time.perf_counter()
        run(
            chosen,
            RunSettings.parse(methods="dotmask"),
            Path(folder) / "run",
            lambda: peak_mb.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10),
        )
        seconds = time.perf_counter() - start
    third = frames // 3
    return (
        f"The closed loop, rendering to report, `dotmask` alone, two threads: {frames / seconds:.1f} frames per second "
        f"on the clock (budget: at least {LOOP_BUDGET_HZ:.0f}). "
        f"Peak memory of the process after {third}, {2 * third} and {frames} frames: "
        f"{peak_mb[third - 1]:.0f}, {peak_mb[2 * third - 1]:.0f} and {peak_mb[-1]:.0f} MB "
        f"(budget: below {MEMORY_BUDGET_MB:.0f})."
    )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--write", type=Path, metavar="PAGE", help="put the table into this page")
    options = parser.parse_args()
    text = f"{compare(options.frames)}\n\n{closed_loop(options.frames)}"
    print(text)
    if options.write:
        write_block(options.write, "speed", COMMAND, text)


if __name__ == "__main__":
    main()
