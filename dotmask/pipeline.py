"""The paper's architecture figure on one page: segment, track, classify, mask, and close the loop with SLAM.

    frame --> segment --> observe, follow --> predict, associate, update --> classify --> mask --> MO-MDI, MDI
                                              ^                                                   |
                                              |   predicted camera pose                           v
                                              '------------- pose feedback <----------- SLAM: odometry, map

Source: Vincent et al. 2020, section III and the figure "Architecture of DOTMask".
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from dotmask.classification import Classify, classify
from dotmask.geometry import rotation_from_vector, vector_from_rotation
from dotmask.interfaces import Segmenter, SlamBackend, WorksElsewhere
from dotmask.masking import all_cutouts, choose_cutouts, mask_depth
from dotmask.profiles import PoseFeedback, Profile
from dotmask.records import (
    Detections,
    FloatArray,
    MaskedDepth,
    Observation,
    PoseEstimate,
    RgbdFrame,
    SlamResult,
    SurfaceMotion,
    Track,
    checked_pose,
)
from dotmask.segmentation.selection import select_detections
from dotmask.tracking.association import Associate, associate
from dotmask.tracking.measurement import observe
from dotmask.tracking.surface import SurfacePoints, follow, surface_motions
from dotmask.tracking.tracker import PredictedTracks, TrackerState, predict_tracks, update_tracks


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrontEndResult:
    """What a masking front end made of one frame.

    Attributes:
        detections: objects of interest, None where the front end looks for none.
        observations: their measured positions in the camera frame.
        tracks: beliefs after this frame, each with its verdict.
        masked: the depth images for SLAM.
        stage_seconds: CPU time of the calling thread by stage (segment, track, classify, mask); only stages that ran.
    """

    detections: Detections | None
    observations: tuple[Observation, ...]
    tracks: tuple[Track, ...]
    masked: MaskedDepth
    stage_seconds: dict[str, float]


class FrontEnd(Protocol):
    """Turns a frame into the depth images that SLAM may see."""

    def step(self, frame: RgbdFrame, T_world_camera: FloatArray) -> FrontEndResult:
        """Process the next frame, with the camera pose as known before odometry has seen it."""
        ...

    def refine(self, T_world_camera: FloatArray) -> FrontEndResult:
        """Redo the tracking of the last frame with the pose that odometry found; the masks stay."""
        ...


class StageClock:
    """Adds up the CPU time that this thread, and what works for it elsewhere, spends in named stages."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, stage: str, part: object = None) -> Iterator[None]:
        """Time the block as `stage`; `part` is what does the work, where some of it may be done in another process."""
        start = time.thread_time() + _cpu_elsewhere_s(part)
        yield
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.thread_time() + _cpu_elsewhere_s(part) - start


def _cpu_elsewhere_s(part: object) -> float:
    # Asking whether None is such a part would cost more than some stages do.
    return part.cpu_elsewhere_s if part is not None and isinstance(part, WorksElsewhere) else 0.0


class Unmasked:
    """The control: raw depth to odometry and to the map."""

    def step(self, frame: RgbdFrame, T_world_camera: FloatArray) -> FrontEndResult:
        """See FrontEnd."""
        self._result = FrontEndResult(
            detections=None,
            observations=(),
            tracks=(),
            masked=MaskedDepth(mo_mdi_m=frame.depth_m, mdi_m=frame.depth_m),
            stage_seconds={},
        )
        return self._result

    def refine(self, T_world_camera: FloatArray) -> FrontEndResult:
        """Nothing depends on the pose."""
        return self._result


class MaskAll:
    """The MDI for everything: all objects of interest removed from odometry and map, moving or not."""

    def __init__(self, segmenter: Segmenter, profile: Profile) -> None:
        self._segmenter, self._profile = segmenter, profile

    def step(self, frame: RgbdFrame, T_world_camera: FloatArray) -> FrontEndResult:
        """See FrontEnd."""
        clock = StageClock()
        with clock("segment"):
            detections = select_detections(self._segmenter.segment(frame), self._profile)
            detections.check_size(frame.intrinsics)
        with clock("mask"):
            masked = mask_depth(frame.depth_m, all_cutouts(detections, self._profile))
        self._result = FrontEndResult(
            detections=detections, observations=(), tracks=(), masked=masked, stage_seconds=clock.seconds
        )
        return self._result

    def refine(self, T_world_camera: FloatArray) -> FrontEndResult:
        """Nothing depends on the pose."""
        return self._result


@dataclass(slots=True)
class _Kept:
    """State before the last frame and what that frame brought: enough to redo its tracking."""

    before: TrackerState
    predicted: PredictedTracks
    frame: RgbdFrame
    points: SurfacePoints | None
    T_world_camera: FloatArray
    result: FrontEndResult


