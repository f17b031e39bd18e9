"""The report: schema 1 of `report.json`, and the table that people read."""

import operator
import re
from collections.abc import Callable
from types import NoneType
from typing import Annotated, get_args

from pydantic import BaseModel, ConfigDict, Field
from rich.box import SIMPLE
from rich.table import Table

from scenarios.errors import ScenarioError

Measured = Annotated[float | None, Field(allow_inf_nan=False)]
"""A figure, or null when it was not measured: never 0 in its place."""


class Part(BaseModel):
    """Common rules of the report's parts."""

    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)


class LoopReport(Part):
    """Loop closures, and the errors of the relative poses they claim.

    Attributes:
        count: accepted loop closures.
        false_count: those of them whose translation is more than 0.1 m wrong.
        trans_error_m: mean error of the translation.
        trans_error_max_m: the largest of them.
        rot_error_rad: mean error of the rotation.
    """

    count: int | None = None
    false_count: int | None = None
    trans_error_m: Measured = None
    trans_error_max_m: Measured = None
    rot_error_rad: Measured = None


class EkfReport(Part):
    """Errors of the tracker's beliefs, over all frames in which a track was observed.

    A bias is the part of the error that stays when it is averaged over each object's frames in the camera's axes; the
    rest, the spread, is `sqrt(rmse² - bias²)`. Bounds hold a consistent filter's figure with probability 0.95.

    Attributes:
        position_rmse_m: against the true centre of the object.
        position_bias_m: of the same error.
        position_bias_ray_m: mean of the same error along the ray from the camera to the centre: below 0, the belief is
            too near.
        position_rmse_ideal_m: against what the estimator's own observation gives on perfect images.
        position_bias_ideal_m: of the same error.
        velocity_rmse_m_s: against the velocity of the centre.
        velocity_bias_m_s: of the same error.
        nees: mean normalised estimation error squared of position and velocity against the centre; 6 if consistent.
        nees_bounds: of nees.
        nees_ideal: of the position against what the estimator's own observation gives on perfect images; 3 if
            consistent.
        nis: mean normalised innovation squared; 3 if consistent.
        nis_bounds: of nis.
        innovation_correlation: autocorrelation at lag 1 of the normalised innovations; 0 if white.
        innovation_correlation_bound: of its magnitude.
    """

    position_rmse_m: Measured = None
    position_bias_m: Measured = None
    position_bias_ray_m: Measured = None
    position_rmse_ideal_m: Measured = None
    position_bias_ideal_m: Measured = None
    velocity_rmse_m_s: Measured = None
    velocity_bias_m_s: Measured = None
    nees: Measured = None
    nees_bounds: tuple[float, float] | None = None
    nees_ideal: Measured = None
    nis: Measured = None
    nis_bounds: tuple[float, float] | None = None
    innovation_correlation: Measured = None
    innovation_correlation_bound: Measured = None


class TrackingReport(Part):
    """Multi-object tracking scores.

    Attributes:
        mota: CLEAR-MOT accuracy.
        idf1: share of right identities.
        hota: mean over 19 thresholds of IoU of the geometric mean of detection and association accuracy.
        deta: detection accuracy, mean over the thresholds.
        assa: association accuracy, mean over the thresholds.
        switches: times that an object's track changed.
    """

    mota: Measured = None
    idf1: Measured = None
    hota: Measured = None
    deta: Measured = None
    assa: Measured = None
    switches: int | None = None


class ConfusionReport(Part):
    """How often an object in a frame was what, and called what; positive = moving."""

    true_positive: int
    false_positive: int
    false_negative: int
    true_negative: int


