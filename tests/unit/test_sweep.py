"""Sweeps: the plan, that nothing is lost or repeated, the table, the figures over seeds, the page."""

import math
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from scenarios.errors import ScenarioError
from scenarios.registry import scenario
from scenarios.report import MethodReport, Report, SegmenterReport, StageTimes, WorldTimes
from scenarios.spec import scenario_from_json
from scenarios.sweep import page
from scenarios.sweep.cells import Cell, CellResult, Done
from scenarios.sweep.executors import Executed
from scenarios.sweep.plan import SweepPlan
from scenarios.sweep.run import Progress, sweep
from scenarios.sweep.statistics import Axes, Series, breakdown, crossing, gain, series_of
from scenarios.sweep.table import is_time, read_table

SMOKE = scenario("smoke")
SPEEDS = ("camera.speed=1,2,4", "people.speed=0.5,1")


def ates(cell: Cell) -> dict[str, float]:
    """What the stub measures: dotmask grows with the square of the speed, unmasked is broken everywhere."""
    seed, speed = cell.scenario.seed, cell.scenario.camera.speed
    return {"unmasked": 0.4, "mdi": 0.004, "dotmask": 0.01 * speed**2 * (1 + 0.1 * seed)}


def stub(cell: Cell) -> Done:
    """A run that takes no time; of camera speed 2 and seed 1 it fails."""
    if cell.scenario.camera.speed == 2 and cell.scenario.seed == 1:
        return Done(result=CellResult(error="SimError: nobody <is> there"))
    methods = {
        name: MethodReport(
            ate_rmse_m=ate,
            rpe_trans_rmse_m=ate / 10,
            rpe_rot_rmse_rad=0.01,
            tracked_frames=cell.scenario.frames - (6 if name == "mdi" else 0),
            time_ms=StageTimes(odometry=time.perf_counter()),
        )
        for name, ate in ates(cell).items()
    }
    report = Report(
        scenario=cell.scenario.name,
        seed=cell.scenario.seed,
        frames=cell.scenario.frames,
        renderer="numba",
        segmenter=SegmenterReport(name="oracle"),
        slam="embedded",
        profile="calibrated",
        frame_hash=cell.name,
        methods=methods,
        time_ms=WorldTimes(render=time.perf_counter()),
    )
    return Done(result=CellResult(report=report, wall_s=time.perf_counter()), files={"report.json": b"{}"})


def inline(cells: Sequence[Cell]) -> Executed:
    """An executor that runs the stub here, the last cell first: the order must not matter."""
    return ((cell, stub(cell)) for cell in reversed(cells))


def plan(*vary: str, **options) -> SweepPlan:
    return SweepPlan.parse(SMOKE, vary=vary or SPEEDS, **options)


def without_times(folder: Path) -> list[dict]:
    rows = read_table(folder / "table.parquet")
    return [{name: value for name, value in row.items() if not is_time(name)} for row in rows]


def test_cells_are_every_combination_in_order() -> None:
    cells = plan("camera.speed=1,0.5", "profile=paper,calibrated", seeds=2, methods="dotmask").cells
    assert [(c.varied["camera.speed"], c.varied["profile"], c.scenario.seed) for c in cells] == [
        (speed, profile, seed) for speed in (1.0, 0.5) for profile in ("paper", "calibrated") for seed in (0, 1)
    ]
    assert [(c.scenario.camera.speed, c.settings.profile) for c in cells[2:4]] == [(1.0, "calibrated")] * 2
    assert {c.settings.pose_feedback for c in cells if c.settings.profile == "paper"} == {"previous"}
    assert {c.settings.methods for c in cells} == {("dotmask",)}
    assert [c.scenario.seed for c in plan(seed="7,3").cells[:2]] == [7, 3]


def test_values_may_be_json_lists() -> None:
    cells = plan("camera.position_m=[0,-2.3,1.4],[0,-2,1.4]").cells
    assert [c.scenario.camera.position_m for c in cells] == [(0, -2.3, 1.4), (0, -2, 1.4)]
    assert cells[0].varied["camera.position_m"] == "[0.0, -2.3, 1.4]"


