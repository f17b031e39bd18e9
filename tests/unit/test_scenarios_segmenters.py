"""Segmenters of a run: by name, asked once a frame, said in the report; and one of the user's own."""

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import save_file

from dotmask.errors import SegmenterError
from dotmask.records import Intrinsics, RgbdFrame
from dotmask.segmentation.networks import NETWORKS, choose_network
from dotmask.segmentation.yolact.design import COMPACT
from dotmask.segmentation.yolact.network import Yolact
from scenarios.doctor import examine
from scenarios.errors import ScenarioError
from scenarios.finished_runs import figure_settings, run_key, run_name
from scenarios.registry import scenario
from scenarios.report import Report
from scenarios.run import RunSettings
from scenarios.segmenters import load_segmenter
from scenarios.sources.source import TruePose
from scenarios.sweep.plan import SweepPlan

ROOT = Path(__file__).parents[2]
EXAMPLE = re.search(r"```python\n(.*?)```", (ROOT / "docs" / "segmenters.md").read_text(), re.DOTALL)


COUNTED = """
seen = []
class Counted(Near):
    def segment(self, frame):
        seen.append(frame.index)
        return super().segment(frame)
"""


class Unknown:
    """A source whose truth is not known."""

    name, oracle = "recorded", None


def frame(depth_m: np.ndarray) -> RgbdFrame:
    height, width = depth_m.shape
    camera = Intrinsics(width=width, height=height, fx=100.0, fy=100.0, cx=79.5, cy=59.5)
    rgb = np.zeros((height, width, 3), np.uint8)
    return RgbdFrame(index=7, timestamp_s=0.0, rgb=rgb, depth_m=depth_m, intrinsics=camera)


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Weights of `compact` that know nothing, but see persons everywhere."""
    torch.manual_seed(0)
    network = Yolact(COMPACT)
    head = network.prediction_layers[0]
    torch.nn.init.zeros_(head.conf_layer.weight)
    head.conf_layer.bias.data[:] = torch.tensor([0.0, 3.0, 0.0, 0.0, 0.0] * COMPACT.anchors_a_cell)
    head.mask_layer.bias.data += 0.5
    path = tmp_path_factory.mktemp("weights") / "compact.safetensors"
    save_file(network.state_dict(), path)
    return path


def test_a_run_with_a_network_stands_beside_the_oracle(weights: Path, tmp_path: Path, dotmask) -> None:
    arguments = ("run", "smoke", "--segmenter", "compact", "--weights", weights, "--frames", 3, "--json")
    threads = torch.get_num_threads()
    done = dotmask(*arguments, "--out", tmp_path / "a", "--expect", "dotmask-oracle.masks.iou>0.99")
    assert (done.code, "holds  dotmask-oracle" in done.err) == (0, True), done.err
    assert torch.get_num_threads() == threads
    report = Report.model_validate_json(done.out)
    assert json.loads(done.out)["segmenter"] == {
        "name": "compact",
        "weights_sha256": choose_network("compact", weights, "cpu").weights_sha256,
        "device": "cpu",
    }
    assert list(report.methods) == ["unmasked", "mdi", "dotmask-oracle", "dotmask"]
    network_ms, oracle_ms = (report.methods[name].time_ms.segment for name in ("dotmask", "dotmask-oracle"))
    assert report.methods["mdi"].time_ms.segment == network_ms
    assert network_ms > oracle_ms, "the network's time is charged to those whom it serves"
    assert report.methods["unmasked"].time_ms.segment is None
    assert report.methods["dotmask"].masks.waste > 0.01, "it sees persons everywhere"
    again = dotmask(*arguments, "--methods", "dotmask", "--out", tmp_path / "b")
    other = Report.model_validate_json(again.out).methods["dotmask"]
    timeless = {"time_ms": other.time_ms}
    assert report.methods["dotmask"].model_copy(update=timeless) == other, "two equal runs differ"


def test_the_key_of_a_run_holds_the_weights_and_not_their_place(weights: Path, tmp_path: Path) -> None:
    def key(path: Path) -> dict:
        return run_key(scenario("smoke"), RunSettings.parse(segmenter="compact", weights=path))

    moved, changed = tmp_path / "moved.safetensors", tmp_path / "changed.safetensors"
    moved.write_bytes(weights.read_bytes())
    save_file({"0": torch.zeros(1)}, changed)
    assert run_name(key(weights)) == run_name(key(moved)) != run_name(key(changed))
    settings = RunSettings.parse(segmenter="compact", weights=weights)
    other = replace(settings, network=replace(settings.network, device="cuda"))
    assert figure_settings(settings) != figure_settings(other)
    assert figure_settings(settings) != figure_settings(replace(settings, threads=1)), "its last bits depend on them"
    oracle = RunSettings.parse()
    assert figure_settings(oracle) == figure_settings(replace(oracle, threads=1))


def test_a_sweep_gives_weights_to_the_networks_among_its_segmenters(weights: Path) -> None:
    words = {"weights": str(weights)}
    plan = SweepPlan.parse(scenario("smoke"), vary=["segmenter=oracle,compact"], words=words)
    assert [cell.settings.segmenter for cell in plan.cells] == ["oracle", "compact"]
    assert [cell.settings.network is None for cell in plan.cells] == [True, False]


BAD_INPUT = [
    (["--segmenter", "yolcat"], "unknown segmenter 'yolcat'. Did you mean yolact"),
    (["--segmenter", "yolact"], "--segmenter yolact: no weights come with it; name a file with --weights"),
    (["--segmenter", "yolact", "--weights", "none.pth"], "none.pth: cannot be read (No such file"),
    (["--segmenter", "yolact", "--weights", "none.pth", "--device", "gpu"], "unknown device 'gpu'"),
    (["--segmenter", "oracle", "--weights", "none.pth"], "--weights and --device are for networks ("),
    (["--device", "cpu"], "not for oracle"),
    (["--methods", "dotmask-oracle"], "the oracle is the segmenter of all methods already"),
    (["--methods", "dotmask-orcale"], "unknown method 'dotmask-orcale'"),
    (["--segmenter", "wrong:Lists"], "frame 0: TypeError: segment answered with list, expected dotmask.records.Detec"),
]

OWN = {
    ":Lists": "expected package.module:factory",
    "nowhere:make": "ModuleNotFoundError: No module named 'nowhere'",
    "wrong:Far": "AttributeError: module 'wrong' has no attribute 'Far'",
    "wrong:np": "TypeError: 'module' object is not callable",
    "wrong:dict": "dict has no method segment(frame)",
    "wrong:breaks": "ZeroDivisionError: division by zero (wrong.py, line 12)",
    "wrong:Fails": "frame 7: RuntimeError: no idea (wrong.py, line 7)",
    "wrong:Small": "frame 7: ValueError: masks: expected the size of the frame, (120, 160), got (2, 2)",
}

WRONG = """\
import numpy as np
from dotmask.records import Detections
class Lists:
    def segment(self, frame): return []
