"""The pytest plugin as its users meet it: pytest is run on small test files, in this process and on a stub of the run.

No test that uses pytester makes frames: it forgets what was imported in the test, and Numba cannot bear to be imported
again in part. The whole way, in processes of their own, is in tests/acceptance/test_ci_page.py.
"""

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

import pytest_dotmask.marks
import pytest_dotmask.runs
import pytest_dotmask.session
from dotmask.records import Detections, FloatArray, Intrinsics, MaskedDepth, PoseEstimate, RgbdFrame
from dotmask.slam.embedded import EmbeddedSlam
from pytest_dotmask.kept_frames import FrameStore
from pytest_dotmask.runs import DotmaskRun
from scenarios.errors import ScenarioError
from scenarios.registry import chosen_scenario
from scenarios.report import MaskReport, MethodReport, Report, SegmenterReport, StageTimes, WorldTimes

pytest_plugins = ["pytester"]

TINY = {"room": "desk", "people.cast": [], "things": []}
"""A room without anybody, which is built in no time."""

SUITE = """
import pytest

@pytest.mark.dotmask("smoke", seeds=3, frames=4)
def test_mask(dotmask_run, dotmask_scenario):
    report = dotmask_run(mask=lambda rgb, depth_m, stamp_s: depth_m < 1)
    assert report.tracked_frames == dotmask_scenario.frames == 4
"""
COMPARE = ("--dotmask-baseline", "baseline.json")
UPDATE = (*COMPARE, "--dotmask-update-baseline")
NAME = "test_suite.py::test_mask[smoke-mask-baseline]"


@dataclass
class Stub:
    """Stands for the run: its figures take no time.

    Attributes:
        waste: of every seed, besides what differs from seed to seed.
        leak: likewise; None = not measured.
        ate_mm: likewise.
        bytes: what the frames are made of.
    """

    waste: float = 0.05
    leak: float | None = None
    ate_mm: float = 4.0
    bytes: str = "these"

    def __call__(self, source, settings, out, advance, parts) -> Report:
        own = 1 + 0.1 * source.seed
        method = MethodReport(
            ate_rmse_m=1e-3 * self.ate_mm * own,
            rpe_trans_rmse_m=0.002,
            rpe_rot_rmse_rad=0.001,
            tracked_frames=4,
            masks=MaskReport(leak=self.leak, waste=self.waste * own),
            time_ms=StageTimes(),
        )
        return Report(
            scenario=source.name,
            seed=source.seed,
            frames=4,
            renderer="numba",
            segmenter=SegmenterReport(name="none"),
            slam="embedded",
            profile="calibrated",
            frame_hash=f"{self.bytes} {source.seed}",
            methods={settings.methods[0]: method},
            time_ms=WorldTimes(),
        )


@pytest.fixture
def stub(monkeypatch: pytest.MonkeyPatch) -> Stub:
    made = Stub()
    monkeypatch.setattr(pytest_dotmask.runs, "run_source", made)
    return made


@pytest.fixture(autouse=True)
def _environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CI", "true")  # pytest cuts no line
    monkeypatch.setenv("PYTEST_ADDOPTS", "-p no:hypothesispytest -p no:cov")  # a second to load, each time


@pytest.fixture
def suite(pytester: pytest.Pytester) -> pytest.Pytester:
    pytester.makepyfile(test_suite=SUITE)
    return pytester


def stored(pytester: pytest.Pytester) -> dict:
    return json.loads((pytester.path / "baseline.json").read_text())


def runner(folder: Path, frames: int) -> DotmaskRun:
    """What the fixture is, on a room without anybody."""
    scenario = chosen_scenario("smoke", {**TINY, "frames": frames, "seed": 3})
    return DotmaskRun("test_a.py::test[smoke]", FrameStore(threads=1).frames(scenario), folder, [], [])


