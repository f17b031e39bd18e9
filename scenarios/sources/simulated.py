"""Frames of a scenario, rendered as they are asked for."""

from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING

from scenarios.bridge import rgbd_frame_from_sim
from scenarios.faults.chain import Faults
from scenarios.oracle import OracleSegmenter
from scenarios.run_folder import RunFolder
from scenarios.sources.ahead import FRAMES_AHEAD, Timed, made_ahead
from scenarios.sources.source import SourceFrame
from scenarios.spec import Scenario
from scenarios.world import build_simulator
from sim.simulator import Simulator

if TYPE_CHECKING:
    from scenarios.static_world import StaticWorld


class Simulated:
    """A scenario as a source of frames; see `Source`.

    Args:
        scenario: what happens.
        renderer: name of the renderer.
        threads: that the run uses: one is left to the methods; with 1 nothing is rendered ahead either.
    """

    def __init__(self, scenario: Scenario, renderer: str, threads: int) -> None:
        self._scenario, self._threads = scenario, threads
        self.name: str = scenario.name
        self.seed: int | None = scenario.seed
        self.renderer: str | None = renderer
        self.frame_rate_hz: float = scenario.frame_rate_hz
        self.oracle: OracleSegmenter | None = OracleSegmenter(Faults(scenario))

    @cached_property
    def _simulator(self) -> Simulator:
        assert self.renderer is not None
        return build_simulator(self._scenario, self.renderer, max(self._threads - 1, 1))

    def __len__(self) -> int:
        """Number of frames."""
        return len(self._simulator)

    def frames(self) -> Iterator[Timed[SourceFrame]]:
        """See `Source`.

        Raises:
            SimError, ScenarioError: the scenario's world cannot be built.
        """
        simulator = self._simulator

        def make(index: int) -> SourceFrame:
            frame = simulator.frame(index)
            return SourceFrame(frame=rgbd_frame_from_sim(frame), truth=frame.truth)

        return made_ahead(make, range(len(self)), 0 if self._threads == 1 else FRAMES_AHEAD)

    def static_world(self) -> "StaticWorld":
        """The scene without all that can move."""
        from scenarios.static_world import StaticWorld  # loads what is needed by those who want a map alone

        return StaticWorld(self._simulator.scene, self._simulator.camera)

    def describe(self, folder: RunFolder) -> None:
        """Write `scenario.json`, which `--from` repeats."""
        folder.write("scenario.json", self._scenario.to_json())
