"""What a camera path is, and what all of them need."""

import math
from typing import Protocol

import numpy as np

from sim.errors import CameraPathError
from sim.geometry import FloatArray


class CameraPath(Protocol):
    """Where the camera is: a pure function of time."""

    def pose_at(self, time_s: float) -> FloatArray:
        """`T_world_camera` (4, 4)."""
        ...


def rotation_from_vector(rotation_vector: FloatArray) -> FloatArray:
    """3x3 rotation about the direction of `rotation_vector` (3,) by its length in radians (Rodrigues)."""
    angle = math.sqrt(float(np.sum(rotation_vector**2)))
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = rotation_vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * (cross @ cross))


def there_and_back(time_s: float, duration_s: float) -> float:
    """The time within 0..duration_s of a path that is gone back the same way at its end, for ever."""
    return duration_s - abs(time_s % (2 * duration_s) - duration_s)


def check_nominal(T_world_camera: FloatArray) -> None:
    """Refuse what is no pose (4, 4).

    Raises:
        CameraPathError: not finite, not 4x4, or no rotation in it.
    """
    shape = np.shape(T_world_camera)
    if shape != (4, 4) or not np.all(np.isfinite(T_world_camera)):
        raise CameraPathError(f"camera path: the nominal pose must be a finite 4x4 matrix, got shape {shape}")
    R = T_world_camera[:3, :3]
    if np.abs(R @ R.T - np.eye(3)).max() > 1e-6 or np.linalg.det(R) < 0:
        raise CameraPathError("camera path: the nominal pose's upper left 3x3 block must be a rotation")


def check_factor(name: str, value: float) -> None:
    """Refuse a factor that is negative or not finite.

    Raises:
        CameraPathError: it is.
    """
    if not (math.isfinite(value) and value >= 0):
        raise CameraPathError(f"camera path: the {name} must be 0 or more, got {value}")


def check_speed(speed: float) -> None:
    """Refuse a speed factor that is not above 0.

    Raises:
        CameraPathError: it is not.
    """
    if not (math.isfinite(speed) and speed > 0):
        raise CameraPathError(f"camera path: the speed factor must be above 0, got {speed}")
