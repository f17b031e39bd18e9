"""From detections and depth to positions in the camera frame: z of the paper (Tracking Using EKF, Update)."""

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
    measurement_covariance,
    median_depth_variance,
)

_BAND_PX = 8
"""How far outside a box an occluder is looked for: past the ring without depth that sensors leave at depth edges."""
_RIM_PX = 3
"""Mask pixels this close to a side of the box are what that side rests on."""
_LINES = 64
"""At most this many lines across a side are looked at."""
_MEDIAN_PIXELS = 3000
_LEAST_DEPTH_M, _MOST_DEPTH_M = 1e-6, 1e6
_OTHER_MARGIN_M = 0.02
"""How much nearer another detection must be to count as an occluder."""


class _Crop(NamedTuple):
    """Whole pixels of a detection's box, clipped to the image; the stops are exclusive."""

    u_start: int
    u_stop: int
    v_start: int
    v_stop: int

    @property
    def slices(self) -> tuple[slice, slice]:
        return slice(self.v_start, self.v_stop), slice(self.u_start, self.u_stop)


def observe(detections: Detections, frame: RgbdFrame, profile: Profile) -> tuple[Observation, ...]:
    """Camera-frame positions of the detections of `frame`.

    `profile.measurement` says what is measured: `bbox_centre` is the paper's z: the mean depth `z_z` of the mask's
    pixels with depth, `z_x = (u - cx) z_z / fx` and `z_y` alike, with (u, v) the centre of the bounding box.
    `mask_centroid` takes the mean of the mask's pixels and their median depth instead. `pixel_depth` measures what the
    box centre's pixel and the mean depth are before the back-projection. R follows from the sensor's noise and, where
    the profile says so, from how the shape of the class changes and from sides of the object that are not seen. A
    detection with fewer than `profile.min_depth_pixels` pixels of valid depth gives no observation.
    """
    observations = []
    labels = _label(detections, frame.intrinsics) if profile.noise.notices_hidden_sides else None
    model = PixelDepth(intrinsics=frame.intrinsics) if profile.measurement == "pixel_depth" else CAMERA_POINT
    for index, class_name in enumerate(detections.class_names):
        box = detections.boxes_px[index]
        crop = _crop(box, frame.intrinsics)
        mask, depth_m = detections.masks[index][crop.slices], frame.depth_m[crop.slices]
        depth_seen = _depth(mask, depth_m, profile)
        if depth_seen is None:
            continue
        centre, centre_variance = _centre(mask, box, crop, profile)
        depth, depth_variance = depth_seen
        p_camera = back_project(centre[None], np.array([depth]), frame.intrinsics)[0]
        class_model = profile.class_model(class_name)
        is_partial = False
        if labels is not None:
            view = _View(index + 1, labels, frame.depth_m, depth, profile.noise.occluder_margin_m + 0.02 * depth**2)
            is_partial = _is_partial(view, crop, frame.intrinsics)
        observations.append(
            Observation(
                position_camera=p_camera,
                covariance=measurement_covariance(
                    p_camera,
                    np.array([*centre_variance, depth_variance]),
                    model,
                    class_model,
                    frame.intrinsics,
                    profile.noise,
                ),
                class_name=class_name,
                detection_index=index,
                mask=detections.masks[index],
                model=model,
                is_partial=is_partial,
            )
        )
    return tuple(observations)


