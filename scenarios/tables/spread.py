"""One figure of several runs: the median, and how far apart they are."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median

from scenarios.report import MethodReport, Report


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """Median and range of a figure over the runs that measured it.

    Attributes:
        median, low, high: of those.
        measured, runs: how many runs measured it, of how many.
    """

    median: float
    low: float
    high: float
    measured: int
    runs: int

    def text(self, digits: int) -> str:
        """The median, with the range after it where runs differ, and how many have no figure where some have none."""
        shown = f"{self.median:.{digits}f}"
        low, high = f"{self.low:.{digits}f}", f"{self.high:.{digits}f}"
        if low != high:
            shown += f" ({low} to {high})"
        if self.measured < self.runs:
            shown += f" [{self.measured} of {self.runs} runs]"
        return shown


Figure = Callable[[MethodReport], float | None]


def spread(reports: Sequence[Report], method: str, figure: Figure, scale: float = 1.0) -> Spread | None:
    """A figure of one method over several runs, times `scale`; None where no run measured it."""
    values = [figure(report.methods[method]) for report in reports]
    known = [scale * value for value in values if value is not None]
    if not known:
        return None
    return Spread(median=median(known), low=min(known), high=max(known), measured=len(known), runs=len(values))


def cell(reports: Sequence[Report], method: str, figure: Figure, digits: int, scale: float = 1.0) -> str:
    """The same as a cell of a table; - where it was not measured."""
    found = spread(reports, method, figure, scale)
    return "-" if found is None else found.text(digits)
