"""From detections and depth to positions in the camera frame: z of the paper (Tracking Using EKF, Update)."""

from collections.abc import Sequence
from math import ceil, floor, isqrt
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from dotmask.geometry import back_project
from dotmask.profiles import Profile
from dotmask.records import DepthImage, Detections, FloatArray, Intrinsics, MaskImage, Observation, RgbdFrame
from dotmask.tracking.measurement_model import CAMERA_POINT, PixelDepth
from dotmask.tracking.measurement_noise import (
    box_centre_variance,
    centroid_variance,
    mean_depth_variance,
    measurement_covariances,
    median_depth_variance,
)

_BAND_PX = 8
"""How far outside a box an occluder is looked for: past the ring without depth that sensors leave at depth edges."""
_RIM_PX = 3
"""Mask pixels this close to a side of the box are what that side rests on."""
_LINES = 64
"""So many lines across a side are looked at."""
_SAMPLES = 4000
"""Of a box of more pixels a grid of at least so many is looked at."""
_MEDIAN_SAMPLES = 1000
_LEAST_DEPTH_M, _MOST_DEPTH_M = 1e-6, 1e6
"""What lies outside is no depth."""
_OTHER_MARGIN_M = 0.02
"""How much nearer another detection must be to count as an occluder."""

_ACROSS_PX = np.arange(-_BAND_PX, _RIM_PX)[:, None]
"""(A, 1) places along a line: from outside the box to inside of it."""
_ALONG = (np.arange(_LINES) + 0.5) / _LINES
"""(L,) places of the lines on a side, as shares of it."""


class _Crop(NamedTuple):
    """Whole pixels of a detection's box, clipped to the image; the stops are exclusive."""

    u_start: int
    u_stop: int
    v_start: int
    v_stop: int

    @property
    def is_empty(self) -> bool:
        return self.u_start >= self.u_stop or self.v_start >= self.v_stop

    @property
    def slices(self) -> tuple[slice, slice]:
        return slice(self.v_start, self.v_stop), slice(self.u_start, self.u_stop)

    def is_near(self, other: "_Crop", distance_px: int) -> bool:
        """Whether fewer than so many pixels lie between the two."""
        return (
            self.u_start - distance_px < other.u_stop
            and other.u_start - distance_px < self.u_stop
            and self.v_start - distance_px < other.v_stop
            and other.v_start - distance_px < self.v_stop
        )


def observe(detections: Detections, frame: RgbdFrame, profile: Profile) -> tuple[Observation, ...]:
    """Camera-frame positions of the detections of `frame`.

    `profile.measurement` says what is measured: `bbox_centre` is the paper's z: the mean depth `z_z` of the mask's
    pixels with depth, `z_x = (u - cx) z_z / fx` and `z_y` alike, with (u, v) the centre of the bounding box.
    `mask_centroid` takes the mean of the mask's pixels and their median depth instead. `pixel_depth` measures what the
    box centre's pixel and the mean depth are before the back-projection. R follows from the sensor's noise and, where
    the profile says so, from how the shape of the class changes. A detection with fewer than
    `profile.min_depth_pixels` pixels of valid depth, or with a box outside the image, gives no observation.

    Args:
        detections: with masks of the frame's size.
        frame: gives the depth.
        profile: what is measured, and how noisy it is.
    """
    crops = [_crop(box, frame.intrinsics) for box in detections.boxes_px.tolist()]
    seen, pixels, sensor_variances, shape_sigmas = [], [], [], []
    for index, crop in enumerate(crops):
        if crop.is_empty:
            continue
        mask = detections.masks[index][crop.slices]
        depth = _depth(mask, frame.depth_m[crop.slices], profile)
        if depth is None:
            continue
        centre, centre_variance = _centre(mask, detections.boxes_px[index], crop, profile)
        seen.append(index)
        pixels.append((*centre, depth[0]))
        sensor_variances.append((*centre_variance, depth[1]))
        shape_sigmas.append(profile.class_model(detections.class_names[index]).shape_sigma_m)
    if not seen:
        return ()
    model = PixelDepth(intrinsics=frame.intrinsics) if profile.measurement == "pixel_depth" else CAMERA_POINT
    measured = np.array(pixels)
    p_camera = back_project(measured[:, :2], measured[:, 2], frame.intrinsics)
    covariances = measurement_covariances(
        p_camera, np.array(sensor_variances), model, np.array(shape_sigmas), frame.intrinsics, profile.noise
    )
    hidden: Sequence[bool] = [False] * len(seen)
    if profile.noise.notices_hidden_sides:
        hidden = _hidden(seen, crops, detections.masks, frame.depth_m, measured[:, 2], profile.noise.occluder_margin_m)
    return tuple(
        Observation(
            position_camera=p,
            covariance=R,
            class_name=detections.class_names[index],
            detection_index=index,
            mask=detections.masks[index],
            model=model,
            is_partial=is_partial,
        )
        for index, p, R, is_partial in zip(seen, p_camera, covariances, hidden, strict=True)
    )


