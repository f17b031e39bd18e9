"""Camera pose and its covariance from matched map points: PnP RANSAC, then robust least squares on pixels and depth."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from dotmask.geometry import rotation_from_vector, transform
from dotmask.records import FloatArray, Intrinsics
from dotmask.slam.pose_kernels import normal_equations
from dotmask.slam.settings import REFERENCE_WIDTH_PX, OdometrySettings

RANSAC_ITERATIONS = 300
RANSAC_CONFIDENCE = 0.9999
REFINEMENTS = 3
GAUSS_NEWTON_STEPS = 6
CONVERGED = 1e-6
"""Last increment of a refinement, radians and metres."""
NEAREST_M = 0.05
"""Points nearer than this to the image plane are not projected."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution:
    """Pose and what supports it.

    Attributes:
        T_camera_world: (4, 4).
        inliers: (K,) indices into the matches.
        covariance: (6, 6) of the pose's error as a twist in the camera's frame, rotation then translation: what the
            spread of the residuals says, with the map points as they are.
    """

    T_camera_world: FloatArray
    inliers: npt.NDArray[np.intp]
    covariance: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Seen:
    """N matched points, with what a residual needs that does not depend on the pose.

    Attributes:
        p_world: (N, 3) metres.
        x, y: (N,) where they are seen: pixels of the reference width, from the principal point.
        depth_m: (N,) measured.
        inverse_sigma: (N,) of the depth, 1/m.
    """

    p_world: FloatArray
    x: FloatArray
    y: FloatArray
    depth_m: FloatArray
    inverse_sigma: FloatArray


