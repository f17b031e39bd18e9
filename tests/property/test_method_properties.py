"""What must hold for any input, and what the calibrated profile promises, on synthetic RGB-D of walkers and chairs."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.spatial.transform import Rotation

from dotmask.evaluation.classification import ClassificationRecord, confusion
from dotmask.evaluation.filter import chi_square_mean_bounds, normalised_squares
from dotmask.mask_geometry import aligned_iou, intersection_over_union
from dotmask.masking import Cutout, mask_depth
from dotmask.pipeline import DotMask, FrontEndResult
from dotmask.profiles import CALIBRATED, PAPER, PROFILES
from dotmask.records import Detections, Intrinsics, Observation, RgbdFrame
from dotmask.segmentation.selection import select_detections
from dotmask.tracking.association import associate
from dotmask.tracking.ekf import initiate, update
from dotmask.tracking.measurement_model import CAMERA_POINT, PixelDepth
from dotmask.tracking.motion_model import predict

CAMERA = Intrinsics(width=320, height=240, fx=262.5, fy=262.5, cx=159.5, cy=119.5)
SPECK = np.ones((2, 2), bool)

# ---- the filter on its own model ----------------------------------------------------------------


def turned(k: int) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec([0.02 * k, 0.3, -0.01 * k]).as_matrix()
    T[:3, 3] = [0.02 * k, 0.01 * k, 1.0]
    return T


@pytest.mark.parametrize("class_name", ["person", "chair"])
@pytest.mark.parametrize("profile", PROFILES, ids=lambda p: p.name)
def test_nees_and_nis_are_consistent_on_the_exact_model(profile, class_name) -> None:
    """60 runs of 25 frames, drawn from the prior, the motion model and R: means inside their chi-square intervals.

    The interval holds for independent samples: NIS of all frames (innovations are white), NEES of one frame per run.
    """
    runs, frames, dt = 60, 25, 1 / 30
    model = profile.class_model(class_name)
    R = np.array([[4e-4, 1e-4, 0], [1e-4, 9e-4, 2e-4], [0, 2e-4, 1.6e-3]])
    accelerations = model.acceleration_sigma_m_s2 * model.axis_shares
    root = np.linalg.cholesky(R)
    nees, nis = [], []
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        velocity = rng.normal(0, model.prior_speed_sigma_m_s * model.axis_shares)
        x = np.concatenate([rng.normal(0, 1, 3), velocity])
        track = None
        for k in range(frames):
            if k:
                a = rng.normal(0, accelerations)
                x = np.concatenate([x[:3] + dt * x[3:] + 0.5 * dt**2 * a, x[3:] + dt * a])
            T = turned(k)
            z = T[:3, :3].T @ (x[:3] - T[:3, 3]) + root @ rng.normal(size=3)
            seen = Observation(
                position_camera=z,
                covariance=R,
                class_name=class_name,
                detection_index=0,
                mask=SPECK,
                model=CAMERA_POINT,
            )
            if track is None:
                track = initiate(seen, 0.0, T, profile, 1)
            else:
                track = update(predict(track, k * dt, profile), seen, None, T, profile)
                assert track.innovation is not None
                nis.append(track.innovation.nis)
        assert track is not None
        nees.append(normalised_squares((track.mean - x)[None], track.covariance[None])[0])
    low, high = chi_square_mean_bounds(3, len(nis), 0.99)
    assert low < np.mean(nis) < high
    low, high = chi_square_mean_bounds(6, len(nees), 0.99)
    assert low < np.mean(nees) < high


shares = st.floats(0, 1)
steps_of_a_filter = st.lists(
    st.tuples(
        shares,  # of the powers of ten of the time step
        st.tuples(shares, shares, shares),  # and of the axes of R
        st.tuples(*[st.floats(-3, 3)] * 3),  # turn of these axes
        st.tuples(*[st.floats(-2, 2)] * 3),  # where the observation lies beside the prediction
        st.booleans(),  # whether there is one
    ),
    min_size=1,
    max_size=12,
)


@pytest.mark.parametrize(
    ("model", "least", "most"),
    [(CAMERA_POINT, -5, 2), (PixelDepth(intrinsics=CAMERA), -4, 1)],
    ids=["CameraPoint", "PixelDepth"],
)
@settings(max_examples=100, phases=[Phase.generate])
@given(
    steps=steps_of_a_filter,
    turn=st.tuples(*[st.floats(-3, 3)] * 3),
    shift=st.tuples(*[st.floats(-1000, 1000)] * 3),
)
def test_the_covariance_stays_symmetric_and_positive_definite(steps, turn, shift, model, least, most) -> None:
    """For any camera, and R and time steps between powers of ten; the model that is not linear inside the gate only."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(turn).as_matrix()
    T[:3, 3] = shift

    def power(share):
        return 10.0 ** (least + share * (most - least))

    to_units = np.diag([100.0, 100.0, 1.0] if model is not CAMERA_POINT else [1.0, 1.0, 1.0])

    def seen(position, sigmas, axes) -> Observation:
        root = to_units @ Rotation.from_rotvec(axes).as_matrix() @ np.diag(power(np.array(sigmas)))
        return Observation(
            position_camera=np.array([*position[:2], max(position[2], 0.3)]),
            covariance=root @ root.T,
            class_name="person",
            detection_index=0,
            mask=SPECK,
            model=model,
        )

    timestamp_s = 0.0
    track = initiate(seen((0.0, 0.0, 2.0), *steps[0][1:3]), timestamp_s, T, CALIBRATED, 1)
    for dt, sigmas, axes, beside, is_seen in steps:
        timestamp_s += power(dt)
        track = predict(track, timestamp_s, CALIBRATED)
        observation = seen(T[:3, :3].T @ (track.position_world - T[:3, 3]) + beside, sigmas, axes)
        if is_seen and (model is CAMERA_POINT or associate([track], [observation], T, CAMERA, CALIBRATED).pairs):
            track = update(track, observation, None, T, CALIBRATED)
        np.testing.assert_array_equal(track.covariance, track.covariance.T)
        assert np.linalg.eigvalsh(track.covariance).min() > 0


