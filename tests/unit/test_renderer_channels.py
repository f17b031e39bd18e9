"""Normals, flow and rows of colour against a second, slow computation in float64; all channels always the same."""

import hashlib
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim.geometry import FloatArray, look_at, pose, rotation_z
from sim.records import CameraModel, Moment, RenderedImages
from sim.renderers.visibility_buffer import VisibilityBufferRenderer
from sim.scene import Light, Placed, Scene, SceneObject, Surface

CAMERA = CameraModel(width=160, height=120, fx=130.0, fy=140.0, cx=78.3, cy=61.2)
CUBE = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], np.float32)
SIDES = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
CUBE_FACES = np.array([t for a, b, c, d in SIDES for t in ((a, b, c), (a, c, d))], np.int32)


def cube(
    name: str, number: int, T_world_object: FloatArray, *, inside_out: bool = False, bones: int = 1
) -> SceneObject:
    """A unit cube on 0..1; with two bones the second one moves what is high."""
    rng = np.random.default_rng(number)
    part = Surface(
        vertices=CUBE,
        normals=np.tile(np.array([0, 0, 1], np.float32), (8, 1)),
        uv=rng.uniform(0, 2, (8, 2)).astype(np.float32),
        faces=CUBE_FACES[:, ::-1].copy() if inside_out else CUBE_FACES,
        texture=rng.integers(0, 255, (32, 32, 3), dtype=np.uint8),
    )
    if bones == 2:
        weights = np.zeros((8, 4), np.float32)
        weights[:, 0], weights[:, 1] = 1 - CUBE[:, 2], CUBE[:, 2]
        part = replace(part, bones=np.tile(np.array([0, 1, 0, 0], np.int32), (8, 1)), weights=weights)
        return SceneObject(
            name=name,
            class_name="thing",
            instance_id=number,
            surfaces=(part,),
            motion=_TwoBones(T_world_object),
            is_actor=True,
        )
    return SceneObject(
        name=name,
        class_name="thing",
        instance_id=number,
        surfaces=(part,),
        motion=Placed(T_world_object),
        is_actor=not inside_out,
    )


class _TwoBones(Placed):
    def palette_at(self, time_s: float) -> FloatArray:
        return np.stack([self.T_world_object, self.T_world_object])


def scene() -> Scene:
    """A room, a rigid cube and one that bends."""
    room = cube("room", 0, pose(np.diag([6.0, 5.0, 3.0]), (-3, -2.5, 0)), inside_out=True)
    rigid = cube("rigid", 4, pose(np.eye(3), (0, 0, 0)))
    bent = cube("bent", 7, pose(np.eye(3), (0, 0, 0)), bones=2)
    return Scene(objects=(room, rigid, bent), lights=(Light(position_world=(0.2, 0.3, 2.8), power=2.0),))


def moment(step: float) -> Moment:
    """The cubes and the camera move with `step`."""
    base = pose(rotation_z(0.5 + 0.3 * step), (-1.4 + 0.2 * step, 0.1, 0.1 * step))
    low = pose(rotation_z(-0.2 * step), (0.3, 0.4 - 0.1 * step, 0.0))
    high = pose(rotation_z(0.4 * step), (0.5 + 0.2 * step, 0.4, 0.1))
    return Moment(
        T_world_camera=look_at((0.1 + 0.1 * step, -2.2, 1.5), (0.1 * step, 1.0, 0.7)),
        palettes={"rigid": base[None], "bent": np.stack([low, high])},
    )


def world_points(images: RenderedImages, T_world_camera: FloatArray) -> FloatArray:
    u, v = np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height))
    rays = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones(u.shape)], -1)
    return np.asarray(T_world_camera[:3, 3] + (rays * images.depth_m[..., None]) @ T_world_camera[:3, :3].T)


def pixels(points_world: FloatArray, T_world_camera: FloatArray) -> FloatArray:
    p = (points_world - T_world_camera[:3, 3]) @ T_world_camera[:3, :3]
    return np.stack([CAMERA.fx * p[..., 0] / p[..., 2] + CAMERA.cx, CAMERA.fy * p[..., 1] / p[..., 2] + CAMERA.cy], -1)


