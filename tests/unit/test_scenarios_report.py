import io
import json

import pytest
from rich.console import Console

from scenarios.errors import ScenarioError
from scenarios.report import (
    ConfusionReport,
    EkfReport,
    MethodReport,
    MocReport,
    Report,
    SegmenterReport,
    StageTimes,
    TrackingReport,
    WorldTimes,
    expectation,
    table,
    times,
)

METHODS = ("unmasked", "dotmask")


def method(ate: float | None, **more: object) -> MethodReport:
    return MethodReport(
        ate_rmse_m=ate,
        rpe_trans_rmse_m=0.001,
        rpe_rot_rmse_rad=0.002,
        tracked_frames=10,
        time_ms=StageTimes(odometry=12.0),
        **more,
    )


DOTMASK = method(
    0.0123,
    ekf=EkfReport(nees_bounds=(5.5, 6.5)),
    tracking=TrackingReport(hota=0.95),
    moc=MocReport(
        precision=0.95,
        start_latency_max_frames=2,
        by_class={"person": ConfusionReport(true_positive=5, false_positive=0, false_negative=1, true_negative=2)},
    ),
)

REPORT = Report(
    scenario="smoke",
    seed=0,
    frames=10,
    renderer="numba",
    segmenter=SegmenterReport(name="oracle"),
    slam="embedded",
    profile="paper",
    frame_hash="ab" * 32,
    methods={"unmasked": method(0.2), "dotmask": DOTMASK},
    time_ms=WorldTimes(render=20.0),
)


def test_report_json_follows_the_contract() -> None:
    tree = json.loads(REPORT.to_json())
    assert list(tree) == [
        "schema", "scenario", "seed", "frames", "renderer", "segmenter", "slam", "slam_parameters", "profile",
        "frame_hash", "methods", "time_ms",
    ]  # fmt: skip
    assert tree["schema"] == 1
    assert tree["time_ms"] == {"render": 20.0}
    dotmask = tree["methods"]["dotmask"]
    assert list(dotmask) == [
        "ate_rmse_m", "rpe_trans_rmse_m", "rpe_rot_rmse_rad", "tracked_frames", "ate_optimised_rmse_m",
        "optimised_frames", "loops", "ekf", "tracking", "moc", "masks", "map", "time_ms",
    ]  # fmt: skip
    assert list(dotmask["ekf"]) == [
        "position_rmse_m", "position_bias_m", "position_bias_ray_m", "position_rmse_ideal_m", "position_bias_ideal_m",
        "velocity_rmse_m_s", "velocity_bias_m_s", "nees", "nees_bounds", "nees_ideal", "nis", "nis_bounds",
        "innovation_correlation", "innovation_correlation_bound",
    ]  # fmt: skip
    assert list(dotmask["tracking"]) == ["mota", "idf1", "hota", "deta", "assa", "switches"]
    assert list(dotmask["moc"]) == [
        "precision", "recall", "idle_flag_rate", "auc", "flag_latency_frames", "unflag_latency_frames", "starts",
        "missed_starts", "start_latency_frames", "start_latency_max_frames", "by_class",
    ]  # fmt: skip
    assert list(dotmask["masks"]) == ["iou", "boundary_f", "leak", "waste"]
    assert list(dotmask["map"]) == [
        "ghost_fraction", "accuracy_m", "accuracy_median_m", "completeness", "points", "views",
    ]  # fmt: skip
    assert list(dotmask["loops"]) == [
        "count", "false_count", "trans_error_m", "trans_error_max_m", "rot_error_rad",
    ]  # fmt: skip
    assert list(dotmask["time_ms"]) == ["segment", "track", "classify", "mask", "odometry", "map"]


def test_what_was_not_measured_is_null() -> None:
    tree = json.loads(REPORT.to_json())["methods"]["unmasked"]
    assert tree["ekf"]["nees"] is None
    assert tree["loops"]["count"] is None


def test_a_figure_that_is_not_finite_is_refused() -> None:
    with pytest.raises(ValueError, match="finite"):
        method(float("nan"))


def test_report_json_there_and_back() -> None:
    assert Report.model_validate_json(REPORT.to_json()) == REPORT


@pytest.mark.parametrize(
    ("text", "holds"),
    [
        ("ate_rmse_m<0.02", True),
        ("dotmask.ate_rmse_m<0.0123", False),
        ("dotmask.ate_rmse_m<=0.0123", True),
        ("unmasked.ate_rmse_m > 0.1", True),
        ("moc.precision>=0.9", True),
        ("moc.recall>=0", False),  # not measured: never holds
        ("time_ms.odometry<1e3", True),
        ("moc.start_latency_max_frames<=3", True),
        ("moc.auc>0.9", False),
        ("tracking.hota>0.9", True),
    ],
)
def test_expectations(text: str, holds: bool) -> None:
    assert expectation(text, METHODS).verdict(REPORT)[0] is holds


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("ate_rmse_m", "expected FIGURE<NUMBER"),
        ("ate<1", "no figure 'ate'; known: ate_rmse_m"),
        ("moc<1", "name one of moc: precision"),
        ("ate_rmse_m.x<1", "has no parts"),
        ("dotmask<1", "name a figure"),
        ("ate_rmse_m<1e", "is no number"),
        ("moc.by_class<1", "'by_class' is not one number"),
        ("moc.by_class.person<1", "'by_class' is not one number"),
        ("ekf.nees_bounds<1", "'nees_bounds' is not one number"),
    ],
)
def test_bad_expectations_say_what_is_valid(text: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        expectation(text, METHODS)


def test_the_table_has_a_row_a_method_and_a_dash_for_what_is_not_there() -> None:
    console = Console(width=200, file=io.StringIO())
    console.print(table(REPORT))
    text = console.file.getvalue()
    assert "12.3" in text
    assert "200.0" in text
    unmasked = next(line for line in text.splitlines() if "unmasked" in line)
    assert " - " in unmasked


def test_a_recorded_sequence_has_neither_seed_nor_renderer() -> None:
    recorded = REPORT.model_copy(update={"seed": None, "renderer": None, "time_ms": WorldTimes()})
    tree = json.loads(recorded.to_json())
    assert (tree["seed"], tree["renderer"], tree["time_ms"]) == (None, None, {"render": None})
    assert table(recorded).title == "smoke, 10 frames: segmenter oracle, SLAM embedded, profile paper"
    assert times(recorded).startswith("ms per frame: CPU of unmasked: odometry 12.0")


def test_the_time_of_a_network_is_told_once() -> None:
    fed = DOTMASK.model_copy(update={"time_ms": StageTimes(segment=1187.0, track=2.0, odometry=12.0)})
    told = DOTMASK.model_copy(update={"time_ms": StageTimes(segment=0.1, track=2.0, odometry=12.0)})
    report = REPORT.model_copy(
        update={
            "segmenter": SegmenterReport(name="yolact", weights_sha256="ab" * 32, device="cpu"),
            "methods": {"dotmask-oracle": told, "dotmask": fed},
        }
    )
    assert times(report).startswith("ms per frame: render 20.0 (wall); yolact 1187.0 (wall); CPU of dotmask-oracle: ")
