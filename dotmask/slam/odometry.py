"""Frame-to-map visual odometry for RGB-D images.

A local map of corners is matched to each new image by projection with a constant-velocity guess, and the pose is
solved from the matches. Moving things are not treated in any special way: what has depth is taken as static, and
only the robust estimation stands against it, as in the common back ends.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dotmask.geometry import back_project, inverse, rotation_from_vector, transform, vector_from_rotation
from dotmask.records import FloatArray, Intrinsics
from dotmask.slam.features import Descriptors, Features
from dotmask.slam.local_map import LocalMap
from dotmask.slam.matching import Matches, match_anywhere, match_near
from dotmask.slam.pose_solver import NEAREST_M, PoseSolver, Solution
from dotmask.slam.settings import REFERENCE_WIDTH_PX, OdometrySettings

CONVINCING_SHARE = 0.5
"""A pose with this share of the previous frame's inliers is taken without a wider search."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OdometryResult:
    """Pose of one frame.

    Attributes:
        T_world_camera: (4, 4).
        inliers: matches that agree with it; all features in the first frame.
        covariance: (6, 6) of its error as a twist in the camera's frame, rotation then translation, against the local
            map; 0 in the first frame, whose pose is given.
        is_relocalised: whether it was found by looks alone, without a guess by the motion before.
    """

    T_world_camera: FloatArray
    inliers: int
    covariance: FloatArray
    is_relocalised: bool


