"""Points on surfaces: followed on pictures of textured planes whose motion is known, and judged on exact points."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from dotmask.geometry import inverse, project, transform
from dotmask.pipeline import DotMask
from dotmask.profiles import CALIBRATED, ClassModel, MeasurementNoise, SurfaceSettings
from dotmask.records import Detections, Intrinsics, Reason, RgbdFrame, SurfaceMotion
from dotmask.tracking.surface import SurfacePoints, follow, surface_motions

CAMERA = Intrinsics(width=320, height=240, fx=260.0, fy=260.0, cx=159.5, cy=119.5)
RATE_HZ = 30
SETTINGS = SurfaceSettings()
CHAIR = CALIBRATED.class_model("chair")
NOISE = CALIBRATED.noise
OBJECT_M, WALL_M = 2.0, 5.0
HALF_WIDTH_M, HALF_HEIGHT_M = 0.35, 0.45

_noise = np.random.default_rng(7).normal(size=(2, 512, 512))
TEXTURES = [ndimage.gaussian_filter(n, 2.0, mode="wrap") for n in _noise]
TEXTURES = [np.clip(127 + 50 * t / t.std(), 0, 255) for t in TEXTURES]
TEXELS_PER_M = 130  # about one per pixel at the object


PERIOD_M = 0.2
"""Of stripes and checks: 26 pixels, 13 of the half size image."""


def sampled(texture, x_m, y_m):
    """Brightness of the textures of noise 0 and 1, or of `stripes` (upright, on faint noise) or `checks`."""
    if texture == "checks":
        return 127 + 20 * np.sin(2 * np.pi * x_m / PERIOD_M) * np.sin(2 * np.pi * y_m / PERIOD_M)
    if texture == "stripes":
        return 127 + 40 * np.sin(2 * np.pi * x_m / PERIOD_M) + 0.2 * (sampled(1, x_m, y_m) - 127)
    places = TEXELS_PER_M * np.stack([y_m, x_m])
    return ndimage.map_coordinates(TEXTURES[texture], places, order=3, mode="grid-wrap")


def pose(x=0.0, y=0.0, z=0.0, turn=(0.0, 0.0, 0.0)):
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(turn).as_matrix()
    T[:3, 3] = x, y, z
    return T


def picture(
    index,
    T_world_camera,
    *,
    offset=(0, 0, 0),
    part_offset=None,
    part=0.2,
    texture=1,
    contrast=1.0,
    half_size_m=(HALF_WIDTH_M, HALF_HEIGHT_M),
):
    """A textured rectangle at (0, 0, OBJECT_M) + `offset` metres before a textured wall, and its detection.

    The texture of the right `part` of the rectangle is shifted by `part_offset` metres (x, y) instead of `offset`.
    """
    v, u = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width].astype(float)
    rays = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones_like(u)], axis=-1)
    directions = rays @ T_world_camera[:3, :3].T
    x0, y0, z0 = T_world_camera[:3, 3]

    def met(plane_m):
        depth = (plane_m - z0) / directions[..., 2]
        return depth, x0 + depth * directions[..., 0], y0 + depth * directions[..., 1]

    far, x_wall, y_wall = met(WALL_M)
    near, x, y = met(OBJECT_M + offset[2])
    mask = (np.abs(x - offset[0]) <= half_size_m[0]) & (np.abs(y - offset[1]) <= half_size_m[1])
    brightness = sampled(texture, x - offset[0], y - offset[1])
    if part_offset is not None:
        is_part = x - offset[0] > half_size_m[0] * (1 - 2 * part)
        brightness = np.where(is_part, sampled(texture, x - part_offset[0], y - part_offset[1]), brightness)
    brightness = 127 + contrast * (brightness - 127)
    grey = np.where(mask, brightness, sampled(0, x_wall, y_wall))
    frame = RgbdFrame(
        index=index,
        timestamp_s=index / RATE_HZ,
        rgb=np.repeat(np.clip(np.rint(grey), 0, 255).astype(np.uint8)[..., None], 3, axis=2),
        depth_m=np.where(mask, near, far).astype(np.float32),
        intrinsics=CAMERA,
    )
    return frame, detect(mask)


def detect(*masks):
    boxes = [[*np.argwhere(m).min(0)[::-1], *np.argwhere(m).max(0)[::-1]] for m in masks]
    return Detections(
        masks=np.array(masks), boxes_px=np.array(boxes, float), class_names=("chair",) * len(masks),
        scores=np.ones(len(masks)),
    )  # fmt: skip


def followed(frames, poses, settings=SETTINGS):
    """Points after every frame."""
    points, T_before, out = None, None, []
    for (frame, detections), T in zip(frames, poses, strict=True):
        points, T_before = follow(points, frame, detections, T_before, T, settings), T
        out.append(points)
    return out


def motion(points, T_world_camera, model=CHAIR, settings=SETTINGS, noise=NOISE) -> SurfaceMotion | None:
    [answer] = surface_motions(points, [model], T_world_camera, CAMERA, noise, settings)
    return answer


CAMERAS = {
    "at rest": lambda t: pose(),
    "sideways and forward": lambda t: pose(0.4 * t - 0.05, -0.1 * t, 0.3 * t),
    "turning": lambda t: pose(0.2 * t, 0, 0, (0.05 * t, 0.3 * t, -0.2 * t)),
}
TIMES = np.arange(10) / RATE_HZ


# ---- on pictures --------------------------------------------------------------------------------


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("velocity", [(0.46, 0, 0), (-0.23, 0.35, 0), (0.1, -0.2, -0.5)], ids=str)
def test_a_rectangle_that_moves_has_its_velocity_and_all_its_points_move(camera, velocity) -> None:
    """0.23 m/s at 2 m is one pixel per frame."""
    poses = [CAMERAS[camera](t) for t in TIMES]
    frames = [picture(k, T, offset=np.multiply(velocity, t)) for k, (t, T) in enumerate(zip(TIMES, poses, strict=True))]
    answer = motion(followed(frames, poses)[-1], poses[-1])
    assert answer is not None
    assert answer.points > 15
    np.testing.assert_allclose(answer.velocity_world, velocity, rtol=0, atol=0.03)
    if np.linalg.norm(velocity[:2]) > 0.3:
        assert answer.moving_share > 0.95
    residual = answer.velocity_world - velocity
    assert residual @ np.linalg.solve(answer.covariance, residual) < 12.8  # 99.5 % of chi-square, 3 degrees


@pytest.mark.parametrize("camera", CAMERAS)
def test_while_the_camera_moves_a_rectangle_that_stands_has_no_velocity_and_no_moving_points(camera) -> None:
    poses = [CAMERAS[camera](t) for t in TIMES]
    answers = [
        motion(points, T)
        for points, T in zip(followed([picture(k, T) for k, T in enumerate(poses)], poses), poses, strict=True)
    ]
    assert answers[0] is None, "in the first frame nothing is known from before"
    for answer in answers[1:]:
        assert answer is not None
        assert answer.moving_share == 0.0
        assert np.linalg.norm(answer.velocity_world) < 0.03


@pytest.mark.parametrize("part", [0.3, 0.4])
@pytest.mark.parametrize("camera", CAMERAS)
def test_a_moving_part_is_the_share_of_its_points(camera, part) -> None:
    """A part of the rectangle moves down at 0.4 m/s, a pixel and three quarters per frame; the rest stands.

    A point is followed with its surroundings, 11 pixels to either side: near the seam it may go with the other part.
    """
    poses = [CAMERAS[camera](t) for t in TIMES]
    frames = [
        picture(k, T, part_offset=(0, 0.4 * t), part=part, contrast=0.5)
        for k, (t, T) in enumerate(zip(TIMES, poses, strict=True))
    ]
    points = followed(frames, poses)[-1]
    from_seam_m = transform(poses[-1], points.p_camera)[:, 0] - HALF_WIDTH_M * (1 - 2 * part)
    near_m = 8 * OBJECT_M / CAMERA.fx
    by_side = replace(points, detection_index=np.digitize(from_seam_m, [-near_m, near_m]))
    alone = replace(SETTINGS, least_points=1)
    stands, seam, moves = surface_motions(by_side, [CHAIR] * 3, poses[-1], CAMERA, NOISE, alone)
    assert stands is not None
    assert stands.points >= 12
    assert stands.moving_share * stands.points <= 1
    assert seam is not None
    assert moves is not None
    assert moves.moving_share == 1.0
    np.testing.assert_allclose(moves.velocity_world, [0, 0.4, 0], rtol=0, atol=0.05)
    answer = motion(points, poses[-1])
    assert answer is not None
    of_part = float(np.mean(from_seam_m[np.isfinite(points.past_world[:, 0, 0])] > 0))
    assert part / 2 < of_part < 1.5 * part
    assert answer.moving_share == pytest.approx(of_part, abs=(seam.points + 1) / answer.points)
    assert answer.moving_share > CALIBRATED.class_model("person").moving_share, "it is enough to flag a person"
    assert np.linalg.norm(answer.velocity_world) < 0.03, "most of it stands"


def test_two_objects_have_their_own_motions() -> None:
    poses = [CAMERAS["sideways and forward"](t) for t in TIMES]
    frames = []
    for k, (t, T) in enumerate(zip(TIMES, poses, strict=True)):
        frame, whole = picture(k, T, part_offset=(0, 0.4 * t), part=0.5)
        u = np.arange(CAMERA.width)
        middle = project(transform(inverse(T), np.array([[0, 0, OBJECT_M]])), CAMERA)[0, 0]
        left, right = whole.masks[0] & (u < middle), whole.masks[0] & (u >= middle)
        frames.append((frame, detect(right, left)))
    points = followed(frames, poses)[-1]
    moves, stands = surface_motions(points, [CHAIR, CHAIR], poses[-1], CAMERA, NOISE, SETTINGS)
    assert moves is not None
    assert stands is not None
    assert (moves.moving_share > 0.85, stands.moving_share < 0.15) == (True, True)
    np.testing.assert_allclose(moves.velocity_world, [0, 0.4, 0], rtol=0, atol=0.04)
    np.testing.assert_allclose(stands.velocity_world, 0, rtol=0, atol=0.04)


def test_points_lie_on_the_object_and_keep_two_pixels_off_its_border() -> None:
    v, u = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width]
    odd_shape = (((u - 150) / 50) ** 2 + ((v - 120) / 70) ** 2 <= 1) & ~((u > 140) & (u < 175) & (v < 100))
    poses = [CAMERAS["turning"](t) for t in TIMES]
    frames = []
    for k, T in enumerate(poses):
        frame, _ = picture(k, T)
        frames.append((frame, detect(odd_shape, np.roll(odd_shape, 100, axis=1) & (u > 202))))
    for (_, detections), points in zip(frames, followed(frames, poses), strict=True):
        assert set(points.detection_index) == {0, 1}
        for index, mask in enumerate(detections.masks):
            inner = ndimage.binary_erosion(mask[::2, ::2], np.ones((5, 5)))
            column, row = np.rint(points.pixels[points.detection_index == index]).astype(int).T
            assert inner[row, column].all()


def test_the_window_around_a_point_lies_in_the_image() -> None:
    poses = [pose(turn=(0.3 * t, 0.6 * t, 0)) for t in TIMES]
    frames = [picture(k, T, half_size_m=(2.0, 1.5)) for k, T in enumerate(poses)]
    assert frames[0][1].masks[0].all(), "the object reaches past all borders"
    for points in followed(frames, poses):
        off_px = np.minimum(np.rint(points.pixels), np.array([159, 119]) - np.rint(points.pixels))
        assert off_px.min() >= 5, "the window has 11 pixels"


@pytest.mark.parametrize(("crossing", "has_points"), [(0.0, False), (0.1, False), (1.0, True)])
def test_no_point_lies_where_it_would_slide_along_a_stripe(crossing, has_points) -> None:
    """Slanted stripes with sharp sides, crossed by others of a share of their contrast.

    Where a faint one crosses a strong one is a corner, but of the window's matrix the eigenvalues stand as the square
    of the contrasts.
    """
    frame, detections = picture(0, pose())
    v, u = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width]
    grey = 127 + 50 * np.sign(np.sin((u + 0.2 * v) / 6)) + 50 * crossing * np.sign(np.sin((v - 0.2 * u) / 6))
    rgb = np.repeat(np.rint(grey).astype(np.uint8)[..., None], 3, axis=2)
    [points] = followed([(replace(frame, rgb=rgb), detections)], [pose()])
    assert (len(points.pixels) > 10) == has_points
    assert has_points or len(points.pixels) == 0


def test_a_points_place_is_its_pixel_at_its_depth() -> None:
    T = pose(turn=(0.1, -0.2, 0.05))
    [points] = followed([picture(0, T)], [T])
    assert len(points.pixels) > 15
    # The centre of pixel u of the half size image lies between pixels 2 u and 2 u + 1.
    np.testing.assert_allclose(project(points.p_camera, CAMERA), 2 * points.pixels + 0.5, rtol=0, atol=1e-6)
    np.testing.assert_allclose(transform(T, points.p_camera)[:, 2], OBJECT_M, rtol=0, atol=0.002)
    assert np.isnan(points.past_world).all()
    assert np.isnan(points.past_pixels).all()
    assert np.isnan(points.past_s).all()


def test_the_past_of_a_point_is_where_it_was_seen_in_the_frames_before() -> None:
    settings = replace(SETTINGS, memory_frames=3)
    poses = [CAMERAS["sideways and forward"](t) for t in TIMES[:6]]
    points = followed([picture(k, T) for k, T in enumerate(poses)], poses, settings)[-1]
    np.testing.assert_allclose(points.past_s, np.array([4, 3, 2]) / RATE_HZ, rtol=0, atol=1e-12)
    old = np.isfinite(points.past_world[:, 2, 0])
    assert np.count_nonzero(old) > 15
    # It stands: where it was is where it is.
    now = transform(poses[-1], points.p_camera[old])
    np.testing.assert_allclose(points.past_world[old], np.repeat(now[:, None], 3, axis=1), rtol=0, atol=0.01)
    for ago, T_then in enumerate(poses[4:1:-1]):
        then = project(transform(inverse(T_then), points.past_world[old, ago]), CAMERA)
        np.testing.assert_allclose(2 * points.past_pixels[old, ago] + 0.5, then, rtol=0, atol=1e-4)
    new = np.isnan(points.past_world)
    np.testing.assert_array_equal(np.isnan(points.past_pixels), new[:, :, :2])


@pytest.mark.parametrize(("jump_m", "is_kept"), [(0.2, True), (0.4, False), (-0.4, False), (-2.0, False)])
def test_points_are_lost_where_the_depth_jumps(jump_m, is_kept) -> None:
    frame, detections = picture(0, pose())
    later, _ = picture(1, pose())
    depth = later.depth_m.copy()
    depth[:, 160:] += np.float32(jump_m)  # lands on 0, no depth, for -2.0
    first, second = followed([(frame, detections), (replace(later, depth_m=depth), detections)], [pose(), pose()])
    old = second.pixels[np.isfinite(second.past_world[:, 0, 0]), 0]
    beside, there = (np.count_nonzero(first.pixels[:, 0] < 78), np.count_nonzero(first.pixels[:, 0] > 81))
    assert min(beside, there) > 5
    assert np.count_nonzero(old < 78) == beside, "those beside stay"
    assert np.count_nonzero(old > 81) == (there if is_kept else 0)
    if jump_m == -2.0:
        assert (second.p_camera[:, 2] > 0).all(), "without depth there is no point"


def test_a_point_that_leaves_every_mask_is_lost() -> None:
    frame, detections = picture(0, pose())
    later, _ = picture(1, pose())
    lower = detect(detections.masks[0] & (np.arange(CAMERA.height)[:, None] > 120))
    after = followed([(frame, detections), (later, lower)], [pose(), pose()])[1]
    assert (2 * after.pixels[:, 1] > 120).all()
    assert np.isfinite(after.past_world[:, 0, 0]).any()


def test_points_are_refilled_when_too_few_are_left() -> None:
    v = np.arange(CAMERA.height)[:, None]
    frame, whole = picture(0, pose())
    views = [(frame, detect(whole.masks[0] & (v < 109))), *((picture(k, pose())[0], whole) for k in (1, 2))]
    few, refilled, same = followed(views, [pose()] * 3)
    assert 0.55 * SETTINGS.points < len(few.pixels) < 0.7 * SETTINGS.points
    assert 0.75 * SETTINGS.points <= len(refilled.pixels) <= SETTINGS.points
    assert np.count_nonzero(refilled.pixels[:, 1] > 55) > 5, "the new ones are where it was hidden"
    assert np.count_nonzero(np.isfinite(refilled.past_world[:, 0, 0])) == len(few.pixels), "the old ones go on"
    assert len(same.pixels) == len(refilled.pixels), "enough of them: nothing is looked for"
    distances = np.linalg.norm(refilled.pixels[:, None] - refilled.pixels[None], axis=-1)
    assert distances[~np.eye(len(distances), dtype=bool)].min() > 3, "never one point twice"


def test_a_surface_without_texture_or_depth_says_nothing() -> None:
    flat = [picture(k, pose(), contrast=0.0) for k in range(3)]
    assert motion(followed(flat, [pose()] * 3)[-1], pose()) is None
    blind = [(replace(f, depth_m=np.zeros_like(f.depth_m)), d) for f, d in (picture(k, pose()) for k in range(3))]
    assert len(followed(blind, [pose()] * 3)[-1].pixels) == 0


def test_without_detections_there_are_no_points_and_afterwards_they_come_back() -> None:
    none = Detections(
        masks=np.zeros((0, 240, 320), bool), boxes_px=np.zeros((0, 4)), class_names=(), scores=np.zeros(0)
    )
    views = [picture(k, pose()) for k in range(4)]
    views[1] = (views[1][0], none)
    points = followed(views, [pose()] * 4)
    assert [len(p.pixels) > 0 for p in points] == [True, False, True, True]
    assert surface_motions(points[1], [], pose(), CAMERA, NOISE, SETTINGS) == ()
    assert motion(points[2], pose()) is None
    assert motion(points[3], pose()) is not None


def test_a_mask_at_the_images_corner_and_one_of_a_pixel_are_no_trouble() -> None:
    frame, _ = picture(0, pose())
    corner, speck = np.zeros((2, 240, 320), bool)
    corner[200:, 290:], speck[239, 319] = True, True
    detections = detect(corner, speck)
    wider = replace(detections, boxes_px=detections.boxes_px + np.array([-3, -3, 40, 40.0]))
    for each in (detections, wider):
        points = followed([(frame, each), (picture(1, pose())[0], each)], [pose(), pose()])[-1]
        assert set(points.detection_index) <= {0}


def test_two_runs_are_equal() -> None:
    poses = [CAMERAS["turning"](t) for t in TIMES]
    frames = [picture(k, T, offset=(0.3 * t, 0, 0)) for k, (t, T) in enumerate(zip(TIMES, poses, strict=True))]
    one, other = (followed(frames, poses) for _ in range(2))
    for a, b in zip(one, other, strict=True):
        for name in ("grey", "pixels", "p_camera", "detection_index", "past_world", "past_pixels", "past_s"):
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    first, second = (motion(points[-1], poses[-1]) for points in (one, other))
    assert first is not None
    assert second is not None
    np.testing.assert_array_equal(first.velocity_world, second.velocity_world)
    np.testing.assert_array_equal(first.covariance, second.covariance)
    assert first.moving_share == second.moving_share


@pytest.mark.parametrize(("turn_rad", "is_known"), [(0.35, True), (0.35, False)])
def test_points_of_a_camera_that_turns_fast_are_found_where_they_are_expected(turn_rad, is_known) -> None:
    """They jump by 95 pixels in one frame; searched from where they were, hardly any is found."""
    poses = [pose(turn=(0, -0.175, 0)), pose(turn=(0, turn_rad - 0.175, 0))]
    (first, seen), (second, seen_later) = (picture(k, T) for k, T in enumerate(poses))
    before = follow(None, first, seen, None, poses[0], SETTINGS)
    after = follow(before, second, seen_later, poses[0], poses[1] if is_known else poses[0], SETTINGS)
    kept = np.count_nonzero(np.isfinite(after.past_world[:, 0, 0]))
    if not is_known:
        assert kept < 0.25 * len(before.pixels)
        return
    assert kept >= 0.5 * len(before.pixels)
    answer = motion(after, poses[1])
    assert answer is not None
    assert answer.moving_share == 0.0


TURNS = {
    "turning left and right": lambda t: pose(turn=(0, 0.25 * np.sin(8 * t), 0)),
    "turning up and down": lambda t: pose(turn=(0.15 * np.sin(8 * t), 0, 0)),
    "rolling": lambda t: pose(turn=(0, 0, 0.6 * t)),
}


@pytest.mark.parametrize("texture", ["stripes", "checks"])
@pytest.mark.parametrize("camera", TURNS)
def test_the_points_of_a_pattern_that_stands_stand_while_the_camera_turns(camera, texture) -> None:
    """Neither does flow fall for the next period of the pattern, nor do points slide along a stripe."""
    poses = [TURNS[camera](t) for t in TIMES]
    frames = [picture(k, T, texture=texture) for k, T in enumerate(poses)]
    moving = known = 0.0
    for points, T in list(zip(followed(frames, poses), poses, strict=True))[1:]:
        answer = motion(points, T)
        if answer is not None:
            moving, known = moving + answer.moving_share * answer.points, known + answer.points
            assert np.linalg.norm(answer.velocity_world) < 0.05
    assert known > 9 * 15
    assert moving <= 0.03 * known


def test_new_points_are_spread_over_the_object() -> None:
    """Of each third of a large rectangle there are some, although one of them has by far the strongest corners."""
    half_width_m, half_height_m = 0.55, 0.8
    frame, detections = picture(0, pose(), contrast=0.4, half_size_m=(half_width_m, half_height_m))
    loud, _ = picture(0, pose(), half_size_m=(half_width_m, half_height_m))
    _, strong = picture(0, pose(), half_size_m=(half_width_m / 3, half_height_m))
    rgb = np.where(strong.masks[0][..., None], loud.rgb, frame.rgb)
    [points] = followed([(replace(frame, rgb=rgb), detections)], [pose()])
    assert len(points.pixels) >= 0.75 * SETTINGS.points
    by_third, _ = np.histogram(points.p_camera[:, 0], half_width_m * np.array([-1, -1 / 3, 1 / 3, 1]))
    assert by_third.min() >= 0.1 * SETTINGS.points


@pytest.mark.parametrize(("grey_levels", "is_kept"), [(4, True), (16, False)])
def test_a_point_whose_surroundings_changed_was_not_found_again(grey_levels, is_kept) -> None:
    """A shadow's edge, say: a part of the object is brighter, by so much on average, in a pattern that is not its."""
    frame, detections = picture(0, pose(), contrast=0.5)
    change = np.zeros((CAMERA.height, CAMERA.width, 1))
    v, u = np.mgrid[0 : CAMERA.height : 4, 0 : CAMERA.width : 4]
    blocks = np.where((u // 4 + v // 4) % 2, 1.0, -1.0) * grey_levels
    change[:, 160:, 0] = np.kron(blocks, np.ones((4, 4)))[:, 160:]
    rgb = np.clip(frame.rgb + change, 0, 255).astype(np.uint8)
    later = replace(picture(1, pose())[0], rgb=rgb)
    first, second = followed([(frame, detections), (later, detections)], [pose(), pose()])
    old = second.pixels[np.isfinite(second.past_world[:, 0, 0]), 0]
    for is_side, share in ((lambda u: u < 74, 1.0), (lambda u: u > 86, float(is_kept))):
        before = np.count_nonzero(is_side(first.pixels[:, 0]))
        assert before > 5
        assert np.count_nonzero(is_side(old)) == pytest.approx(share * before, abs=0.1 * before)


class Playback:
    """Answers with the detections of the pictures."""

    def __init__(self, detections) -> None:
        self._detections = detections

    def segment(self, frame: RgbdFrame) -> Detections:
        return self._detections[frame.index]


@pytest.mark.parametrize("half_size_m", [(HALF_WIDTH_M, HALF_HEIGHT_M), (0.2, 0.2)], ids=["large", "small"])
@pytest.mark.parametrize(("towards_m_s", "reason"), [(0.5, Reason.SPEED), (-0.5, Reason.SPEED), (0.0, Reason.IDLE)])
def test_a_chair_that_comes_straight_at_the_camera_is_fast_though_it_hardly_leaves_its_pixels(
    towards_m_s, reason, half_size_m
) -> None:
    times = np.arange(20) / RATE_HZ
    views = [picture(k, pose(), offset=(0, 0, -towards_m_s * t), half_size_m=half_size_m) for k, t in enumerate(times)]
    method = DotMask(Playback([detections for _, detections in views]), CALIBRATED)
    shares, reasons = [], []
    for frame, _ in views:
        [track] = method.step(frame, pose()).tracks
        assert track.verdict is not None
        reasons.append(track.verdict.reason)
        if track.surface is not None:
            shares.append(track.surface.moving_share)
    assert len(shares) >= 15
    if reason is Reason.IDLE:
        assert set(reasons[CALIBRATED.proof_frames :]) == {Reason.IDLE}
        assert max(shares) == 0.0
    else:
        assert set(reasons[6:]) == {Reason.SPEED}
        if half_size_m == (0.2, 0.2):
            assert max(shares[:12]) < CHAIR.moving_share, "its points alone do not tell"
    assert track.surface is not None
    np.testing.assert_allclose(track.surface.velocity_world, [0, 0, -towards_m_s], rtol=0, atol=0.05)


# ---- on exact points ----------------------------------------------------------------------------


def exact(paths, T_world_camera, stamps, owners=None, ages=None, turned_px=0.0):
    """Points whose `paths` (N, K + 1, 3) in the world are known at `stamps` (K + 1,), the latest first.

    The camera was where it is, but they were `turned_px` pixels of the image elsewhere in it.
    """
    paths, stamps = np.asarray(paths, float), np.asarray(stamps, float)
    p_camera = transform(inverse(T_world_camera), paths[:, 0])
    past = paths[:, 1:].copy()
    for point, age in enumerate(ages if ages is not None else []):
        past[point, age:] = np.nan
    then = project(transform(inverse(T_world_camera), past.reshape(-1, 3)), CAMERA).reshape(*past.shape[:2], 2)
    return SurfacePoints(
        timestamp_s=stamps[0],
        grey=np.zeros((120, 160), np.uint8),
        pixels=((project(p_camera, CAMERA) - 0.5) / 2).astype(np.float32),
        past_pixels=((then + np.array([turned_px, 0.0]) - 0.5) / 2).astype(np.float32),
        p_camera=p_camera,
        detection_index=np.zeros(len(paths), np.intp) if owners is None else np.asarray(owners, np.intp),
        past_world=past,
        past_s=stamps[1:],
    )


LOOKS_ALONG_X = pose(-2.0, 0.3, 0.1)
LOOKS_ALONG_X[:3, :3] = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]
STAMPS = 1.0 - np.arange(11) / RATE_HZ


def straight(count, velocity, seed=0):
    """Points around the origin on straight paths (N, 11, 3)."""
    start = np.random.default_rng(seed).uniform(-0.3, 0.3, (count, 1, 3))
    return start + (STAMPS - STAMPS[0])[None, :, None] * np.asarray(velocity, float)


def test_points_that_move_alike_have_their_velocity_exactly() -> None:
    velocity = [0.2, -0.5, 0.1]
    answer = motion(exact(straight(20, velocity), LOOKS_ALONG_X, STAMPS), LOOKS_ALONG_X)
    assert answer is not None
    np.testing.assert_allclose(answer.velocity_world, velocity, rtol=0, atol=1e-6)
    assert (answer.points, answer.moving_share) == (20, 1.0)


@pytest.mark.parametrize("moving", [0, 1, 4, 13, 20])
def test_the_share_counts_the_points_that_move(moving) -> None:
    paths = np.concatenate([straight(moving, [0, 0.5, 0]), straight(20 - moving, [0, 0, 0], 1)])
    answer = motion(exact(paths, LOOKS_ALONG_X, STAMPS), LOOKS_ALONG_X)
    assert answer is not None
    assert answer.moving_share == moving / 20
    np.testing.assert_allclose(answer.velocity_world, [0, 0.5 if moving > 10 else 0, 0], rtol=0, atol=1e-6)


@pytest.mark.parametrize("turned_px", [0.0, 50.0])
def test_a_point_moves_if_it_left_its_pixel_and_is_faster_than_the_class_threshold(turned_px) -> None:
    """At 2 m a pixel is 7.7 mm: in a third of a second 1.6 pixels are 37 mm/s; on a long way flow errs more."""
    points = straight(10, [0, 0, 0])
    points[:, :, 0] = 0  # all at one depth
    pixel_m = 2.0 / CAMERA.fx

    def share(left_px, threshold, count=11):
        speed = left_px * pixel_m / (STAMPS[0] - STAMPS[count - 1])
        paths = points + (STAMPS - STAMPS[0])[None, :, None] * np.array([0, 0, speed])
        model = replace(CHAIR, speed_threshold_m_s=threshold)
        seen = exact(paths[:, :count], LOOKS_ALONG_X, STAMPS[:count], turned_px=turned_px)
        answer = motion(seen, LOOKS_ALONG_X, model)
        assert answer is not None
        return answer.moving_share

    def noise_px(left_px):
        """The way is the one that it left and, across it, the one of the camera."""
        way_px = np.hypot(left_px, turned_px)
        return SETTINGS.flow_sigmas * (SETTINGS.flow_sigma_px + SETTINGS.flow_sigma_share * way_px)

    least = brentq(lambda left_px: left_px - noise_px(left_px), 0, 100)
    assert least == pytest.approx(1.5 / 0.94 if turned_px == 0 else 4.5, rel=0.01)
    for count in (11, 2):
        assert (share(0.99 * least, 0.0, count), share(1.01 * least, 0.0, count)) == (0.0, 1.0)
        # Far beyond the noise, the threshold of the class decides.
        speed = 5 * least * pixel_m / (STAMPS[0] - STAMPS[count - 1])
        assert (share(5 * least, 1.01 * speed, count), share(5 * least, 0.99 * speed, count)) == (0.0, 1.0)


@pytest.mark.parametrize(("away_at", "moves"), [(10, True), (5, True), (2, False)])
def test_a_point_is_compared_with_its_oldest_place_and_the_one_of_half_that_age(away_at, moves) -> None:
    """It was 0.1 m, 13 pixels, away in one of the frames alone."""
    paths = straight(10, [0, 0, 0])
    paths[:, away_at, 1] += 0.1
    answer = motion(exact(paths, LOOKS_ALONG_X, STAMPS), LOOKS_ALONG_X)
    assert answer is not None
    assert answer.moving_share == float(moves)


def test_the_velocity_is_taken_over_the_last_frames_only() -> None:
    """It has just set off: over the last 0.11 s, three frames of thirty, it moved, before it stood."""
    paths = straight(10, [0, 0, 0])
    paths[:, :4, 1] += 0.6 * (STAMPS[:4] - STAMPS[3])
    answer = motion(exact(paths, LOOKS_ALONG_X, STAMPS), LOOKS_ALONG_X)
    assert answer is not None
    np.testing.assert_allclose(answer.velocity_world, [0, 0.6, 0], rtol=0, atol=1e-6)
    over_all = motion(exact(paths, LOOKS_ALONG_X, STAMPS), LOOKS_ALONG_X, settings=replace(SETTINGS, velocity_s=9))
    assert over_all is not None
    np.testing.assert_allclose(over_all.velocity_world, [0, 0.6 * 3 / 10, 0], rtol=0, atol=1e-6)


def test_points_of_every_age_count_with_the_time_that_they_are_known_for() -> None:
    velocity = [0, 0.4, -0.2]
    ages = [1, 1, 2, 3, 5, 8, 10, 10]
    answer = motion(exact(straight(8, velocity), LOOKS_ALONG_X, STAMPS, ages=ages), LOOKS_ALONG_X)
    assert answer is not None
    np.testing.assert_allclose(answer.velocity_world, velocity, rtol=0, atol=1e-6)


def test_new_points_and_few_points_say_nothing() -> None:
    paths = straight(SETTINGS.least_points, [0, 0.5, 0])
    enough = exact(paths, LOOKS_ALONG_X, STAMPS)
    assert motion(enough, LOOKS_ALONG_X) is not None
    assert motion(exact(paths[1:], LOOKS_ALONG_X, STAMPS), LOOKS_ALONG_X) is None
    new = exact(paths, LOOKS_ALONG_X, STAMPS, ages=[0])
    assert motion(new, LOOKS_ALONG_X) is None
    assert motion(exact(paths[:0], LOOKS_ALONG_X, STAMPS), LOOKS_ALONG_X) is None


def test_every_detection_gets_its_own_answer_and_its_class_threshold() -> None:
    paths = np.concatenate([straight(6, [0, 0.3, 0]), straight(2, [0, 1, 0], 1), straight(6, [0, 0.3, 0], 2)])
    points = exact(paths, LOOKS_ALONG_X, STAMPS, owners=[0] * 6 + [1] * 2 + [2] * 6)
    slow = replace(CHAIR, speed_threshold_m_s=0.4)
    first, second, third = surface_motions(points, [CHAIR, CHAIR, slow], LOOKS_ALONG_X, CAMERA, NOISE, SETTINGS)
    assert second is None
    assert first is not None
    assert third is not None
    assert (first.moving_share, third.moving_share) == (1.0, 0.0)


def test_the_covariance_of_points_without_spread_is_the_floor() -> None:
    """The class's own difference between surface and centre, and the camera's uncertain way over three frames."""
    answer = motion(exact(straight(20, [0.1, 0.2, 0.3]), LOOKS_ALONG_X, STAMPS), LOOKS_ALONG_X)
    assert answer is not None
    floor = CHAIR.surface_sigma_m_s**2 + (NOISE.pose_position_sigma_m / (3 / RATE_HZ)) ** 2
    np.testing.assert_allclose(answer.covariance, floor * np.eye(3), rtol=1e-6, atol=1e-12)


def test_the_velocity_errs_as_its_covariance_says() -> None:
    """Noise of the depth along the camera's axis, which is the world's x: the velocity's error, over many draws."""
    bare_model: ClassModel = replace(CHAIR, surface_sigma_m_s=0.0)
    bare_noise: MeasurementNoise = replace(NOISE, pose_position_sigma_m=0.0)
    squares, said = [], []
    for seed in range(600):
        rng = np.random.default_rng(seed)
        paths = straight(24, [0, 0, 0], seed)
        paths[:, :, 0] += rng.normal(0, 0.01, paths.shape[:2])
        paths[:, :, 1:] += rng.normal(0, 0.001, (*paths.shape[:2], 2))
        answer = motion(exact(paths, LOOKS_ALONG_X, STAMPS), LOOKS_ALONG_X, bare_model, noise=bare_noise)
        assert answer is not None
        assert answer.covariance[0, 0] > 9 * answer.covariance[1, 1], "each axis has its own"
        squares.append(answer.velocity_world[0] ** 2)
        said.append(answer.covariance[0, 0])
    # It allows for the overlap of three frames, which independent draws do not have: a third of the variance.
    assert np.mean(squares) / np.mean(said) == pytest.approx(1 / 3, rel=0.2)