def _crop(box_px: FloatArray, intrinsics: Intrinsics) -> _Crop:
    u_min, v_min, u_max, v_max = (float(x) for x in box_px)
    return _Crop(
        u_start=max(int(np.floor(u_min)), 0),
        u_stop=min(int(np.ceil(u_max)) + 1, intrinsics.width),
        v_start=max(int(np.floor(v_min)), 0),
        v_stop=min(int(np.ceil(v_max)) + 1, intrinsics.height),
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

    Together with its variance, m and m²; None with too few pixels.
    """
    nearest, farthest = _LEAST_DEPTH_M, _MOST_DEPTH_M
    median = None
    if profile.depth_trim_m is not None or profile.measurement == "mask_centroid":
        # A grid of pixels is enough.
        step = max(1, int(np.sqrt(mask.size / _MEDIAN_PIXELS)))
        depths = depth_m[::step, ::step][mask[::step, ::step]]
        depths = depths[depths > 0]
        if len(depths):
            median = float(np.partition(depths, len(depths) // 2)[len(depths) // 2])
    if median is not None and profile.depth_trim_m is not None:
        nearest, farthest = max(median - profile.depth_trim_m, _LEAST_DEPTH_M), median + profile.depth_trim_m
    is_used = np.asarray(cv2.bitwise_and(cv2.inRange(depth_m, nearest, farthest), mask.view(np.uint8)), np.uint8)
    pixels = cv2.countNonZero(is_used)
    if pixels < profile.min_depth_pixels:
        return None
    if median is not None and profile.measurement == "mask_centroid":
        return median, median_depth_variance(median, len(depths), profile.noise)
    mean = float(cv2.mean(depth_m, is_used)[0])
    return mean, mean_depth_variance(mean, depth_m, is_used, pixels, profile.noise)


class _View(NamedTuple):
    """What the search for hidden sides looks at.

    Attributes:
        label: of the detection.
        labels: (H, W) uint8, 0 where no detection is.
        depth_m: (H, W).
        distance_m: of the object.
        margin_m: how much nearer than the object something unlabelled must be to count as an occluder and not as the
            floor before its feet.
    """

    label: int
    labels: npt.NDArray[np.uint8]
    depth_m: DepthImage
    distance_m: float
    margin_m: float


def _label(detections: Detections, intrinsics: Intrinsics) -> npt.NDArray[np.uint8]:
    """(H, W) number of the detection, from 1, that each pixel belongs to; the last where masks overlap."""
    if len(detections) > 255:
        raise ValueError(f"observe: {len(detections)} detections, at most 255 are supported")
    labels = np.zeros((intrinsics.height, intrinsics.width), np.uint8)
    for index, mask in enumerate(detections.masks):
        region = _crop(detections.boxes_px[index], intrinsics).slices
        np.copyto(labels[region], np.uint8(index + 1), where=mask[region])
    return labels


def _is_partial(view: _View, crop: _Crop, intrinsics: Intrinsics) -> bool:
    """Whether the image border, or something nearer, hides a side of the object."""
    u0, u1, v0, v1 = crop
    if u0 <= 1 or v0 <= 1 or u1 >= intrinsics.width - 1 or v1 >= intrinsics.height - 1:
        return True
    rows, columns = slice(v0, v1, 1 + (v1 - v0) // _LINES), slice(u0, u1, 1 + (u1 - u0) // _LINES)
    if _is_covered(view, (rows, columns)):
        return True
    left, right = slice(max(u0 - _BAND_PX, 0), u0 + _RIM_PX), slice(u1 - _RIM_PX, u1 + _BAND_PX)
    top, bottom = slice(max(v0 - _BAND_PX, 0), v0 + _RIM_PX), slice(v1 - _RIM_PX, v1 + _BAND_PX)
    return (
        _ends_behind_occluder(view, (rows, left), across_columns=True, is_high=False)
        or _ends_behind_occluder(view, (rows, right), across_columns=True, is_high=True)
        or _ends_behind_occluder(view, (top, columns), across_columns=False, is_high=False)
        or _ends_behind_occluder(view, (bottom, columns), across_columns=False, is_high=True)
    )


def _is_covered(view: _View, box: tuple[slice, slice]) -> bool:
    """Whether another detection, nearer than the object, takes more of the box than the object itself."""
    labels, depth_m = view.labels[box], view.depth_m[box]
    is_other = (labels != 0) & (labels != view.label) & (depth_m > 0) & (depth_m < view.distance_m)
    return bool(np.count_nonzero(is_other) > np.count_nonzero(labels == view.label))


def _ends_behind_occluder(view: _View, strip: tuple[slice, slice], *, across_columns: bool, is_high: bool) -> bool:
    """Whether most lines that reach a side of the box have something nearer right outside of it.

    Args:
        view: see _View.
        strip: rows and columns from _BAND_PX outside to _RIM_PX inside the side; fewer outside at the image border.
        across_columns: whether lines run along u (left and right side) or along v.
        is_high: whether the side is the right or the lower one.
    """
    labels, depth_m = view.labels[strip], view.depth_m[strip]
    if across_columns:
        labels, depth_m = labels.T, depth_m.T
    if is_high:
        labels, depth_m = labels[::-1], depth_m[::-1]
    labels, depth_m = np.ascontiguousarray(labels), np.ascontiguousarray(depth_m)
    outside, others = depth_m[:-_RIM_PX], labels[:-_RIM_PX]
    own = np.where(labels[-_RIM_PX:] == view.label, depth_m[-_RIM_PX:], np.float32(0)).max(axis=0)
    is_other = (others != 0) & (others != view.label)
    nearer = np.where(is_other, own - np.float32(_OTHER_MARGIN_M), own - np.float32(view.margin_m))
    is_nearer = ((outside > 0) & (outside < nearer)).any(axis=0)
    return bool(2 * np.count_nonzero(is_nearer) > np.count_nonzero(own))
