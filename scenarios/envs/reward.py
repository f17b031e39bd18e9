"""What the environments reward: small pose errors, moving objects kept out, and for a driver seeing the room."""

from dataclasses import dataclass

import numpy as np

from dotmask.evaluation.trajectory import step_error
from dotmask.geometry import back_project, transform
from dotmask.records import FloatArray, Intrinsics
from sim.records import GroundTruth

VOXEL_M = 0.25
"""Side of the cubes of space by which coverage is counted."""
SAMPLED_EVERY_PX = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class RewardWeights:
    """Prices and prizes.

    Attributes:
        error_per_m: price of a metre of relative pose error of one step.
        error_per_rad: price of a radian of it.
        lost: price of a step at whose end, or at whose start, SLAM has no pose.
        leak: price of a step in which odometry sees all pixels of moving objects.
        waste: price of a step in which all static pixels are hidden from odometry.
        progress_per_m2: prize of a square metre of the room seen for the first time.
    """

    error_per_m: float = 100.0
    error_per_rad: float = 100.0
    lost: float = 1.0
    leak: float = 0.1
    waste: float = 0.1
    progress_per_m2: float = 0.1


class PoseError:
    """Relative pose error from step to step, and how long SLAM has been lost.

    Attributes:
        lost_frames: consecutive frames without a pose, up to the last one.
    """

    def __init__(self) -> None:
        self.lost_frames = 0
        self._before: tuple[FloatArray, FloatArray | None] | None = None

    def price(self, truth: FloatArray, estimate: FloatArray | None, weights: RewardWeights) -> float:
        """Price of the step to this frame; the first frame ends no step and costs nothing.

        Args:
            truth: (4, 4) true `T_world_camera`.
            estimate: (4, 4) what SLAM says, None while it is lost.
            weights: of the errors.
        """
        before, self._before = self._before, (truth, estimate)
        self.lost_frames = self.lost_frames + 1 if estimate is None else 0
        if before is None:
            return 0.0
        if estimate is None or before[1] is None:
            return weights.lost
        trans_m, rot_rad = step_error(before[0], truth, before[1], estimate)
        return weights.error_per_m * trans_m + weights.error_per_rad * rot_rad


class Coverage:
    """How much of the room was seen so far, by cubes of VOXEL_M that a surface goes through.

    Args:
        intrinsics: of the camera.
        moving_ids: instance ids of people and things, which are not counted.
    """

    def __init__(self, intrinsics: Intrinsics, moving_ids: tuple[int, ...]) -> None:
        self._intrinsics = intrinsics
        self._is_counted = np.ones(np.iinfo(np.uint16).max + 1, np.bool_)
        self._is_counted[list(moving_ids)] = False
        self._seen: set[int] = set()
        v, u = np.mgrid[0 : intrinsics.height : SAMPLED_EVERY_PX, 0 : intrinsics.width : SAMPLED_EVERY_PX]
        self._pixels = np.stack([u.ravel(), v.ravel()], axis=1).astype(float)

    def see(self, truth: GroundTruth) -> float:
        """Square metres that this frame adds: a side of each cube that is seen for the first time."""
        every = slice(None, None, SAMPLED_EVERY_PX)
        depth_m, ids = truth.depth_m[every, every].ravel(), truth.instance_ids[every, every].ravel()
        counted = (depth_m > 0) & self._is_counted[ids]
        points = back_project(self._pixels[counted], depth_m[counted].astype(float), self._intrinsics)
        x, y, z = (np.floor(transform(truth.T_world_camera, points) / VOXEL_M).astype(np.int64) + 1024).T
        before = len(self._seen)
        self._seen.update(np.unique((x << 24) | (y << 12) | z).tolist())
        return (len(self._seen) - before) * VOXEL_M**2