# ---- masks --------------------------------------------------------------------------------------

SIZE = (24, 32)
depths = hnp.arrays(np.float32, SIZE, elements=st.sampled_from([0.0, 0.5, 1.5, 4.0]))
masks_of_three = hnp.arrays(np.bool_, (3, *SIZE), elements=st.booleans(), fill=st.just(False))


def detections_of(masks, scores=None) -> Detections:
    return Detections(
        masks=masks,
        boxes_px=np.array([[i, 0, 20, 20] for i in range(len(masks))], float),
        class_names=("person",) * len(masks),
        scores=np.ones(len(masks)) if scores is None else scores,
    )


fates_of_three = st.lists(st.tuples(st.integers(0, 4), st.booleans()), min_size=3, max_size=3)


def cutouts(masks, fates) -> list[Cutout]:
    """Of masks, each with its radius (pixels) and whether it moves."""
    return [Cutout(mask=m, radius_px=r, is_moving=moves) for m, (r, moves) in zip(masks, fates, strict=True)]


@settings(max_examples=60)
@given(depth=depths, masks=masks_of_three, fates=fates_of_three)
def test_masking_only_removes_and_a_second_time_changes_nothing(depth, masks, fates) -> None:
    removed = cutouts(masks, fates)
    once = mask_depth(depth, removed)
    for image in (once.mo_mdi_m, once.mdi_m):
        assert ((image == depth) | (image == 0)).all()
    assert (once.mdi_m <= once.mo_mdi_m).all()
    assert not once.mdi_m[masks.any(axis=0)].any()
    for mask, (_, is_moving) in zip(masks, fates, strict=True):
        assert not (is_moving and once.mo_mdi_m[mask].any())
    np.testing.assert_array_equal(mask_depth(once.mo_mdi_m, removed).mo_mdi_m, once.mo_mdi_m)
    np.testing.assert_array_equal(mask_depth(once.mdi_m, removed).mdi_m, once.mdi_m)


