"""Moving object classification (MOC): is an object moving or idle, and why (paper, Moving Object Classification).

The paper calls an object moving if its speed is above a class threshold, or if it is non-rigid and its consecutive
masks overlap too little. It prints "above" for the overlap as well: a misprint, since a deforming object has a LOW
overlap.
"""

from collections.abc import Callable
from functools import cache

import cv2
import numpy as np
from scipy.special import gammaincinv

from dotmask.profiles import MaskAlignment, Profile
from dotmask.records import MaskImage, Reason, Track, Verdict

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
    iou = None
    if model.is_non_rigid and previous is not None and previous.misses == 0 and track.misses == 0:
        iou = mask_iou(previous.mask, track.mask, profile.mask_alignment)

    # Half hidden, a standing object seems to move when more or less of it shows.
    is_partial = track.partial_timestamp_s == track.timestamp_s
    is_fast = speed > model.speed_threshold_m_s * (profile.partial_speed_factor if is_partial else 1.0)
    reason = Reason.IDLE
    if is_fast and _is_significant(track, profile.speed_confidence):
        reason = Reason.SPEED
    elif iou is not None and iou < profile.deformation_iou:
        reason = Reason.DEFORMATION
    if reason is not Reason.IDLE:
        return Verdict(is_moving=True, reason=reason, speed_m_s=speed, mask_iou=iou, calm_frames=0)

    # A speed above the threshold that may still be noise speaks neither for motion nor for rest.
    calm = before.calm_frames if before is not None else 0
    calm = calm if is_fast else calm + 1
    if calm >= profile.calm_frames or (before is not None and before.reason is Reason.IDLE):
        return Verdict(is_moving=False, reason=Reason.IDLE, speed_m_s=speed, mask_iou=iou, calm_frames=calm)
    if before is None or before.reason is Reason.NEW:
        is_masked = profile.unknown_policy == "mask"
        return Verdict(is_moving=is_masked, reason=Reason.NEW, speed_m_s=speed, mask_iou=iou, calm_frames=calm)
    return Verdict(is_moving=True, reason=before.reason, speed_m_s=speed, mask_iou=iou, calm_frames=calm)


def mask_iou(first: MaskImage, second: MaskImage, alignment: MaskAlignment) -> float:
    """Intersection over union of two masks (H, W); 0 where both are empty.

    With alignment "box" the first mask's bounding box is moved and scaled onto the second's, so that neither an object
    that crosses the image nor one that comes nearer looks deformed.
    """
    a, b = _rectangle(first), _rectangle(second)
    if alignment == "box":
        if a[2] == 0 or b[2] == 0:
            return 0.0
        cut = np.ascontiguousarray(_cut(first, a)).view(np.uint8)
        one = cv2.resize(cut, (b[2], b[3]), interpolation=cv2.INTER_NEAREST).view(np.bool_)
        other = _cut(second, b)
    else:
        u0, v0 = min(a[0], b[0]), min(a[1], b[1])
        u1, v1 = max(a[0] + a[2], b[0] + b[2]), max(a[1] + a[3], b[1] + b[3])
        one, other = first[v0:v1, u0:u1], second[v0:v1, u0:u1]
    union = int(np.count_nonzero(one | other))
    return int(np.count_nonzero(one & other)) / union if union else 0.0


def _rectangle(mask: MaskImage) -> tuple[int, int, int, int]:
    """Left, top, width, height of the mask's pixels; all 0 for none."""
    u, v, width, height = cv2.boundingRect(mask.view(np.uint8))
    return u, v, width, height


def _cut(mask: MaskImage, rectangle: tuple[int, int, int, int]) -> MaskImage:
    u, v, width, height = rectangle
    return mask[v : v + height, u : u + width]


def _is_significant(track: Track, confidence: float) -> bool:
    """Whether zero velocity lies outside the `confidence` region of the velocity (chi-square, 3 degrees of freedom)."""
    v = track.velocity_world
    return float(v @ np.linalg.solve(track.covariance[3:, 3:], v)) > _quantile(confidence)


@cache
def _quantile(probability: float) -> float:
    return float(2.0 * gammaincinv(1.5, probability))
