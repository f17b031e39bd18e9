"""The figures that are compared with a baseline: which way is worse, and what change is too small to count."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from dotmask.records import FloatArray
from scenarios.report import MethodReport, figure

LEAST_FACTOR = 1.05
"""An error that grows by less does not count."""

LEAST_POINTS = 0.005
"""A share that changes by less does not count: half a percentage point."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Metric:
    """A figure, and how two of its values are compared.

    An error (`floor` is not None) is compared by its ratio: seeds are worlds of different difficulty, and twice the
    error is the same loss in each. A share is compared by its difference.

    Attributes:
        name: dotted, as in the report of a run; `lost_share` is of the frames in which odometry had no pose.
        unit: that people read.
        scale: to that unit.
        worse: which way is worse.
        floor: of an error: anything smaller counts as this.
    """

    name: str
    unit: str
    scale: float
    worse: Literal["more", "less"] = "more"
    floor: float | None = None

    def losses(self, before: FloatArray, now: FloatArray) -> FloatArray:
        """(n,) how much worse each value `now` (n,) is than its partner `before` (n,): below 0, better."""
        if self.floor is not None:
            return np.log(np.maximum(now, self.floor) / np.maximum(before, self.floor))
        return now - before if self.worse == "more" else before - now

    @property
    def margin(self) -> float:
        """The loss that is too small to count."""
        return LEAST_POINTS if self.floor is None else math.log(LEAST_FACTOR)

    def middle(self, values: FloatArray) -> float:
        """The mean of values (n,) that fits the mean of the losses: geometric for an error."""
        if self.floor is None:
            return float(values.mean())
        return math.exp(float(np.log(np.maximum(values, self.floor)).mean()))

    def value_text(self, value: float) -> str:
        """A value for people."""
        return f"{value * self.scale:.3g} {self.unit}"

    def loss_text(self, loss: float) -> str:
        """A loss for people, as a factor or a signed difference of the values."""
        if self.floor is not None:
            return f"{math.exp(loss):.2f}"
        return f"{(loss if self.worse == 'more' else -loss) * self.scale:+.1f}"

    def change_text(self, loss: float, low: float, high: float) -> str:
        """A loss with its interval for people."""
        ends = (low, high) if self.worse == "more" else (high, low)
        unit = "points" if self.floor is None else "times"
        return f"{self.loss_text(loss)} {unit} [{' to '.join(map(self.loss_text, ends))}]"


METRICS: tuple[Metric, ...] = (
    Metric(name="ate_rmse_m", unit="mm", scale=1e3, floor=1e-4),
    Metric(name="ate_optimised_rmse_m", unit="mm", scale=1e3, floor=1e-4),
    Metric(name="rpe_trans_rmse_m", unit="mm", scale=1e3, floor=1e-4),
    Metric(name="rpe_rot_rmse_rad", unit="mrad", scale=1e3, floor=1e-4),
    Metric(name="lost_share", unit="%", scale=100.0),
    Metric(name="masks.leak", unit="%", scale=100.0),
    Metric(name="masks.waste", unit="%", scale=100.0),
    Metric(name="masks.iou", unit="%", scale=100.0, worse="less"),
    Metric(name="masks.boundary_f", unit="%", scale=100.0, worse="less"),
    Metric(name="moc.precision", unit="%", scale=100.0, worse="less"),
    Metric(name="moc.recall", unit="%", scale=100.0, worse="less"),
    Metric(name="tracking.hota", unit="%", scale=100.0, worse="less"),
    Metric(name="ekf.position_rmse_ideal_m", unit="mm", scale=1e3, floor=1e-3),
    Metric(name="ekf.velocity_rmse_m_s", unit="m/s", scale=1.0, floor=1e-2),
)
"""All of them. Times are not compared: they are the machine's. Counts of rare events and medians of whole frames are
not either: a handful of seeds says nothing about them."""


def figures(report: MethodReport, frames: int) -> dict[str, float | None]:
    """The compared figures of a run of so many frames; None where not measured."""
    found = {metric.name: figure(report, metric.name) for metric in METRICS if metric.name != "lost_share"}
    return {**found, "lost_share": 1.0 - report.tracked_frames / frames}
