"""Blame, steps and correlation against values that can be worked out by hand."""

import numpy as np
import pytest
from rich.console import Console

from dotmask.evaluation.trajectory import relative_pose_error
from dotmask.pipeline import FrameResult, FrontEndResult
from dotmask.records import FloatArray, Intrinsics, MaskedDepth, PoseEstimate, RgbdFrame, SlamStatus, Trajectory
from scenarios.attribution.report import (
    Attribution,
    Figures,
    add_up,
    blame_stages,
    blame_table,
    figures_of,
    figures_table,
)
from scenarios.attribution.steps import Step, StepMeter, correlate
from scenarios.attribution.variants import STAGES, VARIANTS, Variant
from scenarios.report import ConfusionReport, MaskReport, MethodReport, MocReport, SegmenterReport, StageTimes
from sim.geometry import look_at
from sim.records import GroundTruth, ObjectTruth

HARM = {"masks": 1.0, "depth": 2.0, "pose": 4.0, "association": 8.0, "moc": 16.0}


def added(variant: Variant) -> Figures:
    """Figures of a method whose stages' errors simply add up."""
    harm = sum(HARM[stage] for stage in STAGES if stage not in variant.true_stages)
    return Figures(ate_rmse_m=1.0 + harm, moc_error=0.01 * harm, leak=None)


ADDED = {variant.name: added(variant) for variant in VARIANTS}


def test_where_errors_add_up_gain_and_cost_are_each_stages_own() -> None:
    blame = blame_stages(ADDED)
    for stage, harm in HARM.items():
        for figures in (blame[stage].gain, blame[stage].cost):
            assert figures.ate_rmse_m == pytest.approx(harm)
            assert figures.moc_error == pytest.approx(0.01 * harm)
            assert figures.leak is None, "what was not measured is nobody's fault"
    total = ADDED["baseline"] - ADDED["all_true"]
    for figures in (add_up(blame).gain, add_up(blame).cost):
        assert figures.ate_rmse_m == pytest.approx(total.ate_rmse_m)


def test_an_error_that_another_one_hides_costs_but_gains_nothing() -> None:
    # Two stages that spoil the same thing: repairing one does not help while the other is broken.
    def spoiled(variant: Variant) -> Figures:
        return Figures(leak=float(not {"pose", "moc"} <= variant.true_stages))

    blame = blame_stages({variant.name: spoiled(variant) for variant in VARIANTS})
    assert (blame["pose"].gain.leak, blame["pose"].cost.leak) == (0.0, 1.0)
    assert (blame["masks"].gain.leak, blame["masks"].cost.leak) == (0.0, 0.0)


def test_the_tables_show_signs_and_what_was_not_measured() -> None:
    blame = blame_stages(ADDED)
    attribution = Attribution(
        scenario="smoke",
        seed=0,
        frames=3,
        renderer="numba",
        segmenter=SegmenterReport(name="oracle"),
        slam="embedded",
        profile="paper",
        pose_feedback="previous",
        frame_hash="ab" * 32,
        figures=ADDED,
        blame=blame,
        sum=add_up(blame),
        total=ADDED["baseline"] - ADDED["all_true"],
        correlation={},
        variants={},
    )
    console = Console(width=80, record=True, file=None)
    with console.capture() as capture:
        console.print(figures_table(attribution))
        console.print(blame_table(attribution))
    rows = {line.split("  ")[0].strip(): line.split() for line in capture.get().splitlines() if line.strip()}
    assert rows["pose"] == ["pose", "+4000.00", "+4.00", "-", "+4000.00", "+4.00", "-"]
    assert rows["sum"][1] == "+31000.00"
    assert rows["every stage true"][-3:] == ["1000.00", "0.00", "-"]


def of_counts(by_class: dict[str, ConfusionReport] | None) -> Figures:
    return figures_of(
        MethodReport(
            ate_rmse_m=0.5,
            rpe_trans_rmse_m=None,
            rpe_rot_rmse_rad=None,
            tracked_frames=3,
            moc=MocReport(by_class=by_class),
            masks=MaskReport(leak=0.25),
            time_ms=StageTimes(),
        )
    )


def test_the_error_of_the_classification_is_the_share_of_wrong_verdicts_of_all_classes() -> None:
    people = ConfusionReport(true_positive=10, false_positive=3, false_negative=2, true_negative=5)
    chairs = ConfusionReport(true_positive=0, false_positive=1, false_negative=0, true_negative=9)
    assert of_counts({"person": people, "chair": chairs}) == Figures(ate_rmse_m=0.5, moc_error=6 / 30, leak=0.25)
    assert of_counts(None).moc_error is None


