"""Points on the objects' surfaces, followed from frame to frame: how fast an object moves, and which part of it.

The box of an object says where it is; but when something hides a side of it, the box shrinks and its centre moves,
though the object stands. Corners of its texture stay where they are on the object. They are followed by pyramidal
Lucas-Kanade flow (Bouguet 2000, "Pyramidal implementation of the Lucas Kanade feature tracker"), lifted into the
world by depth and camera pose, and compared with where they were up to some frames ago.

Not in the paper, whose classification of an object rests on the track's speed and on consecutive masks.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from dotmask.geometry import back_project, inverse, project, transform
from dotmask.profiles import ClassModel, MeasurementNoise, SurfaceSettings
from dotmask.records import ColourImage, DepthImage, Detections, FloatArray, Intrinsics, RgbdFrame, SurfaceMotion
from dotmask.tracking.surface_kernels import is_held, object_motions, owners, steady_depth

_SCALE = 2
"""Points are followed in the image at half its size."""
_WINDOW_PX, _LEVELS = 11, 3
_FLOW_STOP = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 10, 0.03)
_MOST_DIFFERENCE = 8.0
"""Mean difference in grey levels between the surroundings of a point then and now; more, and it was not found again."""
_BORDER_PX = 2
"""Points keep off a mask's border by so many pixels of the half size image: there, the background moves with them."""
_MARGIN_PX = _WINDOW_PX // 2 - _BORDER_PX
"""With that, the window around a point lies in the image: at the image's border points slide."""
_CORNER_QUALITY, _CORNER_DISTANCE_PX, _HARRIS_K = 0.001, 4, 0.04
"""By the measure of Harris and Stephens (1988), which refuses edges: a point would slide along a stripe."""
_LEAST_HOLD = 0.1
"""Of the window that is searched for; Harris and Stephens look at three pixels, where the corner of a stripe is one."""
_SPREAD = 0.6
"""Corners keep this share of the distance that they would have if they were spread evenly: they are found on the arms
as well as on the print of a shirt."""
_DEPTH_JUMP_M = 0.3
"""A point whose depth changes by more from one frame to the next has slipped off its object."""
_DEPTH_STEP_M = 0.05
"""Neighbouring pixels within this belong to the same surface."""
_LEAST_NEIGHBOURS = 5

GreyImage = npt.NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SurfacePoints:
    """Points on the objects of one frame, and where they were before.

    Attributes:
        timestamp_s: of the frame.
        grey: (h, w) uint8, the image at half its size.
        pixels: (N, 2) float32 u, v in `grey`.
        p_camera: (N, 3) metres, camera frame.
        detection_index: (N,) whose mask each lies in.
        past_world: (N, K, 3) positions in the world in the frames before, the latest first, metres; NaN where a point
            was not followed yet.
        past_pixels: (N, K, 2) where they were then in the half size image.
        past_s: (K,) stamps of those frames; NaN before the first.
    """

    timestamp_s: float
    grey: GreyImage
    pixels: npt.NDArray[np.float32]
    p_camera: FloatArray
    detection_index: npt.NDArray[np.intp]
    past_world: FloatArray
    past_pixels: npt.NDArray[np.float32]
    past_s: FloatArray


