"""`attribution.json`, schema 1, and the table that people read."""

from collections.abc import Mapping

from pydantic import Field
from rich.box import SIMPLE
from rich.table import Table

from scenarios.attribution.variants import ALL_TRUE, BASELINE, STAGES, all_but, only
from scenarios.report import Measured, MethodReport, Part, SegmenterReport


class Figures(Part):
    """The figures that blame is measured in, or differences of them.

    Attributes:
        ate_rmse_m: absolute trajectory error.
        moc_error: share of wrong verdicts (missed movers and false flags) among the objects of interest that were seen.
        leak: share of the moving objects' pixels that odometry still sees.
    """

    ate_rmse_m: Measured = None
    moc_error: Measured = None
    leak: Measured = None

    def __sub__(self, other: "Figures") -> "Figures":
        """The difference, null where either was not measured."""
        return self._combined(other, -1.0)

    def __add__(self, other: "Figures") -> "Figures":
        """The sum, null where either was not measured."""
        return self._combined(other, 1.0)

    def _combined(self, other: "Figures", sign: float) -> "Figures":
        combined = {}
        for name in Figures.model_fields:
            mine, theirs = getattr(self, name), getattr(other, name)
            combined[name] = None if mine is None or theirs is None else mine + sign * theirs
        return Figures(**combined)


class Blame(Part):
    """What one stage is to blame for; positive = it does harm.

    Attributes:
        gain: baseline, less this stage alone true: what repairing it alone gains.
        cost: all but this stage true, less all true: what its errors alone cost.
    """

    gain: Figures
    cost: Figures


class Correlation(Part):
    """How the odometry's error of a step goes with the leaked pixels of the frame at its end.

    Attributes:
        steps: number of steps from frame to frame with both poses known.
        steps_with_leak: those of them with any leaked pixel.
        pearson: correlation of the values; null when either does not vary.
        spearman: correlation of the ranks; null when either does not vary.
    """

    steps: int
    steps_with_leak: int
    pearson: Measured = None
    spearman: Measured = None


class Attribution(Part):
    """`attribution.json`, schema 1.

    Attributes:
        figures: of every variant.
        blame: of every stage.
        sum: of the blame of all stages.
        total: what all errors cost together: baseline less the variant in which everything is true. The sums differ
            from it by as much as the stages' errors act together.
        correlation: of the baseline and of the variant in which everything is true.
        variants: all figures of every variant, as in the report of a run.
    """

    schema_version: int = Field(default=1, alias="schema")
    scenario: str
    seed: int
    frames: int
    renderer: str
    segmenter: SegmenterReport
    slam: str
    profile: str
    pose_feedback: str
    frame_hash: str
    figures: dict[str, Figures]
    blame: dict[str, Blame]
    sum: Blame
    total: Figures
    correlation: dict[str, Correlation]
    variants: dict[str, MethodReport]

    def to_json(self) -> str:
        """The text of `attribution.json`."""
        return self.model_dump_json(indent=2, by_alias=True) + "\n"


def figures_of(report: MethodReport) -> Figures:
    """The figures that blame is measured in, of one variant."""
    counts = (report.moc.by_class or {}).values()
    wrong = sum(count.false_positive + count.false_negative for count in counts)
    answers = wrong + sum(count.true_positive + count.true_negative for count in counts)
    return Figures(
        ate_rmse_m=report.ate_rmse_m,
        moc_error=wrong / answers if answers else None,
        leak=report.masks.leak,
    )


def blame_stages(figures: Mapping[str, Figures]) -> dict[str, Blame]:
    """The blame of every stage from the figures of all variants, by their names."""
    return {
        stage: Blame(
            gain=figures[BASELINE.name] - figures[only(stage).name],
            cost=figures[all_but(stage).name] - figures[ALL_TRUE.name],
        )
        for stage in STAGES
    }


def add_up(blame: Mapping[str, Blame]) -> Blame:
    """The sum of the blame of all stages."""
    none = Figures(ate_rmse_m=0.0, moc_error=0.0, leak=0.0)
    return Blame(gain=sum((b.gain for b in blame.values()), none), cost=sum((b.cost for b in blame.values()), none))


def _cells(figures: Figures, sign: str) -> tuple[str, str, str]:
    def text(value: float | None, scale: float, digits: int) -> str:
        return "-" if value is None else f"{round(value * scale, digits) + 0.0:{sign}.{digits}f}"

    return text(figures.ate_rmse_m, 1e3, 2), text(figures.moc_error, 1e2, 2), text(figures.leak, 1e2, 2)


def headline(attribution: Attribution) -> str:
    """What was run, in one line."""
    return (
        f"{attribution.scenario}, seed {attribution.seed}, {attribution.frames} frames: segmenter "
        f"{attribution.segmenter.name}, SLAM {attribution.slam}, profile {attribution.profile}, pose feedback "
        f"{attribution.pose_feedback}"
    )


def figures_table(attribution: Attribution) -> Table:
    """The figures with nothing and with everything replaced, and what lies between."""
    drawn = Table(box=SIMPLE, padding=(0, 1, 0, 0), pad_edge=False)
    drawn.add_column("", no_wrap=True)
    for heading in ("ATE\nmm", "MOC error\n%", "leak\n%"):
        drawn.add_column(heading, justify="right", no_wrap=True)
    drawn.add_row("the method as it is", *_cells(attribution.figures[BASELINE.name], ""))
    drawn.add_row("every stage true", *_cells(attribution.figures[ALL_TRUE.name], ""))
    drawn.add_row("all errors together", *_cells(attribution.total, "+"))
    return drawn


def blame_table(attribution: Attribution) -> Table:
    """A row a stage: what repairing it alone gains, and what its errors alone cost when all others are true."""
    drawn = Table(box=SIMPLE, padding=(0, 1, 0, 0), pad_edge=False)
    drawn.add_column("stage", no_wrap=True)
    for kind in ("gain", "cost"):
        for heading in ("ATE mm", "MOC %", "leak %"):
            drawn.add_column(f"{kind}\n{heading}", justify="right", no_wrap=True)
    for stage, blame in attribution.blame.items():
        drawn.add_row(stage, *_cells(blame.gain, "+"), *_cells(blame.cost, "+"))
    drawn.add_section()
    drawn.add_row("sum", *_cells(attribution.sum.gain, "+"), *_cells(attribution.sum.cost, "+"))
    return drawn