def test_another_frame_rate_keeps_the_duration() -> None:
    cells = plan("frame_rate_hz=30,14,8").cells
    assert [c.scenario.frames for c in cells] == [60, 29, 17], "59/30 s, rounded to whole frames"
    for cell in cells:
        assert cell.scenario.duration_s == pytest.approx(SMOKE.duration_s, abs=0.5 / cell.scenario.frame_rate_hz)
    both = plan("frame_rate_hz=30,14", "frames=10,20").cells
    assert [c.scenario.frames for c in both] == [10, 20, 10, 20], "said so, so it is"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "--vary: name at least one key with its values"),
        (["--vary", "camera.sped=1,2"], "--vary camera.sped: unknown key 'sped'; valid keys under 'camera': width"),
        (["--vary", "camera.speed"], "expected KEY=VALUE"),
        (["--vary", "camera.speed="], "a value is missing"),
        (["--vary", "camera.speed=1,,2"], "a value is missing"),
        (["--vary", "camera.speed=1,1"], "given twice"),
        (["--vary", "camera.speed=1,1.0"], "are the same run"),
        (["--vary", "camera.speed=1", "--vary", "camera.speed=2"], "varied twice"),
        (["--vary", "camera.speed=1,fast"], "--vary: camera.speed: Input should be a valid number"),
        (["--vary", "camera.speed=1,-1"], "greater than 0"),
        (["--vary", "pose_feedback=previous,refind"], "unknown pose feedback 'refind'. Did you mean refined?"),
        (["--vary", "profile=papr"], "papr"),
        (["--vary", "seed=1,2"], "use --seeds or --seed"),
        (["--vary", "methods=mdi"], "use --methods"),
        (["--vary", "camera.speed=1", "--seeds", "0"], "run at least one"),
        (["--vary", "camera.speed=1", "--seeds", "2", "--seed", "3"], "not both"),
        (["--vary", "camera.speed=1", "--seed", "a"], "expected whole numbers"),
        (["--vary", "camera.speed=1", "--executor", "rey"], "Did you mean ray?"),
        (["--vary", "camera.speed=1", "--address", "auto"], "--address is for --executor ray"),
    ],
)
def test_bad_input_is_one_line_before_the_first_run(tmp_path: Path, dotmask, arguments, message) -> None:
    done = dotmask("sweep", "smoke", *arguments, "--out", tmp_path / "out")
    lines = [line for line in done.err.splitlines() if line.strip()]
    assert (done.code, len(lines), message in lines[0]) == (2, 1, True), done.err
    assert not (tmp_path / "out").exists()


