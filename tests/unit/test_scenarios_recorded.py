"""`dotmask run` on a recorded folder: contracts of the command line, and what is left in the run folder."""

import csv
import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from dotmask.partial_folder import PartialFolder
from dotmask.records import Intrinsics, RgbdFrame
from dotmask.tum import TumSequenceWriter, read_trajectory
from scenarios.registry import scenario
from scenarios.report import Report
from scenarios.run import RunSettings, run
from scenarios.spec import with_overrides

CAMERA = Intrinsics(width=320, height=240, fx=300.0, fy=300.0, cx=159.5, cy=119.5)


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Four frames of noise 30 times a second, seen by a camera that stands 1 m above the floor."""
    rng = np.random.default_rng(0)
    growing = PartialFolder.create(tmp_path / "noise", {})
    writer = TumSequenceWriter(growing.files, CAMERA)
    writer.begin()
    pose = np.eye(4)
    pose[2, 3] = 1.0
    for index in range(4):
        rgb = rng.integers(0, 256, (240, 320, 3), dtype=np.uint8)
        depth_m = np.full((240, 320), 2.0, np.float32)
        stamp = 1341846313.592026 + index / 30
        frame = RgbdFrame(index=index, timestamp_s=stamp, rgb=rgb, depth_m=depth_m, intrinsics=CAMERA)
        writer.write(frame, pose)
    growing.finish()
    return tmp_path / "noise"


def image(folder: Path, kind: str = "rgb") -> Path:
    return sorted((folder / kind).iterdir())[0]


def test_a_rendered_folder_gives_the_figures_of_its_scenario(tmp_path: Path, dotmask) -> None:
    chosen = with_overrides(scenario("smoke"), {"frames": "12", "variant": "empty"})
    simulated = run(chosen, RunSettings.parse(methods="unmasked", threads=1), tmp_path / "simulated", lambda: None)
    assert dotmask("render", "smoke", "--frames", 12, "--set", "variant=empty", "--out", tmp_path / "seq").code == 0
    done = dotmask("run", tmp_path / "seq", "--out", tmp_path / "recorded", "--json")
    assert done.code == 0, done.err
    recorded = Report.model_validate_json(done.out)
    one, other = simulated.methods["unmasked"], recorded.methods["unmasked"]
    # The sensor's depth is in the file's steps of 0.2 mm already; the first pose passes through a quaternion, and the
    # simulator's rotation is one to six digits.
    assert recorded.frame_hash == simulated.frame_hash
    assert other.ate_rmse_m == pytest.approx(one.ate_rmse_m, abs=1e-5)
    assert other.rpe_trans_rmse_m == pytest.approx(one.rpe_trans_rmse_m, abs=1e-5)
    assert other.tracked_frames == one.tracked_frames == 12
    first, again = (read_trajectory(tmp_path / name / "trajectory_unmasked.txt") for name in ("simulated", "recorded"))
    np.testing.assert_allclose(again.T_world_camera[0], first.T_world_camera[0], atol=1e-6)
    np.testing.assert_allclose(again.T_world_camera, first.T_world_camera, atol=1e-5)


def test_the_report_says_what_does_not_apply(recording: Path, tmp_path: Path, dotmask) -> None:
    done = dotmask("run", recording, "--out", tmp_path / "run", "--video")
    assert done.code == 0, done.err
    assert sorted(p.name for p in (tmp_path / "run").iterdir()) == [
        "frames.csv", "recording.json", "report.json", "trajectories.png", "trajectory_truth.txt",
        "trajectory_unmasked.txt", "trajectory_unmasked_optimised.txt", "versions.json", "video.mp4",
    ]  # fmt: skip
    report = Report.model_validate_json((tmp_path / "run" / "report.json").read_text())
    assert (report.scenario, report.seed, report.renderer, report.segmenter.name) == ("noise", None, None, "none")
    assert report.frames == 4
    assert list(report.methods) == ["unmasked"]
    unmasked = report.methods["unmasked"]
    assert unmasked.masks.leak is unmasked.masks.waste is unmasked.moc.recall is unmasked.ekf.nees is None
    facts = json.loads((tmp_path / "run" / "recording.json").read_text())
    assert facts["world"] == "groundtruth.txt"
    assert facts["camera"]["intrinsics"]["fx"] == 300.0


def test_a_segmenter_of_ones_own_masks_a_recorded_folder(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, dotmask
) -> None:
    (tmp_path / "halves.py").write_text(
        "import numpy as np\n"
        "from dotmask.records import Detections\n"
        "class Left:\n"
        "    def segment(self, frame):\n"
        "        mask = np.zeros((1, *frame.depth_m.shape), bool)\n"
        "        mask[:, :, :160] = True\n"
        "        box = np.array([[0, 0, 159, 239]], float)\n"
        "        return Detections(masks=mask, boxes_px=box, class_names=('person',), scores=np.ones(1))\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    done = dotmask("run", recording, "--segmenter", "halves:Left", "--out", tmp_path / "run", "--json")
    assert done.code == 0, done.err
    report = Report.model_validate_json(done.out)
    assert list(report.methods) == ["unmasked", "mdi", "dotmask"], "there is no oracle to stand beside"
    assert report.segmenter.name == "halves:Left"
    assert report.methods["dotmask"].time_ms.segment is not None
    with (tmp_path / "run" / "frames.csv").open() as file:
        assert {row["detections"] for row in csv.DictReader(file) if row["method"] != "unmasked"} == {"1"}


def test_without_truth_the_world_is_the_first_camera(recording: Path, tmp_path: Path, dotmask) -> None:
    (recording / "groundtruth.txt").unlink()
    done = dotmask("run", recording, "--frames", 2, "--out", tmp_path / "run")
    assert done.code == 0, done.err
    assert "the world is the first camera, and no error is measured" in done.err
    report = Report.model_validate_json((tmp_path / "run" / "report.json").read_text())
    assert report.frames == 2
    assert report.methods["unmasked"].ate_rmse_m is None
    poses = read_trajectory(tmp_path / "run" / "trajectory_unmasked.txt").T_world_camera
    np.testing.assert_allclose(poses[0], np.eye(4), atol=1e-12)


def _append(path: Path, text: str) -> None:
    path.write_text(path.read_text() + text)


FAULTS = {
    "empty folder": (lambda r: shutil.rmtree(r) or r.mkdir(), "has neither rgb.txt nor depth.txt"),
    "missing list": (lambda r: (r / "depth.txt").unlink(), "depth.txt: no such file"),
    "missing image": (lambda r: image(r).unlink(), "rgb.txt:2: "),
    "truncated": (lambda r: image(r).write_bytes(image(r).read_bytes()[:1000]), "is cut off"),
    "8-bit depth": (
        lambda r: shutil.copy(image(r), image(r, "depth")),
        "expected a grey image of 16 bits, found colour",
    ),
    "climbs out": (
        lambda r: _append(r / "rgb.txt", "1e12 ../noise/rgb.txt\n"),
        "rgb.txt:6: ../noise/rgb.txt leads out",
    ),
    "unsorted": (lambda r: _append(r / "rgb.txt", f"1 rgb/{image(r).name}\n"), "rgb.txt:6: time 1 is before"),
    "bad truth": (lambda r: _append(r / "groundtruth.txt", "1 2 3\n"), "groundtruth.txt:6: expected 8 columns"),
    "no camera": (lambda r: (r / "camera.json").unlink(), "give --camera fr1, fr2, fr3 or --intrinsics FILE"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_one_line_that_names_the_file(name: str, recording: Path, tmp_path: Path, dotmask) -> None:
    change, message = FAULTS[name]
    change(recording)
    done = dotmask("run", recording, "--out", tmp_path / "run")
    assert done.code == 2, done.err
    lines = [line for line in done.err.splitlines() if line.strip() and not line.startswith("run noise")]
    assert len(lines) == 1, done.err
    assert message in lines[0]
    assert str(recording) in lines[0]
    assert done.out == ""
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--segmenter", "oracle"], "--segmenter oracle: the true masks of noise are not known"),
        (["--methods", "unmasked,dotmask"], "without a segmenter nothing is masked; leave only unmasked"),
        (["--camera", "fr4"], "unknown camera 'fr4'; known: fr1, fr2, fr3"),
        (["--camera", "fr3"], "320 x 240 pixels, camera fr3 has 640 x 480"),
        (["--camera", "fr3", "--intrinsics", "x.json"], "not both"),
        (["--intrinsics", "x.json"], "x.json: no such file"),
        (["--seed", "1"], "--set and --seed change scenarios only"),
        (["--frames", "0"], "--frames 0: ask for at least one"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_options_that_do_not_fit(arguments: list[str], message: str, recording: Path, tmp_path: Path, dotmask) -> None:
    done = dotmask("run", recording, "--out", tmp_path / "run", *arguments)
    assert done.code == 2, done.err
    lines = [line for line in done.err.splitlines() if line.strip() and not line.startswith("run noise")]
    assert len(lines) == 1, done.err
    assert message in lines[0]
    assert not (tmp_path / "run").exists()


def test_a_scenario_takes_no_camera_and_a_path_is_no_scenario(tmp_path: Path, dotmask) -> None:
    done = dotmask("run", "smoke", "--camera", "fr3", "--out", tmp_path / "run")
    assert (done.code, "a scenario has its own" in done.err) == (2, True)
    done = dotmask("run", tmp_path / "nothing")
    assert (done.code, "nothing: no such folder" in done.err) == (2, True)
