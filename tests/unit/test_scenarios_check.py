"""`dotmask check` passes on the truth, and each check fails when what it looks at is wrong."""

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from scenarios.check.measure import Check, Measured, joined
from scenarios.check.run import CHECKS, findings_json
from scenarios.check.sample import Sample, View, posed_vertices, sample_indices, take_sample
from scenarios.errors import ScenarioError
from scenarios.registry import SCENARIOS
from scenarios.spec import with_overrides
from scenarios.world import build_simulator
from sim.geometry import pose, rotation_z
from sim.records import Flow, ObjectTruth, RenderedImages
from sim.rooms.room import Obstacle
from sim.truth import SurfaceMoments

CHAIR = "chair_right"
BY_NAME = {check.name: check for check in CHECKS}


@pytest.fixture(scope="module")
def sample() -> Sample:
    """Two people walk, and a chair that was hit rolls."""
    hit = json.dumps([{"time_s": 0.2, "impulse_n_s": [-6.0, 2.0, 0.0], "height_m": 0.45, "offset_m": 0.1}])
    scenario = with_overrides(SCENARIOS["smoke"], {"things.1.impulses": hit, "sensor.model": "ideal"})
    apart = Obstacle(centre_m=(30.0, 0.0, 0.5), size_m=(1.0, 1.0, 1.0))
    taken = take_sample(build_simulator(scenario, "numba", 1), 12, (apart,), np.array([0.3, 0.4]))
    assert len(taken.near) == 3, "two people, and each of them and the obstacle"
    chair = next(actor for actor in taken.now.objects if actor.name == CHAIR)
    assert chair.surface_speed_m_s > 0.2
    assert chair.visible_pixels > 50
    return taken


def with_images(view: View, **changes: object) -> View:
    images: RenderedImages = replace(view.images, **changes)
    return replace(view, images=images)


def with_flow(sample: Sample, **changes: object) -> Sample:
    flow: Flow = replace(sample.now.images.flow, **changes)
    return replace(sample, now=with_images(sample.now, flow=flow))


def with_actor(view: View, name: str, change: Callable[[ObjectTruth], ObjectTruth]) -> View:
    return replace(view, objects=tuple(change(o) if o.name == name else o for o in view.objects))


def masked(sample: Sample, name: str) -> np.ndarray:
    number = next(o.instance_id for o in sample.scene if o.name == name)
    return sample.now.images.instance_ids == number


def moved_camera(view: View, x_m: float = 0.0, yaw_rad: float = 0.0) -> View:
    return replace(view, T_world_camera=pose(rotation_z(yaw_rad), [x_m, 0, 0]) @ view.T_world_camera)


def scaled_depth(sample: Sample, factor: float) -> Sample:
    return replace(
        sample,
        now=with_images(sample.now, depth_m=sample.now.images.depth_m * np.float32(factor)),
        then=with_images(sample.then, depth_m=sample.then.images.depth_m * np.float32(factor)),
    )


def swapped_ids(view: View, one: int, other: int) -> View:
    ids = view.images.instance_ids
    swapped = ids.copy()
    swapped[ids == one], swapped[ids == other] = other, one
    return with_images(view, instance_ids=swapped)


def added(array: np.ndarray, where: object, value: float) -> np.ndarray:
    changed = array.copy()
    changed[where] += np.asarray(value, array.dtype)
    return changed


def berta_changed(sample: Sample, change: Callable[[ObjectTruth], ObjectTruth]) -> Sample:
    return replace(sample, now=with_actor(sample.now, "berta", change))


def keypoints_changed(sample: Sample, **changes: Callable[[np.ndarray], np.ndarray]) -> Sample:
    def change(actor: ObjectTruth) -> ObjectTruth:
        new = {name: function(getattr(actor.keypoints, name)) for name, function in changes.items()}
        return replace(actor, keypoints=replace(actor.keypoints, **new))

    return replace(sample, now=with_actor(sample.now, "berta", change))


def lowered(sample: Sample, metres: float) -> Sample:
    palettes = {name: palette.copy() for name, palette in sample.now.palettes.items()}
    palettes[CHAIR][:, 2, 3] -= metres
    return replace(sample, now=replace(sample.now, palettes=palettes))


def shoved(sample: Sample) -> Sample:
    """A camera that the truth puts 5 cm aside in both frames: only where things stand tells."""
    return replace(sample, now=moved_camera(sample.now, 0.05), then=moved_camera(sample.then, 0.05))


