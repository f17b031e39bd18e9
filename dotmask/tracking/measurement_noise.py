"""R of an observation: the sensor, the camera's pose and the changing shape.

The paper calls R's diagonal "the imprecision of the RGB-D camera" and gives no values (Tracking Using EKF, Update).
Here the sensor's part follows from how a position is computed from many pixels:

- A border of a mask lies somewhere between two pixel centres: uniform over one pixel, sigma `1/sqrt(12)` = 0.29 px. The
  centre of a box is the mean of two such borders: `1/sqrt(24)` = 0.20 px.
- The mean of a mask's pixels is moved by each pixel of its outline, by its distance from the mean over the area:
  `sum of (u - mean)² / area²` times the variance of a border; 0.03 px for a disc of 80 px.
- The mean of n depths has the variance of one over n, and rounding to the steps of the disparity adds `step²/12` to the
  one. The outline moves the mean of the depths as it moves the centre. Rounding to the step of the file format shifts
  each of the few values that the disparity leaves, so it hardly averages out.
- The median of n depths has `pi/2` times the variance of their mean, and lies on a step of the disparity itself: its
  `step²/12` does not average out.

`dotmask validate` measures all of this on images whose truth is exact (docs/validation.md).
"""

import cv2
import numpy as np
import numpy.typing as npt

from dotmask.profiles import MeasurementNoise
from dotmask.records import FloatArray, Intrinsics, MaskImage, MeasurementModel
from dotmask.tracking.measurement_model import PixelDepth

_AXES = np.arange(3)
_CROSS = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))


def box_centre_variance(noise: MeasurementNoise) -> FloatArray:
    """(2,) of the centre of a box in u and v, px²: the mean of two borders with errors of their own."""
    return np.full(2, noise.pixel_sigma_px**2 + 0.5 * noise.edge_sigma_px**2)


def centroid_variance(mask: MaskImage, centroid_px: FloatArray, area_px: float, noise: MeasurementNoise) -> FloatArray:
    """(2,) of the mean of a mask's pixels in u and v, px²: each pixel of the outline errs by itself.

    A straight side that lies along the rows or the columns errs as a whole; that is not modelled.

    Args:
        mask: (H, W).
        centroid_px: (2,) u and v of the mean, in the pixels of `mask`.
        area_px: number of the mask's pixels.
        noise: see MeasurementNoise.
    """
    moments = cv2.moments(_outline(mask.view(np.uint8)), binaryImage=True)
    length = moments["m00"]
    spread = np.array(
        [
            moments["mu20"] + length * (moments["m10"] / length - centroid_px[0]) ** 2,
            moments["mu02"] + length * (moments["m01"] / length - centroid_px[1]) ** 2,
        ]
    )
    return np.asarray(noise.pixel_sigma_px**2 + noise.edge_sigma_px**2 * spread / area_px**2)


def mean_depth_variance(mean_m: float, outline_spread_m2: float, pixels: int, noise: MeasurementNoise) -> float:
    """Of the mean depth, m².

    Args:
        mean_m: the mean.
        outline_spread_m2: sum over the pixels of the outline of the squared difference of their depth from the mean.
        pixels: how many depths entered the mean.
        noise: see MeasurementNoise.
    """
    one = _depth_sigma(mean_m, noise) ** 2
    if not noise.averages_pixels:
        return one
    one += _step_variance(mean_m, noise)
    outline = noise.edge_sigma_px**2 * outline_spread_m2 / pixels**2
    return one / pixels + outline + _rounding_variance(mean_m, one, noise)


def median_depth_variance(depth_m: float, pixels: int, noise: MeasurementNoise) -> float:
    """Of the median depth of `pixels` pixels at about `depth_m`, m²."""
    if not noise.averages_pixels:
        return _depth_sigma(depth_m, noise) ** 2
    return 0.5 * np.pi * _depth_sigma(depth_m, noise) ** 2 / pixels + _step_variance(depth_m, noise)


