"""Corners with descriptors and depth: Shi-Tomasi (CVPR 1994) with ORB descriptors (Rublee et al., ICCV 2011)."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from dotmask.records import DepthImage, FloatArray, Intrinsics
from dotmask.slam.settings import REFERENCE_WIDTH_PX, OdometrySettings

Descriptors = npt.NDArray[np.uint8]
GreyImage = npt.NDArray[np.uint8]

PATCH_PX = 31
"""Side of the image patch that an ORB descriptor looks at."""

SUBPIXEL_PX = 3
"""Half side of the window of the sub-pixel refinement, and the furthest it moves a corner."""

SUBPIXEL_CRITERIA = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 10, 0.03)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Features:
    """Corners of one image.

    Attributes:
        pixels: (N, 2) float64 `u, v`.
        descriptors: (N, 32) uint8, 256 bits each.
        depth_m: (N,) float64, z.
    """

    pixels: FloatArray
    descriptors: Descriptors
    depth_m: FloatArray

    def __len__(self) -> int:
        """The number of corners."""
        return len(self.pixels)

    def select(self, chosen: npt.NDArray[np.intp] | npt.NDArray[np.bool_]) -> "Features":
        """The corners `chosen` (indices or a mask)."""
        return Features(pixels=self.pixels[chosen], descriptors=self.descriptors[chosen], depth_m=self.depth_m[chosen])


class FeatureExtractor:
    """Finds corners where there is depth.

    Args:
        intrinsics: gives the image size.
        settings: how many corners, and how far apart.
    """

    def __init__(self, intrinsics: Intrinsics, settings: OdometrySettings) -> None:
        self._settings = settings
        scale = intrinsics.width / REFERENCE_WIDTH_PX
        self._distance_px = max(settings.corner_distance_px * scale, 2.0)
        self._border_px = max(round(settings.border_px * scale), 1)
        self._kernel = np.ones((2 * self._border_px + 1,) * 2, np.uint8)
        # Sub-pixel refinement may move a corner outwards; the descriptor must still find its whole patch there.
        self._edge_px = PATCH_PX // 2 + 1 + SUBPIXEL_PX + 1
        self._orb = cv2.ORB.create(nfeatures=settings.features, nlevels=1, edgeThreshold=PATCH_PX // 2 + 1)

    def extract(self, grey: GreyImage, depth_m: DepthImage) -> Features:
        """Corners of `grey` (H, W), with the depth of `depth_m` (H, W; 0 = none or masked)."""
        s, edge = self._settings, self._edge_px
        usable = cv2.inRange(depth_m, np.nextafter(s.min_depth_m, 1.0), s.max_depth_m)
        usable = cv2.erode(usable, self._kernel)
        usable[:edge], usable[-edge:], usable[:, :edge], usable[:, -edge:] = 0, 0, 0, 0
        corners = cv2.goodFeaturesToTrack(
            grey, s.features, s.corner_quality, self._distance_px, mask=usable, blockSize=3
        )
        if corners is None:
            return _NO_FEATURES
        corners = cv2.cornerSubPix(grey, corners, (SUBPIXEL_PX, SUBPIXEL_PX), (-1, -1), SUBPIXEL_CRITERIA)
        # Keypoints without an angle give upright descriptors.
        keypoints = cv2.KeyPoint.convert(corners[:, 0], size=PATCH_PX, response=0.0)  # type: ignore[call-overload]
        described, descriptors = self._orb.compute(grey, keypoints)
        assert len(described) == len(corners), "every patch lies inside the image"
        pixels = corners[:, 0].astype(np.float64)
        depth, on_one_surface = self._depth_at(pixels, depth_m)
        return Features(pixels=pixels, descriptors=np.asarray(descriptors, dtype=np.uint8), depth_m=depth).select(
            on_one_surface
        )

    def within(self, features: Features, depth_m: DepthImage) -> Features:
        """Those of `features` that have depth and stand on one surface in `depth_m` (H, W; 0 = none or masked) too."""
        depth, on_one_surface = self._depth_at(features.pixels, depth_m)
        return Features(pixels=features.pixels, descriptors=features.descriptors, depth_m=depth).select(on_one_surface)

    def _depth_at(self, pixels: FloatArray, depth_m: DepthImage) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
        """Depth at each corner (N,), and whether all around it is valid and of one surface."""
        s = self._settings
        height, width = depth_m.shape
        u = np.rint(pixels[:, 0]).astype(np.intp)
        v = np.rint(pixels[:, 1]).astype(np.intp)
        reach = np.array([-self._border_px, 0, self._border_px])
        rows = (v[:, None, None] + reach[None, :, None]).clip(0, height - 1)
        columns = (u[:, None, None] + reach[None, None, :]).clip(0, width - 1)
        around = depth_m[rows, columns].reshape(len(u), 9).astype(np.float64)
        depth = around[:, 4]
        near, far = around.min(axis=1), around.max(axis=1)
        return depth, (near > s.min_depth_m) & (depth < s.max_depth_m) & (far - near < s.max_depth_step * depth)


_NO_FEATURES = Features(pixels=np.zeros((0, 2)), descriptors=np.zeros((0, 32), np.uint8), depth_m=np.zeros(0))
