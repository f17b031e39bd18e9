"""The report of a sweep: plots, breakdown points and the table, in one HTML file that needs nothing else."""

import base64
import html
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dotmask.atomic_file import write_atomically
from scenarios.errors import ScenarioError
from scenarios.sweep.figures import NOTE, draw_errors, draw_heat_maps, shown, told
from scenarios.sweep.run import PLAN, RUNS
from scenarios.sweep.statistics import Axes, Breakdown, Series, breakdown, gain, series_of
from scenarios.sweep.table import TABLE, Row, read_table

PAGE, PLOTS = "report.html", "plots"

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #222; background: #fafafa; margin: 0 auto; max-width: 1180px;
  padding: 24px; }
h1 { font-size: 26px; margin: 0 0 4px; } h2 { font-size: 19px; margin: 32px 0 8px; }
p, li { max-width: 85ch; } .note { color: #666; font-size: 13px; }
img { max-width: 100%; background: white; border: 1px solid #ddd; border-radius: 6px; }
.scroll { overflow: auto; max-height: 70vh; border: 1px solid #ddd; border-radius: 6px; background: white; }
table { border-collapse: collapse; font-size: 13px; width: 100%; font-variant-numeric: tabular-nums; }
th { position: sticky; top: 0; background: #f0f0f0; text-align: right; font-weight: 600; }
td { text-align: right; border-top: 1px solid #eee; } th, td { padding: 4px 10px; white-space: nowrap; }
th.text, td.text { text-align: left; } tr:hover td { background: #fff6ef; }
td.error { color: #b00020; text-align: left; white-space: normal; min-width: 24em; } a { color: #b4520f; }
code { background: #f0f0f0; padding: 1px 4px; border-radius: 3px; }
"""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Analysis:
    """What is drawn and told of a sweep.

    Attributes:
        plan: as in sweep.json.
        rows: of the table.
        axes: of the plots.
        series: all of them.
        breakdowns: beside `series`; None where the first axis has no numbers.
        bound_m: of the breakdown.
    """

    plan: Mapping[str, Any]
    rows: Sequence[Row]
    axes: Axes
    series: Sequence[Series]
    breakdowns: Sequence[Breakdown | None]
    bound_m: float


def analyse(folder: Path, bound_m: float) -> Analysis:
    """Read the folder of a sweep, finished or not.

    Raises:
        ScenarioError: it is none, or no cell of it has a result.
    """
    if not bound_m > 0:
        raise ScenarioError(f"--bound {bound_m:g}: give a length above 0, in metres")
    try:
        plan = json.loads((folder / PLAN).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ScenarioError(f"{folder}: no folder of a sweep ({PLAN} cannot be read); run `dotmask sweep`") from error
    rows = read_table(folder / TABLE)
    axes = Axes.of(plan["varied"])
    series = series_of(rows, axes)
    breakdowns = [breakdown(one, bound_m) if axes.is_numeric and len(one.x) else None for one in series]
    return Analysis(plan=plan, rows=rows, axes=axes, series=series, breakdowns=breakdowns, bound_m=bound_m)


def draw(analysis: Analysis, folder: Path, prefix: str = "") -> dict[str, Path]:
    """Draw the plots of a sweep into a folder, which is made where it is missing.

    Returns:
        What to read where no picture is shown, to the file.
    """
    folder.mkdir(parents=True, exist_ok=True)
    axes, name = analysis.axes, analysis.plan["scenario"]
    drawn = {f"{name}: error against {axes.x}": folder / f"{prefix}error.png"}
    draw_errors(drawn[f"{name}: error against {axes.x}"], f"{name}: error", axes, analysis.series, analysis.bound_m)
    if axes.others:
        title = f"{name}: median error over {axes.x} and {axes.others[0]}"
        drawn[title] = folder / f"{prefix}heat_map.png"
        draw_heat_maps(drawn[title], title, axes, analysis.series, analysis.bound_m)
    return drawn


def breakdown_rows(analysis: Analysis) -> Iterator[tuple[list[str], str, str]]:
    """The other parameters, the method and its breakdown point, a line for each series."""
    for one, point in zip(analysis.series, analysis.breakdowns, strict=True):
        if point is not None:
            yield [shown(value) for value in one.others.values()], one.method, point.text()


def summary_rows(analysis: Analysis) -> Iterator[list[str]]:
    """The other parameters, the value of the first axis, the method; median error in mm, its interval, gain, lost."""
    reference = {told(one.others): one for one in reversed(analysis.series)}  # of each panel the first method
    names = dict(enumerate(analysis.axes.values))
    for one in analysis.series:
        base = reference[told(one.others)]
        band, better = one.band_m(), gain(one, base)
        shared = {x: k for k, x in enumerate(np.intersect1d(one.x, base.x))}
        for k, x in enumerate(one.x):
            value = float(x) if analysis.axes.is_numeric else names[int(x)]
            yield [
                *(shown(other) for other in one.others.values()),
                shown(value),
                one.method,
                _millimetres(one.median_m[k]),
                "-" if band is None else f"{_millimetres(band[0, k])} to {_millimetres(band[1, k])}",
                _factor(better.factor, better.band, shared.get(x)) if one is not base else "",
                f"{100 * np.nanmean(one.lost[:, k]):.1f}",
            ]


def _millimetres(value_m: float) -> str:
    return "lost" if np.isinf(value_m) else "-" if np.isnan(value_m) else f"{1e3 * value_m:.1f}"


def _factor(factor: Any, band: Any, place: int | None) -> str:
    if place is None:
        return "-"
    text = f"{factor[place]:.3g}"
    return text if band is None else f"{text} ({band[0, place]:.3g} to {band[1, place]:.3g})"


def summary_header(analysis: Analysis) -> list[str]:
    """Of `summary_rows`."""
    first = analysis.plan["methods"][0]
    keys = [*analysis.axes.others, analysis.axes.x]
    return [*keys, "method", "ATE, mm", "95 % interval", f"times better than {first}", "frames lost, %"]


def write_report(folder: Path, bound_m: float) -> Path:
    """Draw the plots into `folder/plots` and write `folder/report.html`.

    Args:
        folder: of a sweep.
        bound_m: of the breakdown.

    Returns:
        The page.

    Raises:
        ScenarioError: see `analyse`, or the folder cannot be written to.
    """
    analysis = analyse(folder, bound_m)
    try:
        pictures = draw(analysis, folder / PLOTS)
        write_atomically(folder / PAGE, page(analysis, pictures, folder))
    except OSError as error:
        raise ScenarioError(f"{folder / PAGE}: cannot be written ({error.strerror})") from error
    return folder / PAGE


def page(analysis: Analysis, pictures: Mapping[str, Path], folder: Path) -> str:
    """The text of the page.

    Args:
        analysis: what to tell.
        pictures: see `draw`.
        folder: of the sweep, to see which runs were kept.
    """
    plan, axes = analysis.plan, analysis.axes
    failed = {row["cell"] for row in analysis.rows if row["error"] is not None}
    cells = {row["cell"] for row in analysis.rows}
    varied = "; ".join(f"<code>{_text(key)}</code> {_text(_list(values))}" for key, values in plan["varied"].items())
    parts = [
        f"<h1>Sweep of {_text(plan['scenario'])}</h1>",
        f"<p>{varied}; seeds {_text(_list(plan['seeds']))}; methods {_text(_list(plan['methods']))}.<br>"
        f"{len(cells)} of {plan['cells']} cells are done, {len(failed)} of them failed. "
        f"dotmask {_text(analysis.rows[0]['version'])}, code <code>{analysis.rows[0]['code'][:12]}</code>.</p>",
    ]
    if axes.is_numeric:
        parts += [
            f"<h2>Breakdown points: where the median ATE exceeds {1e3 * analysis.bound_m:g} mm</h2>",
            _table(
                [*axes.others, "method", axes.x],
                [[*others, method, text] for others, method, text in breakdown_rows(analysis)],
                texts=len(axes.others) + 2,
            ),
            "<p class='note'>Interpolated on logarithmic scales between the values that were run; in brackets the 95 % "
            "bootstrap interval over the seeds.</p>",
        ]
    for title, path in pictures.items():
        data = base64.b64encode(path.read_bytes()).decode()
        parts += [f"<h2>{_text(title)}</h2>", f'<img alt="{_text(title)}" src="data:image/png;base64,{data}">']
    parts += [
        f"<p class='note'>{_text(NOTE)}</p>",
        "<h2>Medians over the seeds</h2>",
        _table(summary_header(analysis), list(summary_rows(analysis)), texts=len(axes.others) + 2),
        "<h2>All runs</h2>",
        _runs_table(analysis, folder),
        f"<p class='note'>All figures of every run are in <code>{TABLE}</code>.</p>",
    ]
    return (
        f"<!DOCTYPE html>\n<html lang='en'>\n<head>\n<meta charset='utf-8'>\n"
        f"<meta name='viewport' content='width=device-width'>\n<title>Sweep of {_text(plan['scenario'])}</title>\n"
        f"<style>{STYLE}</style>\n</head>\n<body>\n" + "\n".join(parts) + "\n</body>\n</html>\n"
    )


COLUMNS: tuple[tuple[str, str, float, int], ...] = (
    ("ATE, mm", "ate_rmse_m", 1e3, 1),
    ("RPE, mm", "rpe_trans_rmse_m", 1e3, 2),
    ("frames", "frames", 1, 0),
    ("lost", "lost_frames", 1, 0),
    ("MOC precision", "moc.precision", 1, 3),
    ("MOC recall", "moc.recall", 1, 3),
    ("leak, %", "masks.leak", 1e2, 1),
    ("waste, %", "masks.waste", 1e2, 1),
    ("wall, s", "wall_s", 1, 1),
)


def _runs_table(analysis: Analysis, folder: Path) -> str:
    keys = [*analysis.plan["varied"], "seed", "method"]
    head = "".join(f"<th class='text'>{_text(key)}</th>" for key in keys)
    head += "".join(f"<th>{_text(heading)}</th>" for heading, *_ in COLUMNS) + "<th class='text'>frames' hash</th>"
    lines = []
    for row in analysis.rows:
        cells = [f"<td class='text'>{_text(row[key])}</td>" for key in keys]
        if row["error"] is not None:
            cells.append(f"<td class='error' colspan='{len(COLUMNS) + 1}'>{_text(row['error'])}</td>")
        else:
            cells += [f"<td>{_number(row[name], scale, digits)}</td>" for _, name, scale, digits in COLUMNS]
            run = folder / RUNS / row["cell"]
            label = _text(row["frame_hash"][:10])
            linked = f"<a href='{RUNS}/{_text(run.name)}/'>{label}</a>" if run.is_dir() else label
            cells.append(f"<td class='text'>{linked}</td>")
        lines.append(f"<tr>{''.join(cells)}</tr>")
    return f"<div class='scroll'><table><thead><tr>{head}</tr></thead><tbody>{''.join(lines)}</tbody></table></div>"


def _number(value: float | None, scale: float, digits: int) -> str:
    return "-" if value is None else f"{scale * value:.{digits}f}"


def _table(header: Sequence[str], rows: Sequence[Sequence[str]], texts: int) -> str:
    kinds = [" class='text'" if k < texts else "" for k in range(len(header))]
    head = "".join(f"<th{kind}>{_text(cell)}</th>" for kind, cell in zip(kinds, header, strict=True))
    body = "".join(
        "<tr>" + "".join(f"<td{kind}>{_text(cell)}</td>" for kind, cell in zip(kinds, row, strict=True)) + "</tr>"
        for row in rows
    )
    return f"<div class='scroll'><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"


def _list(values: Sequence[Any]) -> str:
    return ", ".join(shown(value) for value in values)


def _text(value: Any) -> str:
    return html.escape(shown(value))
