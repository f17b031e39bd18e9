"""The local map of the odometry: world points with descriptors, bounded in number."""

import numpy as np
import numpy.typing as npt

from dotmask.records import FloatArray
from dotmask.slam.features import Descriptors

Indices = npt.NDArray[np.intp]


class LocalMap:
    """Points that the odometry finds its pose against.

    Args:
        capacity: at most this many points; those not seen for the longest time go first.
        fusion_depth: observations that a point's running mean goes back.
    """

    def __init__(self, capacity: int, fusion_depth: int) -> None:
        self._capacity, self._fusion_depth = capacity, fusion_depth
        self._p_world = np.zeros((0, 3))
        self._descriptors = np.zeros((0, 32), np.uint8)
        self._observations = np.zeros(0, np.int64)
        self._last_seen = np.zeros(0, np.int64)

    def __len__(self) -> int:
        """The number of points."""
        return len(self._p_world)

    @property
    def p_world(self) -> FloatArray:
        """(N, 3) metres."""
        return self._p_world

    @property
    def descriptors(self) -> Descriptors:
        """(N, 32)."""
        return self._descriptors

    def add(self, p_world: FloatArray, descriptors: Descriptors, frame: int) -> int:
        """Add points seen for the first time in frame number `frame`, and drop old ones beyond the capacity.

        Returns:
            The index of the first of them; they are the last in the map.
        """
        count = len(p_world)
        self._p_world = np.concatenate([self._p_world, p_world])
        self._descriptors = np.concatenate([self._descriptors, descriptors])
        self._observations = np.concatenate([self._observations, np.ones(count, np.int64)])
        self._last_seen = np.concatenate([self._last_seen, np.full(count, frame, np.int64)])
        if len(self) > self._capacity:
            keep = np.sort(np.lexsort((self._observations, self._last_seen))[-self._capacity :])
            self._p_world, self._descriptors = self._p_world[keep], self._descriptors[keep]
            self._observations, self._last_seen = self._observations[keep], self._last_seen[keep]
        return len(self) - count

    def observe(self, points: Indices, p_world: FloatArray, frame: int) -> None:
        """Move `points` towards where frame number `frame` saw them: a running mean.

        Args:
            points: (K,) indices, each once.
            p_world: (K, 3) their positions by this frame's pose and depth.
            frame: its number.
        """
        seen = np.minimum(self._observations[points] + 1, self._fusion_depth)
        self._p_world[points] += (p_world - self._p_world[points]) / seen[:, None]
        self._observations[points] = seen
        self._last_seen[points] = frame