def follow(
    before: SurfacePoints | None,
    frame: RgbdFrame,
    detections: Detections,
    T_world_camera_before: FloatArray | None,
    T_world_camera: FloatArray,
    settings: SurfaceSettings,
) -> SurfacePoints:
    """The points of the frame before that are still seen on an object, and new ones where there are too few.

    Args:
        before: of the frame before; None at the start.
        frame: the next one.
        detections: of `frame`.
        T_world_camera_before: (4, 4) pose of the frame before, as odometry found it; None at the start.
        T_world_camera: (4, 4) pose of `frame` as predicted: the search begins where a point would be at rest, so that
            it finds points of a turning camera.
        settings: parameters.
    """
    grey = _half_size(frame.rgb)
    frames = _frames(detections.boxes_px, grey.shape)
    memory = settings.memory_frames
    past_s = np.full(memory, np.nan)
    pixels, owner, p_camera = np.zeros((0, 2), np.float32), np.zeros(0, np.intp), np.zeros((0, 3))
    kept, world = np.zeros(0, np.intp), np.zeros((0, 3))
    if before is not None and T_world_camera_before is not None:
        past_s = np.concatenate([[before.timestamp_s], before.past_s[:-1]])
        if len(before.pixels):
            world = transform(T_world_camera_before, before.p_camera)
            expected = project(transform(inverse(T_world_camera), world), frame.intrinsics)
            pixels, found = _flow(before, grey, _half_pixels(expected))
            owner = owners(pixels, frames, detections.masks, _SCALE, _BORDER_PX)
            p_camera = _lift(pixels, frame.depth_m, frame.intrinsics)
            is_kept = found & (owner >= 0) & (p_camera[:, 2] > 0)
            is_kept &= np.abs(p_camera[:, 2] - before.p_camera[:, 2]) < _DEPTH_JUMP_M
            kept = np.flatnonzero(is_kept)
            pixels, owner, p_camera = pixels[kept], owner[kept], p_camera[kept]
    counts = np.bincount(owner, minlength=len(frames)).tolist()
    for index in _served(counts, frame.index):
        region = _inner_region(frames[index], detections.masks[index])
        fresh = _corners(grey, region, pixels[owner == index], settings.points)
        if len(fresh):
            fresh_camera = _lift(fresh, frame.depth_m, frame.intrinsics)
            is_usable = (fresh_camera[:, 2] > 0) & is_held(grey, fresh, _WINDOW_PX // 2, _LEAST_HOLD)
            pixels = np.concatenate([pixels, fresh[is_usable]])
            p_camera = np.concatenate([p_camera, fresh_camera[is_usable]])
            owner = np.concatenate([owner, np.full(np.count_nonzero(is_usable), index)])
    past_world = np.full((len(pixels), memory, 3), np.nan)
    past_pixels = np.full((len(pixels), memory, 2), np.nan, np.float32)
    if before is not None and len(kept):
        past_world[: len(kept), 0], past_world[: len(kept), 1:] = world[kept], before.past_world[kept, :-1]
        past_pixels[: len(kept), 0], past_pixels[: len(kept), 1:] = before.pixels[kept], before.past_pixels[kept, :-1]
    return SurfacePoints(
        timestamp_s=frame.timestamp_s,
        grey=grey,
        pixels=pixels,
        p_camera=p_camera,
        detection_index=owner,
        past_world=past_world,
        past_pixels=past_pixels,
        past_s=past_s,
    )


def surface_motions(
    points: SurfacePoints,
    models: Sequence[ClassModel],
    T_world_camera: FloatArray,
    intrinsics: Intrinsics,
    noise: MeasurementNoise,
    settings: SurfaceSettings,
) -> tuple[SurfaceMotion | None, ...]:
    """How the surface of each detection moves in the world; None where too few points are known from before.

    A point counts as moving if it left the pixel that it would be seen at, had it stood still since it was first
    followed (or for half of that time), by more than the flow's noise, and faster than the class's threshold. What
    comes straight at the camera hardly does: its velocity tells.

    Args:
        points: of this frame.
        models: the class of each detection.
        T_world_camera: (4, 4) pose of this frame.
        intrinsics: of the camera.
        noise: of depth and pose.
        settings: parameters.
    """
    motions: list[SurfaceMotion | None] = [None] * len(models)
    elapsed_s = points.timestamp_s - points.past_s
    counts, moving, lags, lags_s, middles, spreads = object_motions(
        _full_pixels(points.pixels),
        points.p_camera,
        points.detection_index,
        points.past_world,
        _full_pixels(points.past_pixels),
        elapsed_s,
        np.array([model.speed_threshold_m_s for model in models], np.float64),
        T_world_camera,
        (intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy),
        (settings.flow_sigma_px, settings.flow_sigma_share, settings.flow_sigmas),
        max(1, int(np.count_nonzero(elapsed_s <= settings.velocity_s))),
    )
    R_world_camera = T_world_camera[:3, :3]
    for index in np.flatnonzero(counts >= max(settings.least_points, 1)).tolist():
        count = int(counts[index])
        # 1.25: a median is less efficient than a mean. The frames between two samples of one point overlap.
        sigma = 1.25 * 1.4826 * spreads[index] * np.sqrt((1.0 + lags[index]) / count)
        floor = np.hypot(models[index].surface_sigma_m_s, noise.pose_position_sigma_m / lags_s[index])
        motions[index] = SurfaceMotion(
            points=count,
            moving_points=int(moving[index]),
            velocity_world=R_world_camera @ middles[index],
            covariance=(R_world_camera * (sigma**2 + floor**2)) @ R_world_camera.T,
        )
    return tuple(motions)


@dataclass(frozen=True, slots=True, eq=False)
class _Region:
    """A mask at half size without its border, cut to its box: `inside[v - top, u - left]`."""

    left: int
    top: int
    inside: npt.NDArray[np.uint8]


def _half_size(rgb: ColourImage) -> GreyImage:
    size = (rgb.shape[1] // _SCALE, rgb.shape[0] // _SCALE)
    return np.asarray(cv2.resize(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY), size, interpolation=cv2.INTER_AREA), np.uint8)


def _full_pixels(half: npt.NDArray[np.float32]) -> FloatArray:
    """(..., 2) pixels of the image of pixels (..., 2) of the one at half its size."""
    return np.asarray(_SCALE * half.astype(np.float64) + 0.5 * (_SCALE - 1))


def _half_pixels(full: FloatArray) -> npt.NDArray[np.float32]:
    """The inverse of `_full_pixels`."""
    return ((full - 0.5 * (_SCALE - 1)) / _SCALE).astype(np.float32)


def _flow(
    before: SurfacePoints, grey: GreyImage, expected: npt.NDArray[np.float32]
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.bool_]]:
    """Where the points are in `grey` (N, 2), and whether each was found (N,).

    A point is looked for where it would be at rest (`expected`) first, and through the pyramid only if it is not there:
    the coarse levels would lead it into the next stripe of a shirt.
    """
    start = np.where(np.isfinite(expected), expected, before.pixels)
    pixels, found = _searched(before.grey, grey, before.pixels, start, 0)
    gone = np.flatnonzero(~found)
    if len(gone):
        pixels[gone], found[gone] = _searched(before.grey, grey, before.pixels[gone], start[gone], _LEVELS)
    return pixels, found


