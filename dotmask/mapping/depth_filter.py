"""Which depth a map may trust: not what is far, at a jump of the depth, or at the border of a hole or a mask."""

import cv2
import numpy as np

from dotmask.mapping.settings import MappingSettings
from dotmask.records import DepthImage


def trusted_depth(depth_m: DepthImage, settings: MappingSettings) -> DepthImage:
    """The depth image (H, W), metres, with 0 where it is not fit for the map.

    Args:
        depth_m: (H, W) metres, 0 = none or masked.
        settings: range, and distances from edges and holes.
    """
    has_depth = depth_m > 0
    # Seen from a hole everything is infinitely far, and infinitely near: neither makes an edge with its neighbours.
    nearest = cv2.erode(np.where(has_depth, depth_m, np.float32(np.inf)), np.ones((3, 3), np.uint8))
    farthest = cv2.dilate(depth_m, np.ones((3, 3), np.uint8))
    is_edge = has_depth & (farthest - nearest > np.float32(settings.edge_jump) * depth_m)
    edge_px, hole_px = (settings.at_width(px, depth_m.shape[1]) for px in (settings.edge_px, settings.hole_px))
    lost = _grown(is_edge, edge_px) | _grown(~has_depth, hole_px)
    in_range = (depth_m >= np.float32(settings.nearest_m)) & (depth_m <= np.float32(settings.farthest_m))
    return np.where(in_range & ~lost, depth_m, np.float32(0))


def _grown(mask: np.ndarray, radius_px: int) -> np.ndarray:
    """A mask (H, W) grown by a square of `2 radius_px + 1` pixels."""
    window = np.ones((2 * radius_px + 1,) * 2, np.uint8)
    return np.asarray(cv2.dilate(mask.view(np.uint8), window) > 0)