class Fails:
    def segment(self, frame):
        raise RuntimeError("no idea")
class Small:
    def segment(self, frame):
        return Detections(masks=np.ones((1, 2, 2), bool), boxes_px=np.zeros((1, 4)), class_names="c", scores=np.ones(1))
def breaks():
    return 1 / 0
dict = dict
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with modules of the user's own."""
    assert EXAMPLE is not None
    (tmp_path / "near.py").write_text(EXAMPLE[1])
    (tmp_path / "wrong.py").write_text(WRONG)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    for name in ("near", "wrong"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    return tmp_path


@pytest.mark.parametrize(("arguments", "message"), BAD_INPUT, ids=lambda v: " ".join(v) if isinstance(v, list) else "")
def test_bad_input_is_one_clear_line(arguments: list[str], message: str, here: Path, dotmask) -> None:
    done = dotmask("run", "smoke", "--frames", 1, "--out", here / "out", *arguments)
    assert done.code == 2, done.err
    lines = [line for line in done.err.splitlines() if line.strip() and not line.startswith("run smoke")]
    assert len(lines) == 1, done.err
    assert message in lines[0]
    assert not (here / "out").exists()


@pytest.mark.parametrize("name", OWN)
def test_a_mistake_in_a_segmenter_of_ones_own_is_one_line_that_names_the_place(name: str, here: Path) -> None:
    with pytest.raises(ScenarioError, match=re.escape(f"segmenter {name}: {OWN[name]}")) as told:
        load_segmenter(name, None, Unknown()).see(frame(np.ones((120, 160), np.float32)), TruePose(T_world_camera=None))
    assert "\n" not in str(told.value)


def test_the_example_of_the_documents_runs_and_is_asked_once_a_frame(here: Path, dotmask) -> None:
    assert EXAMPLE is not None
    assert len([line for line in EXAMPLE[1].splitlines() if line]) <= 15
    (here / "near.py").write_text(f"{EXAMPLE[1]}\n{COUNTED}")
    arguments = ("run", "smoke", "--frames", 2, "--methods", "mdi,dotmask", "--json")
    done = dotmask(*arguments, "--segmenter", "near:Counted", "--out", here / "out")
    assert done.code == 0, done.err
    assert sys.modules["near"].seen == [0, 1]
    assert json.loads(done.out)["segmenter"] == {"name": "near:Counted", "weights_sha256": None, "device": None}
    settings = RunSettings.parse(segmenter="near:Counted")
    before = run_name(run_key(scenario("smoke"), settings))
    (here / "near.py").write_text(EXAMPLE[1])
    assert run_name(run_key(scenario("smoke"), settings)) != before, "another program gives other figures"


def test_the_example_finds_what_is_near(here: Path) -> None:
    depth_m = np.full((120, 160), 3.0, np.float32)
    depth_m[20:80, 30:90] = 1.0
    depth_m[100:104, 100:104] = 1.0
    segmenter, seen = load_segmenter("near:Near", None, Unknown()), frame(depth_m)
    segmenter.see(seen, TruePose(T_world_camera=None))
    found = segmenter.segment(seen)
    assert found.boxes_px.tolist() == [[30, 20, 89, 79]]
    assert found.masks.sum() == 3600


@pytest.mark.parametrize("name", NETWORKS)
def test_without_pytorch_the_extra_is_named(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(
        SegmenterError, match=rf"--segmenter {re.escape(name)}: torch is not installed; run pip install 'd"
    ):
        choose_network(name, None, "cpu")


def test_doctor_says_what_networks_run_on(monkeypatch: pytest.MonkeyPatch) -> None:
    found = next(finding for finding in examine() if finding.what == "networks")
    assert (found.is_well, found.is_needed, torch.__version__ in found.said) == (True, True, True)
    monkeypatch.setitem(sys.modules, "torch", None)
    lacking = next(finding for finding in examine() if finding.what == "networks")
    assert (lacking.is_well, lacking.is_needed) == (False, False)


def test_without_torchvision_the_other_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "torchvision", None)
    with pytest.raises(SegmenterError, match=r"pip install 'dotmask\[torchvision\]'"):
        choose_network("mask_rcnn", None, "cpu")


def test_a_torchvision_that_does_not_fit_is_said_to_be_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "torchvision.py").write_text("raise RuntimeError('operator torchvision::nms does not exist')")
    for name in [name for name in sys.modules if name.partition(".")[0] == "torchvision"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(SegmenterError, match=r"does not work with the installed PyTorch \(operator torchvision::nms"):
        choose_network("mask_rcnn", None, "cpu")


def test_a_gpu_that_is_not_there_is_not_replaced(weights: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(SegmenterError, match="--device cuda: PyTorch finds no CUDA device here; use --device cpu"):
        choose_network("compact", weights, "cuda")


def test_only_a_network_loads_pytorch() -> None:
    packages = ("torch", "torchvision", "safetensors")
    code = f"import sys, scenarios.run; print([name for name in {packages} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout == "[]\n"
