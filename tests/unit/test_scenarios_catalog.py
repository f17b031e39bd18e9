"""The catalog: every scenario is possible, and those after the benchmark move like its sequences."""

from functools import cache

import numpy as np
import pytest

from scenarios.camera import camera_path
from scenarios.cast import build_cast
from scenarios.errors import ScenarioError
from scenarios.registry import RENDERED_AS, SCENARIOS, scenario
from scenarios.spec import CameraSpec, FollowCameraSpec, RobotCameraSpec, TourCameraSpec, with_overrides
from scenarios.tum_figures import BENCHMARK, camera_figures
from scenarios.world import ROOMS, build_scene
from sim.people.clearance import clearances, outline
from sim.scene import Frozen

ASKED_FOR = {
    *BENCHMARK, "smoke", "robot_follows_person", "robot_corridor", "plaid_idle", "crossing", "crowd", "tilted",
    "stop_and_go", "unknown_mover", "low_texture", "pushed_chair", "falling_bottle", "carried_cup", "detection_order",
    "ageless_track", "fixed_time_step", "wide_covariance", "new_mover", "approaching_person",
    "fault_missed", "fault_missed_bursts", "fault_false_positives", "fault_late_masks", "fault_eroded_masks",
    "fault_dilated_masks", "fault_split", "fault_merged", "fault_identity_shuffle", "fault_class_flips",
    "fault_score_shuffle", "fault_tilted", "fault_few_detections",
    "failing_sensor", "kidnapped", "blank_wall",
}  # fmt: skip
WITH_OWN_FRAMES = sorted(set(RENDERED_AS.values()))
"""How people and cameras move is the same in scenarios that share their frames."""

NEAREST_TO_CAMERA_M = 0.35
IN_WALKING_HEIGHT = (0.1, 1.7)


@cache
def people_of(name):
    return {person.name: person.motion for person in build_cast(SCENARIOS[name])}


def moments(name, step_s=0.2, longest_s=40.0):
    return np.arange(0.0, min(SCENARIOS[name].duration_s, longest_s), step_s)


def test_the_catalog_has_what_was_asked_for():
    assert set(SCENARIOS) == ASKED_FOR


@pytest.mark.parametrize("name", SCENARIOS)
def test_every_scenario_says_what_it_is(name):
    chosen = SCENARIOS[name]
    assert chosen.description.endswith(".")
    assert 20 < len(chosen.description) < 110
    assert chosen.tags
    assert chosen.variant == "moving"
    assert chosen.camera.model_dump()["width"] in (320, 640)


@pytest.mark.parametrize("name", BENCHMARK)
def test_the_camera_moves_as_in_the_benchmark(name):
    """Duration, length, speed and turning over the whole sequence, from poses at 30 Hz."""
    ours, theirs = camera_figures(scenario(name)), BENCHMARK[name]
    for field in ("duration_s", "length_m", "speed_m_s", "turn_deg_s"):
        assert getattr(ours, field) == pytest.approx(getattr(theirs, field), rel=0.15), field


def test_the_figures_of_the_benchmark_agree_with_each_other():
    """Length is duration times speed; the page rounds."""
    for name, figures in BENCHMARK.items():
        assert figures.length_m / figures.duration_s == pytest.approx(figures.speed_m_s, rel=0.06), name


