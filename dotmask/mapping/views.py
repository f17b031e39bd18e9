"""The views that a map is built from: a bounded choice of the frames, kept whole until all poses are optimised."""

import zlib
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from dotmask.mapping.settings import MappingSettings
from dotmask.records import ColourImage, DepthImage, FloatArray, Intrinsics, RgbdFrame, Trajectory

SAME_TIME_S = 1e-6
"""A pose is of a view if their stamps differ by no more than this."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class View:
    """One frame, compressed without loss: float32 depth by zlib, colour as PNG.

    Depth is not stored in steps of a length: whatever the steps of a sensor, the map is built from the very numbers
    that SLAM was given.

    Attributes:
        index: of the frame.
        timestamp_s: of the frame, seconds.
        intrinsics: of both images.
        packed_depth: the depth image.
        packed_rgb: the colour image.
    """

    index: int
    timestamp_s: float
    intrinsics: Intrinsics
    packed_depth: bytes
    packed_rgb: bytes

    @classmethod
    def of(cls, frame: RgbdFrame, depth_m: DepthImage) -> "View":
        """Pack the colour of `frame` and a depth image (H, W) of it, metres, 0 = none."""
        _, png = cv2.imencode(".png", frame.rgb, [cv2.IMWRITE_PNG_COMPRESSION, 1])
        return cls(
            index=frame.index,
            timestamp_s=frame.timestamp_s,
            intrinsics=frame.intrinsics,
            packed_depth=zlib.compress(np.ascontiguousarray(depth_m, np.float32).tobytes(), 1),
            packed_rgb=png.tobytes(),
        )

    @property
    def depth_m(self) -> DepthImage:
        """(H, W) float32, metres, 0 = none."""
        size = (self.intrinsics.height, self.intrinsics.width)
        return np.frombuffer(zlib.decompress(self.packed_depth), np.float32).reshape(size)

    @property
    def rgb(self) -> ColourImage:
        """(H, W, 3) uint8."""
        # Neither OpenCV's writer nor its reader is told about the order of the channels, so it comes back as it was.
        image = cv2.imdecode(np.frombuffer(self.packed_rgb, np.uint8), cv2.IMREAD_COLOR)
        assert image is not None
        return np.asarray(image, np.uint8)

    @property
    def packed_bytes(self) -> int:
        """Size of both images in memory."""
        return len(self.packed_depth) + len(self.packed_rgb)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PosedView:
    """A view and where it was taken.

    Attributes:
        view: the images.
        T_world_camera: (4, 4).
    """

    view: View
    T_world_camera: FloatArray


class ViewKeeper:
    """Chooses the views while the frames go by.

    A frame is kept when the camera has moved, turned or waited enough since the last one that was kept. When there are
    more than `settings.most_views`, the view that is most like another one is dropped: two views differ by what lies
    between them of way, angle and time, each as a share of its step.

    Args:
        settings: steps and the bound.
        dropped: told the index of each frame whose view is dropped again.
    """

    def __init__(self, settings: MappingSettings, dropped: Callable[[int], object] = lambda index: None) -> None:
        self._settings, self._dropped = settings, dropped
        self._views: list[View] = []
        self._places = np.empty((0, 8))  # per view: position, quaternion, time, in the order of the views
        self._last: FloatArray | None = None

    @property
    def views(self) -> tuple[View, ...]:
        """What is kept, in the order of time."""
        return tuple(self._views)

    def offer(self, frame: RgbdFrame, depth_m: DepthImage, T_world_camera: FloatArray | None) -> bool:
        """Keep the frame if it shows enough that is new; says whether it was kept.

        Args:
            frame: the next frame.
            depth_m: (H, W) its depth for the map (MDI), metres, 0 = none or masked.
            T_world_camera: (4, 4) the pose as it is known now, None while lost; a frame without pose is not kept.
        """
        if T_world_camera is None:
            return False
        here = np.array(
            [*T_world_camera[:3, 3], *Rotation.from_matrix(T_world_camera[:3, :3]).as_quat(), frame.timestamp_s]
        )
        settings = self._settings
        if self._last is not None and (_steps(self._last[None], here, settings) < 1.0).all():
            return False
        self._last = here
        self._views.append(View.of(frame, depth_m))
        self._places = np.concatenate([self._places, here[None]])
        if len(self._views) > settings.most_views:
            self._drop_one()
        return True

    def _drop_one(self) -> None:
        """Drop the later one of the two views that are most alike, but never the newest."""
        places = self._places
        nearest, which = np.inf, 0
        for later in range(1, len(places) - 1):
            difference = float(_steps(places[:later], places[later], self._settings).sum(axis=1).min())
            if difference < nearest:
                nearest, which = difference, later
        self._dropped(self._views.pop(which).index)
        self._places = np.delete(places, which, axis=0)


def _steps(places: FloatArray, here: FloatArray, settings: MappingSettings) -> FloatArray:
    """(N, 3) way, angle and time from each of `places` (N, 8) to `here` (8,), in steps."""
    way_m = np.linalg.norm(places[:, :3] - here[:3], axis=1)
    angle_rad = 2.0 * np.arccos(np.minimum(np.abs(places[:, 3:7] @ here[3:7]), 1.0))
    time_s = np.abs(places[:, 7] - here[7])
    return np.stack([way_m / settings.step_m, angle_rad / settings.step_rad, time_s / settings.step_s], axis=1)


def pose_views(views: tuple[View, ...], trajectory: Trajectory) -> tuple[PosedView, ...]:
    """The views that a trajectory knows the pose of; it may end up without some, where SLAM was lost.

    Args:
        views: what was kept.
        trajectory: the optimised poses.
    """
    times = trajectory.timestamps_s
    posed = []
    for view in views:
        at = int(np.searchsorted(times, view.timestamp_s - SAME_TIME_S))
        if at < len(times) and abs(times[at] - view.timestamp_s) <= SAME_TIME_S:
            posed.append(PosedView(view=view, T_world_camera=trajectory.T_world_camera[at]))
    return tuple(posed)