def test_the_report_is_that_of_dotmask_run_and_frames_are_made_once(
    dotmask: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = runner(tmp_path, frames=3)
    first = run(method="unmasked", name="one")
    monkeypatch.setattr("pytest_dotmask.kept_frames.Simulated", None)
    changes = [text for key, value in TINY.items() for text in ("--set", f"{key}={json.dumps(value)}")]
    arguments = ("run", "smoke", "--seed", 3, "--frames", 3, *changes, "--methods", "unmasked", "--out", tmp_path / "a")
    of_command = json.loads(dotmask(*arguments, "--json").out)
    told = {"time_ms"}
    for report in (first, run(method="unmasked", name="two")):
        assert report.model_dump(exclude=told) == {
            key: value for key, value in of_command["methods"]["unmasked"].items() if key not in told
        }
    scenarios = [(tmp_path / folder / "scenario.json").read_text() for folder in ("one", "a")]
    assert scenarios[0] == scenarios[1]


def test_a_store_lets_go_of_what_was_used_least_lately(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pytest_dotmask.kept_frames.MOST_BYTES", 10)
    store = FrameStore(threads=1)
    scenarios = [chosen_scenario("smoke", {"seed": seed}) for seed in range(3)]
    first, second = (store.frames(scenario) for scenario in scenarios[:2])
    first.bytes, second.bytes = 6, 4
    assert store.frames(scenarios[0]) is first
    store.frames(scenarios[2]).bytes = 5
    assert store.frames(scenarios[0]) is first
    assert store.frames(scenarios[1]) is not second


class LeftHalf:
    """A segmenter."""

    def segment(self, frame: RgbdFrame) -> Detections:
        masks = np.zeros((1, *frame.depth_m.shape), bool)
        masks[0, :, :160] = True
        boxes = np.array([[0.0, 0, 159, 239]])
        return Detections(masks=masks, boxes_px=boxes, class_names=("person",), scores=np.ones(1))


class Watched(EmbeddedSlam):
    """A SLAM back end that remembers whether it saw anything in the left half."""

    def __init__(self, intrinsics: Intrinsics, T_world_camera: FloatArray) -> None:
        super().__init__(intrinsics, T_world_camera)
        self.saw: list[bool] = []

    def track(self, frame: RgbdFrame, masked: MaskedDepth) -> PoseEstimate:
        self.saw.append(bool(masked.mo_mdi_m[:, :160].any()))
        return super().track(frame, masked)


def test_a_segmenter_and_a_slam_of_the_users_own_are_run(tmp_path: Path) -> None:
    made: list[Watched] = []

    def make(intrinsics: Intrinsics, T_world_camera: FloatArray) -> Watched:
        made.append(Watched(intrinsics, T_world_camera))
        return made[-1]

    report = runner(tmp_path, frames=4)(segmenter=LeftHalf(), slam=make, method="mdi")
    assert [slam.saw for slam in made] == [[False] * 4]
    assert report.tracked_frames == 4
    assert 0.4 < report.masks.waste < 0.6
    told = json.loads((tmp_path / "mdi" / "report.json").read_text())
    assert (told["segmenter"]["name"], "make" in told["slam"]) == ("LeftHalf", True)


def test_a_mask_is_asked_for_every_frame(tmp_path: Path) -> None:
    stamps = []

    def both(rgb: np.ndarray, depth_m: np.ndarray, stamp_s: float) -> dict[str, np.ndarray]:
        rgb[:] = 0  # the images are the function's own
        stamps.append(stamp_s)
        nothing = np.zeros(depth_m.shape, np.uint8)
        return {"odometry": nothing, "map": nothing + 1}

    run = runner(tmp_path, frames=3)
    shown = run(mask=both)
    assert stamps == [0.0, 1 / 30, 2 / 30]
    assert shown.masks.waste == 0
    hidden = run(mask=lambda *images: ~both(*images)["odometry"].astype(bool) | True, name="nothing left")
    assert hidden.masks.waste == 1
    for wrong, message in (
        (lambda *images: np.zeros((3, 4)), r"the size of the image, \(240, 320\); got \(3, 4\)"),
        (lambda *images: {"map": np.zeros((240, 320))}, r"give a mask, or .*; got \['map'\]"),
    ):
        with pytest.raises(ScenarioError, match=message):
            run(mask=wrong, name="wrong")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"mask": len, "segmenter": LeftHalf()}, "give mask= or segmenter=, not both"),
        ({"mask": len, "method": "mdi"}, "give mask= or method=, not both"),
        ({"method": "mdj"}, "unknown method 'mdj'. Did you mean mdi?"),
        ({"name": "../a"}, "without a slash"),
        ({"name": "there"}, "has a run 'there' already"),
    ],
)
def test_arguments_that_do_not_fit_are_refused(
    tmp_path: Path, stub: "Stub", arguments: dict[str, Any], message: str
) -> None:
    run = runner(tmp_path, frames=2)
    run(name="there")
    with pytest.raises(ScenarioError, match=message):
        run(**arguments)