class MocReport(Part):
    """Moving object classification, over all seen objects of interest and frames.

    Motions and rests shorter than 10 frames begin nothing that a latency would count from.

    Attributes:
        precision: share of flagged objects that move.
        recall: share of moving objects that are flagged.
        idle_flag_rate: share of resting objects that are flagged.
        auc: area under the ROC curve of the tracks' speeds: what the best choice of threshold has to work with.
        flag_latency_frames: median, from the beginning of a motion or the appearance of a mover to its first flag.
        unflag_latency_frames: median, from the beginning of a rest or the appearance of a resting object to its first
            frame without flag.
        starts: times that an object sets off (its centre, above 0.1 m/s) that was tracked, at rest and not flagged.
        missed_starts: those of them that were never flagged.
        start_latency_frames: median over the flagged starts.
        start_latency_max_frames: the longest of them.
        by_class: counts for each class.
    """

    precision: Measured = None
    recall: Measured = None
    idle_flag_rate: Measured = None
    auc: Measured = None
    flag_latency_frames: Measured = None
    unflag_latency_frames: Measured = None
    starts: int | None = None
    missed_starts: int | None = None
    start_latency_frames: Measured = None
    start_latency_max_frames: int | None = None
    by_class: dict[str, ConfusionReport] | None = None


class MaskReport(Part):
    """Masks, over all frames and pixels with depth.

    Attributes:
        iou: mean over the matched detections.
        boundary_f: mean F-score of their contours within 0.8 % of the image's diagonal, in every fifth frame.
        leak: share of the moving objects' pixels that odometry still sees.
        waste: share of the static pixels that odometry lost.
    """

    iou: Measured = None
    boundary_f: Measured = None
    leak: Measured = None
    waste: Measured = None


class MapReport(Part):
    """The point cloud against the scene without all that can move; null unless a map was asked for.

    A point is a ghost when at least half of the pixels it was measured in showed something that can move, whether it
    moved or not. The observable surface is what the camera would have seen in range without anything that can move.

    Attributes:
        ghost_fraction: share of the points that are ghosts.
        accuracy_m: mean distance of the other points to the static surface.
        accuracy_median_m: median of the same.
        completeness: share of the observable static surface with a point that is no ghost within 5 cm.
        points: of the cloud.
        views: frames that it was built from.
    """

    ghost_fraction: Measured = None
    accuracy_m: Measured = None
    accuracy_median_m: Measured = None
    completeness: Measured = None
    points: int | None = None
    views: int | None = None


class StageTimes(Part):
    """Mean CPU time per frame in milliseconds, of one thread.

    `segment` of a network, and of a segmenter of the user's own, is wall time, since it may use several threads or a
    GPU; all methods of a run share one answer, and each is charged its whole time.
    """

    segment: Measured = None
    track: Measured = None
    classify: Measured = None
    mask: Measured = None
    odometry: Measured = None
    map: Measured = None


class MethodReport(Part):
    """All figures of one method.

    Attributes:
        ate_rmse_m: of odometry: the poses as they were fed back to the tracker.
        rpe_trans_rmse_m: of odometry, per frame.
        rpe_rot_rmse_rad: of odometry, per frame.
        tracked_frames: frames with a pose by odometry; an ATE says nothing without the number of poses it covers.
        ate_optimised_rmse_m: after the last frame, with the loops closed.
        optimised_frames: poses that it covers.
        loops: see LoopReport.
        ekf: see EkfReport.
        tracking: see TrackingReport.
        moc: see MocReport.
        masks: see MaskReport.
        map: see MapReport.
        time_ms: see StageTimes.
    """

    ate_rmse_m: Measured
    rpe_trans_rmse_m: Measured
    rpe_rot_rmse_rad: Measured
    tracked_frames: int
    ate_optimised_rmse_m: Measured = None
    optimised_frames: int | None = None
    loops: LoopReport = LoopReport()
    ekf: EkfReport = EkfReport()
    tracking: TrackingReport = TrackingReport()
    moc: MocReport = MocReport()
    masks: MaskReport = MaskReport()
    map: MapReport = MapReport()
    time_ms: StageTimes


class SegmenterReport(Part):
    """What found the objects.

    Attributes:
        name: `oracle`, `none`, a network, or `package.module:factory` of the user's own.
        weights_sha256: of the file with the network's weights; null without a network.
        device: where the network ran, `cpu` or `cuda`; null without a network.
    """

    name: str
    weights_sha256: str | None = None
    device: str | None = None


class WorldTimes(Part):
    """Mean wall time per frame in milliseconds of making a frame (rendering, truth, sensor), beside the methods.

    Null for a recorded sequence.
    """

    render: Measured = None