@settings(max_examples=60)
@given(depth=depths, masks=masks_of_three, fates=fates_of_three, order=st.permutations(range(3)))
def test_masks_do_not_depend_on_the_order_of_the_detections(depth, masks, fates, order) -> None:
    one = mask_depth(depth, cutouts(masks, fates))
    other = mask_depth(depth, cutouts(masks[order], [fates[i] for i in order]))
    np.testing.assert_array_equal(one.mo_mdi_m, other.mo_mdi_m)
    np.testing.assert_array_equal(one.mdi_m, other.mdi_m)


@settings(max_examples=60)
@given(masks=hnp.arrays(np.bool_, (2, *SIZE)), iou=st.sampled_from([intersection_over_union, aligned_iou]))
def test_iou_lies_between_zero_and_one_and_is_one_for_the_same_mask(masks, iou) -> None:
    assert 0.0 <= iou(masks[0], masks[1]) <= 1.0
    assert iou(masks[0], masks[0]) == float(masks[0].any())


@settings(max_examples=60)
@given(scores=st.lists(st.sampled_from([0.05, 0.3, 0.5, 0.9]), min_size=1, max_size=14), data=st.data())
def test_selection_does_not_depend_on_the_order_in_which_a_segmenter_lists(scores, data) -> None:
    count = len(scores)
    detections = detections_of(np.zeros((count, 2, 2), bool), np.array(scores))
    order = data.draw(st.permutations(range(count)))
    one, other = (select_detections(d, PAPER) for d in (detections, detections.select(order)))
    np.testing.assert_array_equal(one.boxes_px, other.boxes_px)
    assert len(one) == min(sum(s >= 0.1 for s in scores), 5)
    assert (np.diff(one.scores) <= 0).all()


# ---- a small world: people and chairs as pictures with depth -----------------------------------------

RATE_HZ = 30
MOVING_IDS = (1, 2)


@dataclass(frozen=True)
class Picture:
    """One frame of the small world."""

    frame: RgbdFrame
    detections: Detections
    instances: tuple[int, ...]
    T_world_camera: np.ndarray
    velocities: dict[int, np.ndarray]


def walker(base, direction, phase):
    """Capsules (end, end, radius) of a person on the spot `base`: trunk, head, legs that swing at the step rate."""
    up = np.array([0, 0, 1.0])
    hip, neck = base + 0.9 * up, base + 1.4 * up
    parts = [(hip, neck, 0.16), (neck + 0.1 * up, neck + 0.2 * up, 0.1)]
    for half in (0.0, 0.5):
        swing = 2 * np.pi * (phase + half)
        thigh = np.deg2rad(25) * np.cos(swing)
        shank = thigh - np.deg2rad(45) * max(0.0, -np.sin(swing))
        knee = hip + 0.43 * (np.sin(thigh) * direction - np.cos(thigh) * up)
        foot = knee + 0.45 * (np.sin(shank) * direction - np.cos(shank) * up)
        hand = neck - 0.05 * up - 0.6 * (np.sin(0.8 * thigh) * direction + np.cos(0.8 * thigh) * up)
        parts += [(hip, knee, 0.08), (knee, foot, 0.06), (foot, foot + 0.12 * direction, 0.04), (neck, hand, 0.045)]
    return parts


def chair(base):
    up, x = np.array([0, 0, 1.0]), np.array([1.0, 0, 0])
    legs = [(base + s * x, base + s * x + 0.45 * up, 0.03) for s in (-0.22, 0.22)]
    return [*legs, *((base - 0.2 * x + h * up, base + 0.2 * x + h * up, 0.06) for h in np.linspace(0.45, 0.95, 6))]


def fine_pixel(p_camera) -> tuple[int, int]:
    """Where a point is seen, in sixteenths of a pixel, as cv2 draws."""
    x, y, z = p_camera
    return round(16 * (x / z * CAMERA.fx + CAMERA.cx)), round(16 * (y / z * CAMERA.fy + CAMERA.cy))


