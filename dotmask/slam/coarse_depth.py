"""A thinned-out depth image per keyframe, and whether two of them can both be true under a relative pose.

A wrong relative pose may find many corners that agree (a poster that hangs twice, a shirt that walked on), but hardly
ever surfaces that agree: it puts surfaces of one image where the other one has looked through.
"""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
import numpy.typing as npt

from dotmask.geometry import back_project, transform
from dotmask.records import DepthImage, FloatArray, Intrinsics
from dotmask.slam.settings import REFERENCE_WIDTH_PX

STEP_PX = 8
"""Every how many pixels depth is kept, at the reference width."""
NEAREST_M = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthAgreement:
    """How the surfaces of one image fit another one.

    Attributes:
        overlap: share of the first image's samples that fall where the second has depth.
        agreeing: share of those that lie on the second's surface.
        violating: share of those that lie in front of it, where the second has seen nothing.
    """

    overlap: float
    agreeing: float
    violating: float


@dataclass(frozen=True, kw_only=True, eq=False)
class CoarseDepth:
    """Samples of a depth image at every `step_px`-th pixel of both axes, from (0, 0).

    Attributes:
        intrinsics: of the whole image.
        step_px: distance of the samples.
        depth_m: (H', W') float32, 0 = no return or masked.
    """

    intrinsics: Intrinsics
    step_px: int
    depth_m: DepthImage

    @classmethod
    def of(cls, depth_m: DepthImage, intrinsics: Intrinsics) -> "CoarseDepth":
        """The samples of a depth image (H, W)."""
        step_px = max(round(STEP_PX * intrinsics.width / REFERENCE_WIDTH_PX), 1)
        return cls(intrinsics=intrinsics, step_px=step_px, depth_m=depth_m[::step_px, ::step_px].copy())

    @cached_property
    def points_camera(self) -> FloatArray:
        """(N, 3) the samples that have depth, metres."""
        v, u = np.nonzero(self.depth_m)
        pixels = (np.stack([u, v], axis=1) * self.step_px).astype(np.float64)
        return back_project(pixels, self.depth_m[v, u].astype(np.float64), self.intrinsics)

    @cached_property
    def _range_m(self) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
        """Nearest and furthest depth of each sample and its eight neighbours; the nearest is 0 where one has none."""
        block = np.ones((3, 3), np.uint8)
        return np.asarray(cv2.erode(self.depth_m, block)), np.asarray(cv2.dilate(self.depth_m, block))

    def agreement(self, other: "CoarseDepth", T_self_other: FloatArray, tolerance: float) -> DepthAgreement:
        """How the surfaces of `other` fit this image.

        Args:
            other: the image whose samples are looked at.
            T_self_other: (4, 4).
            tolerance: share of the depth by which a point may be off the surface around it.
        """
        camera = self.intrinsics
        points = transform(T_self_other, other.points_camera)
        x, y, z = points[points[:, 2] > NEAREST_M].T
        u = np.rint((camera.fx * x / z + camera.cx) / self.step_px)
        v = np.rint((camera.fy * y / z + camera.cy) / self.step_px)
        rows, columns = self.depth_m.shape
        inside = (u >= 0) & (u < columns) & (v >= 0) & (v < rows)
        at = v[inside].astype(np.intp), u[inside].astype(np.intp)
        near_m, far_m = (image[at].astype(np.float64) for image in self._range_m)
        z = z[inside]
        known = near_m > 0
        count = int(known.sum())
        if count == 0:
            return DepthAgreement(overlap=0.0, agreeing=0.0, violating=0.0)
        in_front = known & (z < near_m * (1 - tolerance))
        on_surface = known & ~in_front & (z <= far_m * (1 + tolerance))
        return DepthAgreement(
            overlap=count / len(other.points_camera),
            agreeing=int(on_surface.sum()) / count,
            violating=int(in_front.sum()) / count,
        )
