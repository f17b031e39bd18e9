"""What the authors' released program does: its failures, reproducible.

The clean stages of this package do not share its behaviour, so all of it is here, apart from them. It was written from
a description of what the program was observed to do (commit bc056cd, 2022-12-20); the program itself was neither read
nor ported. docs/original.md lists every behaviour, the test that shows it, and what `calibrated` does instead.

Where the description gives an outcome and no rule, this is the simplest rule with that outcome:

- Life of a track. With as many detections as tracks, nothing is born and nothing ages, matched or not. With more
  detections, the unmatched ones start tracks. With T tracks and fewer, D, detections only the first T - D places of the
  list are looked at: a track there that was not seen ages by two, one elsewhere not at all. That gives both observed
  outcomes: of two people the one listed last never ends, the one listed first ends after 5 frames. Without any
  detection every track ages by one and ends one frame later than the limit (the observed "off by one").
- MO-MDI. The instances are zeroed one after another in one image, and each moving one saves what is zeroed so far: the
  MO-MDI lacks every instance up to the last moving one of the list. Equal scores are listed from left to right.
- A track that was not seen keeps its verdict, its mask index and its last centroid.
- The deformation test crops for 640x480, and another image size makes the program fail; here any size works.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from dotmask.interfaces import Segmenter
from dotmask.mask_geometry import dilate
from dotmask.pipeline import FrontEndResult, StageClock
from dotmask.profiles import ORIGINAL, ClassModel
from dotmask.records import (
    DepthImage,
    Detections,
    FloatArray,
    Innovation,
    MaskedDepth,
    MaskImage,
    Observation,
    Reason,
    RgbdFrame,
    Track,
    TrackPhase,
    Verdict,
)
from dotmask.segmentation.selection import select_best
from dotmask.tracking.ekf import measurement_jacobian
from dotmask.tracking.measurement_model import CAMERA_POINT
from dotmask.tracking.motion_model import transition

STEP_S = 0.25
"""Every prediction is over 0.25 s, whatever the stamps say: a speed reads as truth x real step / 0.25 s."""

FOCAL_PX, CENTRE_PX = 525.0, (319.5, 239.5)
"""The intrinsics of every camera."""

DILATION_PX = 1

R_M2 = np.diag([0.8, 0.8, 1.2])
"""Measurement noise in the camera frame: about 0.9 m, for a sensor that is good to centimetres."""

P0 = np.eye(6)
"""Covariance of a new track: 1 m and 1 m/s."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Target:
    """A track and what only this program remembers of it.

    Attributes:
        track: the belief as it is reported; of an unseen track the prediction.
        updated_mean: (6,) the mean after its last update: every prediction starts from it again.
        centroid_camera: (3,) last observation, metres, camera frame of that time.
        mask_index: the number of the detection that it was last seen as, in the list of THAT frame.
        missed: its count of missed frames, which is not always their number (`Track.misses`).
    """

    track: Track
    updated_mean: FloatArray
    centroid_camera: FloatArray
    mask_index: int
    missed: int = 0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _State:
    """Targets in the order of their birth, and the id of the next."""

    targets: tuple[_Target, ...] = ()
    next_track_id: int = 1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Kept:
    """State before the last frame and what that frame brought: enough to redo its tracking."""

    before: _State
    frame: RgbdFrame
    result: FrontEndResult