CAMERA = Intrinsics(width=8, height=6, fx=6.0, fy=6.0, cx=3.5, cy=2.5)


def frames(poses: list[FloatArray | None], truth: list[FloatArray]) -> list[Step]:
    """The steps of a run in which instance 3, on the left half, moves, and odometry sees 5 of its pixels."""
    ids = np.zeros((6, 8), np.uint16)
    ids[:, :4] = 3
    depth = np.full((6, 8), 2.0, np.float32)
    masked = np.where(ids == 3, np.float32(0), depth)
    masked[0, :4] = masked[1, 0] = 2.0
    actor = ObjectTruth(
        name="p", class_name="person", instance_id=3, T_world_object=np.eye(4), centre_world=np.zeros(3),
        velocity_world=np.zeros(3), surface_speed_m_s=1.0, is_moving=True, visible_pixels=24, occlusion=0.0,
        is_truncated=True, ideal_world=None,
    )  # fmt: skip
    meter, steps = StepMeter(), []
    for index, (pose, true_pose) in enumerate(zip(poses, truth, strict=True)):
        frame = RgbdFrame(
            index=index,
            timestamp_s=index / 30,
            rgb=np.zeros((6, 8, 3), np.uint8),
            depth_m=depth,
            intrinsics=CAMERA,
        )
        result = FrameResult(
            frame=frame,
            T_world_camera_predicted=np.eye(4),
            front_end=FrontEndResult(
                detections=None,
                observations=(),
                tracks=(),
                masked=MaskedDepth(mo_mdi_m=masked, mdi_m=masked),
                stage_seconds={},
            ),
            pose=PoseEstimate(
                timestamp_s=frame.timestamp_s,
                T_world_camera=pose,
                status=SlamStatus.LOST if pose is None else SlamStatus.TRACKED,
                inliers=9,
            ),
            stage_seconds={},
        )
        steps.append(
            meter.see(GroundTruth(T_world_camera=true_pose, depth_m=depth, instance_ids=ids, objects=(actor,)), result)
        )
    return steps


def wandering(seed: int, noise_m: float) -> list[FloatArray]:
    random = np.random.default_rng(seed)
    return [
        look_at(np.array([0.1 * k, 0, 1]) + random.normal(0, noise_m, 3), np.array([3.0, k % 3, 1])) for k in range(9)
    ]


def test_the_steps_are_those_of_the_relative_pose_error() -> None:
    truth, estimate = wandering(0, 0.0), wandering(1, 0.02)
    steps = frames(list(estimate), truth)
    times = np.arange(9) / 30
    expected = relative_pose_error(
        Trajectory(timestamps_s=times, T_world_camera=np.array(truth)),
        Trajectory(timestamps_s=times, T_world_camera=np.array(estimate)),
    )
    assert steps[0].trans_error_m is None
    errors = np.array([(s.trans_error_m, s.rot_error_rad) for s in steps[1:]])
    assert np.sqrt((errors**2).mean(axis=0)) == pytest.approx([expected.trans_rmse_m, expected.rot_rmse_rad])
    assert {(s.moving_pixels, s.leaked_pixels) for s in steps} == {(24, 5)}


def test_a_step_from_or_to_a_frame_without_pose_is_not_measured() -> None:
    truth = wandering(0, 0.0)
    estimate: list[FloatArray | None] = list(truth)
    estimate[4] = None
    assert [s.frame for s in frames(estimate, truth) if s.trans_error_m is None] == [0, 4, 5]


def step(leaked: int, error_m: float | None) -> Step:
    return Step(
        frame=0, timestamp_s=0.0, trans_error_m=error_m, rot_error_rad=error_m, moving_pixels=99, leaked_pixels=leaked
    )


def test_correlation_of_values_and_of_ranks() -> None:
    rising = [step(leaked, error) for leaked, error in ((0, 0.0), (1, 0.1), (2, 0.2), (3, 5.0))]
    found = correlate([*rising, step(50, None)])
    x, y = np.array([0, 1, 2, 3.0]), np.array([0, 0.1, 0.2, 5.0])
    by_hand = np.mean((x - x.mean()) * (y - y.mean())) / (x.std() * y.std())
    assert (found.steps, found.steps_with_leak) == (4, 3)
    assert found.pearson == pytest.approx(by_hand)
    assert found.spearman == pytest.approx(1.0)


@pytest.mark.parametrize("steps", [[], [step(0, 0.1), step(0, 0.2), step(0, 0.3)], [step(0, 0.1), step(4, 0.2)]])
def test_no_correlation_where_nothing_varies_or_two_points_would_decide(steps: list[Step]) -> None:
    found = correlate(steps)
    assert found.pearson is None
    assert found.spearman is None
