"""The masked depth images MDI and MO-MDI (paper, section III and the figure "Architecture of DOTMask")."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dotmask.geometry import inverse, transform
from dotmask.mask_geometry import disc_half_widths, enclosing_rectangle, moved_mask
from dotmask.mask_kernels import clear_grown
from dotmask.profiles import MaskGrowth, Profile
from dotmask.records import DepthImage, Detections, FloatArray, Intrinsics, MaskedDepth, MaskImage, Track, TrackPhase


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cutout:
    """One region that is removed from the depth.

    Attributes:
        mask: (H, W) bool.
        radius_px: by which it grows before.
        is_moving: whether it goes from the MO-MDI; all go from the MDI.
        box_px: (4,) `u_min, v_min, u_max, v_max`, where the mask is looked for first; only the time depends on it.
    """

    mask: MaskImage
    radius_px: int
    is_moving: bool
    box_px: FloatArray | None = None


def all_cutouts(detections: Detections, profile: Profile) -> tuple[Cutout, ...]:
    """Every object of interest as if it moved."""
    radius_px = round(profile.growth.base_px)
    return tuple(
        Cutout(mask=mask, radius_px=radius_px, is_moving=True, box_px=box)
        for mask, box in zip(detections.masks, detections.boxes_px, strict=True)
    )


def choose_cutouts(
    detections: Detections,
    tracks: Sequence[Track],
    T_world_camera: FloatArray,
    camera_velocity_world: FloatArray,
    intrinsics: Intrinsics,
    profile: Profile,
) -> tuple[Cutout, ...]:
    """What is removed from a frame's depth, and from which image.

    A detection without a track has no valid depth: nothing is known of it, so it is removed as if it moved. A moving
    track that was not seen for up to `profile.coasting_mask_frames` frames is removed where it is predicted: a
    detector that misses a walking person once does not let it into the map.

    Args:
        detections: objects of interest of the frame.
        tracks: after the frame, with verdicts.
        T_world_camera: (4, 4) camera pose at the frame.
        camera_velocity_world: (3,) metres per second.
        intrinsics: of the camera.
        profile: growth of the masks, and for how long unseen tracks are removed.
    """
    T_camera_world = inverse(T_world_camera)

    def radius_px(track: Track | None) -> int:
        if track is None:
            return round(profile.growth.base_px)
        velocity_camera = T_camera_world[:3, :3] @ (track.velocity_world - camera_velocity_world)
        return growth_px(transform(T_camera_world, track.position_world), velocity_camera, intrinsics, profile.growth)

    seen = {track.detection_index: track for track in tracks if track.detection_index is not None}
    cutouts = []
    for index, mask in enumerate(detections.masks):
        track = seen.get(index)
        cutouts.append(
            Cutout(
                mask=mask,
                radius_px=radius_px(track),
                is_moving=track is None or _is_moving(track),
                box_px=detections.boxes_px[index],
            )
        )
    for track in tracks:
        if track.phase is TrackPhase.COASTING and track.misses <= profile.coasting_mask_frames and _is_moving(track):
            p_camera = transform(T_camera_world, track.position_world)
            mask = moved_mask(track.mask, track.mask_position_camera, p_camera, intrinsics)
            cutouts.append(Cutout(mask=mask, radius_px=radius_px(track), is_moving=True))
    return tuple(cutouts)


def growth_px(p_camera: FloatArray, velocity_camera: FloatArray, intrinsics: Intrinsics, growth: MaskGrowth) -> int:
    """By how many pixels a mask grows: its own error, a margin in metres, and the way during the delay of the depth.

    Args:
        p_camera: (3,) where the object is, metres.
        velocity_camera: (3,) of the object as the camera sees it, metres per second, camera axes.
        intrinsics: of the camera.
        growth: parameters.
    """
    px_per_m = intrinsics.fx / max(float(p_camera[2]), growth.nearest_m)
    sideways_m = float(np.hypot(velocity_camera[0], velocity_camera[1])) * growth.depth_delay_s
    return round(min(growth.base_px + (growth.margin_m + sideways_m) * px_per_m, growth.most_px))


def mask_depth(depth_m: DepthImage, cutouts: Sequence[Cutout]) -> MaskedDepth:
    """Depth without the moving objects (MO-MDI) and without all objects of interest (MDI).

    Every pixel of the result is the input's depth or 0, and a pixel is removed if any cut-out covers it: their order
    does not matter.

    Args:
        depth_m: (H, W) float32 metres, 0 = none; stays as it is.
        cutouts: what is removed.
    """
    # One block for both: the system gives and takes back memory once, and not image by image.
    mo_mdi, mdi = np.empty((2, *depth_m.shape), np.float32)
    np.copyto(mo_mdi, depth_m)
    _remove(mo_mdi, [cutout for cutout in cutouts if cutout.is_moving])
    np.copyto(mdi, mo_mdi)
    _remove(mdi, [cutout for cutout in cutouts if not cutout.is_moving])
    return MaskedDepth(mo_mdi_m=mo_mdi, mdi_m=mdi)


def _remove(depth_m: DepthImage, cutouts: Sequence[Cutout]) -> None:
    """Set `depth_m` to 0 under the grown masks, in place."""
    for cutout in cutouts:
        rectangle = enclosing_rectangle(cutout.mask, cutout.box_px)
        clear_grown(depth_m, cutout.mask, *rectangle, disc_half_widths(cutout.radius_px))


def _is_moving(track: Track) -> bool:
    return track.verdict is not None and track.verdict.is_moving