class OriginalDotMask:
    """A `dotmask.pipeline.FrontEnd` that behaves as the released program does; use it with the profile `original`."""

    def __init__(self, segmenter: Segmenter) -> None:
        self._segmenter = segmenter
        self._state = _State()
        self._kept: _Kept | None = None

    def step(self, frame: RgbdFrame, T_world_camera: FloatArray) -> FrontEndResult:
        """Segment, track, classify and mask one frame. Stamps are copied into the tracks and not used otherwise.

        Args:
            frame: the next frame.
            T_world_camera: (4, 4) the last known camera pose.
        """
        clock, before = StageClock(), self._state
        with clock("segment"):
            # No list of classes: whatever the network knows is tracked and masked.
            detections = select_best(self._segmenter.segment(frame), ORIGINAL)
        with clock("track"):
            observations = observe_boxes(detections, frame)
            after = _track(before, observations, frame, T_world_camera)
        with clock("classify"):
            after = _classify(before, after)
        with clock("mask"):
            # An unseen track names the number that it had in another frame's list: whoever has it now is removed.
            moving = {t.mask_index for t in after.targets if t.track.verdict is not None and t.track.verdict.is_moving}
            masked = mask_in_list_order(frame.depth_m, detections, moving)
        result = FrontEndResult(
            detections=detections,
            observations=observations,
            tracks=tuple(target.track for target in after.targets),
            masked=masked,
            stage_seconds=clock.seconds,
        )
        self._state, self._kept = after, _Kept(before=before, frame=frame, result=result)
        return result

    def refine(self, T_world_camera: FloatArray) -> FrontEndResult:
        """Redo the tracking and classification of the last frame with another pose; the masks stay.

        The program does no such thing; this is here for `--pose-feedback refined`.

        Raises:
            ValueError: no frame has been processed yet.
        """
        if self._kept is None:
            raise ValueError("refine: no frame has been processed yet")
        before, frame, result = self._kept.before, self._kept.frame, self._kept.result
        assert result.detections is not None
        clock = StageClock()
        clock.seconds.update(result.stage_seconds)
        with clock("track"):
            after = _track(before, result.observations, frame, T_world_camera)
        with clock("classify"):
            after = _classify(before, after)
        self._state = after
        return replace(result, tracks=tuple(t.track for t in after.targets), stage_seconds=clock.seconds)


def observe_boxes(detections: Detections, frame: RgbdFrame) -> tuple[Observation, ...]:
    """Centre of the box at the mean depth of the mask, through the fixed intrinsics, for every detection.

    Background inside the mask is part of the mean. A mask without any depth gives the point (0, 0, 0), and that is
    taken for an observation like any other.
    """
    observations = []
    for index, (mask, box) in enumerate(zip(detections.masks, detections.boxes_px, strict=True)):
        depths = frame.depth_m[mask & (frame.depth_m > 0)]
        depth_m = float(depths.mean(dtype=np.float64)) if len(depths) else 0.0
        u, v = 0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3])
        x, y = (u - CENTRE_PX[0]) / FOCAL_PX * depth_m, (v - CENTRE_PX[1]) / FOCAL_PX * depth_m
        observations.append(
            Observation(
                position_camera=np.array([x, y, depth_m]),
                covariance=R_M2,
                class_name=detections.class_names[index],
                detection_index=index,
                mask=mask,
                model=CAMERA_POINT,
            )
        )
    return tuple(observations)


def process_noise(acceleration_sigma_m_s2: float) -> FloatArray:
    """Q (6, 6) over `STEP_S`, with the cross term that the paper's source has: `a³ dt⁴/4` for `a² dt³/2`."""
    a, dt = acceleration_sigma_m_s2, STEP_S
    cross = a**3 * dt**4 / 4
    return np.kron(np.array([[a**2 * dt**4 / 4, cross], [cross, a**2 * dt**2]]), np.eye(3))


def centred_iou(first: MaskImage, second: MaskImage) -> float:
    """IoU of two masks (H, W) with the centres of their boxes on each other and their sizes as they are.

    Scale counts: a shape that grows by s has 1/s², so whoever comes nearer fast enough looks deformed.
    """
    cut = [_cut_to_box(mask) for mask in (first, second)]
    height, width = (max(patch.shape[axis] for patch in cut) for axis in (0, 1))
    layers = np.zeros((2, height, width), np.bool_)
    for layer, patch in zip(layers, cut, strict=True):
        v, u = (height - patch.shape[0]) // 2, (width - patch.shape[1]) // 2
        layer[v : v + patch.shape[0], u : u + patch.shape[1]] = patch
    union = int(np.count_nonzero(layers.any(axis=0)))
    return int(np.count_nonzero(layers.all(axis=0))) / union if union else 0.0


