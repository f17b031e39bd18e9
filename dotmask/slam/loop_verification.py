"""Do two keyframes show the same place, and from where? Corners, both directions, and surfaces must agree.

1. Descriptors are matched without any guess, among those whose words are alike; each must be the other's best.
2. PnP RANSAC finds a relative pose; around where it expects each corner the matching is done again.
3. The pose is solved in both directions, each on its own corners and depth. The two must agree with each other; the
   answer is the one halfway between them.
4. The inliers must be many, spread over both images, and must determine the pose well.
5. The surfaces of each image must lie on those of the other, and not where it has looked through.
"""

from dataclasses import dataclass

import numpy as np

from dotmask.geometry import inverse, project, transform
from dotmask.records import FloatArray, Intrinsics
from dotmask.slam.features import Features
from dotmask.slam.keyframes import Keyframe, motion
from dotmask.slam.matching import Matches, match_near, match_within_groups
from dotmask.slam.pose_solver import PoseSolver
from dotmask.slam.settings import REFERENCE_WIDTH_PX, LoopSettings, OdometrySettings
from dotmask.slam.twists import cross, halfway
from dotmask.slam.vocabulary import Vocabulary

CELLS = (6, 8)
"""Rows and columns that an image is divided into, to see whether inliers are spread over it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VerifiedLoop:
    """A relative pose that two keyframes agree on.

    Attributes:
        T_from_to: (4, 4) maps points of the earlier keyframe's camera into the later one's.
        covariance: (6, 6) of its error as a twist in the earlier camera's frame: `T_true = T_from_to exp(twist)`,
            rotation in radians before translation in metres.
        inliers: matches that agree with it.
    """

    T_from_to: FloatArray
    covariance: FloatArray
    inliers: int


class LoopVerifier:
    """Finds the relative pose of two keyframes, or that there is none to be sure of.

    Args:
        intrinsics: of the camera.
        vocabulary: of the words; only descriptors whose words are alike are compared.
        settings: of the features.
        loop_settings: what a loop must fulfil.
    """

    def __init__(
        self, intrinsics: Intrinsics, vocabulary: Vocabulary, settings: OdometrySettings, loop_settings: LoopSettings
    ) -> None:
        self._camera, self._vocabulary, self._settings = intrinsics, vocabulary, loop_settings
        self._solver = PoseSolver(intrinsics, settings)
        self._scale = intrinsics.width / REFERENCE_WIDTH_PX

    def verify(self, later: Keyframe, earlier: Keyframe) -> VerifiedLoop | None:
        """The pose of `earlier` in the camera of `later`, or None."""
        features_from, features_to = later.features, earlier.features
        p_from, p_to = later.p_camera.astype(np.float64), earlier.p_camera.astype(np.float64)
        matches = match_within_groups(
            features_to.descriptors,
            self._vocabulary.parents_of(earlier.words),
            features_from.descriptors,
            self._vocabulary.parents_of(later.words),
            max_hamming=self._settings.max_hamming,
            ratio=self._settings.ratio,
        )
        if len(matches) < self._settings.min_inliers // 2:
            return None
        first = self._solver.solve(
            p_to[matches[:, 0]], features_from.pixels[matches[:, 1]], features_from.depth_m[matches[:, 1]]
        )
        if first is None or len(first.inliers) < self._settings.min_match_share * len(matches):
            return None
        forward = self._directed(first.T_camera_world, p_to, features_to, features_from)
        backward = self._directed(inverse(first.T_camera_world), p_from, features_from, features_to)
        if forward is None or backward is None:
            return None
        T_from_to = halfway(forward[0], inverse(backward[0]))
        apart_m, apart_rad = motion(forward[0], inverse(backward[0]))
        if apart_m > self._settings.max_disagreement_m or apart_rad > self._settings.max_disagreement_rad:
            return None
        to, of = forward[1].T
        if not (self._is_spread(features_from.pixels[of]) and self._is_spread(features_to.pixels[to])):
            return None
        covariance = self._covariance(T_from_to, p_to[to])
        if np.linalg.eigvalsh(covariance[3:, 3:])[-1] > self._settings.max_translation_sigma_m**2:
            return None
        if not (
            self._surfaces_agree(later, earlier, T_from_to) and self._surfaces_agree(earlier, later, inverse(T_from_to))
        ):
            return None
        return VerifiedLoop(T_from_to=T_from_to, covariance=covariance, inliers=len(to))

    def _directed(
        self, T_seen_points: FloatArray, points: FloatArray, of_points: Features, seen: Features
    ) -> tuple[FloatArray, Matches] | None:
        """Pose (4, 4) and inliers (M, 2) of `points` (N, 3) among the corners `seen`, from a pose that is about right.

        Args:
            T_seen_points: (4, 4) the pose.
            points: (N, 3) in the camera that took them.
            of_points: their corners.
            seen: the corners of the other image.
        """
        expected_px = project(transform(T_seen_points, points), self._camera)
        size = np.array([self._camera.width, self._camera.height])
        visible = np.flatnonzero(((expected_px >= 0) & (expected_px < size)).all(axis=1))
        matches = match_near(
            expected_px[visible],
            of_points.descriptors[visible],
            seen,
            radius_px=self._settings.guided_radius_px * self._scale,
            max_hamming=self._settings.max_hamming,
            ratio=self._settings.ratio,
        )
        matches[:, 0] = visible[matches[:, 0]]
        point, corner = matches.T
        solution = self._solver.solve(points[point], seen.pixels[corner], seen.depth_m[corner])
        if solution is None or len(solution.inliers) < self._settings.min_inliers:
            return None
        return solution.T_camera_world, matches[solution.inliers]

    def _is_spread(self, pixels: FloatArray) -> bool:
        """Whether corners (N, 2) lie in enough cells of the image."""
        rows, columns = CELLS
        u = (pixels[:, 0] * columns / self._camera.width).astype(np.intp)
        v = (pixels[:, 1] * rows / self._camera.height).astype(np.intp)
        return len(np.unique(v * columns + u)) >= self._settings.min_cells

    def _covariance(self, T_from_to: FloatArray, points: FloatArray) -> FloatArray:
        """Covariance (6, 6) of a pose from inliers (N, 3): the inverse of the information of pixels and depths.

        With `Y = T exp(twist) X`, `dY = R (w x X + t)`.
        """
        R = T_from_to[:3, :3]
        dY = np.concatenate([-R @ cross(points), np.broadcast_to(R, (len(points), 3, 3))], axis=2)
        x, y, z = transform(T_from_to, points).T
        # One over the standard deviation, of u, v and depth; depth has an error in both images.
        sharp_u, sharp_v = (
            f / (self._settings.pixel_sigma_px * self._scale * z) for f in (self._camera.fx, self._camera.fy)
        )
        sharp_z = 1.0 / (np.sqrt(2.0) * self._solver.depth_sigma(z))
        rows = np.concatenate(
            [
                sharp_u[:, None] * (dY[:, 0] - (x / z)[:, None] * dY[:, 2]),
                sharp_v[:, None] * (dY[:, 1] - (y / z)[:, None] * dY[:, 2]),
                sharp_z[:, None] * dY[:, 2],
            ]
        )
        # einsum of two operands sums in a fixed order; a BLAS product may not, for another number of threads.
        information = np.einsum("ni,nj->ij", rows, rows)
        regular = information + 1e-9 * np.trace(information) * np.eye(6)
        covariance = np.linalg.inv(regular)
        return np.asarray((covariance + covariance.T) / 2)

    def _surfaces_agree(self, seen: Keyframe, other: Keyframe, T_seen_other: FloatArray) -> bool:
        s = self._settings
        found = seen.depth.agreement(other.depth, T_seen_other, s.depth_tolerance)
        return (
            found.overlap >= s.min_overlap and found.agreeing >= s.min_agreeing and found.violating <= s.max_violating
        )
