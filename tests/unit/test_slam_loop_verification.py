"""Two keyframes of a made-up room: the relative pose is found where there is one, and nothing else is."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from dotmask.geometry import back_project, inverse, project, transform
from dotmask.records import Intrinsics
from dotmask.slam.coarse_depth import STEP_PX, CoarseDepth
from dotmask.slam.keyframes import Keyframe, motion
from dotmask.slam.loop_verification import LoopVerifier
from dotmask.slam.settings import LoopSettings, OdometrySettings
from dotmask.slam.twists import exp, halfway, log
from dotmask.slam.vocabulary import load_vocabulary

CAMERA = Intrinsics(width=640, height=480, fx=525.0, fy=535.0, cx=318.0, cy=241.0)
HALF_M = np.array([3.0, 2.5, 2.0])
"""The room is a box around the origin, with a pillar before the wall at +z."""
PILLAR = np.array([[-0.4, -2.5, 0.9], [0.4, 2.5, 1.3]])
POINTS = 6000


def ray_depth(origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Multiples of the directions (N, 3) at which rays from inside the room meet the pillar or else a wall."""
    with np.errstate(divide="ignore", invalid="ignore"):
        walls = np.where(directions > 0, HALF_M - origin, -HALF_M - origin) / directions
        near, far = np.sort((PILLAR[:, None] - origin) / directions, axis=0)
    enter, leave = near.max(axis=1), far.min(axis=1)
    wall = np.where(np.isfinite(walls), walls, np.inf).min(axis=1)
    return np.where((enter < leave) & (enter > 0), enter, wall)


def surface_points(rng: np.random.Generator) -> np.ndarray:
    """(N, 3) points on what can be seen from near the origin."""
    directions = rng.normal(size=(POINTS, 3))
    return ray_depth(np.zeros(3), directions)[:, None] * directions


