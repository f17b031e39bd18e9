"""The embedded back end on an analytic scene: a wall and a floor with random textures, seen by a moving camera."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dotmask.geometry import back_project, inverse, transform
from dotmask.records import Intrinsics, MaskedDepth, PoseEstimate, RgbdFrame, SlamStatus
from dotmask.slam.embedded import EmbeddedSlam
from dotmask.slam.features import FeatureExtractor
from dotmask.slam.odometry import Odometry
from dotmask.slam.settings import LoopSettings, OdometrySettings

CAMERA = Intrinsics(width=320, height=240, fx=262.0, fy=275.0, cx=158.0, cy=121.5)
START = np.eye(4)
START[:3, :3] = Rotation.from_euler("zyx", [0.3, -0.2, 1.1]).as_matrix()
START[:3, 3] = 1.0, -2.0, 0.5
FRAMES = 6


def noise_texture(seed: int) -> np.ndarray:
    """Smooth random blobs, 200 texels per metre, not repeating within 5 m."""
    noise = np.random.default_rng(seed).uniform(0, 255, (250, 250)).astype(np.float32)
    return cv2.resize(noise, (1000, 1000), interpolation=cv2.INTER_CUBIC)


WALL, FLOOR, BOX = (noise_texture(seed) for seed in range(3))


def pose_in_scene(k: int) -> np.ndarray:
    """`T_scene_camera`: the scene's axes are those of the camera at k = 0."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec([0.004 * k, 0.012 * k, -0.006 * k]).as_matrix()
    T[:3, 3] = 0.015 * k, -0.006 * k, 0.02 * k
    return T


def sample(texture: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return cv2.remap(texture, (200 * a + 500).astype(np.float32), (200 * b + 500).astype(np.float32), cv2.INTER_LINEAR)


def render(k: int, box: bool = False) -> tuple[RgbdFrame, np.ndarray]:
    """Frame number k, and where the box (which moves with the camera, 1.2 m before it) is seen."""
    T = pose_in_scene(k)
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width].astype(np.float64)
    rays = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones_like(u)], -1) @ T[:3, :3].T
    wall_z = (2.5 - T[2, 3]) / rays[..., 2]
    floor_z = np.where(rays[..., 1] > 1e-6, (0.7 - T[1, 3]) / np.maximum(rays[..., 1], 1e-6), np.inf)
    depth = np.minimum(wall_z, floor_z)
    x, y, z = np.moveaxis(T[:3, 3] + rays * depth[..., None], -1, 0)
    grey = np.where(wall_z < floor_z, sample(WALL, x, y), sample(FLOOR, x, z - 1.5))
    seen = np.zeros(u.shape, bool)
    if box:
        seen[20:215, 75:270] = True
        grey = np.where(seen, sample(BOX, (u - 160) / 100, (v - 120) / 100), grey)
        depth = np.where(seen, 1.2, depth)
    rgb = np.repeat(np.clip(grey, 0, 255).astype(np.uint8)[..., None], 3, axis=2)
    frame = RgbdFrame(index=k, timestamp_s=10 + k / 30, rgb=rgb, depth_m=depth.astype(np.float32), intrinsics=CAMERA)
    return frame, seen


def unmasked(frame: RgbdFrame) -> MaskedDepth:
    return MaskedDepth(mo_mdi_m=frame.depth_m, mdi_m=frame.depth_m)


def without(frame: RgbdFrame, mask: np.ndarray) -> np.ndarray:
    return np.where(mask, np.float32(0), frame.depth_m)


def follow(slam: EmbeddedSlam, frames: list[RgbdFrame]) -> list[PoseEstimate]:
    estimates = []
    for frame in frames:
        estimates.append(slam.track(frame, unmasked(frame)))
        slam.update_map(frame, unmasked(frame))
    return estimates


def error(estimate: PoseEstimate, k: int) -> tuple[float, float]:
    """Metres and radians."""
    assert estimate.T_world_camera is not None
    T = inverse(START @ pose_in_scene(k)) @ estimate.T_world_camera
    return float(np.linalg.norm(T[:3, 3])), float(Rotation.from_matrix(T[:3, :3]).magnitude())


@pytest.fixture(scope="module")
def frames() -> list[RgbdFrame]:
    return [render(k)[0] for k in range(FRAMES)]


@pytest.fixture(scope="module")
def blank() -> RgbdFrame:
    """A frame without texture, at the time of frame 2."""
    size = (CAMERA.height, CAMERA.width)
    return RgbdFrame(
        index=2,
        timestamp_s=10 + 2 / 30,
        rgb=np.full((*size, 3), 127, np.uint8),
        depth_m=np.full(size, 2.0, np.float32),
        intrinsics=CAMERA,
    )