def test_every_seed_is_a_test(suite: pytest.Pytester, stub: "Stub") -> None:
    suite.makepyfile(test_suite=SUITE.replace("seeds=3", "seeds=[3, 1]"))
    result = suite.runpytest("-v")
    result.assert_outcomes(passed=2)
    result.stdout.fnmatch_lines(["*::test_mask[[]smoke-seed3] PASSED*", "*::test_mask[[]smoke-seed1] PASSED*"])


@pytest.mark.parametrize(
    ("mark", "message"),
    [
        ('("smok")', "unknown scenario 'smok'. Did you mean smoke?"),
        ("()", "name a scenario"),
        ('("smoke", sceds=3)', "got an unexpected keyword argument 'sceds'"),
        ('("smoke", seeds=0)', "seeds: expected a number of seeds, 1 or more, or a list of them; got 0"),
        ('("smoke", seeds="many")', "got 'many'"),
        ('("smoke", seeds=[1, 1])', "smoke-seed1 is there twice"),
        ('("smoke", frames=0)', "frames: Input should be greater than or equal to 1"),
        ('("smoke", overrides={"camera.sped": 2})', "unknown key 'sped'"),
        ('("smoke", overrides={"camera.speed": {1}})', "camera.speed: Object of type set is not JSON serializable"),
        ('("smoke", overrides={"seed": 2})', "the seed is set by seeds="),
        ("(3)", "expected names of scenarios or Scenario objects, got 3"),
    ],
)
def test_a_bad_marker_is_one_line(pytester: pytest.Pytester, mark: str, message: str) -> None:
    pytester.makepyfile(f"import pytest\n@pytest.mark.dotmask{mark}\ndef test_a(dotmask_scenario): pass")
    result = pytester.runpytest()
    assert result.ret == pytest.ExitCode.INTERRUPTED
    (line,) = [line for line in result.outlines if message in line and not line.startswith("ERROR")]
    assert line.startswith("test_a_bad_marker_is_one_line.py::test_a: @pytest.mark.dotmask: ")


def test_a_test_without_a_marker_is_told_how(pytester: pytest.Pytester) -> None:
    pytester.makepyfile("def test_a(dotmask_run): pass")
    pytester.runpytest().stdout.fnmatch_lines(["*::test_a: it uses dotmask_scenario or dotmask_run: mark it, *"])


def test_options_that_cannot_work_are_one_line(suite: pytest.Pytester) -> None:
    for arguments, message in (
        (COMPARE, "--dotmask-baseline baseline.json: there is no such file; write it with --dotmask-update-baseline"),
        (("--dotmask-update-baseline",), "name the file to write with --dotmask-baseline FILE"),
        (("--dotmask-summary", "no/a.md"), "--dotmask-summary no/a.md: there is no such folder"),
        (("--dotmask-baseline", "test_suite.py"), "test_suite.py: not a baseline (file: Invalid JSON"),
    ):
        result = suite.runpytest(*arguments)
        assert result.ret == pytest.ExitCode.USAGE_ERROR
        assert sum(message in line for line in result.errlines) == 1, result.errlines
        assert len(result.errlines) <= 2