class Odometry:
    """Follows the camera. State changes only with a frame whose pose was found.

    Args:
        intrinsics: of the camera.
        T_world_camera_initial: (4, 4) pose of the first frame that has features.
        settings: parameters.
    """

    def __init__(self, intrinsics: Intrinsics, T_world_camera_initial: FloatArray, settings: OdometrySettings) -> None:
        self._camera, self._settings = intrinsics, settings
        self._scale = intrinsics.width / REFERENCE_WIDTH_PX
        self._solver = PoseSolver(intrinsics, settings)
        self._map = LocalMap(settings.map_points, settings.fusion_depth)
        self._T_camera_world = inverse(T_world_camera_initial)
        self._time_s: float | None = None
        self._velocity = np.zeros(6)  # (rotation vector, translation) per second of T_now_before
        self._frame = 0
        self._last_inliers = 0
        self._is_lost = False

    def start(self, features: Features, time_s: float) -> OdometryResult:
        """Take the first frame as seen from the initial pose."""
        self._time_s, self._last_inliers = time_s, len(features)
        self._add_points(features)
        return OdometryResult(
            T_world_camera=inverse(self._T_camera_world),
            inliers=len(features),
            covariance=np.zeros((6, 6)),
            is_relocalised=False,
        )

    def track(self, features: Features, time_s: float) -> OdometryResult | None:
        """Pose of a frame at `time_s`, or None when too few features agree on one.

        After None the next frame is tried from the last pose that was found, standing still.
        """
        assert self._time_s is not None, "start comes first"
        self._frame += 1
        found = self._locate(features, self._predicted(time_s))
        if found is not None and (not self._is_lost or self._is_certain(found[0])):
            return self._accept(*found, features, time_s, is_relocalised=False)
        matches = match_anywhere(
            self._map.descriptors, features, max_hamming=self._settings.max_hamming, ratio=self._settings.ratio
        )
        solution = self._solve(matches, features)
        if solution is not None and self._is_certain(solution):
            return self._accept(solution, matches, features, time_s, is_relocalised=True)
        self._velocity, self._is_lost = np.zeros(6), True
        return None

    def relocalise(
        self, p_world: FloatArray, descriptors: Descriptors, features: Features, time_s: float
    ) -> OdometryResult | None:
        """Pose of a frame that `track` found none for, by points that the local map has lost, or None.

        Args:
            p_world: (N, 3) points of a place that may be in view; they join the local map if they are.
            descriptors: (N, 32) of the points.
            features: of the frame.
            time_s: of the frame.
        """
        s = self._settings
        matches = match_anywhere(descriptors, features, max_hamming=s.max_hamming, ratio=s.ratio)
        points, corners = matches.T
        solution = self._solver.solve(p_world[points], features.pixels[corners], features.depth_m[corners])
        if solution is None or not self._is_certain(solution):
            return None
        first = self._map.add(p_world, descriptors, self._frame)
        matches[:, 0] += first
        return self._accept(solution, matches, features, time_s, is_relocalised=True)

    def _is_certain(self, solution: Solution) -> bool:
        """Whether a pose that no motion before it speaks for is the place, and not one that looks like it."""
        s, sigma_m = self._settings, float(np.sqrt(np.trace(solution.covariance[3:, 3:])))
        return len(solution.inliers) >= s.relocalisation_inliers and sigma_m <= s.relocalisation_sigma_m

    def _accept(
        self, solution: Solution, matches: Matches, features: Features, time_s: float, *, is_relocalised: bool
    ) -> OdometryResult:
        """Take the pose as that of the frame, and teach the local map what was seen from it."""
        assert self._time_s is not None
        # A camera that was found again may have been anywhere in between.
        self._velocity = (
            np.zeros(6)
            if is_relocalised
            else _velocity(self._T_camera_world, solution.T_camera_world, time_s - self._time_s)
        )
        self._T_camera_world, self._time_s = solution.T_camera_world, time_s
        self._last_inliers, self._is_lost = len(solution.inliers), False
        T_world_camera = inverse(solution.T_camera_world)

        points, corners = matches[solution.inliers].T
        seen = back_project(features.pixels[corners], features.depth_m[corners], self._camera)
        self._map.observe(points, transform(T_world_camera, seen), self._frame)
        if len(points) < self._settings.insert_below * len(features):
            unmatched = np.ones(len(features), np.bool_)
            unmatched[matches[:, 1]] = False
            self._add_points(features.select(unmatched))
        return OdometryResult(
            T_world_camera=T_world_camera,
            inliers=len(points),
            covariance=solution.covariance,
            is_relocalised=is_relocalised,
        )

    def _add_points(self, features: Features) -> None:
        p_camera = back_project(features.pixels, features.depth_m, self._camera)
        self._map.add(transform(inverse(self._T_camera_world), p_camera), features.descriptors, self._frame)

    def _predicted(self, time_s: float) -> FloatArray:
        """`T_camera_world` at `time_s` with the velocity of the last step."""
        assert self._time_s is not None
        motion = self._velocity * (time_s - self._time_s)
        T_now_before = np.eye(4)
        T_now_before[:3, :3] = rotation_from_vector(motion[:3])
        T_now_before[:3, 3] = motion[3:]
        return np.asarray(T_now_before @ self._T_camera_world)

    def _locate(self, features: Features, T_camera_world_guess: FloatArray) -> tuple[Solution, Matches] | None:
        """Pose and matches: by a small window, then by a wide one, until one is convincing."""
        s = self._settings
        best: tuple[Solution, Matches] | None = None
        visible, expected_px = self._visible(T_camera_world_guess)
        for radius_px in (s.search_radius_px, s.wide_search_radius_px):
            matches = match_near(
                expected_px,
                self._map.descriptors[visible],
                features,
                radius_px=radius_px * self._scale,
                max_hamming=s.max_hamming,
                ratio=s.ratio,
            )
            matches[:, 0] = visible[matches[:, 0]]
            best = _better(best, self._solve(matches, features), matches)
            # A sudden fall of the inliers means that the guess was off, and the window held only some of them.
            if best is not None and len(best[0].inliers) >= CONVINCING_SHARE * self._last_inliers:
                return best
        return best

    def _solve(self, matches: Matches, features: Features) -> Solution | None:
        points, corners = matches.T
        return self._solver.solve(self._map.p_world[points], features.pixels[corners], features.depth_m[corners])

    def _visible(self, T_camera_world: FloatArray) -> tuple[npt.NDArray[np.intp], FloatArray]:
        """Map points that may be in view from there: indices (K,) and expected pixels (K, 2)."""
        camera = self._camera
        x, y, z = transform(T_camera_world, self._map.p_world).T
        safe_z = np.maximum(z, NEAREST_M)
        u, v = camera.fx * x / safe_z + camera.cx, camera.fy * y / safe_z + camera.cy
        margin = self._settings.wide_search_radius_px * self._scale
        inside = (u > -margin) & (u < camera.width + margin) & (v > -margin) & (v < camera.height + margin)
        visible = np.flatnonzero(inside & (z > NEAREST_M))
        return visible, np.stack([u[visible], v[visible]], axis=1)


def _better(
    best: tuple[Solution, Matches] | None, solution: Solution | None, matches: Matches
) -> tuple[Solution, Matches] | None:
    """The one with more inliers."""
    if solution is None or (best is not None and len(best[0].inliers) >= len(solution.inliers)):
        return best
    return solution, matches


def _velocity(T_before_world: FloatArray, T_now_world: FloatArray, duration_s: float) -> FloatArray:
    T_now_before = T_now_world @ inverse(T_before_world)
    return np.concatenate([vector_from_rotation(T_now_before[:3, :3]), T_now_before[:3, 3]]) / duration_s
