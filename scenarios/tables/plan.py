"""What is run for the tables: the paper's six sequences, all methods, the back end as often as it needs."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from scenarios.registry import scenario
from scenarios.run import METHODS as RUN_METHODS
from scenarios.run import RunSettings
from scenarios.spec import Scenario, first_frames
from scenarios.tables.paper import TABLE_II

SEQUENCES = tuple(TABLE_II)
QUICK_FRAMES = 150
"""Frames of each sequence with `--quick`."""

REPEATS = {"rtabmap": 5}
"""Runs of each sequence by SLAM back end; 1 where the same input gives the same result."""

METHODS = {"rtabmap": ("unmasked", "dotmask")}
"""Methods by SLAM back end; all where it is not named. RTAB-Map takes long, and `mdi` is not in the paper's tables."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TablePlan:
    """Run settings times sequences.

    Attributes:
        back_end: names the section of the page that the results are in.
        settings: of every run; every method is in them as often as it is run.
        methods: the methods, each once.
        repeats: how often each is run.
        frames: only the first so many of each sequence; None for all.
        sequences: names of scenarios, in the order of the tables.
    """

    back_end: str
    settings: RunSettings
    methods: tuple[str, ...]
    repeats: int
    frames: int | None = None
    sequences: tuple[str, ...] = SEQUENCES

    @classmethod
    def parse(
        cls,
        *,
        slam: str = "embedded",
        slam_parameters: str | None = None,
        slam_changes: Sequence[str] = (),
        segmenter: str = "oracle",
        weights: str | Path | None = None,
        device: str | None = None,
        profile: str = "calibrated",
        threads: int = 2,
        repeats: int | None = None,
        is_quick: bool = False,
    ) -> "TablePlan":
        """The plan of the command line; see `RunSettings.parse`.

        Raises:
            ScenarioError, DotmaskError: as `RunSettings.parse`.
        """
        chosen = REPEATS.get(slam, 1) if repeats is None else repeats
        methods = METHODS.get(slam, tuple(RUN_METHODS))
        settings = RunSettings.parse(
            methods=",".join(methods),
            segmenter=segmenter,
            weights=weights,
            device=device,
            slam=slam,
            slam_parameters=slam_parameters,
            slam_changes=slam_changes,
            profile=profile,
            threads=threads,
            repeats=chosen,
        )
        return cls(
            back_end="-".join(
                [
                    slam,
                    *([] if settings.rtabmap is None else [slam_parameters or "default"]),
                    *([] if segmenter == "oracle" else [segmenter.replace(":", ".")]),
                ]
            ),
            settings=settings,
            methods=methods,
            repeats=chosen,
            frames=QUICK_FRAMES if is_quick else None,
        )

    def scenarios(self) -> tuple[Scenario, ...]:
        """The sequences, cut to their first frames where the plan says so."""
        return tuple(first_frames(scenario(name), self.frames) for name in self.sequences)

    def total_frames(self) -> int:
        """Frames of all runs."""
        return sum(one.frames for one in self.scenarios())
