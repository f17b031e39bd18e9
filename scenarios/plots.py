"""Plots, as PNG files with the same bytes every time; the plotting library is loaded when something is drawn."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dotmask.records import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DOTS_PER_INCH = 130
ORANGE, GREY, PALE = "#d1682b", "#6b6b6b", "#dddddd"


@contextmanager
def figure_file(path: Path, width_in: float, height_in: float) -> Iterator["Figure"]:
    """An empty figure to draw on inside the block; at its end it is written as a PNG file.

    It shares nothing with other plots of this process, follows the library's own style and not the user's, and the file
    does not name the program that drew it.

    Args:
        path: of the file.
        width_in: width in inches, of DOTS_PER_INCH pixels each.
        height_in: height, alike.
    """
    import matplotlib.style
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with matplotlib.style.context("default"):
        figure = Figure(figsize=(width_in, height_in), dpi=DOTS_PER_INCH, layout="constrained")
        FigureCanvasAgg(figure)
        yield figure
        figure.savefig(path, format="png", metadata={"Software": None})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scatter:
    """One panel of points.

    Attributes:
        title: of the panel.
        note: a line below it, for the figures that go with the points.
        x: (N,) counts.
        y: (N,) not negative.
    """

    title: str
    note: str
    x: FloatArray
    y: FloatArray


def draw_scatters(path: Path, title: str, x_label: str, y_label: str, panels: Sequence[Scatter]) -> None:
    """Draw panels of points side by side on the same axes.

    Points with x = 0 are grey, with a dashed line at their median: what there is anyway, without any x.
    """
    from matplotlib.ticker import MaxNLocator

    with figure_file(path, 4.6 * len(panels), 4.4) as figure:
        figure.suptitle(title, fontsize=11, fontweight="bold")
        axes = figure.subplots(1, len(panels), sharex=True, sharey=True, squeeze=False)[0]
        for axis, panel in zip(axes, panels, strict=True):
            for shown, colour, label in ((panel.x == 0, GREY, "none"), (panel.x > 0, ORANGE, "some")):
                axis.scatter(panel.x[shown], panel.y[shown], s=14, color=colour, alpha=0.5, linewidths=0, label=label)
            if (panel.x == 0).any():
                median = float(np.median(panel.y[panel.x == 0]))
                axis.axhline(median, color=GREY, linewidth=0.9, linestyle="--", label=f"median of none: {median:.3g}")
            axis.set_title(f"{panel.title}\n{panel.note}", fontsize=9)
            axis.set_xlabel(x_label, fontsize=9)
            axis.tick_params(labelsize=8)
            axis.xaxis.set_major_locator(MaxNLocator(nbins=6, integer=True))
            axis.xaxis.set_major_formatter("{x:,.0f}")
            axis.grid(color=PALE, linewidth=0.6)
            axis.set_axisbelow(True)
            axis.legend(title=x_label, fontsize=8, title_fontsize=8, loc="best")
        axes[0].set_ylabel(y_label, fontsize=9)
        axes[0].set_ylim(bottom=0)