def _crop(box_px: Sequence[float], intrinsics: Intrinsics) -> _Crop:
    u_min, v_min, u_max, v_max = box_px
    return _Crop(
        u_start=max(floor(u_min), 0),
        u_stop=min(ceil(u_max) + 1, intrinsics.width),
        v_start=max(floor(v_min), 0),
        v_stop=min(ceil(v_max) + 1, intrinsics.height),
    )


def _centre(mask: MaskImage, box_px: FloatArray, crop: _Crop, profile: Profile) -> tuple[FloatArray, FloatArray]:
    """(2,) u and v of the box's centre or of the mask's centroid, pixels, and their variances (2,)."""
    if profile.measurement != "mask_centroid":
        return 0.5 * (box_px[:2] + box_px[2:]), box_centre_variance(profile.noise)
    moments = cv2.moments(mask.view(np.uint8), binaryImage=True)
    area = moments["m00"]
    centroid = np.array([moments["m10"] / area, moments["m01"] / area])
    return np.add(centroid, (crop.u_start, crop.v_start)), centroid_variance(mask, centroid, area, profile.noise)


def _depth(mask: MaskImage, depth_m: DepthImage, profile: Profile) -> tuple[float, float] | None:
    """Mean (of a mask's centroid: median) of the depths under the mask, without what is far from their median.

    Together with its variance, m and m²; None with too few pixels. Of a large mask a grid of pixels is enough, unless
    that holds too few.
    """
    step = _step(mask.size, _SAMPLES)
    answer = _sampled_depth(mask, depth_m, step, profile)
    return answer if answer is not None or step == 1 else _sampled_depth(mask, depth_m, 1, profile)


