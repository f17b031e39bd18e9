"""Where people walk: a smooth curve on the floor through waypoints."""

from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from sim.errors import MotionError
from sim.geometry import FloatArray

SPACING_M = 0.01
SMOOTHING_M = 0.10


Way = Literal["loop", "there_and_back", "one_way"]


class WalkPath:
    """A curve with rounded corners, parametrised by arc length.

    Args:
        waypoints_world: (N, 2) metres on the floor.
        way: "loop": through all waypoints, from the last straight to the first. "there_and_back": to the last waypoint
            and back again, with a half circle at both ends; there and back keep to the right, `turn_radius_m` beside
            the straight lines between the waypoints. "one_way": from the first waypoint to the last.
        turn_radius_m: of the corners (smaller where the lines between waypoints are short) and the half circles.

    Attributes:
        length_m: of the loop, or of the way from the first to the last waypoint.

    Raises:
        MotionError: too few waypoints, two the same in a row, or a corner that turns back on itself.
    """

    def __init__(self, waypoints_world: npt.ArrayLike, *, way: Way, turn_radius_m: float = 0.35) -> None:
        corners = np.asarray(waypoints_world, float)
        least = 3 if way == "loop" else 2
        if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < least:
            raise MotionError(f"a way needs at least {least} waypoints (x, y), got an array of shape {corners.shape}")
        if turn_radius_m < 0.2:
            raise MotionError(f"turn_radius_m: {turn_radius_m} is too tight to walk; use 0.2 or more")
        self.is_ring = way != "one_way"
        if way == "there_and_back":
            corners = _there_and_back(corners, turn_radius_m)
        points = _resampled(_rounded(corners, turn_radius_m, self.is_ring), self.is_ring)
        if self.is_ring:
            points = gaussian_filter1d(points, SMOOTHING_M / SPACING_M, axis=0, mode="wrap")
            points = np.vstack([points, points[:1]])
        else:
            # An odd reflection at the ends keeps them, and the directions there, where they are.
            line = np.linspace(points[0], points[-1], len(points))
            ring = np.vstack([points - line, (line - points)[-2:0:-1]])
            points = line + gaussian_filter1d(ring, SMOOTHING_M / SPACING_M, axis=0, mode="wrap")[: len(points)]
        s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        self.length_m = float(s[-1])
        self._curve = CubicSpline(s, points, bc_type="periodic" if self.is_ring else "natural")
        self._first, self._second = self._curve.derivative(1), self._curve.derivative(2)

    def _on(self, s_m: FloatArray) -> FloatArray:
        """Arc lengths as the curve knows them."""
        return np.asarray(np.mod(s_m, self.length_m) if self.is_ring else np.clip(s_m, 0.0, self.length_m))

    def position_at(self, s_m: FloatArray) -> FloatArray:
        """(..., 2) metres in the world, `s_m` metres along the path (any number; the ends of one way are clamped)."""
        return np.asarray(self._curve(self._on(s_m)))

    def heading_at(self, s_m: FloatArray) -> FloatArray:
        """(...) radians from the world's x axis, in (-pi, pi]."""
        d = self._first(self._on(s_m))
        return np.asarray(np.arctan2(d[..., 1], d[..., 0]))

    def curvature_at(self, s_m: FloatArray) -> FloatArray:
        """(...) 1/m, positive to the left."""
        s = self._on(s_m)
        d, dd = self._first(s), self._second(s)
        return np.asarray((d[..., 0] * dd[..., 1] - d[..., 1] * dd[..., 0]) / np.linalg.norm(d, axis=-1) ** 3)

    def nearest(self, point_world: npt.ArrayLike) -> float:
        """Arc length of the first point of the path that is nearest to `point_world` (2,)."""
        s = np.arange(0.0, self.length_m, SPACING_M)
        distance = np.linalg.norm(self.position_at(s) - np.asarray(point_world, float), axis=1)
        return float(s[np.argmax(distance < distance.min() + 1e-3)])


def _directions(corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unit vectors and lengths from each point to the next one."""
    steps = np.diff(corners, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    if lengths.min() < 0.05:
        raise MotionError("two waypoints in a row are the same or nearer than 5 cm: leave one out")
    return steps / lengths[:, None], lengths


def _there_and_back(corners: FloatArray, radius: float) -> FloatArray:
    """The ring of corners that goes along the right-hand side of the line, around its end, and back."""
    directions, lengths = _directions(corners)
    if lengths.sum() < 6 * radius:
        raise MotionError(f"the way is too short to turn with a radius of {radius} m: it needs {6 * radius:.1f} m")
    right = np.stack([directions[:, 1], -directions[:, 0]], axis=1)
    before, after = np.vstack([right[:1], right]), np.vstack([right, right[-1:]])
    cosine = np.sum(before * after, axis=1)
    if cosine.min() < -0.8:
        raise MotionError("a waypoint turns the path back on itself: put a second waypoint beside it")
    offset = radius * (before + after) / (1.0 + cosine)[:, None]
    return np.vstack([corners + offset, (corners - offset)[::-1]])


def _rounded(corners: FloatArray, radius: float, is_ring: bool) -> FloatArray:
    """(m, 2) points of the way with every corner replaced by an arc; one way keeps its ends."""
    directions, lengths = _directions(np.vstack([corners, corners[:1]]) if is_ring else corners)
    points = []
    for i, corner in enumerate(corners):
        if not is_ring and i in (0, len(corners) - 1):
            points.append(corner[None])
            continue
        d_in, d_out = directions[i - 1], directions[i]
        turn = np.arctan2(d_in[0] * d_out[1] - d_in[1] * d_out[0], d_in @ d_out)
        if abs(turn) > np.radians(150.0):
            raise MotionError(f"waypoint {i} turns the path back on itself: put a second waypoint beside it")
        if abs(turn) < 1e-6:
            points.append(corner[None])
            continue
        tangent = min(radius * np.tan(abs(turn) / 2), 0.5 * lengths[i - 1], 0.5 * lengths[i])
        r = tangent / np.tan(abs(turn) / 2)
        left = np.sign(turn) * np.array([-d_in[1], d_in[0]])
        centre = corner - tangent * d_in + r * left
        count = max(3, int(np.ceil(abs(turn) * r / SPACING_M)))
        angle = np.linspace(0.0, abs(turn), count)[:, None]
        points.append(centre - r * np.cos(angle) * left + r * np.sin(angle) * d_in)
    return np.vstack(points)


def _resampled(points: FloatArray, is_ring: bool) -> FloatArray:
    """Points of the way at an even distance of about SPACING_M; of a ring without the first point again."""
    way = np.vstack([points, points[:1]]) if is_ring else points
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    even = np.linspace(0.0, s[-1], max(16, round(float(s[-1]) / SPACING_M)), endpoint=not is_ring)
    return np.stack([np.interp(even, s, way[:, k]) for k in range(2)], axis=1)
