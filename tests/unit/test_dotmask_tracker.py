from dataclasses import replace

import numpy as np
import pytest

from dotmask.profiles import CALIBRATED, PAPER
from dotmask.records import Intrinsics, Observation, Reason, SurfaceMotion, TrackPhase, Verdict
from dotmask.tracking.association import Association
from dotmask.tracking.measurement_model import CAMERA_POINT
from dotmask.tracking.motion_model import predict
from dotmask.tracking.tracker import TrackerState, predict_tracks, update_tracks

DT = 1 / 30
CAMERA = Intrinsics(width=32, height=24, fx=26.0, fy=26.0, cx=15.5, cy=11.5)
MASK = np.zeros((24, 32), bool)
MASK[4:20, 4:14] = True


def frame(*objects, is_partial=False):
    """Observations of objects given as (position, class name)."""
    return tuple(
        Observation(
            position_camera=np.asarray(position, float),
            covariance=0.02**2 * np.eye(3),
            class_name=class_name,
            detection_index=i,
            mask=MASK,
            model=CAMERA_POINT,
            is_partial=is_partial,
        )
        for i, (position, class_name) in enumerate(objects)
    )


def step(state, k, *objects, profile=PAPER, T_world_camera=None, is_partial=False, surfaces=None, dt=DT):
    observations = frame(*objects, is_partial=is_partial)
    pose = np.eye(4) if T_world_camera is None else T_world_camera
    surfaces = (None,) * len(objects) if surfaces is None else surfaces
    return update_tracks(predict_tracks(state, k * dt, profile), observations, surfaces, pose, CAMERA, profile)


def test_a_new_object_starts_a_track_and_the_next_frame_updates_it() -> None:
    born = step(TrackerState(), 0, ([0, 0, 2], "chair"))
    [track] = born.tracks
    assert (track.track_id, track.hits, track.misses, track.detection_index) == (1, 1, 0, 0)
    [track] = step(born, 1, ([0.01, 0, 2], "chair")).tracks
    assert (track.track_id, track.hits, track.misses) == (1, 2, 0)
    assert track.innovation is not None


def test_a_step_leaves_the_state_before_as_it_was() -> None:
    before = step(TrackerState(), 0, ([0, 0, 2], "chair"))
    mean = before.tracks[0].mean.copy()
    assert step(before, 1, ([0.05, 0, 2], "chair")).tracks[0].mean[0] > 0
    np.testing.assert_array_equal(before.tracks[0].mean, mean)
    first, second = (step(before, 1, ([0.05, 0, 2], "chair")) for _ in range(2))
    np.testing.assert_array_equal(first.tracks[0].covariance, second.tracks[0].covariance)


@pytest.mark.parametrize("profile", [PAPER, CALIBRATED], ids=lambda p: p.name)
def test_a_confirmed_track_ends_after_e_frames_without_observation(profile) -> None:
    state = TrackerState()
    for k in range(profile.confirming_hits):
        state = step(state, k, ([0, 0, 2], "chair"), profile=profile)
    for misses in range(1, profile.max_misses):
        state = step(state, k + misses, profile=profile)
        assert [(t.misses, t.phase, t.hits) for t in state.tracks] == [(misses, TrackPhase.COASTING, k + 1)]
    assert step(state, k + profile.max_misses, profile=profile).tracks == ()


@pytest.mark.parametrize("is_moving", [False, True])
def test_what_stood_still_is_waited_for_longer(is_moving) -> None:
    state = TrackerState()
    for k in range(CALIBRATED.confirming_hits):
        state = step(state, k, ([0, 0, 2], "chair"), profile=CALIBRATED)
    verdict = Verdict(is_moving=is_moving, reason=Reason.IDLE, speed_m_s=0.0, mask_iou=None)
    state = replace(state, tracks=tuple(replace(t, verdict=verdict) for t in state.tracks))
    patience = CALIBRATED.max_misses if is_moving else CALIBRATED.max_misses_idle
    for misses in range(1, patience):
        state = step(state, k + misses, profile=CALIBRATED)
        assert [t.misses for t in state.tracks] == [misses]
    assert step(state, k + patience, profile=CALIBRATED).tracks == ()


@pytest.mark.parametrize("hits", [1, 2])
def test_a_tentative_track_ends_at_its_first_miss(hits) -> None:
    state = TrackerState()
    for k in range(hits):
        state = step(state, k, ([0, 0, 2], "chair"), profile=CALIBRATED)
        assert [t.phase for t in state.tracks] == [TrackPhase.TENTATIVE]
    assert step(state, hits, profile=CALIBRATED).tracks == ()