CORRUPTIONS: dict[str, tuple[Callable[[Sample], Sample], set[str]]] = {
    "next pose shifted by 2 mm": (
        lambda s: replace(s, then=moved_camera(s.then, 0.002)), {"optical flow", "next depth", "next surface"}
    ),
    "next pose turned by 0.02 degrees": (
        lambda s: replace(s, then=moved_camera(s.then, yaw_rad=np.radians(0.02))), {"optical flow"}
    ),
    "both poses shifted by 5 cm": (shoved, {"place"}),
    "depth scaled by 1 %": (lambda s: scaled_depth(s, 1.01), {"place", "optical flow"}),
    "next depth scaled by 0.1 %": (
        lambda s: replace(s, then=with_images(s.then, depth_m=s.then.images.depth_m * np.float32(1.001))),
        {"next depth", "next surface"},
    ),
    "next depth nearer by 2 cm": (
        lambda s: replace(s, then=with_images(s.then, depth_m=s.then.images.depth_m - np.float32(0.02))),
        {"hidden"},
    ),
    "ids swapped in one frame": (lambda s: replace(s, then=swapped_ids(s.then, 0, 2)), {"next id"}),
    "ids swapped in both frames": (
        lambda s: replace(s, now=swapped_ids(s.now, 1, 2), then=swapped_ids(s.then, 1, 2)), {"place"}
    ),
    "an id that nothing has": (lambda s: replace(s, now=swapped_ids(s.now, 2, 999)), {"place", "next id"}),
    "optical flow off by 0.2 px at one pixel": (
        lambda s: with_flow(s, optical_px=added(s.now.images.flow.optical_px, (100, 100, 0), 0.2)), {"optical flow"}
    ),
    "optical flow missing": (
        lambda s: with_flow(s, optical_px=added(s.now.images.flow.optical_px, (100, 100), np.nan)), {"optical flow"}
    ),
    "the floor flows": (
        lambda s: with_flow(s, scene_m=added(s.now.images.flow.scene_m, masked(s, "floor"), 1e-5)), {"static flow"}
    ),
    "a chair flows too far": (
        lambda s: with_flow(s, scene_m=added(s.now.images.flow.scene_m, masked(s, CHAIR), 0.003)), {"rigid flow"}
    ),
    "a person flows too far": (
        lambda s: with_flow(s, scene_m=added(s.now.images.flow.scene_m, masked(s, "berta"), 0.004)),
        {"optical flow", "next depth"},
    ),
    "normals turned": (
        lambda s: replace(s, now=with_images(s.now, normals_camera=s.now.images.normals_camera @ rotation_z(0.1).T)),
        {"normals"},
    ),
    "normals from behind": (
        lambda s: replace(s, now=with_images(s.now, normals_camera=-s.now.images.normals_camera)), {"normals"}
    ),
    "velocity 5 % too high": (
        lambda s: berta_changed(s, lambda o: replace(o, velocity_world=1.05 * o.velocity_world)), {"velocity"}
    ),
    "centre shifted": (
        lambda s: berta_changed(s, lambda o: replace(o, centre_world=o.centre_world + 0.001)), {"velocity"}
    ),
    "keypoints' points shifted": (
        lambda s: keypoints_changed(s, world_m=lambda points: points + 0.01), {"keypoint pixels"}
    ),
    "keypoints' pixels shifted": (
        lambda s: keypoints_changed(s, pixels=lambda pixels: pixels + 0.2), {"keypoint pixels"}
    ),
    "hidden keypoints called visible": (
        lambda s: keypoints_changed(s, pixels=lambda p: p * 0 + 5, visibility=lambda v: v * 0 + 2), {"keypoints seen"}
    ),
    "keypoints in the image called outside": (
        lambda s: keypoints_changed(s, visibility=lambda v: v * 0), {"keypoints seen"}
    ),
    "somebody inside a table": (
        lambda s: replace(s, near=(replace(s.near[0], distance_m=0.0), *s.near[1:])), {"collisions"}
    ),
    "a chair in the floor": (lambda s: lowered(s, 0.01), {"floor", "place"}),
}  # fmt: skip


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.name)
def test_the_truth_passes(check: Check, sample: Sample) -> None:
    found = joined("smoke", check, {sample.index: check.measure(sample)})
    assert found.passes, found
    assert found.measured.worst is not None, "nothing was tested"


@pytest.mark.parametrize("name", CORRUPTIONS)
def test_a_wrong_truth_fails(name: str, sample: Sample) -> None:
    corrupt, wanted = CORRUPTIONS[name]
    wrong = corrupt(sample)
    for check in wanted:
        found = joined("smoke", BY_NAME[check], {0: BY_NAME[check].measure(wrong)})
        assert not found.passes, found.measured


def test_every_check_was_seen_to_fail() -> None:
    assert set(BY_NAME) == set().union(*(checks for _, checks in CORRUPTIONS.values()))


def test_posed_vertices_have_the_centre_of_the_truth(sample: Sample) -> None:
    """The second implementation of skinning: the area's mean of a rigid actor is that of its corners' thirds."""
    chair = next(obj for obj in sample.scene if obj.name == CHAIR)
    palette = sample.now.palettes[CHAIR]
    vertices, faces, first = posed_vertices(chair, palette), [], 0
    for surface in chair.surfaces:
        faces.append(surface.faces + first)
        first += len(surface.vertices)
    corners = vertices[np.concatenate(faces)]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    centre = (corners.mean(axis=1) * area[:, None]).sum(axis=0) / area.sum()
    np.testing.assert_allclose(centre, SurfaceMoments.of(chair).centre(palette), atol=1e-6)


def test_samples_are_spread_over_the_sequence() -> None:
    assert sample_indices(101, 3) == [1, 50, 99]
    assert sample_indices(3, 5) == [1]
    assert sample_indices(60, 1) == [1]
    with pytest.raises(ScenarioError, match="at least 3 frames, this one has 2"):
        sample_indices(2, 1)


def test_findings_of_several_frames_are_joined() -> None:
    check = replace(CHECKS[0], bound=1.0, least_share=0.5)

    def found(*measured: tuple[float | None, int, int]) -> object:
        return joined("a", check, {k: Measured(worst=w, tested=t, total=n) for k, (w, t, n) in enumerate(measured)})

    one = found((0.5, 5, 10), (0.9, 5, 10), (None, 0, 0))
    assert (one.measured.worst, one.index, one.share, one.passes) == (0.9, 1, 0.5, True)
    assert not found((0.5, 4, 10)).passes, "too little was tested"
    assert not found((1.1, 10, 10)).passes
    assert not found((float("nan"), 10, 10), (0.1, 10, 10)).passes
    nothing = found((None, 0, 0))
    assert (nothing.passes, nothing.share, nothing.index) == (True, None, None)
    assert not found((None, 0, 10)).passes, "there was something, and none of it was tested"
    told = json.loads(findings_json([one]))
    assert (told[0]["check"], told[0]["worst"], told[0]["passes"]) == ("optical flow", 0.9, True)
