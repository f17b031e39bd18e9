"""All tracks over one frame: predict, associate, update, birth and death (paper, Tracking Using EKF)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dotmask.profiles import Profile
from dotmask.records import Detections, FloatArray, Observation, Track
from dotmask.tracking.association import Associate, associate
from dotmask.tracking.ekf import initiate, update
from dotmask.tracking.motion_model import predict


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrackerState:
    """What the tracker knows between two frames.

    Attributes:
        tracks: living tracks by ascending id.
        sizes: for each track the usual size of its box, (2,) width and height in pixels times depth in metres: the same
            at any distance.
        next_track_id: id of the next birth; ids are never used again.
    """

    tracks: tuple[Track, ...] = ()
    sizes: tuple[FloatArray, ...] = ()
    next_track_id: int = 1

    def __post_init__(self) -> None:
        """Check that every track has a size."""
        if len(self.tracks) != len(self.sizes):
            raise ValueError(f"tracker state: {len(self.tracks)} tracks, but {len(self.sizes)} sizes")


def track_objects(
    state: TrackerState,
    observations: Sequence[Observation],
    detections: Detections,
    timestamp_s: float,
    T_world_camera: FloatArray,
    profile: Profile,
    associate: Associate = associate,
) -> TrackerState:
    """The state after one frame; `state` itself stays as it is.

    Tracks without an observation keep their prediction and go on moving; after `profile.max_misses` such frames they
    end. An object that something half hides may jump in the image: where the profile says so, R is widened by what is
    missing of its box, and tracks and observations that the gate left over are paired again with a wider R. Such a
    track was either half hidden, then its position is learned anew, or pushed, then its velocity is. Observations
    without a track start one, in the order of the observations.

    Args:
        state: after the frame before.
        observations: of this frame, from `dotmask.tracking.measurement.observe`.
        detections: that the observations were made from.
        timestamp_s: of this frame.
        T_world_camera: (4, 4) camera pose at this frame.
        profile: parameters.
        associate: pairs tracks and observations.

    Raises:
        ValueError: the frame is not later than the state.
    """
    tracks = [predict(track, timestamp_s, profile) for track in state.tracks]
    sizes = list(state.sizes)
    association = associate(tracks, observations, T_world_camera, profile)
    for i, j in association.pairs:
        observation, size = observations[j], _box_size(observations[j], detections)
        if profile.jump_share > 0:
            observation = widen(observation, _size_change(sizes[i], size, observation, profile), profile)
        sizes[i] = _usual_size(sizes[i], size, timestamp_s - state.tracks[i].mask_timestamp_s, profile)
        tracks[i] = update(tracks[i], observation, detections, T_world_camera)

    newcomers = [observations[j] for j in association.unmatched_observations]
    if profile.jump_share > 0:
        lost = association.unmatched_tracks
        share = np.full(2, profile.jump_share)
        widened = [widen(observation, share, profile) for observation in newcomers]
        second = associate([tracks[i] for i in lost], widened, T_world_camera, profile)
        for i, j in second.pairs:
            track, observation = tracks[lost[i]], newcomers[j]
            seen_whole_s = 0.0 if observation.is_partial else timestamp_s - track.partial_timestamp_s
            freed = release(track, profile) if seen_whole_s > profile.whole_s else relocate(track, profile)
            tracks[lost[i]] = update(freed, observation, detections, T_world_camera)
        newcomers = [newcomers[j] for j in second.unmatched_observations]

    living = [i for i, track in enumerate(tracks) if track.misses < profile.max_misses]
    births = [
        initiate(observation, detections, timestamp_s, T_world_camera, profile, state.next_track_id + k)
        for k, observation in enumerate(newcomers)
    ]
    return TrackerState(
        tracks=(*(tracks[i] for i in living), *births),
        sizes=(*(sizes[i] for i in living), *(_box_size(observation, detections) for observation in newcomers)),
        next_track_id=state.next_track_id + len(births),
    )


def release(track: Track, profile: Profile) -> Track:
    """`track` with as little known of its velocity as at birth: it was seen whole where it could not have been.

    A chair that is pushed changes its velocity faster than the random acceleration of its class allows.
    """
    model = profile.class_model(track.class_name)
    P = track.covariance.copy()
    P[3:, 3:] += np.diag((model.prior_speed_sigma_m_s * model.axis_shares) ** 2)
    return replace(track, covariance=P)


def relocate(track: Track, profile: Profile) -> Track:
    """`track` with a position as uncertain as when an object comes out from behind something; its velocity stays."""
    model = profile.class_model(track.class_name)
    P = track.covariance.copy()
    P[:3, :3] += np.eye(3) * (0.5 * profile.jump_share * max(model.extent_m)) ** 2
    return replace(track, covariance=P)


def widen(observation: Observation, missing_share: FloatArray, profile: Profile) -> Observation:
    """`observation` with R widened because part of the object may be hidden.

    Args:
        observation: as measured.
        missing_share: (2,) share of the object's width and height that may be hidden; the centre of the rest lies half
            of it away from the centre of the whole.
        profile: gives the extent of the class.
    """
    if not missing_share.any():
        return observation
    model = profile.class_model(observation.class_name)
    width, height, depth = model.extent_m
    hidden_m = np.array(
        [
            0.5 * missing_share[0] * width,
            0.5 * missing_share[1] * height,
            profile.noise.hidden_depth_share * missing_share.max() * depth,
        ]
    )
    hidden_m *= model.hidden_factor
    J = observation.model.jacobian(observation.position_camera)
    return replace(observation, covariance=observation.covariance + J @ np.diag(hidden_m**2) @ J.T)


def _box_size(observation: Observation, detections: Detections) -> FloatArray:
    u_min, v_min, u_max, v_max = detections.boxes_px[observation.detection_index]
    depth_m = float(observation.position_camera[2])
    return np.array([float(u_max - u_min + 1.0) * depth_m, float(v_max - v_min + 1.0) * depth_m])


def _size_change(usual: FloatArray, size: FloatArray, observation: Observation, profile: Profile) -> FloatArray:
    """(2,) by which share the box is larger or smaller than usual, beyond what the class does by itself."""
    play = profile.class_model(observation.class_name).size_play
    change: FloatArray = np.maximum(np.abs(size / usual - 1.0) - np.array(play), 0.0)
    return change


def _usual_size(usual: FloatArray, size: FloatArray, elapsed_s: float, profile: Profile) -> FloatArray:
    """Grows at once, shrinks slowly: a box shrinks when something hides the object, and when the object turns."""
    memory = float(np.exp(-elapsed_s / profile.size_memory_s))
    larger: FloatArray = np.maximum(size, memory * usual + (1.0 - memory) * size)
    return larger