def print_of_cloth(ends, radius, rng):
    """Dots (centre, radius in pixels, grey level) that stay where they are on a capsule with ends (2, 3)."""
    along = ends[1] - ends[0]
    across = np.array([along[1], -along[0], 0.0])
    across *= radius / max(np.linalg.norm(across), 1e-9)
    for _ in range(int(4 + 60 * np.linalg.norm(along) * radius / 0.16)):
        s, r, size, grey = rng.uniform(0, 1), rng.uniform(-0.8, 0.8), rng.uniform(1.0, 2.2), int(rng.integers(0, 256))
        yield ends[0] + s * along + r * across, size, grey


def picture(index: int, *, walking: bool = True) -> Picture:
    """Two people walk at 1.2 m/s, one across the chairs and one beside; three chairs stand; the camera moves."""
    t = index / RATE_HZ
    T = np.eye(4)
    T[:3, :3] = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0.0]])  # looks along the world's y
    T[:3, 3] = [-0.4 + 0.2 * t, 0, 1.2]
    speed = 1.2 if walking else 0.0
    velocities = {1: np.array([speed, 0, 0]), 2: speed * np.array([-0.35, 0.94, 0])}
    velocities |= {i: np.zeros(3) for i in (3, 4, 5)}
    phase = 0.9 * t * walking
    bodies = {
        1: walker(np.array([-1.6, 2.4, 0]) + t * velocities[1], np.array([1.0, 0, 0]), phase),
        2: walker(np.array([1.1, 2.0, 0]) + t * velocities[2], np.array([-0.35, 0.94, 0]), phase + 0.3),
        3: chair(np.array([-0.6, 3.2, 0])),
        4: chair(np.array([0.5, 3.0, 0])),
        5: chair(np.array([1.5, 4.2, 0])),
    }
    depth, ids = np.full((240, 320), 5.5, np.float32), np.zeros((240, 320), np.uint8)
    rgb = np.full((240, 320, 3), 90, np.uint8)
    strokes = []
    for instance, parts in bodies.items():
        for number, (a, b, radius) in enumerate(parts):
            ends = [T[:3, :3].T @ (p - T[:3, 3]) for p in (a, b)]
            strokes.append((0.5 * (ends[0][2] + ends[1][2]), instance, number, ends, radius))
    for z, instance, number, ends, radius in sorted(strokes, key=lambda s: -s[0]):
        line = [fine_pixel(end) for end in ends]
        width = max(1, round(2 * radius * CAMERA.fx / z))
        cv2.line(depth, *line, float(z), width, cv2.LINE_8, 4)
        cv2.line(ids, *line, instance, width, cv2.LINE_8, 4)
        cv2.line(rgb, *line, (120, 120, 120), width, cv2.LINE_8, 4)
        for dot, radius_px, grey in print_of_cloth(np.array(ends), radius, np.random.default_rng([instance, number])):
            cv2.circle(rgb, fine_pixel(dot), round(16 * radius_px), (grey, grey, grey), -1, cv2.LINE_AA, 4)
    rng = np.random.default_rng([17, index])
    noise = rng.standard_normal(depth.shape, dtype=np.float32)
    depth = depth + noise * (0.0012 + 0.0019 * (depth - 0.4) ** 2)
    depth[rng.random(depth.shape) < 0.02] = 0
    seen = [i for i in bodies if np.count_nonzero(ids == i) > 60]
    masks = np.array([ids == i for i in seen])
    boxes = [cv2.boundingRect(m.view(np.uint8)) for m in masks]
    detections = Detections(
        masks=masks,
        boxes_px=np.array([[u, v, u + w - 1, v + h - 1] for u, v, w, h in boxes], float),
        class_names=tuple("person" if i in MOVING_IDS else "chair" for i in seen),
        scores=np.array([0.9 - 0.01 * i for i in seen]),
    )
    frame = RgbdFrame(
        index=index,
        timestamp_s=t,
        rgb=rgb,
        depth_m=depth.astype(np.float32),
        intrinsics=CAMERA,
    )
    return Picture(frame, detections, tuple(seen), T, velocities)


UNMOVED = np.eye(4)