def test_first_frame_has_the_initial_pose(frames):
    estimate = EmbeddedSlam(CAMERA, START).track(frames[0], unmasked(frames[0]))
    assert estimate.status is SlamStatus.INITIALISING
    assert estimate.timestamp_s == frames[0].timestamp_s
    np.testing.assert_allclose(estimate.T_world_camera, START, atol=1e-12)


def test_follows_a_camera_with_unequal_focal_lengths(frames):
    estimates = follow(EmbeddedSlam(CAMERA, START), frames)
    for k, estimate in enumerate(estimates[1:], start=1):
        assert estimate.status is SlamStatus.TRACKED
        metres, radians = error(estimate, k)
        assert metres < 0.003
        assert radians < 0.0015


def test_blank_frame_is_lost_and_the_next_is_found_again(frames, blank):
    slam = EmbeddedSlam(CAMERA, START)
    follow(slam, frames[:2])
    lost = slam.track(blank, unmasked(blank))
    assert lost.status is SlamStatus.LOST
    assert lost.T_world_camera is None
    assert lost.inliers == 0
    found = slam.track(frames[3], unmasked(frames[3]))
    assert found.status is SlamStatus.RELOCALISED
    assert slam.track(frames[4], unmasked(frames[4])).status is SlamStatus.TRACKED
    # It has moved 79 mm from the start; 6 mm is 0.6 pixels at the wall.
    assert error(found, 3)[0] < 0.006


def test_a_camera_that_was_carried_elsewhere_is_lost_and_found_where_it_was_before(frames):
    slam = EmbeddedSlam(CAMERA, START)
    follow(slam, frames[:3])
    elsewhere = replace(frames[3], rgb=np.ascontiguousarray(frames[3].rgb[::-1, ::-1]))
    lost = slam.track(elsewhere, unmasked(elsewhere))
    assert (lost.status, lost.T_world_camera, lost.covariance) == (SlamStatus.LOST, None, None)
    # Turned by 12 degrees within a frame: neither window reaches so far, the looks do.
    turned, _ = render(18)
    found = slam.track(turned, unmasked(turned))
    assert found.status is SlamStatus.RELOCALISED
    assert error(found, 18)[0] < 0.02
    following, _ = render(19)
    assert slam.track(following, unmasked(following)).status is SlamStatus.TRACKED


def test_points_of_an_old_place_find_a_camera_that_the_local_map_cannot(frames):
    extractor = FeatureExtractor(CAMERA, OdometrySettings())
    old, new = (
        extractor.extract(cv2.cvtColor(render(k)[0].rgb, cv2.COLOR_RGB2GRAY), render(k)[0].depth_m) for k in (0, 60)
    )
    odometry = Odometry(CAMERA, START @ pose_in_scene(60), OdometrySettings())
    odometry.start(new, 0.0)
    p_world = transform(START, back_project(old.pixels, old.depth_m, CAMERA))
    assert odometry.relocalise(p_world[:10], old.descriptors[:10], old, 0.1) is None
    found = odometry.relocalise(p_world, old.descriptors, old, 0.1)
    assert found is not None
    assert found.is_relocalised
    np.testing.assert_allclose(found.T_world_camera, START, atol=1e-4)
    following = odometry.track(old, 0.2)
    assert following is not None
    assert not following.is_relocalised


