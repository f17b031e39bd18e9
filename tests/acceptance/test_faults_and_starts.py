"""At full size: what a missed detection costs, how soon a start is seen, and that rest is left alone."""

from dataclasses import replace
from pathlib import Path

import pytest

from dotmask.pipeline import ClosedLoop, DotMask
from dotmask.profiles import CALIBRATED
from dotmask.slam.embedded import EmbeddedSlam
from scenarios.bridge import rgbd_frame_from_sim
from scenarios.faults.chain import Faults
from scenarios.judge import Judge
from scenarios.oracle import OracleSegmenter
from scenarios.registry import scenario
from scenarios.report import MethodReport
from scenarios.run import RunSettings, one_opencv_thread, run
from scenarios.run_folder import RunFolder
from scenarios.sources import rendered_ahead
from scenarios.spec import with_overrides
from scenarios.world import build_simulator

pytestmark = pytest.mark.acceptance


@pytest.fixture(scope="module")
def walks(tmp_path_factory: pytest.TempPathFactory) -> dict[str, MethodReport]:
    """The method on the same frames: with every detection, with 30 % missing, and so without masks that coast."""
    whole = scenario("fr3_walking_xyz")
    missing = with_overrides(whole, {"faults.missed.probability": "0.3"})
    runs = {
        "whole": (OracleSegmenter(Faults(whole)), CALIBRATED),
        "missing": (OracleSegmenter(Faults(missing)), CALIBRATED),
        "not coasting": (OracleSegmenter(Faults(missing)), replace(CALIBRATED, coasting_mask_frames=0)),
    }
    loops: dict[str, ClosedLoop] = {}
    judges = {name: Judge(name) for name in runs}
    with RunFolder(tmp_path_factory.mktemp("walks") / "out") as folder, one_opencv_thread():
        for timed in rendered_ahead(build_simulator(whole, "numba", 1)):
            frame, truth = rgbd_frame_from_sim(timed.frame), timed.frame.truth
            for name, (oracle, profile) in runs.items():
                oracle.show(frame.index, truth)
                if name not in loops:
                    start = truth.T_world_camera
                    slam = EmbeddedSlam(frame.intrinsics, start)
                    loops[name] = ClosedLoop(DotMask(oracle, profile), slam, profile.pose_feedback, start)
                judges[name].see(truth, loops[name].step(frame), folder)
    return {name: judge.report() for name, judge in judges.items()}


@pytest.mark.slow
def test_thirty_percent_of_missing_detections_hardly_move_the_trajectory(walks: dict[str, MethodReport]) -> None:
    assert walks["missing"].ate_rmse_m < 1.5 * walks["whole"].ate_rmse_m


@pytest.mark.slow
def test_without_coasting_masks_the_same_misses_let_people_into_odometry(walks: dict[str, MethodReport]) -> None:
    assert walks["not coasting"].masks.leak > 5 * walks["missing"].masks.leak
    assert walks["not coasting"].rpe_trans_rmse_m > 2 * walks["missing"].rpe_trans_rmse_m


@pytest.mark.slow
def test_perfect_masks_hide_what_moves_and_little_else(walks: dict[str, MethodReport]) -> None:
    assert walks["whole"].masks.leak <= 0.005
    assert walks["whole"].masks.waste <= 0.03


@pytest.mark.slow
def test_the_position_follows_the_ideal_observation(walks: dict[str, MethodReport]) -> None:
    assert walks["whole"].ekf.position_rmse_ideal_m <= 0.03


def test_whoever_sets_off_is_flagged_within_three_frames_and_whoever_sits_still_is_not(tmp_path: Path) -> None:
    out = tmp_path / "out"
    moc = run(scenario("stop_and_go"), RunSettings.parse(methods="dotmask"), out, lambda: None).methods["dotmask"].moc
    assert moc.starts >= 2
    assert moc.missed_starts == 0
    assert moc.start_latency_max_frames <= 3
    assert moc.idle_flag_rate <= 0.01
