"""The plots of a sweep."""

from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes as PlotAxes
from matplotlib.colors import LogNorm
from matplotlib.patches import Rectangle
from matplotlib.ticker import FuncFormatter, NullFormatter, NullLocator

from dotmask.records import FloatArray
from scenarios.plots import GREY, ORANGE, PALE, figure_file
from scenarios.sweep.statistics import CONFIDENCE, LOST_SHARE, Axes, Series, breakdown

COLOURS = {"unmasked": GREY, "mdi": "#2b7fd1", "dotmask": ORANGE}
MARKERS = {"unmasked": "s", "mdi": "^", "dotmask": "o"}
MOST_COLUMNS = 3
ROOM = 1.6
"""Factor between the largest error and the upper end of the axis, where broken runs are marked."""


def told(others: Mapping[str, Any]) -> str:
    """What is fixed in a panel."""
    return ", ".join(f"{key} {shown(value)}" for key, value in others.items())


def shown(value: Any) -> str:
    """A value of a parameter, for people."""
    if value is None:
        return "-"
    return f"{value:g}" if isinstance(value, float) else str(value)


def panels(series: Sequence[Series]) -> list[list[Series]]:
    """The series of each panel: all methods with the same other parameters."""
    found: dict[str, list[Series]] = {}
    for one in series:
        found.setdefault(told(one.others), []).append(one)
    return list(found.values())


