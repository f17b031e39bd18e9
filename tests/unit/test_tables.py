"""`dotmask tables`: what is run again and what is not, and where each figure stands in the tables."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from scenarios import finished_runs
from scenarios.errors import ScenarioError
from scenarios.registry import SCENARIOS
from scenarios.report import LoopReport, MapReport, MethodReport, Report, SegmenterReport, StageTimes, WorldTimes
from scenarios.run import METHODS, RunSettings, method_of
from scenarios.tables import measure as measuring
from scenarios.tables import page
from scenarios.tables import plan as plan_module
from scenarios.tables.layout import (
    ate_table,
    loop_table,
    map_table,
    odometry_table,
    paper_time_table,
    time_table,
)
from scenarios.tables.measure import measure, split_repeats
from scenarios.tables.paper import TABLE_II, TABLE_III
from scenarios.tables.plan import SEQUENCES, TablePlan

SETTINGS = RunSettings.parse(threads=1)
METHOD_NAMES = tuple(METHODS)
PLAN = TablePlan(back_end="embedded", settings=SETTINGS, methods=METHOD_NAMES, repeats=1, frames=7)
TWICE = replace(PLAN, settings=RunSettings.parse(threads=1, repeats=2), repeats=2)


def method(ate_m: float | None = 0.1, *, frames: int = 100, mask_ms: float | None = None, **more) -> MethodReport:
    return MethodReport(
        ate_rmse_m=ate_m,
        rpe_trans_rmse_m=0.001,
        rpe_rot_rmse_rad=0.002,
        tracked_frames=frames,
        ate_optimised_rmse_m=None if ate_m is None else ate_m / 2,
        optimised_frames=frames - 1,
        time_ms=StageTimes(odometry=10.0, map=2.0, mask=mask_ms),
        **more,
    )


def report(name: str = "fr3_walking_xyz", frames: int = 100, **methods: MethodReport) -> Report:
    return Report(
        scenario=name,
        seed=0,
        frames=frames,
        renderer="numba",
        segmenter=SegmenterReport(name="oracle"),
        slam="embedded",
        profile="calibrated",
        frame_hash="00",
        methods={"unmasked": method(), "mdi": method(), "dotmask": method(), **methods},
        time_ms=WorldTimes(render=1.0),
    )


def rows(table: str) -> list[dict[str, str]]:
    """The cells of a Markdown table by heading; a heading that stands there twice is numbered."""
    lines = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()]
    first = lines[0]
    names = [name if (k := first[:at].count(name)) == 0 else f"{name} #{k + 1}" for at, name in enumerate(first)]
    assert all(len(line) == len(names) for line in lines)
    return [dict(zip(names, line, strict=True)) for line in lines[2:]]


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Stands for the runs: what was run."""
    done: list[str] = []

    def run(scenario, settings, out, advance) -> Report:
        done.append(scenario.name)
        for _ in range(scenario.frames):
            advance()
        one = report(scenario.name, scenario.frames, dotmask=method(0.01 * len(done)))
        return one.model_copy(update={"methods": {name: one.methods[method_of(name)] for name in settings.methods}})

    monkeypatch.setattr(measuring, "run", run)
    return done


def measured(plan: TablePlan, out: Path) -> dict[str, tuple[Report, ...]]:
    return dict(measure(plan, out, lambda title: None, lambda frames: None))


def test_the_six_sequences_of_the_paper_are_run_whole() -> None:
    assert SEQUENCES == (
        "fr3_sitting_static", "fr3_sitting_xyz", "fr3_walking_static", "fr3_walking_xyz", "fr3_walking_rpy",
        "fr3_walking_halfsphere",
    )  # fmt: skip
    whole = TablePlan.parse()
    assert [one.frames for one in whole.scenarios()] == [SCENARIOS[name].frames for name in SEQUENCES]
    assert {one.frames for one in TablePlan.parse(is_quick=True).scenarios()} == {150}
    assert (whole.back_end, whole.methods, whole.repeats) == ("embedded", METHOD_NAMES, 1)


def test_what_differs_from_run_to_run_is_run_five_times_on_the_same_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(plan_module.REPEATS, "embedded", 5)
    monkeypatch.setitem(plan_module.METHODS, "embedded", ("unmasked", "dotmask"))
    plan = TablePlan.parse()
    assert plan.settings.methods[:4] == ("unmasked", "dotmask", "unmasked-2", "dotmask-2")
    assert len(plan.settings.methods) == 10
    assert plan.total_frames() == sum(SCENARIOS[name].frames for name in SEQUENCES)
    assert TablePlan.parse(repeats=2).settings.methods == ("unmasked", "dotmask", "unmasked-2", "dotmask-2")