def test_a_foreign_folder_and_a_second_sweep_are_refused(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("")
    with pytest.raises(ScenarioError, match="holds other files"):
        sweep(plan(), tmp_path, inline)
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.tex"]

    def inside(cells: Sequence[Cell]) -> Executed:
        with pytest.raises(ScenarioError, match="another sweep is running there"):
            sweep(plan(), tmp_path / "out", inline)
        return inline(cells)

    assert sweep(plan(), tmp_path / "out", inside).done == 6


def test_rows_are_in_the_order_of_the_plan_and_carry_everything(tmp_path: Path) -> None:
    seen: list[Progress] = []
    end = sweep(plan(seeds=2), tmp_path / "out", inline, show=seen.append)
    assert (end.done, end.failed, end.before) == (12, 2, 0)
    assert [now.done for now in seen] == list(range(13))
    rows = read_table(tmp_path / "out" / "table.parquet")
    assert [(r["camera.speed"], r["people.speed"], r["seed"], r["method"]) for r in rows] == [
        (speed, people, seed, method)
        for speed in (1.0, 2.0, 4.0)
        for people in (0.5, 1.0)
        for seed in (0, 1)
        for method in ("unmasked", "mdi", "dotmask")
    ]
    third = rows[2]
    assert (third["ate_rmse_m"], third["lost_frames"], third["error"]) == (0.01, 0, None)
    assert (third["frames"], third["frame_rate_hz"], third["profile"]) == (60, 30.0, "calibrated")
    assert third["moc.recall"] is None, "not measured is null, never 0"
    assert rows[1]["lost_frames"] == 6
    assert third["version"]
    assert third["frame_hash"] == third["cell"]
    repeated = scenario_from_json(third["scenario_json"], "the row")
    assert repeated == plan().cells[0].scenario, "a row is enough to repeat its run"


def test_a_program_may_end_as_soon_as_it_has_read_a_table(tmp_path: Path) -> None:
    sweep(plan(), tmp_path / "out", inline)
    table = str(tmp_path / "out" / "table.parquet")
    code = f"from pathlib import Path\nfrom scenarios.sweep.table import read_table\nread_table(Path({table!r}))"
    for _ in range(3):
        subprocess.run([sys.executable, "-c", code], check=True)


def test_a_failed_cell_is_a_row_with_its_error_and_is_not_run_again(tmp_path: Path) -> None:
    sweep(plan(seeds=2), tmp_path / "out", inline)
    failed = [r for r in read_table(tmp_path / "out" / "table.parquet") if r["error"] is not None]
    assert [(r["camera.speed"], r["people.speed"], r["seed"]) for r in failed[::3]] == [(2.0, 0.5, 1), (2.0, 1.0, 1)]
    assert {r["error"] for r in failed} == {"SimError: nobody <is> there"}
    assert {r["ate_rmse_m"] for r in failed} == {r["frame_hash"] for r in failed} == {None}
    asked: list[Cell] = []

    def ask(cells: Sequence[Cell]) -> Executed:
        asked.extend(cells)
        return inline(cells)

    assert sweep(plan(seeds=2), tmp_path / "out", ask).before == 12
    assert asked == []
    sweep(plan(seeds=2), tmp_path / "out", ask, retry_failed=True)
    assert len(asked) == 2


def test_a_wider_plan_keeps_what_is_finished(tmp_path: Path) -> None:
    sweep(plan("camera.speed=1,4"), tmp_path / "out", inline)
    wider = sweep(plan("camera.speed=0.5,1,4", seeds=2), tmp_path / "out", inline)
    assert (wider.before, wider.done) == (2, 6)
    narrow = sweep(plan("camera.speed=4"), tmp_path / "out", inline)
    assert (narrow.before, narrow.done) == (1, 1)
    assert [r["camera.speed"] for r in read_table(tmp_path / "out" / "table.parquet")] == [4.0] * 3


SWEEPER = """
import sys, time
from pathlib import Path
sys.path.insert(0, {tests!r})
from test_sweep import plan, stub
from scenarios.sweep.run import sweep

def slow(cells):
    print("begun", flush=True)
    for cell in cells:
        with Path({log!r}).open("a") as log:
            log.write(cell.name + "\\n")
        time.sleep(0.02)
        yield cell, stub(cell)

sweep(plan(seeds=3), Path({out!r}), slow, keep_runs=True)
"""


def test_killed_at_random_moments_it_gives_the_same_table(tmp_path: Path) -> None:
    out, log = tmp_path / "out", tmp_path / "log"
    text = SWEEPER.format(tests=str(Path(__file__).parent), log=str(log), out=str(out))
    moments = random.Random()  # any moment will do
    killed = 0
    for _ in range(2):
        process = subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE)
        assert process.stdout is not None
        process.stdout.readline()
        time.sleep(moments.uniform(0.0, 0.25))
        process.kill()
        killed += process.wait() == -signal.SIGKILL
        process.stdout.close()
    assert killed == 2
    for name in (".table.parquet.77.tmp", "cells/.smoke-1.json.77.tmp"):
        (out / name).parent.mkdir(exist_ok=True)
        (out / name).write_text("half")
    (out / "runs" / ".smoke-1.partial-x").mkdir(parents=True)
    subprocess.run([sys.executable, "-c", text], check=True)
    sweep(plan(seeds=3), tmp_path / "whole", inline)
    assert without_times(out) == without_times(tmp_path / "whole")
    begun = log.read_text().split()
    assert len(set(begun)) == 18
    assert len(begun) <= 18 + killed, "what was running when it was killed is begun again, and nothing else"
    assert not [p for p in out.rglob(".*") if p.name != ".dotmask-sweep.lock"], "nothing half written is left"
    assert len(list((out / "runs").iterdir())) == 16, "of every cell that did not fail"


DYING = """
import os, sys, time
from functools import partial
from pathlib import Path
sys.path.insert(0, {tests!r})
from test_sweep import plan, stub
from scenarios.sweep.executors import run_local

def work(cell):
    if cell.scenario.seed == 1:
        os.kill(os.getpid(), 9)
    if cell.scenario.seed == 2:
        Path({started!r}).write_text(str(os.getpid()))
        time.sleep(600)
    assert os.environ["OMP_NUM_THREADS"] == "1"
    return stub(cell)

if __name__ == "__main__":
    for cell, done in run_local(work, plan("camera.speed=1", seeds=3).cells, 2):
        print(cell.scenario.seed, done.result.error, flush=True)
"""