class DotMask:
    """The method of the paper. The one object with state; a step that raises leaves the state as it was.

    Args:
        segmenter: finds the objects.
        profile: parameters.
        associate: pairs tracks and observations. This stage and the next can be replaced, to learn what they are
            to blame for.
        classify: says which tracks move.
    """

    def __init__(
        self,
        segmenter: Segmenter,
        profile: Profile,
        *,
        associate: Associate = associate,
        classify: Classify = classify,
    ) -> None:
        self._segmenter, self._profile = segmenter, profile
        self._associate, self._classify_track = associate, classify
        self._state = TrackerState()
        self._kept: _Kept | None = None

    def step(self, frame: RgbdFrame, T_world_camera: FloatArray) -> FrontEndResult:
        """Segment, track, classify and mask one frame.

        Args:
            frame: the next frame; stamps must increase.
            T_world_camera: (4, 4) the camera pose as predicted before odometry has seen the frame.

        Raises:
            ValueError: the frame is not later than the one before, the pose is no rigid transform, or what the
                segmenter found does not fit the frame.
        """
        if self._kept is not None and not frame.timestamp_s > self._kept.frame.timestamp_s:
            stamps = f"{frame.timestamp_s} s is not later than the one before at {self._kept.frame.timestamp_s} s"
            raise ValueError(f"step: frame at {stamps}")
        T_world_camera = checked_pose(T_world_camera, "T_world_camera")
        clock, before = StageClock(), self._state
        with clock("segment"):
            detections = select_detections(self._segmenter.segment(frame), self._profile)
            detections.check_size(frame.intrinsics)
        with clock("track"):
            observations = observe(detections, frame, self._profile)
            points = self._follow(frame, detections, T_world_camera)
            predicted = predict_tracks(before, frame.timestamp_s, self._profile)
            after = self._update(predicted, frame, detections, observations, points, T_world_camera)
        with clock("classify"):
            after = self._classify(before, after)
        with clock("mask"):
            cutouts = choose_cutouts(
                detections,
                after.tracks,
                T_world_camera,
                self._camera_velocity(frame, T_world_camera),
                frame.intrinsics,
                self._profile,
            )
            masked = mask_depth(frame.depth_m, cutouts)
        result = FrontEndResult(
            detections=detections,
            observations=observations,
            tracks=after.tracks,
            masked=masked,
            stage_seconds=clock.seconds,
        )
        self._state, self._kept = after, _Kept(before, predicted, frame, points, T_world_camera, result)
        return result

    def refine(self, T_world_camera: FloatArray) -> FrontEndResult:
        """Redo the tracking and classification of the last frame with the pose that odometry found.

        The masked images were used already and stay as they are; the beliefs that the next frame starts from and the
        reported tracks are the refined ones.
        """
        if self._kept is None:
            raise ValueError("refine: no frame has been processed yet")
        T_world_camera = checked_pose(T_world_camera, "T_world_camera")
        kept, result = self._kept, self._kept.result
        assert result.detections is not None
        clock = StageClock()
        clock.seconds.update(result.stage_seconds)
        with clock("track"):
            after = self._update(
                kept.predicted, kept.frame, result.detections, result.observations, kept.points, T_world_camera
            )
        with clock("classify"):
            after = self._classify(kept.before, after)
        self._state, self._kept.T_world_camera = after, T_world_camera
        return replace(result, tracks=after.tracks, stage_seconds=clock.seconds)

    def _camera_velocity(self, frame: RgbdFrame, T_world_camera: FloatArray) -> FloatArray:
        """(3,) world, metres per second, since the frame before; 0 in the first frame."""
        if self._kept is None:
            return np.zeros(3)
        elapsed_s = frame.timestamp_s - self._kept.frame.timestamp_s
        return np.asarray((T_world_camera[:3, 3] - self._kept.T_world_camera[:3, 3]) / elapsed_s)

    def _follow(self, frame: RgbdFrame, detections: Detections, T_world_camera: FloatArray) -> SurfacePoints | None:
        settings, kept = self._profile.surface, self._kept
        if settings is None:
            return None
        # The pose of the frame before is known by now as well as it will ever be.
        before, T_world_camera_before = (None, None) if kept is None else (kept.points, kept.T_world_camera)
        return follow(before, frame, detections, T_world_camera_before, T_world_camera, settings)

    def _update(
        self,
        predicted: PredictedTracks,
        frame: RgbdFrame,
        detections: Detections,
        observations: tuple[Observation, ...],
        points: SurfacePoints | None,
        T_world_camera: FloatArray,
    ) -> TrackerState:
        profile = self._profile
        surfaces: tuple[SurfaceMotion | None, ...] = (None,) * len(detections)
        if points is not None and profile.surface is not None:
            models = [profile.class_model(name) for name in detections.class_names]
            surfaces = surface_motions(points, models, T_world_camera, frame.intrinsics, profile.noise, profile.surface)
        return update_tracks(
            predicted, observations, surfaces, T_world_camera, frame.intrinsics, profile, self._associate
        )

    def _classify(self, before: TrackerState, after: TrackerState) -> TrackerState:
        known = {t.track_id: t for t in before.tracks}
        tracks = tuple(
            replace(t, verdict=self._classify_track(t, known.get(t.track_id), self._profile)) for t in after.tracks
        )
        return replace(after, tracks=tracks)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrameResult:
    """One turn of the closed loop.

    Attributes:
        frame: what went in.
        T_world_camera_predicted: (4, 4) the pose that the tracker was given.
        front_end: see FrontEndResult.
        pose: what SLAM answered.
        stage_seconds: CPU time by stage (segment, track, classify, mask, odometry, map): of the calling thread, and of
            what SLAM has done elsewhere.
    """

    frame: RgbdFrame
    T_world_camera_predicted: FloatArray
    front_end: FrontEndResult
    pose: PoseEstimate
    stage_seconds: dict[str, float]


