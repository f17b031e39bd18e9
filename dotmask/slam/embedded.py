"""The embedded SLAM back end: RGB-D odometry and keyframes on OpenCV and NumPy."""

from dataclasses import dataclass

import cv2
import numpy as np

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
from dotmask.slam.features import FeatureExtractor, Features, GreyImage
from dotmask.slam.keyframes import Keyframe, KeyframeStore
from dotmask.slam.odometry import Odometry
from dotmask.slam.settings import OdometrySettings

_DEFAULT_SETTINGS = OdometrySettings()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Seen:
    """What odometry found in the last frame; mapping goes on from it."""

    grey: GreyImage
    features: Features
    T_world_camera: FloatArray


class EmbeddedSlam:
    """A `SlamBackend` that needs no other program and gives the same poses, bit for bit, in every run.

    Odometry uses corners with depth in MO-MDI. Keyframes hold corners with depth in MDI; they are what loop closure
    and the pose graph work on. The poses that `track` returns are those of odometry.

    Args:
        intrinsics: of all frames.
        initial_T_world_camera: (4, 4) pose of the camera at the first frame; it ties the map to the world.
        settings: parameters.

    Raises:
        ValueError: the initial pose is not a finite 4x4 matrix.
    """

    def __init__(
        self,
        intrinsics: Intrinsics,
        initial_T_world_camera: FloatArray,
        settings: OdometrySettings = _DEFAULT_SETTINGS,
    ) -> None:
        start = checked(initial_T_world_camera, "initial_T_world_camera", (4, 4), np.float64)
        check_finite(start, "initial_T_world_camera")
        self._camera, self._settings = intrinsics, settings
        self._extractor = FeatureExtractor(intrinsics, settings)
        self._odometry = Odometry(intrinsics, start, settings)
        self._store = KeyframeStore(intrinsics, settings)
        self._started, self._is_lost = False, False
        self._last_time_s: float | None = None
        self._seen: _Seen | None = None
        self._poses: list[tuple[float, FloatArray]] = []

    @property
    def keyframes(self) -> tuple[Keyframe, ...]:
        """The keyframes in the order of time, at most `settings.max_keyframes` (about 50 kB each)."""
        return self._store.keyframes

    def track(self, frame: RgbdFrame, masked: MaskedDepth) -> PoseEstimate:
        """Pose of the camera at `frame`.

        The status is `INITIALISING` with the initial pose on the first frame that has enough features, `TRACKED` when
        a pose was found by the motion before, `RELOCALISED` when it was found after a loss or by looks alone, and else
        `LOST` without a pose; the next frame is then tried from the last pose found.

        Raises:
            ValueError: the frame has other intrinsics, the masked depth another size, or the time does not rise.
        """
        self._check(frame, masked)
        self._last_time_s = frame.timestamp_s
        grey = np.asarray(cv2.cvtColor(frame.rgb, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
        features = self._extractor.extract(grey, masked.mo_mdi_m)
        if self._started:
            result = self._odometry.track(features, frame.timestamp_s)
            found_again = self._is_lost or (result is not None and result.is_relocalised)
            status = SlamStatus.RELOCALISED if found_again else SlamStatus.TRACKED
        else:
            self._started = len(features) >= self._settings.min_inliers
            result = self._odometry.start(features, frame.timestamp_s) if self._started else None
            status = SlamStatus.INITIALISING
        self._seen, self._is_lost = None, self._started and result is None
        if result is None:
            return PoseEstimate(timestamp_s=frame.timestamp_s, T_world_camera=None, status=SlamStatus.LOST, inliers=0)
        self._seen = _Seen(grey=grey, features=features, T_world_camera=result.T_world_camera)
        self._poses.append((frame.timestamp_s, result.T_world_camera))
        return PoseEstimate(
            timestamp_s=frame.timestamp_s,
            T_world_camera=result.T_world_camera,
            status=status,
            inliers=result.inliers,
            covariance=result.covariance,
        )

    def update_map(self, frame: RgbdFrame, masked: MaskedDepth) -> None:
        """Keep the frame as a keyframe when the camera has moved enough; nothing happens while lost."""
        seen = self._seen
        if seen is None or not self._store.is_due(seen.T_world_camera):
            return
        # Where both depths are masked alike, odometry has found the corners already.
        same = np.array_equal(masked.mdi_m, masked.mo_mdi_m)
        features = seen.features if same else self._extractor.extract(seen.grey, masked.mdi_m)
        self._store.add(frame.index, frame.timestamp_s, seen.T_world_camera, features)

    def finish(self) -> SlamResult:
        """The poses of all frames that were not lost."""
        return SlamResult(
            trajectory=Trajectory(
                timestamps_s=np.array([t for t, _ in self._poses], np.float64),
                T_world_camera=np.array([p for _, p in self._poses], np.float64).reshape(-1, 4, 4),
            ),
            loops=(),
        )

    def _check(self, frame: RgbdFrame, masked: MaskedDepth) -> None:
        if frame.intrinsics != self._camera:
            raise ValueError(f"frame {frame.index}: its intrinsics are not those the back end was made for")
        if masked.mo_mdi_m.shape != frame.depth_m.shape:
            raise ValueError(f"frame {frame.index}: masked depth of {masked.mo_mdi_m.shape}, not {frame.depth_m.shape}")
        if self._last_time_s is not None and frame.timestamp_s <= self._last_time_s:
            raise ValueError(f"frame {frame.index}: time {frame.timestamp_s} is not after {self._last_time_s}")
