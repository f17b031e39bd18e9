"""The figures of a segmenter, and the tables that people read."""

from pydantic import Field
from rich.box import SIMPLE
from rich.table import Table

from scenarios.report import Measured, Part, SegmenterReport


class Band(Part):
    """Instances that were to be found under some circumstance.

    Attributes:
        label: of the circumstance.
        seen: how many.
        missed: of them.
        missed_share: of them; null where there were none.
    """

    label: str
    seen: int
    missed: int
    missed_share: Measured


class ClassFigures(Part):
    """Figures of one class.

    Attributes:
        ap: COCO's average precision of the masks, mean over the IoU 0.5 to 0.95; null where there were none.
        ap50: the same at an IoU of 0.5.
        ap50_reasonable: the same if the reasonable instances alone count: those that show at least 50 rows of pixels
            and are hidden at most to 35 %; null where there were none.
        ap50_small, ap50_medium, ap50_large: the same of COCO's sizes, the bands of `misses["visible_px"]`; null where
            there were none.
        iou: mean over the matched masks; null without any.
        seen: instances that were to be found, over all frames.
        reasonable: how many of them were.
        missed: those of them that no detection of the class overlaps with an IoU of 0.5.
        missed_share: of them.
    """

    ap: Measured
    ap50: Measured
    ap50_reasonable: Measured
    ap50_small: Measured
    ap50_medium: Measured
    ap50_large: Measured
    iou: Measured
    seen: int
    reasonable: int
    missed: int
    missed_share: Measured


class Milliseconds(Part):
    """Wall time of a frame; null for the oracle, which is told.

    Attributes:
        median, p95: milliseconds.
        threads: that a network on the CPU worked with.
    """

    median: Measured
    p95: Measured
    threads: int


class SegmenterEvaluation(Part):
    """What `dotmask evaluate-segmenter --json` prints, schema 1.

    Attributes:
        segmenter: what was evaluated.
        profile: whose threshold and number decide `iou` and the misses.
        scenarios: the frames that were looked at, by scenario.
        classes: figures by class.
        misses: by circumstance: `visible_px`, `hidden_percent`, `distance_m`, `tilt_deg`, `truncated`, `blur_px`.
        ms: see Milliseconds.
    """

    schema_version: int = Field(default=1, alias="schema")
    segmenter: SegmenterReport
    profile: str
    scenarios: dict[str, int]
    classes: dict[str, ClassFigures]
    misses: dict[str, tuple[Band, ...]]
    ms: Milliseconds

    def to_json(self) -> str:
        """The text that is printed."""
        return self.model_dump_json(indent=2, by_alias=True) + "\n"


CIRCUMSTANCES = {
    "visible_px": "visible pixels",
    "hidden_percent": "hidden by something, %",
    "distance_m": "distance, m",
    "tilt_deg": "tilt of the camera, deg",
    "truncated": "cut by the image's border",
    "blur_px": "motion blur, px",
}


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.1f}"


def headline(evaluation: SegmenterEvaluation) -> str:
    """What was evaluated on what, in one line."""
    segmenter = evaluation.segmenter
    where = "" if segmenter.device is None else f" on {segmenter.device}"
    frames = ", ".join(f"{count} of {name}" for name, count in evaluation.scenarios.items())
    return f"segmenter {segmenter.name}{where}, frames {frames}; profile {evaluation.profile}"


def class_table(evaluation: SegmenterEvaluation) -> Table:
    """A row a class."""
    drawn = _table("class", "AP", "AP50", "reasonable", "small", "medium", "large", "IoU", "seen", "missed, %")
    for name, f in evaluation.classes.items():
        numbers = (f.ap, f.ap50, f.ap50_reasonable, f.ap50_small, f.ap50_medium, f.ap50_large, f.iou)
        drawn.add_row(name, *(_number(value, 3) for value in numbers), str(f.seen), _percent(f.missed_share))
    return drawn


def miss_table(evaluation: SegmenterEvaluation) -> Table:
    """A row for each band of each circumstance."""
    drawn = _table("missed by", "", "seen", "missed, %")
    for circumstance, bands in evaluation.misses.items():
        for index, band in enumerate(bands):
            title = CIRCUMSTANCES[circumstance] if index == 0 else ""
            drawn.add_row(title, band.label, str(band.seen), _percent(band.missed_share))
    return drawn


def time_line(evaluation: SegmenterEvaluation) -> str:
    """Wall time of a frame, in one line."""
    ms = evaluation.ms
    if ms.median is None:
        return "ms per frame: not measured, the oracle is told"
    threads = f" on {ms.threads} threads" if evaluation.segmenter.device == "cpu" else ""
    return f"ms per frame: {_number(ms.median, 1)} (median), {_number(ms.p95, 1)} (95th percentile), wall time{threads}"


def _table(*headings: str) -> Table:
    drawn = Table(box=SIMPLE, padding=(0, 1, 0, 0), pad_edge=False)
    for index, heading in enumerate(headings):
        drawn.add_column(heading, justify="right" if index else "left", no_wrap=True)
    return drawn
