"""Attribution and counterfactuals from the command line, on a few frames of the smoke scenario."""

import csv
import json
from pathlib import Path

import pytest

from scenarios.attribution.report import Attribution
from scenarios.attribution.variants import VARIANTS
from scenarios.counterfactual import Triplet
from scenarios.report import Report

FRAMES = 24
ARGUMENTS = ("smoke", "--frames", FRAMES, "--profile", "paper", "--json")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("attribution")


@pytest.fixture
def attribution(folder: Path, dotmask) -> Attribution:
    out = folder / "blame"
    if not out.exists():
        done = dotmask("attribute", *ARGUMENTS, "--out", out)
        assert done.code == 0, done.err
        assert done.out == (out / "attribution.json").read_text()
    return Attribution.model_validate_json((out / "attribution.json").read_text())


@pytest.fixture
def report(folder: Path, dotmask) -> Report:
    if not (folder / "run").exists():
        assert dotmask("run", *ARGUMENTS, "--methods", "unmasked,mdi,dotmask", "--out", folder / "run").code == 0
    return Report.model_validate_json((folder / "run" / "report.json").read_text())


def test_the_baseline_is_the_run(attribution: Attribution, report: Report) -> None:
    assert attribution.frame_hash == report.frame_hash
    baseline, ours = attribution.variants["baseline"], report.methods["dotmask"]
    assert baseline.model_copy(update={"time_ms": ours.time_ms}) == ours


def test_with_every_stage_true_nothing_leaks_and_no_verdict_is_wrong(attribution: Attribution, folder: Path) -> None:
    true = attribution.figures["all_true"]
    assert true.moc_error == 0.0
    with (folder / "blame" / "frames.csv").open(newline="") as file:
        frames = [row for row in csv.DictReader(file) if row["method"] == "all_true"]
    # Instances below the oracle's least number of pixels are no detections, whoever segments.
    unseen = sum(int(row["leaked_pixels"]) for row in frames)
    assert true.leak == pytest.approx(unseen / sum(int(row["moving_pixels"]) for row in frames))
    assert true.leak < 1e-4
    assert attribution.figures["baseline"].moc_error > 0.1, "else there would be nothing to attribute"
    assert attribution.variants["all_true"].tracking.switches == 0


def test_the_oracle_is_not_to_blame_and_the_classification_is_to_blame_for_its_verdicts(
    attribution: Attribution,
) -> None:
    masks, moc = attribution.blame["masks"], attribution.blame["moc"]
    assert set(masks.gain.model_dump().values()) | set(masks.cost.model_dump().values()) == {0.0}
    # What has no depth has no track, hence no verdict: that is not the classification's fault.
    assert 0.9 * attribution.figures["baseline"].moc_error < moc.gain.moc_error
    assert moc.cost.moc_error > 0


def test_the_sums_of_blame_are_reported(attribution: Attribution) -> None:
    for kind in ("gain", "cost"):
        for figure in ("ate_rmse_m", "moc_error", "leak"):
            parts = [getattr(getattr(blame, kind), figure) for blame in attribution.blame.values()]
            assert getattr(getattr(attribution.sum, kind), figure) == pytest.approx(sum(parts))
    total = attribution.figures["baseline"].leak - attribution.figures["all_true"].leak
    assert attribution.total.leak == pytest.approx(total)


def test_wrong_verdicts_are_those_of_the_table_of_tracks(attribution: Attribution, folder: Path) -> None:
    def rows(table: str) -> list[dict[str, str]]:
        with (folder / "blame" / table).open(newline="") as file:
            return [row for row in csv.DictReader(file) if row["method"] == "baseline"]

    answers = sum(int(row["detections"]) for row in rows("frames.csv"))
    tracked = [row for row in rows("tracks.csv") if row["instance_id"]]
    wrong = sum(row["is_moving"] != row["true_is_moving"] for row in tracked)
    # A detection without a track is called moving; here those are chairs too far away for the sensor.
    untracked = answers - len(tracked)
    assert 0 < untracked < 5
    assert attribution.figures["baseline"].moc_error == pytest.approx((wrong + untracked) / answers)


