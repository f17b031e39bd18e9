"""Which observation belongs to which track. The paper does not say; this is gated global nearest neighbour."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.special import gammaincinv

from dotmask.geometry import inverse, transform
from dotmask.mask_geometry import intersection_over_union, moved_mask
from dotmask.profiles import Profile
from dotmask.records import FloatArray, Intrinsics, Observation, Track

_FORBIDDEN = 1e9
"""Above any gated distance: the assignment first pairs as many as it can, then at the least sum of distances."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Association:
    """Answer of `associate`, as indices into its arguments, each ascending.

    Attributes:
        pairs: (track, observation).
        unmatched_tracks: tracks without an observation.
        unmatched_observations: observations without a track.
    """

    pairs: tuple[tuple[int, int], ...]
    unmatched_tracks: tuple[int, ...]
    unmatched_observations: tuple[int, ...]


Associate = Callable[[Sequence[Track], Sequence[Observation], FloatArray, Intrinsics, Profile], Association]
"""The form of `associate`."""


@cache
def chi_square_quantile(probability: float, degrees: int) -> float:
    """The value that a chi-square variable stays below with `probability`."""
    return float(2.0 * gammaincinv(0.5 * degrees, probability))


def squared_mahalanobis(
    tracks: Sequence[Track], observations: Sequence[Observation], T_world_camera: FloatArray
) -> FloatArray:
    """(T, O) `yᵀ S⁻¹ y` of every pair, for tracks predicted to the frame of the observations, all of one model."""
    T_camera_world = inverse(T_world_camera)
    R_camera_world = T_camera_world[:3, :3]
    expected = transform(T_camera_world, np.array([t.position_world for t in tracks]))
    P = R_camera_world @ np.array([t.covariance[:3, :3] for t in tracks]) @ R_camera_world.T
    # What is measured is taken as linear around the observations, which lie in the image, as predictions may not.
    seen = np.array([o.position_camera for o in observations])
    J = observations[0].model.jacobian(seen)[None]  # one frame's observations are made alike
    y = (J @ (seen[None] - expected[:, None])[..., None])[..., 0]
    S = J @ P[:, None] @ J.swapaxes(-1, -2) + np.array([o.covariance for o in observations])[None]
    return np.asarray((y * np.linalg.solve(S, y[..., None])[..., 0]).sum(-1))


def associate(
    tracks: Sequence[Track],
    observations: Sequence[Observation],
    T_world_camera: FloatArray,
    intrinsics: Intrinsics,
    profile: Profile,
) -> Association:
    """Pair predicted tracks with observations of the same class inside the gate, at the least total distance.

    Where the gate holds more than one candidate, the overlap of the masks has a say: the IoU of the track's last mask,
    moved to where the track is predicted, with the observation's mask counts as a likelihood.

    Args:
        tracks: predicted to the time of the frame.
        observations: of that frame.
        T_world_camera: (4, 4) the frame's camera pose.
        intrinsics: of the camera.
        profile: gives the gate.
    """
    pairs: tuple[tuple[int, int], ...] = ()
    if tracks and observations:
        cost = squared_mahalanobis(tracks, observations, T_world_camera)
        is_same_class = np.array([[t.class_name == o.class_name for o in observations] for t in tracks])
        is_allowed = is_same_class & (cost <= chi_square_quantile(profile.gate_probability, 3))
        rivals = is_allowed & ((is_allowed.sum(axis=0) > 1)[None] | (is_allowed.sum(axis=1) > 1)[:, None])
        if profile.least_mask_likelihood < 1 and rivals.any():
            T_camera_world = inverse(T_world_camera)
            for i in map(int, np.flatnonzero(rivals.any(axis=1))):
                expected = moved_mask(
                    tracks[i].mask,
                    tracks[i].mask_position_camera,
                    transform(T_camera_world, tracks[i].position_world),
                    intrinsics,
                )
                for j in map(int, np.flatnonzero(rivals[i])):
                    iou = intersection_over_union(expected, observations[j].mask)
                    cost[i, j] -= 2.0 * np.log(max(iou, profile.least_mask_likelihood))
        rows, columns = linear_sum_assignment(np.where(is_allowed, cost, _FORBIDDEN))
        pairs = tuple((int(i), int(j)) for i, j in zip(rows, columns, strict=True) if is_allowed[i, j])
    seen_tracks = {i for i, _ in pairs}
    seen_observations = {j for _, j in pairs}
    return Association(
        pairs=pairs,
        unmatched_tracks=tuple(i for i in range(len(tracks)) if i not in seen_tracks),
        unmatched_observations=tuple(j for j in range(len(observations)) if j not in seen_observations),
    )