def test_a_report_of_repeats_is_split_into_one_for_each() -> None:
    methods = {"dotmask": method(0.1), "unmasked": method(0.2), "dotmask-2": method(0.3), "unmasked-2": method(0.4)}
    first, second = split_repeats(report().model_copy(update={"methods": methods}))
    assert first.methods == {"dotmask": methods["dotmask"], "unmasked": methods["unmasked"]}
    assert second.methods == {"dotmask": methods["dotmask-2"], "unmasked": methods["unmasked-2"]}
    assert split_repeats(report()) == (report(),)


def test_after_a_kill_finished_runs_are_not_run_again(tmp_path: Path, runs, monkeypatch) -> None:
    plan = TWICE
    run, stop_before = measuring.run, 4

    def killed(*arguments) -> Report:
        if len(runs) == stop_before:
            raise KeyboardInterrupt
        return run(*arguments)

    monkeypatch.setattr(measuring, "run", killed)
    with pytest.raises(KeyboardInterrupt):
        measured(plan, tmp_path)
    assert len(list(tmp_path.iterdir())) == 4
    monkeypatch.setattr(measuring, "run", run)
    frames: list[int] = []
    reports = measure(plan, tmp_path, lambda title: None, frames.append)
    assert runs == list(SEQUENCES), "each run once"
    assert sum(frames) == plan.total_frames()
    assert [r.methods["dotmask"].ate_rmse_m for r in reports["fr3_walking_static"]] == [0.03, 0.03]
    assert measured(plan, tmp_path) == reports
    assert len(runs) == 6


def test_a_half_written_or_foreign_file_is_no_result(tmp_path: Path, runs) -> None:
    plan = replace(PLAN, sequences=("fr3_walking_xyz",))
    measured(plan, tmp_path)
    (path,) = tmp_path.iterdir()
    for text in (path.read_text()[:-100], "{}", "[]", json.dumps({**json.loads(path.read_text()), "key": {}})):
        path.write_text(text)
        measured(plan, tmp_path)
    assert len(runs) == 5


def test_other_settings_versions_code_or_frames_are_other_runs(tmp_path: Path, runs, monkeypatch) -> None:
    plan = replace(PLAN, sequences=("fr3_walking_xyz",))
    measured(plan, tmp_path)
    measured(replace(plan, settings=replace(SETTINGS, threads=4)), tmp_path)
    assert len(runs) == 1, "the number of threads changes no figure"
    measured(replace(plan, settings=replace(SETTINGS, profile="paper")), tmp_path)
    measured(replace(plan, frames=8), tmp_path)
    monkeypatch.setattr(finished_runs, "versions", lambda: {"numpy": "99"})
    measured(plan, tmp_path)
    monkeypatch.setattr(finished_runs, "code_hash", lambda: "other")
    measured(plan, tmp_path)
    assert len(runs) == 5
    monkeypatch.undo()
    monkeypatch.setattr(measuring, "run", None)
    assert measured(plan, tmp_path), "the first result is still there"


def test_every_ate_stands_beside_its_poses() -> None:
    one = report(unmasked=method(0.4, frames=90), mdi=method(None, frames=1), dotmask=method(0.02, frames=98))
    (row,) = rows(ate_table({"fr3_walking_xyz": (one,)}, METHOD_NAMES))
    assert row["unmasked, cm / poses"] == "20.00 / 89"
    assert row["mdi, cm / poses"] == "- / 0"
    assert row["dotmask, cm / poses"] == "1.00 / 97"
    assert row["improvement, %"] == "95.00"
    assert (row["paper: RTAB-Map"], row["DOTMask"], row["impr., %"]) == ("24.50", "2.10", "91.42")
    (row,) = rows(odometry_table({"fr3_walking_xyz": (one,)}, METHOD_NAMES))
    assert row["frames"] == "100"
    assert row["unmasked, cm / poses"] == "40.00 / 90"
    assert row["RPE dotmask, mm"] == "1.0"


def test_repeats_give_the_median_and_the_range() -> None:
    ates = (0.05, 0.01, 0.03)
    several = tuple(report(dotmask=method(ate, frames=100 - k)) for k, ate in enumerate(ates))
    (row,) = rows(odometry_table({"fr3_walking_xyz": several}, METHOD_NAMES))
    assert row["dotmask, cm / poses"] == "3.00 (1.00 to 5.00) / 99 (98 to 100)"
    assert row["improvement, %"] == "70.00", "of the medians"
    lost = (*several[:2], report(dotmask=method(None)))
    (row,) = rows(odometry_table({"fr3_walking_xyz": lost}, METHOD_NAMES))
    assert row["dotmask, cm / poses"].startswith("3.00 (1.00 to 5.00) [2 of 3 runs] / ")


def test_loops_without_and_with_the_method() -> None:
    loops = LoopReport(count=12, false_count=1, trans_error_m=0.0123, trans_error_max_m=0.2, rot_error_rad=0.01)
    (row,) = rows(loop_table({"fr3_walking_rpy": (report(dotmask=method(loops=loops)),)}))
    assert [row["dotmask: loops"], row["false #2"], row["T_err, cm #2"], row["R_err, deg #2"]] == [
        "12", "1", "1.23", "0.57",
    ]  # fmt: skip
    assert [row["unmasked: loops"], row["T_err, cm"]] == ["-", "-"]
    assert [row["paper, RTAB-Map: loops"], row["paper, DOTMask: loops"]] == ["94", "965"]


