"""R of an observation: the sensor, the camera's pose and the changing shape.

The paper calls R's diagonal "the imprecision of the RGB-D camera" and gives no values (Tracking Using EKF, Update).
"""

import numpy as np

from dotmask.profiles import ClassModel, MeasurementNoise
from dotmask.records import FloatArray, Intrinsics, MeasurementModel
from dotmask.tracking.measurement_model import PixelDepth


def measurement_covariance(
    p_camera: FloatArray,
    model: MeasurementModel,
    class_model: ClassModel,
    intrinsics: Intrinsics,
    noise: MeasurementNoise,
) -> FloatArray:
    """R (3, 3) of what `model` measures, in the units of that.

    Args:
        p_camera: (3,) where the object is seen, metres.
        model: what is measured.
        class_model: how much the shape of the class changes.
        intrinsics: of the camera.
        noise: see MeasurementNoise.
    """
    depth_m = float(p_camera[2])
    sigma_z = noise.depth_sigma_m + noise.depth_sigma_per_m * (depth_m - 0.4) ** 2
    sensor = np.diag(np.array([noise.pixel_sigma_px, noise.pixel_sigma_px, sigma_z]) ** 2)
    shape = np.diag(np.array(class_model.shape_sigma_m) ** 2)
    metric = shape + _pose_covariance(p_camera, noise)
    if isinstance(model, PixelDepth):
        J = model.jacobian(p_camera)
        return np.asarray(sensor + J @ metric @ J.T)
    back = np.linalg.inv(PixelDepth(intrinsics=intrinsics).jacobian(p_camera))
    if noise.is_diagonal:
        back = np.diag(np.diag(back))
    return np.asarray(back @ sensor @ back.T + metric)


def _pose_covariance(p_camera: FloatArray, noise: MeasurementNoise) -> FloatArray:
    """(3, 3) of a point in the camera frame of a camera that may be turned by w and shifted by t: `dp = w x p + t`."""
    x, y, z = p_camera
    turned = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
    return np.asarray(noise.pose_rotation_sigma_rad**2 * turned @ turned.T + noise.pose_position_sigma_m**2 * np.eye(3))
