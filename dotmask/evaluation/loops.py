"""Errors of loop closures: how far the relative poses that they claim are from the true ones."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from dotmask.geometry import inverse
from dotmask.records import FloatArray, LoopClosure

FALSE_LOOP_M = 0.1
"""A loop closure whose translation is further off than this is a false one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopErrors:
    """Errors of at least one loop closure.

    Attributes:
        count: number of loop closures.
        false_count: those of them more than `FALSE_LOOP_M` off.
        trans_error_m: mean error of the translation.
        trans_error_max_m: the largest of them.
        rot_error_rad: mean error of the rotation.
    """

    count: int
    false_count: int
    trans_error_m: float
    trans_error_max_m: float
    rot_error_rad: float


def loop_errors(loops: Sequence[LoopClosure], truth: Mapping[int, FloatArray]) -> LoopErrors | None:
    """Errors of `loops`, or None when there are none.

    Args:
        loops: what the SLAM back end accepted.
        truth: `T_world_camera` (4, 4) by frame index.
    """
    if not loops:
        return None
    translation, rotation = [], []
    for loop in loops:
        T_from_to = inverse(truth[loop.from_index]) @ truth[loop.to_index]
        error = inverse(T_from_to) @ loop.T_from_to
        translation.append(float(np.linalg.norm(error[:3, 3])))
        rotation.append(float(Rotation.from_matrix(error[:3, :3]).magnitude()))
    return LoopErrors(
        count=len(loops),
        false_count=sum(e > FALSE_LOOP_M for e in translation),
        trans_error_m=float(np.mean(translation)),
        trans_error_max_m=max(translation),
        rot_error_rad=float(np.mean(rotation)),
    )
