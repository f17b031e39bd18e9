"""From detections and depth to positions in the camera frame: z of the paper (Tracking Using EKF, Update)."""

from collections.abc import Sequence
from math import ceil, floor, isqrt
from typing import NamedTuple

import cv2
import numpy as np

from dotmask.geometry import back_project
from dotmask.profiles import Profile
from dotmask.records import DepthImage, Detections, FloatArray, Intrinsics, MaskImage, Observation, RgbdFrame
from dotmask.tracking.measurement_kernels import hidden_objects, mean_depth, median_depth, sampled_depths
from dotmask.tracking.measurement_model import CAMERA_POINT, PixelDepth
from dotmask.tracking.measurement_noise import (
    box_centre_variance,
    centroid_variance,
    mean_depth_variance,
    measurement_covariances,
    median_depth_variance,
)

_SAMPLES = 4000
"""Of a box of more pixels a grid of at least so many is looked at."""
_MEDIAN_SAMPLES = 1000
"""For the trim, a rough median is enough."""
_LEAST_DEPTH_M, _MOST_DEPTH_M = 1e-6, 1e6
"""What lies outside is no depth."""


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
    hidden = np.zeros(len(seen), np.bool_)
    if profile.noise.notices_hidden_sides:
        hidden = hidden_objects(
            np.array(seen),
            np.array(crops),
            detections.masks,
            frame.depth_m,
            measured[:, 2],
            profile.noise.occluder_margin_m,
            _MOST_DEPTH_M,
        )
    return tuple(
        Observation(
            position_camera=p,
            covariance=R,
            class_name=detections.class_names[index],
            detection_index=index,
            mask=detections.masks[index],
            model=model,
            is_partial=bool(is_partial),
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
    samples = sampled_depths(mask, depth_m, step, _LEAST_DEPTH_M, _MOST_DEPTH_M)
    is_median = profile.measurement == "mask_centroid"
    nearest, farthest = _LEAST_DEPTH_M, _MOST_DEPTH_M
    median, count = 0.0, 0
    if is_median or profile.depth_trim_m is not None:
        median, count = median_depth(samples, 1 if is_median else _step(mask.size // step**2, _MEDIAN_SAMPLES))
    if count and profile.depth_trim_m is not None:
        nearest = max(median - profile.depth_trim_m, nearest)
        farthest = min(median + profile.depth_trim_m, farthest)
    pixels, mean, spread = mean_depth(samples, nearest, farthest)
    if pixels < profile.min_depth_pixels:
        return None
    if is_median:
        return median, median_depth_variance(median, count, profile.noise)
    return mean, mean_depth_variance(mean, spread, pixels, profile.noise)


def _step(pixels: int, samples: int) -> int:
    """Every so many-th pixel in both directions leaves at least `samples`, or all."""
    return max(1, isqrt(pixels // samples))