def test_the_third_sighting_confirms_and_a_coasting_track_that_is_seen_again_goes_on() -> None:
    state, phases = TrackerState(), []
    for k in range(8):
        seen = () if k in (4, 5) else (([0, 0, 2], "chair"),)
        state = step(state, k, *seen, profile=CALIBRATED)
        phases.append([(t.track_id, t.phase) for t in state.tracks])
    tentative, confirmed, coasting = TrackPhase.TENTATIVE, TrackPhase.CONFIRMED, TrackPhase.COASTING
    expected = [tentative, tentative, confirmed, confirmed, coasting, coasting, confirmed, confirmed]
    assert phases == [[(1, phase)] for phase in expected]


def test_in_the_paper_a_track_is_confirmed_at_birth() -> None:
    assert [t.phase for t in step(TrackerState(), 0, ([0, 0, 2], "chair")).tracks] == [TrackPhase.CONFIRMED]


def test_ids_are_never_used_again() -> None:
    state = step(TrackerState(), 0, ([0, 0, 2], "chair"), ([1, 0, 2], "chair"))
    for k in range(1, 12):
        state = step(state, k)
    assert state.tracks == ()
    assert [t.track_id for t in step(state, 12, ([0, 0, 2], "chair")).tracks] == [3]


def test_ids_of_tentative_tracks_are_never_used_again() -> None:
    state, ids = TrackerState(), []
    for k in range(0, 10, 2):
        state = step(state, k, ([0, 0, 2], "chair"), profile=CALIBRATED)
        ids += [t.track_id for t in state.tracks]
        state = step(state, k + 1, profile=CALIBRATED)
    assert ids == [1, 2, 3, 4, 5]


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
            state = step(state, k, ([k / rate, 0, 3], "chair"), dt=1 / rate)
        assert state.tracks[0].velocity_world[0] == pytest.approx(1.0, abs=0.02)


def test_a_moving_camera_does_not_move_a_standing_object() -> None:
    state = TrackerState()
    for k in range(60):
        T = np.eye(4)
        T[:3, 3] = [0.5 * k * DT, 0, 0.2 * k * DT]
        state = step(state, k, (np.array([1, 0, 4]) - T[:3, 3], "chair"), T_world_camera=T)
    assert np.linalg.norm(state.tracks[0].velocity_world) < 1e-9


def test_the_velocity_of_a_half_hidden_object_that_stands_is_not_dragged_while_its_visible_centre_slides() -> None:
    """The centre of what is seen slides by 0.3 m/s: the position follows it, the velocity does not."""

    def after_sliding(profile, *, is_partial):
        state = TrackerState()
        for k in range(30):
            state = step(state, k, ([0, 0, 2], "chair"), profile=profile)
        for k in range(30, 45):
            state = step(state, k, ([0.01 * (k - 29), 0, 2], "chair"), profile=profile, is_partial=is_partial)
        [track] = state.tracks
        return track.position_world[0], track.velocity_world[0]

    position, velocity = after_sliding(CALIBRATED, is_partial=True)
    assert position == pytest.approx(0.15, abs=0.03)
    assert abs(velocity) < 0.06
    # Seen whole, this is motion; and the paper knows no hidden sides.
    assert after_sliding(CALIBRATED, is_partial=False)[1] > 0.1
    paper = after_sliding(PAPER, is_partial=True)
    assert paper == after_sliding(PAPER, is_partial=False)
    assert paper[1] > 0.1


def test_a_half_hidden_object_that_moves_has_the_velocity_of_its_surface() -> None:
    moves = SurfaceMotion(
        points=20, moving_points=20, velocity_world=np.array([0.3, 0, 0]), covariance=0.03**2 * np.eye(3)
    )
    state = TrackerState()
    for k in range(30):
        seen = ([0.01 * k, 0, 2], "chair")
        state = step(state, k, seen, profile=CALIBRATED, is_partial=True, surfaces=(moves,))
    [track] = state.tracks
    assert track.velocity_world[0] == pytest.approx(0.3, abs=0.02)
    assert track.surface is moves


def test_each_track_gets_the_surface_of_its_own_detection() -> None:
    def motion(speed):
        velocity = np.array([speed, 0, 0])
        return SurfaceMotion(points=20, moving_points=20, velocity_world=velocity, covariance=1e-6 * np.eye(3))

    objects = [([0, 0, 2], "chair"), ([1, 0, 2], "chair")]
    state = step(TrackerState(), 0, *objects)
    state = step(state, 1, *objects[::-1], surfaces=(motion(0.2), motion(-0.3)))
    assert [t.detection_index for t in state.tracks] == [1, 0]
    assert [t.velocity_world[0] for t in state.tracks] == pytest.approx([-0.3, 0.2], abs=1e-4)
    unseen = step(state, 2).tracks
    assert [t.surface for t in unseen] == [None, None]


def test_a_jump_over_the_gate_gets_a_second_chance_in_the_calibrated_profile_only() -> None:
    ids = {}
    for profile in (CALIBRATED, PAPER):
        state = TrackerState()
        for k in range(30):
            state = step(state, k, ([0, 0, 2], "chair"), profile=profile)
        state = step(state, 30, ([0.3, 0, 2], "chair"), profile=profile)
        ids[profile.name] = [(t.track_id, t.misses) for t in state.tracks]
    assert ids == {"calibrated": [(1, 0)], "paper": [(1, 1), (2, 0)]}