def posed(palette: FloatArray) -> FloatArray:
    """Vertices of a cube with two bones."""
    homogeneous = np.c_[CUBE.astype(float), np.ones(8)]
    low, high = (homogeneous @ T[:3].T for T in palette)
    weight = CUBE[:, 2:].astype(float)
    return np.asarray((1 - weight) * low + weight * high)


def carried(points: FloatArray, now: FloatArray, then: FloatArray) -> FloatArray:
    """Points (k, 3) on a cube with vertices `now`, where the same points of its faces are with vertices `then`."""
    best, moved = np.full(len(points), np.inf), np.zeros_like(points)
    for i, j, k in CUBE_FACES:
        edges = np.stack([now[j] - now[i], now[k] - now[i]], 1)
        weights = np.linalg.lstsq(edges, (points - now[i]).T, rcond=None)[0]
        beside = np.maximum(0, -np.minimum(weights.min(0), 1 - weights.sum(0)))
        off = np.linalg.norm(edges @ weights - (points - now[i]).T, axis=0) + beside
        target = then[i] + (np.stack([then[j] - then[i], then[k] - then[i]], 1) @ weights).T
        moved[off < best], best = target[off < best], np.minimum(best, off)
    assert best.max() < 1e-4
    return moved


def test_flow_carries_every_point_with_its_surface() -> None:
    now, then = moment(0.0), moment(1.0)
    images = VisibilityBufferRenderer(scene(), CAMERA).render(now, flow_to=then)
    assert images.flow is not None
    points = world_points(images, now.T_world_camera)
    T = then.palettes["rigid"][0] @ np.linalg.inv(now.palettes["rigid"][0])
    targets = {
        0: lambda p: p,
        4: lambda p: p @ T[:3, :3].T + T[:3, 3],
        7: lambda p: carried(p, posed(now.palettes["bent"]), posed(then.palettes["bent"])),
    }
    u, v = np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height))
    for number, target in targets.items():
        seen = images.instance_ids == number
        assert seen.sum() > 1000
        there = target(points[seen])
        np.testing.assert_allclose(images.flow.scene_m[seen], there - points[seen], atol=5e-6)
        expected = pixels(there, then.T_world_camera) - np.stack([u, v], -1)[seen]
        np.testing.assert_allclose(images.flow.optical_px[seen], expected, atol=2e-3)
    assert np.abs(images.flow.scene_m[images.instance_ids == 7]).max() > 0.1
    assert not images.flow.scene_m[images.instance_ids == 0].any()


def test_flow_to_the_same_moment_is_nothing() -> None:
    images = VisibilityBufferRenderer(scene(), CAMERA).render(moment(0.3), flow_to=moment(0.3))
    assert images.flow is not None
    assert not images.flow.scene_m.any()
    assert np.abs(images.flow.optical_px).max() < 1e-5


def test_flow_of_what_falls_behind_the_camera_is_unknown() -> None:
    now = moment(0.0)
    ahead = Moment(T_world_camera=pose(now.T_world_camera[:3, :3], (0.1, 0.6, 1.3)), palettes=now.palettes)
    images = VisibilityBufferRenderer(scene(), CAMERA).render(now, flow_to=ahead)
    assert images.flow is not None
    z = (world_points(images, now.T_world_camera) - ahead.T_world_camera[:3, 3]) @ ahead.T_world_camera[:3, 2]
    unknown = np.isnan(images.flow.optical_px).all(-1)
    np.testing.assert_array_equal(unknown[np.abs(z) > 1e-5], (z < 0)[np.abs(z) > 1e-5])
    assert 0 < unknown.sum() < unknown.size
    assert np.isfinite(images.flow.scene_m).all()


def test_normals_are_those_of_the_depth() -> None:
    images = VisibilityBufferRenderer(scene(), CAMERA).render(moment(0.0), normals=True)
    normals = images.normals_camera
    assert normals is not None
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1.0, atol=1e-6)
    points = world_points(images, np.eye(4))
    assert ((normals * points).sum(-1) < 0).all()  # towards the camera
    across, down = (np.diff(points[:-1], axis=1), np.diff(points[:, :-1], axis=0))
    truth = np.cross(down, across)
    truth /= np.linalg.norm(truth, axis=-1, keepdims=True)
    flat = (normals[:-1, :-1] == normals[1:, :-1]).all(-1) & (normals[:-1, :-1] == normals[:-1, 1:]).all(-1)
    assert flat.mean() > 0.8
    error = np.linalg.norm(normals[:-1, :-1] - truth, axis=-1)[flat]
    assert np.median(error) < 1e-4
    assert error.max() < 5e-3