class Playback:
    """A segmenter that answers with what was found before."""

    def __init__(self, found: dict[int, Detections]) -> None:
        self._found = found

    def segment(self, frame: RgbdFrame) -> Detections:
        return self._found[frame.index]


def run(pictures, profile, order=np.arange, T_moved_world=UNMOVED) -> list[FrontEndResult]:
    """What the method makes of pictures that list their detections in some order, in a world that was moved."""
    found = {p.frame.index: p.detections.select(order(len(p.detections))) for p in pictures}
    method = DotMask(Playback(found), profile)
    return [method.step(p.frame, T_moved_world @ p.T_world_camera) for p in pictures]


@pytest.fixture(scope="module")
def pictures():
    return [picture(k) for k in range(75)]


@pytest.fixture(scope="module")
def calibrated(pictures):
    return run(pictures, CALIBRATED)


def beliefs(pictures, steps):
    """(frame, instance, track) of every track that was seen."""
    for k, (p, s) in enumerate(zip(pictures, steps, strict=True)):
        for track in s.tracks:
            if track.detection_index is not None:
                mask = s.detections.masks[track.detection_index]
                instance = next(i for i, m in zip(p.instances, p.detections.masks, strict=True) if (m == mask).all())
                yield k, instance, track


@pytest.mark.parametrize("instance", MOVING_IDS)
def test_the_speed_of_a_walking_person_is_known_within_15_cm_per_second(pictures, calibrated, instance) -> None:
    errors = [
        np.linalg.norm(track.velocity_world - pictures[k].velocities[instance])
        for k, i, track in beliefs(pictures, calibrated)
        if i == instance and track.hits > RATE_HZ
    ]
    assert len(errors) > 20
    assert np.sqrt(np.mean(np.square(errors))) < 0.15


def test_walkers_are_flagged_and_standing_chairs_are_not(pictures, calibrated) -> None:
    records = []
    for k, instance, track in beliefs(pictures, calibrated):
        assert track.verdict is not None
        is_new = track.hits < CALIBRATED.calm_frames
        if not is_new:
            records.append(
                ClassificationRecord(
                    frame=k,
                    instance_id=instance,
                    class_name=track.class_name,
                    is_moving=instance in MOVING_IDS,
                    true_speed_m_s=float(np.linalg.norm(pictures[k].velocities[instance])),
                    is_flagged=track.verdict.is_moving,
                    speed_m_s=track.verdict.speed_m_s,
                )
            )
    scores = confusion(records)
    assert scores.recall is not None
    assert scores.precision is not None
    assert scores.recall >= 0.95
    assert scores.precision >= 0.9


def test_a_walker_is_masked_in_its_first_frame_by_the_calibrated_profile(pictures, calibrated) -> None:
    first = calibrated[0]
    person = first.detections.masks[first.detections.class_names.index("person")]
    assert not first.masked.mo_mdi_m[person].any()
    kept = run(pictures[:1], PAPER)[0]
    assert kept.masked.mo_mdi_m[person].any()


def test_each_object_keeps_its_track(pictures, calibrated) -> None:
    owners: dict[int, set[int]] = {}
    for _, instance, track in beliefs(pictures, calibrated):
        owners.setdefault(instance, set()).add(track.track_id)
    assert sum(len(ids) - 1 for ids in owners.values()) <= 1


def assert_same_but_for_the_world(one: FrontEndResult, other: FrontEndResult) -> None:
    """Ids, verdicts, masks and images are the same; positions may not be."""
    np.testing.assert_array_equal(one.masked.mo_mdi_m, other.masked.mo_mdi_m)
    np.testing.assert_array_equal(one.masked.mdi_m, other.masked.mdi_m)
    for a, b in zip(one.tracks, other.tracks, strict=True):
        assert (a.track_id, a.class_name, a.hits, a.phase, a.misses, a.detection_index) == (
            (b.track_id, b.class_name, b.hits, b.phase, b.misses, b.detection_index)
        )
        np.testing.assert_array_equal(a.mask, b.mask)
        assert a.verdict is not None
        assert b.verdict is not None
        assert (a.verdict.is_moving, a.verdict.reason, a.verdict.mask_iou, a.verdict.calm_frames) == (
            (b.verdict.is_moving, b.verdict.reason, b.verdict.mask_iou, b.verdict.calm_frames)
        )


