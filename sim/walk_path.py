"""Where people walk: a smooth closed curve on the floor through waypoints."""

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from sim.errors import MotionError
from sim.geometry import FloatArray

SPACING_M = 0.01
SMOOTHING_M = 0.10


class WalkPath:
    """A closed curve with rounded corners, parametrised by arc length.

    Args:
        waypoints_world: (N, 2) metres on the floor.
        closed: True: a loop through all waypoints, from the last straight to the first. False: to the last waypoint and
            back again, with a half circle at both ends; there and back keep to the right, `turn_radius_m` beside the
            straight lines between the waypoints.
        turn_radius_m: of the corners (smaller where the lines between waypoints are short) and the half circles.

    Raises:
        MotionError: too few waypoints, two the same in a row, or a corner that turns back on itself.
    """

    def __init__(self, waypoints_world: npt.ArrayLike, *, closed: bool, turn_radius_m: float = 0.35) -> None:
        corners = np.asarray(waypoints_world, float)
        if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < (3 if closed else 2):
            raise MotionError(
                f"a {'closed' if closed else 'back and forth'} path needs at least "
                f"{3 if closed else 2} waypoints (x, y), got an array of shape {corners.shape}"
            )
        if turn_radius_m < 0.2:
            raise MotionError(f"turn_radius_m: {turn_radius_m} is too tight to walk; use 0.2 or more")
        if not closed:
            corners = _there_and_back(corners, turn_radius_m)
        points = _rounded(corners, turn_radius_m)
        points = _resampled(points)
        points = gaussian_filter1d(points, SMOOTHING_M / SPACING_M, axis=0, mode="wrap")
        ring = np.vstack([points, points[:1]])
        s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))])
        self.length_m = float(s[-1])
        self._curve = CubicSpline(s, ring, bc_type="periodic")
        self._first, self._second = self._curve.derivative(1), self._curve.derivative(2)

    def position_at(self, s_m: FloatArray) -> FloatArray:
        """(..., 2) metres in the world, `s_m` metres along the path (any number: it is a loop)."""
        return np.asarray(self._curve(np.mod(s_m, self.length_m)))

    def heading_at(self, s_m: FloatArray) -> FloatArray:
        """(...) radians from the world's x axis, in (-pi, pi]."""
        d = self._first(np.mod(s_m, self.length_m))
        return np.asarray(np.arctan2(d[..., 1], d[..., 0]))

    def curvature_at(self, s_m: FloatArray) -> FloatArray:
        """(...) 1/m, positive to the left."""
        s = np.mod(s_m, self.length_m)
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


def _rounded(corners: FloatArray, radius: float) -> FloatArray:
    """(m, 2) points of the ring with every corner replaced by an arc."""
    directions, lengths = _directions(np.vstack([corners, corners[:1]]))
    points = []
    for i, corner in enumerate(corners):
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


def _resampled(points: FloatArray) -> FloatArray:
    """Points of the ring at an even distance of about SPACING_M."""
    ring = np.vstack([points, points[:1]])
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))])
    even = np.linspace(0.0, s[-1], max(16, round(float(s[-1]) / SPACING_M)), endpoint=False)
    return np.stack([np.interp(even, s, ring[:, k]) for k in range(2)], axis=1)
