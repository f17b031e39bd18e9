"""Counterfactual triplets: a scenario as it is, with everything frozen, and without people, and what each costs."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Literal

from pydantic import Field
from rich.box import SIMPLE
from rich.table import Table

from scenarios.errors import ScenarioError
from scenarios.report import Measured, Part, Report, SegmenterReport
from scenarios.run import RunSettings, run
from scenarios.run_folder import RunFolder
from scenarios.segmenters import segmenter_report
from scenarios.spec import Scenario

World = Literal["empty", "frozen", "moving"]
WORLDS: tuple[World, ...] = ("empty", "frozen", "moving")
METHODS = ("unmasked", "mdi", "dotmask")


class Costs(Part):
    """Differences of two absolute trajectory errors, metres; positive = it does harm.

    Attributes:
        people_m: unmasked, frozen less empty: that people are there, though nothing moves.
        motion_m: unmasked, moving less frozen: that they and the things move.
        not_masking_m: unmasked, moving less empty: both together, what a mask could win at most.
        masking_all_m: frozen, mdi less unmasked: masking everybody where nobody moved.
        method_frozen_m: frozen, dotmask less unmasked: what the method costs where nothing moved.
        method_empty_m: empty, dotmask less unmasked: what it costs where there are no people.
        method_moving_m: dotmask moving less unmasked empty: what the method leaves of `not_masking_m`.
    """

    people_m: Measured
    motion_m: Measured
    not_masking_m: Measured
    masking_all_m: Measured
    method_frozen_m: Measured
    method_empty_m: Measured
    method_moving_m: Measured


class Triplet(Part):
    """`counterfactual.json`, schema 1.

    Attributes:
        ate_rmse_m: absolute trajectory error by world and method.
        costs: see Costs.
        flagged_frozen: share of the seen objects of interest, over all frames of the frozen world, that the method
            calls moving: all of them wrongly. Null when none was seen.
        waste_frozen: share of the static pixels that odometry lost to the method in the frozen world.
        frame_hashes: by world.
    """

    schema_version: int = Field(default=1, alias="schema")
    scenario: str
    seed: int
    frames: int
    segmenter: SegmenterReport
    slam: str
    profile: str
    pose_feedback: str
    ate_rmse_m: dict[World, dict[str, Measured]]
    costs: Costs
    flagged_frozen: Measured
    waste_frozen: Measured
    frame_hashes: dict[World, str]

    def to_json(self) -> str:
        """The text of `counterfactual.json`."""
        return self.model_dump_json(indent=2, by_alias=True) + "\n"


def run_triplet(scenario: Scenario, settings: RunSettings, out: Path, advance: Callable[[], None]) -> Triplet:
    """Run the three worlds of a scenario with the same camera and seed, each into a run folder inside `out`.

    Args:
        scenario: as it is, with variant "moving".
        settings: how it is run; the methods must be METHODS.
        out: a new or empty folder.
        advance: called after every frame of every world.

    Raises:
        ScenarioError, SimError, DotmaskError: bad input; nothing is left in `out`.
    """
    if scenario.variant != "moving":
        raise ScenarioError(
            f"counterfactual runs {', '.join(WORLDS)} by itself: leave variant={scenario.variant} out of the scenario"
        )
    with RunFolder(out) as folder:
        reports: dict[World, Report] = {}
        for world in WORLDS:
            varied = scenario.model_copy(update={"variant": world})
            reports[world] = run(varied, settings, folder.path / world, advance)
        ate = {
            world: {name: method.ate_rmse_m for name, method in report.methods.items()}
            for world, report in reports.items()
        }
        frozen = reports["frozen"].methods["dotmask"]
        triplet = Triplet(
            scenario=scenario.name,
            seed=scenario.seed,
            frames=reports["moving"].frames,
            segmenter=segmenter_report(settings.segmenter, settings.network),
            slam=settings.slam,
            profile=settings.profile,
            pose_feedback=settings.pose_feedback,
            ate_rmse_m=ate,
            costs=compare(ate),
            flagged_frozen=frozen.moc.idle_flag_rate,
            waste_frozen=frozen.masks.waste,
            frame_hashes={world: report.frame_hash for world, report in reports.items()},
        )
        folder.write("counterfactual.json", triplet.to_json())
    return triplet


def compare(ate_rmse_m: Mapping[World, Mapping[str, float | None]]) -> Costs:
    """The differences, null where an error was not measured."""

    def less(first: tuple[World, str], second: tuple[World, str]) -> float | None:
        a, b = ate_rmse_m[first[0]][first[1]], ate_rmse_m[second[0]][second[1]]
        return None if a is None or b is None else a - b

    return Costs(
        people_m=less(("frozen", "unmasked"), ("empty", "unmasked")),
        motion_m=less(("moving", "unmasked"), ("frozen", "unmasked")),
        not_masking_m=less(("moving", "unmasked"), ("empty", "unmasked")),
        masking_all_m=less(("frozen", "mdi"), ("frozen", "unmasked")),
        method_frozen_m=less(("frozen", "dotmask"), ("frozen", "unmasked")),
        method_empty_m=less(("empty", "dotmask"), ("empty", "unmasked")),
        method_moving_m=less(("moving", "dotmask"), ("empty", "unmasked")),
    )


def _number(value: float | None, scale: float, sign: str = "") -> str:
    return "-" if value is None else f"{round(value * scale, 2) + 0.0:{sign}.2f}"


def headline(triplet: Triplet) -> str:
    """What was run, in one line."""
    return (
        f"{triplet.scenario}, seed {triplet.seed}, {triplet.frames} frames: segmenter {triplet.segmenter.name}, "
        f"SLAM {triplet.slam}, profile {triplet.profile}, pose feedback {triplet.pose_feedback}"
    )


def ate_table(triplet: Triplet) -> Table:
    """The absolute trajectory errors: a row a world, a column a method."""
    drawn = Table(box=SIMPLE, padding=(0, 1, 0, 0), pad_edge=False)
    drawn.add_column("ATE, mm", no_wrap=True)
    for name in METHODS:
        drawn.add_column(name, justify="right", no_wrap=True)
    for world, errors in triplet.ate_rmse_m.items():
        drawn.add_row(world, *(_number(errors[name], 1e3) for name in METHODS))
    return drawn


def costs_table(triplet: Triplet) -> Table:
    """What each thing costs, and from which two errors that is."""
    costs = triplet.costs
    drawn = Table(box=SIMPLE, padding=(0, 1, 0, 0), pad_edge=False)
    for heading in ("what it costs", "from"):
        drawn.add_column(heading)
    drawn.add_column("mm", justify="right", no_wrap=True)
    for what, how, value in (
        ("people are there", "unmasked: frozen - empty", costs.people_m),
        ("they and things move", "unmasked: moving - frozen", costs.motion_m),
        ("not masking, both together", "unmasked: moving - empty", costs.not_masking_m),
        ("what the method leaves of that", "dotmask moving - unmasked empty", costs.method_moving_m),
        ("masking all, where nothing moved", "frozen: mdi - unmasked", costs.masking_all_m),
        ("the method, where nothing moved", "frozen: dotmask - unmasked", costs.method_frozen_m),
        ("the method, without people", "empty: dotmask - unmasked", costs.method_empty_m),
    ):
        drawn.add_row(what, how, _number(value, 1e3, "+"))
    return drawn


def false_alarms(triplet: Triplet) -> str:
    """What the method did in the frozen world, where every alarm is false, in one line."""
    return (
        f"frozen world: {_number(triplet.flagged_frozen, 100)} % of the objects called moving, "
        f"{_number(triplet.waste_frozen, 100)} % of the pixels lost"
    )
