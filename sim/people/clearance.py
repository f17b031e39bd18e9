"""How near people come to furniture and to each other.

A person takes up an ellipse on the floor: SHOULDER_HALF_WIDTH_M to both sides and HALF_DEPTH_M to the front and the
back of the root, or of the hips if it sits. Feet and hands reach beyond it. Distances are between such ellipses, or
between an ellipse and the outline of an obstacle; they are 0 where two overlap.
"""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sim.geometry import FloatArray, rotation_z
from sim.rooms.room import Obstacle

SHOULDER_HALF_WIDTH_M = 0.24
HALF_DEPTH_M = 0.14

LOWEST_M, HIGHEST_M = 0.1, 1.7
"""Obstacles that end below LOWEST_M (one steps over them) or begin above HIGHEST_M are in nobody's way."""

_OUTLINE_POINTS = 32


class Standing(Protocol):
    """A motion that tells where a person is, as `sim.people.motion.PersonMotion`."""

    def pose_at(self, time_s: float) -> FloatArray:
        """`T_world_object` (4, 4), on the floor under the person, who faces -y."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Clearance:
    """The least distance of one pair.

    Attributes:
        person: name.
        other: name of another person or of the obstacle.
        distance_m: 0 if they overlap.
        time_s: when.
    """

    person: str
    other: str
    distance_m: float
    time_s: float


def outline(motion: Standing, time_s: float) -> FloatArray:
    """(32, 2) metres in the world, the ellipse that a person takes up."""
    T_world_root = motion.pose_at(time_s)
    angle = np.arange(_OUTLINE_POINTS) * (2.0 * np.pi / _OUTLINE_POINTS)
    points = np.stack([SHOULDER_HALF_WIDTH_M * np.cos(angle), HALF_DEPTH_M * np.sin(angle)], axis=1)
    return np.asarray(points @ T_world_root[:2, :2].T + T_world_root[:2, 3])


def clearances(
    people: Mapping[str, Standing], obstacles: Mapping[str, Obstacle], times_s: Sequence[float] | FloatArray
) -> tuple[Clearance, ...]:
    """The least distance of every person to every obstacle and to every other person over some times.

    The obstacles of a room have no names: number them. The chair that a person sits on or pushes is no obstacle of a
    room, so it is exempt unless it is given.

    Args:
        people: motions by name.
        obstacles: by name; those in nobody's way are left out of the answer.
        times_s: at which to look; people walk up to 2 m/s, so 0.05 s apart is dense enough for 10 cm.

    Returns:
        One for each pair, the nearest first.
    """
    in_the_way = {
        name: box
        for name, box in obstacles.items()
        if box.centre_m[2] + box.size_m[2] / 2 > LOWEST_M and box.centre_m[2] - box.size_m[2] / 2 < HIGHEST_M
    }
    outlines = {name: np.array([outline(motion, float(t)) for t in times_s]) for name, motion in people.items()}
    found = []
    for person, ring in outlines.items():
        middle = ring.mean(axis=1)
        for name, box in in_the_way.items():
            corners = _corners(box)
            bounds = np.linalg.norm(middle - box.centre_m[:2], axis=1) - np.hypot(*box.size_m[:2]) / 2
            found.append(_least(person, name, times_s, bounds, ring, itertools.repeat(corners)))
    for a, b in itertools.combinations(outlines, 2):
        bounds = np.linalg.norm(outlines[a].mean(axis=1) - outlines[b].mean(axis=1), axis=1) - SHOULDER_HALF_WIDTH_M
        found.append(_least(a, b, times_s, bounds, outlines[a], outlines[b]))
    return tuple(sorted(found, key=lambda pair: (pair.distance_m, pair.person, pair.other)))


def _least(
    person: str,
    other: str,
    times_s: Sequence[float] | FloatArray,
    bounds: FloatArray,
    rings: FloatArray,
    others: Iterable[FloatArray],
) -> Clearance:
    """The least distance of two outlines over the times, at the first time at which it is reached.

    Args:
        person: name of who has `rings`.
        other: name of what has `others`.
        times_s: (n,).
        bounds: (n,) metres from the middle of a ring, than which the other outline is never nearer.
        rings: (n, 32, 2).
        others: n outlines (m, 2).
    """
    best = (np.inf, 0.0)
    for time_s, bound, ring, outline_points in zip(times_s, bounds.tolist(), rings, others, strict=False):
        if bound - SHOULDER_HALF_WIDTH_M < best[0]:
            best = min(best, (_between(ring, outline_points), float(time_s)))
    return Clearance(person=person, other=other, distance_m=best[0], time_s=best[1])


def _corners(box: Obstacle) -> FloatArray:
    """(4, 2) metres in the world, counter-clockwise."""
    half = np.array(box.size_m[:2]) / 2
    corners = half * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    return np.asarray(corners @ rotation_z(box.yaw_rad)[:2, :2].T + box.centre_m[:2])


def _between(a: FloatArray, b: FloatArray) -> float:
    """Metres between two convex outlines (n, 2) and (m, 2), counter-clockwise; 0 if they overlap."""
    if not (_separates(a, b) or _separates(b, a)):
        return 0.0
    return min(_points_to_outline(a, b), _points_to_outline(b, a))


def _separates(a: FloatArray, b: FloatArray) -> bool:
    """Whether one of the edges of `a` has all of `b` on its outer side."""
    edges = np.roll(a, -1, axis=0) - a
    outward = np.stack([edges[:, 1], -edges[:, 0]], axis=1)
    beyond = np.einsum("nk,nmk->nm", outward, b[None] - a[:, None])
    return bool(np.any(np.all(beyond >= 0.0, axis=1)))


def _points_to_outline(points: FloatArray, outline_points: FloatArray) -> float:
    """Least distance from the points to the edges of an outline."""
    edges = np.roll(outline_points, -1, axis=0) - outline_points
    to = points[:, None] - outline_points[None]
    share = np.clip(np.sum(to * edges, axis=2) / np.sum(edges * edges, axis=1), 0.0, 1.0)
    return float(np.sqrt(np.min(np.sum((to - share[:, :, None] * edges) ** 2, axis=2))))
