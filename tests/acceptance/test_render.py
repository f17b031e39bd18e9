"""`dotmask render` as its users meet it."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import cv2
import pytest

from dotmask.tum import read_sequence, read_trajectory

SMALL = [
    word
    for key, value in (("width", 160), ("height", 120), ("fx", 133.85), ("fy", 134.8), ("cx", 79.65), ("cy", 61.5))
    for word in ("--set", f"camera.{key}={value}")
]


def files(root: Path) -> dict[str, bytes]:
    return {str(p.relative_to(root)): p.read_bytes() for p in sorted(root.rglob("*")) if p.is_file()}


def test_it_writes_a_tum_folder_with_its_truth_and_a_video(tmp_path: Path, dotmask) -> None:
    out = tmp_path / "sequence"
    done = dotmask("render", "smoke", "--frames", 4, "--out", out, "--video")
    assert done.code == 0, done.err
    assert done.out == f"{out}\n"
    frames = list(read_sequence(out))
    assert len(frames) == 4
    assert frames[0].rgb.shape == (240, 320, 3)
    assert len(read_trajectory(out / "groundtruth.txt")) == 4
    names = {line.split(",")[1] for line in (out / "objects.csv").read_text().splitlines()[1:]}
    assert names == {"anton", "berta", "chair_left", "chair_right"}
    assert len(list((out / "instance").iterdir())) == 4
    video = cv2.VideoCapture(str(out / "video.mp4"))
    assert video.get(cv2.CAP_PROP_FRAME_COUNT) == 4
    assert video.read()[1].shape == (240, 960, 3)
    assert "/s" in done.err
    assert "left" in done.err
    assert [p.name for p in tmp_path.iterdir()] == ["sequence"]


def test_people_have_their_keypoints(tmp_path: Path, dotmask) -> None:
    out = tmp_path / "coco"
    assert dotmask("render", "smoke", "--frames", 2, "--out", out, "--format", "coco").code == 0
    for frame in json.loads((out / "keypoints.json").read_text())["frames"]:
        assert {person["name"] for person in frame["people"]} == {"anton", "berta"}
    people = json.loads((out / "annotations" / "person_keypoints.json").read_text())
    assert people["annotations"]
    assert all(len(a["keypoints"]) == 51 for a in people["annotations"])


@pytest.mark.parametrize("end", [pytest.param(signal.SIGKILL, marks=pytest.mark.slow), signal.SIGINT])
def test_stopped_from_outside_it_leaves_nothing_that_looks_complete_and_is_continued(
    end: signal.Signals, tmp_path: Path, dotmask
) -> None:
    arguments = ["render", "smoke", "--frames", "60", "--seed", "3", "--format", "kitti", *SMALL, "--out"]
    out, partial = tmp_path / "out", tmp_path / ".out.partial"
    process = subprocess.Popen(
        [sys.executable, "-m", "scenarios.cli", *arguments, str(out)],
        stderr=subprocess.PIPE,
        text=True,
        # A shell that runs the tests in the background has them ignore the interrupt, and their children with them.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    checkpoint = partial / "checkpoint.json"
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and not (checkpoint.exists() and '"steps": 0' not in checkpoint.read_text()):
        time.sleep(0.01)
    process.send_signal(end)
    _, err = process.communicate(timeout=60)
    assert not out.exists()
    assert partial.is_dir()
    if end == signal.SIGINT:
        assert process.returncode == 130
        assert "frames are kept; continue with --resume" in err

    refused = dotmask(*arguments, out)
    assert refused.code == 2
    assert "continue it with --resume, or remove it" in refused.err
    other = dotmask(*arguments, out, "--resume", "--seed", 4)
    assert other.code == 2
    assert "scenario.seed = 3, not 4" in other.err
    other = dotmask(*arguments, out, "--resume", "--format", "tum")
    assert other.code == 2
    assert 'format = "kitti", not "tum"' in other.err

    assert dotmask(*arguments, out, "--resume").code == 0
    assert not partial.exists()
    assert dotmask(*arguments, tmp_path / "whole").code == 0
    assert files(out) == files(tmp_path / "whole")


def test_it_repeats_the_scenario_of_another_render(tmp_path: Path, dotmask) -> None:
    dotmask("render", "smoke", "--frames", 2, *SMALL, "--seed", 5, "--out", tmp_path / "a")
    done = dotmask("render", "--from", tmp_path / "a" / "scenario.json", "--out", tmp_path / "b", "--threads", 1)
    assert done.code == 0, done.err
    assert files(tmp_path / "a") == files(tmp_path / "b")


BAD_INPUT = [
    (["smoke", "--format", "tun"], "unknown format 'tun'. Did you mean tum? Known: coco, kitti, tum"),
    (["smoke", "--resume"], "nothing to resume"),
    (["smoke", "--renderer", "gpu"], "unknown renderer 'gpu'"),
    (["smoke", "--from", "x.json"], "not both"),
    ([], "give the name of a scenario, or --from"),
    (["--from", "missing.json"], "missing.json: cannot be read"),
]


@pytest.mark.parametrize(("arguments", "message"), BAD_INPUT, ids=lambda v: " ".join(v) if isinstance(v, list) else "")
def test_bad_input_is_one_clear_line_and_exit_code_2(
    arguments: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, dotmask
) -> None:
    monkeypatch.chdir(tmp_path)
    done = dotmask("render", *arguments, "--out", "x")
    assert done.code == 2, done.err
    lines = [line for line in done.err.splitlines() if line.strip() and not line.startswith("render smoke")]
    assert len(lines) == 1, done.err
    assert message in lines[0]
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path: Path, dotmask) -> None:
    (tmp_path / "file").write_text("keep")
    done = dotmask("render", "smoke", "--frames", 1, "--out", tmp_path / "file" / "below")
    assert done.code == 2
    assert "cannot write to" in done.err
    done = dotmask("render", "smoke", "--frames", 1, "--out", tmp_path / "file")
    assert done.code == 2
    assert "is a file" in done.err
