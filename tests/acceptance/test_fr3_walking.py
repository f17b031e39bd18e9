"""The claim at full size: masking moving objects keeps odometry on its way, and every stage does its part."""

import csv
from pathlib import Path

import numpy as np
import pytest

from scenarios.registry import scenario
from scenarios.report import Report
from scenarios.run import RunSettings, run
from scenarios.spec import CameraSpec, PeopleSpec, PersonSpec, Scenario, WalkLoopAct

pytestmark = pytest.mark.acceptance


@pytest.fixture(scope="module")
def walking_xyz(tmp_path_factory: pytest.TempPathFactory) -> Report:
    out = tmp_path_factory.mktemp("runs") / "xyz"
    return run(scenario("fr3_walking_xyz"), RunSettings.parse(methods="unmasked,dotmask"), out, lambda: None)


def test_masking_saves_odometry(walking_xyz: Report) -> None:
    methods = walking_xyz.methods
    assert methods["dotmask"].ate_rmse_m < 0.02
    assert methods["unmasked"].ate_rmse_m > 5 * methods["dotmask"].ate_rmse_m
    assert methods["dotmask"].tracked_frames == 864


def test_loops_are_found_where_people_are_masked(walking_xyz: Report) -> None:
    dotmask, unmasked = walking_xyz.methods["dotmask"], walking_xyz.methods["unmasked"]
    assert dotmask.loops.count >= 10
    assert dotmask.loops.count >= 3 * unmasked.loops.count
    assert dotmask.loops.trans_error_m < 0.005
    assert dotmask.loops.false_count == unmasked.loops.false_count == 0
    assert dotmask.ate_optimised_rmse_m < 0.012


def test_the_classification_finds_what_moves(walking_xyz: Report) -> None:
    moc = walking_xyz.methods["dotmask"].moc
    assert moc.recall >= 0.95
    assert moc.precision >= 0.95


def test_almost_nothing_that_moves_reaches_odometry(walking_xyz: Report) -> None:
    masks = walking_xyz.methods["dotmask"].masks
    assert masks.leak <= 0.005
    assert masks.waste <= 0.03


def test_the_speed_of_a_walking_person_is_known_after_a_second(tmp_path: Path) -> None:
    walker = PersonSpec(
        name="walker",
        character="man",
        outfit="plaid",
        position_m=(-2.9, 0.75),
        acts=(WalkLoopAct(waypoints_m=((2.6, 0.75), (2.6, -0.2), (-2.9, -0.2)), speed_m_s=1.2, start_m=1.3),),
    )
    stage = Scenario(
        name="one_walker",
        description="One person walks past a camera that moves.",
        frames=75,
        camera=CameraSpec(path="xyz", amplitude=0.5, position_m=(0.0, -2.5, 1.7), tilt_deg=12),
        people=PeopleSpec(cast=(walker,)),
    )
    run(stage, RunSettings.parse(methods="dotmask"), tmp_path / "walker", lambda: None)
    with (tmp_path / "walker" / "tracks.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["instance_id"] and float(row["timestamp_s"]) >= 1.0]
    assert len(rows) > 30
    speeds = np.array([[float(row[f"v{axis}_m_s"]) for axis in "xyz"] for row in rows])
    truth = np.array([[float(row[f"true_v{axis}_m_s"]) for axis in "xyz"] for row in rows])
    # The centre of a walking body speeds up and slows down by 0.15 m/s with every step, about the speed of the walk.
    assert np.linalg.norm(truth, axis=1).mean() == pytest.approx(1.2, abs=0.05)
    assert np.sqrt(np.mean((np.linalg.norm(speeds, axis=1) - 1.2) ** 2)) < 0.15