def mask_in_list_order(depth_m: DepthImage, detections: Detections, moving: set[int]) -> MaskedDepth:
    """Depth without all instances (MDI), and without all up to the last moving one of the list (MO-MDI).

    Args:
        depth_m: (H, W) float32 metres, 0 = none; stays as it is.
        detections: of this frame.
        moving: numbers of detections; those that this frame does not have are without effect.
    """
    mdi = depth_m.copy()
    mo_mdi = depth_m
    for index, mask in enumerate(detections.masks):
        mdi[dilate(mask, DILATION_PX)] = 0.0
        if index in moving:
            # A static object listed before a moving one is gone as well.
            mo_mdi = mdi.copy()
    return MaskedDepth(mo_mdi_m=mo_mdi, mdi_m=mdi)


def _track(
    before: _State,
    observations: Sequence[Observation],
    frame: RgbdFrame,
    T_world_camera: FloatArray,
) -> _State:
    targets = [_predict(target, frame.timestamp_s) for target in before.targets]
    pairs = _nearest_pairs(before.targets, observations)
    for i, j in pairs.items():
        targets[i] = _update(targets[i], observations[j], T_world_camera)
    next_track_id = before.next_track_id
    if len(observations) > len(targets):
        taken = set(pairs.values())
        for observation in observations:
            if observation.detection_index not in taken:
                targets.append(_initiate(observation, frame.timestamp_s, T_world_camera, next_track_id))
                next_track_id += 1
    else:
        targets = _age(targets, len(observations))
    return _State(targets=tuple(targets), next_track_id=next_track_id)


def _nearest_pairs(targets: Sequence[_Target], observations: Sequence[Observation]) -> dict[int, int]:
    """Numbers of targets to numbers of observations: the closest pair of one class first, however far apart.

    The distance is between camera-frame centroids of two frames: what the target and the camera did in between is not
    accounted for.
    """
    distances = sorted(
        (float(np.linalg.norm(target.centroid_camera - observation.position_camera)), i, j)
        for i, target in enumerate(targets)
        for j, observation in enumerate(observations)
        if target.track.class_name == observation.class_name
    )
    pairs: dict[int, int] = {}
    for _, i, j in distances:
        if i not in pairs and j not in pairs.values():
            pairs[i] = j
    return pairs


def _predict(target: _Target, timestamp_s: float) -> _Target:
    """The belief one step on, from the last UPDATED mean: an unseen object stays one step ahead of it for ever.

    The covariance goes on from where it was, so it grows.
    """
    track, F = target.track, transition(STEP_S)
    return replace(
        target,
        track=replace(
            track,
            timestamp_s=timestamp_s,
            mean=F @ target.updated_mean,
            covariance=F @ track.covariance @ F.T + process_noise(_model(track.class_name).acceleration_sigma_m_s2),
            misses=track.misses + 1,
            phase=TrackPhase.COASTING,
            detection_index=None,
            innovation=None,
        ),
    )


def _initiate(observation: Observation, timestamp_s: float, T_world_camera: FloatArray, track_id: int) -> _Target:
    mean = np.zeros(6)
    mean[:3] = T_world_camera[:3, :3] @ observation.position_camera + T_world_camera[:3, 3]
    index = observation.detection_index
    track = Track(
        track_id=track_id,
        class_name=observation.class_name,
        timestamp_s=timestamp_s,
        mean=mean,
        covariance=P0,
        hits=1,
        misses=0,
        phase=TrackPhase.CONFIRMED,
        detection_index=index,
        mask=observation.mask,
        mask_timestamp_s=timestamp_s,
        mask_position_camera=observation.position_camera,
        is_partial=False,
    )
    return _Target(track=track, updated_mean=mean, centroid_camera=observation.position_camera, mask_index=index)