class Report(Part):
    """`report.json`, schema 1.

    Attributes:
        scenario: its name; of a recorded sequence the name of the folder.
        seed: of the scenario; null for a recorded sequence.
        frames: how many there were.
        renderer: that made the images; null for a recorded sequence.
        segmenter: see SegmenterReport.
        slam, profile: how it was run.
        slam_parameters: values that the SLAM back end was given beside its own.
        frame_hash: SHA-256 of the colour and depth images as the methods saw them.
        methods: the figures of each. What needs a truth that there is not (of a recorded sequence all but the
            trajectory's, without groundtruth.txt these too) is null.
        time_ms: see WorldTimes.
    """

    schema_version: int = Field(default=1, alias="schema")
    scenario: str
    seed: int | None
    frames: int
    renderer: str | None
    segmenter: SegmenterReport
    slam: str
    slam_parameters: dict[str, str] = {}
    profile: str
    frame_hash: str
    methods: dict[str, MethodReport]
    time_ms: WorldTimes

    def to_json(self) -> str:
        """The text of `report.json`."""
        return self.model_dump_json(indent=2, by_alias=True) + "\n"


def _number(value: float | None, scale: float = 1.0, digits: int = 1) -> str:
    return "-" if value is None else f"{value * scale:.{digits}f}"


COLUMNS: tuple[tuple[str, Callable[[MethodReport, Report], str]], ...] = (
    ("ATE\nmm", lambda m, _: _number(m.ate_rmse_m, 1e3)),
    ("opt.\nmm", lambda m, _: _number(m.ate_optimised_rmse_m, 1e3)),
    ("loops", lambda m, _: "-" if m.loops.count is None else str(m.loops.count)),
    ("RPE\nmm", lambda m, _: _number(m.rpe_trans_rmse_m, 1e3)),
    ("lost", lambda m, r: str(r.frames - m.tracked_frames)),
    ("EKF\nmm", lambda m, _: _number(m.ekf.position_rmse_ideal_m, 1e3, 0)),
    ("EKF\nm/s", lambda m, _: _number(m.ekf.velocity_rmse_m_s, 1, 2)),
    ("MOC\nprec.", lambda m, _: _number(m.moc.precision, 1, 3)),
    ("MOC\nrec.", lambda m, _: _number(m.moc.recall, 1, 3)),
    ("leak\n%", lambda m, _: _number(m.masks.leak, 100)),
    ("waste\n%", lambda m, _: _number(m.masks.waste, 100)),
)
"""Headings and cells of the table: it fits a terminal of 80 columns."""


def _method_ms(times: StageTimes) -> float | None:
    stages = [t for t in (times.track, times.classify, times.mask) if t is not None]
    return sum(stages) if stages else None


def table(report: Report) -> Table:
    """The table of one run: a row a method."""
    seed = "" if report.seed is None else f"seed {report.seed}, "
    title = (
        f"{report.scenario}, {seed}{report.frames} frames: segmenter {report.segmenter.name}, "
        f"SLAM {report.slam}, profile {report.profile}"
    )
    drawn = Table(title=title, title_justify="left", box=SIMPLE, padding=0, pad_edge=False)
    drawn.add_column("method", no_wrap=True)
    for heading, _ in COLUMNS:
        drawn.add_column(heading, justify="right", no_wrap=True)
    for name, method in report.methods.items():
        drawn.add_row(name, *(cell(method, report) for _, cell in COLUMNS))
    return drawn


def times(report: Report) -> str:
    """One line: wall time per frame of making the frames and of a network, CPU time of each method's stages."""
    parts = []
    for name, method in report.methods.items():
        masking = _method_ms(method.time_ms)
        stages = [] if masking is None else [f"masking {masking:.1f}"]
        parts.append(f"{name}: {', '.join([*stages, f'odometry {_number(method.time_ms.odometry)}'])}")
    world = "" if report.time_ms.render is None else f"render {_number(report.time_ms.render)} (wall); "
    segmenting = [m.time_ms.segment for m in report.methods.values() if m.time_ms.segment is not None]
    if report.segmenter.device is not None and segmenting:
        world += f"{report.segmenter.name} {_number(max(segmenting))} (wall); "  # the oracle beside it takes no time
    return f"ms per frame: {world}CPU of " + "; ".join(parts)


