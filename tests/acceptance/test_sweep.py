"""Sweeps of real runs: killed and continued, and on a local Ray cluster."""

import os
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import pytest

from scenarios.errors import ScenarioError
from scenarios.registry import scenario
from scenarios.run import RunSettings, run
from scenarios.spec import Scenario, with_overrides
from scenarios.sweep.cells import Cell, run_cell
from scenarios.sweep.executors import Executed, run_ray
from scenarios.sweep.plan import SweepPlan
from scenarios.sweep.run import sweep
from scenarios.sweep.table import is_time, read_table

ROOT = Path(__file__).parents[2]

CHANGES = {
    "room": "bare", "frames": "3", "camera.width": "96", "camera.height": "72",
    "camera.fx": "80", "camera.fy": "80", "camera.cx": "47.5", "camera.cy": "35.5",
}  # fmt: skip
ARGUMENTS = ("--vary", "camera.speed=1,2,4", "--methods", "unmasked,dotmask")


def tiny() -> Scenario:
    return with_overrides(scenario("smoke"), CHANGES)


def whole_plan() -> SweepPlan:
    return SweepPlan.parse(tiny(), vary=["camera.speed=1,2,4"], methods="unmasked,dotmask")


def inline(cells: Sequence[Cell]) -> Executed:
    return ((cell, run_cell(cell)) for cell in cells)


def without_times(folder: Path) -> list[dict]:
    rows = read_table(folder / "table.parquet")
    return [{name: value for name, value in row.items() if not is_time(name)} for row in rows]


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory: pytest.TempPathFactory) -> list[dict]:
    out = tmp_path_factory.mktemp("sweep") / "whole"
    sweep(whole_plan(), out, inline)
    return without_times(out)


def test_a_row_is_what_a_run_reports(uninterrupted: list[dict], tmp_path: Path) -> None:
    fast = with_overrides(tiny(), {"camera.speed": "4"})
    report = run(fast, RunSettings.parse(methods="unmasked,dotmask"), tmp_path / "run", lambda: None)
    row = uninterrupted[-1]
    assert (row["camera.speed"], row["method"], row["error"]) == (4.0, "dotmask", None)
    assert row["frame_hash"] == report.frame_hash
    assert row["ate_rmse_m"] == report.methods["dotmask"].ate_rmse_m
    assert row["masks.leak"] == report.methods["dotmask"].masks.leak


def test_killed_and_continued_on_all_cores(uninterrupted: list[dict], tmp_path: Path) -> None:
    sets = [part for key, value in CHANGES.items() for part in ("--set", f"{key}={value}")]
    out = tmp_path / "out"
    command = [sys.executable, "-m", "scenarios.cli", "sweep", "smoke", *ARGUMENTS, *sets, "--keep-runs"]
    command += ["--jobs", "2", "--out", str(out)]
    process = subprocess.Popen(command, cwd=ROOT, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 300
    while not list(out.glob("cells/*.json")) and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.02)
    process.kill()
    process.wait()
    finished = {path: path.stat().st_mtime_ns for path in out.glob("cells/*.json")}
    assert 1 <= len(finished) < 3
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == str(out / "table.parquet")
    assert without_times(out) == uninterrupted
    assert {path: path.stat().st_mtime_ns for path in finished} == finished, "none was run again"
    assert {path.stem for path in out.glob("cells/*.json")} == {path.name for path in out.glob("runs/*")}
    assert all((folder / "report.json").is_file() for folder in out.glob("runs/*"))


@pytest.mark.skipif(find_spec("ray") is None, reason="needs Ray: pip install 'dotmask[ray]'")
@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::FutureWarning", "ignore::DeprecationWarning")
def test_ray_gives_the_same_table(uninterrupted: list[dict], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(ROOT), prepend=os.pathsep)
    sweep(whole_plan(), tmp_path / "out", partial(run_ray, run_cell, address=None))
    assert without_times(tmp_path / "out") == uninterrupted


@pytest.mark.skipif(find_spec("ray") is None, reason="needs Ray: pip install 'dotmask[ray]'")
@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::FutureWarning", "ignore::DeprecationWarning")
def test_so_does_a_ray_cluster_that_runs_already(
    uninterrupted: list[dict], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from ray.cluster_utils import Cluster

    monkeypatch.setenv("PYTHONPATH", str(ROOT), prepend=os.pathsep)
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 2, "include_dashboard": False})
    try:
        sweep(whole_plan(), tmp_path / "out", partial(run_ray, run_cell, address=cluster.address))
    finally:
        cluster.shutdown()
    assert without_times(tmp_path / "out") == uninterrupted


@pytest.mark.skipif(find_spec("ray") is None, reason="needs Ray: pip install 'dotmask[ray]'")
def test_an_address_where_nobody_listens_is_refused_at_once(tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))  # and never listens
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(ScenarioError, match=f"--address {address}: nobody answers there"):
            sweep(whole_plan(), tmp_path / "out", partial(run_ray, run_cell, address=address))
