"""Judges a map of points: ghosts of what can move, distance to the static surface, and how much of it is there.

Points and surface are compared as they lie, without an alignment: the first true pose fixes the world that SLAM reports
in, so an error of the trajectory is an error of the map.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from dotmask.geometry import inverse, project, transform
from dotmask.records import DepthImage, FloatArray, Intrinsics, MaskImage

COMPLETE_M = 0.05
"""A piece of the surface is in the map when a point of the map is as near as this."""

IN_FRONT_M = 0.1
"""A measurement shows something else than the static world when it is so much nearer, grown by the factor below ..."""

IN_FRONT_PER_M2 = 0.01
"""... times the square of its depth, metres: three standard deviations of the noise, and a step of the disparity."""

AROUND_PX = 4
"""The depth of a pixel may be that of a pixel of the static world so far beside it."""

SEEN_MARGIN_M = 0.02
"""A piece of the surface is what a pixel shows when it is no farther behind the depth of that pixel ..."""

SEEN_SHARE = 0.01
"""... than this margin and this share of the depth."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SurfaceSamples:
    """The static surface as points that stand for equal pieces of its area.

    Attributes:
        points_m: (S, 3) world, metres.
        normals: (S, 3) unit, outward.
        spacing_m: square root of the area that a point stands for.
    """

    points_m: FloatArray
    normals: FloatArray
    spacing_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class MapErrors:
    """Figures of one map; None where there is nothing to measure them on.

    Attributes:
        points: of the map.
        ghost_fraction: share of them that are ghosts.
        accuracy_m: mean distance to the static surface of those that are none.
        accuracy_median_m: median of the same.
        completeness: share of the observable static surface that has a point of the map that is no ghost within 5 cm.
    """

    points: int
    ghost_fraction: float | None
    accuracy_m: float | None
    accuracy_median_m: float | None
    completeness: float | None


def shows_ghost(depth_m: DepthImage, is_actor: npt.NDArray[np.bool_], static_depth_m: DepthImage) -> MaskImage:
    """Which pixels (H, W) measured something that can move.

    A pixel did if an actor is there in truth, or if it measured something well in front of all that the static world
    has within a few pixels: with depth and colour of different moments, an actor's depth lies beside the actor.

    Args:
        depth_m: (H, W) as the sensor gave it, metres, 0 = none.
        is_actor: (H, W) true pixels of all that can move, whether it moves or not.
        static_depth_m: (H, W) true depth of the same view without actors, 0 = nothing hit.
    """
    window = np.ones((2 * AROUND_PX + 1,) * 2, np.uint8)
    nothing = np.float32(np.inf)
    nearest = cv2.erode(np.where(static_depth_m > 0, static_depth_m, nothing), window)
    margin = np.float32(IN_FRONT_M) + np.float32(IN_FRONT_PER_M2) * depth_m * depth_m
    return np.asarray((depth_m > 0) & (is_actor | (depth_m < nearest - margin)))


def seen_samples(
    samples: SurfaceSamples,
    static_depth_m: DepthImage,
    intrinsics: Intrinsics,
    T_world_camera: FloatArray,
    range_m: tuple[float, float],
) -> npt.NDArray[np.bool_]:
    """Which samples (S,) a camera sees in the static world: in the image and in range, facing it, hidden by nothing.

    Args:
        samples: of the static surface.
        static_depth_m: (H, W) true depth without actors, metres, 0 = nothing hit.
        intrinsics: of the camera.
        T_world_camera: (4, 4) its true pose.
        range_m: nearest and farthest depth that the map uses.
    """
    seen = np.zeros(len(samples.points_m), np.bool_)
    ray = samples.points_m - T_world_camera[:3, 3]
    z = ray[:, 0] * T_world_camera[0, 2] + ray[:, 1] * T_world_camera[1, 2] + ray[:, 2] * T_world_camera[2, 2]
    asked = np.flatnonzero((z >= range_m[0]) & (z <= range_m[1]))
    asked = asked[(ray[asked] * samples.normals[asked]).sum(axis=1) < 0]
    u, v = np.rint(project(transform(inverse(T_world_camera), samples.points_m[asked]), intrinsics)).T
    inside = (u >= 0) & (v >= 0) & (u < intrinsics.width) & (v < intrinsics.height)
    asked, u, v = asked[inside], u[inside].astype(np.intp), v[inside].astype(np.intp)
    depth = static_depth_m[v, u].astype(np.float64)
    seen[asked] = z[asked] <= depth + SEEN_MARGIN_M + SEEN_SHARE * depth
    return seen


def map_errors(
    points_m: FloatArray,
    is_ghost: npt.NDArray[np.bool_],
    samples: SurfaceSamples,
    is_observable: npt.NDArray[np.bool_],
) -> MapErrors:
    """Score a map.

    Args:
        points_m: (N, 3) of the map, world, metres.
        is_ghost: (N,).
        samples: of the whole static surface.
        is_observable: (S,) which of them the camera saw where nothing that can move stood in its way.
    """
    static = points_m[~is_ghost]
    distances = surface_distances(static, samples)
    observable = samples.points_m[is_observable]
    completeness = None
    if len(observable):
        nearest = cKDTree(static).query(observable, distance_upper_bound=COMPLETE_M)[0] if len(static) else [np.inf]
        completeness = float(np.isfinite(nearest).mean())
    return MapErrors(
        points=len(points_m),
        ghost_fraction=float(is_ghost.mean()) if len(points_m) else None,
        accuracy_m=float(distances.mean()) if len(static) else None,
        accuracy_median_m=float(np.median(distances)) if len(static) else None,
        completeness=completeness,
    )


def surface_distances(points_m: FloatArray, samples: SurfaceSamples) -> FloatArray:
    """(N,) distance of points (N, 3) to the surface, metres.

    The surface around a sample is a disc in its tangent plane, as wide as the spacing of the samples: so the
    distance to a plane is exact, and at an edge it is off by no more than the spacing.
    """
    if not len(points_m):
        return np.empty(0)
    nearest = cKDTree(samples.points_m).query(points_m)[1]
    offset = points_m - samples.points_m[nearest]
    across = (offset * samples.normals[nearest]).sum(axis=1)
    along = np.sqrt(np.maximum((offset**2).sum(axis=1) - across**2, 0.0))
    return np.asarray(np.hypot(across, np.maximum(along - samples.spacing_m, 0.0)))
