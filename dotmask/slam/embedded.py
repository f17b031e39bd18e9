"""The embedded SLAM back end: RGB-D odometry, keyframes, loop closure and a pose graph."""

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from dotmask.geometry import transform
from dotmask.records import (
    FloatArray,
    Intrinsics,
    MaskedDepth,
    PoseEstimate,
    RgbdFrame,
    SlamResult,
    SlamStatus,
    Trajectory,
    check_finite,
    checked,
)
from dotmask.slam.features import FeatureExtractor, Features
from dotmask.slam.frame_check import check_next_frame
from dotmask.slam.keyframes import Keyframe, KeyframeStore
from dotmask.slam.loop_closing import LoopClosing
from dotmask.slam.odometry import Odometry, OdometryResult
from dotmask.slam.settings import LoopSettings, OdometrySettings
from dotmask.slam.vocabulary import load_vocabulary

_DEFAULT_SETTINGS = OdometrySettings()
_DEFAULT_LOOP_SETTINGS = LoopSettings()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Seen:
    """What odometry found in the last frame; mapping goes on from it."""

    features: Features
    odometry: OdometryResult


class _Pose(NamedTuple):
    """What odometry said of one frame."""

    frame_index: int
    timestamp_s: float
    T_world_camera: FloatArray


class EmbeddedSlam:
    """A `SlamBackend` that needs no other program and gives the same poses, bit for bit, in every run.

    Odometry uses corners with depth in MO-MDI. Keyframes hold corners with depth in MDI; loops are found among them.
    The poses that `track` returns are those of odometry, and no loop makes them jump; `finish` closes the loops.

    Args:
        intrinsics: of all frames.
        initial_T_world_camera: (4, 4) pose of the camera at the first frame; it ties the map to the world.
        settings: parameters of odometry and of keyframes.
        loop_settings: parameters of loop closure.

    Raises:
        ValueError: the initial pose is not a finite 4x4 matrix.
        VocabularyError: the visual vocabulary that comes with the package is missing or damaged.
    """

    def __init__(
        self,
        intrinsics: Intrinsics,
        initial_T_world_camera: FloatArray,
        settings: OdometrySettings = _DEFAULT_SETTINGS,
        loop_settings: LoopSettings = _DEFAULT_LOOP_SETTINGS,
    ) -> None:
        start = checked(initial_T_world_camera, "initial_T_world_camera", (4, 4), np.float64)
        check_finite(start, "initial_T_world_camera")
        self._camera, self._settings = intrinsics, settings
        self._extractor = FeatureExtractor(intrinsics, settings)
        self._odometry = Odometry(intrinsics, start, settings)
        self._store = KeyframeStore(intrinsics, settings)
        self._vocabulary = load_vocabulary()
        self._loops = LoopClosing(intrinsics, self._vocabulary, settings, loop_settings)
        self._started, self._is_lost = False, False
        self._last_time_s: float | None = None
        self._seen: _Seen | None = None
        self._poses: list[_Pose] = []

    @property
    def keyframes(self) -> tuple[Keyframe, ...]:
        """The keyframes in the order of time, at most `settings.max_keyframes` (about 80 kB each)."""
        return self._store.keyframes

    def track(self, frame: RgbdFrame, masked: MaskedDepth) -> PoseEstimate:
        """Pose of the camera at `frame`.

        The status is `INITIALISING` with the initial pose on the first frame that has enough features, `TRACKED` when
        a pose was found by the motion before, `RELOCALISED` when it was found after a loss or by looks alone, and else
        `LOST` without a pose; the next frame is then tried from the last pose found.

        Raises:
            ValueError: the frame has other intrinsics, the masked depth another size, or the time does not rise.
        """
        check_next_frame(frame, masked, self._camera, self._last_time_s)
        self._last_time_s = frame.timestamp_s
        grey = np.asarray(cv2.cvtColor(frame.rgb, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
        features = self._extractor.extract(grey, masked.mo_mdi_m)
        if self._started:
            result = self._odometry.track(features, frame.timestamp_s)
            if result is None:
                result = self._relocalise(features, frame.timestamp_s)
            found_again = self._is_lost or (result is not None and result.is_relocalised)
            status = SlamStatus.RELOCALISED if found_again else SlamStatus.TRACKED
        else:
            self._started = len(features) >= self._settings.min_inliers
            result = self._odometry.start(features, frame.timestamp_s) if self._started else None
            status = SlamStatus.INITIALISING
        self._seen, self._is_lost = None, self._started and result is None
        if result is None:
            return PoseEstimate(timestamp_s=frame.timestamp_s, T_world_camera=None, status=SlamStatus.LOST, inliers=0)
        self._seen = _Seen(features=features, odometry=result)
        self._poses.append(_Pose(frame.index, frame.timestamp_s, result.T_world_camera))
        return PoseEstimate(
            timestamp_s=frame.timestamp_s,
            T_world_camera=result.T_world_camera,
            status=status,
            inliers=result.inliers,
            covariance=result.covariance,
        )

    def update_map(self, frame: RgbdFrame, masked: MaskedDepth) -> None:
        """Keep the frame as a keyframe when the camera has moved enough, and look for a loop from it.

        Nothing happens while lost.
        """
        seen = self._seen
        if seen is None or not self._store.is_due(seen.odometry.T_world_camera):
            return
        features = self._extractor.within(seen.features, masked.mdi_m)
        words = self._vocabulary.words_of(features.descriptors)
        dropped = self._store.add(
            frame.index,
            frame.timestamp_s,
            seen.odometry.T_world_camera,
            seen.odometry.covariance,
            features,
            words,
            masked.mdi_m,
        )
        self._loops.add(self._store.keyframes[-1], dropped)

    def finish(self) -> SlamResult:
        """The poses of all frames that were not lost, with the loops closed: each moves with the keyframe before it."""
        closed, poses = self._loops.close(), self._poses
        return SlamResult(
            trajectory=Trajectory(
                timestamps_s=np.array([pose.timestamp_s for pose in poses], np.float64),
                T_world_camera=closed.corrected(
                    [pose.frame_index for pose in poses], [pose.T_world_camera for pose in poses]
                ),
            ),
            loops=closed.loops,
        )

    def _relocalise(self, features: Features, time_s: float) -> OdometryResult | None:
        """Find the place among the keyframes, whose points the local map may have lost."""
        for keyframe in self._loops.places_like(features):
            p_world = transform(keyframe.T_world_camera, keyframe.p_camera.astype(np.float64))
            result = self._odometry.relocalise(p_world, keyframe.descriptors, features, time_s)
            if result is not None:
                return result
        return None
