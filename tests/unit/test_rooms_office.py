"""The office: closed, in its size, furnished, and full of static features."""

import hashlib
import subprocess
import sys

import cv2
import numpy as np
import pytest

import sim.rooms.office
from sim.geometry import look_at
from sim.records import CameraModel, Moment
from sim.renderers.visibility_buffer import VisibilityBufferRenderer
from sim.rooms.office import (
    CAMERA_PLACE,
    CHAIR_PLACES,
    LIGHTS,
    ROOM_MAX_M,
    ROOM_MIN_M,
    build_office,
)
from sim.rooms.room import FIRST_FURNITURE_ID
from sim.scene import Scene

CAMERA = CameraModel(width=640, height=480, fx=535.4, fy=539.2, cx=320.1, cy=247.6)
DIGEST = """
import hashlib
from sim.rooms.office import build_office
h = hashlib.sha256()
for o in build_office(0).objects:
    for s in o.surfaces:
        for a in (s.vertices, s.normals, s.uv, s.faces, s.texture):
            h.update(a.tobytes())
    h.update(o.motion.T_world_object.tobytes())
print(h.hexdigest())
"""


@pytest.fixture(scope="module")
def office():
    return build_office(0).objects


@pytest.fixture(scope="module")
def renderer(office):
    return VisibilityBufferRenderer(Scene(objects=office, lights=LIGHTS), CAMERA)


def world_points(thing):
    T = thing.motion.T_world_object
    return np.concatenate([s.vertices for s in thing.surfaces]) @ T[:3, :3].T + T[:3, 3]


def test_ids_and_classes(office):
    shell = [o for o in office if o.instance_id == 0]
    assert {o.class_name for o in shell} == {"floor", "ceiling", "wall"}
    ids = [o.instance_id for o in office if o.instance_id]
    assert ids == list(range(FIRST_FURNITURE_ID, FIRST_FURNITURE_ID + len(ids)))
    assert not any(o.is_actor for o in office)
    classes = {o.class_name for o in office}
    assert {"dining table", "tv", "keyboard", "mouse", "potted plant", "book", "cup", "bottle", "clock"} <= classes
    assert len({o.name for o in office}) == len(office)


def test_everything_is_inside_the_room(office):
    for thing in office:
        p = world_points(thing)
        assert (p >= np.array(ROOM_MIN_M) - 1e-4).all(), thing.name
        assert (p <= np.array(ROOM_MAX_M) + 1e-4).all(), thing.name


def test_budgets(office):
    assert sum(len(s.faces) for o in office for s in o.surfaces) < 60_000
    textures = {id(s.texture): s.texture.nbytes for o in office for s in o.surfaces}
    assert sum(textures.values()) < 60 * 2**20


def test_walking_area_is_free(office):
    """Between the knees and two metres nothing but the low shelf stands where people walk."""
    for thing in office:
        if thing.instance_id == 0:
            continue
        p = world_points(thing)
        p = p[(p[:, 2] > 0.02) & (p[:, 2] < 1.9)]
        if not len(p) or thing.name.startswith("low "):
            continue
        low, high = p.min(axis=0), p.max(axis=0)
        inside = low[0] < 1.6 and high[0] > -1.6 and low[1] < 0.9 and high[1] > -2.9
        assert not inside, thing.name


def test_low_shelf_leaves_both_lanes(office):
    p = np.concatenate([world_points(o) for o in office if o.name.startswith("low ")])
    assert p[:, 1].min() > -1.06
    assert p[:, 1].max() < -0.74
    assert np.abs(p[:, 0]).max() < 0.61


def test_chair_places_are_clear_of_obstacles():
    """But for the tops of the desks, under which a chair rolls."""
    for x, y in CHAIR_PLACES:
        for box in build_office(0).obstacles:
            if box.centre_m[2] - box.size_m[2] / 2 > 0.5:
                continue
            dx, dy = abs(box.centre_m[0] - x) - box.size_m[0] / 2, abs(box.centre_m[1] - y) - box.size_m[1] / 2
            assert np.hypot(max(dx, 0), max(dy, 0)) > 0.31


@pytest.mark.parametrize(
    "target", [(0, 1.2, 0.9), (3.5, 0, 1.2), (-3.5, 0, 1.2), (0.1, -3.3, 1.0), (0, 0, 0), (1, 1, 2.8)]
)
@pytest.mark.parametrize("eye", [CAMERA_PLACE, (-3.3, 2.0, 2.6), (3.2, -3.1, 0.3)])
def test_no_ray_leaves_the_room(renderer, eye, target):
    images = renderer.render(Moment(T_world_camera=look_at(eye, target), palettes={}))
    assert (images.depth_m > 0).all()
    assert images.depth_m.max() < 10


def test_nominal_view_is_rich_and_deep(renderer):
    """More than 800 corners, spread over the image, at depths from about 1.2 to 5 m."""
    images = renderer.render(Moment(T_world_camera=look_at(CAMERA_PLACE, (0, 1.2, 0.92)), palettes={}))
    grey = cv2.cvtColor(images.rgb, cv2.COLOR_RGB2GRAY)
    corners = cv2.goodFeaturesToTrack(grey, 5000, 0.01, 5)[:, 0].astype(int)
    assert len(corners) > 800
    depths = images.depth_m[corners[:, 1], corners[:, 0]]
    counts, _ = np.histogram(depths, bins=[1.0, 1.6, 3.0, 4.0, 4.6, 5.2])
    assert (counts > 30).all(), counts
    cells = np.zeros((4, 4), int)
    np.add.at(cells, (corners[:, 1] // 120, corners[:, 0] // 160), 1)
    assert (cells > 12).all(), cells
    assert 80 < grey.mean() < 160
    assert (grey > 250).mean() < 0.02


def digest_of(objects):
    digest = hashlib.sha256()
    for thing in objects:
        for s in thing.surfaces:
            for a in (s.vertices, s.normals, s.uv, s.faces, s.texture):
                digest.update(a.tobytes())
        digest.update(thing.motion.T_world_object.tobytes())
    return digest.hexdigest()


def test_same_bytes_in_another_process(office):
    command = [sys.executable, "-c", DIGEST]
    there = subprocess.run(command, check=True, capture_output=True, text=True, env={"PYTHONHASHSEED": "7"}).stdout
    assert there.strip() == digest_of(office)


def test_another_seed_looks_different(monkeypatch):
    """The desk's clutter alone, to be quick."""
    for part in ("shell", "desks", "low_shelf", "back_wall", "sides", "front_wall", "lamps"):
        monkeypatch.setattr(sim.rooms.office, f"_build_{part}", lambda builder: None)
    first, again, other = (build_office.__wrapped__(seed).objects for seed in (0, 0, 1))
    assert [o.name for o in first] == [o.name for o in other]
    assert digest_of(first) == digest_of(again) != digest_of(other)