def test_time_must_go_on() -> None:
    state = step(TrackerState(), 1, ([0, 0, 2], "chair"))
    with pytest.raises(ValueError, match="is not later than"):
        step(state, 1, ([0, 0, 2], "chair"))


@pytest.mark.parametrize("was_partial", [False, True])
@pytest.mark.parametrize("is_partial", [False, True])
def test_a_shift_counts_as_motion_only_if_the_object_was_seen_whole_before_and_after_it(
    was_partial, is_partial
) -> None:
    state = TrackerState()
    for k in range(30):
        state = step(state, k, ([0, 0, 2], "chair"), profile=CALIBRATED, is_partial=was_partial)
    [track] = step(state, 30, ([0.04, 0, 2], "chair"), profile=CALIBRATED, is_partial=is_partial).tracks
    speed_for_the_way = track.velocity_world[0] / track.position_world[0]
    if was_partial or is_partial:
        assert track.position_world[0] > 0.025
        assert speed_for_the_way < 1.0
    else:
        assert track.position_world[0] < 0.02
        assert speed_for_the_way > 2.0


def test_what_jumps_out_of_its_gate_is_at_its_new_place_without_a_speed() -> None:
    state = TrackerState()
    for k in range(30):
        state = step(state, k, ([0, 0, 2], "chair"), profile=CALIBRATED)
    state = step(state, 30, ([0.3, 0, 2], "chair"), profile=CALIBRATED)
    [track] = state.tracks
    assert track.position_world[0] == pytest.approx(0.3, abs=0.01)
    assert np.linalg.norm(track.velocity_world) < 0.02


def test_the_search_for_what_came_out_elsewhere_ends_at_its_gate() -> None:
    """As far as the quantile of the reappearance's sigma allows; behind it a new object is born."""
    for metres, ids in ((0.7, [1]), (1.3, [1, 2])):
        state = TrackerState()
        for k in range(30):
            state = step(state, k, ([0, 0, 2], "chair"), profile=CALIBRATED)
        state = step(state, 30, ([metres, 0, 2], "chair"), profile=CALIBRATED)
        assert [t.track_id for t in state.tracks] == ids
        if len(ids) == 2:
            # The lost one is no less certain for having been looked for.
            assert np.trace(state.tracks[0].covariance) < 0.1


def test_tracks_are_predicted_once_and_may_be_updated_often() -> None:
    """With another pose, say: the prediction is the motion model's, and an update leaves it as it was."""
    state = TrackerState()
    for k in range(5):
        state = step(state, k, ([0.1 * k, 0, 2], "chair"), ([2, 0, 3], "person"))
    predicted = predict_tracks(state, 5 * DT, PAPER)
    assert (predicted.timestamp_s, predicted.next_track_id) == (5 * DT, 3)
    assert predicted.elapsed_s == pytest.approx(DT)
    for known, ahead in zip(state.tracks, predicted.tracks, strict=True):
        expected = predict(known, 5 * DT, PAPER)
        np.testing.assert_array_equal(ahead.mean, expected.mean)
        np.testing.assert_array_equal(ahead.covariance, expected.covariance)
        assert (ahead.misses, ahead.detection_index) == (1, None)
    seen, pose = frame(([0.5, 0, 2], "chair"), ([9, 0, 2], "cup")), np.eye(4)
    first = update_tracks(predicted, seen, (None,) * 2, pose, CAMERA, PAPER)
    elsewhere = np.eye(4)
    elsewhere[0, 3] = 0.05
    update_tracks(predicted, seen, (None,) * 2, elsewhere, CAMERA, PAPER)
    again = update_tracks(predicted, seen, (None,) * 2, pose, CAMERA, PAPER)
    assert [t.track_id for t in again.tracks] == [1, 2, 3]
    assert [t.misses for t in again.tracks] == [0, 1, 0]
    for one, other in zip(first.tracks, again.tracks, strict=True):
        np.testing.assert_array_equal(one.mean, other.mean)
        np.testing.assert_array_equal(one.covariance, other.covariance)
    assert predict_tracks(TrackerState(), 7.0, PAPER).elapsed_s == 0.0


def test_how_pairs_are_found_can_be_replaced() -> None:
    def crossed(tracks, observations, *_):
        return Association(pairs=((0, 1), (1, 0)), unmatched_tracks=(), unmatched_observations=())

    state = step(TrackerState(), 0, ([0, 0, 2], "chair"), ([1, 0, 2], "chair"))
    seen = frame(([0, 0, 2], "chair"), ([1, 0, 2], "chair"))
    after = update_tracks(predict_tracks(state, DT, PAPER), seen, (None,) * 2, np.eye(4), CAMERA, PAPER, crossed)
    assert [t.detection_index for t in after.tracks] == [1, 0]
