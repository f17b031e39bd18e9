"""Figures of a sweep over its seeds: medians, bootstrap intervals, and where a method breaks down.

A run counts as broken, its error as infinite, when odometry lost more than half of the frames or has no error at all:
the error of the few poses that are left says nothing. A cell that failed is left out.
"""

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dotmask.records import FloatArray
from scenarios.errors import ScenarioError
from scenarios.sweep.table import Row
from sim.randomness import child

LOST_SHARE = 0.5
"""A run that lost a larger share of its frames is broken."""

RESAMPLES = 2000
CONFIDENCE = 0.95
LEAST_ERROR_M = 1e-9
"""Below this the logarithm of an error is cut."""

LEAST_SEEDS = 2
"""Seeds that an interval needs."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Series:
    """One method along the first axis of a sweep, everything else fixed.

    Attributes:
        method: its name.
        others: key to value of what else is varied.
        x: (X,) values of the axis that have a run, ascending; places 0, 1, ... where the values are no numbers.
        ate_m: (S, X) by seed; inf where the run is broken, nan where the cell failed.
        lost: (S, X) share of the frames that odometry lost; nan where the cell failed.
    """

    method: str
    others: Mapping[str, Any]
    x: FloatArray
    ate_m: FloatArray
    lost: FloatArray

    @property
    def median_m(self) -> FloatArray:
        """(X,) median over the seeds."""
        return _median(self.ate_m)

    def band_m(self) -> FloatArray | None:
        """(2, X) bounds of the median; None where one seed alone was run."""
        if len(self.ate_m) < LEAST_SEEDS:
            return None
        return interval(_median(self.ate_m[resampled(len(self.ate_m))]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Axes:
    """How the varied parameters of a sweep are shown.

    Attributes:
        x: key of the first axis: the first whose values are numbers, or else the first of all.
        values: of `x`, in the order in which they are shown.
        others: the other keys, in the order in which they were given.
        is_numeric: whether `values` are numbers.
    """

    x: str
    values: tuple[Any, ...]
    others: tuple[str, ...]
    is_numeric: bool

    @classmethod
    def of(cls, varied: Mapping[str, Sequence[Any]]) -> "Axes":
        """The axes for what was varied."""
        numeric = [key for key, values in varied.items() if all(is_number(value) for value in values)]
        x = (numeric or list(varied))[0]
        values = sorted(varied[x]) if numeric else varied[x]
        others = tuple(key for key in varied if key != x)
        return cls(x=x, values=tuple(values), others=others, is_numeric=bool(numeric))


def is_number(value: Any) -> bool:
    """Whether a value can stand on an axis."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def series_of(rows: Sequence[Row], axes: Axes) -> list[Series]:
    """The rows of a table as series, in the order of the table.

    Raises:
        ScenarioError: no cell has a result.
    """
    if all(row["error"] is not None for row in rows):
        raise ScenarioError("every cell of this sweep failed; the column `error` of its table says why")
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault((*(row[key] for key in axes.others), row["method"]), []).append(row)
    seeds = list(dict.fromkeys(row["seed"] for row in rows))
    found = []
    for (*others, method), members in groups.items():
        ate_m, lost = (np.full((len(seeds), len(axes.values)), np.nan) for _ in range(2))
        for row in members:
            if row["error"] is None:
                place = seeds.index(row["seed"]), axes.values.index(row[axes.x])
                lost[place] = row["lost_frames"] / row["frames"]
                is_broken = row["ate_rmse_m"] is None or lost[place] > LOST_SHARE
                ate_m[place] = np.inf if is_broken else row["ate_rmse_m"]
        known = ~np.isnan(ate_m).all(axis=0)
        x = np.array(axes.values if axes.is_numeric else range(len(axes.values)), dtype=np.float64)
        found.append(
            Series(
                method=method,
                others=dict(zip(axes.others, others, strict=True)),
                x=x[known],
                ate_m=ate_m[:, known],
                lost=lost[:, known],
            )
        )
    return found


def resampled(seeds: int) -> NDArray[np.int64]:
    """(RESAMPLES, seeds) numbers of seeds, drawn with replacement; the same ones in every process."""
    return child(0, "sweep-bootstrap", seeds).integers(seeds, size=(RESAMPLES, seeds))


def interval(values: FloatArray) -> FloatArray:
    """(2, ...) the bounds that hold the middle of the resampled values (RESAMPLES, ...); infinite ones are possible."""
    tail = 0.5 * (1 - CONFIDENCE)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a column without a number has no bounds: nan
        bounds: FloatArray = np.nanquantile(values, [tail, 1 - tail], axis=0, method="inverted_cdf")
    return bounds