def test_the_folder_is_complete(attribution: Attribution, folder: Path) -> None:
    out = folder / "blame"
    assert sorted(p.name for p in out.iterdir()) == [
        "attribution.json", "error_against_leak.png", "frames.csv", "scenario.json", "steps.csv", "tracks.csv",
        "versions.json",
    ]  # fmt: skip
    with (out / "steps.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == FRAMES * len(VARIANTS)
    assert {row["variant"] for row in rows} == {variant.name for variant in VARIANTS} == set(attribution.figures)
    assert set(attribution.correlation) == {"baseline", "all_true"}
    assert attribution.correlation["baseline"].steps == FRAMES - 1


def test_a_triplet_compares_runs_with_the_same_camera(folder: Path, report: Report, dotmask) -> None:
    out = folder / "triplet"
    done = dotmask("counterfactual", *ARGUMENTS, "--out", out)
    assert done.code == 0, done.err
    triplet = Triplet.model_validate(json.loads(done.out))
    assert done.out == (out / "counterfactual.json").read_text()
    assert triplet.frame_hashes["moving"] == report.frame_hash
    assert len(set(triplet.frame_hashes.values())) == 3
    moving = {name: method.ate_rmse_m for name, method in report.methods.items()}
    assert triplet.ate_rmse_m["moving"] == moving
    costs = triplet.costs
    assert costs.not_masking_m > 3 * abs(costs.method_moving_m), "the method prevents most of what people who walk do"
    assert costs.not_masking_m > 3 * abs(costs.method_empty_m)
    assert 0 <= triplet.flagged_frozen <= 1
    paths = {(out / world / "trajectory_truth.txt").read_bytes() for world in ("empty", "frozen", "moving")}
    assert len(paths) == 1, "the camera is the same in every world"


def test_a_segmenter_that_misses_people_is_to_blame_for_the_leak(tmp_path: Path, dotmask) -> None:
    done = dotmask(
        "attribute",
        "smoke",
        "--frames",
        12,
        "--set",
        "faults.missed.probability=0.5",
        "--json",
        "--out",
        tmp_path / "a",
    )
    found = Attribution.model_validate_json(done.out)
    others = [blame.cost.leak for stage, blame in found.blame.items() if stage != "masks"]
    assert found.blame["masks"].cost.leak > 0.05
    assert found.blame["masks"].cost.leak > 10 * max(others)
    assert found.figures["true_masks"].leak < found.figures["baseline"].leak


BAD_INPUT = [
    (["attribute", "smok"], "Did you mean smoke?"),
    (["attribute", "smoke", "--profile", "papr"], "paper"),
    (["attribute", "smoke", "--profile", "original"], "without these stages"),
    (["attribute", "smoke", "--segmenter", "orcale"], "Did you mean oracle?"),
    (["attribute"], "give the name of a scenario, or --from"),
    (["counterfactual", "smoke", "--set", "variant=frozen"], "leave variant=frozen out"),
    (["counterfactual", "smoke", "--frames", "0"], "greater than or equal to 1"),
]


@pytest.mark.parametrize(("arguments", "message"), BAD_INPUT, ids=lambda v: " ".join(v) if isinstance(v, list) else "")
def test_bad_input_is_one_clear_line_and_leaves_nothing(
    arguments: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, dotmask
) -> None:
    monkeypatch.chdir(tmp_path)
    done = dotmask(*arguments)
    assert done.code == 2, done.err
    assert message in done.err
    assert "Traceback" not in done.err
    assert not [p for p in tmp_path.rglob("*") if p.is_file()]


def test_help_gives_examples(dotmask) -> None:
    for verb in ("attribute", "counterfactual"):
        done = dotmask(verb, "--help")
        assert done.code == 0
        assert f"dotmask {verb} smoke" in done.out
