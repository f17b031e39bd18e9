"""A camera that is driven from outside, pose by pose, while the sequence is rendered."""

import numpy as np

from sim.camera_paths.path import check_nominal
from sim.errors import CameraPathError
from sim.geometry import FloatArray


class DrivenPath:
    """One pose for each capture of the camera, known up to the last one that was appended.

    A pose that is known never changes, so a frame stays a pure function of its index. There is no future: a sensor
    that exposes over time, and so looks ahead of the frame's own time, cannot be driven.

    Args:
        T_world_camera: (4, 4) the pose at time 0.
        frame_rate_hz: captures are at multiples of its inverse.

    Raises:
        CameraPathError: no pose.
    """

    def __init__(self, T_world_camera: FloatArray, frame_rate_hz: float) -> None:
        check_nominal(T_world_camera)
        self._rate_hz = frame_rate_hz
        self._poses = [T_world_camera]

    def __len__(self) -> int:
        """Number of captures whose pose is known."""
        return len(self._poses)

    def append(self, T_world_camera: FloatArray) -> None:
        """Add the pose (4, 4) of the next capture.

        Raises:
            CameraPathError: no pose.
        """
        check_nominal(T_world_camera)
        self._poses.append(T_world_camera)

    def restart(self) -> None:
        """Forget all poses but the first."""
        del self._poses[1:]

    @property
    def poses(self) -> FloatArray:
        """(N, 4, 4) `T_world_camera` of all captures so far."""
        return np.array(self._poses)

    def pose_at(self, time_s: float) -> FloatArray:
        """`T_world_camera` (4, 4) at the time of a capture.

        Raises:
            CameraPathError: no capture is at this time, or it has no pose yet.
        """
        capture = round(time_s * self._rate_hz)
        if abs(capture - time_s * self._rate_hz) > 1e-6 or not 0 <= capture < len(self):
            raise CameraPathError(
                f"driven path: no pose at {time_s:.4f} s; {len(self)} poses are known, "
                f"one every {1 / self._rate_hz:.4f} s from 0 s on"
            )
        return self._poses[capture]