class Place:
    """Points with descriptors, and the keyframes that see them."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.points = surface_points(self.rng)
        self.descriptors = self.rng.integers(0, 256, (POINTS, 32), dtype=np.uint8)

    def keyframe(
        self,
        number: int,
        T_world_camera: np.ndarray,
        *,
        where: Callable[[np.ndarray], np.ndarray] | None = None,
        T_moved: np.ndarray | None = None,
        moved_share: float = 0.0,
    ) -> Keyframe:
        """A view with noise.

        Args:
            number: of the keyframe.
            T_world_camera: (4, 4).
            where: which pixels (N, 2) may hold corners.
            T_moved: (4, 4) what has happened to `moved_share` of the points since the first view.
            moved_share: of all points.
        """
        points = self.points.copy()
        if T_moved is not None:
            moved = np.arange(POINTS) < moved_share * POINTS
            points[moved] = transform(T_moved, points[moved])
        camera = transform(inverse(T_world_camera), points)
        pixels = project(camera, CAMERA)
        margin = 20
        seen = ((pixels > margin) & (pixels < [CAMERA.width - margin, CAMERA.height - margin])).all(axis=1)
        if where is not None:
            seen[seen] = where(pixels[seen])
        order = np.flatnonzero(seen)[:900]
        pixels = pixels[order] + self.rng.normal(0, 0.5, (len(order), 2))
        z = camera[order, 2]
        z = z + self.rng.normal(0, 0.002 + 0.0015 * z**2)
        descriptors = self.descriptors[order] ^ np.packbits(self.rng.random((len(order), 256)) < 0.02, axis=1)
        return Keyframe(
            number=number,
            frame_index=number,
            timestamp_s=float(number),
            T_world_camera=T_world_camera,
            covariance=1e-6 * np.eye(6),
            pixels=pixels.astype(np.float32),
            p_camera=back_project(pixels, z, CAMERA).astype(np.float32),
            descriptors=descriptors,
            words=load_vocabulary().words_of(descriptors),
            depth=self.depth(T_world_camera),
        )

    @staticmethod
    def depth(T_world_camera: np.ndarray) -> CoarseDepth:
        v, u = np.mgrid[: CAMERA.height : STEP_PX, : CAMERA.width : STEP_PX]
        pixels = np.stack([u.ravel(), v.ravel()], axis=1).astype(float)
        rays = back_project(pixels, np.ones(len(pixels)), CAMERA) @ T_world_camera[:3, :3].T
        depth_m = ray_depth(T_world_camera[:3, 3], rays).reshape(v.shape).astype(np.float32)
        return CoarseDepth(intrinsics=CAMERA, step_px=STEP_PX, depth_m=depth_m)


def pose(*twist: float) -> np.ndarray:
    return exp(np.array(twist))


FIRST, SECOND = pose(0.02, -0.03, 0.01, -0.2, 0.1, -0.9), pose(-0.05, 0.12, -0.04, 0.15, -0.05, -0.7)


def verifier(**changes: float) -> LoopVerifier:
    return LoopVerifier(CAMERA, load_vocabulary(), OdometrySettings(), LoopSettings(**changes))


@pytest.fixture(scope="module")
def place() -> Place:
    return Place(0)


def test_the_relative_pose_is_found(place):
    earlier, later = place.keyframe(0, FIRST), place.keyframe(1, SECOND)
    found = verifier().verify(later, earlier)
    assert found is not None
    distance_m, angle_rad = motion(found.T_from_to, inverse(SECOND) @ FIRST)
    assert distance_m < 0.004
    assert angle_rad < 0.002
    assert found.inliers > 100
    # Both ways are the same question.
    back = verifier().verify(earlier, later)
    assert back is not None
    assert motion(back.T_from_to, inverse(found.T_from_to))[0] < 0.001


def test_errors_are_as_the_covariance_says_or_smaller(place):
    squares = []
    for k in range(24):
        first = FIRST @ pose(0, 0, 0.05 * k, 0.01 * k, 0, 0)
        found = verifier().verify(place.keyframe(1, SECOND), place.keyframe(0, first))
        assert found is not None
        error = log(inverse(found.T_from_to) @ inverse(SECOND) @ first)
        squares.append(error @ np.linalg.solve(found.covariance, error))
    # Real corners err together and the setting leaves room for it; these do not.
    assert 1.0 < np.mean(squares) < chi2.ppf(0.999, 6 * len(squares)) / len(squares)


def test_another_place_is_refused(place):
    assert verifier().verify(Place(1).keyframe(1, SECOND), place.keyframe(0, FIRST)) is None


def test_two_views_with_nothing_in_common_are_refused(place):
    turned = FIRST @ pose(0, np.pi, 0, 0, 0, 0)
    assert verifier().verify(place.keyframe(1, turned), place.keyframe(0, FIRST)) is None


def test_corners_on_one_thing_are_refused(place):
    def on_a_poster(pixels: np.ndarray) -> np.ndarray:
        return np.asarray((np.abs(pixels - [250, 200]) < [75, 75]).all(axis=1))

    earlier, later = place.keyframe(0, FIRST, where=on_a_poster), place.keyframe(1, SECOND)
    assert verifier().verify(later, earlier) is None
    # It is the spread that is missed: nothing else stands against it.
    assert verifier(min_cells=1, max_translation_sigma_m=1.0).verify(later, earlier) is not None


def test_corners_that_walked_on_together_are_refused(place):
    # A third of the corners are on what has moved by 30 cm; the others agree with each other.
    earlier = place.keyframe(0, FIRST)
    later = place.keyframe(1, SECOND, T_moved=pose(0, 0, 0, 0.3, 0, 0), moved_share=0.35)
    assert verifier().verify(later, earlier) is None
    right = verifier(min_match_share=0.4).verify(later, earlier)
    assert right is not None
    assert motion(right.T_from_to, inverse(SECOND) @ FIRST)[0] < 0.01


def test_surfaces_where_the_other_has_looked_through_are_refused(place):
    # All corners are where a place looks the same from 35 cm to the side, as repeated patterns do; the pillar is not.
    aside = pose(0, 0, 0, 0.35, 0, 0)
    later = place.keyframe(1, SECOND, T_moved=aside, moved_share=1.0)
    found = verifier(max_violating=1.0, min_agreeing=0.0).verify(later, place.keyframe(0, FIRST))
    assert found is not None
    assert motion(found.T_from_to, inverse(SECOND) @ FIRST)[0] > 0.3
    assert verifier().verify(later, place.keyframe(0, FIRST)) is None


def test_depth_agreement_counts_overlap_surfaces_and_what_is_looked_through():
    wall, nearer = np.full((480, 640), 2.0, np.float32), np.full((480, 640), 2.0, np.float32)
    nearer[:, :320] = 1.5
    seen, other = CoarseDepth.of(wall, CAMERA), CoarseDepth.of(nearer, CAMERA)
    same = seen.agreement(seen, np.eye(4), 0.02)
    assert (same.overlap, same.agreeing, same.violating) == (1.0, 1.0, 0.0)
    half = seen.agreement(other, np.eye(4), 0.02)
    assert half.violating == pytest.approx(0.5, abs=0.02)
    assert half.agreeing == pytest.approx(0.5, abs=0.02)
    # Behind a surface is hidden, and hidden is no contradiction.
    behind = other.agreement(seen, np.eye(4), 0.02)
    assert behind.violating == 0
    assert behind.agreeing == pytest.approx(0.5, abs=0.03)
    away = seen.agreement(seen, pose(0, np.pi, 0, 0, 0, 0), 0.02)
    assert away.overlap == 0
    aside = seen.agreement(seen, pose(0, 0, 0, 2.0 * 320 / CAMERA.fx, 0, 0), 0.02)
    assert aside.overlap == pytest.approx(0.5, abs=0.02)


def test_masked_depth_says_nothing():
    masked = np.full((480, 640), 2.0, np.float32)
    masked[:, 320:] = 0
    seen, other = CoarseDepth.of(masked, CAMERA), CoarseDepth.of(np.full((480, 640), 1.0, np.float32), CAMERA)
    found = seen.agreement(other, np.eye(4), 0.02)
    assert found.overlap == pytest.approx(0.5, abs=0.02)
    assert found.violating == 1.0


@pytest.mark.parametrize("angle_rad", [0.0, 1e-9, 0.3, 3.0])
def test_twists_are_those_of_the_matrix_exponential(angle_rad):
    axis = np.array([0.48, -0.6, 0.64])
    twist = np.array([*(angle_rad * axis), 0.4, -1.0, 0.7])
    generator = np.zeros((4, 4))
    x, y, z = twist[:3]
    generator[:3, :3], generator[:3, 3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]], twist[3:]
    np.testing.assert_allclose(exp(twist), expm(generator), atol=1e-12)
    np.testing.assert_allclose(log(exp(twist)), twist, atol=1e-9)


def test_halfway_is_as_far_from_both():
    a, b = pose(0.1, 0.2, -0.3, 1.0, 2.0, 3.0), pose(-0.2, 0.1, 0.2, 1.5, 1.0, 2.0)
    middle = halfway(a, b)
    np.testing.assert_allclose(log(inverse(a) @ middle), log(inverse(middle) @ b), atol=1e-12)


def test_motion_is_distance_and_angle():
    rng = np.random.default_rng(0)
    poses = np.array([exp(rng.normal(size=6)) for _ in range(20)])
    others = np.array([exp(rng.normal(size=6)) for _ in range(20)])
    distance_m, angle_rad = motion(poses, others)
    for a, b, metres, radians in zip(poses, others, distance_m, angle_rad, strict=True):
        assert metres == pytest.approx(np.linalg.norm(a[:3, 3] - b[:3, 3]))
        assert radians == pytest.approx(Rotation.from_matrix(a[:3, :3].T @ b[:3, :3]).magnitude())
