"""All tracks over one frame: predict, associate, update, birth and death (paper, Tracking Using EKF)."""

from collections.abc import Sequence
from dataclasses import dataclass

from dotmask.profiles import Profile
from dotmask.records import FloatArray, Intrinsics, Observation, SurfaceMotion, Track, TrackPhase
from dotmask.tracking.association import Associate, associate
from dotmask.tracking.ekf import initiate, slide, update
from dotmask.tracking.motion_model import predict, slide_variance


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrackerState:
    """What the tracker knows between two frames.

    Attributes:
        tracks: living tracks by ascending id.
        next_track_id: id of the next birth; ids are never used again.
    """

    tracks: tuple[Track, ...] = ()
    next_track_id: int = 1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PredictedTracks:
    """The tracks as they are expected in a frame, before it is looked at.

    Attributes:
        tracks: by ascending id, each with one more miss.
        timestamp_s: of the frame.
        elapsed_s: since the frame before; 0 without tracks.
        next_track_id: see TrackerState.
    """

    tracks: tuple[Track, ...]
    timestamp_s: float
    elapsed_s: float
    next_track_id: int


def predict_tracks(state: TrackerState, timestamp_s: float, profile: Profile) -> PredictedTracks:
    """What is expected in the frame at `timestamp_s`; `state` itself stays as it is.

    Raises:
        ValueError: the frame is not later than the state.
    """
    return PredictedTracks(
        tracks=tuple(predict(track, timestamp_s, profile) for track in state.tracks),
        timestamp_s=timestamp_s,
        elapsed_s=timestamp_s - state.tracks[0].timestamp_s if state.tracks else 0.0,
        next_track_id=state.next_track_id,
    )


def update_tracks(
    predicted: PredictedTracks,
    observations: Sequence[Observation],
    surfaces: Sequence[SurfaceMotion | None],
    T_world_camera: FloatArray,
    intrinsics: Intrinsics,
    profile: Profile,
    associate: Associate = associate,
) -> TrackerState:
    """The state after a frame.

    Tracks without an observation keep their prediction and go on moving; after `profile.max_misses` such frames they
    end, tentative ones at once. Tracks and observations that the gate left over are paired again as if the object had
    come out from behind something. Observations without a track start one, in the order of the observations.

    Args:
        predicted: for this frame.
        observations: of this frame, from `dotmask.tracking.measurement.observe`.
        surfaces: for each detection how its surface moves, from `dotmask.tracking.surface.surface_motions`.
        T_world_camera: (4, 4) camera pose at this frame.
        intrinsics: of the camera.
        profile: parameters.
        associate: pairs tracks and observations.
    """
    tracks = list(predicted.tracks)
    association = associate(tracks, observations, T_world_camera, intrinsics, profile)
    for i, j in association.pairs:
        track, observation = tracks[i], observations[j]
        if observation.is_partial and not track.is_partial:
            track = slide(track, slide_variance(track.class_name, predicted.elapsed_s, profile))
        tracks[i] = update(track, observation, surfaces[observation.detection_index], T_world_camera, profile)

    newcomers = [observations[j] for j in association.unmatched_observations]
    if profile.reappearance_m > 0 and newcomers:
        lost = association.unmatched_tracks
        anywhere = [slide(tracks[i], profile.reappearance_m**2) for i in lost]
        second = associate(anywhere, newcomers, T_world_camera, intrinsics, profile)
        for i, j in second.pairs:
            surface = surfaces[newcomers[j].detection_index]
            tracks[lost[i]] = update(anywhere[i], newcomers[j], surface, T_world_camera, profile)
        newcomers = [newcomers[j] for j in second.unmatched_observations]

    births = [
        initiate(observation, predicted.timestamp_s, T_world_camera, profile, predicted.next_track_id + k)
        for k, observation in enumerate(newcomers)
    ]
    living = [track for track in tracks if track.misses < _patience(track, profile)]
    return TrackerState(tracks=(*living, *births), next_track_id=predicted.next_track_id + len(births))


def _patience(track: Track, profile: Profile) -> int:
    """With so many misses a track ends."""
    return 1 if track.phase is TrackPhase.TENTATIVE else profile.max_misses