def _searched(
    before: GreyImage, now: GreyImage, pixels: npt.NDArray[np.float32], start: npt.NDArray[np.float32], levels: int
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.bool_]]:
    found_at, found, difference = cv2.calcOpticalFlowPyrLK(
        before,
        now,
        pixels,
        start.copy(),
        winSize=(_WINDOW_PX, _WINDOW_PX),
        maxLevel=levels,
        criteria=_FLOW_STOP,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    is_alike = np.asarray(difference)[:, 0] <= _MOST_DIFFERENCE
    return np.asarray(found_at, np.float32), (np.asarray(found)[:, 0] == 1) & is_alike


def _frames(boxes_px: FloatArray, size: tuple[int, ...]) -> npt.NDArray[np.intp]:
    """(N, 4) first and last column, first and last row of the image of `size` (h, w) where each box may have points."""
    within = np.clip(boxes_px, 0, _SCALE * max(size))  # a box may be far larger than any whole number
    u_min, v_min, u_max, v_max = within.astype(np.intp).T // _SCALE
    last_column, last_row = size[1] - 1 - _MARGIN_PX, size[0] - 1 - _MARGIN_PX
    left, top = np.maximum(u_min, _MARGIN_PX), np.maximum(v_min, _MARGIN_PX)
    return np.stack([left, np.minimum(u_max, last_column), top, np.minimum(v_max, last_row)], axis=1)


def _inner_region(frame: npt.NDArray[np.intp], mask: npt.NDArray[np.bool_]) -> _Region:
    left, right, top, bottom = frame.tolist()
    rows = slice(_SCALE * top, _SCALE * max(bottom + 1, top), _SCALE)
    columns = slice(_SCALE * left, _SCALE * max(right + 1, left), _SCALE)
    part = np.ascontiguousarray(mask[rows, columns]).view(np.uint8)
    window = np.ones((2 * _BORDER_PX + 1, 2 * _BORDER_PX + 1), np.uint8)
    inside = cv2.erode(part, window, borderType=cv2.BORDER_CONSTANT, borderValue=0) if part.size else part
    return _Region(left, top, np.asarray(inside, np.uint8))


def _served(counts: Sequence[int], frame_index: int) -> set[int]:
    """Which objects get new corners in this frame: those that have no points, and the others by turns.

    Corners take time to find, and an object loses few points from one frame to the next.
    """
    turn = {frame_index % len(counts)} if counts else set()
    return turn | {i for i, count in enumerate(counts) if count == 0}


def _corners(grey: GreyImage, region: _Region, have: npt.NDArray[np.float32], wanted: int) -> npt.NDArray[np.float32]:
    """(M, 2) new corners in a region, away from the points that it has."""
    height, width = region.inside.shape
    area = cv2.countNonZero(region.inside)
    if area == 0 or len(have) >= wanted:
        return np.zeros((0, 2), np.float32)
    distance_px = max(_CORNER_DISTANCE_PX, int(_SPREAD * np.sqrt(area / wanted)))
    free = region.inside
    if len(have):
        free = region.inside.copy()
        for u, v in np.rint(have).astype(int) - (region.left, region.top):
            cv2.circle(free, (int(u), int(v)), distance_px, 0, -1)
    patch = np.ascontiguousarray(grey[region.top : region.top + height, region.left : region.left + width])
    found = cv2.goodFeaturesToTrack(
        patch,
        wanted - len(have),
        _CORNER_QUALITY,
        distance_px,
        mask=free,
        useHarrisDetector=True,
        k=_HARRIS_K,
    )
    if found is None:
        return np.zeros((0, 2), np.float32)
    return np.asarray(found[:, 0] + np.array([region.left, region.top], np.float32), np.float32)


def _lift(pixels: npt.NDArray[np.float32], depth_m: DepthImage, intrinsics: Intrinsics) -> FloatArray:
    """(N, 3) camera-frame points of pixels of the half size image; z = 0 where there is no steady depth."""
    full = _full_pixels(pixels)
    return back_project(full, steady_depth(full, depth_m, _DEPTH_STEP_M, _LEAST_NEIGHBOURS), intrinsics)
