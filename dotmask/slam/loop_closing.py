"""From keyframes to the optimised trajectory: find loops as keyframes come, and close them all at the end.

What is bounded by `OdometrySettings.max_keyframes` is what is large: corners, descriptors, depth and words. The poses
of all keyframes stay, like those of all frames, so that a dropped keyframe takes none of its loops away.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dotmask.geometry import inverse
from dotmask.records import FloatArray, Intrinsics, LoopClosure, LoopKind
from dotmask.slam.features import Features
from dotmask.slam.keyframes import Keyframe, motion
from dotmask.slam.loop_verification import LoopVerifier
from dotmask.slam.place_recognition import PlaceRecognition
from dotmask.slam.pose_graph import Edge, optimise
from dotmask.slam.settings import LoopSettings, OdometrySettings
from dotmask.slam.twists import adjoint
from dotmask.slam.vocabulary import BagOfWords, Vocabulary


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Loop:
    """A verified loop and its edge in the pose graph."""

    closure: LoopClosure
    edge: Edge


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ClosedLoops:
    """The answer.

    Attributes:
        frame_indices: (N,) of all keyframes there ever were, rising.
        T_world_odometry: (N, 4, 4) how each of them was moved: the optimised pose is this times odometry's.
        loops: the accepted loops in the order of their discovery.
    """

    frame_indices: tuple[int, ...]
    T_world_odometry: FloatArray
    loops: tuple[LoopClosure, ...]

    def corrected(self, frame_indices: Sequence[int], T_odometry_camera: Sequence[FloatArray]) -> FloatArray:
        """The optimised poses (M, 4, 4) of frames: each keeps its place relative to the last keyframe not after it.

        Args:
            frame_indices: M of them, none before the first keyframe.
            T_odometry_camera: their poses (4, 4) by odometry.
        """
        keyframe = np.searchsorted(self.frame_indices, frame_indices, side="right") - 1
        poses = [self.T_world_odometry[k] @ T for k, T in zip(keyframe, T_odometry_camera, strict=True)]
        return np.array(poses, np.float64).reshape(-1, 4, 4)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Node:
    """What the pose graph needs of a keyframe, also of one that was dropped.

    Attributes:
        frame_index: of its frame.
        T_world_camera: (4, 4) pose by odometry.
        covariance: (6, 6) of the pose.
    """

    frame_index: int
    T_world_camera: FloatArray
    covariance: FloatArray


def odometry_edge(number: int, before: Node, after: Node, scale: float) -> Edge:
    """Odometry's motion from keyframe `number` to the next one.

    Both poses were found against the local map, each with an error of its own. What they have in common, the errors of
    the map's points, is in the factor `scale` on the covariance.
    """
    T_before_after = inverse(before.T_world_camera) @ after.T_world_camera
    A = adjoint(inverse(T_before_after))
    covariance = scale * (after.covariance + A @ before.covariance @ A.T)
    return Edge(a=number, b=number + 1, T_a_b=T_before_after, covariance=covariance)


class LoopClosing:
    """Finds loops among keyframes.

    Args:
        intrinsics: of the camera.
        vocabulary: of the descriptors.
        settings: of odometry.
        loop_settings: of the loops.
    """

    def __init__(
        self, intrinsics: Intrinsics, vocabulary: Vocabulary, settings: OdometrySettings, loop_settings: LoopSettings
    ) -> None:
        self._settings, self._vocabulary = loop_settings, vocabulary
        self._places = PlaceRecognition(len(vocabulary))
        self._verifier = LoopVerifier(intrinsics, vocabulary, settings, loop_settings)
        self._keyframes: dict[int, Keyframe] = {}
        self._nodes: list[Node] = []
        self._loops: list[_Loop] = []
        self._last_bag: BagOfWords | None = None

    def add(self, keyframe: Keyframe, dropped: Keyframe | None) -> None:
        """Look for a loop from a new keyframe to an earlier one.

        Args:
            keyframe: the new one.
            dropped: one that is no longer kept.
        """
        if dropped is not None:
            del self._keyframes[dropped.number]
            self._places.forget(dropped.number)
        bag = self._vocabulary.bag_of(keyframe.words)
        for kind, earlier in self._candidates(keyframe, bag):
            found = self._verifier.verify(keyframe, earlier)
            if found is not None:
                closure = LoopClosure(
                    from_index=keyframe.frame_index,
                    to_index=earlier.frame_index,
                    T_from_to=found.T_from_to,
                    kind=kind,
                )
                edge = Edge(a=keyframe.number, b=earlier.number, T_a_b=found.T_from_to, covariance=found.covariance)
                self._loops.append(_Loop(closure=closure, edge=edge))
                break
        self._keyframes[keyframe.number] = keyframe
        self._nodes.append(
            Node(
                frame_index=keyframe.frame_index,
                T_world_camera=keyframe.T_world_camera,
                covariance=keyframe.covariance,
            )
        )
        self._places.add(keyframe.number, bag)
        self._last_bag = bag

    def close(self) -> ClosedLoops:
        """Optimise the poses of all keyframes by odometry and loops."""
        scale = self._settings.odometry_covariance_scale
        chain = [
            odometry_edge(number, before, after, scale) for number, (before, after) in enumerate(pairwise(self._nodes))
        ]
        poses = [node.T_world_camera for node in self._nodes]
        found = optimise(poses, chain, [loop.edge for loop in self._loops], self._settings.rejection_probability)
        corrections = [T @ inverse(before) for T, before in zip(found.T_world_node, poses, strict=True)]
        return ClosedLoops(
            frame_indices=tuple(node.frame_index for node in self._nodes),
            T_world_odometry=np.array(corrections).reshape(-1, 4, 4),
            loops=tuple(
                loop.closure for loop, accepted in zip(self._loops, found.is_accepted, strict=True) if accepted
            ),
        )

    def places_like(self, features: Features) -> tuple[Keyframe, ...]:
        """The keyframes that look most like an image whose place is unknown, the best first."""
        bag = self._vocabulary.bag_of(self._vocabulary.words_of(features.descriptors))
        alike = self._places.similar(bag, count=self._settings.relocalisation_candidates)
        return tuple(self._keyframes[place.place] for place in alike)

    def _candidates(self, keyframe: Keyframe, bag: BagOfWords) -> list[tuple[LoopKind, Keyframe]]:
        """Keyframes that may show the same place: those that look alike, then the one that is nearest."""
        s, before = self._settings, keyframe.number - self._settings.recent_keyframes
        if self._last_bag is None or before <= 0:
            return []
        least = s.relative_similarity * bag.similarity(self._last_bag)
        alike = self._places.similar(bag, before=before, count=s.candidates, least=least)
        found = [(LoopKind.GLOBAL, self._keyframes[place.place]) for place in alike]
        nearest = self._nearest(keyframe, before, {place.place for place in alike})
        return found if nearest is None else [*found, (LoopKind.PROXIMITY, nearest)]

    def _nearest(self, keyframe: Keyframe, before: int, tried: set[int]) -> Keyframe | None:
        """The keyframe nearest by odometry among those before number `before` and not `tried`; None if all are far."""
        others = [other for number, other in self._keyframes.items() if number < before and number not in tried]
        if not others:
            return None
        s = self._settings
        T_world_camera = np.array([other.T_world_camera for other in others])
        distance_m, angle_rad = motion(T_world_camera, keyframe.T_world_camera)
        apart = np.maximum(distance_m / s.proximity_distance_m, angle_rad / s.proximity_angle_rad)
        best = int(apart.argmin())
        return others[best] if apart[best] <= 1 else None