def _median(values: FloatArray) -> FloatArray:
    """Over the seeds, the axis before the last."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a resample of failed cells alone has no median: nan
        middle: FloatArray = np.nanmedian(values, axis=-2)
    return middle


@dataclass(frozen=True, slots=True, kw_only=True)
class Breakdown:
    """Where the median error crosses the bound.

    Attributes:
        value: of the parameter; infinite where it does not cross it, see `is_rising`.
        low, high: of the interval, alike; None where one seed alone was run.
        is_rising: whether the method holds at small values and breaks down at large ones. Then `inf` is "not reached",
            and `-inf` is "broken at the smallest value already"; else the other way round.
        smallest, largest: of the values that were run.
    """

    value: float
    low: float | None
    high: float | None
    is_rising: bool
    smallest: float
    largest: float

    def text(self) -> str:
        """For people."""
        if self.is_reached:
            told = f"{self.value:.3g}"
        elif self.is_never:
            told = f"not reached ({'up' if self.is_rising else 'down'} to {self._far_end:g})"
        else:
            near = self.smallest if self.is_rising else self.largest
            told = f"broken at {near:g} already"
        if self.low is None or self.high is None or (not self.is_reached and self.low == self.high):
            return told
        return f"{told} [{self._bound(self.low)} to {self._bound(self.high)}]"

    @property
    def is_reached(self) -> bool:
        """Whether there is a value at which it crosses the bound."""
        return math.isfinite(self.value)

    @property
    def is_never(self) -> bool:
        """Whether it holds wherever it was run."""
        return self.value == (math.inf if self.is_rising else -math.inf)

    @property
    def _far_end(self) -> float:
        return self.largest if self.is_rising else self.smallest

    def _bound(self, value: float) -> str:
        if math.isfinite(value):
            return f"{value:.3g}"
        return f"below {self.smallest:g}" if value < 0 else f"above {self.largest:g}"


def breakdown(series: Series, bound_m: float) -> Breakdown:
    """Where the median error of a series crosses the bound, interpolated on logarithmic scales.

    It is looked for from the small values on where the method holds there, from the large ones on where it does not but
    holds at those. Of several crossings the first counts. The interval is of the median: the seeds are drawn anew, all
    values with the same ones.
    """
    median = series.median_m
    is_rising = bool(median[0] <= bound_m or median[-1] > bound_m)
    low = high = None
    if len(series.ate_m) >= LEAST_SEEDS:
        drawn = _median(series.ate_m[resampled(len(series.ate_m))])
        crossings = np.array([crossing(series.x, errors, bound_m, is_rising) for errors in drawn])
        low, high = (float(value) for value in interval(crossings))
    return Breakdown(
        value=crossing(series.x, median, bound_m, is_rising),
        low=low,
        high=high,
        is_rising=is_rising,
        smallest=float(series.x[0]),
        largest=float(series.x[-1]),
    )


def crossing(x: FloatArray, error: FloatArray, bound: float, is_rising: bool) -> float:
    """Where `error` first exceeds `bound`, walking up `x` or down.

    Args:
        x: (X,) ascending.
        error: (X,) at each of them; nan is passed over.
        bound: above 0.
        is_rising: whether to walk up.

    Returns:
        The interpolated value. Never: infinity in the direction of the walk; at the first value already: the other.
    """
    order = np.arange(len(x)) if is_rising else np.arange(len(x))[::-1]
    order = order[~np.isnan(error[order])]
    onward = math.inf if is_rising else -math.inf
    above = np.flatnonzero(error[order] > bound)
    if not len(above):
        return onward
    if above[0] == 0:
        return -onward
    before, after = order[above[0] - 1], order[above[0]]
    low, high = (math.log(max(error[k], LEAST_ERROR_M)) for k in (before, after))
    share = 0.0 if math.isinf(high) else (math.log(bound) - low) / (high - low)
    if min(x[before], x[after]) > 0:
        return float(math.exp(math.log(x[before]) + share * (math.log(x[after]) - math.log(x[before]))))
    return float(x[before] + share * (x[after] - x[before]))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Gain:
    """By what factor a method's error is smaller than another's, on the same frames.

    Attributes:
        factor: (X,) median over the seeds of the ratio; above 1 the method is better.
        band: (2, X) its bounds; None where one seed alone was run.
    """

    factor: FloatArray
    band: FloatArray | None


def gain(method: Series, reference: Series) -> Gain:
    """The gain of one series over another at the values that both have; two broken runs are equally good."""
    shared, ours, theirs = np.intersect1d(method.x, reference.x, return_indices=True)
    errors, others = method.ate_m[:, ours], reference.ate_m[:, theirs]
    both_broken = np.isinf(errors) & np.isinf(others)
    ratio = np.ones((len(errors), len(shared)))
    np.divide(others, np.maximum(errors, LEAST_ERROR_M), out=ratio, where=~both_broken)
    band = interval(_median(ratio[resampled(len(ratio))])) if len(ratio) >= LEAST_SEEDS else None
    return Gain(factor=_median(ratio), band=band)