@pytest.mark.parametrize("has_equal_scores", [False, True], ids=["unequal scores", "equal scores"])
@pytest.mark.parametrize("profile", PROFILES, ids=lambda p: p.name)
def test_nothing_depends_on_the_order_in_which_a_segmenter_lists(pictures, profile, has_equal_scores) -> None:
    listed = pictures[:25]
    if has_equal_scores:
        listed = [replace(p, detections=replace(p.detections, scores=np.ones(len(p.detections)))) for p in listed]
    shuffle = np.random.default_rng(8).permutation
    for one, other in zip(run(listed, profile), run(listed, profile, order=shuffle), strict=True):
        assert_same_but_for_the_world(one, other)
        for a, b in zip(one.tracks, other.tracks, strict=True):
            np.testing.assert_array_equal(a.mean, b.mean)
            np.testing.assert_array_equal(a.covariance, b.covariance)


@settings(max_examples=40)
@given(masks=hnp.arrays(np.bool_, (4, 2, 2)), order=st.permutations(range(4)))
def test_detections_that_differ_in_their_masks_alone_are_not_chosen_by_their_order(masks, order) -> None:
    detections = replace(detections_of(masks), boxes_px=np.tile([0.0, 0, 1, 1], (4, 1)))
    three = replace(PAPER, max_observations=3)
    one, other = (select_detections(d, three) for d in (detections, detections.select(order)))
    np.testing.assert_array_equal(one.masks, other.masks)


metres = st.floats(-200, 200)


@pytest.mark.parametrize("profile", PROFILES, ids=lambda p: p.name)
@settings(max_examples=5, phases=[Phase.generate])
@given(heading=st.floats(-3, 3), tilt=st.tuples(st.floats(-3, 3), st.floats(-3, 3)), shift=st.tuples(*[metres] * 3))
def test_a_moved_world_moves_the_tracks_and_changes_nothing_else(pictures, profile, heading, tilt, shift) -> None:
    """By any rigid motion where all axes are alike, else by one that keeps z up."""
    has_up = any(model.vertical_share != 1.0 for model in profile.classes)
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec([*((0.0, 0.0) if has_up else tilt), heading]).as_matrix()
    T[:3, 3] = shift
    turn = np.kron(np.eye(2), T[:3, :3])
    for one, other in zip(run(pictures[:25], profile), run(pictures[:25], profile, T_moved_world=T), strict=True):
        assert_same_but_for_the_world(one, other)
        for a, b in zip(one.tracks, other.tracks, strict=True):
            np.testing.assert_allclose(b.mean, turn @ a.mean + [*shift, 0, 0, 0], atol=1e-8)
            np.testing.assert_allclose(b.covariance, turn @ a.covariance @ turn.T, atol=1e-10)


@pytest.mark.parametrize("profile", PROFILES, ids=lambda p: p.name)
def test_odometry_keeps_what_the_map_keeps_and_nothing_is_added(pictures, profile) -> None:
    for p, result in zip(pictures, run(pictures, profile), strict=True):
        for image in (result.masked.mo_mdi_m, result.masked.mdi_m):
            assert ((image == p.frame.depth_m) | (image == 0)).all()
        is_mapped = result.masked.mdi_m > 0
        np.testing.assert_array_equal(result.masked.mo_mdi_m[is_mapped], p.frame.depth_m[is_mapped])


def test_people_and_chairs_that_stand_still_end_up_idle() -> None:
    """The camera moves: a person slides into the image, and is known to be idle only when enough of it is seen."""
    steps = run([picture(k, walking=False) for k in range(60)], CALIBRATED)
    from_the_start = [t for t in steps[24].tracks if t.hits == 25]
    assert len(from_the_start) == 4
    assert len(steps[-1].tracks) == 5
    for track in (*from_the_start, *steps[-1].tracks):
        assert track.verdict is not None
        assert not track.verdict.is_moving
