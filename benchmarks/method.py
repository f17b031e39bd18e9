"""The method against a literal transcription of the paper (`benchmarks.literal_paper`). Prints a table in Markdown.

    python -m benchmarks.method [--frames 120] [--write]

All are given the same recorded frames, masks and camera poses, one frame after the other in turn, so that the machine's
load is the same for each. Before each turn the frame is read once: whoever delivers it has just written it, so that no
method may be charged for fetching it from memory. A processor may still keep only what is read a second time, so each
frame begins with another method. Nothing is segmented. CPU time of one thread.
"""

import argparse
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.literal_paper import LiteralDotMask
from dotmask.pipeline import DotMask
from dotmask.profiles import CALIBRATED, PAPER, Profile
from dotmask.records import Detections, FloatArray, RgbdFrame
from dotmask.segmentation.selection import select_detections
from scenarios.bridge import rgbd_frame_from_sim
from scenarios.oracle import OracleSegmenter
from scenarios.registry import scenario
from scenarios.run import one_opencv_thread
from scenarios.spec import Scenario, ThingSpec
from scenarios.world import build_simulator
from tools.doc_block import markdown_table, write_block

PAGE = Path("docs/design.md")
COMMAND = "python -m benchmarks.method --write"
WARM_UP_FRAMES = 5
FIRST_FRAME = 264
"""From here on all five objects are seen for six seconds."""
BUDGET_MS, TARGET_RATIO = 3.0, 10.0
STAGES = ("track", "classify", "mask")


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """One frame as every method is given it; `detections` are as the segmentation stage hands them over."""

    frame: RgbdFrame
    detections: Detections
    T_world_camera: FloatArray

    def fetch(self) -> None:
        """Read every image once."""
        for image in (self.frame.rgb, self.frame.depth_m, self.detections.masks):
            image.max()


class Playback:
    """A segmenter that answers at once with what was recorded."""

    def __init__(self, recorded: list[Recorded]) -> None:
        self._detections = {r.frame.index: r.detections for r in recorded}

    def segment(self, frame: RgbdFrame) -> Detections:
        """See `dotmask.interfaces.Segmenter`."""
        return self._detections[frame.index]


@dataclass(slots=True)
class Spent:
    """CPU seconds of one method, one number a frame."""

    whole: list[float] = field(default_factory=list)
    stages: dict[str, list[float]] = field(default_factory=lambda: {stage: [] for stage in STAGES})

    def add(self, whole: float, stages: dict[str, float]) -> None:
        """One more frame."""
        self.whole.append(whole)
        for stage in STAGES:
            self.stages[stage].append(stages[stage])


class Ours:
    """DotMask of a profile, on recorded detections."""

    def __init__(self, profile: Profile, recorded: list[Recorded], *, is_refined: bool) -> None:
        self.name = f"ours, profile `{profile.name}`" + (", with `refine`" if is_refined else "")
        self._method, self._is_refined = DotMask(Playback(recorded), profile), is_refined

    def step(self, recorded: Recorded) -> dict[str, float]:
        """Process one frame; CPU seconds by stage."""
        result = self._method.step(recorded.frame, recorded.T_world_camera)
        if self._is_refined:
            result = self._method.refine(recorded.T_world_camera)
        return result.stage_seconds


class Literal:
    """The transcription."""

    name = "the paper, transcribed literally"

    def __init__(self) -> None:
        self._method = LiteralDotMask(PAPER)

    def step(self, recorded: Recorded) -> dict[str, float]:
        """Process one frame; CPU seconds by stage."""
        clock = [time.thread_time()]
        self._method.track(recorded.frame, recorded.detections, recorded.T_world_camera)
        clock.append(time.thread_time())
        self._method.classify()
        clock.append(time.thread_time())
        self._method.mask(recorded.frame.depth_m, recorded.detections)
        clock.append(time.thread_time())
        return dict(zip(STAGES, np.diff(clock), strict=True))


def five_objects() -> Scenario:
    """The office with two walking people and three chairs."""
    office = scenario("fr3_walking_xyz")
    chair = ThingSpec(name="chair_middle", kind="chair", look="red", position_m=(0.0, 0.6, 0.0), heading_deg=200)
    return office.model_copy(update={"things": (*office.things, chair)})


def record(frames: int) -> list[Recorded]:
    """`frames` frames of the scenario, from `FIRST_FRAME` on."""
    simulator, oracle = build_simulator(five_objects(), "numba", 1), OracleSegmenter()
    recorded = []
    for index in range(FIRST_FRAME, FIRST_FRAME + frames):
        sim_frame = simulator.frame(index)
        frame = rgbd_frame_from_sim(sim_frame)
        oracle.show(index, sim_frame.truth)
        detections = select_detections(oracle.segment(frame), CALIBRATED)
        recorded.append(Recorded(frame=frame, detections=detections, T_world_camera=sim_frame.truth.T_world_camera))
    return recorded


def measure(recorded: list[Recorded]) -> dict[str, Spent]:
    """What each method spends, by name; the transcription comes last."""
    methods: list[Ours | Literal] = [
        *(Ours(profile, recorded, is_refined=refined) for profile in (PAPER, CALIBRATED) for refined in (False, True)),
        Literal(),
    ]
    spent = {method.name: Spent() for method in methods}
    with one_opencv_thread():
        for index, frame in enumerate(recorded):
            first = index % len(methods)
            for method in methods[first:] + methods[:first]:
                frame.fetch()
                start = time.process_time()
                stages = method.step(frame)
                whole = time.process_time() - start
                if index >= WARM_UP_FRAMES:
                    spent[method.name].add(whole, stages)
    return spent


def table(recorded: list[Recorded], spent: dict[str, Spent]) -> str:
    """The table, with a line above it that says what was measured."""
    kept = recorded[WARM_UP_FRAMES:]
    height, width = kept[0].frame.depth_m.shape
    objects = np.mean([len(r.detections) for r in kept])
    literal = float(np.median(spent[Literal.name].whole))
    rows = []
    for name, times in spent.items():
        low, middle, high = 1e3 * np.percentile(times.whole, [25, 50, 75])
        stages = [f"{1e3 * np.median(times.stages[stage]):.2f}" for stage in STAGES]
        is_ours = name != Literal.name
        ratio = f"{1e3 * literal / middle:.1f}" if is_ours else "1"
        target = f"at most {BUDGET_MS:.0f} ms, at least {TARGET_RATIO:.0f} times faster" if is_ours else ""
        rows.append([name, *stages, f"{middle:.2f} ({low:.2f} to {high:.2f})", ratio, target])
    header = ["method", *STAGES, "CPU ms (middle half)", "times faster", "target"]
    intro = f"{width}x{height}, {len(kept)} frames of {objects:.1f} objects of interest, one thread, CPU ms per frame:"
    return f"{intro}\n\n{markdown_table(header, rows)}"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=120, help="that are measured, at most 180")
    parser.add_argument("--write", action="store_true", help=f"put the table into {PAGE}")
    options = parser.parse_args()
    recorded = record(min(options.frames, 180) + WARM_UP_FRAMES)
    text = table(recorded, measure(recorded))
    print(text)
    if options.write:
        write_block(PAGE, "speed", COMMAND, text)


if __name__ == "__main__":
    main()