class ClosedLoop:
    """Front end and SLAM back end, with the camera pose fed back to the tracker.

    The tracker needs a pose before odometry has seen the frame: the method's weak joint at high camera speed.
    `previous` gives it the last pose (the paper's loop), `constant_velocity` extrapolates the last two, `refined`
    starts from the extrapolation and redoes the update with odometry's answer. While SLAM is lost the last known poses
    are used; the pose estimate says that it is lost.

    Args:
        front_end: what masks the depth.
        slam: what follows the camera.
        pose_feedback: see above.
        T_world_camera_initial: (4, 4) where the first frame is taken: it fixes the world that SLAM reports in.
    """

    def __init__(
        self, front_end: FrontEnd, slam: SlamBackend, pose_feedback: PoseFeedback, T_world_camera_initial: FloatArray
    ) -> None:
        self._front_end, self._slam, self._pose_feedback = front_end, slam, pose_feedback
        self._initial = T_world_camera_initial
        self._poses: tuple[tuple[float, FloatArray], ...] = ()

    def step(self, frame: RgbdFrame) -> FrameResult:
        """Process the next frame."""
        predicted = self._predict_pose(frame.timestamp_s)
        front_end = self._front_end.step(frame, predicted)
        clock = StageClock()
        with clock("odometry", self._slam):
            pose = self._slam.track(frame, front_end.masked)
        with clock("map", self._slam):
            self._slam.update_map(frame, front_end.masked)
        if pose.T_world_camera is not None:
            if self._pose_feedback == "refined":
                front_end = self._front_end.refine(pose.T_world_camera)
            self._poses = (*self._poses[-1:], (frame.timestamp_s, pose.T_world_camera))
        return FrameResult(
            frame=frame,
            T_world_camera_predicted=predicted,
            front_end=front_end,
            pose=pose,
            stage_seconds={**front_end.stage_seconds, **clock.seconds},
        )

    def finish(self) -> SlamResult:
        """What SLAM knows after the last frame."""
        return self._slam.finish()

    def _predict_pose(self, timestamp_s: float) -> FloatArray:
        if not self._poses:
            return self._initial
        if self._pose_feedback == "previous" or len(self._poses) < 2:
            return self._poses[-1][1]
        first, second = self._poses
        return extrapolate(first, second, timestamp_s)


def extrapolate(first: tuple[float, FloatArray], second: tuple[float, FloatArray], timestamp_s: float) -> FloatArray:
    """Pose at `timestamp_s` of a camera that keeps its velocity between two stamped poses (seconds, (4, 4)).

    The velocity of the position is kept in the world, the angular velocity in the camera.
    """
    (t0, T_world_0), (t1, T_world_1) = first, second
    ratio = (timestamp_s - t1) / (t1 - t0)
    turn = vector_from_rotation(T_world_0[:3, :3].T @ T_world_1[:3, :3])
    T_world_camera = np.eye(4)
    T_world_camera[:3, :3] = T_world_1[:3, :3] @ rotation_from_vector(ratio * turn)
    T_world_camera[:3, 3] = T_world_1[:3, 3] + ratio * (T_world_1[:3, 3] - T_world_0[:3, 3])
    return T_world_camera
