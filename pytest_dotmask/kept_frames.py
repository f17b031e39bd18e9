"""The frames of a scenario, made once for all runs on them while they fit into memory."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from scenarios.faults.chain import Faults
from scenarios.oracle import OracleSegmenter
from scenarios.run_folder import RunFolder
from scenarios.sources import Simulated, SourceFrame, Timed
from scenarios.spec import Scenario
from sim.records import GroundTruth

if TYPE_CHECKING:
    from scenarios.static_world import StaticWorld

MOST_BYTES = 512 * 2**20
"""Frames of a scenario that need more are made anew for every run: a minute of 320x240, seconds of 640x480."""


class KeptFrames:
    """The frames of a scenario.

    Args:
        scenario: what happens.
        threads: that a run uses, see `Simulated`.
    """

    def __init__(self, scenario: Scenario, threads: int) -> None:
        self.scenario, self.threads = scenario, threads
        self.simulated = Simulated(scenario, "numba", threads)
        self._kept: list[Timed[SourceFrame]] = []

    def frames(self) -> Iterator[Timed[SourceFrame]]:
        """All frames in the order of time."""
        if self._kept:
            yield from self._kept
            return
        made: list[Timed[SourceFrame]] = []
        for timed in self.simulated.frames():
            if len(self.simulated) * _bytes(timed.frame) <= MOST_BYTES:
                made.append(timed)
            yield timed
        self._kept = made

    def source(self) -> "KeptSource":
        """The frames for one run."""
        return KeptSource(self)


class KeptSource:
    """Kept frames as the source of one run; see `scenarios.sources.Source`.

    Args:
        kept: the frames.
    """

    def __init__(self, kept: KeptFrames) -> None:
        self._kept, simulated = kept, kept.simulated
        self.name: str = simulated.name
        self.seed: int | None = simulated.seed
        self.renderer: str | None = simulated.renderer
        self.frame_rate_hz: float = simulated.frame_rate_hz
        # The oracle's faults remember the frames before: each run has its own.
        self.oracle: OracleSegmenter | None = OracleSegmenter(Faults(kept.scenario))

    def __len__(self) -> int:
        """Number of frames."""
        return len(self._kept.simulated)

    def frames(self) -> Iterator[Timed[SourceFrame]]:
        """See `Source`."""
        return self._kept.frames()

    def static_world(self) -> "StaticWorld":
        """See `Source`."""
        return self._kept.simulated.static_world()

    def describe(self, folder: RunFolder) -> None:
        """See `Source`."""
        self._kept.simulated.describe(folder)


def _bytes(frame: SourceFrame) -> int:
    of_truth = (frame.truth.depth_m, frame.truth.instance_ids) if isinstance(frame.truth, GroundTruth) else ()
    return frame.frame.rgb.nbytes + frame.frame.depth_m.nbytes + sum(image.nbytes for image in of_truth)
