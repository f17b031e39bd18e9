"""The training of `compact`: the split, the scenes, what is to be found in a frame, the loop, and its card."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import load_file

from dotmask import assets
from dotmask.errors import SegmenterError
from dotmask.records import Intrinsics, RgbdFrame
from dotmask.segmentation.networks import WEIGHTS_OF_COMPACT, choose_network, load_network
from dotmask.segmentation.yolact.design import COMPACT
from dotmask.segmentation.yolact.images import network_image
from scenarios.oracle import MIN_PIXELS, true_detections
from scenarios.registry import scenario
from scenarios.spec import scenario_from_json
from scenarios.world import build_simulator
from sim.assets import asset_root, manifest
from sim.people.characters import CHARACTERS
from sim.things.chairs import CHAIR_LOOKS
from tools.segmenter_training import held_out, split
from tools.segmenter_training.augmentation import LEAST_PX, Change, changed, draw_change, target_of
from tools.segmenter_training.errors import TrainingError
from tools.segmenter_training.frames import FrameStore, LabelledFrame, halved, labelled, render_frames
from tools.segmenter_training.places import Places
from tools.segmenter_training.scenes import build_scene, draw_moment, draw_scenario
from tools.segmenter_training.state import FILE, Settings
from tools.segmenter_training.team import Team, team
from tools.segmenter_training.training import LOSSES, WEIGHTS, frames_of_step, learning_rate, network_images, train
from tools.train_vocabulary.rooms import random_room

DESIGN = replace(
    COMPACT, height=64, width=96, channels=32, prototypes=8, scales_px=((12.0,), (24.0,), (40.0,), (64.0,), (90.0,))
)
"""A network that learns in seconds."""
SETTINGS = Settings(
    seed=3,
    scenes=1,
    frames_a_scene=4,
    cycles=1,
    steps=12,
    batch=2,
    peak_rate=2e-3,
    processes=1,
    device="cpu",
    precision="float32",
)


def no_advance(steps: int, told: str) -> None:
    pass


def toy_frame(rng: np.random.Generator, height: int = 64, width: int = 96) -> LabelledFrame:
    """A disc and a bar that overlap at times, before something dark."""
    rgb, labels = rng.integers(0, 80, (height, width, 3), dtype=np.uint8), np.zeros((height, width), np.uint8)
    v, u = np.mgrid[:height, :width]
    x, y = rng.integers(20, (width - 20, height - 20))
    disc = (u - x) ** 2 + (v - y) ** 2 < 14**2
    bar = (abs(u - rng.integers(10, width - 10)) < 7) & (abs(v - height // 2) < 22)
    for label, mask, colour in ((1, disc, (220, 60, 60)), (2, bar, (60, 60, 230))):
        rgb[mask], labels[mask] = colour, label
    depth_mm = np.where(labels > 0, 1500 + 200 * labels.astype(int), 4000).astype(np.uint16)
    return LabelledFrame(rgb=rgb, depth_mm=depth_mm, labels=labels, classes=(1, 0))


@pytest.fixture(scope="module")
def toys() -> list[LabelledFrame]:
    rng = np.random.default_rng(0)
    return [toy_frame(rng) for _ in range(4)]


def test_the_split_is_disjoint_and_covers_everything() -> None:
    assert set(split.TRAINING_CHARACTERS) | set(split.HELD_OUT_CHARACTERS) == set(CHARACTERS)
    assert not set(split.TRAINING_CHARACTERS) & set(split.HELD_OUT_CHARACTERS)
    assert set(split.TRAINING_CHAIRS) | set(split.HELD_OUT_CHAIRS) == set(CHAIR_LOOKS)
    assert not set(split.TRAINING_CHAIRS) & set(split.HELD_OUT_CHAIRS)
    for path in ("static", "xyz", "rpy", "halfsphere"):
        assert split.seen_in_training(scenario(f"fr3_walking_{path}")) == (), "the acceptance is on unseen people"
    assert split.seen_in_training(scenario("low_texture")) == ("tall_man in oxford",)


def test_scenes_show_what_the_training_may_see_and_the_test_what_it_may_not() -> None:
    for number in range(40):
        drawn, groups = draw_scenario(5, number)
        assert {person.character for person in drawn.people.cast} <= set(split.TRAINING_CHARACTERS)
        chairs = {thing.look for thing in drawn.things if thing.kind == "chair"}
        assert chairs <= set(split.TRAINING_CHAIRS)
        assert drawn.seed < split.FIRST_HELD_OUT_SEED
        named = [name for group in groups for name in group.names]
        assert sorted(named) == sorted(actor.name for actor in (*drawn.people.cast, *drawn.things))
    assert draw_scenario(5, 7) == draw_scenario(5, 7) != draw_scenario(5, 8)
    tests = [held_out.held_out_scenario(number) for number in (13, 48)]
    assert [one.room for one in tests] == ["desk", "bare"]
    for one in tests:
        assert split.seen_in_training(one) == ()
        assert one.seed >= split.FIRST_HELD_OUT_SEED
        assert scenario_from_json(one.to_json(), "here") == one
    assert held_out.held_out_scenario(48) == tests[-1]


def test_places_are_free() -> None:
    """Against the obstacles sampled point by point."""
    room, rng = random_room(3, 5), np.random.default_rng(1)
    places = Places(room)
    grid = np.concatenate([_points_of(obstacle) for obstacle in room.obstacles])
    for _ in range(20):
        disc = places.on_floor(rng, 0.3, [])
        assert disc is not None
        assert np.hypot(*(grid[:, :2] - disc[:2]).T).min() > 0.3 - 0.06
        T_world_camera = places.camera(rng, np.array([*disc[:2], 1.0]), (0.5, 3.0), [disc])
        assert T_world_camera is not None
        assert np.linalg.norm(grid - T_world_camera[:3, 3], axis=1).min() > 0.1
        spot = places.on_desk(rng)
        assert spot is not None
        assert 0.6 < spot[2] < 0.9


def _points_of(obstacle) -> np.ndarray:
    """(n, 3) points of a box, 5 cm apart, by its own axes."""
    axes = [np.linspace(-size / 2, size / 2, max(2, int(size / 0.05))) for size in obstacle.size_m]
    x, y, z = (axis.ravel() for axis in np.meshgrid(*axes))
    c, s = np.cos(obstacle.yaw_rad), np.sin(obstacle.yaw_rad)
    return np.stack([c * x - s * y, s * x + c * y, z], axis=1) + obstacle.centre_m


def test_a_scene_gives_the_same_frames_twice_and_each_is_worth_looking_at() -> None:
    first, again = render_frames(5, 1, 5), render_frames(5, 1, 3)
    for one, other in zip(first, again, strict=False):
        np.testing.assert_array_equal(one.rgb, other.rgb)
        np.testing.assert_array_equal(one.depth_mm, other.depth_mm)
        np.testing.assert_array_equal(one.labels, other.labels)
        assert one.classes == other.classes
    for frame in first:
        assert frame.rgb.shape == (COMPACT.height, COMPACT.width, 3)
        assert frame.labels.shape == frame.depth_mm.shape == (COMPACT.height, COMPACT.width)
        assert 0.3 < np.mean(frame.depth_mm > 0) < 1.0, "the depth is that of a sensor, not that of the renderer"
        assert set(np.unique(frame.labels)) <= set(range(len(frame.classes) + 1))
    assert len({len(frame.classes) for frame in first}) > 1 or len({frame.rgb.tobytes() for frame in first}) == 5


def test_those_who_are_not_in_a_frame_are_far_below_it() -> None:
    drawn = build_scene(5, 1)
    rng = np.random.default_rng(0)
    for _ in range(5):
        moment, _ = draw_moment(drawn, rng)
        heights = {name: palette[0, 2, 3] for name, palette in moment.palettes.items()}
        assert all(-1.0 < z < 2.5 or z < -990 for z in heights.values()), heights
        assert any(z < -990 for z in heights.values())
        eye = moment.T_world_camera[:3, 3]
        assert 0.2 <= eye[2] <= 1.8


def test_what_is_to_be_found_is_the_truth_of_the_simulator() -> None:
    """Against the oracle's detections, made by another program."""
    chosen = scenario("smoke").model_copy(update={"frames": 2})
    simulator = build_simulator(chosen, "numba", 1)
    truth = simulator.frame(1).truth
    images, _ = simulator.render(1)
    classes = {a.instance_id: COMPACT.class_names.index(a.class_name) for a in simulator.scene.actors}
    target = target_of(labelled(images, classes))
    wanted = true_detections(truth)
    assert len(wanted.class_names) >= 3
    assert [COMPACT.class_names[index] for index in target.classes] == list(wanted.class_names)
    height, width = images.rgb.shape[:2]
    edges = np.add(wanted.boxes_px, (0, 0, 1, 1))
    np.testing.assert_allclose(target.boxes.numpy() * (width, height, width, height), edges, atol=1e-3)
    blocks = wanted.masks.reshape(-1, height // 2, 2, width // 2, 2).mean(axis=(2, 4))
    np.testing.assert_allclose(target.masks.numpy(), blocks, atol=1e-6)
    assert LEAST_PX == MIN_PIXELS / 4, "what the judge counts at 640x480 is taught at a quarter of the pixels"


def test_a_change_moves_image_masks_and_boxes_alike(toys: list[LabelledFrame]) -> None:
    """Against a walk over all pixels."""
    frame, rng = toys[0], np.random.default_rng(0)
    change = Change(zoom=1.3, turn_rad=0.2, shift_px=(4.0, -3.0), is_mirrored=True)
    got = changed(frame, change, rng)
    height, width = frame.labels.shape
    labels = np.zeros_like(frame.labels)
    for v in range(height):
        for u in range(width):
            # Back to the frame: undo shift, turn and zoom about the middle, then mirror.
            x, y = u - 4.0 - (width - 1) / 2, v + 3.0 - (height - 1) / 2
            c, s = np.cos(0.2), np.sin(0.2)
            x, y = (c * x - s * y) / 1.3, (s * x + c * y) / 1.3
            column, row = round(-x + (width - 1) / 2), round(y + (height - 1) / 2)
            if 0 <= row < height and 0 <= column < width:
                labels[v, u] = frame.labels[row, column]
    assert np.mean(labels != got.labels) < 0.02, "pixels on the rim may go either way"
    is_red = (got.rgb[..., 0] > 150) & (got.rgb[..., 2] < 110)
    assert np.mean(is_red != (got.labels == 1)) < 0.03, "the picture went elsewhere than its mask"
    wanted_mm = np.where(got.labels > 0, 1500 + 200 * got.labels.astype(int), 4000) / 1.3
    is_near = abs(got.depth_mm - wanted_mm) < 1.0
    has_image = got.depth_mm > 0
    assert np.mean(is_near[has_image]) > 0.98, "the depth went elsewhere than its mask, or did not come nearer"
    np.testing.assert_array_equal(has_image[4:-4, 4:-4], True)
    target = target_of(got)
    for box, class_index in zip(target.boxes.numpy(), target.classes.tolist(), strict=True):
        v, u = np.nonzero(got.labels == got.classes.index(class_index) + 1)
        wanted = u.min() / width, v.min() / height, (u.max() + 1) / width, (v.max() + 1) / height
        np.testing.assert_allclose(box, wanted, atol=1e-6)


def test_a_change_of_nothing_is_none_and_colours_move_no_label(toys: list[LabelledFrame]) -> None:
    frame = toys[1]
    same = changed(frame, Change(), np.random.default_rng(0))
    np.testing.assert_array_equal(same.rgb, frame.rgb)
    np.testing.assert_array_equal(same.labels, frame.labels)
    drawn = [draw_change(np.random.default_rng(n), 64, 96) for n in range(60)]
    still = replace(next(c for c in drawn if c.blur_px), zoom=1.0, turn_rad=0.0, shift_px=(0.0, 0.0), is_mirrored=False)
    other = changed(frame, still, np.random.default_rng(0))
    np.testing.assert_array_equal(other.labels, frame.labels)
    assert not np.array_equal(other.rgb, frame.rgb)
    assert {c.is_mirrored for c in drawn} == {False, True}
    brighter = changed(frame, Change(biases=(30.0, 0.0, 0.0)), np.random.default_rng(0))
    np.testing.assert_array_equal(brighter.rgb[..., 0], np.minimum(frame.rgb[..., 0].astype(int) + 30, 255))
    np.testing.assert_array_equal(brighter.rgb[..., 1:], frame.rgb[..., 1:])
    grey = changed(frame, Change(saturation=0.0), np.random.default_rng(0)).rgb
    np.testing.assert_allclose(grey.astype(float), frame.rgb.mean(axis=2, keepdims=True) * np.ones(3), atol=1.0)
    late = changed(frame, Change(late_px=(3.0, -2.0)), np.random.default_rng(0))
    np.testing.assert_array_equal(late.rgb, frame.rgb)
    np.testing.assert_array_equal(late.depth_mm[:-2, 3:], frame.depth_mm[2:, :-3])
    blind = changed(frame, Change(zoom=1.2, has_depth=False), np.random.default_rng(0))
    assert not blind.depth_mm.any()
    assert 0.0 < np.mean([not c.has_depth for c in drawn]) < 0.2
    noisy = changed(replace(frame, rgb=np.full_like(frame.rgb, 128)), Change(noise=4.0), np.random.default_rng(0)).rgb
    assert noisy.std() == pytest.approx(4.0, rel=0.05)


def test_specks_are_not_to_be_found() -> None:
    labels = np.zeros((64, 96), np.uint8)
    labels[:19, 0], labels[10:15, 10:14] = 1, 2
    frame = LabelledFrame(
        rgb=np.zeros((64, 96, 3), np.uint8), depth_mm=np.zeros((64, 96), np.uint16), labels=labels, classes=(0, 3)
    )
    assert target_of(frame).classes.tolist() == [3], "19 pixels are a speck, 20 are not"


def test_a_frame_is_halved_as_the_segmenter_does_it() -> None:
    """Against what the network is given of the whole frame, and a count of labels pixel by pixel."""
    rng = np.random.default_rng(0)
    whole = LabelledFrame(
        rgb=rng.integers(0, 256, (128, 192, 3), dtype=np.uint8),
        depth_mm=(rng.integers(300, 6000, (128, 192)) * rng.integers(0, 2, (128, 192))).astype(np.uint16),
        labels=rng.integers(0, 4, (128, 192)).astype(np.uint8),
        classes=(0, 1, 2),
    )
    half = halved(whole)
    for v in range(64):
        for u in range(96):
            counts = np.bincount(whole.labels[2 * v : 2 * v + 2, 2 * u : 2 * u + 2].ravel())
            most = np.flatnonzero(counts == counts.max())
            assert half.labels[v, u] == most[-1] or len(most) == 4, "of four different labels any"
    given, made = (network_image(shown(frame), DESIGN, torch.device("cpu")) for frame in (whole, half))
    # Colours of a stored frame are whole grey levels.
    torch.testing.assert_close(given[:, :3], made[:, :3], atol=0.5 / 57 + 1e-5, rtol=0)
    torch.testing.assert_close(given[:, 3:], made[:, 3:], atol=1e-5, rtol=0)


def shown(frame: LabelledFrame) -> RgbdFrame:
    """What a segmenter is given of it."""
    height, width = frame.labels.shape
    return RgbdFrame(
        index=0,
        timestamp_s=0.0,
        rgb=frame.rgb,
        depth_m=frame.depth_mm.astype(np.float32) / 1000,
        intrinsics=Intrinsics(width=width, height=height, fx=90.0, fy=90.0, cx=width / 2, cy=height / 2),
    )


def test_images_are_normalised_as_the_segmenter_does(toys: list[LabelledFrame]) -> None:
    wanted = torch.cat([network_image(shown(frame), DESIGN, torch.device("cpu")) for frame in toys])
    got = network_images(toys)
    torch.testing.assert_close(got, wanted, atol=1e-5, rtol=0)
    assert got.is_contiguous(memory_format=torch.channels_last)


def test_every_epoch_sees_every_frame_once_in_an_order_of_its_own() -> None:
    settings = replace(SETTINGS, batch=4)
    epochs = [[n for step in range(k, k + 5) for n in frames_of_step(step, 20, settings)] for k in (0, 5)]
    assert [sorted(epoch) for epoch in epochs] == [list(range(20))] * 2
    assert epochs[0] != epochs[1]
    rates = [learning_rate(step, replace(settings, steps=100)) for step in range(100)]
    assert max(rates) == pytest.approx(SETTINGS.peak_rate)
    assert rates.index(max(rates)) in (4, 5)
    assert rates[-1] < 0.02 * SETTINGS.peak_rate
    later = [learning_rate(step, replace(settings, steps=100, cycles=2)) for step in range(200)]
    assert later[:100] == rates, "more cycles leave the first one as it was"
    middle = SETTINGS.peak_rate * (1 + 0.01) / 2
    assert [later[100], later[150]] == pytest.approx([SETTINGS.peak_rate, middle])
    assert sorted(later[100:], reverse=True) == later[100:]


def test_the_loss_falls_and_a_killed_training_ends_with_the_same_weights(
    toys: list[LabelledFrame], tmp_path: Path
) -> None:
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    settings = replace(SETTINGS, steps=60)
    for folder in (whole, parts):
        folder.mkdir()
    train(toys, settings, whole, save_every=20, advance=no_advance, design=DESIGN)
    rows = [line.split(",") for line in (whole / LOSSES).read_text().splitlines()]
    assert rows[0] == ["step", "classes", "boxes", "masks", "semantic", "sum"]
    assert [row[0] for row in rows[1:]] == ["20", "40", "60"]
    assert float(rows[3][-1]) < 0.8 * float(rows[1][-1])
    # Killed between two states: what was learnt since the last one is learnt again.
    train(toys, settings, parts, save_every=20, advance=no_advance, design=DESIGN, stop_after=27)
    assert not (parts / WEIGHTS).exists()
    train(toys, settings, parts, save_every=20, advance=no_advance, design=DESIGN)
    assert (parts / WEIGHTS).read_bytes() == (whole / WEIGHTS).read_bytes()
    assert (parts / LOSSES).read_text() == (whole / LOSSES).read_text()
    before = (parts / WEIGHTS).read_bytes()
    train(toys, settings, parts, save_every=20, advance=no_advance, design=DESIGN)
    assert (parts / WEIGHTS).read_bytes() == before, "a finished training has nothing left to do"
    assert all(tensor.isfinite().all() for tensor in load_file(parts / WEIGHTS).values())


def test_a_finished_training_goes_on_with_another_cycle(toys: list[LabelledFrame], tmp_path: Path) -> None:
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    twice = replace(SETTINGS, cycles=2)
    for folder in (whole, parts):
        folder.mkdir()
    train(toys, twice, whole, save_every=5, advance=no_advance, design=DESIGN)
    train(toys, SETTINGS, parts, save_every=5, advance=no_advance, design=DESIGN)
    assert (parts / WEIGHTS).read_bytes() != (whole / WEIGHTS).read_bytes()
    train(toys, twice, parts, save_every=5, advance=no_advance, design=DESIGN)
    assert (parts / WEIGHTS).read_bytes() == (whole / WEIGHTS).read_bytes()
    with pytest.raises(
        TrainingError, match=r"with 24 steps, more than the 12 asked for; use more --cycles, or another"
    ):
        train(toys, SETTINGS, parts, save_every=5, advance=no_advance, design=DESIGN)


def test_processes_share_a_training_and_go_on_where_they_were_killed(toys: list[LabelledFrame], tmp_path: Path) -> None:
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    settings = replace(SETTINGS, processes=2, batch=4)
    for folder in (whole, parts):
        folder.mkdir()
    train(toys, settings, whole, save_every=4, advance=no_advance, design=DESIGN)
    train(toys, settings, parts, save_every=4, advance=no_advance, design=DESIGN, stop_after=6)
    train(toys, settings, parts, save_every=4, advance=no_advance, design=DESIGN)
    assert (parts / WEIGHTS).read_bytes() == (whole / WEIGHTS).read_bytes()


def rank_everywhere(mine: Team) -> None:
    mine.average([torch.full((2, 3), float(mine.rank)), torch.tensor(10.0 * mine.rank)])


def fail(mine: Team) -> None:
    raise TrainingError("no")


def test_a_team_has_the_mean_and_ends_when_one_fails() -> None:
    tensors = [torch.zeros(2, 3), torch.tensor(0.0)]
    with team(3, 7, rank_everywhere) as mine:
        mine.average(tensors)
    assert tensors[0].tolist() == [[1.0] * 3] * 2
    assert tensors[1].item() == 10.0
    with pytest.raises(TrainingError, match="a process of the training has ended"), team(2, 7, fail) as mine:
        mine.wait()


def test_a_damaged_or_foreign_state_is_refused(toys: list[LabelledFrame], tmp_path: Path) -> None:
    settings = replace(SETTINGS, steps=2)
    train(toys, settings, tmp_path, save_every=2, advance=no_advance, design=DESIGN)
    with pytest.raises(
        TrainingError, match=r"of a training with seed 3, not 4; use the same options, or another --out"
    ):
        train(toys, replace(settings, seed=4), tmp_path, save_every=2, advance=no_advance, design=DESIGN)
    state = tmp_path / FILE
    state.write_bytes(state.read_bytes()[:-100])
    with pytest.raises(TrainingError, match=r"is cut short or damaged \(.*\); delete it to begin the training anew"):
        train(toys, settings, tmp_path, save_every=2, advance=no_advance, design=DESIGN)


def test_frames_come_back_from_disk_and_what_is_missing_is_said(toys: list[LabelledFrame], tmp_path: Path) -> None:
    store = FrameStore(tmp_path, seed=0, scenes=2, frames_a_scene=2)
    assert store.missing() == [0, 1]
    store.write(1, toys[:2])
    assert (len(store), store.missing()) == (4, [0])
    np.testing.assert_array_equal(store[3].rgb, toys[1].rgb)
    np.testing.assert_array_equal(store[3].depth_mm, toys[1].depth_mm)
    np.testing.assert_array_equal(store[3].labels, toys[1].labels)
    assert store[3].classes == toys[1].classes
    with pytest.raises(TrainingError, match="scene 0 is missing or damaged"):
        store[1]
    (tmp_path / "00001.rgb.npy").write_bytes(b"")
    with pytest.raises(TrainingError, match=r"scene 1 is missing or damaged .* run the same command again"):
        FrameStore(tmp_path, seed=0, scenes=2, frames_a_scene=2)[2]


def test_compact_without_weights_takes_the_asset_or_says_that_there_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(assets, "__file__", str(tmp_path / "dotmask" / "assets.py"))
    with pytest.raises(SegmenterError, match=r"comes without its weights .*; name a file with --weights, or make one"):
        choose_network("compact", None, "cpu")
    for place in ("dotmask_assets", "assets"):
        path = tmp_path / place / WEIGHTS_OF_COMPACT
        path.parent.mkdir(parents=True)
        path.write_bytes(place.encode())
        assert choose_network("compact", None, "cpu").weights == path, "a checkout goes before a wheel"


def test_the_weights_that_are_committed_are_those_of_the_manifest_and_of_the_card() -> None:
    path = asset_root() / WEIGHTS_OF_COMPACT
    choice = choose_network("compact", None, "cpu")
    assert (choice.weights, choice.weights_sha256) == (path, manifest()[WEIGHTS_OF_COMPACT].sha256)
    assert choice.weights_sha256 in path.with_name("compact.md").read_text()
    assert path.stat().st_size <= 12_000_000
    load_network(choice)


def test_scenario_files_can_be_evaluated(tmp_path: Path, dotmask) -> None:
    path = tmp_path / "scenario.json"
    path.write_text(scenario("smoke").model_copy(update={"name": "mine", "frames": 1}).to_json())
    done = dotmask("evaluate-segmenter", "oracle", "--scenarios", path, "--json")
    assert done.code == 0, done.err
    assert json.loads(done.out)["scenarios"] == {"mine": 1}
