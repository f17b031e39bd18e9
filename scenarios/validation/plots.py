"""Plots of the validation page: each function draws on an empty figure."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dotmask.records import FloatArray

_BAND = {"color": "0.85", "zorder": 0}


def averages_over_time(
    figure: Figure,
    curves: Mapping[str, tuple[FloatArray, FloatArray]],
    bounds: tuple[tuple[float, float], tuple[float, float]],
    *,
    is_log: bool = False,
) -> None:
    """Average NEES and NIS at each frame, with the interval that a consistent filter's stay in.

    Args:
        figure: to draw on.
        curves: by name (T,) average NEES and (T,) average NIS.
        bounds: of both.
        is_log: whether the values span decades.
    """
    axes = figure.subplots(1, 2)
    for axis, title, interval, k in zip(axes, ("NEES (6)", "NIS (3)"), bounds, (0, 1), strict=True):
        axis.axhspan(*interval, **_BAND)
        for name, values in curves.items():
            axis.plot(np.arange(1, len(values[k]) + 1), values[k], label=name, linewidth=1.2)
        _label(axis, "frame", f"average {title}")
        if is_log:
            axis.set_yscale("log")
        else:
            axis.set_ylim(0, sum(interval))
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=7)


def lines(
    figure: Figure,
    x: Sequence[float],
    curves: Mapping[str, Sequence[float | None]],
    x_label: str,
    y_label: str,
    *,
    is_log_x: bool = False,
) -> None:
    """Curves over a common axis; None leaves a gap."""
    axis = figure.subplots()
    for name, values in curves.items():
        axis.plot(x, [np.nan if v is None else v for v in values], "o-", label=name, markersize=4, linewidth=1.2)
    if is_log_x:
        axis.set_xscale("log")
    axis.set_ylim(bottom=0)
    _label(axis, x_label, y_label)
    axis.legend(fontsize=8)


def receiver_curves(
    figure: Figure, curves: Mapping[str, tuple[FloatArray, FloatArray]], points: Mapping[str, tuple[float, float]]
) -> None:
    """ROC curves.

    Args:
        figure: to draw on.
        curves: by name the false and the true positive rate (T,) at each threshold.
        points: by name of a curve where the profile's own threshold lies.
    """
    axis = figure.subplots()
    for name, (false_rate, true_rate) in curves.items():
        (line,) = axis.plot(false_rate, true_rate, "-", label=name, linewidth=1.2)
        if name in points:
            axis.plot(*points[name], "o", color=line.get_color())
    _label(axis, "false positive rate", "true positive rate")
    axis.set_xlim(-0.02, 1.02)
    axis.set_ylim(-0.02, 1.02)
    axis.legend(fontsize=8, loc="lower right")


def bars(figure: Figure, groups: Sequence[str], series: Mapping[str, Sequence[float | None]], y_label: str) -> None:
    """Bars side by side: a group for each scenario, a colour for each profile."""
    axis = figure.subplots()
    width = 0.8 / len(series)
    for k, (name, values) in enumerate(series.items()):
        places = np.arange(len(groups)) + (k - 0.5 * (len(series) - 1)) * width
        axis.bar(places, [0.0 if v is None else v for v in values], width, label=name)
    axis.set_xticks(np.arange(len(groups)), groups, rotation=30, ha="right", fontsize=8)
    axis.set_ylabel(y_label)
    axis.grid(axis="y", alpha=0.3)
    axis.legend(fontsize=8)


def _label(axis: Axes, x_label: str, y_label: str) -> None:
    axis.set_xlabel(x_label)
    axis.set_ylabel(y_label)
    axis.grid(alpha=0.3)
