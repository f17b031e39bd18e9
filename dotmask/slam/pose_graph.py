"""The poses of all keyframes that odometry and loops agree on best (gtsam).

Odometry ties each keyframe to the one before, loops tie keyframes that show the same place; the poses are those of the
least squared errors, in standard deviations. A wrong loop must not bend the map: graduated non-convexity (Yang et al.,
RA-L 2020) starts from all loops and lets go, step by step, of those that the others and odometry contradict.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from dotmask.records import FloatArray

if TYPE_CHECKING:
    import gtsam

ANCHOR_SIGMA = 1e-6
"""Standard deviation of the first pose, radians and metres: it ties the map to the world."""
INLIER_WEIGHT = 0.5
"""The weights of loops end at 0 or 1."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Edge:
    """A measured relative pose of two nodes.

    Attributes:
        a, b: numbers of the nodes.
        T_a_b: (4, 4).
        covariance: (6, 6) of its error as a twist in the frame of b, rotation in radians before translation in metres.
    """

    a: int
    b: int
    T_a_b: FloatArray
    covariance: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OptimisedGraph:
    """The answer.

    Attributes:
        T_world_node: (N, 4, 4).
        is_accepted: (L,) whether each loop agrees with the answer; those that do not have no part in it.
    """

    T_world_node: FloatArray
    is_accepted: npt.NDArray[np.bool_]


def optimise(
    T_world_node: Sequence[FloatArray], odometry: Sequence[Edge], loops: Sequence[Edge], rejection_probability: float
) -> OptimisedGraph:
    """The poses that agree best with all edges; the first one stays.

    The same input gives the same bits: gtsam works on one thread.

    Args:
        T_world_node: N poses (4, 4) to start from; the first is known.
        odometry: edges that hold, and that connect all nodes.
        loops: edges of which some may be wrong.
        rejection_probability: a right loop would be as far off as a rejected one with less than this probability.
    """
    before = np.array(T_world_node, np.float64).reshape(-1, 4, 4)
    if not loops:
        return OptimisedGraph(T_world_node=before, is_accepted=np.zeros(0, np.bool_))
    import gtsam  # slow to load, and not needed without a loop

    start = gtsam.Values()
    for node, T in enumerate(before):
        start.insert(node, gtsam.Pose3(T))
    known = 1 + len(odometry)
    parameters = gtsam.GncLMParams(gtsam.LevenbergMarquardtParams())
    parameters.setLossType(gtsam.GncLossType.TLS)
    parameters.setKnownInliers(list(range(known)))
    graduated = gtsam.GncLMOptimizer(_graph(before[0], (*odometry, *loops)), start, parameters)
    graduated.setInlierCostThresholdsAtProbability(1 - rejection_probability)
    graduated.optimize()
    is_accepted = np.asarray(graduated.getWeights())[known:] > INLIER_WEIGHT
    if not is_accepted.any():
        return OptimisedGraph(T_world_node=before, is_accepted=is_accepted)
    # Once more with the accepted loops alone, so that the others leave nothing behind.
    accepted = [loop for loop, good in zip(loops, is_accepted, strict=True) if good]
    found = gtsam.LevenbergMarquardtOptimizer(_graph(before[0], (*odometry, *accepted)), start).optimize()
    return OptimisedGraph(
        T_world_node=np.array([found.atPose3(node).matrix() for node in range(len(before))]), is_accepted=is_accepted
    )


def _graph(T_world_first: FloatArray, edges: Sequence[Edge]) -> "gtsam.NonlinearFactorGraph":
    """The first pose, then the edges in their order."""
    import gtsam

    graph = gtsam.NonlinearFactorGraph()
    anchor = gtsam.noiseModel.Isotropic.Sigma(6, ANCHOR_SIGMA)
    graph.add(gtsam.PriorFactorPose3(0, gtsam.Pose3(T_world_first), anchor))
    for edge in edges:
        noise = gtsam.noiseModel.Gaussian.Covariance(edge.covariance)
        graph.add(gtsam.BetweenFactorPose3(edge.a, edge.b, gtsam.Pose3(edge.T_a_b), noise))
    return graph
