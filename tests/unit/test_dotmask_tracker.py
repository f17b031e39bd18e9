from dataclasses import replace

import numpy as np
import pytest

from dotmask.profiles import CALIBRATED, PAPER
from dotmask.records import Detections, Observation
from dotmask.tracking.measurement_model import CAMERA_POINT
from dotmask.tracking.tracker import TrackerState, track_objects, widen

DT = 1 / 30


def frame(*objects, shape=(24, 32)):
    """Observations and detections of objects given as (position, class name) or (position, class name, box)."""
    boxes = [o[2] if len(o) > 2 else (4, 4, 13, 19) for o in objects]
    masks = np.zeros((len(objects), *shape), bool)
    for mask, (u0, v0, u1, v1) in zip(masks, boxes, strict=True):
        mask[v0 : v1 + 1, u0 : u1 + 1] = True
    detections = Detections(
        masks=masks,
        boxes_px=np.array(boxes, float).reshape(-1, 4),
        class_names=tuple(o[1] for o in objects),
        scores=np.ones(len(objects)),
    )
    observations = tuple(
        Observation(
            position_camera=np.asarray(o[0], float),
            covariance=0.02**2 * np.eye(3),
            class_name=o[1],
            detection_index=i,
            model=CAMERA_POINT,
        )
        for i, o in enumerate(objects)
    )
    return observations, detections


def step(state, k, *objects, profile=PAPER, T_world_camera=None):
    observations, detections = frame(*objects)
    pose = np.eye(4) if T_world_camera is None else T_world_camera
    return track_objects(state, observations, detections, k * DT, pose, profile)


def test_a_new_object_starts_a_track_and_the_next_frame_updates_it() -> None:
    born = step(TrackerState(), 0, ([0, 0, 2], "chair"))
    [track] = born.tracks
    assert (track.track_id, track.age_frames, track.misses, track.detection_index) == (1, 1, 0, 0)
    [track] = step(born, 1, ([0.01, 0, 2], "chair")).tracks
    assert (track.track_id, track.age_frames, track.misses) == (1, 2, 0)
    assert track.innovation is not None


def test_a_step_leaves_the_state_before_as_it_was() -> None:
    before = step(TrackerState(), 0, ([0, 0, 2], "chair"))
    mean = before.tracks[0].mean.copy()
    assert step(before, 1, ([0.05, 0, 2], "chair")).tracks[0].mean[0] > 0
    np.testing.assert_array_equal(before.tracks[0].mean, mean)
    first, second = (step(before, 1, ([0.05, 0, 2], "chair")) for _ in range(2))
    np.testing.assert_array_equal(first.tracks[0].covariance, second.tracks[0].covariance)


@pytest.mark.parametrize("profile", [PAPER, CALIBRATED], ids=lambda p: p.name)
def test_a_track_ends_after_e_frames_without_observation(profile) -> None:
    state = step(TrackerState(), 0, ([0, 0, 2], "chair"), profile=profile)
    for k in range(1, profile.max_misses):
        state = step(state, k, profile=profile)
        assert [t.misses for t in state.tracks] == [k]
    assert step(state, profile.max_misses, profile=profile).tracks == ()


def test_ids_are_never_used_again() -> None:
    state = step(TrackerState(), 0, ([0, 0, 2], "chair"), ([1, 0, 2], "chair"))
    for k in range(1, 12):
        state = step(state, k)
    assert state.tracks == ()
    assert [t.track_id for t in step(state, 12, ([0, 0, 2], "chair")).tracks] == [3]


def test_an_unseen_object_at_one_metre_per_second_goes_on() -> None:
    state = TrackerState()
    for k in range(60):
        state = step(state, k, ([k * DT, 0, 3], "chair"))
    last = state.tracks[0]
    assert last.velocity_world[0] == pytest.approx(1.0, abs=0.02)
    for k in range(60, 66):
        state = step(state, k)
    [coasting] = state.tracks
    assert coasting.misses == 6
    assert coasting.position_world[0] - last.position_world[0] == pytest.approx(6 * DT, abs=0.01)
    assert coasting.mask_timestamp_s == pytest.approx(59 * DT)
    assert np.linalg.det(coasting.covariance[:3, :3]) > np.linalg.det(last.covariance[:3, :3])


def test_of_two_people_either_may_leave() -> None:
    for stays in (0, 1):
        people = [([0, 0, 2], "person"), ([1, 0, 2], "person")]
        state = step(TrackerState(), 0, *people)
        for k in range(1, 10):
            state = step(state, k, people[stays])
        assert [t.track_id for t in state.tracks] == [1, 2]
        state = step(state, 10, people[stays])
        assert [(t.track_id, t.misses) for t in state.tracks] == [(stays + 1, 0)]


