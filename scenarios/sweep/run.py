"""Run the cells of a plan that are not finished yet, keep each at once, and write the table."""

import fcntl
import shutil
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

from dotmask.atomic_file import write_atomically
from scenarios.errors import ScenarioError
from scenarios.finished_runs import FinishedRuns
from scenarios.run_folder import RunFolder
from scenarios.sweep.cells import Cell, CellResult, Done
from scenarios.sweep.plan import SweepPlan
from scenarios.sweep.table import TABLE, Row, rows_of, write_table

PLAN, CELLS, RUNS, LOCK = "sweep.json", "cells", "runs", ".dotmask-sweep.lock"
"""In the folder of a sweep: the plan, the finished cells, the kept run folders, and what keeps a second sweep out."""

TABLE_EVERY_S, TABLE_SHARE = 2.0, 0.05
"""How often the table is renewed while cells are done, at most, and what share of the time that may take."""

Executor = Callable[[Sequence[Cell]], Generator[tuple[Cell, Done], None, None]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """How far a sweep is: cells that are done, failed ones among them, and how many of them an earlier command did."""

    done: int
    failed: int
    before: int


def sweep(
    plan: SweepPlan,
    out: Path,
    execute: Executor,
    *,
    keep_runs: bool = False,
    retry_failed: bool = False,
    show: Callable[[Progress], None] = lambda progress: None,
) -> Progress:
    """Run a plan and leave `out/table.parquet`, with the rows in the order of the plan.

    A cell is finished when its file in `out/cells` is there, which is renamed to its place. So the same command
    continues a sweep that was stopped at any moment. Finished cells of another plan stay and are not in the table.

    Args:
        plan: what to run.
        out: folder of the sweep.
        execute: runs cells, see `scenarios.sweep.executors`.
        keep_runs: whether each run's folder is kept in `out/runs`; its files must come with `Done`.
        retry_failed: whether cells that failed before are run again.
        show: called at the beginning and after every cell.

    Raises:
        ScenarioError: `out` holds other files, is in use by another sweep, or cannot be written to.
    """
    with _folder(out):
        finished = FinishedRuns(out / CELLS, CellResult)
        _write(out / PLAN, plan.to_json())
        rows: dict[str, list[Row]] = {}
        for cell in plan.cells:
            result = finished.load(cell.key)
            if result is None or (retry_failed and result.error is not None):
                continue
            if keep_runs and result.error is None and not (out / RUNS / cell.name).is_dir():
                continue
            rows[cell.name] = list(rows_of(cell, result))
        before, next_s = len(rows), 0.0

        def progress() -> Progress:
            failed = sum(of_cell[0]["error"] is not None for of_cell in rows.values())
            return Progress(done=len(rows), failed=failed, before=before)

        show(progress())
        with closing(execute([cell for cell in plan.cells if cell.name not in rows])) as executed:
            for cell, done in executed:
                if keep_runs and done.files:
                    _keep(out / RUNS / cell.name, done)
                finished.save(cell.key, done.result)
                rows[cell.name] = list(rows_of(cell, done.result))
                start_s = time.monotonic()
                if start_s > next_s:
                    _write_table(out, plan, rows)
                    now_s = time.monotonic()
                    next_s = now_s + max(TABLE_EVERY_S, (now_s - start_s) / TABLE_SHARE)
                show(progress())
        _write_table(out, plan, rows)
        return progress()


def _write_table(out: Path, plan: SweepPlan, rows: dict[str, list[Row]]) -> None:
    in_order = [row for cell in plan.cells for row in rows.get(cell.name, ())]
    write_table(out / TABLE, in_order, plan.varied)


def _keep(folder: Path, done: Done) -> None:
    """Keep a run folder; one that is there was left by a sweep that was stopped before the cell was finished."""
    shutil.rmtree(folder, ignore_errors=True)
    with RunFolder(folder) as kept:
        for name, content in done.files.items():
            (kept.path / name).write_bytes(content)


def _write(path: Path, text: str) -> None:
    try:
        write_atomically(path, text)
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be written ({error.strerror})") from error


@contextmanager
def _folder(out: Path) -> Iterator[None]:
    """The folder for one sweep alone, without what a killed one left half written.

    Raises:
        ScenarioError: as `sweep`.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        if any(out.iterdir()) and not (out / LOCK).exists():
            raise ScenarioError(f"--out {out}: holds other files; give a new folder, or that of a sweep to continue it")
        lock = (out / LOCK).open("w")
    except OSError as error:
        raise ScenarioError(f"--out {out}: cannot be used ({error.strerror})") from error
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)  # ends with this process, however that ends
        except OSError:
            raise ScenarioError(f"--out {out}: another sweep is running there") from None
        for pattern in (".*.tmp", f"{CELLS}/.*.tmp"):
            for left in out.glob(pattern):
                left.unlink(missing_ok=True)
        for folder in out.glob(f"{RUNS}/.*.partial-*"):
            shutil.rmtree(folder, ignore_errors=True)
        yield
