"""What holds for every room: closed, furnished inside its walls, quick to render, honest about its obstacles."""

import hashlib

import numpy as np
import pytest

from scenarios.world import ROOMS
from sim.geometry import look_at
from sim.records import CameraModel, Moment
from sim.renderers.visibility_buffer import VisibilityBufferRenderer
from sim.rooms.room import FIRST_FURNITURE_ID
from sim.scene import Scene

CAMERA = CameraModel(width=160, height=120, fx=80.0, fy=80.0, cx=79.5, cy=59.5)
ON_SOMETHING = 0.02
"""A thing whose lowest point is above this stands on another one, or hangs."""


def points_of(thing):
    """(n, 3) vertices in the world."""
    T = thing.motion.T_world_object
    return np.concatenate([s.vertices for s in thing.surfaces]).astype(float) @ T[:3, :3].T + T[:3, 3]


def corners_of(room):
    shell = np.concatenate([points_of(o) for o in room.objects if o.instance_id == 0])
    return shell.min(axis=0), shell.max(axis=0)


def is_in(points, box, margin_m):
    """(n,) whether points lie in an obstacle that is made larger by a margin."""
    c, s = np.cos(box.yaw_rad), np.sin(box.yaw_rad)
    offset = points - np.array(box.centre_m)
    local = np.stack([c * offset[:, 0] + s * offset[:, 1], c * offset[:, 1] - s * offset[:, 0], offset[:, 2]], axis=1)
    return (np.abs(local) <= np.array(box.size_m) / 2 + margin_m).all(axis=1)


@pytest.fixture(scope="module", params=sorted(ROOMS))
def room(request):
    return ROOMS[request.param](0)


def test_names_and_ids(room):
    assert len({o.name for o in room.objects}) == len(room.objects)
    ids = [o.instance_id for o in room.objects if o.instance_id]
    assert ids == list(range(FIRST_FURNITURE_ID, FIRST_FURNITURE_ID + len(ids)))
    assert {o.class_name for o in room.objects if not o.instance_id} == {"floor", "ceiling", "wall"}


def test_everything_and_every_light_is_inside(room):
    low, high = corners_of(room)
    for thing in room.objects:
        points = points_of(thing)
        assert (points >= low - 1e-4).all(), thing.name
        assert (points <= high + 1e-4).all(), thing.name
    for light in room.lights:
        assert (np.array(light.position_world) > low).all()
        assert (np.array(light.position_world) < high).all()


def test_budgets(room):
    assert sum(len(s.faces) for o in room.objects for s in o.surfaces) < 60_000
    textures = {id(s.texture): s.texture.nbytes for o in room.objects for s in o.surfaces}
    assert sum(textures.values()) < 64 * 2**20


def test_no_two_surfaces_share_a_picture(room):
    """A texture that is seen twice would close loops that are none."""
    digests = [
        hashlib.sha256(s.texture.tobytes()).hexdigest()
        for o in room.objects
        for s in o.surfaces
        if s.texture.shape[0] >= 128
    ]
    assert len(set(digests)) == len(digests)


def test_what_stands_on_the_floor_is_covered_by_obstacles(room):
    """All of a thing but the beams of a desk lies in the boxes; small things on tops are in nobody's way."""
    for thing in room.objects:
        points = points_of(thing)
        if thing.instance_id == 0 or points[:, 2].min() > ON_SOMETHING or thing.class_name == "door":
            continue
        covered = np.zeros(len(points), bool)
        for box in room.obstacles:
            covered |= is_in(points, box, 0.003)
        if thing.class_name == "dining table":
            faces_up = thing.surfaces[0]
            assert covered[: len(faces_up.vertices)].all(), f"the top of {thing.name}"
            assert covered.mean() > 0.6, thing.name
        else:
            assert covered.all(), f"{thing.name}: {(~covered).sum()} points of {len(points)}"


def test_obstacles_are_where_something_is(room):
    """Every box but the walls holds vertices close to all of its six sides."""
    low, high = corners_of(room)
    everything = np.concatenate([points_of(o) for o in room.objects if o.instance_id])
    for box in room.obstacles:
        outside = (np.array(box.centre_m) < low) | (np.array(box.centre_m) > high)
        if outside.any():
            continue
        inside = everything[is_in(everything, box, 0.003)]
        c, s = np.cos(box.yaw_rad), np.sin(box.yaw_rad)
        local = (inside - np.array(box.centre_m)) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        assert np.ptp(local, axis=0) == pytest.approx(box.size_m, abs=0.01), box


def test_walls_block_just_behind_themselves(room):
    low, high = corners_of(room)
    middle = (low + high) / 2
    for axis in (0, 1):
        for edge, sign in ((low, -1), (high, 1)):
            point = middle.copy()
            point[axis] = edge[axis] + sign * 0.05
            assert any(is_in(point[None], box, 0.0).all() for box in room.obstacles)


def test_no_ray_leaves_and_the_light_is_right(room):
    low, high = corners_of(room)
    renderer = VisibilityBufferRenderer(Scene(objects=room.objects, lights=room.lights), CAMERA, 1)
    eye = (low + high) / 2
    eye[:2] += 0.01
    brightness = []
    for way in ((1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0), (0.3, 0.1, -1), (0.1, 0.3, 1)):
        images = renderer.render(Moment(T_world_camera=look_at(eye, eye + np.array(way)), palettes={}))
        assert (images.depth_m > 0).all()
        brightness.append(images.rgb.mean())
    assert 70 < np.mean(brightness[:4]) < 170, brightness


def test_another_seed_looks_different():
    assert any(
        not np.array_equal(a.texture, b.texture)
        for one, other in zip(ROOMS["bare"](0).objects, ROOMS["bare"](1).objects, strict=True)
        for a, b in zip(one.surfaces, other.surfaces, strict=True)
    )
