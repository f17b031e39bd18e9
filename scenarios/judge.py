"""The judge: sees the truth and what a method made of each frame, and scores every stage."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import asdict

import numpy as np

from dotmask.evaluation.classification import ClassificationRecord, confusion, roc
from dotmask.evaluation.filter import BeliefSample, filter_errors, innovation_whiteness
from dotmask.evaluation.identities import FrameIdentities, clear_scores, hota_scores, idf1
from dotmask.evaluation.latency import latency_scores
from dotmask.evaluation.loops import loop_errors
from dotmask.evaluation.masks import MaskCounts, count_masking, count_outlines, count_overlap
from dotmask.evaluation.matching import mask_ious, match_detections
from dotmask.evaluation.trajectory import absolute_trajectory_error, relative_pose_error
from dotmask.pipeline import FrameResult
from dotmask.records import Detections, FloatArray, SlamResult, Track, Trajectory
from scenarios.oracle import CLASSES, MIN_PIXELS
from scenarios.report import (
    ConfusionReport,
    EkfReport,
    LoopReport,
    MapReport,
    MaskReport,
    MethodReport,
    MocReport,
    StageTimes,
    TrackingReport,
)
from scenarios.run_folder import RunFolder
from scenarios.sources.source import TruePose
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


OUTLINES_EVERY = 5
"""Frames from one judgement of the outlines to the next: the dearest measure, of what changes slowly."""


class Judge:
    """Scores one method over one run.

    Args:
        method: its name, for the tables.
    """

    def __init__(self, method: str) -> None:
        self._method = method
        self._truth: dict[int, tuple[float, FloatArray]] = {}  # time and pose by frame
        self._estimate: list[tuple[float, FloatArray]] = []
        self._seconds: dict[str, list[float]] = defaultdict(list)
        self._beliefs: list[BeliefSample] = []
        self._classified: list[ClassificationRecord] = []
        self._identities: list[FrameIdentities] = []
        self._masks = MaskCounts()

    def see(self, truth: GroundTruth | TruePose, result: FrameResult, folder: RunFolder) -> None:
        """Score one frame, as far as its truth is known, and append its rows to `frames.csv` and `tracks.csv`."""
        frame, pose, true_pose = result.frame, result.pose.T_world_camera, truth.T_world_camera
        if true_pose is not None:
            self._truth[frame.index] = frame.timestamp_s, true_pose
        if pose is not None:
            self._estimate.append((frame.timestamp_s, pose))
        for stage, seconds in result.stage_seconds.items():
            self._seconds[stage].append(seconds)
        counts: tuple[int | None, ...] = (None,) * 4
        if isinstance(truth, GroundTruth):
            counts = self._see_masks(truth, result)
            self._see_tracks(truth, result, folder)
        else:
            self._list_tracks(result, folder)
        error = None if pose is None or true_pose is None else float(np.linalg.norm(pose[:3, 3] - true_pose[:3, 3]))
        detections = result.front_end.detections
        row = (
            self._method, frame.index, f"{frame.timestamp_s:.6f}", result.pose.status.value, result.pose.inliers,
            _text(error), None if detections is None else len(detections), len(result.front_end.tracks),
            *counts,
        )  # fmt: skip
        folder.append("frames.csv", FRAME_COLUMNS, row)

    def _see_masks(self, truth: GroundTruth, result: FrameResult) -> tuple[int, int, int, int]:
        """Count, and return the frame's moving, leaked, static and wasted pixels."""
        moving = [actor.instance_id for actor in truth.objects if actor.is_moving]
        masked = result.front_end.masked
        counts = count_masking(result.frame.depth_m, masked.mo_mdi_m, truth.instance_ids, moving)
        self._masks += counts
        return counts.moving_pixels, counts.leaked_pixels, counts.static_pixels, counts.wasted_pixels

    def _list_tracks(self, result: FrameResult, folder: RunFolder) -> None:
        """The rows of tracks of which nothing is known."""
        for track in result.front_end.tracks:
            folder.append("tracks.csv", TRACK_COLUMNS, self._track_row(result.frame.index, track, None))

    def _see_tracks(self, truth: GroundTruth, result: FrameResult, folder: RunFolder) -> None:
        detections = result.front_end.detections
        if detections is None:
            return
        frame, tracks = result.frame, result.front_end.tracks
        ious = mask_ious(detections.masks, truth.instance_ids)
        matches = match_detections(ious)
        self._masks += count_overlap(ious, matches)
        if frame.index % OUTLINES_EVERY == 0:
            self._masks += count_outlines(detections.masks, truth.instance_ids, matches)
        if "track" not in result.stage_seconds:
            return
        self._classified += _classified(truth, result, detections, matches)
        self._identities.append(_identities(truth, tracks, ious))
        actors = {actor.instance_id: actor for actor in truth.objects}
        for track in tracks:
            instance = None if track.detection_index is None else matches[track.detection_index]
            actor = None if instance is None else actors.get(instance)
            if actor is not None:
                self._beliefs.append(_sample(frame.index, track, actor, truth.T_world_camera))
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
        return Trajectory.from_poses(self._truth.values())

    def estimated_trajectory(self) -> Trajectory:
        """The poses that SLAM gave; frames in which it was lost are missing."""
        return Trajectory.from_poses(self._estimate)

    def report(self, slam: SlamResult | None = None, of_map: MapReport | None = None) -> MethodReport:
        """All figures.

        Args:
            slam: what SLAM knew after the last frame; without it the figures of the optimised poses are null.
            of_map: the figures of the map, where one was built.
        """
        truth, estimate = self.truth_trajectory(), self.estimated_trajectory()
        ate = absolute_trajectory_error(truth, estimate)
        rpe = relative_pose_error(truth, estimate)
        optimised = None if slam is None else absolute_trajectory_error(truth, slam.trajectory)
        return MethodReport(
            ate_rmse_m=None if ate is None else ate.rmse_m,
            rpe_trans_rmse_m=None if rpe is None else rpe.trans_rmse_m,
            rpe_rot_rmse_rad=None if rpe is None else rpe.rot_rmse_rad,
            tracked_frames=len(estimate),
            ate_optimised_rmse_m=None if optimised is None else optimised.rmse_m,
            optimised_frames=None if slam is None else len(slam.trajectory),
            loops=LoopReport() if slam is None else self._loop_report(slam),
            ekf=self._ekf_report(),
            tracking=self._tracking_report(),
            moc=self._moc_report(),
            masks=MaskReport(
                iou=self._masks.iou,
                boundary_f=self._masks.boundary_f,
                leak=self._masks.leak,
                waste=self._masks.waste,
            ),
            map=MapReport() if of_map is None else of_map,
            time_ms=StageTimes(**{stage: 1e3 * float(np.mean(s)) for stage, s in self._seconds.items()}),
        )

    def _loop_report(self, slam: SlamResult) -> LoopReport:
        known = {index: pose for index, (_, pose) in self._truth.items()}
        judged = [loop for loop in slam.loops if loop.from_index in known and loop.to_index in known]
        errors = loop_errors(judged, known)
        if errors is None:
            return LoopReport(count=len(slam.loops), false_count=None if slam.loops else 0)
        return LoopReport(**{**asdict(errors), "count": len(slam.loops)})

    def _ekf_report(self) -> EkfReport:
        figures = asdict(filter_errors(self._beliefs))
        del figures["samples"]
        whiteness = innovation_whiteness(self._beliefs)
        return EkfReport(
            **figures,
            innovation_correlation=None if whiteness is None else whiteness.correlation,
            innovation_correlation_bound=None if whiteness is None else whiteness.bound,
        )

    def _tracking_report(self) -> TrackingReport:
        if not self._identities:
            return TrackingReport()
        clear, hota = clear_scores(self._identities), hota_scores(self._identities)
        return TrackingReport(
            mota=clear.mota,
            idf1=idf1(self._identities),
            hota=None if hota is None else hota.hota,
            deta=None if hota is None else hota.detection,
            assa=None if hota is None else hota.association,
            switches=clear.switches,
        )

    def _moc_report(self) -> MocReport:
        if not self._classified:
            return MocReport()
        counts, latencies = confusion(self._classified), latency_scores(self._classified)
        by_class: dict[str, list[ClassificationRecord]] = defaultdict(list)
        for record in self._classified:
            by_class[record.class_name].append(record)
        tracked = [(r.speed_m_s, r.is_moving) for r in self._classified if r.speed_m_s is not None]
        curve = roc(np.array([speed for speed, _ in tracked]), np.array([moves for _, moves in tracked], np.bool_))
        return MocReport(
            precision=counts.precision,
            recall=counts.recall,
            idle_flag_rate=counts.idle_flag_rate,
            auc=None if curve is None else curve.auc,
            flag_latency_frames=latencies.flag_median_frames,
            unflag_latency_frames=latencies.unflag_median_frames,
            starts=latencies.starts,
            missed_starts=latencies.missed_starts,
            start_latency_frames=latencies.start_median_frames,
            start_latency_max_frames=latencies.start_max_frames,
            by_class={name: ConfusionReport(**asdict(confusion(by_class[name]))) for name in sorted(by_class)},
        )


