"""Truth about COCO keypoints: places by a second implementation, pixels by projection, visibility by construction."""

import numpy as np
import pytest

from sim.geometry import look_at, pose, rotation_z
from sim.people.body import Body, Soles
from sim.people.characters import load_character, skin
from sim.people.keypoints import COVER_M, KEYPOINT_NAMES, SKELETON_LINKS, keypoint_positions, keypoints_truth
from sim.people.script import Script
from sim.records import CameraModel, Moment, RenderedImages
from sim.renderers.visibility_buffer import VisibilityBufferRenderer
from sim.scene import KeypointRig, Light, Placed, Scene, SceneObject
from sim.things.meshes import box
from sim.things.textures import plain

CAMERA = CameraModel(width=320, height=240, fx=260.0, fy=262.0, cx=159.0, cy=121.0)


@pytest.fixture(scope="module")
def person():
    character = load_character("man")
    script = Script(Body(character.skeleton, Soles.of(character)))
    script.stand(10.0)
    return SceneObject(
        name="anton",
        class_name="person",
        instance_id=1,
        surfaces=character.surfaces,
        motion=script.motion(),
        is_actor=True,
        keypoints=character.keypoints,
    )


def screen(x_m):
    surface = box((x_m, 0.0, 0.55), (0.02, 3.0, 1.1)).surface(plain(np.random.default_rng(0), (90, 90, 90), 16, 0.0))
    return SceneObject(
        name="screen", class_name="wall", instance_id=0, surfaces=(surface,), motion=Placed(np.eye(4)), is_actor=False
    )


def seen(person, eye, target=(0.0, 0.0, 1.0), others=()):
    scene = Scene(objects=(person, *others), lights=(Light(position_world=(0.0, 0.0, 2.8), power=3.0),))
    T = look_at(eye, target)
    palette = person.motion.palette_at(1.0)
    images = VisibilityBufferRenderer(scene, CAMERA).render(Moment(T_world_camera=T, palettes={"anton": palette}))
    return keypoints_truth(person.keypoints, palette, 1, images, CAMERA, T)


def visible(truth):
    return {name for name, v in zip(KEYPOINT_NAMES, truth.visibility, strict=True) if v == 2}


def test_the_names_and_links_are_cocos():
    assert len(KEYPOINT_NAMES) == 17
    assert len(SKELETON_LINKS) == 19
    named = {frozenset((KEYPOINT_NAMES[a], KEYPOINT_NAMES[b])) for a, b in SKELETON_LINKS}
    assert {frozenset(("left_knee", "left_hip")), frozenset(("right_ankle", "right_knee"))} <= named
    assert frozenset(("left_shoulder", "left_elbow")) in named


def test_positions_are_skinned_like_vertices(person):
    palette = person.motion.palette_at(2.0)
    rig = person.keypoints
    expected = skin(rig.points, rig.bones, rig.weights.astype(np.float32), palette)
    np.testing.assert_allclose(keypoint_positions(rig, palette), expected, atol=1e-6)


def test_pixels_are_the_projection(person):
    truth = seen(person, (3.0, 0.5, 1.3))
    T = look_at((3.0, 0.5, 1.3), (0.0, 0.0, 1.0))
    for world, pixel in zip(truth.world_m, truth.pixels, strict=True):
        x, y, z = T[:3, :3].T @ (world - T[:3, 3])
        np.testing.assert_allclose(pixel, [260.0 * x / z + 159.0, 262.0 * y / z + 121.0])


def test_from_ahead_all_but_the_ears_or_all_are_seen(person):
    assert set(KEYPOINT_NAMES) - visible(seen(person, (3.0, 0.0, 1.2))) <= {"left_ear", "right_ear"}


def test_from_behind_the_face_is_hidden_and_the_joints_are_seen(person):
    truth = seen(person, (-3.0, 0.0, 1.2))
    assert not visible(truth) & {"nose", "left_eye", "right_eye"}
    assert {"left_knee", "right_knee", "left_ankle", "right_shoulder", "left_hip"} <= visible(truth)
    assert (truth.visibility > 0).all()


def test_from_the_side_the_far_arm_is_hidden(person):
    found = visible(seen(person, (0.0, 3.0, 1.2)))  # the person faces +x, its left is +y
    assert {"left_shoulder", "left_elbow", "left_wrist", "left_ear"} <= found
    assert not found & {"right_shoulder", "right_ear", "right_eye", "right_elbow"}


def test_a_screen_hides_what_is_behind_it(person):
    truth = seen(person, (3.0, 0.0, 1.2), others=(screen(1.0),))
    hidden = {name for name, v in zip(KEYPOINT_NAMES, truth.visibility, strict=True) if v == 1}
    assert {"left_knee", "right_knee", "left_ankle", "right_ankle"} <= hidden
    assert {"nose", "left_shoulder", "right_shoulder"} <= visible(truth)


def test_outside_the_image_and_behind_the_camera(person):
    truth = seen(person, (1.2, 0.0, 1.6), target=(0.0, 0.0, 1.6))
    outside = dict(zip(KEYPOINT_NAMES, truth.visibility, strict=True))
    assert outside["left_ankle"] == 0
    assert np.isfinite(truth.pixels).all()
    behind = seen(person, (3.0, 0.0, 1.2), target=(6.0, 0.0, 1.2))
    assert np.isnan(behind.pixels).all()
    assert not behind.visibility.any()


@pytest.mark.parametrize(("before", "expected"), [(0.0, 2), (0.9, 2), (1.1, 1)])
def test_the_rule_for_joints_inside_the_body(before, expected):
    """A wall of the person's own pixels at `before` times the cover in front of each keypoint."""
    rig = KeypointRig(
        points=np.tile([0.0, 0.0, 2.0], (17, 1)), bones=np.zeros((17, 4), np.int32), weights=np.full((17, 4), 0.25)
    )
    shape = (CAMERA.height, CAMERA.width)
    for number in range(17):
        images = RenderedImages(
            rgb=np.zeros((*shape, 3), np.uint8),
            depth_m=np.full(shape, 2.0 - before * COVER_M[number], np.float32),
            instance_ids=np.full(shape, 5, np.uint16),
        )
        palette = pose(rotation_z(0.0), (0.0, 0.0, 0.0))[None]
        truth = keypoints_truth(rig, palette, 5, images, CAMERA, np.eye(4))
        assert truth.visibility[number] == expected
        other = keypoints_truth(rig, palette, 4, images, CAMERA, np.eye(4))
        assert other.visibility[number] == 1