def _update(target: _Target, observation: Observation, T_world_camera: FloatArray) -> _Target:
    """A Kalman update with `P = (I - K H) P`; the camera's own uncertainty is ignored."""
    track = target.track
    H = measurement_jacobian(observation.position_camera, CAMERA_POINT, T_world_camera)
    expected = H @ track.mean - T_world_camera[:3, :3].T @ T_world_camera[:3, 3]
    S = H @ track.covariance @ H.T + observation.covariance
    K = np.linalg.solve(S, H @ track.covariance).T
    innovation = Innovation(residual=observation.position_camera - expected, covariance=S)
    mean = track.mean + K @ innovation.residual
    index = observation.detection_index
    return _Target(
        track=replace(
            track,
            mean=mean,
            covariance=(np.eye(6) - K @ H) @ track.covariance,
            hits=track.hits + 1,
            misses=0,
            phase=TrackPhase.CONFIRMED,
            detection_index=index,
            mask=observation.mask,
            mask_position_camera=observation.position_camera,
            mask_timestamp_s=track.timestamp_s,
            innovation=innovation,
        ),
        updated_mean=mean,
        centroid_camera=observation.position_camera,
        mask_index=index,
    )


def _age(targets: Sequence[_Target], detections: int) -> list[_Target]:
    """Count missed frames and end tracks; see the module's text for what is wrong with it.

    Args:
        targets: after this frame's updates, at least as many as detections.
        detections: their number.
    """
    if detections == 0:
        aged = [replace(target, missed=target.missed + 1) for target in targets]
        return [target for target in aged if target.missed <= ORIGINAL.max_misses]
    places = range(len(targets) - detections)
    aged = [
        replace(target, missed=target.missed + 2) if place in places and target.track.misses > 0 else target
        for place, target in enumerate(targets)
    ]
    return [target for target in aged if target.missed < ORIGINAL.max_misses]


def _classify(before: _State, after: _State) -> _State:
    previous = {target.track.track_id: target.track for target in before.targets}
    targets = []
    for target in after.targets:
        track = target.track
        targets.append(replace(target, track=replace(track, verdict=_verdict(track, previous.get(track.track_id)))))
    return replace(after, targets=tuple(targets))


def _verdict(track: Track, previous: Track | None) -> Verdict:
    """Moving if any axis of the velocity is above the threshold, or if a person that is not changes its shape.

    The first frame of a track is never moving, so a new mover reaches odometry once. An unseen track keeps its verdict.
    """
    speed = float(np.linalg.norm(track.velocity_world))
    if previous is None:
        return Verdict(is_moving=False, reason=Reason.NEW, speed_m_s=speed, mask_iou=None)
    if track.misses > 0 and previous.verdict is not None:
        return replace(previous.verdict, speed_m_s=speed, mask_iou=None)
    model = _model(track.class_name)
    if np.abs(track.velocity_world).max() > model.speed_threshold_m_s:
        return Verdict(is_moving=True, reason=Reason.SPEED, speed_m_s=speed, mask_iou=None)
    iou = centred_iou(previous.mask, track.mask) if model.is_non_rigid else None
    is_deformed = iou is not None and iou < ORIGINAL.deformation_iou
    reason = Reason.DEFORMATION if is_deformed else Reason.IDLE
    return Verdict(is_moving=is_deformed, reason=reason, speed_m_s=speed, mask_iou=iou)


def _model(class_name: str) -> ClassModel:
    """Of persons, or of everything else: the program knows no third."""
    return ORIGINAL.class_model("person" if class_name == "person" else "chair")


def _cut_to_box(mask: MaskImage) -> MaskImage:
    u, v, width, height = cv2.boundingRect(mask.view(np.uint8))
    return mask[v : v + height, u : u + width]