def test_the_same_figures_pass_and_worse_ones_fail_by_name(suite: pytest.Pytester, stub: Stub) -> None:
    renewed = suite.runpytest(*UPDATE)
    renewed.assert_outcomes(passed=3)
    renewed.stdout.fnmatch_lines(["wrote baseline.json: 3 runs; commit it"])
    before = (suite.path / "baseline.json").read_bytes()
    runs = stored(suite)["runs"]
    assert [run["seed"] for run in runs] == [0, 1, 2]
    assert {run["test"] for run in runs} == {"test_suite.py::test_mask[smoke]"}
    assert runs[0]["figures"]["masks.leak"] is None, "not measured is null"
    same = suite.runpytest(*COMPARE)
    same.assert_outcomes(passed=4)
    same.stdout.fnmatch_lines(["test_suite.py .... *[[]100%]"])
    assert same.ret == pytest.ExitCode.OK

    stub.waste, stub.ate_mm = 0.5, 8.0
    worse = suite.runpytest(*COMPARE, "--dotmask-summary", "summary.md", "--junitxml=worse.xml")
    worse.assert_outcomes(passed=3, failed=1)
    assert worse.ret == pytest.ExitCode.TESTS_FAILED
    worse.stdout.re_match_lines(
        [
            r"Worse than baseline\.json, with 95 % confidence for all 5 figures that were compared together\.",
            r"Scenario smoke, run 'mask':",
            r"  ate_rmse_m   4\.39 mm -> 8\.78 mm: 2\.00 times \[2\.00 to 2\.00\], worse in all 3 seeds",
            r"  masks\.waste  5\.5 % -> 55 %: \+49\.5 points \[\+\S+ to \+\S+\], worse in all 3 seeds",
            r".*--dotmask-update-baseline",
            r"FAILED test_suite\.py::test_mask\[smoke-mask-baseline\] - worse: ate_rmse_m 4\.39 mm -> .*",
        ]
    )
    page = (suite.path / "summary.md").read_text()
    assert "5 figures compared with the baseline: 2 worse" in page
    assert "| 3 | `ate_rmse_m` | 4.39 mm -> 8.78 mm: 2.00 times [2.00 to 2.00] | **worse** |" in page
    cases = {case.get("name"): case for case in ElementTree.parse(suite.path / "worse.xml").iter("testcase")}
    assert "masks.waste" in cases["test_mask[smoke-mask-baseline]"].find("failure").get("message")
    properties = {p.get("name"): p.get("value") for p in cases["test_mask[smoke-seed2]"].iter("property")}
    assert float(properties["dotmask.mask.masks.waste"]) == pytest.approx(0.6)

    stub.waste, stub.ate_mm = 0.01, 2.0
    suite.runpytest(*COMPARE, "--dotmask-summary", "summary.md").assert_outcomes(passed=4)
    assert "| better |" in (suite.path / "summary.md").read_text()
    assert (suite.path / "baseline.json").read_bytes() == before, "a comparison changes nothing"


def test_what_cannot_be_compared_fails_and_says_what_to_do(suite: pytest.Pytester, stub: Stub) -> None:
    suite.runpytest(*UPDATE)
    path, content = suite.path / "baseline.json", stored(suite)
    for change, message in (
        (lambda runs: runs[1].update(frame_hash="others", version="0.0.1"), "*frames of seeds 1 are not those that*"),
        (lambda runs: runs.pop(2), "the baseline does not know seeds 2: renew it with --dotmask-update-baseline"),
        (lambda runs: runs.clear(), "the baseline does not know this test: renew it with --dotmask-update-baseline"),
    ):
        varied = json.loads(json.dumps(content))
        change(varied["runs"])
        path.write_text(json.dumps(varied))
        result = suite.runpytest(*COMPARE)
        result.assert_outcomes(passed=3, failed=1)
        result.stdout.fnmatch_lines([message, f"FAILED {NAME.replace('[', '[[]')} - dotmask: *"])
    path.write_text(json.dumps(content))
    few = suite.runpytest(*COMPARE, "-k", "seed1", "--dotmask-summary", "summary.md")
    few.assert_outcomes(passed=2, deselected=2)
    few.stdout.fnmatch_lines(["2 runs of the baseline have no partner: they were not run"])
    assert "too few of its seeds were run" in (suite.path / "summary.md").read_text()


def test_a_figure_that_one_run_lacks_is_not_compared(suite: pytest.Pytester, stub: Stub) -> None:
    stub.leak = 0.0
    suite.runpytest(*UPDATE)
    stub.leak = None
    suite.runpytest(*COMPARE, "--dotmask-summary", "summary.md").assert_outcomes(passed=4)
    assert "masks.leak" not in (suite.path / "summary.md").read_text()


def test_only_what_was_run_is_renewed_and_nothing_after_a_failure(suite: pytest.Pytester, stub: Stub) -> None:
    suite.makepyfile(test_other=SUITE.replace("seeds=3", "seeds=2"))
    result = suite.runpytest(*UPDATE)
    result.stdout.fnmatch_lines(["test_other.py::test_mask*: no comparison will be possible with fewer than 3 seeds"])
    before = stored(suite)["runs"]
    suite.makepyfile(test_broken="def test_a(): assert False")
    stub.waste = 0.3
    failed = suite.runpytest(*UPDATE)
    failed.stdout.fnmatch_lines(["baseline.json: not renewed, since tests have failed"])
    assert failed.ret == pytest.ExitCode.TESTS_FAILED
    assert stored(suite)["runs"] == before
    suite.runpytest(*UPDATE, "test_other.py").stdout.fnmatch_lines(["kept *: test_suite.py::test_mask[[]smoke]"])
    after = stored(suite)["runs"]
    assert [run for run in after if "suite" in run["test"]] == [run for run in before if "suite" in run["test"]]
    assert [run["figures"]["masks.waste"] > 0.2 for run in after] == [True] * 2 + [False] * 3
    few = suite.runpytest(*COMPARE, "test_other.py")
    few.stdout.fnmatch_lines(["the baseline has 2 seeds of this test, 3 are the least: raise seeds= and renew it *"])


