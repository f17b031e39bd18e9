"""What every section of the validation page shares: where it writes, how long it may take, and its tables."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from scenarios.plots import figure_file
from scenarios.validation.runs import Runs


@dataclass(frozen=True, slots=True, kw_only=True)
class Context:
    """What a section is given.

    Attributes:
        folder: for the plots.
        is_quick: few seeds and frames: to see that everything runs, not to learn anything.
        runs: scenarios that were run already, for all sections.
        advance: called after every frame or episode.
    """

    folder: Path
    is_quick: bool
    runs: Runs
    advance: Callable[[], None]

    def plot(
        self, name: str, alternative: str, draw: Callable[[Figure], None], size_in: tuple[float, float] = (5.6, 3.8)
    ) -> str:
        """Write a plot and return the Markdown that shows it.

        Args:
            name: of the file.
            alternative: what to read where no picture is shown.
            draw: on an empty figure.
            size_in: width and height, inches.
        """
        with figure_file(self.folder / f"{name}.png", *size_in) as figure:
            draw(figure)
        return f"![{alternative}]({self.folder.name}/{name}.png)"


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """One part of the page.

    Attributes:
        name: for `--only`.
        title: its heading.
        write: the Markdown below the heading; plots are written on the way.
    """

    name: str
    title: str
    write: Callable[[Context], str]


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]], texts: int = 1) -> str:
    """A Markdown table: the first `texts` columns are text, the others are numbers."""
    lines = [header, ["---"] * texts + ["---:"] * (len(header) - texts), *rows]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)


def number(value: float | None, digits: int = 2, scale: float = 1.0) -> str:
    """A figure of a table; - where it was not measured."""
    return "-" if value is None else f"{value * scale:.{digits}f}"


def bounds(interval: tuple[float, float] | None, digits: int = 2) -> str:
    """`low to high`."""
    return "-" if interval is None else f"{interval[0]:.{digits}f} to {interval[1]:.{digits}f}"
