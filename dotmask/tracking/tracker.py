"""All tracks over one frame: predict, associate, update, birth and death (paper, Tracking Using EKF)."""

from collections.abc import Sequence
from dataclasses import dataclass

from dotmask.profiles import Profile
from dotmask.records import FloatArray, Intrinsics, Observation, SurfaceMotion, Track, TrackPhase
from dotmask.tracking.association import Associate, associate
from dotmask.tracking.ekf import initiate, slide, update_all
from dotmask.tracking.motion_model import predict_all, slide_variance


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
        tracks=predict_all(state.tracks, timestamp_s, profile),
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

    Tracks without an observation keep their prediction and go on moving; after `profile.max_misses` such frames, or
    `max_misses_idle` if they stood still, they end, tentative ones at once. Tracks and observations that the gate left
    over are paired again as if the object had come out from behind something. Observations without a track start one,
    in the order of the observations.

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
    priors = []
    for i, j in association.pairs:
        track = tracks[i]
        if observations[j].is_partial and not track.is_partial:
            track = slide(track, slide_variance(track.class_name, predicted.elapsed_s, profile))
        priors.append(track)
    seen = [observations[j] for _, j in association.pairs]
    updated = update_all(priors, seen, _surfaces_of(seen, surfaces), T_world_camera, profile)
    for (i, _), track in zip(association.pairs, updated, strict=True):
        tracks[i] = track

    newcomers = [observations[j] for j in association.unmatched_observations]
    if profile.reappearance_m > 0 and newcomers:
        lost = association.unmatched_tracks
        anywhere = [slide(tracks[i], profile.reappearance_m**2) for i in lost]
        second = associate(anywhere, newcomers, T_world_camera, intrinsics, profile)
        priors, seen = [anywhere[i] for i, _ in second.pairs], [newcomers[j] for _, j in second.pairs]
        updated = update_all(priors, seen, _surfaces_of(seen, surfaces), T_world_camera, profile)
        for (i, _), track in zip(second.pairs, updated, strict=True):
            tracks[lost[i]] = track
        newcomers = [newcomers[j] for j in second.unmatched_observations]

    births = [
        initiate(observation, predicted.timestamp_s, T_world_camera, profile, predicted.next_track_id + k)
        for k, observation in enumerate(newcomers)
    ]
    living = [track for track in tracks if track.misses < _patience(track, profile)]
    return TrackerState(tracks=(*living, *births), next_track_id=predicted.next_track_id + len(births))


def _surfaces_of(
    observations: Sequence[Observation], surfaces: Sequence[SurfaceMotion | None]
) -> list[SurfaceMotion | None]:
    """How the surface of each observed object moves, from those of all detections."""
    return [surfaces[observation.detection_index] for observation in observations]


def _patience(track: Track, profile: Profile) -> int:
    """With so many misses a track ends."""
    if track.phase is TrackPhase.TENTATIVE:
        return 1
    is_idle = track.verdict is not None and not track.verdict.is_moving
    return profile.max_misses_idle if is_idle else profile.max_misses