def _sampled_depth(mask: MaskImage, depth_m: DepthImage, step: int, profile: Profile) -> tuple[float, float] | None:
    """As `_depth`, from every so many-th pixel of every so many-th row."""
    if step > 1:
        mask, depth_m = np.ascontiguousarray(mask[::step, ::step]), np.ascontiguousarray(depth_m[::step, ::step])
    nearest, farthest = _LEAST_DEPTH_M, _MOST_DEPTH_M
    median, samples = None, 0
    if profile.depth_trim_m is not None or profile.measurement == "mask_centroid":
        # For the trim, a rough median is enough.
        coarse = 1 if profile.measurement == "mask_centroid" else _step(mask.size, _MEDIAN_SAMPLES)
        depths = depth_m[::coarse, ::coarse][mask[::coarse, ::coarse]]
        depths = depths[(depths >= nearest) & (depths <= farthest)]
        samples = len(depths)
        if samples:
            median = float(np.partition(depths, samples // 2)[samples // 2])
    if median is not None and profile.depth_trim_m is not None:
        nearest = max(median - profile.depth_trim_m, nearest)
        farthest = min(median + profile.depth_trim_m, farthest)
    is_used = np.asarray(cv2.bitwise_and(cv2.inRange(depth_m, nearest, farthest), mask.view(np.uint8)), np.uint8)
    pixels = cv2.countNonZero(is_used)
    if pixels < profile.min_depth_pixels:
        return None
    if median is not None and profile.measurement == "mask_centroid":
        return median, median_depth_variance(median, samples, profile.noise)
    mean = float(cv2.mean(depth_m, is_used)[0])
    return mean, mean_depth_variance(mean, depth_m, is_used, pixels, profile.noise)


def _step(pixels: int, samples: int) -> int:
    """Every so many-th pixel in both directions leaves at least `samples`, or all."""
    return max(1, isqrt(pixels // samples))


def _hidden(
    seen: Sequence[int],
    crops: Sequence[_Crop],
    masks: npt.NDArray[np.bool_],
    depth_m: DepthImage,
    distances_m: FloatArray,
    margin_m: float,
) -> list[bool]:
    """Whether the image border, or something nearer, hides a side of each of the objects `seen`.

    Args:
        seen: which detections are meant.
        crops: of all detections.
        masks: (N, H, W) of all detections; where two overlap, the pixel belongs to the later one.
        depth_m: (H, W).
        distances_m: (len(seen),) depths of the objects.
        margin_m: how much nearer than an object something that is no detection must be to count as an occluder and not
            as the floor before its feet; grows with the distance.
    """
    height, width = depth_m.shape
    is_hidden = [True] * len(seen)
    inside = []
    for place, index in enumerate(seen):
        u0, u1, v0, v1 = crop = crops[index]
        if u0 <= 1 or v0 <= 1 or u1 >= width - 1 or v1 >= height - 1:
            continue
        over = [j for j, other in enumerate(crops) if j != index and not other.is_empty and crop.is_near(other, 0)]
        if not over or not _is_covered(index, over, crop, masks, depth_m, float(distances_m[place])):
            inside.append(place)
    if inside:
        within = [seen[place] for place in inside]
        for place, answer in zip(
            inside, _ends_behind_occluder(within, crops, masks, depth_m, distances_m[inside], margin_m), strict=True
        ):
            is_hidden[place] = answer
    return is_hidden


def _is_covered(
    index: int,
    over: Sequence[int],
    crop: _Crop,
    masks: npt.NDArray[np.bool_],
    depth_m: DepthImage,
    distance_m: float,
) -> bool:
    """Whether other detections, nearer than the object, take more of its box than the object itself."""
    u0, u1, v0, v1 = crop
    grid = (slice(v0, v1, 1 + (v1 - v0) // _LINES), slice(u0, u1, 1 + (u1 - u0) // _LINES))
    own = masks[index][grid].copy()
    others = np.zeros_like(own)
    for j in over:
        mask = masks[j][grid]
        if j > index:
            own &= ~mask
        others |= mask
    depths = depth_m[grid]
    is_covered = others & ~own & (depths > 0) & (depths < distance_m)
    return bool(np.count_nonzero(is_covered) > np.count_nonzero(own))


def _ends_behind_occluder(
    within: Sequence[int],
    crops: Sequence[_Crop],
    masks: npt.NDArray[np.bool_],
    depth_m: DepthImage,
    distances_m: FloatArray,
    margin_m: float,
) -> list[bool]:
    """Whether most lines that reach one of the four sides of a box have something nearer right outside of it.

    The four sides of all boxes are looked at together: arrays are (M, 4, A, L), L lines across each side, with A pixels
    from `_BAND_PX` outside to `_RIM_PX` inside. What would lie outside the image is its border.

    Args:
        within: the M detections that are meant.
        crops: of all detections.
        masks: (N, H, W) of all detections.
        depth_m: (H, W).
        distances_m: (M,) depths of the objects.
        margin_m: see `_hidden`.
    """
    u0, u1, v0, v1 = np.array([crops[index] for index in within]).T[:, :, None, None]
    height, width = depth_m.shape
    low, high = _ACROSS_PX, -1 - _ACROSS_PX
    columns, rows = u0 + ((u1 - u0) * _ALONG).astype(np.intp), v0 + ((v1 - v0) * _ALONG).astype(np.intp)
    left, right = width * rows + np.maximum(u0 + low, 0), width * rows + np.minimum(u1 + high, width - 1)
    top, bottom = columns + width * np.maximum(v0 + low, 0), columns + width * np.minimum(v1 + high, height - 1)
    places = np.stack([left, right, top, bottom], axis=1)
    depths = depth_m.ravel().take(places)
    outside, rim = depths[:, :, :-_RIM_PX], depths[:, :, -_RIM_PX:]
    margins = np.empty(outside.shape, np.float32)
    margins[:] = (margin_m + 0.02 * distances_m**2)[:, None, None, None]
    for place, index in enumerate(within):
        out, on = places[place, :, :-_RIM_PX], places[place, :, -_RIM_PX:]
        is_own = masks[index].ravel().take(on)
        for j, other in enumerate(crops):
            if j != index and not other.is_empty and crops[index].is_near(other, _BAND_PX):
                np.copyto(margins[place], _OTHER_MARGIN_M, where=masks[j].ravel().take(out))
                if j > index:
                    is_own &= ~masks[j].ravel().take(on)
        rim[place] *= is_own & (rim[place] <= _MOST_DEPTH_M)
    own = rim.max(axis=2, keepdims=True)
    is_nearer = ((outside > 0) & (outside < own - margins)).any(axis=2)
    is_hidden = 2 * np.count_nonzero(is_nearer, axis=-1) > np.count_nonzero(own[:, :, 0], axis=-1)
    return [bool(answer) for answer in is_hidden.any(axis=1)]
