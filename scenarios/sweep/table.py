"""The table of a sweep: a row for every cell and method, one Parquet file."""

import io
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from dotmask.atomic_file import write_atomically
from scenarios.errors import ScenarioError
from scenarios.finished_runs import figure_settings
from scenarios.report import figure, figure_types
from scenarios.sweep.cells import Cell, CellResult

TABLE = "table.parquet"

SETTINGS = ("segmenter", "slam", "profile", "pose_feedback", "renderer")
"""Settings of the run that every row states."""

Row = dict[str, Any]


def is_time(column: str) -> bool:
    """Whether a column holds a measured time: all others are the same in every sweep of the same plan."""
    return column == "wall_s" or column.startswith("time_ms.")


def rows_of(cell: Cell, result: CellResult) -> Iterator[Row]:
    """The rows of a cell, one for each method. Figures that were not measured are None, of a failed cell all are."""
    scenario, settings = cell.scenario, cell.settings
    report = result.report
    common: Row = {
        "cell": cell.name,
        "scenario": scenario.name,
        **cell.varied,
        "seed": scenario.seed,
    }
    stated = {"frames": scenario.frames, "frame_rate_hz": scenario.frame_rate_hz}
    stated |= {name: getattr(settings, name) for name in SETTINGS}
    for method in settings.methods:
        measured = None if report is None else report.methods[method]
        yield {
            **common,
            "method": method,
            **{name: value for name, value in stated.items() if name not in common},
            "lost_frames": None if measured is None else scenario.frames - measured.tracked_frames,
            **{name: None if measured is None else figure(measured, name) for name in figure_types()},
            "time_ms.render": None if report is None else report.time_ms.render,
            "wall_s": result.wall_s,
            "frame_hash": None if report is None else report.frame_hash,
            "version": cell.key["versions"]["dotmask"],
            "code": cell.key["code"],
            "error": result.error,
            "scenario_json": scenario.to_json(),
            "settings_json": json.dumps(figure_settings(settings)),
        }


def write_table(path: Path, rows: Sequence[Row], varied: Mapping[str, Sequence[Any]]) -> None:
    """Write the table, whole or not at all.

    Args:
        path: of the Parquet file.
        rows: at least one, see `rows_of`.
        varied: key to its values, which decide the type of its column.

    Raises:
        ScenarioError: it cannot be written.
    """
    types = {name: pa.int64() if kind is int else pa.float64() for name, kind in figure_types().items()}
    types |= {name: pa.int64() for name in ("seed", "frames", "lost_frames")}
    types |= {name: pa.float64() for name in ("frame_rate_hz", "wall_s", "time_ms.render")}
    types |= {name: _type(values) for name, values in varied.items()}
    schema = pa.schema([(name, types.get(name, pa.string())) for name in rows[0]])
    texts = {name for name in varied if schema.field(name).type == pa.string()}
    told = [{name: _text(value) if name in texts else value for name, value in row.items()} for row in rows]
    buffer = io.BytesIO()
    pq.write_table(pa.Table.from_pylist(told, schema=schema), buffer, compression="zstd")
    try:
        write_atomically(path, buffer.getvalue())
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be written ({error.strerror}); make room and run it again") from error


def read_table(path: Path) -> list[Row]:
    """The rows of a table.

    Raises:
        ScenarioError: it cannot be read.
    """
    try:
        # Without threads: a process that ends soon after them is aborted by Arrow, as of version 26.
        rows: list[Row] = pq.read_table(io.BytesIO(path.read_bytes()), use_threads=False).to_pylist()
    except (OSError, pa.ArrowException) as error:
        raise ScenarioError(f"{path}: cannot be read ({error}); run `dotmask sweep` first") from error
    return rows


def _type(values: Sequence[Any]) -> pa.DataType:
    kinds = {type(value) for value in values if value is not None}
    if kinds == {bool}:
        return pa.bool_()
    if kinds == {int}:
        return pa.int64()
    return pa.float64() if kinds and kinds <= {int, float} else pa.string()


def _text(value: Any) -> str | None:
    return value if value is None or isinstance(value, str) else json.dumps(value)