def test_nothing_has_no_normal_and_does_not_flow() -> None:
    alone = replace(scene(), objects=scene().objects[1:])
    images = VisibilityBufferRenderer(alone, CAMERA).render(moment(0.0), normals=True, flow_to=moment(1.0))
    nothing = images.instance_ids == 0
    assert nothing.any()
    assert images.flow is not None
    assert images.normals_camera is not None
    for channel in (images.normals_camera, images.flow.optical_px, images.flow.scene_m):
        assert not channel[nothing].any()


def test_channels_come_on_request_alone() -> None:
    images = VisibilityBufferRenderer(scene(), CAMERA).render(moment(0.0))
    assert images.normals_camera is None
    assert images.flow is None


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("rows", [(0, 120), (0, 1), (37, 38), (40, 93), (119, 120)])
def test_rows_of_colour_are_those_of_the_image(rows: tuple[int, int], threads: int) -> None:
    renderer = VisibilityBufferRenderer(scene(), CAMERA, threads=threads)
    whole = renderer.render(moment(0.0))
    pixels_before = [renderer.unoccluded_pixels(name) for name in ("rigid", "bent")]
    part = renderer.render_colour(moment(0.0), rows)
    np.testing.assert_array_equal(part, whole.rgb[slice(*rows)])
    renderer.render_colour(moment(1.0), rows)
    assert [renderer.unoccluded_pixels(name) for name in ("rigid", "bent")] == pixels_before
    np.testing.assert_array_equal(renderer.render(moment(0.0)).rgb, whole.rgb)


def test_rows_outside_the_image_are_refused() -> None:
    renderer = VisibilityBufferRenderer(scene(), CAMERA)
    for rows in ((5, 5), (-1, 4), (0, 121)):
        with pytest.raises(ValueError, match="rows"):
            renderer.render_colour(moment(0.0), rows)


def digest(images: RenderedImages) -> str:
    assert images.normals_camera is not None
    assert images.flow is not None
    channels = (images.rgb, images.depth_m, images.instance_ids, images.normals_camera)
    joined = b"".join(a.tobytes() for a in (*channels, images.flow.optical_px, images.flow.scene_m))
    return hashlib.sha256(joined).hexdigest()


def digest_of_all_channels(threads: int = 1) -> str:
    renderer = VisibilityBufferRenderer(scene(), replace(CAMERA, exposure_ev=0.3), threads=threads)
    return digest(renderer.render(moment(0.2), normals=True, flow_to=moment(0.5)))


def test_the_bytes_do_not_depend_on_the_number_of_threads() -> None:
    assert len({digest_of_all_channels(threads) for threads in (1, 2, 3)}) == 1


def test_a_frame_depends_on_its_own_poses_alone() -> None:
    renderer = VisibilityBufferRenderer(scene(), CAMERA)
    first = renderer.render(moment(0.0), normals=True, flow_to=moment(1.0))
    before = digest(first)
    other = renderer.render(moment(0.7), normals=True, flow_to=moment(0.1))
    assert digest(first) == before  # the caller's arrays are not written again
    assert digest(other) != before
    assert digest(renderer.render(moment(0.0), normals=True, flow_to=moment(1.0))) == before


def digest_in_another_process(**environment: str) -> str:
    program = f"""
import importlib.util
spec = importlib.util.spec_from_file_location("renderer_tests", {str(Path(__file__))!r})
tests = importlib.util.module_from_spec(spec)
spec.loader.exec_module(tests)
print(tests.digest_of_all_channels())
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, env={**os.environ, **environment}
    )
    return done.stdout.strip()


def test_the_bytes_are_the_same_in_another_process() -> None:
    assert digest_in_another_process() == digest_of_all_channels()


@pytest.mark.slow  # compiles every kernel anew
def test_the_bytes_do_not_depend_on_the_processor(tmp_path: Path) -> None:
    generic = digest_in_another_process(NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="", NUMBA_CACHE_DIR=str(tmp_path))
    assert generic == digest_of_all_channels()
