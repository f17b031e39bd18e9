"""Keyframes: what is kept of chosen frames for loop closure and the pose graph."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dotmask.geometry import back_project
from dotmask.records import DepthImage, FloatArray, Intrinsics
from dotmask.slam.coarse_depth import CoarseDepth
from dotmask.slam.features import Descriptors, Features
from dotmask.slam.settings import OdometrySettings
from dotmask.slam.vocabulary import WordIds


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Keyframe:
    """A frame of the map. Images are not kept, so that memory does not grow with the image size.

    Attributes:
        number: running number of the keyframe, from 0.
        frame_index: index of the frame.
        timestamp_s: its time, seconds.
        T_world_camera: (4, 4) pose by odometry.
        covariance: (6, 6) of it, see `OdometryResult`.
        pixels: (N, 2) float32, corners where the mapping depth (MDI) is valid.
        p_camera: (N, 3) float32, their positions in the camera frame, metres.
        descriptors: (N, 32) uint8.
        words: (N,) the visual word of each.
        depth: samples of the mapping depth.
    """

    number: int
    frame_index: int
    timestamp_s: float
    T_world_camera: FloatArray
    covariance: FloatArray
    pixels: npt.NDArray[np.float32]
    p_camera: npt.NDArray[np.float32]
    descriptors: Descriptors
    words: WordIds
    depth: CoarseDepth

    @property
    def features(self) -> Features:
        """The corners as an image's."""
        return Features(
            pixels=self.pixels.astype(np.float64),
            descriptors=self.descriptors,
            depth_m=self.p_camera[:, 2].astype(np.float64),
        )


class KeyframeStore:
    """The keyframes in the order of time, at most `settings.max_keyframes`.

    Args:
        intrinsics: of the camera.
        settings: when a keyframe is due, and how many are kept.
    """

    def __init__(self, intrinsics: Intrinsics, settings: OdometrySettings) -> None:
        self._camera, self._settings = intrinsics, settings
        self._keyframes: list[Keyframe] = []
        self._made = 0

    @property
    def keyframes(self) -> tuple[Keyframe, ...]:
        """All that are kept."""
        return tuple(self._keyframes)

    def is_due(self, T_world_camera: FloatArray) -> bool:
        """Whether the camera has moved or turned enough since the last keyframe."""
        if not self._keyframes:
            return True
        distance_m, angle_rad = motion(self._keyframes[-1].T_world_camera, T_world_camera)
        s = self._settings
        return bool(distance_m >= s.keyframe_distance_m or angle_rad >= s.keyframe_angle_rad)

    def add(
        self,
        frame_index: int,
        timestamp_s: float,
        T_world_camera: FloatArray,
        covariance: FloatArray,
        features: Features,
        words: WordIds,
        depth_m: DepthImage,
    ) -> Keyframe | None:
        """Append a keyframe; beyond the bound, the one whose neighbours are nearest to each other is dropped.

        Args:
            frame_index: of the frame.
            timestamp_s: of the frame.
            T_world_camera: (4, 4) its pose by odometry.
            covariance: (6, 6) of the pose.
            features: its corners in the mapping depth.
            words: (N,) their visual words.
            depth_m: (H, W) the mapping depth.

        Returns:
            The one that was dropped, if any.
        """
        self._keyframes.append(
            Keyframe(
                number=self._made,
                frame_index=frame_index,
                timestamp_s=timestamp_s,
                T_world_camera=T_world_camera,
                covariance=covariance,
                pixels=features.pixels.astype(np.float32),
                p_camera=back_project(features.pixels, features.depth_m, self._camera).astype(np.float32),
                descriptors=features.descriptors,
                words=words,
                depth=CoarseDepth.of(depth_m, self._camera),
            )
        )
        self._made += 1
        if len(self._keyframes) <= self._settings.max_keyframes:
            return None
        return self._keyframes.pop(self._most_redundant())

    def _most_redundant(self) -> int:
        """Index of the keyframe whose removal leaves the smallest gap; never the first or the last."""
        T_world_camera = np.array([keyframe.T_world_camera for keyframe in self._keyframes])
        distance_m, angle_rad = motion(T_world_camera[:-2], T_world_camera[2:])
        gaps = distance_m / self._settings.keyframe_distance_m + angle_rad / self._settings.keyframe_angle_rad
        return int(np.argmin(gaps)) + 1


def motion(T_world_a: FloatArray, T_world_b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Distance in metres and angle in radians between poses (..., 4, 4), each (...)."""
    distance_m = np.linalg.norm(T_world_b[..., :3, 3] - T_world_a[..., :3, 3], axis=-1)
    R_a_b = np.swapaxes(T_world_a[..., :3, :3], -1, -2) @ T_world_b[..., :3, :3]
    # Twice the cosine from the trace, twice the sine from what is not symmetric: good for small and large angles.
    cosine = np.trace(R_a_b, axis1=-2, axis2=-1) - 1
    skew = R_a_b - np.swapaxes(R_a_b, -1, -2)
    sine = np.sqrt(skew[..., 2, 1] ** 2 + skew[..., 0, 2] ** 2 + skew[..., 1, 0] ** 2)
    return distance_m, np.arctan2(sine, cosine)
