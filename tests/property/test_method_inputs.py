"""What DotMask does with wrong or odd input: one clear error that leaves the state alone, or a stated outcome."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.spatial.transform import Rotation

from dotmask.pipeline import DotMask, FrontEndResult
from dotmask.profiles import CALIBRATED, PAPER, MaskGrowth, Profile
from dotmask.records import Detections, Intrinsics, RgbdFrame

CAMERA = Intrinsics(width=64, height=48, fx=50.0, fy=50.0, cx=31.5, cy=23.5)
SIZE = (CAMERA.height, CAMERA.width)
GOOD_FRAMES, RATE_HZ, WALL_M, OBJECT_M = 3, 30.0, 4.0, 2.0
LINEAR = (PAPER, CALIBRATED, replace(CALIBRATED, name="mask_centroid", measurement="mask_centroid"))
ALL = (*LINEAR, replace(CALIBRATED, name="pixel_depth", measurement="pixel_depth"))
BY_PROFILE = pytest.mark.parametrize("profile", ALL, ids=lambda p: p.name)


def rectangle(u0: int, v0: int, u1: int, v1: int) -> np.ndarray:
    mask = np.zeros(SIZE, bool)
    mask[v0 : v1 + 1, u0 : u1 + 1] = True
    return mask


@dataclass(frozen=True, kw_only=True)
class Given:
    """A frame, and what the segmenter finds in it: an error where it cannot even be said."""

    index: int
    timestamp_s: float
    depth_m: np.ndarray
    masks: np.ndarray
    boxes_px: np.ndarray
    class_names: tuple[str, ...] = ("person",)
    scores: np.ndarray
    T_world_camera: np.ndarray

    @property
    def frame(self) -> RgbdFrame:
        rgb = np.zeros((*SIZE, 3), np.uint8)
        return RgbdFrame(
            index=self.index, timestamp_s=self.timestamp_s, rgb=rgb, depth_m=self.depth_m, intrinsics=CAMERA
        )

    def segment(self, frame: RgbdFrame) -> Detections:
        return Detections(masks=self.masks, boxes_px=self.boxes_px, class_names=self.class_names, scores=self.scores)


def good(index: int) -> Given:
    """A person before a wall, who walks to the right."""
    mask = rectangle(10 + index, 10, 29 + index, 29)
    return Given(
        index=index,
        timestamp_s=index / RATE_HZ,
        depth_m=np.where(mask, OBJECT_M, WALL_M).astype(np.float32),
        masks=mask[None],
        boxes_px=np.array([[10.0 + index, 10, 29 + index, 29]]),
        scores=np.ones(1),
        T_world_camera=np.eye(4),
    )


class Walk:
    """DotMask after some good frames."""

    def __init__(self, profile: Profile) -> None:
        self.method, self._now = DotMask(self, profile), good(0)
        for index in range(GOOD_FRAMES):
            self.result = self.step(good(index))

    def segment(self, frame: RgbdFrame) -> Detections:
        return self._now.segment(frame)

    def step(self, given: Given) -> FrontEndResult:
        self._now = given
        result = self.method.step(given.frame, given.T_world_camera)
        for track in result.tracks:
            assert np.isfinite(track.mean).all()
            assert np.linalg.eigvalsh(track.covariance).min() > 0
        return result


class Shown:
    """A segmenter that answers with what is in the frames that it was told of."""

    def __init__(self, frames: list[Given]) -> None:
        self._frames = {frame.index: frame for frame in frames}

    def segment(self, frame: RgbdFrame) -> Detections:
        return self._frames[frame.index].segment(frame)


NEXT = good(GOOD_FRAMES)


def assert_same(one: FrontEndResult, other: FrontEndResult) -> None:
    np.testing.assert_array_equal(one.masked.mo_mdi_m, other.masked.mo_mdi_m)
    np.testing.assert_array_equal(one.masked.mdi_m, other.masked.mdi_m)
    assert_same_tracks(one, other)


def assert_same_tracks(one: FrontEndResult, other: FrontEndResult) -> None:
    assert len(one.tracks) == len(other.tracks)
    for a, b in zip(one.tracks, other.tracks, strict=True):
        assert (a.track_id, a.hits, a.phase, a.misses, a.detection_index, a.verdict) == (
            (b.track_id, b.hits, b.phase, b.misses, b.detection_index, b.verdict)
        )
        np.testing.assert_array_equal(a.mean, b.mean)
        np.testing.assert_array_equal(a.covariance, b.covariance)


# ---- errors: the next good frame gives what it would have given without the bad one ----------------

NOT_FINITE_POSE = np.eye(4)
NOT_FINITE_POSE[0, 3] = np.nan
MIRRORED = np.diag([1.0, 1, -1, 1])


def with_depth(depth: float) -> Given:
    """One pixel beside the object has this depth."""
    depth_m = NEXT.depth_m.copy()
    depth_m[2, 3] = depth
    return replace(NEXT, depth_m=depth_m)


def with_box(*box: float) -> Given:
    return replace(NEXT, boxes_px=np.array([box], float))


REFUSED = {
    "a repeated time stamp": (replace(NEXT, timestamp_s=good(GOOD_FRAMES - 1).timestamp_s), "not later"),
    "an earlier time stamp": (replace(NEXT, timestamp_s=0.5 / RATE_HZ), "not later"),
    "a time stamp that is not finite": (replace(NEXT, timestamp_s=np.nan), "timestamp_s: not finite"),
    "a score that is not a number": (replace(NEXT, scores=np.array([np.nan])), "scores: .* not finite"),
    "a box that is not finite": (replace(NEXT, boxes_px=np.full((1, 4), np.inf)), "boxes_px: .* not finite"),
    "fewer boxes than masks": (replace(NEXT, boxes_px=np.zeros((0, 4))), "boxes_px: expected shape"),
    "a score above 1": (replace(NEXT, scores=np.array([1.5])), "scores: expected 0 to 1"),
    "a score below 0": (replace(NEXT, scores=np.array([-0.1])), "scores: expected 0 to 1"),
    "a box from right to left": (with_box(30, 10, 10, 29), "boxes_px: .* ends before it begins"),
    "a box from below to above": (with_box(10, 29, 30, 10), "boxes_px: .* ends before it begins"),
    "masks that are smaller than the frame": (replace(NEXT, masks=np.ones((1, 24, 32), bool)), "masks: expected .*48"),
    "masks that are larger than the frame": (replace(NEXT, masks=np.ones((1, 96, 128), bool)), "masks: expected .*48"),
    **{f"a depth of {d}": (with_depth(d), r"depth_m: .* np\.where") for d in (np.nan, np.inf, -np.inf, -1.0)},
    "a camera pose that is not finite": (replace(NEXT, T_world_camera=NOT_FINITE_POSE), "not finite"),
    "a camera pose of 3x3": (replace(NEXT, T_world_camera=np.eye(3)), r"T_world_camera: expected shape \(4, 4\)"),
    "a camera pose of zeros": (replace(NEXT, T_world_camera=np.zeros((4, 4))), "last row"),
    "a camera pose with a scale": (replace(NEXT, T_world_camera=np.diag([2.0, 2, 2, 1])), "no rotation"),
    "a camera pose with a scale in its last row": (replace(NEXT, T_world_camera=2 * np.eye(4)), "last row"),
    "a camera pose with a mirror": (replace(NEXT, T_world_camera=MIRRORED), "no rotation"),
}


@BY_PROFILE
@pytest.mark.parametrize("name", REFUSED)
def test_refused_with_the_state_left_alone(name: str, profile: Profile) -> None:
    bad, message = REFUSED[name]
    walk = Walk(profile)
    with pytest.raises(ValueError, match=message):
        walk.step(bad)
    assert_same(walk.step(NEXT), Walk(profile).step(NEXT))


@BY_PROFILE
def test_a_segmenter_that_fails_leaves_the_state_alone(profile: Profile) -> None:
    class Failing(Given):
        def segment(self, frame: RgbdFrame) -> Detections:
            raise OSError("no answer")

    walk = Walk(profile)
    with pytest.raises(OSError, match="no answer"):
        walk.step(Failing(**{name: getattr(NEXT, name) for name in Given.__dataclass_fields__}))
    assert_same(walk.step(NEXT), Walk(profile).step(NEXT))


@BY_PROFILE
@pytest.mark.parametrize("pose", [NOT_FINITE_POSE, np.eye(3), MIRRORED], ids=["not finite", "3x3", "mirror"])
def test_refinement_with_a_pose_that_is_none_is_refused_with_the_state_left_alone(
    pose: np.ndarray, profile: Profile
) -> None:
    walk = Walk(profile)
    with pytest.raises(ValueError, match="T_world_camera: "):
        walk.method.refine(pose)
    assert_same_tracks(walk.method.refine(np.eye(4)), Walk(profile).method.refine(np.eye(4)))
    assert_same(walk.step(NEXT), Walk(profile).step(NEXT))


@BY_PROFILE
@pytest.mark.parametrize("timestamp_s", [good(GOOD_FRAMES - 1).timestamp_s, 0.5 / RATE_HZ], ids=["repeated", "earlier"])
def test_a_stamp_of_the_past_is_refused_where_no_track_lives(timestamp_s: float, profile: Profile) -> None:
    nothing = {"masks": np.zeros((0, *SIZE), bool), "boxes_px": np.zeros((0, 4)), "class_names": ()}
    empty = [replace(good(k), **nothing, scores=np.zeros(0)) for k in range(GOOD_FRAMES)]
    method = DotMask(Shown(empty), profile)
    for frame in empty:
        assert method.step(frame.frame, np.eye(4)).tracks == ()
    with pytest.raises(ValueError, match="not later"):
        method.step(replace(NEXT, timestamp_s=timestamp_s).frame, np.eye(4))


@BY_PROFILE
def test_a_pose_of_single_precision_is_good_enough(profile: Profile) -> None:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec([0.3, -0.2, 0.5]).as_matrix()
    walk = Walk(profile)
    walk.step(replace(NEXT, T_world_camera=T.astype(np.float32)))


# ---- stated outcomes --------------------------------------------------------------------------------


@BY_PROFILE
@pytest.mark.parametrize("depth", [1e-9, 1e7, 3e38], ids=str)
def test_depth_under_a_mask_that_no_camera_measures_counts_as_no_return(depth: float, profile: Profile) -> None:
    is_odd = NEXT.masks[0] & (np.arange(CAMERA.width) % 3 == 0)
    odd, none = (replace(NEXT, depth_m=np.where(is_odd, d, NEXT.depth_m).astype(np.float32)) for d in (depth, 0.0))
    assert_same(Walk(profile).step(odd), Walk(profile).step(none))


@BY_PROFILE
@pytest.mark.parametrize("depth", [0.0, 1e-9, 1e7], ids=str)
def test_without_any_depth_under_its_mask_an_object_is_removed_and_its_track_coasts(
    depth: float, profile: Profile
) -> None:
    result = Walk(profile).step(replace(NEXT, depth_m=np.where(NEXT.masks[0], depth, WALL_M).astype(np.float32)))
    assert [track.misses for track in result.tracks] == [1]
    assert not result.observations
    for image in (result.masked.mo_mdi_m, result.masked.mdi_m):
        assert (image[NEXT.masks[0]] == 0).all()


@BY_PROFILE
@pytest.mark.parametrize("box", [[13.0, 10, 32, 29], [0, 0, 0, 0]], ids=["box of an object", "box of one pixel"])
def test_with_an_empty_mask_an_object_was_not_seen(box: list[float], profile: Profile) -> None:
    empty = replace(NEXT, masks=np.zeros((1, *SIZE), bool), boxes_px=np.array([box]))
    absent = replace(
        NEXT, masks=np.zeros((0, *SIZE), bool), boxes_px=np.zeros((0, 4)), class_names=(), scores=np.zeros(0)
    )
    assert_same(Walk(profile).step(empty), Walk(profile).step(absent))


@BY_PROFILE
def test_a_mask_of_the_whole_image_leaves_no_depth_for_the_map(profile: Profile) -> None:
    whole = replace(NEXT, masks=np.ones((1, *SIZE), bool), boxes_px=np.array([[0.0, 0, 63, 47]]))
    result = Walk(profile).step(whole)
    assert len(result.observations) == 1
    assert not result.masked.mdi_m.any()


@BY_PROFILE
def test_a_mask_of_one_pixel_is_measured_where_that_is_enough_and_removed_where_not(profile: Profile) -> None:
    speck = replace(NEXT, masks=rectangle(20, 20, 20, 20)[None], boxes_px=np.array([[20.0, 20, 20, 20]]))
    result = Walk(profile).step(speck)
    assert len(result.observations) == (profile.min_depth_pixels == 1)
    assert result.masked.mdi_m[20, 20] == 0
    if not result.observations:
        assert result.masked.mo_mdi_m[20, 20] == 0


@BY_PROFILE
def test_of_200_detections_the_best_are_kept(profile: Profile) -> None:
    masks = np.array([rectangle(2 + n % 50, 2 + n // 5, 11 + n % 50, 6 + n // 5) for n in range(200)])
    boxes = np.array([[2 + n % 50, 2 + n // 5, 11 + n % 50, 6 + n // 5] for n in range(200)], float)
    scores = np.random.default_rng(3).permutation(np.linspace(0.005, 1.0, 200))
    many = replace(NEXT, masks=masks, boxes_px=boxes, class_names=("person",) * 200, scores=scores)
    result = Walk(profile).step(many)
    assert result.detections is not None
    np.testing.assert_array_equal(result.detections.scores, np.sort(scores)[::-1][: profile.max_observations])


@BY_PROFILE
@pytest.mark.parametrize("shift", [(-20, 0), (42, 0), (0, -20), (0, 27)], ids=["left", "right", "above", "below"])
def test_a_box_that_reaches_out_of_the_image_is_measured_by_what_is_inside(
    shift: tuple[int, int], profile: Profile
) -> None:
    u, v = shift
    box = np.array([[10 + u, 10 + v, 29 + u, 29 + v]], float)
    inside = rectangle(max(10 + u, 0), max(10 + v, 0), 29 + u, 29 + v)
    depth = np.where(inside, OBJECT_M, WALL_M).astype(np.float32)
    result = Walk(profile).step(replace(NEXT, masks=inside[None], boxes_px=box, depth_m=depth))
    (observation,) = result.observations
    assert observation.position_camera[2] == pytest.approx(OBJECT_M)
    assert observation.is_partial == profile.noise.notices_hidden_sides
    assert (result.masked.mdi_m[inside] == 0).all()


@BY_PROFILE
@pytest.mark.parametrize(
    "box",
    [[70, 10, 90, 29], [10, 50, 29, 70], [-20, 10, -5, 29], [10, -20, 29, -5], [-1e9, -1e9, -1e8, -1e8]],
    ids=["right", "below", "left", "above", "far away"],
)
def test_a_box_outside_the_image_is_not_measured_and_its_mask_is_removed(box: list[float], profile: Profile) -> None:
    result = Walk(profile).step(with_box(*box))
    assert not result.observations
    assert [track.misses for track in result.tracks] == [1]
    assert not result.masked.mo_mdi_m[NEXT.masks[0]].any()


@BY_PROFILE
@pytest.mark.parametrize("box", [[-1e300, 0, 1e300, 47], [-1e6, -1e6, 1e6, 1e6]], ids=str)
def test_a_box_far_larger_than_the_image_is_measured_by_its_mask(box: list[float], profile: Profile) -> None:
    (observation,) = Walk(profile).step(with_box(*box)).observations
    assert observation.position_camera[2] == pytest.approx(OBJECT_M)


@BY_PROFILE
def test_a_class_that_is_no_object_of_interest_is_as_if_not_there(profile: Profile) -> None:
    zebra = replace(
        NEXT,
        masks=np.array([NEXT.masks[0], rectangle(40, 5, 60, 40)]),
        boxes_px=np.array([NEXT.boxes_px[0], [40, 5, 60, 40]]),
        class_names=("person", "zebra"),
        scores=np.array([0.5, 0.9]),
    )
    assert_same(Walk(profile).step(zebra), Walk(profile).step(replace(NEXT, scores=np.array([0.5]))))


@pytest.mark.parametrize("profile", LINEAR, ids=lambda p: p.name)
def test_after_an_hour_without_frames_an_object_is_where_it_is_seen(profile: Profile) -> None:
    late = replace(NEXT, timestamp_s=3600.0)
    result = Walk(profile).step(late)
    (track,) = result.tracks
    assert track.track_id == 1
    np.testing.assert_allclose(track.position_world, result.observations[0].position_camera, atol=1e-3)


odd_depths = hnp.arrays(np.float32, SIZE, elements=st.sampled_from([0.0, 1e-9, 0.4, 1.0, 2.0, 2.1, 9.0, 60.0, 1e7]))


@BY_PROFILE
@settings(max_examples=25)
@given(
    depths=st.lists(odd_depths, min_size=2, max_size=5),
    corners=st.lists(
        st.tuples(st.integers(0, 63), st.integers(0, 47), st.integers(0, 63), st.integers(0, 47)),
        min_size=1,
        max_size=6,
    ),
    data=st.data(),
)
def test_whatever_is_seen_states_stay_finite_and_every_removed_pixel_lies_under_a_mask(
    depths, corners, data, profile
) -> None:
    boxes = np.array([[min(a, c), min(b, d), max(a, c), max(b, d)] for a, b, c, d in corners], float)
    masks = np.array([rectangle(*(int(x) for x in box)) for box in boxes])
    walk = Walk(replace(profile, growth=MaskGrowth(base_px=0.0), coasting_mask_frames=0))
    for k, depth_m in enumerate(depths):
        count = len(boxes)
        class_names = tuple(data.draw(st.sampled_from(["person", "chair"])) for _ in range(count))
        now = replace(good(GOOD_FRAMES + k), depth_m=depth_m, masks=masks, boxes_px=boxes, class_names=class_names)
        result = walk.step(replace(now, scores=np.linspace(0.5, 0.9, count)))
        for image in (result.masked.mo_mdi_m, result.masked.mdi_m):
            np.testing.assert_array_equal(image[~masks.any(axis=0)], depth_m[~masks.any(axis=0)])
