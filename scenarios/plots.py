"""Plots, as PNG files with the same bytes every time; the plotting library is loaded when something is drawn."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dotmask.records import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DOTS_PER_INCH = 130
BLUE, ORANGE, GREY = "#2b6ca3", "#d1682b", "#6b6b6b"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scatter:
    """One panel of points.

    Attributes:
        title: of the panel.
        note: a line below it, for the figures that go with the points.
        x, y: (N,) in the units of the axes.
    """

    title: str
    note: str
    x: FloatArray
    y: FloatArray


def new_figure(width_in: float, height_in: float) -> "Figure":
    """An empty figure that no other plot in this process shares anything with."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), dpi=DOTS_PER_INCH, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: "Figure", path: Path) -> None:
    """Write `figure` as a PNG file without the name and version of the program that drew it."""
    figure.savefig(path, format="png", metadata={"Software": None})


def draw_scatters(path: Path, title: str, x_label: str, y_label: str, panels: Sequence[Scatter]) -> None:
    """Draw panels of points side by side on the same axes.

    The points with x = 0 are drawn in grey, with a line at their median: what there is without x.
    """
    figure = new_figure(4.6 * len(panels), 4.4)
    figure.suptitle(title, fontsize=11, fontweight="bold")
    axes = figure.subplots(1, len(panels), sharex=True, sharey=True, squeeze=False)[0]
    for axis, panel in zip(axes, panels, strict=True):
        is_zero = panel.x == 0
        axis.scatter(panel.x[is_zero], panel.y[is_zero], s=9, color=GREY, alpha=0.35, linewidths=0)
        axis.scatter(panel.x[~is_zero], panel.y[~is_zero], s=13, color=ORANGE, alpha=0.7, linewidths=0)
        if is_zero.any():
            axis.axhline(float(np.median(panel.y[is_zero])), color=GREY, linewidth=0.8, linestyle="--")
        axis.set_title(f"{panel.title}\n{panel.note}", fontsize=9)
        axis.set_xlabel(x_label, fontsize=9)
        axis.tick_params(labelsize=8)
        axis.grid(color="#dddddd", linewidth=0.6)
        axis.set_axisbelow(True)
    axes[0].set_ylabel(y_label, fontsize=9)
    axes[0].set_ylim(bottom=0)
    save_figure(figure, path)
