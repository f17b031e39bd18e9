"""What is run for the tables: the paper's six sequences, all methods, the back end as often as it needs."""

from dataclasses import asdict, dataclass
from typing import Any

from scenarios.errors import ScenarioError
from scenarios.registry import scenario
from scenarios.run import RunSettings
from scenarios.spec import Scenario, with_overrides
from scenarios.tables.paper import TABLE_II

SEQUENCES = tuple(TABLE_II)
QUICK_FRAMES = 150
"""Frames of each sequence with `--quick`."""

REPEATS = {"rtabmap": 5}
"""Runs of each sequence by SLAM back end; 1 where the same input gives the same result."""

NO_INFLUENCE = ("threads", "video")
"""Settings that change no figure but times."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TablePlan:
    """Run settings times sequences times repeats.

    Attributes:
        settings: of every run; its methods are those of the tables.
        repeats: how often each sequence is run.
        frames: only the first so many of each sequence; None for all.
        sequences: names of scenarios, in the order of the tables.
    """

    settings: RunSettings
    repeats: int
    frames: int | None = None
    sequences: tuple[str, ...] = SEQUENCES

    @classmethod
    def parse(cls, settings: RunSettings, *, repeats: int | None = None, is_quick: bool = False) -> "TablePlan":
        """The plan of the command line.

        Args:
            settings: of every run.
            repeats: None for as many as the back end needs.
            is_quick: whether to run the first frames only.

        Raises:
            ScenarioError: fewer than one repeat.
        """
        chosen = REPEATS.get(settings.slam, 1) if repeats is None else repeats
        if chosen < 1:
            raise ScenarioError(f"--repeat {repeats}: run each sequence at least once")
        return cls(settings=settings, repeats=chosen, frames=QUICK_FRAMES if is_quick else None)

    @property
    def back_end(self) -> str:
        """Names the section of the page that the plan's results are in."""
        return self.settings.slam

    def scenarios(self) -> tuple[Scenario, ...]:
        """The sequences, cut to their first frames where the plan says so."""
        whole = [scenario(name) for name in self.sequences]
        if self.frames is None:
            return tuple(whole)
        return tuple(with_overrides(one, {"frames": str(min(self.frames, one.frames))}) for one in whole)

    def total_frames(self) -> int:
        """Frames of all runs."""
        return self.repeats * sum(one.frames for one in self.scenarios())

    def figure_settings(self) -> dict[str, Any]:
        """The settings that decide the figures, by name."""
        return {name: value for name, value in asdict(self.settings).items() if name not in NO_INFLUENCE}
