"""Odometry's error from frame to frame, beside what leaked into the frame."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import pearsonr, spearmanr

from dotmask.evaluation.masks import count_masking
from dotmask.evaluation.trajectory import step_error
from dotmask.pipeline import FrameResult
from dotmask.records import FloatArray
from scenarios.attribution.report import Correlation
from sim.records import GroundTruth


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """The camera's motion from the frame before to this one, against the truth.

    Attributes:
        frame: number of this frame.
        timestamp_s: of this frame.
        trans_error_m: translation part of the relative pose error; None where either frame has no pose.
        rot_error_rad: rotation part of it.
        moving_pixels: pixels of moving objects with depth in this frame.
        leaked_pixels: those of them that odometry was given.
    """

    frame: int
    timestamp_s: float
    trans_error_m: float | None
    rot_error_rad: float | None
    moving_pixels: int
    leaked_pixels: int


class StepMeter:
    """Measures the steps of one variant. Drift does not add up in them, so that an error shows where it is made."""

    def __init__(self) -> None:
        self._before: tuple[FloatArray, FloatArray] | None = None

    def see(self, truth: GroundTruth, result: FrameResult) -> Step:
        """The step to the next frame."""
        pose, before = result.pose.T_world_camera, self._before
        self._before = None if pose is None else (truth.T_world_camera, pose)
        trans_error_m = rot_error_rad = None
        if before is not None and pose is not None:
            trans_error_m, rot_error_rad = step_error(before[0], truth.T_world_camera, before[1], pose)
        moving = [actor.instance_id for actor in truth.objects if actor.is_moving]
        counts = count_masking(result.frame.depth_m, result.front_end.masked.mo_mdi_m, truth.instance_ids, moving)
        return Step(
            frame=result.frame.index,
            timestamp_s=result.frame.timestamp_s,
            trans_error_m=trans_error_m,
            rot_error_rad=rot_error_rad,
            moving_pixels=counts.moving_pixels,
            leaked_pixels=counts.leaked_pixels,
        )


def correlate(steps: Sequence[Step]) -> Correlation:
    """How error and leak go together over the steps whose error is known."""
    known = [(step.leaked_pixels, step.trans_error_m) for step in steps if step.trans_error_m is not None]
    leaked, error_m = np.array(known, np.float64).reshape(-1, 2).T
    varies = len(known) > 2 and np.ptp(leaked) > 0 and np.ptp(error_m) > 0
    return Correlation(
        steps=len(known),
        steps_with_leak=int(np.count_nonzero(leaked)),
        pearson=float(pearsonr(leaked, error_m).statistic) if varies else None,
        spearman=float(spearmanr(leaked, error_m).statistic) if varies else None,
    )