def measurement_covariances(
    p_camera: FloatArray,
    sensor_variances: FloatArray,
    model: MeasurementModel,
    shape_sigmas_m: FloatArray,
    intrinsics: Intrinsics,
    noise: MeasurementNoise,
) -> FloatArray:
    """R (N, 3, 3) of what `model` measures, in the units of that.

    Args:
        p_camera: (N, 3) where the objects are seen, metres.
        sensor_variances: (N, 3) of u and v (px²) and of the depth (m²) that `p_camera` was computed from.
        model: what is measured.
        shape_sigmas_m: (N, 3) how much the shapes of their classes change.
        intrinsics: of the camera.
        noise: see MeasurementNoise.
    """
    metric = _pose_covariances(p_camera, noise)
    metric[:, _AXES, _AXES] += shape_sigmas_m**2
    if isinstance(model, PixelDepth):
        J = model.jacobian(p_camera)
        R = J @ metric @ J.swapaxes(1, 2)
        R[:, _AXES, _AXES] += sensor_variances
        return np.asarray(R)
    back = _back_projection_jacobian(p_camera, intrinsics)
    if noise.is_diagonal:
        metric[:, _AXES, _AXES] += back[:, _AXES, _AXES] ** 2 * sensor_variances
        return metric
    return np.asarray((back * sensor_variances[:, None]) @ back.swapaxes(1, 2) + metric)


def _back_projection_jacobian(p_camera: FloatArray, intrinsics: Intrinsics) -> FloatArray:
    """(N, 3, 3) derivative of points (N, 3) with respect to the pixel u, v and the depth that they come from."""
    J = np.zeros((len(p_camera), 3, 3))
    z = p_camera[:, 2]
    J[:, 0, 0], J[:, 1, 1] = z / intrinsics.fx, z / intrinsics.fy
    J[:, :, 2] = p_camera / z[:, None]
    return J


def _outline(shape: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """(H, W) the pixels of `shape` that touch, by a side, one that is not of it."""
    inner = cv2.erode(shape, _CROSS, borderType=cv2.BORDER_CONSTANT, borderValue=0)
    return np.asarray(cv2.subtract(shape, inner))


def _depth_sigma(depth_m: float, noise: MeasurementNoise) -> float:
    """Of the depth of one pixel, before it is rounded to a step."""
    return noise.depth_sigma_m + noise.depth_sigma_per_m * (depth_m - 0.4) ** 2


def _rounding_variance(depth_m: float, one: float, noise: MeasurementNoise) -> float:
    """Of the mean of many rounded depths, each of variance `one` and a multiple of the step before.

    Of a Gaussian of sigma s, the squared shares of the values on a grid of a coarser step sum to step / (2 sqrt(pi) s).
    """
    values = 2.0 * np.sqrt(np.pi * one) / (noise.depth_step_per_m * depth_m**2) if noise.depth_step_per_m else np.inf
    return float(noise.depth_rounding_m**2 / 12.0 / max(values, 1.0))


def _step_variance(depth_m: float, noise: MeasurementNoise) -> float:
    """Of rounding to the steps of the disparity, uniform over one of them."""
    return (noise.depth_step_per_m * depth_m**2) ** 2 / 12.0


def _pose_covariances(p_camera: FloatArray, noise: MeasurementNoise) -> FloatArray:
    """(N, 3, 3) of points (N, 3) seen by a camera that may be turned by w and shifted by t: `dp = w x p + t`."""
    turn, shift = noise.pose_rotation_sigma_rad**2, noise.pose_position_sigma_m**2
    # The matrix A of w x p = A w has A Aᵀ = |p|² I - p pᵀ.
    covariances = -turn * p_camera[:, :, None] * p_camera[:, None]
    covariances[:, _AXES, _AXES] += turn * (p_camera**2).sum(axis=1, keepdims=True) + shift
    return covariances