class PoseSolver:
    """Solves for the pose of a calibrated RGB-D camera.

    Args:
        intrinsics: of the camera.
        settings: thresholds; those in pixels are scaled to the image width.
    """

    def __init__(self, intrinsics: Intrinsics, settings: OdometrySettings) -> None:
        self._camera, self._settings = intrinsics, settings
        self._scale = intrinsics.width / REFERENCE_WIDTH_PX

    def depth_sigma(self, depth_m: FloatArray) -> FloatArray:
        """Standard deviation of a measured depth, metres."""
        s = self._settings
        return np.asarray(s.depth_sigma_floor_m + s.depth_sigma_growth_per_m * depth_m**2)

    def solve(self, p_world: FloatArray, pixels: FloatArray, depth_m: FloatArray) -> Solution | None:
        """The pose that most matches agree with, or None when too few do.

        Minimal sets by AP3P (Ke & Roumeliotis, CVPR 2017) in OpenCV's RANSAC, whose random numbers start from the
        same state in every call. Then the pose is refined on the inliers, and the inliers are chosen again among
        all matches.

        Args:
            p_world: (N, 3) matched map points.
            pixels: (N, 2) where they are seen.
            depth_m: (N,) the depth measured there.
        """
        s = self._settings
        if len(p_world) < s.min_inliers:
            return None
        found, rotation, translation, chosen = cv2.solvePnPRansac(
            p_world,
            pixels,
            self._camera.matrix,
            None,
            iterationsCount=RANSAC_ITERATIONS,
            reprojectionError=s.ransac_px * self._scale,
            confidence=RANSAC_CONFIDENCE,
            flags=cv2.SOLVEPNP_AP3P,
        )
        if not found or chosen is None or len(chosen) < s.min_inliers // 2:
            return None
        T_camera_world = _rigid(np.asarray(rotation[:, 0], float), np.asarray(translation[:, 0], float))
        inliers = chosen[:, 0].astype(np.intp)
        for _ in range(REFINEMENTS):
            if not np.isfinite(T_camera_world).all() or len(inliers) < s.min_inliers // 2:
                return None
            T_camera_world = self.refine(T_camera_world, p_world[inliers], pixels[inliers], depth_m[inliers])
            again = self._agreeing(T_camera_world, p_world, pixels, depth_m)
            settled = np.array_equal(again, inliers)
            inliers = again
            if settled:
                break
        if len(inliers) < s.min_inliers:
            return None
        return Solution(
            T_camera_world=T_camera_world,
            inliers=inliers,
            covariance=self._covariance(T_camera_world, p_world[inliers], pixels[inliers], depth_m[inliers]),
        )

    def refine(
        self, T_camera_world: FloatArray, p_world: FloatArray, pixels: FloatArray, depth_m: FloatArray
    ) -> FloatArray:
        """Gauss-Newton on the pose alone with Huber weights, from the start `T_camera_world`.

        Residuals: `u` and `v` in pixels of the reference width (one common weight), and depth in standard deviations.
        The increment is a twist from the left; see `dotmask.slam.pose_kernels.normal_equations`.
        """
        T, seen = T_camera_world, self._seen(p_world, pixels, depth_m)
        for _ in range(GAUSS_NEWTON_STEPS):
            hessian, gradient, _ = self._normal_equations(T, seen)
            step = np.asarray(-np.linalg.solve(hessian, gradient), float)
            T = _rigid(step[:3], step[3:]) @ T
            if np.abs(step).max() < CONVERGED:
                break
        return T

    def _seen(self, p_world: FloatArray, pixels: FloatArray, depth_m: FloatArray) -> _Seen:
        camera, scale = self._camera, self._scale
        return _Seen(
            p_world=p_world,
            x=(pixels[:, 0] - camera.cx) / scale,
            y=(pixels[:, 1] - camera.cy) / scale,
            depth_m=depth_m,
            inverse_sigma=1.0 / self.depth_sigma(depth_m),
        )

    def _normal_equations(self, T_camera_world: FloatArray, seen: _Seen) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Hessian (6, 6) of the loss, a little damped, its gradient (6,), and the matches' squared gradients (6, 6)."""
        camera, scale = self._camera, self._scale
        hessian, gradient, spread = normal_equations(
            T_camera_world,
            seen.p_world,
            seen.x,
            seen.y,
            seen.depth_m,
            seen.inverse_sigma,
            camera.fx / scale,
            camera.fy / scale,
            self._settings.huber,
            NEAREST_M,
        )
        hessian.ravel()[::7] += 1e-9 * hessian.trace()
        return hessian, gradient, spread

    def _covariance(
        self, T_camera_world: FloatArray, p_world: FloatArray, pixels: FloatArray, depth_m: FloatArray
    ) -> FloatArray:
        """(6, 6) of the twist by the sandwich estimator `H⁻¹ (Σ gᵢ gᵢᵀ) H⁻¹` (Huber 1967, White 1982).

        `gᵢ` is the gradient of the three residuals of a match, which need not be independent. So the noise needs no
        model: it is read off the residuals.
        """
        hessian, _, spread = self._normal_equations(T_camera_world, self._seen(p_world, pixels, depth_m))
        inverse_hessian = np.linalg.inv(hessian)
        # Six numbers were fitted to the residuals, which are the smaller for it.
        freedom = 3 * len(depth_m) / (3 * len(depth_m) - 6)
        covariance = freedom * inverse_hessian @ spread @ inverse_hessian
        return np.asarray((covariance + covariance.T) / 2)

    def _agreeing(
        self, T_camera_world: FloatArray, p_world: FloatArray, pixels: FloatArray, depth_m: FloatArray
    ) -> npt.NDArray[np.intp]:
        """Indices of the matches that agree with the pose in the image and in depth."""
        s, camera = self._settings, self._camera
        x, y, z = transform(T_camera_world, p_world).T
        safe_z = np.maximum(z, NEAREST_M)
        error_px = np.hypot(
            camera.fx * x / safe_z + camera.cx - pixels[:, 0], camera.fy * y / safe_z + camera.cy - pixels[:, 1]
        )
        in_image = (error_px < s.inlier_px * self._scale) & (z > NEAREST_M)
        return np.flatnonzero(in_image & (np.abs(z - depth_m) < s.inlier_sigmas * self.depth_sigma(depth_m)))


def _rigid(rotation: FloatArray, translation: FloatArray) -> FloatArray:
    """(4, 4) of a rotation vector (3,), radians, and a translation (3,)."""
    T = np.eye(4)
    T[:3, :3] = rotation_from_vector(rotation)
    T[:3, 3] = translation
    return T
