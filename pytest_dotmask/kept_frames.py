"""The frames of scenarios, made once for all runs on them while they fit into memory."""

from collections.abc import Iterator

from scenarios.faults.chain import Faults
from scenarios.oracle import OracleSegmenter
from scenarios.run_folder import RunFolder
from scenarios.sources import Simulated, SourceFrame, Timed
from scenarios.spec import Scenario
from sim.records import GroundTruth

RENDERER = "numba"

MOST_BYTES = 512 * 2**20
"""Of all frames that are kept: twenty seconds of 320x240, a few of 640x480."""


class KeptFrames:
    """The frames of one scenario. Its world, which is ten times as large, is let go as soon as they are made.

    Args:
        scenario: what happens.
        threads: that a run uses, see `Simulated`.

    Attributes:
        count: of the frames, which are fewer than the scenario's where the sensor drops some; known when they are made.
        bytes: of the frames that are kept.
    """

    def __init__(self, scenario: Scenario, threads: int) -> None:
        self.scenario, self.threads = scenario, threads
        self.count: int | None = None
        self.bytes = 0
        self._kept: list[Timed[SourceFrame]] = []

    def frames(self) -> Iterator[Timed[SourceFrame]]:
        """All frames in the order of time: made, or as they were made before."""
        if self._kept:
            yield from self._kept
            return
        made: list[Timed[SourceFrame]] = []
        simulated = Simulated(self.scenario, RENDERER, self.threads)
        self.count = len(simulated)
        for timed in simulated.frames():
            if self.count * _bytes(timed.frame) <= MOST_BYTES:
                made.append(timed)
            yield timed
        self._kept, self.bytes = made, sum(_bytes(timed.frame) for timed in made)

    def source(self) -> "KeptSource":
        """The frames for one run."""
        return KeptSource(self)


class KeptSource:
    """Kept frames as the source of one run; see `scenarios.sources.Source`.

    Args:
        kept: the frames.
    """

    def __init__(self, kept: KeptFrames) -> None:
        self._kept, scenario = kept, kept.scenario
        self.name: str = scenario.name
        self.seed: int | None = scenario.seed
        self.renderer: str | None = RENDERER
        self.frame_rate_hz: float = scenario.frame_rate_hz
        # The oracle's faults remember the frames before: each run has its own.
        self.oracle: OracleSegmenter | None = OracleSegmenter(Faults(scenario))

    def __len__(self) -> int:
        """Number of frames, when they are made."""
        assert self._kept.count is not None
        return self._kept.count

    def frames(self) -> Iterator[Timed[SourceFrame]]:
        """See `Source`."""
        return self._kept.frames()

    def static_world(self) -> None:
        """Is not kept: these runs build no map."""
        return None

    def describe(self, folder: RunFolder) -> None:
        """Write `scenario.json`, which `dotmask run --from` repeats."""
        folder.write("scenario.json", self._kept.scenario.to_json())


class FrameStore:
    """The frames of the scenarios of a session; those that were used least lately make room for others.

    Args:
        threads: that a run uses, see `Simulated`.
    """

    def __init__(self, threads: int) -> None:
        self._threads = threads
        self._kept: dict[Scenario, KeptFrames] = {}

    def frames(self, scenario: Scenario) -> KeptFrames:
        """The frames of a scenario."""
        kept = self._kept.pop(scenario, None) or KeptFrames(scenario, self._threads)
        self._kept[scenario] = kept
        for other in list(self._kept)[:-1]:
            if sum(frames.bytes for frames in self._kept.values()) > MOST_BYTES:
                del self._kept[other]
        return kept


def _bytes(frame: SourceFrame) -> int:
    of_truth = (frame.truth.depth_m, frame.truth.instance_ids) if isinstance(frame.truth, GroundTruth) else ()
    return frame.frame.rgb.nbytes + frame.frame.depth_m.nbytes + sum(image.nbytes for image in of_truth)
