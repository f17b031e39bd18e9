import json

import pytest

from scenarios.camera import camera_model
from scenarios.errors import ScenarioError
from scenarios.registry import SCENARIOS, scenario
from scenarios.spec import PersonSpec, Scenario, StandAct, WalkLoopAct, first_frames, scenario_from_json, with_overrides


def test_an_override_reaches_a_nested_value_and_leaves_the_original() -> None:
    smoke = scenario("smoke")
    varied = with_overrides(smoke, {"camera.speed": "2", "people.cast.1.acts.0.speed_m_s": "1.5", "frames": "7"})
    assert (varied.camera.speed, varied.people.cast[1].acts[0].speed_m_s, varied.frames) == (2.0, 1.5, 7)
    assert smoke.camera.speed == 1.0
    assert (
        with_overrides(varied, {"camera.speed": "1", "people.cast.1.acts.0.speed_m_s": "1.0", "frames": "60"}) == smoke
    )


def test_first_frames() -> None:
    smoke = scenario("smoke")
    assert first_frames(smoke, 7) == with_overrides(smoke, {"frames": "7"})
    assert first_frames(smoke, None) == first_frames(smoke, smoke.frames) == first_frames(smoke, 1000) == smoke
    with pytest.raises(ScenarioError, match=r"frames: .*greater than or equal to 1"):
        first_frames(smoke, 0)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("camera.sped", "2", r"unknown key 'sped'; valid keys under 'camera': width, height, .*speed"),
        ("camera.speed.x", "2", r"'camera.speed' has no keys of its own"),
        ("people.cast.9.speed_m_s", "2", r"unknown key '9'; valid keys under 'people.cast': 0, 1"),
        ("camera.speed", "fast", r"camera.speed: .*valid number.*'fast'"),
        ("camera.speed", "0", r"camera.speed: .*greater than 0"),
        ("camera.speed", "NaN", r"camera.speed: .*finite"),
        ("frames", "0", r"frames: .*greater than or equal to 1"),
        ("frames", "2.5", r"frames: .*valid integer"),
        ("camera.exposure_ev", "5", r"camera.exposure_ev: .*less than or equal to 4"),
        ("camera.path", "zigzag", r"camera.path: .*'static', 'xyz', 'rpy', 'halfsphere'"),
    ],
)
def test_a_bad_override_names_the_field_and_what_is_valid(key: str, value: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        with_overrides(scenario("smoke"), {key: value})


@pytest.mark.parametrize("name", ["smoke", "fr2_desk", "robot_corridor", "robot_follows_person"])
def test_every_camera_has_an_exposure(name: str) -> None:
    assert camera_model(scenario(name).camera).exposure_ev == 0.0
    assert camera_model(with_overrides(scenario(name), {"camera.exposure_ev": "-1"}).camera).exposure_ev == -1.0


def test_an_unknown_scenario_names_near_matches() -> None:
    with pytest.raises(ScenarioError, match=r"unknown scenario 'fr3_walk_xyz'. Did you mean fr3_walking_xyz"):
        scenario("fr3_walk_xyz")


def test_a_person_needs_an_act_and_a_loop_is_the_last_one() -> None:
    base = {"name": "a", "character": "man", "outfit": "plaid"}
    with pytest.raises(ValueError, match="at least 1 item"):
        PersonSpec.model_validate({**base, "acts": ()})
    loop, stand = WalkLoopAct(waypoints_m=((1.0, 0.0),)), StandAct(duration_s=1.0)
    with pytest.raises(ValueError, match="only act of a person"):
        PersonSpec.model_validate({**base, "acts": (loop, stand)})


def edited(**changes: object) -> str:
    """The JSON of `smoke` with one person and one thing changed."""
    tree = json.loads(scenario("smoke").to_json())
    for key, value in changes.items():
        tree["things"][1][key] = value
    return json.dumps(tree)


def test_two_actors_with_one_name_are_refused() -> None:
    with pytest.raises(ScenarioError, match="two actors have the same name"):
        scenario_from_json(edited(name="chair_left"), "x.json")
    with pytest.raises(ScenarioError, match="two actors have the same name"):
        scenario_from_json(edited(name="anton"), "x.json")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"seated_on": "sofa"}, "anton uses 'sofa', but no chair has that name"),
        ({"acts": ({"kind": "push", "chair": "berta", "distance_m": 1.0},)}, "anton uses 'berta', but no chair"),
        ({"carries": "chair_left"}, "anton carries 'chair_left', but no cup or box has that name"),
    ],
)
def test_what_a_person_uses_must_be_there_and_of_the_right_kind(changes: dict[str, object], message: str) -> None:
    tree = json.loads(scenario("smoke").to_json())
    tree["people"]["cast"][0].update(changes)
    with pytest.raises(ScenarioError, match=message):
        scenario_from_json(json.dumps(tree), "x.json")


@pytest.mark.parametrize("text", ["", "[]", "{", '{"name": 3}'])
def test_a_file_that_is_no_scenario_is_named(text: str) -> None:
    with pytest.raises(ScenarioError, match=r"x.json: not a scenario"):
        scenario_from_json(text, "x.json")


@pytest.mark.parametrize("name", SCENARIOS)
def test_json_there_and_back(name: str) -> None:
    assert scenario_from_json(SCENARIOS[name].to_json(), "x") == SCENARIOS[name]


def test_a_scenario_is_frozen() -> None:
    with pytest.raises(ValueError, match="frozen"):
        scenario("smoke").frames = 3


def test_duration_is_from_the_first_to_the_last_frame() -> None:
    assert Scenario(name="x", description="", frames=31, frame_rate_hz=30).duration_s == 1.0
