"""The masked depth images MDI and MO-MDI (paper, section III and the figure "Architecture of DOTMask")."""

from collections.abc import Sequence
from functools import cache
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from dotmask.profiles import Profile
from dotmask.records import DepthImage, Detections, MaskedDepth, MaskImage, Track


def mask_depth(
    depth_m: DepthImage,
    detections: Detections,
    moving: Sequence[bool],
    tracks: Sequence[Track],
    profile: Profile,
) -> MaskedDepth:
    """Depth without the moving objects (MO-MDI) and without all objects of interest (MDI).

    Every pixel of the result is the input's depth or 0, and a pixel is removed if any removed mask covers it: the
    order of the detections does not matter.

    Args:
        depth_m: (H, W) float32 metres, 0 = none; stays as it is.
        detections: objects of interest of this frame.
        moving: for each detection whether it goes from the MO-MDI.
        tracks: of this frame. With `profile.coasting_mask_frames` above 0, the last mask of a moving track that was not
            seen for up to so many frames goes from both images: a detector that misses a walking person once does
            not let it into the map.
        profile: dilation of the masks.

    Raises:
        ValueError: `moving` does not have one value per detection.
    """
    if len(moving) != len(detections):
        raise ValueError(f"moving: {len(moving)} values for {len(detections)} detections")
    coasting = [
        track.mask
        for track in tracks
        if 0 < track.misses <= profile.coasting_mask_frames and track.verdict is not None and track.verdict.is_moving
    ]
    removed = [mask for mask, is_moving in zip(detections.masks, moving, strict=True) if is_moving]
    kept = [mask for mask, is_moving in zip(detections.masks, moving, strict=True) if not is_moving]
    mo_mdi = depth_m.copy()
    for mask in (*removed, *coasting):
        _cut_out(mo_mdi, mask, profile.dilation_px)
    mdi = mo_mdi.copy()
    for mask in kept:
        _cut_out(mdi, mask, profile.dilation_px)
    return MaskedDepth(mo_mdi_m=mo_mdi, mdi_m=mdi)


def dilate(mask: MaskImage, radius_px: int) -> MaskImage:
    """`mask` (H, W) grown by a disc of `radius_px` pixels."""
    grown = mask.copy()
    region, patch = _dilated_patch(mask, radius_px)
    grown[region] = patch
    return grown


def _cut_out(depth_m: npt.NDArray[np.float32], mask: MaskImage, radius_px: int) -> None:
    """Set `depth_m` to 0 under the dilated `mask`, in place."""
    region, patch = _dilated_patch(mask, radius_px)
    np.copyto(depth_m[region], 0.0, where=patch)


def _dilated_patch(mask: MaskImage, radius_px: int) -> tuple[tuple[slice, slice], MaskImage]:
    """The rectangle that the dilated mask lies in, and the dilated mask inside it."""
    pixels = mask.view(np.uint8)
    u, v, width, height = cv2.boundingRect(pixels)
    if width == 0:
        return (slice(0, 0), slice(0, 0)), mask[:0, :0]
    rows = slice(max(v - radius_px, 0), min(v + height + radius_px, mask.shape[0]))
    columns = slice(max(u - radius_px, 0), min(u + width + radius_px, mask.shape[1]))
    region = (rows, columns)
    if radius_px == 0:
        return region, mask[region]
    return region, cv2.dilate(pixels[region], _disc(radius_px)).view(np.bool_)


@cache
def _disc(radius_px: int) -> npt.NDArray[Any]:
    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius_px + 1, 2 * radius_px + 1))