def maps(report: Report) -> str | None:
    """One line: ghosts, accuracy and completeness of each method's map; None when no map was asked for."""
    parts = []
    for name, method in report.methods.items():
        if method.map.ghost_fraction is not None:
            parts.append(
                f"{name}: ghosts {_number(method.map.ghost_fraction, 100, 2)} %, "
                f"off by {_number(method.map.accuracy_m, 1e3)} mm, "
                f"complete to {_number(method.map.completeness, 100)} %"
            )
        elif method.map.points is not None:
            parts.append(f"{name}: {method.map.points} points from {method.map.views} views")
    return "map of " + "; ".join(parts) if parts else None


COMPARISONS: dict[str, Callable[[float, float], bool]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "<": operator.lt,
    ">": operator.gt,
}


class Expectation(BaseModel):
    """A threshold on a figure of the report, for example `ate_rmse_m<0.03` or `unmasked.ate_rmse_m>0.1`."""

    model_config = ConfigDict(frozen=True)

    text: str
    method: str
    path: tuple[str, ...]
    sign: str
    bound: float

    def verdict(self, report: Report) -> tuple[bool, float | None]:
        """Whether it holds, and the measured figure. A figure that was not measured does not hold."""
        value = figure(report.methods[self.method], ".".join(self.path))
        if value is None:
            return False, None
        return COMPARISONS[self.sign](float(value), self.bound), float(value)


def expectation(text: str, methods: tuple[str, ...]) -> Expectation:
    """Parse `[METHOD.]FIGURE<BOUND`; without a method the last one of the run is meant.

    Raises:
        ScenarioError: not of that form, or no such figure.
    """
    match = re.fullmatch(r"\s*([\w.-]+)\s*(<=|>=|<|>)\s*([-+.\deE]+)\s*", text)
    if match is None:
        raise ScenarioError(f"--expect {text}: expected FIGURE<NUMBER, for example ate_rmse_m<0.03")
    key, sign, number = match.groups()
    parts = key.split(".")
    method = parts.pop(0) if parts[0] in methods else methods[-1]
    model: type[BaseModel] = MethodReport
    for depth, part in enumerate(parts):
        if part not in model.model_fields:
            raise ScenarioError(f"--expect {text}: no figure '{part}'; known: {', '.join(model.model_fields)}")
        inner = model.model_fields[part].annotation
        if isinstance(inner, type) and issubclass(inner, BaseModel):
            model = inner
            if depth == len(parts) - 1:
                raise ScenarioError(f"--expect {text}: name one of {part}: {', '.join(inner.model_fields)}")
        elif not _is_number(inner):
            raise ScenarioError(f"--expect {text}: '{part}' is not one number")
        elif depth < len(parts) - 1:
            raise ScenarioError(f"--expect {text}: '{part}' has no parts")
    if not parts:
        raise ScenarioError(f"--expect {text}: name a figure, for example ate_rmse_m")
    try:
        bound = float(number)
    except ValueError:
        raise ScenarioError(f"--expect {text}: '{number}' is no number") from None
    return Expectation(text=text, method=method, path=tuple(parts), sign=sign, bound=bound)


def figure_types(model: type[BaseModel] = MethodReport, prefix: str = "") -> dict[str, type]:
    """All figures of a method that are one number: dotted names (`masks.leak`) to `int` or `float`, in order."""
    found: dict[str, type] = {}
    for name, field in model.model_fields.items():
        inner = field.annotation
        if isinstance(inner, type) and issubclass(inner, BaseModel):
            found |= figure_types(inner, f"{prefix}{name}.")
        elif _is_number(inner):
            found[prefix + name] = float if float in (get_args(inner) or (inner,)) else int
    return found


def figure(report: MethodReport, name: str) -> float | None:
    """A figure by its dotted name; None when it was not measured."""
    value: float | None = operator.attrgetter(name)(report)
    return value


def _is_number(annotation: object) -> bool:
    return set(get_args(annotation) or (annotation,)) <= {int, float, NoneType}