def test_a_chair_that_is_left_alone_gets_a_track_of_its_own() -> None:
    state = step(TrackerState(), 0, ([0, 0, 2], "person"))
    state = step(state, 1, ([1, 0, 2], "chair"))
    assert [(t.class_name, t.misses) for t in state.tracks] == [("person", 1), ("chair", 0)]


def test_speed_does_not_depend_on_the_frame_rate() -> None:
    for rate in (5, 14, 30):
        state = TrackerState()
        for k in range(4 * rate):
            observations, detections = frame(([k / rate, 0, 3], "chair"))
            state = track_objects(state, observations, detections, k / rate, np.eye(4), PAPER)
        assert state.tracks[0].velocity_world[0] == pytest.approx(1.0, abs=0.02)


def test_a_moving_camera_does_not_move_a_standing_object() -> None:
    state = TrackerState()
    for k in range(60):
        T = np.eye(4)
        T[:3, 3] = [0.5 * k * DT, 0, 0.2 * k * DT]
        state = step(state, k, (np.array([1, 0, 4]) - T[:3, 3], "chair"), T_world_camera=T)
    assert np.linalg.norm(state.tracks[0].velocity_world) < 1e-9


def test_a_box_that_is_cut_in_half_hardly_moves_the_calibrated_belief() -> None:
    def speed_after_cut(profile):
        state = TrackerState()
        for k in range(30):
            state = step(state, k, ([0, 0, 2], "chair", (4, 4, 23, 19)), profile=profile)
        # Half of the box goes; its centre jumps by a quarter of the width, say 6 cm.
        state = step(state, 30, ([0.06, 0, 2], "chair", (14, 4, 23, 19)), profile=profile)
        assert len(state.tracks) == 1
        return state.tracks[0].velocity_world[0]

    assert speed_after_cut(CALIBRATED) < 0.02
    assert speed_after_cut(PAPER) > 0.05


def test_a_jump_over_the_gate_gets_a_second_chance_in_the_calibrated_profile_only() -> None:
    ids = {}
    for profile in (CALIBRATED, PAPER):
        state = TrackerState()
        for k in range(30):
            state = step(state, k, ([0, 0, 2], "chair"), profile=profile)
        state = step(state, 30, ([0.3, 0, 2], "chair"), profile=profile)
        ids[profile.name] = [(t.track_id, t.misses) for t in state.tracks]
    assert ids == {"calibrated": [(1, 0)], "paper": [(1, 1), (2, 0)]}


def test_widening_adds_half_of_what_is_missing() -> None:
    [observation], _ = frame(([0, 0, 2], "chair"))
    chair = CALIBRATED.class_model("chair")
    added = widen(observation, np.array([0.5, 0.0]), CALIBRATED).covariance - observation.covariance
    hidden = 0.5 * 0.5 * chair.extent_m[0] * chair.hidden_factor
    depth = CALIBRATED.noise.hidden_depth_share * 0.5 * chair.extent_m[2] * chair.hidden_factor
    np.testing.assert_allclose(added, np.diag(np.square([hidden, 0, depth])), atol=1e-12)
    assert widen(observation, np.zeros(2), CALIBRATED) is observation


def test_time_must_go_on() -> None:
    state = step(TrackerState(), 1, ([0, 0, 2], "chair"))
    with pytest.raises(ValueError, match="is not later than"):
        step(state, 1, ([0, 0, 2], "chair"))


def test_every_track_needs_a_size() -> None:
    state = step(TrackerState(), 0, ([0, 0, 2], "chair"))
    with pytest.raises(ValueError, match="1 tracks, but 0 sizes"):
        replace(state, sizes=())


def hidden_frame(k, x, *, is_partial):
    observations, detections = frame(([x, 0, 2], "chair"))
    return (replace(observations[0], is_partial=is_partial),), detections, k * DT, np.eye(4), CALIBRATED


def test_a_pushed_object_seen_whole_learns_its_velocity_and_one_that_comes_out_of_hiding_its_place() -> None:
    speeds = {}
    for is_partial in (False, True):
        state = TrackerState()
        for k in range(60):
            state = track_objects(state, *hidden_frame(k, 0.0, is_partial=is_partial))
        for k in range(60, 64):  # all at once it is elsewhere, and further on in every frame
            state = track_objects(state, *hidden_frame(k, 0.25 + 0.03 * (k - 60), is_partial=False))
        [track] = state.tracks
        assert track.track_id == 1, "it is still the same object"
        assert track.position_world[0] == pytest.approx(0.34, abs=0.1)
        speeds[is_partial] = track.velocity_world[0]
    assert speeds[False] > 0.5
    assert abs(speeds[True]) < 0.3