def _classified(
    truth: GroundTruth, result: FrameResult, detections: Detections, matches: Sequence[int | None]
) -> Iterator[ClassificationRecord]:
    """The answer about every true object that a detection was matched to."""
    actors = {actor.instance_id: actor for actor in truth.objects}
    by_detection = {t.detection_index: t for t in result.front_end.tracks if t.detection_index is not None}
    for index, instance in enumerate(matches):
        if instance is None or instance not in actors:
            continue
        track = by_detection.get(index)
        verdict = None if track is None else track.verdict
        if verdict is None:
            # No belief to ask: what became of its pixels is the answer.
            is_flagged = not result.front_end.masked.mo_mdi_m[detections.masks[index]].any()
        else:
            is_flagged = verdict.is_moving
        yield ClassificationRecord(
            frame=result.frame.index,
            instance_id=instance,
            class_name=actors[instance].class_name,
            is_moving=actors[instance].is_moving,
            true_speed_m_s=float(np.linalg.norm(actors[instance].velocity_world)),
            is_flagged=is_flagged,
            speed_m_s=None if verdict is None else verdict.speed_m_s,
        )


def _identities(truth: GroundTruth, tracks: Sequence[Track], ious: FloatArray) -> FrameIdentities:
    """The objects that a tracker should have, the tracks that were seen in this frame, and how well they fit."""
    wanted = [a.instance_id for a in truth.objects if a.class_name in CLASSES and a.visible_pixels >= MIN_PIXELS]
    seen = {track.track_id: track.detection_index for track in tracks if track.detection_index is not None}
    return FrameIdentities(
        instances=tuple(wanted),
        tracks=tuple(seen),
        similarity=ious[np.ix_(np.array(list(seen.values()), np.intp), np.array(wanted, np.intp))].T,
    )


def _sample(frame: int, track: Track, actor: ObjectTruth, T_world_camera: FloatArray) -> BeliefSample:
    return BeliefSample(
        frame=frame,
        track_id=track.track_id,
        instance_id=actor.instance_id,
        mean=track.mean,
        covariance=track.covariance,
        innovation=track.innovation,
        centre_world=actor.centre_world,
        velocity_world=actor.velocity_world,
        ideal_world=actor.ideal_world,
        T_world_camera=T_world_camera,
    )


def _text(value: float | None) -> str | None:
    return None if value is None else f"{value:.6g}"


def _texts(values: FloatArray | list[None]) -> list[str | None]:
    return [_text(value) for value in values]