def test_camera_figures_of_a_motion_that_is_known():
    """A robot at 0.4 m/s on a straight way: it turns nowhere; starting takes half of RAMP_S of way."""
    straight = RobotCameraSpec(waypoints_m=((0, 0), (0, 8)), speed_m_s=0.5, amplitude=0.0)
    figures = camera_figures(scenario("smoke").model_copy(update={"camera": straight, "frames": 301}))
    assert figures.duration_s == 10.0
    assert figures.length_m == pytest.approx(0.5 * (10 - 0.75), abs=1e-3)
    assert figures.turn_deg_s == pytest.approx(0.0, abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("name", [n for n in WITH_OWN_FRAMES if SCENARIOS[n].people.cast])
def test_nobody_walks_through_furniture_or_people(name):
    room = ROOMS[SCENARIOS[name].room](0)
    obstacles = {str(k): box for k, box in enumerate(room.obstacles)}
    nearest = clearances(people_of(name), obstacles, moments(name))[0]
    assert nearest.distance_m > 0.05, nearest


@pytest.mark.parametrize("name", WITH_OWN_FRAMES)
def test_the_camera_keeps_away_from_people_and_furniture(name):
    path, room = camera_path(SCENARIOS[name]), ROOMS[SCENARIOS[name].room](0)
    times = moments(name, longest_s=200.0)
    eyes = np.array([path.pose_at(float(t))[:3, 3] for t in times])
    for person, motion in people_of(name).items():
        for eye, time_s in zip(eyes, times, strict=True):
            gaps = outline(motion, float(time_s)) - eye[:2]
            assert np.sqrt(np.sum(gaps**2, axis=1)).min() > NEAREST_TO_CAMERA_M, (person, time_s)
    for box in room.obstacles:
        c, s = np.cos(box.yaw_rad), np.sin(box.yaw_rad)
        local = (eyes - np.array(box.centre_m)) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        gaps = np.maximum(np.abs(local) - np.array(box.size_m) / 2, 0.0)
        assert np.sqrt(np.sum(gaps**2, axis=1)).min() > 0.3, box


@pytest.mark.parametrize("name", [n for n in WITH_OWN_FRAMES if not isinstance(SCENARIOS[n].camera, CameraSpec)])
def test_a_tour_and_a_drive_do_not_turn_back_within_their_scenario(name):
    path = camera_path(SCENARIOS[name])
    if not isinstance(SCENARIOS[name].camera, FollowCameraSpec):
        assert path.duration_s >= SCENARIOS[name].duration_s


def test_the_robot_moves_as_fast_as_the_person_before_it():
    chosen = scenario("robot_follows_person")
    path, person = camera_path(chosen), people_of("robot_follows_person")["berta"]
    times = np.arange(0.0, chosen.duration_s, 0.1)
    places = np.array([path.pose_at(t)[:2, 3] for t in times]), np.array([person.pose_at(t)[:2, 3] for t in times])
    ways = [np.sqrt(np.sum(np.diff(p, axis=0) ** 2, axis=1)).sum() for p in places]
    assert ways[0] == pytest.approx(ways[1], rel=0.03)
    assert ways[0] / chosen.duration_s > 0.9


@pytest.mark.parametrize("name", ["smoke", "robot_follows_person", "pushed_chair", "carried_cup"])
@pytest.mark.parametrize("variant", ["empty", "frozen"])
def test_the_counterfactuals_keep_the_camera_and_hold_still(name, variant):
    changed = with_overrides(scenario(name), {"variant": variant})
    for time_s in (0.0, 1.7):
        one, other = camera_path(scenario(name)), camera_path(changed)
        assert np.array_equal(one.pose_at(time_s), other.pose_at(time_s))
    actors = build_scene(changed).actors
    assert sum(a.class_name == "person" for a in actors) == (
        0 if variant == "empty" else len(scenario(name).people.cast)
    )
    for actor in actors:
        assert isinstance(actor.motion, Frozen) or np.array_equal(
            actor.motion.palette_at(0.0), actor.motion.palette_at(1.5)
        )


@pytest.mark.parametrize("name", ["fr3_walking_xyz", "fr3_sitting_rpy"])
def test_a_hand_held_camera_takes_the_usual_changes(name, tmp_path):
    file = tmp_path / "t.txt"
    file.write_text("0 0 0 0 0 0.7 0 0.7\n50 1 0 0 0 0.7 0 0.7\n")
    varied = with_overrides(scenario(name), {"camera.speed": "2.0", "camera.path": "static"})
    assert (varied.camera.speed, varied.camera.path) == (2.0, "static")
    replayed = camera_path(with_overrides(scenario(name), {"camera.trajectory": str(file)}))
    assert replayed.duration_s == 50.0


def test_other_cameras_take_a_speed_too():
    for name in ("fr2_desk", "robot_corridor"):
        chosen = scenario(name)
        faster = camera_path(with_overrides(chosen, {"camera.speed": "2"}))
        assert faster.pose_at(3.0) == pytest.approx(camera_path(chosen).pose_at(6.0))


def test_an_unknown_kind_of_path_and_person_are_named():
    with pytest.raises(ScenarioError, match=r"camera.path: .*'halfsphere', 'tour', 'robot', 'follow' \(got 'zigzag'\)"):
        with_overrides(scenario("fr2_desk"), {"camera.path": "zigzag"})
    with pytest.raises(ScenarioError, match=r"camera\.stops: Field required"):
        with_overrides(scenario("smoke"), {"camera.path": "tour"})
    lost = with_overrides(scenario("robot_follows_person"), {"camera.person": "bertha"})
    with pytest.raises(ScenarioError, match=r"unknown person for the camera to follow 'bertha'\. Did you mean berta"):
        camera_path(lost)


def test_a_tour_of_one_stop_is_refused():
    with pytest.raises(ValueError, match="at least 2"):
        TourCameraSpec(stops=SCENARIOS["fr2_desk"].camera.stops[:1])