def test_a_keyframe_finds_the_camera_where_the_local_map_has_forgotten(frames):
    """It sees the left half, then the right half alone until the left is forgotten, then the left half again."""
    height, width = frames[0].depth_m.shape
    left = np.broadcast_to(np.arange(width) < width // 2, (height, width))
    slam = EmbeddedSlam(CAMERA, START, OdometrySettings(features=400, map_points=300, corner_distance_px=4.0))
    shown = [*(~left for _ in range(2)), *(np.zeros_like(left) for _ in range(1)), *(left for _ in range(3)), ~left]
    statuses = []
    for k, hidden in enumerate(shown):
        frame, _ = render(k)
        masked = MaskedDepth(mo_mdi_m=without(frame, hidden), mdi_m=without(frame, hidden))
        estimate = slam.track(frame, masked)
        slam.update_map(frame, masked)
        statuses.append(estimate.status)
    assert statuses[1:-1] == [SlamStatus.TRACKED] * 5
    assert statuses[-1] is SlamStatus.RELOCALISED
    assert error(estimate, len(shown) - 1)[0] < 0.01


def test_waits_for_features_before_it_starts(frames, blank):
    slam = EmbeddedSlam(CAMERA, START)
    assert slam.track(blank, unmasked(blank)).status is SlamStatus.LOST
    first = slam.track(frames[3], unmasked(frames[3]))
    assert first.status is SlamStatus.INITIALISING
    np.testing.assert_allclose(first.T_world_camera, START, atol=1e-12)


def test_lost_without_mo_mdi_whatever_mdi_holds(frames):
    nothing = np.zeros_like(frames[0].depth_m)
    estimate = EmbeddedSlam(CAMERA, START).track(frames[0], MaskedDepth(mo_mdi_m=nothing, mdi_m=frames[0].depth_m))
    assert estimate.status is SlamStatus.LOST


def test_few_features_are_enough(frames):
    slam = EmbeddedSlam(CAMERA, START, OdometrySettings(features=40))
    estimates = follow(slam, frames)
    assert all(estimate.inliers <= 40 for estimate in estimates)
    assert error(estimates[-1], FRAMES - 1)[0] < 0.02


def test_runs_agree_to_the_last_bit_for_any_threads_and_seed(frames):
    def poses(threads: int, seed: int) -> list[bytes]:
        before = cv2.getNumThreads()
        try:
            cv2.setNumThreads(threads)
            cv2.setRNGSeed(seed)
            found = [e.T_world_camera for e in follow(EmbeddedSlam(CAMERA, START), frames)]
        finally:
            cv2.setNumThreads(before)
        return [T.tobytes() for T in found if T is not None]

    reference = poses(1, 0)
    assert len(reference) == FRAMES
    assert poses(2, 17) == reference
    assert poses(4, 99) == reference


def test_mask_is_what_saves_it_from_a_box_that_moves_with_the_camera():
    blind, masking = EmbeddedSlam(CAMERA, START), EmbeddedSlam(CAMERA, START)
    for k in range(FRAMES):
        frame, seen = render(k, box=True)
        masked_depth = without(frame, cv2.dilate(seen.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0)
        fooled = blind.track(frame, unmasked(frame))
        right = masking.track(frame, MaskedDepth(mo_mdi_m=masked_depth, mdi_m=masked_depth))
    assert seen.mean() > 0.45
    assert error(right, FRAMES - 1)[0] < 0.005
    # The box fills the view and does not move in it: to an odometry without masks the camera stands.
    assert error(fooled, FRAMES - 1)[0] > 0.06


def test_keyframes_hold_corners_of_mdi(frames):
    right_half = np.zeros(frames[0].depth_m.shape, bool)
    right_half[:, 160:] = True
    moving = np.zeros_like(right_half)
    moving[:80] = True
    slam = EmbeddedSlam(CAMERA, START)
    masked = MaskedDepth(mo_mdi_m=without(frames[0], moving), mdi_m=without(frames[0], moving | right_half))
    slam.track(frames[0], masked)
    slam.update_map(frames[0], masked)
    (keyframe,) = slam.keyframes
    assert len(keyframe.pixels) > 100
    assert keyframe.pixels[:, 0].max() < 159.5
    assert keyframe.pixels[:, 1].min() > 79.5
    # The points are the pixels' own, from the depth under them.
    u, v = keyframe.pixels.astype(np.float64).T
    z = keyframe.p_camera[:, 2]
    np.testing.assert_allclose(keyframe.p_camera[:, 0], (u - CAMERA.cx) / CAMERA.fx * z, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(keyframe.p_camera[:, 1], (v - CAMERA.cy) / CAMERA.fy * z, rtol=1e-5, atol=1e-6)
    rows, columns = np.rint(v).astype(int), np.rint(u).astype(int)
    np.testing.assert_array_equal(z, frames[0].depth_m[rows, columns])


def test_keyframes_follow_the_motion_not_the_frames(frames):
    settings = OdometrySettings(keyframe_distance_m=0.05, keyframe_angle_rad=9.0)
    slam = EmbeddedSlam(CAMERA, START, settings)
    follow(slam, frames)
    # 26 mm per frame: every second frame is 52 mm on.
    assert [keyframe.frame_index for keyframe in slam.keyframes] == [0, 2, 4]


def test_input_is_not_changed_and_may_be_read_only(frames):
    frame = frames[0]
    before = frame.rgb.tobytes(), frame.depth_m.tobytes()
    assert not frame.rgb.flags.writeable
    follow(EmbeddedSlam(CAMERA, START), [frame])
    assert (frame.rgb.tobytes(), frame.depth_m.tobytes()) == before


def test_refuses_what_does_not_fit(frames):
    slam = EmbeddedSlam(CAMERA, START)
    slam.track(frames[1], unmasked(frames[1]))
    with pytest.raises(ValueError, match="is not after"):
        slam.track(frames[0], unmasked(frames[0]))
    small = np.zeros((10, 10), np.float32)
    with pytest.raises(ValueError, match="masked depth"):
        slam.track(frames[2], MaskedDepth(mo_mdi_m=small, mdi_m=small))
    other = EmbeddedSlam(replace(CAMERA, fx=300.0), START)
    with pytest.raises(ValueError, match="intrinsics"):
        other.track(frames[0], unmasked(frames[0]))
    with pytest.raises(ValueError, match="initial_T_world_camera"):
        EmbeddedSlam(CAMERA, np.eye(3))


def there_and_back() -> list[RgbdFrame]:
    """The frames, then the same places again in reverse."""
    numbers = [*range(FRAMES), *reversed(range(FRAMES - 1))]
    return [replace(render(k)[0], index=index, timestamp_s=10 + index / 30) for index, k in enumerate(numbers)]


OFTEN = OdometrySettings(keyframe_distance_m=0.02, keyframe_angle_rad=9.0)
"""A keyframe in every frame, of 26 mm of motion each."""


def test_a_place_seen_again_is_a_loop():
    frames = there_and_back()
    slam = EmbeddedSlam(CAMERA, START, OFTEN, LoopSettings(recent_keyframes=4))
    estimates = follow(slam, frames)
    result = slam.finish()
    assert len(result.loops) >= 4
    for loop in result.loops:
        later, earlier = min(loop.from_index, 10 - loop.from_index), min(loop.to_index, 10 - loop.to_index)
        T_from_to = inverse(pose_in_scene(later)) @ pose_in_scene(earlier)
        assert np.linalg.norm((inverse(T_from_to) @ loop.T_from_to)[:3, 3]) < 0.004
    np.testing.assert_allclose(result.trajectory.timestamps_s, [frame.timestamp_s for frame in frames])
    for k, T in enumerate(result.trajectory.T_world_camera):
        assert np.linalg.norm((inverse(START @ pose_in_scene(min(k, 10 - k))) @ T)[:3, 3]) < 0.003
    # Odometry's poses were given before any loop was closed, and stay what they were.
    assert not np.array_equal(result.trajectory.T_world_camera[-1], estimates[-1].T_world_camera)


def test_without_a_loop_the_answer_is_odometrys(frames, blank):
    slam = EmbeddedSlam(CAMERA, START)
    estimates = follow(slam, [*frames[:2], blank, *frames[3:]])
    result = slam.finish()
    assert result.loops == ()
    found = [estimate for estimate in estimates if estimate.T_world_camera is not None]
    assert len(found) == FRAMES - 1
    np.testing.assert_array_equal(result.trajectory.timestamps_s, [estimate.timestamp_s for estimate in found])
    np.testing.assert_allclose(
        result.trajectory.T_world_camera, [estimate.T_world_camera for estimate in found], atol=1e-12
    )


def test_a_run_that_never_started_has_an_empty_answer(blank):
    slam = EmbeddedSlam(CAMERA, START)
    follow(slam, [blank])
    result = slam.finish()
    assert len(result.trajectory) == 0
    assert result.loops == ()


def test_loops_outlive_the_keyframes_that_are_dropped():
    frames = there_and_back()
    loops = []
    for bound in (1000, 6):
        slam = EmbeddedSlam(CAMERA, START, replace(OFTEN, max_keyframes=bound), LoopSettings(recent_keyframes=4))
        follow(slam, frames)
        result = slam.finish()
        assert len(slam.keyframes) == min(bound, len(frames))
        loops.append(result.loops)
        for k, T in enumerate(result.trajectory.T_world_camera):
            assert np.linalg.norm((inverse(START @ pose_in_scene(min(k, 10 - k))) @ T)[:3, 3]) < 0.003
    kept = {keyframe.frame_index for keyframe in slam.keyframes}
    assert any(loop.to_index not in kept or loop.from_index not in kept for loop in loops[1])


def test_the_closed_loops_are_the_same_bits_for_any_threads():
    frames = there_and_back()

    def answer(threads: int) -> bytes:
        before = cv2.getNumThreads()
        try:
            cv2.setNumThreads(threads)
            slam = EmbeddedSlam(CAMERA, START, OFTEN, LoopSettings(recent_keyframes=4))
            follow(slam, frames)
            result = slam.finish()
        finally:
            cv2.setNumThreads(before)
        assert result.loops
        return result.trajectory.T_world_camera.tobytes()

    assert answer(1) == answer(3)