def is_alive(process: int) -> bool:
    try:
        return "Z" not in Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return False


def test_a_run_that_dies_is_an_error_and_runs_end_with_the_sweep(tmp_path: Path) -> None:
    started = tmp_path / "started"
    script = tmp_path / "dying.py"
    script.write_text(DYING.format(tests=str(Path(__file__).parent), started=str(started)))
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    process = subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True, env=environment)
    assert process.stdout is not None
    lines = {process.stdout.readline().strip() for _ in range(2)}
    assert lines == {"0 None", "1 the process of the run ended by signal SIGKILL"}
    deadline = time.monotonic() + 60
    while not (started.exists() and started.read_text()) and time.monotonic() < deadline:
        time.sleep(0.05)
    worker = int(started.read_text())
    assert is_alive(worker)
    process.kill()
    process.wait()
    process.stdout.close()
    while is_alive(worker) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not is_alive(worker)


def series(ate_m: list[list[float]], x: tuple[float, ...] = (1, 2, 4, 8), method: str = "dotmask") -> Series:
    errors = np.array(ate_m, dtype=float)
    return Series(method=method, others={}, x=np.array(x, dtype=float), ate_m=errors, lost=np.zeros_like(errors))


def test_the_crossing_is_interpolated_on_logarithmic_scales() -> None:
    x, error = np.array([1.0, 2.0, 4.0, 8.0]), np.array([0.01, 0.02, 0.08, 0.16])
    # From 0.02 at 2 to 0.08 at 4 the error grows with the square of x: 0.04 is reached at 2 * sqrt(2).
    assert crossing(x, error, 0.04, True) == pytest.approx(2 * math.sqrt(2))
    assert crossing(x, error[::-1], 0.04, False) == pytest.approx(2 * math.sqrt(2)), "falling: from the other end"
    assert crossing(x, error, 0.2, True) == math.inf
    assert crossing(x, error, 0.005, True) == -math.inf
    assert crossing(x, np.array([0.01, np.inf, np.inf, np.inf]), 0.04, True) == 1.0, "held there, lost at the next"
    assert crossing(x, np.array([0.01, np.nan, 0.16, 1.0]), 0.04, True) == pytest.approx(2.0), "nan is passed over"
    assert crossing(np.array([0.0, 1.0]), np.array([0.01, 0.04]), 0.02, True) == pytest.approx(0.5), (
        "0 has no logarithm"
    )


def test_breakdown_points_say_what_they_are() -> None:
    same = [[0.01, 0.02, 0.08, 0.16]] * 3
    point = breakdown(series(same), 0.04)
    assert point.value == point.low == point.high == pytest.approx(2 * math.sqrt(2))
    assert point.text() == "2.83 [2.83 to 2.83]"
    assert breakdown(series(same[:1]), 0.04).text() == "2.83", "one seed has no interval"
    assert breakdown(series(same), 1.0).text() == "not reached (up to 8)"
    assert breakdown(series(same), 0.001).text() == "broken at 1 already"
    falling = breakdown(series([list(reversed(same[0]))] * 3), 0.04)
    assert (falling.is_rising, falling.text()) == (False, "2.83 [2.83 to 2.83]")
    # Of three seeds one is never above: a resample of it alone, or twice, has a median that never crosses (7 of 27).
    mixed = breakdown(series([*same[:2], [0.01, 0.01, 0.01, 0.01]]), 0.04)
    assert mixed.text() == "2.83 [2.83 to above 8]"


def test_bands_hold_the_middle_of_the_resampled_medians() -> None:
    # Two seeds: the median of a resample is one value, the other, or with probability 1/2 their mean.
    band = series([[0.01], [0.03]], x=(1,)).band_m()
    assert band is not None
    np.testing.assert_allclose(band[:, 0], [0.01, 0.03])
    # Of 40 seeds with 0, 1, ... 39 the median's standard error is near 1.25 * 11.5 / sqrt(40) = 2.3.
    band = series([[float(k)] for k in range(40)], x=(1,)).band_m()
    assert band is not None
    assert band[0, 0] == pytest.approx(19.5 - 1.96 * 2.3, abs=2)
    assert band[1, 0] == pytest.approx(19.5 + 1.96 * 2.3, abs=2)
    assert series([[0.01]], x=(1,)).band_m() is None


