"""The environments as Gymnasium sees them, and against the standard loop."""

import importlib.util
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env, data_equivalence

import scenarios.envs
from dotmask.pipeline import ClosedLoop, DotMask
from dotmask.profiles import profile
from dotmask.slam.embedded import EmbeddedSlam
from scenarios.bridge import intrinsics_from_camera, rgbd_frame_from_sim
from scenarios.errors import ScenarioError
from scenarios.oracle import OracleSegmenter
from scenarios.registry import chosen_scenario
from scenarios.spec import scenario_from_json
from scenarios.world import build_simulator

DRIVE, MASKING = "DotMask/CameraDrive-v0", "DotMask/Masking-v0"
IDS = tuple(scenarios.envs.ENTRY_POINTS)
TINY = {
    "room": "bare",
    "frames": 8,
    "camera.width": 128,
    "camera.height": 96,
    "camera.fx": 107.1,
    "camera.fy": 107.8,
    "camera.cx": 63.7,
    "camera.cy": 49.1,
    "people.cast": [],
    "things": [],
}
"""An empty room that is built in no time."""
LIVELY = {key: value for key, value in TINY.items() if key not in ("room", "people.cast", "things")}
"""The office of `smoke` with its people."""
FRESH = {"context": "spawn"}
"""Processes forked from one in which environments were stepped hang: its threads are not theirs."""


def made(env_id: str, **options: Any) -> Any:
    return gymnasium.make(env_id, **{"overrides": TINY, **options})


def actions(env: Any, count: int) -> list[Any]:
    env.action_space.seed(3)
    return [env.action_space.sample() for _ in range(count)]


def episode(env: Any, seed: int, chosen: list[Any]) -> Iterator[Any]:
    yield env.reset(seed=seed)
    for action in chosen:
        yield env.step(action)