def test_times_are_means_over_frames() -> None:
    reports = {
        "fr3_walking_xyz": (report(frames=100, dotmask=method(mask_ms=1.0)),),
        "fr3_walking_rpy": (report(frames=300, dotmask=method(mask_ms=3.0)),),
    }
    by_method = {row["method"]: row for row in rows(time_table(reports, METHOD_NAMES))}
    assert by_method["dotmask"]["mask"] == by_method["dotmask"]["front end"] == "2.5"
    assert by_method["dotmask"]["front end and SLAM"] == "14.5"
    assert by_method["unmasked"]["front end"] == "-"
    assert by_method["unmasked"]["frames"] == "400"
    assert rows(paper_time_table())[3]["ms"] == "70"


def test_maps_are_shown_where_they_were_made() -> None:
    assert map_table({"fr3_walking_xyz": (report(),)}, METHOD_NAMES) is None
    made = report(dotmask=method(map=MapReport(ghost_fraction=0.015, completeness=0.9)))
    (row,) = rows(map_table({"fr3_walking_xyz": (made,)}, METHOD_NAMES) or "")
    assert row["dotmask: ghosts, %"] == "1.5"
    assert row["unmasked: ghosts, %"] == "-"


def test_the_papers_figures_are_consistent_with_themselves() -> None:
    # The printed improvement follows from the printed errors; a mistyped digit would show.
    for name, row in TABLE_II.items():
        improvement = 100 * (row.rtabmap - row.dotmask) / row.rtabmap
        assert float(row.improvement_percent) == pytest.approx(float(improvement), abs=0.011), name
    assert set(TABLE_III) == set(TABLE_II)
    for alone, masked in TABLE_III.values():
        assert masked.count > alone.count


def test_the_page_holds_a_section_for_each_back_end(tmp_path: Path) -> None:
    reports = {name: (report(name),) for name in SEQUENCES}
    whole = replace(PLAN, frames=None)
    other = replace(whole, back_end="rtabmap-refined", settings=replace(SETTINGS, slam="rtabmap"), repeats=5)
    page.write_page(tmp_path, other, page.section_text(other, {n: r * 5 for n, r in reports.items()}))
    path = page.write_page(tmp_path, whole, page.section_text(whole, reports))
    text = path.read_text()
    assert path == tmp_path / "results.md"
    assert text.index("## SLAM back end `embedded`") < text.index("## SLAM back end `rtabmap-refined`")
    assert text.count("### Table II: ") == text.count("### Table III: ") == text.count("### Table IV: ") == 2
    assert "run once" in text
    assert "run 5 times" in text
    assert "segmenter `oracle`, slam `embedded`, profile `calibrated`" in text
    assert "--quick" not in text
    assert page.section_text(PLAN, reports).startswith("**Made with `--quick`")


def test_bad_options_are_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, dotmask) -> None:
    monkeypatch.chdir(tmp_path)
    for arguments, message in (
        (["--slam", "embeded"], "unknown SLAM back end 'embeded'. Did you mean embedded?"),
        (["--repeat", "0"], "--repeat 0: run each method at least once"),
        (["--profile", "papr"], "paper"),
        (["--segmenter", "none"], "without a segmenter nothing is masked"),
        (["--write", "--quick"], "--write: a page from the first frames alone would mislead"),
    ):
        done = dotmask("tables", *arguments)
        lines = [line for line in done.err.splitlines() if line.strip()]
        assert (done.code, len(lines), message in lines[0]) == (2, 1, True), done.err
    assert list(tmp_path.iterdir()) == []
    monkeypatch.setattr(page, "DOCS", tmp_path / "site-packages" / "docs")
    with pytest.raises(ScenarioError, match="in a checkout"):
        page.docs_of_checkout(replace(PLAN, frames=None))


def test_an_interrupted_command_says_how_to_go_on(tmp_path: Path, runs, monkeypatch, dotmask) -> None:
    def interrupted(*arguments) -> Report:
        raise KeyboardInterrupt

    monkeypatch.setattr(measuring, "run", interrupted)
    done = dotmask("tables", "--quick", "--out", tmp_path)
    assert done.code == 130
    assert "finished runs are kept" in done.err


def test_the_command_prints_the_tables_and_leaves_them_in_its_folder(tmp_path: Path, runs, dotmask) -> None:
    done = dotmask("tables", "--quick", "--out", tmp_path / "out")
    assert done.code == 0, done.err
    assert len(runs) == len(SEQUENCES)
    for method_name in METHOD_NAMES:
        assert f"{method_name}, cm / poses" in done.out
    assert done.out.strip() in (tmp_path / "out" / "results.md").read_text()
