"""The command line as its users meet it: results, contracts, and what bad input gets."""

import csv
import importlib.metadata
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from dotmask.records import Trajectory
from dotmask.slam.rtabmap.library import core
from dotmask.tum import format_trajectory, read_trajectory
from scenarios.registry import SCENARIOS
from scenarios.report import Report
from scenarios.spec import scenario_from_json


def run_in_another_process(*arguments: object) -> Report:
    command = [sys.executable, "-m", "scenarios.cli", "run", *(str(a) for a in arguments), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return Report.model_validate_json(done.stdout)


def test_list_names_every_scenario(dotmask) -> None:
    done = dotmask("list")
    assert done.code == 0
    assert all(name in done.out for name in SCENARIOS)


def test_show_prints_what_from_reads(dotmask) -> None:
    done = dotmask("show", "smoke", "--set", "camera.speed=2")
    scenario = scenario_from_json(done.out, "stdout")
    assert scenario.camera.speed == 2.0


def test_doctor_finds_this_installation_well(dotmask) -> None:
    done = dotmask("doctor")
    assert done.code == 0, done.out
    assert "BAD" not in done.out
    assert "agree with the manifest" in done.out


@pytest.fixture(scope="module")
def smoke_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("runs") / "smoke"
    run_in_another_process("smoke", "--out", out, "--threads", 1, "--video")
    return out


def test_a_run_folder_is_complete_and_readable(smoke_run: Path) -> None:
    assert sorted(p.name for p in smoke_run.iterdir()) == [
        "frames.csv", "report.json", "scenario.json", "tracks.csv", "trajectories.png", "trajectory_dotmask.txt",
        "trajectory_dotmask_optimised.txt", "trajectory_mdi.txt", "trajectory_mdi_optimised.txt",
        "trajectory_truth.txt", "trajectory_unmasked.txt", "trajectory_unmasked_optimised.txt",
        "versions.json", "video.mp4",
    ]  # fmt: skip
    report = Report.model_validate_json((smoke_run / "report.json").read_text())
    assert list(report.methods) == ["unmasked", "mdi", "dotmask"]
    assert len(report.frame_hash) == 64
    dotmask = report.methods["dotmask"]
    assert dotmask.ate_rmse_m < 0.03
    assert dotmask.moc.recall > 0.9
    assert dotmask.masks.leak < 0.02
    assert dotmask.masks.iou == 1.0, "the oracle's masks are the truth"
    assert report.methods["unmasked"].ekf.nees is None
    truth = read_trajectory(smoke_run / "trajectory_truth.txt")
    assert len(truth) == 60
    with (smoke_run / "frames.csv").open() as file:
        assert sum(1 for _ in csv.DictReader(file)) == 3 * 60
    with (smoke_run / "tracks.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {row["class"] for row in rows} == {"person", "chair"}


def test_the_same_bytes_in_another_process_with_other_threads_and_from_its_json(
    smoke_run: Path, tmp_path: Path
) -> None:
    first = Report.model_validate_json((smoke_run / "report.json").read_text())
    arguments = ("--from", smoke_run / "scenario.json", "--out", tmp_path / "again", "--threads", 2)
    again = run_in_another_process(*arguments)
    assert again.frame_hash == first.frame_hash
    for name, method in first.methods.items():
        timeless = {"time_ms": first.methods[name].time_ms}
        assert again.methods[name].model_copy(update=timeless) == method, "a figure differs between two equal runs"


def test_another_seed_gives_another_hash(smoke_run: Path, tmp_path: Path, dotmask) -> None:
    first = Report.model_validate_json((smoke_run / "report.json").read_text())
    done = dotmask(
        "run", "smoke", "--seed", 1, "--frames", 5, "--methods", "unmasked", "--out", tmp_path / "a", "--json"
    )
    other = Report.model_validate_json(done.out)
    assert other.seed == 1
    assert other.frame_hash != first.frame_hash


def test_expectations_decide_the_exit_code(tmp_path: Path, dotmask) -> None:
    arguments = ("run", "smoke", "--frames", 5, "--methods", "dotmask")
    holds = dotmask(*arguments, "--out", tmp_path / "a", "--expect", "ate_rmse_m<0.05")
    missed = dotmask(*arguments, "--out", tmp_path / "b", "--expect", "ate_rmse_m<1e-9")
    assert (holds.code, missed.code) == (0, 1)
    assert "MISSED dotmask.ate_rmse_m<1e-9" in missed.err
    assert (tmp_path / "b" / "report.json").exists(), "a missed threshold is a result too"


BAD_INPUT = [
    (["run", "fr3_walking_xy"], r"unknown scenario 'fr3_walking_xy'. Did you mean fr3_walking_xyz"),
    (["run"], "give the name of a scenario, or --from"),
    (["run", "smoke", "--from", "x.json"], "not both"),
    (["run", "--from", "missing.json"], "missing.json: cannot be read"),
    (["run", "smoke", "--methods", "dotmsk"], "unknown method 'dotmsk'. Did you mean dotmask?"),
    (["run", "smoke", "--methods", ","], "name at least one of unmasked, mdi, dotmask"),
    (["run", "smoke", "--segmenter", "orcale"], "unknown segmenter 'orcale'. Did you mean oracle?"),
    (["run", "smoke", "--slam", "embeded"], "unknown SLAM back end 'embeded'. Did you mean embedded?"),
    (["run", "smoke", "--renderer", "gpu"], "unknown renderer 'gpu'"),
    (["run", "smoke", "--profile", "papr"], "paper"),
    (["run", "smoke", "--pose-feedback", "previos"], "Did you mean previous?"),
    (["run", "smoke", "--set", "camera.sped=2"], "valid keys under 'camera': width, height"),
    (["run", "smoke", "--set", "camera.speed=fast"], "camera.speed: Input should be a valid number"),
    (["run", "smoke", "--set", "camera.speed"], "expected KEY=VALUE"),
    (["run", "smoke", "--frames", "0"], "frames: Input should be greater than or equal to 1"),
    (["run", "smoke", "--expect", "ate<1"], "no figure 'ate'"),
    (["run", "smoke", "--set", "camera.trajectory=nothing.txt"], "nothing.txt"),
    (["run", "smoke", "--set", "people.cast.0.character=nobody"], "nobody"),
    (["run", "smoke", "--set", "people.cast.0.outfit=tuxedo"], "tuxedo"),
    (["render", "smok", "--out", "x"], "Did you mean smoke?"),
    (["show", "smok"], "Did you mean smoke?"),
]


@pytest.mark.parametrize(("arguments", "message"), BAD_INPUT, ids=lambda v: " ".join(v) if isinstance(v, list) else "")
def test_bad_input_is_one_clear_line_and_exit_code_2(
    arguments: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, dotmask
) -> None:
    monkeypatch.chdir(tmp_path)
    done = dotmask(*arguments)
    assert done.code == 2, done.err
    lines = [line for line in done.err.splitlines() if line.strip() and not line.startswith("run smoke")]
    assert len(lines) == 1, done.err
    assert message in lines[0]
    assert done.out == ""
    assert [p.name for p in tmp_path.rglob("*") if p.is_file()] == [], "something was written"


@pytest.mark.parametrize("verb", ["run", "render"])
def test_a_folder_with_other_files_is_refused_and_left_alone(verb: str, tmp_path: Path, dotmask) -> None:
    (tmp_path / "mine.txt").write_text("keep")
    done = dotmask(verb, "smoke", "--out", tmp_path)
    assert done.code == 2
    assert "holds other files" in done.err
    assert [p.name for p in tmp_path.iterdir()] == ["mine.txt"]


BAD_RECORDINGS = {
    "nan": ("0 0 0 1 -1 0 0 1\n1 nan 0 1 -1 0 0 1\n", "line 2"),
    "unsorted": ("0 0 0 1 -1 0 0 1\n2 0 0 1 -1 0 0 1\n1 0 0 1 -1 0 0 1\n", "line 3"),
    "columns": ("0 0 0 1 -1 0 0\n", "line 1"),
    "too short": ("0 0 0 1 -1 0 0 1\n0.5 0 0 1 -1 0 0 1\n", "lasts 0.50 s"),
}


@pytest.mark.parametrize("name", BAD_RECORDINGS)
def test_a_bad_recording_names_file_and_line(name: str, tmp_path: Path, dotmask) -> None:
    text, place = BAD_RECORDINGS[name]
    path = tmp_path / "recorded.txt"
    path.write_text(text)
    done = dotmask("run", "smoke", "--set", f"camera.trajectory={path}", "--out", tmp_path / "out")
    assert done.code == 2, done.err
    assert "recorded.txt" in done.err
    assert place in done.err
    assert [p.name for p in tmp_path.iterdir()] == ["recorded.txt"]


@pytest.mark.parametrize("option", ["--slam-parameters=refined", "--slam-set=Vis/MinInliers=12"])
def test_parameters_of_rtabmap_are_for_rtabmap(dotmask, option: str) -> None:
    done = dotmask("run", "smoke", option)
    assert done.code == 2
    assert done.err == "dotmask: --slam-parameters and --slam-set are for --slam rtabmap, not embedded\n"


def test_rtabmap_that_is_not_installed_is_one_line_before_anything_is_rendered(
    dotmask, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    find = importlib.metadata.distribution

    def without_depthai(name: str) -> importlib.metadata.Distribution:
        return find("no-such-package" if name == "depthai" else name)

    monkeypatch.setattr(importlib.metadata, "distribution", without_depthai)
    core.cache_clear()
    done = dotmask("run", "smoke", "--slam", "rtabmap", "--out", tmp_path / "out")
    assert done.code == 2
    assert "pip install 'dotmask[rtabmap]'" in done.err or "x86-64 Linux only" in done.err
    assert done.err.count("\n") == 1
    assert not (tmp_path / "out").exists()
    assert "-   SLAM rtabmap: RTAB-Map" in dotmask("doctor").out
    core.cache_clear()


def test_eval_says_what_the_metrics_say(tmp_path: Path, dotmask) -> None:
    times = np.arange(20) / 10
    poses = np.tile(np.eye(4), (20, 1, 1))
    poses[:, 0, 3], poses[:, 1, 3] = times, np.sin(times)
    truth = Trajectory(timestamps_s=times, T_world_camera=poses)
    moved = poses.copy()
    moved[:, 2, 3] = np.where(np.arange(20) % 2, 0.004, -0.004)
    (tmp_path / "groundtruth.txt").write_text(format_trajectory(truth))
    estimate = tmp_path / "estimate.txt"
    estimate.write_text(format_trajectory(Trajectory(timestamps_s=times[:18], T_world_camera=moved[:18])))
    for known in (tmp_path, tmp_path / "groundtruth.txt"):
        done = dotmask("eval", known, estimate)
        assert (done.code, done.err) == (0, "")
        assert "ATE 4.0 mm RMSE" in done.out
        assert "over 18 of 20 true poses" in done.out
        assert "RPE 8.0 mm, 0.00 deg" in done.out
    figures = json.loads(dotmask("eval", tmp_path, estimate, "--json").out)
    assert figures["ate"]["poses"] == figures["estimate_poses"] == 18
    assert figures["ate"]["rmse_m"] == pytest.approx(0.004, rel=0.01)


def test_eval_refuses_what_cannot_be_compared_in_one_line(tmp_path: Path, dotmask) -> None:
    poses = np.tile(np.eye(4), (5, 1, 1))
    for name, start in (("a.txt", 0.0), ("b.txt", 1000.0)):
        trajectory = Trajectory(timestamps_s=start + np.arange(5), T_world_camera=poses)
        (tmp_path / name).write_text(format_trajectory(trajectory))
    for estimate, message in (("b.txt", "are the stamps of the same clock?"), ("no.txt", "no such file")):
        done = dotmask("eval", tmp_path / "a.txt", tmp_path / estimate)
        assert done.code == 2
        assert message in done.err
        assert len(done.err.strip().splitlines()) == 1