@pytest.fixture
def no_display(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")


@pytest.mark.usefixtures("no_display")
@pytest.mark.filterwarnings("ignore:pkg_resources is deprecated")
@pytest.mark.parametrize("env_id", IDS)
def test_gymnasium_has_nothing_to_say(env_id: str) -> None:
    env = made(env_id)
    check_env(env.unwrapped)
    env.close()


def test_a_dictionary_of_two_masks_passes_the_check_too() -> None:
    check_env(made(MASKING, map_mask=True).unwrapped, skip_render_check=True)


@pytest.mark.parametrize("env_id", IDS)
def test_the_same_seed_and_actions_give_the_same_bytes(env_id: str) -> None:
    env, other = made(env_id, overrides=LIVELY), made(env_id, overrides=LIVELY, threads=2)
    chosen = actions(env, 5)
    first = list(episode(env, 4, chosen))
    # In another environment, and in the same one again after an episode that went another way.
    assert data_equivalence(list(episode(other, 4, chosen)), first, exact=True)
    list(episode(env, 4, chosen[::-1]))
    assert data_equivalence(list(episode(env, 4, chosen)), first, exact=True)
    different = env.reset(seed=5)
    assert not np.array_equal(different[0]["rgb"], first[0][0]["rgb"])
    assert env.unwrapped.scenario.seed == 5


@pytest.mark.slow
@pytest.mark.parametrize("env_id", IDS)
def test_200_steps_are_the_same_bytes(env_id: str) -> None:
    overrides = {**LIVELY, "frames": 201}
    env, other = (made(env_id, overrides=overrides, lost_frames=1000) for _ in range(2))
    chosen = actions(env, 200)
    for one, two in zip(episode(env, 1, chosen), episode(other, 1, chosen), strict=True):
        assert data_equivalence(one, two, exact=True)


def test_an_episode_ends_with_the_scenario() -> None:
    for env_id, steps in ((DRIVE, TINY["frames"] - 1), (MASKING, TINY["frames"])):
        env = made(env_id, lost_frames=1000)
        results = list(episode(env, 0, actions(env, steps)))[1:]
        assert [result[3] for result in results] == [False] * (steps - 1) + [True]
        assert not any(result[2] for result in results)


def test_an_episode_ends_when_slam_is_lost_for_long() -> None:
    env = made(MASKING, lost_frames=3)
    everything = np.ones(env.action_space.shape, np.int8)
    results = list(episode(env, 0, [0 * everything, *[everything] * 3]))[1:]
    assert [result[2] for result in results] == [False, False, False, True]
    assert [result[4]["is_tracked"] for result in results] == [True, False, False, False]
    assert [result[4]["waste"] for result in results] == [0, 1, 1, 1]


@pytest.mark.parametrize("env_id", IDS)
def test_the_reward_is_the_sum_of_its_terms(env_id: str) -> None:
    env = made(env_id, overrides=LIVELY)
    for _, reward, _, _, info in list(episode(env, 0, actions(env, 3)))[1:]:
        assert reward == pytest.approx(sum(info["reward"].values()))
    terms = {DRIVE: {"relative_pose_error", "leak", "progress"}, MASKING: {"odometry_error", "waste"}}
    assert set(info["reward"]) == terms[env_id]


def test_leak_and_waste_are_paid() -> None:
    leaky = made(DRIVE, overrides=LIVELY, method="unmasked")
    results = list(episode(leaky, 0, [np.zeros(6, np.float32)] * 2))[1:]
    assert [r[4]["reward"]["leak"] for r in results] == [-leaky.unwrapped.weights.leak] * 2
    masking = made(MASKING)
    nothing, everything = np.zeros(masking.action_space.shape, np.int8), np.ones(masking.action_space.shape, np.int8)
    results = list(episode(masking, 0, [nothing, everything]))[1:]
    assert [r[4]["reward"]["waste"] for r in results] == [0, -masking.unwrapped.weights.waste]


def test_what_was_driven_is_a_scenario_with_the_same_frames() -> None:
    env = made(DRIVE, overrides=LIVELY)
    observations = [result[0] for result in episode(env, 2, actions(env, 5))]
    saved = scenario_from_json(env.unwrapped.driven_scenario().to_json(), "here")
    simulator = build_simulator(saved, "numba", 1)
    assert len(simulator) == len(observations) == 6
    for frame, observation in zip(simulator, observations, strict=True):
        assert np.array_equal(frame.rgb, observation["rgb"])
        assert np.array_equal(frame.depth_m, observation["depth"])


def test_the_camera_moves_on_in_frames_that_the_sensor_lost() -> None:
    missing = {**TINY, "sensor.failures": [{"kind": "missing", "first": 1, "frames": 3}]}
    ahead = np.array([0, 0, 1, 0, 0, 0], np.float32)
    env, whole = made(DRIVE, overrides=missing), made(DRIVE)
    gap = list(episode(env, 0, [ahead]))[-1]
    steps = list(episode(whole, 0, [ahead] * 4))[-1]
    assert gap[0]["stamp"] == steps[0]["stamp"]
    assert np.array_equal(gap[4]["true_pose"], steps[4]["true_pose"])


def example(name: str) -> ModuleType:
    path = Path(__file__).parents[2] / "examples" / name
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_dotmask_as_an_agent_is_dotmask_in_the_loop() -> None:
    env = made(MASKING, overrides={"frames": 8}, map_mask=True)
    _, info = env.reset(seed=0)
    policy, poses = example("05_masking_agents.py").Method(env.unwrapped), []
    for _ in range(6):
        _, _, _, _, info = env.step(policy(info))
        assert info["is_tracked"]
        poses.append(info["estimated_pose"])
    simulator = build_simulator(env.unwrapped.scenario, "numba", 1)
    oracle, start = OracleSegmenter(), simulator.frame(0).truth.T_world_camera
    slam = EmbeddedSlam(intrinsics_from_camera(simulator.camera), start)
    loop = ClosedLoop(DotMask(oracle, profile("calibrated")), slam, "refined", start)
    for index, pose in enumerate(poses):
        frame = simulator.frame(index)
        oracle.show(index, frame.truth)
        assert np.array_equal(loop.step(rgbd_frame_from_sim(frame)).pose.T_world_camera, pose)


def test_four_environments_in_processes() -> None:
    vector = gymnasium.make_vec(DRIVE, num_envs=4, vectorization_mode="async", vector_kwargs=FRESH, overrides=TINY)
    try:
        observation, _ = vector.reset(seed=[1, 1, 2, 3])
        assert observation["rgb"].shape == (4, 96, 128, 3)
        for _ in range(10):  # through the end of an episode, into the next
            action = np.tile(np.float32([0.2, 0, 0.1, 0, 0.3, 0]), (4, 1))
            observation, reward, _, _, info = vector.step(action)
            assert np.array_equal(observation["depth"][0], observation["depth"][1])
        assert not np.array_equal(observation["rgb"][0], observation["rgb"][2])
        assert reward.shape == (4,)
        assert info["reward"]["progress"].shape == (4,)
    finally:
        vector.close()


@pytest.mark.slow
def test_four_environments_in_processes_over_100_steps() -> None:
    vector = gymnasium.make_vec(
        DRIVE, num_envs=4, vectorization_mode="async", vector_kwargs=FRESH, overrides={**LIVELY, "frames": 60}
    )
    try:
        vector.reset(seed=7)
        vector.action_space.seed(7)
        ends = 0
        for _ in range(100):
            _, reward, terminated, truncated, _ = vector.step(vector.action_space.sample())
            assert np.isfinite(reward).all()
            ends += int((terminated | truncated).sum())
        assert ends >= 4
    finally:
        vector.close()


def test_a_reset_without_a_seed_repeats_the_world_unless_asked_to_vary() -> None:
    same, varied = made(MASKING), made(MASKING, vary_seed=True)
    first, _ = same.reset(seed=3)
    assert np.array_equal(same.reset()[0]["rgb"], first["rgb"])
    varied.reset(seed=3)
    again = made(MASKING, vary_seed=True)
    again.reset(seed=3)
    assert not np.array_equal(varied.reset()[0]["rgb"], first["rgb"])
    assert np.array_equal(again.reset()[0]["rgb"], varied.unwrapped.images(varied.unwrapped.frame())["rgb"])


def test_a_picture_shows_colour_depth_masks_and_trajectory() -> None:
    env = made(MASKING, render_mode="rgb_array")
    env.reset(seed=0)
    mask = np.zeros(env.action_space.shape, np.int8)
    mask[:40, :40] = 1
    env.step(mask)
    picture, frame = env.render(), env.unwrapped.simulator.frame(0)
    assert picture.shape == (96, 4 * 128, 3)
    assert picture.dtype == np.uint8
    assert np.array_equal(picture[:70, :128], frame.rgb[:70])  # below is the title
    red = picture[:40, 256:296].astype(int)[frame.depth_m[:40, :40] > 0]
    assert (red[:, 0] > red[:, 1] + 50).all()
    grey = picture[:60, 310:384].astype(int)
    assert (grey[..., 0] == grey[..., 1]).all()


@pytest.mark.filterwarnings("ignore")
def test_gymnasium_records_a_video(tmp_path: Path) -> None:
    import cv2

    env = gymnasium.wrappers.RecordVideo(made(MASKING, render_mode="rgb_array"), str(tmp_path))
    list(episode(env, 0, [np.zeros(env.action_space.shape, np.int8)] * TINY["frames"]))
    env.close()
    (path,) = tmp_path.glob("*.mp4")
    video = cv2.VideoCapture(str(path))
    assert video.get(cv2.CAP_PROP_FRAME_COUNT) == TINY["frames"] + 1
    assert video.get(cv2.CAP_PROP_FPS) == 30
    assert (video.get(cv2.CAP_PROP_FRAME_WIDTH), video.get(cv2.CAP_PROP_FRAME_HEIGHT)) == (512, 96)


def test_a_missing_window_library_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    env = made(MASKING, render_mode="human")
    with pytest.raises(gymnasium.error.DependencyNotInstalled, match="pip install pygame"):
        env.reset(seed=0)


@pytest.mark.parametrize(
    ("env_id", "options", "message"),
    [
        (DRIVE, {"scenario": "smok"}, "Did you mean smoke"),
        (DRIVE, {"method": "dotmsk"}, "Did you mean dotmask"),
        (DRIVE, {"overrides": {"sensor.motion_errors": True}}, "no future"),
        (MASKING, {"overrides": {"frames": 1}}, "at least 2 frames"),
        (MASKING, {"overrides": {"camera.breadth": 3}}, "unknown key 'breadth'"),
        (MASKING, {"renderer": "numbo"}, "Did you mean numba"),
        (MASKING, {"lost_frames": 0}, "1 or more"),
    ],
)
def test_a_wrong_argument_is_named(env_id: str, options: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        gymnasium.make(env_id, **options).reset()


def test_a_mask_of_the_wrong_size_is_refused() -> None:
    env = made(MASKING).unwrapped
    env.reset(seed=0)
    with pytest.raises(ScenarioError, match=r"\(96, 128\); got \(3, 4\)"):
        env.step(np.zeros((3, 4)))


def test_overrides_are_values_and_a_scenario_may_be_given() -> None:
    base = chosen_scenario("smoke", {})
    varied = chosen_scenario(base, {"camera.speed": 2.5, "sensor.model": "ideal", "seed": 4})
    assert (varied.camera.speed, varied.sensor.model, varied.seed) == (2.5, "ideal", 4)


def test_the_import_registers_and_gymnasium_can_do_it_alone() -> None:
    code = (
        "import gymnasium, sys\n"
        f"print({DRIVE!r} in gymnasium.registry)\n"
        f"env = gymnasium.make('scenarios.envs:{MASKING}')\n"
        f"print(env.spec.id, {DRIVE!r} in gymnasium.registry)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["False", f"{MASKING} True"]