def test_the_gain_is_paired_by_seed() -> None:
    ours, theirs = series([[0.01, 0.1], [0.1, np.inf]], x=(1, 2)), series([[0.02, 0.1], [0.2, np.inf]], x=(1, 2))
    better = gain(ours, theirs)
    np.testing.assert_allclose(better.factor, [2.0, 1.0])
    assert better.band is not None
    np.testing.assert_allclose(better.band, [[2.0, 1.0], [2.0, 1.0]])


def test_a_lost_run_is_broken_and_a_failed_cell_is_left_out() -> None:
    def row(seed: int, speed: float, **changes) -> dict:
        common = {"method": "dotmask", "frames": 100, "lost_frames": 0, "ate_rmse_m": 0.01, "error": None}
        return {"seed": seed, "camera.speed": speed, **common, **changes}

    rows = [
        row(0, 2.0, lost_frames=50), row(1, 2.0, lost_frames=51), row(0, 1.0, ate_rmse_m=None), row(1, 1.0, error="x"),
        row(0, 4.0, error="x"), row(1, 4.0, error="x"),
    ]  # fmt: skip
    (one,) = series_of(rows, Axes.of({"camera.speed": [2.0, 1.0, 4.0]}))
    np.testing.assert_array_equal(one.x, [1.0, 2.0])
    np.testing.assert_array_equal(one.ate_m, [[np.inf, 0.01], [np.nan, np.inf]])
    with pytest.raises(ScenarioError, match="every cell of this sweep failed"):
        series_of([row(0, 1.0, error="x")], Axes.of({"camera.speed": [1.0]}))


def test_the_first_key_with_numbers_is_the_axis() -> None:
    axes = Axes.of({"profile": ["paper", "calibrated"], "camera.speed": [4.0, 1.0]})
    assert (axes.x, axes.values, axes.others, axes.is_numeric) == ("camera.speed", (1.0, 4.0), ("profile",), True)
    axes = Axes.of({"profile": ["paper", "calibrated"]})
    assert (axes.values, axes.is_numeric) == (("paper", "calibrated"), False)


def test_the_page_needs_no_network_and_links_to_the_runs(tmp_path: Path, dotmask) -> None:
    sweep(plan(seeds=2), tmp_path / "out", inline, keep_runs=True)
    done = dotmask("plot", tmp_path / "out", "--bound", "0.04")
    assert done.code == 0, done.err
    assert done.out.count("broken at 1 already") == 2, "unmasked, at both speeds of the people"
    text = (tmp_path / "out" / "report.html").read_text()
    assert "http" not in text
    assert "<script" not in text
    assert text.count("src=") == text.count('src="data:image/png;base64,') == 2
    assert "SimError: nobody &lt;is&gt; there" in text
    links = [part.split("'")[0] for part in text.split("href='")[1:]]
    assert len(links) == 3 * 10
    assert all((tmp_path / "out" / link / "report.json").is_file() for link in links)
    assert "2 of them failed" in text


def test_dotmask_breaks_down_where_the_stub_says(tmp_path: Path) -> None:
    sweep(plan(), tmp_path / "out", inline)
    found = {(o[0], m): text for o, m, text in page.breakdown_rows(page.analyse(tmp_path / "out", 0.02))}
    assert found["1", "dotmask"] == f"{math.sqrt(2):.3g}", "0.01 * speed² = 0.02"
    assert found["1", "mdi"] == "not reached (up to 4)"


def test_words_alone_are_drawn_side_by_side(tmp_path: Path, dotmask) -> None:
    sweep(plan("profile=paper,calibrated"), tmp_path / "out", inline)
    done = dotmask("plot", tmp_path / "out")
    assert done.code == 0, done.err
    assert "Breakdown points" not in (tmp_path / "out" / "report.html").read_text()


def test_plot_says_what_is_missing(tmp_path: Path, dotmask) -> None:
    for arguments, message in (
        ([tmp_path], "no folder of a sweep"),
        ([tmp_path, "--bound", "0"], "give a length above 0"),
    ):
        done = dotmask("plot", *arguments)
        assert (done.code, message in done.err) == (2, True), done.err