def draw_errors(path: Path, title: str, axes: Axes, series: Sequence[Series], bound_m: float) -> None:
    """Error against the first axis: medians with bands, the bound, breakdown points; below, the frames that were lost.

    Args:
        path: of the PNG file.
        title: of the figure.
        axes: of the sweep.
        series: all of them; each combination of the other parameters has a panel.
        bound_m: where a method counts as broken down.
    """
    groups = panels(series)
    # The last of the other parameters changes from panel to panel, so a line of panels holds all its values.
    columns = min(MOST_COLUMNS, len({one.others[axes.others[-1]] for one in series}) if axes.others else 1)
    lines = -(-len(groups) // columns)
    low_m, high_m = _limits(series, bound_m)
    with figure_file(path, max(6.4, 4.6 * columns), 0.5 + 4.9 * lines) as figure:
        figure.suptitle(title, fontsize=11, fontweight="bold")
        grid = figure.subplots(
            2 * lines, columns, sharex=True, sharey="row", squeeze=False, height_ratios=[3.2, 1.0] * lines
        )
        for number, group in enumerate(groups):
            line, column = divmod(number, columns)
            upper, lower = grid[2 * line, column], grid[2 * line + 1, column]
            for one in group:
                _draw_error(upper, one, axes, bound_m, high_m)
                share = 100 * np.nanmean(one.lost, axis=0)
                colour, marker = COLOURS[one.method], MARKERS[one.method]
                lower.plot(one.x, share, marker=marker, color=colour, markersize=4, linewidth=1.2)
            upper.axhline(1e3 * bound_m, color="#b00020", linewidth=0.9, linestyle="--")
            upper.set_yscale("log")
            upper.set_ylim(1e3 * low_m, 1e3 * high_m)
            upper.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            upper.set_title(told(group[0].others), fontsize=9)
            lower.set_ylim(-5, 105)
            lower.set_xlabel(axes.x, fontsize=9)
            lower.tick_params(labelbottom=True)
            for axis in (upper, lower):
                axis.tick_params(labelsize=8)
                axis.grid(color=PALE, linewidth=0.6)
                axis.set_axisbelow(True)
            _label_x(lower, axes)
            if column == 0:
                upper.set_ylabel("ATE, mm", fontsize=9)
                lower.set_ylabel("frames lost, %", fontsize=9)
        grid[0, 0].legend(fontsize=8, loc="best")
        for number in range(len(groups), lines * columns):
            line, column = divmod(number, columns)
            grid[2 * line, column].set_visible(False)
            grid[2 * line + 1, column].set_visible(False)


def _draw_error(axis: PlotAxes, one: Series, axes: Axes, bound_m: float, high_m: float) -> None:
    median, band = one.median_m, one.band_m()
    colour, marker = COLOURS[one.method], MARKERS[one.method]
    known = np.isfinite(median)
    axis.plot(
        one.x[known], 1e3 * median[known], marker=marker, markersize=4.5, color=colour, linewidth=1.6, label=one.method
    )
    if band is not None:
        low, high = (1e3 * np.minimum(bound, 2 * high_m) for bound in band)
        axis.fill_between(one.x, low, high, color=colour, alpha=0.16, linewidth=0)
    broken = np.isinf(median)
    axis.plot(one.x[broken], np.full(broken.sum(), 1e3 * high_m / 1.15), "x", color=colour, markersize=7)
    if axes.is_numeric and len(one.x):
        point = breakdown(one, bound_m)
        if point.is_reached:
            axis.plot(point.value, 1e3 * bound_m, "D", color=colour, markeredgecolor="white", markersize=7, zorder=5)


def _limits(series: Sequence[Series], bound_m: float) -> tuple[float, float]:
    errors: FloatArray = np.concatenate([one.ate_m.ravel() for one in series])
    known = errors[np.isfinite(errors) & (errors > 0)]
    known = np.append(known, bound_m)
    return float(known.min() / ROOM), float(known.max() * ROOM)


def _label_x(axis: PlotAxes, axes: Axes) -> None:
    if not axes.is_numeric:
        axis.set_xticks(range(len(axes.values)), [shown(value) for value in axes.values])
        return
    if min(axes.values) > 0 and len(axes.values) > 1:
        axis.set_xscale("log")
    axis.set_xticks(axes.values, [shown(value) for value in axes.values])
    axis.xaxis.set_minor_locator(NullLocator())
    axis.xaxis.set_minor_formatter(NullFormatter())


def draw_heat_maps(path: Path, title: str, axes: Axes, series: Sequence[Series], bound_m: float) -> None:
    """Median error over the first two axes: a column for each method, a line for each combination of what else varies.

    Args:
        path: of the PNG file.
        title: of the figure.
        axes: of the sweep; at least two keys are varied.
        series: all of them.
        bound_m: cells above it are framed in black.
    """
    second, *rest = axes.others
    methods = list(dict.fromkeys(one.method for one in series))
    values = list(dict.fromkeys(one.others[second] for one in series))
    fixed = list(dict.fromkeys(tuple(one.others[key] for key in rest) for one in series))
    columns = [float(v) for v in axes.values] if axes.is_numeric else [float(k) for k in range(len(axes.values))]
    low_m, high_m = _limits(series, bound_m)
    norm = LogNorm(1e3 * low_m * ROOM, 1e3 * high_m / ROOM)
    colours = matplotlib.colormaps["YlOrRd"].with_extremes(bad="#eeeeee")
    width_in, height_in = 1.0 + 0.6 * len(columns), 0.9 + 0.5 * len(values)
    with figure_file(path, 1.0 + width_in * len(methods), 0.7 + height_in * len(fixed)) as figure:
        figure.suptitle(title, fontsize=11, fontweight="bold")
        grid = figure.subplots(len(fixed), len(methods), squeeze=False)
        image = None
        for (line, others), (column, method) in product(enumerate(fixed), enumerate(methods)):
            axis = grid[line, column]
            cells = np.full((len(values), len(columns)), np.nan)
            for one in series:
                if one.method == method and tuple(one.others[key] for key in rest) == others:
                    places = [columns.index(x) for x in one.x]
                    cells[values.index(one.others[second]), places] = 1e3 * one.median_m
            known = np.ma.masked_invalid(np.where(np.isinf(cells), 1e3 * high_m, cells))
            image = axis.imshow(known, norm=norm, cmap=colours, aspect="auto", origin="lower")
            for row, place in np.ndindex(cells.shape):
                value_mm = float(cells[row, place])
                _write_cell(axis, place, row, value_mm, float(norm(min(value_mm, 1e3 * high_m))))
                if value_mm > 1e3 * bound_m:
                    axis.add_patch(_frame(place, row))
            axis.set_xticks(range(len(columns)), [shown(value) for value in axes.values], fontsize=8)
            axis.set_yticks(range(len(values)), [shown(value) for value in values], fontsize=8)
            axis.set_xlabel(axes.x, fontsize=9)
            if column == 0:
                axis.set_ylabel(second, fontsize=9)
            fixed_text = told(dict(zip(rest, others, strict=True)))
            axis.set_title(f"{method}, {fixed_text}" if fixed_text else method, fontsize=9)
        assert image is not None
        bar = figure.colorbar(image, ax=grid, shrink=0.85, format=FuncFormatter(lambda value, _: f"{value:g}"))
        bar.set_label("median ATE, mm", fontsize=9)
        bar.ax.tick_params(labelsize=8)


def _write_cell(axis: PlotAxes, x: int, y: int, value_mm: float, depth: float) -> None:
    if np.isnan(value_mm):
        text = "-"
    elif np.isinf(value_mm):
        text = "lost"
    else:
        text = f"{value_mm:.1f}" if value_mm < 100 else f"{value_mm:.0f}"
    axis.text(x, y, text, ha="center", va="center", fontsize=8, color="white" if depth > 0.6 else "black")


def _frame(x: int, y: int) -> Rectangle:
    return Rectangle((x - 0.47, y - 0.45), 0.94, 0.9, fill=False, edgecolor="black", linewidth=1.3)


NOTE = (
    f"Lines: median over the seeds, bands: its {100 * CONFIDENCE:.0f} % bootstrap interval. Diamonds: breakdown "
    "points. Crosses at the upper edge: the median run has no error, or lost more than "
    f"{100 * LOST_SHARE:.0f} % of its frames. Frames in the heat map: above the bound."
)
"""How to read the plots."""
