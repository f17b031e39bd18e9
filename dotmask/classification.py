"""Moving object classification (MOC): is an object moving or idle, and why (paper, Moving Object Classification).

The paper calls an object moving if its speed is above a class threshold, or if it is non-rigid and its consecutive
masks overlap too little. It prints "above" for the overlap as well: a misprint, since a deforming object has a LOW
overlap.
"""

from collections.abc import Callable
from functools import cache

import numpy as np
from scipy.special import gammaincinv

from dotmask.mask_geometry import aligned_iou, intersection_over_union
from dotmask.profiles import Profile
from dotmask.records import Reason, Track, Verdict

Classify = Callable[[Track, Track | None, Profile], Verdict]
"""The form of `classify`."""


def classify(track: Track, previous: Track | None, profile: Profile) -> Verdict:
    """Moving or idle.

    Args:
        track: belief after this frame.
        previous: the same track after the frame before, with its verdict; None at birth.
        profile: thresholds. With `calm_frames` above 1, an object is idle only after that many frames that speak for
            it; a new one is treated by `unknown_policy` until then. A track that was not observed keeps its verdict.
    """
    speed = float(np.linalg.norm(track.velocity_world))
    before = previous.verdict if previous is not None else None
    if track.misses > 0 and before is not None:
        return Verdict(
            is_moving=before.is_moving,
            reason=before.reason,
            speed_m_s=speed,
            mask_iou=None,
            calm_frames=before.calm_frames,
        )
    model = profile.class_model(track.class_name)
    surface, iou = track.surface, None
    was_moving = before is not None and before.is_moving and before.reason is not Reason.NEW
    moving_share = model.still_moving_share if was_moving else model.moving_share
    is_fast = speed > model.speed_threshold_m_s
    reason, speaks_for_rest = Reason.IDLE, True
    if surface is not None:
        least_points = 1 if was_moving else model.moving_points
        is_shifted = surface.moving_share >= moving_share and surface.moving_points >= least_points
        is_surface_fast = float(np.linalg.norm(surface.velocity_world)) > model.speed_threshold_m_s
        if model.is_non_rigid and is_shifted:
            reason = Reason.SURFACE  # a hand may move before the body does, without a change of the mask
        elif is_fast and (is_shifted or is_surface_fast):
            speaks_for_rest = False
            reason = Reason.SPEED if _is_significant(track, profile.speed_confidence) else Reason.IDLE
    elif track.is_partial and profile.surface is not None:
        # The centre of the visible part slides over the object: its speed proves nothing.
        speaks_for_rest = not (is_fast or model.is_non_rigid)
    elif is_fast and _is_significant(track, profile.speed_confidence):
        reason = Reason.SPEED
    else:
        # A speed above the threshold that may still be noise speaks neither for motion nor for rest.
        speaks_for_rest = not is_fast
        if model.is_non_rigid and previous is not None and previous.misses == 0:
            iou = (aligned_iou if profile.aligns_masks else intersection_over_union)(previous.mask, track.mask)
            reason = Reason.DEFORMATION if iou < profile.deformation_iou else Reason.IDLE
    if reason is not Reason.IDLE:
        return Verdict(is_moving=True, reason=reason, speed_m_s=speed, mask_iou=iou, calm_frames=0)

    calm = (before.calm_frames if before is not None else 0) + speaks_for_rest
    needed = profile.calm_frames if was_moving else profile.proof_frames
    if calm >= needed or (before is not None and before.reason is Reason.IDLE):
        return Verdict(is_moving=False, reason=Reason.IDLE, speed_m_s=speed, mask_iou=iou, calm_frames=calm)
    if before is None or before.reason is Reason.NEW:
        is_masked = profile.unknown_policy == "mask"
        return Verdict(is_moving=is_masked, reason=Reason.NEW, speed_m_s=speed, mask_iou=iou, calm_frames=calm)
    return Verdict(is_moving=True, reason=before.reason, speed_m_s=speed, mask_iou=iou, calm_frames=calm)


def _is_significant(track: Track, confidence: float) -> bool:
    """Whether zero velocity lies outside the `confidence` region of the velocity (chi-square, 3 degrees of freedom)."""
    v = track.velocity_world
    if confidence == 0:
        return True
    return float(v @ np.linalg.solve(track.covariance[3:, 3:], v)) > _quantile(confidence)


@cache
def _quantile(probability: float) -> float:
    return float(2.0 * gammaincinv(1.5, probability))
