"""The judge: sees the truth and what a method made of each frame, and scores every stage."""

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from dotmask.evaluation.classification import ClassificationRecord, classification_scores
from dotmask.evaluation.masks import MaskCounts, count_masking, count_overlap
from dotmask.evaluation.tracking import FrameIdentities, filter_errors, identity_scores, match_detections
from dotmask.evaluation.trajectory import absolute_trajectory_error, relative_pose_error
from dotmask.pipeline import FrameResult
from dotmask.records import FloatArray, Track, Trajectory
from scenarios.oracle import CLASSES, MIN_PIXELS
from scenarios.report import EkfReport, MaskReport, MethodReport, MocReport, StageTimes, TrackingReport
from scenarios.run_folder import RunFolder
from sim.records import GroundTruth, ObjectTruth

FRAME_COLUMNS = (
    "method", "frame", "timestamp_s", "status", "inliers", "position_error_m", "detections", "tracks", "moving_pixels",
    "leaked_pixels", "static_pixels", "wasted_pixels",
)  # fmt: skip
TRACK_COLUMNS = (
    "method", "frame", "timestamp_s", "track_id", "class", "instance_id", "misses",
    "x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s",
    "true_x_m", "true_y_m", "true_z_m", "true_vx_m_s", "true_vy_m_s", "true_vz_m_s",
    "ideal_x_m", "ideal_y_m", "ideal_z_m",
    "nis", "is_moving", "reason", "mask_iou", "true_is_moving", "true_surface_speed_m_s", "occlusion", "is_truncated",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BeliefSample:
    """One observed track in one frame beside its truth."""

    mean: FloatArray
    covariance: FloatArray
    centre_world: FloatArray
    velocity_world: FloatArray
    ideal_world: FloatArray
    nis: float


class Judge:
    """Scores one method over one run.

    Args:
        method: its name, for the tables.
    """

    def __init__(self, method: str) -> None:
        self._method = method
        self._truth: list[tuple[float, FloatArray]] = []
        self._estimate: list[tuple[float, FloatArray]] = []
        self._seconds: dict[str, list[float]] = defaultdict(list)
        self._beliefs: list[BeliefSample] = []
        self._classified: list[ClassificationRecord] = []
        self._identities: list[FrameIdentities] = []
        self._masks = MaskCounts()

    def see(self, truth: GroundTruth, result: FrameResult, folder: RunFolder) -> None:
        """Score one frame and append its rows to `frames.csv` and `tracks.csv`."""
        frame, pose = result.frame, result.pose.T_world_camera
        self._truth.append((frame.timestamp_s, truth.T_world_camera))
        if pose is not None:
            self._estimate.append((frame.timestamp_s, pose))
        for stage, seconds in result.stage_seconds.items():
            self._seconds[stage].append(seconds)
        counts = self._see_masks(truth, result)
        self._see_tracks(truth, result, folder)
        error = None if pose is None else float(np.linalg.norm(pose[:3, 3] - truth.T_world_camera[:3, 3]))
        detections = result.front_end.detections
        row = (
            self._method, frame.index, f"{frame.timestamp_s:.6f}", result.pose.status.value, result.pose.inliers,
            _text(error), None if detections is None else len(detections), len(result.front_end.tracks),
            counts.moving_pixels, counts.leaked_pixels, counts.static_pixels, counts.wasted_pixels,
        )  # fmt: skip
        folder.append("frames.csv", FRAME_COLUMNS, row)

    def _see_masks(self, truth: GroundTruth, result: FrameResult) -> MaskCounts:
        moving = [actor.instance_id for actor in truth.objects if actor.is_moving]
        masked = result.front_end.masked
        counts = count_masking(result.frame.depth_m, masked.mo_mdi_m, truth.instance_ids, moving)
        self._masks += counts
        return counts

    def _see_tracks(self, truth: GroundTruth, result: FrameResult, folder: RunFolder) -> None:
        detections = result.front_end.detections
        if detections is None:
            return
        frame = result.frame
        matches = match_detections(detections.masks, truth.instance_ids)
        self._masks += count_overlap(detections.masks, truth.instance_ids, matches)
        tracks = result.front_end.tracks
        if not tracks and not result.front_end.observations:
            return
        actors = {actor.instance_id: actor for actor in truth.objects}
        by_detection = {t.detection_index: t for t in tracks if t.detection_index is not None}
        for index, instance in enumerate(matches):
            if instance not in actors:
                continue
            track = by_detection.get(index)
            if track is None:
                # No belief to ask: what became of its pixels is the answer.
                flagged = not result.front_end.masked.mo_mdi_m[detections.masks[index]].any()
            else:
                flagged = track.verdict is not None and track.verdict.is_moving
            self._classified.append(
                ClassificationRecord(
                    frame=frame.index,
                    instance_id=actors[instance].instance_id,
                    is_moving=actors[instance].is_moving,
                    is_flagged=flagged,
                )
            )
        followed = {t.track_id: matches[t.detection_index] if t.detection_index is not None else None for t in tracks}
        self._identities.append(
            FrameIdentities(
                instances=tuple(
                    a.instance_id for a in truth.objects if a.class_name in CLASSES and a.visible_pixels >= MIN_PIXELS
                ),
                tracks=tuple((t.track_id, followed[t.track_id]) for t in tracks if t.misses == 0),
            )
        )
        for track in tracks:
            actor = actors.get(followed[track.track_id] or 0)
            if actor is not None:
                self._beliefs.append(_sample(track, actor))
            folder.append("tracks.csv", TRACK_COLUMNS, self._track_row(frame.index, track, actor))

    def _track_row(self, frame: int, track: Track, actor: ObjectTruth | None) -> tuple[object, ...]:
        verdict = track.verdict
        assert verdict is not None
        truth: tuple[object, ...]
        if actor is None:
            truth = (*[None] * 9,)
        else:
            ideal = actor.ideal_world if actor.ideal_world is not None else [None] * 3
            truth = (*_texts(actor.centre_world), *_texts(actor.velocity_world), *_texts(ideal))
        return (
            self._method,
            frame,
            f"{track.timestamp_s:.6f}",
            track.track_id,
            track.class_name,
            None if actor is None else actor.instance_id,
            track.misses,
            *_texts(track.mean),
            *truth,
            _text(None if track.innovation is None else track.innovation.nis),
            int(verdict.is_moving),
            verdict.reason.value,
            _text(verdict.mask_iou),
            *(
                (None, None, None, None)
                if actor is None
                else (
                    int(actor.is_moving),
                    _text(actor.surface_speed_m_s),
                    _text(actor.occlusion),
                    int(actor.is_truncated),
                )
            ),
        )

    def truth_trajectory(self) -> Trajectory:
        """The true poses of all frames."""
        return _trajectory(self._truth)

    def estimated_trajectory(self) -> Trajectory:
        """The poses that SLAM gave; frames in which it was lost are missing."""
        return _trajectory(self._estimate)

    def report(self) -> MethodReport:
        """All figures."""
        truth, estimate = self.truth_trajectory(), self.estimated_trajectory()
        ate = absolute_trajectory_error(truth, estimate)
        rpe = relative_pose_error(truth, estimate)
        return MethodReport(
            ate_rmse_m=None if ate is None else ate.rmse_m,
            rpe_trans_rmse_m=None if rpe is None else rpe.trans_rmse_m,
            rpe_rot_rmse_rad=None if rpe is None else rpe.rot_rmse_rad,
            tracked_frames=len(estimate),
            ekf=self._ekf_report(),
            tracking=self._tracking_report(),
            moc=self._moc_report(),
            masks=MaskReport(iou=self._masks.iou, leak=self._masks.leak, waste=self._masks.waste),
            time_ms=StageTimes(**{stage: 1e3 * float(np.mean(s)) for stage, s in self._seconds.items()}),
        )

    def _ekf_report(self) -> EkfReport:
        if not self._beliefs:
            return EkfReport()
        errors = filter_errors(
            np.array([b.mean for b in self._beliefs]),
            np.array([b.covariance for b in self._beliefs]),
            np.array([b.centre_world for b in self._beliefs]),
            np.array([b.velocity_world for b in self._beliefs]),
            np.array([b.ideal_world for b in self._beliefs]),
            np.array([b.nis for b in self._beliefs]),
        )
        return EkfReport(
            position_rmse_m=errors.position_rmse_m,
            position_rmse_ideal_m=errors.position_rmse_ideal_m,
            velocity_rmse_m_s=errors.velocity_rmse_m_s,
            nees=errors.nees,
            nis=errors.nis,
        )

    def _tracking_report(self) -> TrackingReport:
        if not self._identities:
            return TrackingReport()
        scores = identity_scores(self._identities)
        return TrackingReport(mota=scores.mota, idf1=scores.idf1, switches=scores.switches)

    def _moc_report(self) -> MocReport:
        if not self._classified:
            return MocReport()
        scores = classification_scores(self._classified)
        return MocReport(
            precision=scores.precision,
            recall=scores.recall,
            flag_latency_frames=scores.flag_latency_frames,
            unflag_latency_frames=scores.unflag_latency_frames,
        )


def _sample(track: Track, actor: ObjectTruth) -> BeliefSample:
    return BeliefSample(
        mean=track.mean,
        covariance=track.covariance,
        centre_world=actor.centre_world,
        velocity_world=actor.velocity_world,
        ideal_world=actor.ideal_world if actor.ideal_world is not None else np.full(3, np.nan),
        nis=track.innovation.nis if track.innovation is not None else np.nan,
    )


def _trajectory(poses: list[tuple[float, FloatArray]]) -> Trajectory:
    return Trajectory(
        timestamps_s=np.array([t for t, _ in poses], np.float64),
        T_world_camera=np.array([p for _, p in poses], np.float64).reshape(-1, 4, 4),
    )


def _text(value: float | None) -> str | None:
    return None if value is None else f"{value:.6g}"


def _texts(values: FloatArray | list[None]) -> list[str | None]:
    return [_text(value) for value in values]