def test_other_parameters_and_classes_stay_in_the_name(pytester: pytest.Pytester, stub: Stub) -> None:
    pytester.makepyfile(
        test_suite="""
        import pytest

        @pytest.mark.dotmask("crowd", seeds=9)
        class TestAll:
            @pytest.mark.dotmask("smoke", seeds=[1, 12])
            @pytest.mark.parametrize("wide", [True, False])
            def test_mask(self, dotmask_run, wide):
                dotmask_run(mask=None, name="a")
        """
    )
    pytester.runpytest(*UPDATE).assert_outcomes(passed=4)
    told = {(run["test"], run["seed"]) for run in stored(pytester)["runs"]}
    names = [f"test_suite.py::TestAll::test_mask[smoke-{wide}]" for wide in (True, False)]
    assert told == {(name, seed) for name in names for seed in (1, 12)}


STUBBED = """
import sys
sys.path.insert(0, {folder!r})
import pytest_dotmask.runs
import test_pytest_plugin
pytest_dotmask.runs.run_source = test_pytest_plugin.Stub(waste=0.5)
"""


def test_workers_of_xdist_send_their_runs_to_the_one_who_compares(suite: pytest.Pytester, stub: Stub) -> None:
    suite.runpytest(*UPDATE).assert_outcomes(passed=3)
    suite.makeconftest(STUBBED.format(folder=str(Path(__file__).parent)))
    result = suite.runpytest_subprocess(*COMPARE, "-n2", "--dotmask-summary", "summary.md")
    result.assert_outcomes(passed=3, failed=1)
    result.stdout.no_fnmatch_line("INTERNALERROR*")
    result.stdout.fnmatch_lines([f"FAILED {NAME.replace('[', '[[]')} - worse: *masks.waste *points*"])
    assert "**worse**" in (suite.path / "summary.md").read_text()


FOREIGN = """
import sys

def test_nothing_of_ours_is_loaded():
    loaded = {"numpy", "pydantic", "dotmask", "sim"} & set(sys.modules)
    assert not loaded
    import scenarios
    assert scenarios.MINE
"""


def test_where_it_is_not_used_it_loads_and_changes_nothing(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(test_a=FOREIGN)
    pytester.mkpydir("scenarios").joinpath("__init__.py").write_text("MINE = True")
    outputs = []
    for arguments in ((), ("-p", "no:dotmask")):
        result = pytester.run(sys.executable, "-m", "pytest", "-v", *arguments)
        assert result.ret == 0, result.stdout.str()
        outputs.append([line for line in result.outlines if "passed in" not in line and "plugins:" not in line])
    assert outputs[0] == outputs[1]
    pytester.makepyfile(test_b="import pytest\n@pytest.mark.dotmask('smoke')\ndef test_b(dotmask_run): pass")
    result = pytester.run(sys.executable, "-m", "pytest", "test_b.py")
    result.stdout.fnmatch_lines(["*another package named 'scenarios' hides dotmask's: *; rename it, or run `pytest`"])


def test_the_plugin_is_quick_to_import() -> None:
    code = "import sys, time, pytest; t = time.process_time(); import pytest_dotmask.plugin; "
    code += "print(time.process_time() - t, sorted(set(sys.modules) & {'numpy', 'pydantic', 'scenarios', 'sim'}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    seconds, _, loaded = done.stdout.partition(" ")
    assert float(seconds) < 0.05
    assert loaded.strip() == "[]"


def test_scenario_objects_are_as_good_as_names(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
        import pytest
        from scenarios.registry import scenario

        @pytest.mark.dotmask(scenario("smoke").model_copy(update={"name": "mine", "seed": 7}), "crowd", seeds=2)
        def test_a(dotmask_scenario):
            print("IS", dotmask_scenario.name, dotmask_scenario.seed)
        """
    )
    result = pytester.runpytest("-rP")
    told = [line for line in result.outlines if line.startswith("IS ")]
    assert told == ["IS mine 7", "IS mine 8", "IS crowd 0", "IS crowd 1"]
