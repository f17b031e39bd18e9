"""The second renderer against analytic images, and against the default one on what has no formula.

Skipped where no OpenGL library is found; `.ci/run` installs one.
"""

import ctypes.util
import gc
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from sim.errors import SimError
from sim.geometry import FloatArray, look_at, pose, rotation_z
from sim.records import CameraModel, Moment, RenderedImages
from sim.renderers.pyrender_renderer.gl_context import RendererMissingError, choose_platform
from sim.renderers.visibility_buffer import VisibilityBufferRenderer
from sim.scene import Light, Placed, Scene, SceneObject, Surface

try:
    choose_platform()
except RendererMissingError as error:
    pytest.skip(f"no OpenGL here: {error}", allow_module_level=True)

from sim.renderers.pyrender_renderer.renderer import FAR_M, NEAR_M, PyrenderRenderer

CAMERA = CameraModel(width=162, height=121, fx=130.0, fy=140.0, cx=78.3, cy=61.2)
GREY = np.full((4, 4, 3), 200, np.uint8)


def surface(vertices: npt.ArrayLike, faces: npt.ArrayLike, normals: npt.ArrayLike, **rest: object) -> Surface:
    points = np.asarray(vertices, np.float32)
    values = {"uv": np.zeros((len(points), 2), np.float32), "texture": GREY, **rest}
    return Surface(
        vertices=points, normals=np.asarray(normals, np.float32), faces=np.asarray(faces, np.int32), **values
    )  # type: ignore[arg-type]  # keywords passed through


def quad(*corners: npt.ArrayLike, **rest: object) -> Surface:
    """Seen from the front, the corners run counter-clockwise."""
    points = np.array(corners, float)
    normal = np.cross(points[1] - points[0], points[2] - points[0])
    return surface(points, [[0, 1, 2], [0, 2, 3]], np.tile(normal / np.linalg.norm(normal), (4, 1)), **rest)


def pixel_quad(u0: float, v0: float, u1: float, v1: float, z: float, **rest: object) -> Surface:
    """A fronto-parallel rectangle between these pixel coordinates at depth z; uv (0, 0) at its upper left corner."""
    x0, x1 = ((u - CAMERA.cx) / CAMERA.fx * z for u in (u0, u1))
    y0, y1 = ((v - CAMERA.cy) / CAMERA.fy * z for v in (v0, v1))
    uv = np.array([[0, 0], [0, 1], [1, 1], [1, 0]], np.float32)
    return quad((x0, y0, z), (x0, y1, z), (x1, y1, z), (x1, y0, z), uv=uv, **rest)


def ball(centre: npt.ArrayLike, radius: float, n: int = 400) -> Surface:
    phi, theta = np.meshgrid(np.linspace(0, np.pi, n // 2 + 1), np.linspace(0, 2 * np.pi, n + 1), indexing="ij")
    normals = np.stack([np.sin(phi) * np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi)], -1).reshape(-1, 3)
    number = np.arange(len(normals)).reshape(phi.shape)
    a, b, c, d = (x.ravel() for x in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return surface(np.asarray(centre) + radius * normals, faces, normals)


def thing(*surfaces: Surface, name: str = "thing", number: int = 1, actor: bool = False) -> SceneObject:
    return SceneObject(
        name=name,
        class_name="thing",
        instance_id=number,
        surfaces=surfaces,
        motion=Placed(np.eye(4)),
        is_actor=actor,
    )


def at(T_world_camera: FloatArray, **palettes: FloatArray) -> Moment:
    return Moment(T_world_camera=T_world_camera, palettes=palettes)


def draw(*objects: SceneObject) -> RenderedImages:
    """From the origin, in ambient light alone, the actors where they rest."""
    scene = Scene(objects=objects, lights=(), ambient=0.5)
    moment = at(np.eye(4), **{o.name: np.eye(4)[None] for o in scene.actors})
    return PyrenderRenderer(scene, CAMERA).render(moment, normals=True)


def rays() -> FloatArray:
    u, v = np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height))
    return np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones(u.shape)], axis=-1)


@pytest.mark.parametrize("distance_m", [0.5, 2.5, 6.0])
@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (0.5, 0.1, 0.8), (-0.2, 0.6, 0.7)])
def test_depth_of_a_plane_is_exact(distance_m: float, normal: tuple[float, float, float]) -> None:
    n = np.array(normal) / np.linalg.norm(normal)
    w, h = CAMERA.width, CAMERA.height
    edge = np.array([[-9, -9], [-9, h + 9], [w + 9, h + 9], [w + 9, -9]], float)
    edge_rays = np.c_[(edge - [CAMERA.cx, CAMERA.cy]) / [CAMERA.fx, CAMERA.fy], np.ones(4)]
    offset = distance_m * n[2]
    images = draw(thing(quad(*(edge_rays * (offset / (edge_rays @ n))[:, None]))))
    error_m = np.abs(images.depth_m - offset / (rays() @ n))[images.depth_m < 8.0]
    assert images.depth_m.dtype == np.float32
    assert (images.depth_m > 0).all()
    np.testing.assert_allclose(images.normals_camera, np.broadcast_to(-n, (h, w, 3)), atol=2e-3)
    assert error_m.max() < 1e-5  # 0.01 mm; a pixel centre off by 0.01 px shows as more


def test_depth_of_a_sphere_is_exact() -> None:
    centre, radius, n = np.array([0.1, -0.05, 1.6]), 0.4, 400
    images = draw(thing(ball(centre, radius, n)))
    r = rays()
    half, squared = (r * centre).sum(-1), (r * r).sum(-1)
    inside = half**2 - squared * (centre @ centre - radius**2)
    truth = (half - np.sqrt(np.maximum(inside, 0))) / squared
    facing = -((r * truth[..., None] - centre) * r).sum(-1) / radius / np.sqrt(squared)
    seen = (inside > 0) & (facing > 0.3)  # near the outline a mesh is no sphere
    error_m = np.abs(images.depth_m - truth)[seen]
    assert seen.sum() > 2000
    assert np.median(error_m) < 1e-5 + 0.4 * (np.pi / n) ** 2 / 2  # sagitta of a facet
    assert error_m.max() < 2e-4
    assert ((images.depth_m > 0) == (inside > 0)).mean() > 0.999


@pytest.mark.parametrize("z", [0.7, 3.0])
def test_pixel_centres_lie_at_integers(z: float) -> None:
    images = draw(thing(pixel_quad(9.99, 4.51, 20.01, 8.49, z)))
    expected = np.zeros((CAMERA.height, CAMERA.width), np.uint16)
    expected[5:9, 10:21] = 1
    np.testing.assert_array_equal(images.instance_ids, expected)
    shrunk = draw(thing(pixel_quad(10.01, 4.51, 19.99, 8.49, z)))
    expected[:, [10, 20]] = 0
    np.testing.assert_array_equal(shrunk.instance_ids, expected)


def test_what_is_too_near_or_too_far_or_turned_away_is_not_drawn() -> None:
    images = draw(
        thing(pixel_quad(10, 10, 20, 20, NEAR_M * 0.99), name="near", number=1),
        thing(pixel_quad(30, 10, 40, 20, NEAR_M * 1.01), name="seen", number=2),
        thing(pixel_quad(50, 10, 60, 20, FAR_M * 1.01), name="far", number=3),
        thing(pixel_quad(80, 10, 70, 20, 1.0), name="turned", number=4),
    )
    assert set(np.unique(images.instance_ids)) == {0, 2}
    assert images.normals_camera is not None
    np.testing.assert_array_equal(images.depth_m > 0, images.instance_ids == 2)
    np.testing.assert_array_equal(images.normals_camera.any(axis=2), images.instance_ids == 2)


def test_the_first_row_of_a_texture_is_v_0_and_odd_sizes_of_image_stay_straight() -> None:
    texture = np.zeros((2, 2, 3), np.uint8)
    texture[0, 0], texture[0, 1], texture[1, 0] = (255, 0, 0), (0, 255, 0), (0, 0, 255)
    rgb = draw(thing(pixel_quad(19.5, 19.5, 59.5, 59.5, 1.0, texture=texture))).rgb
    assert rgb.shape == (121, 162, 3)
    assert [int(c.argmax()) for c in (rgb[25, 25], rgb[25, 54], rgb[54, 25])] == [0, 1, 2]
    assert rgb[54, 54].max() < 40


def test_instance_ids_have_16_bits_and_the_nearer_wins() -> None:
    images = draw(
        thing(pixel_quad(10, 10, 60, 60, 2.0), name="behind", number=65535),
        thing(pixel_quad(40, 40, 90, 90, 1.0), name="before", number=513),
        thing(pixel_quad(-9, -9, 999, 999, 3.0), name="room", number=0),
    )
    assert (images.instance_ids[20, 20], images.instance_ids[50, 50], images.instance_ids[5, 5]) == (65535, 513, 0)
    assert images.depth_m[5, 5] == pytest.approx(3.0, abs=1e-5)
    with pytest.raises(ValueError, match="16 bits"):
        draw(thing(pixel_quad(10, 10, 60, 60, 2.0), number=65536))


def test_edges_are_anti_aliased_in_colour_alone() -> None:
    images = draw(thing(pixel_quad(30.25, 20, 90, 90, 1.0), number=7))
    column = images.rgb[50, 28:34, 0].astype(int)
    assert column[0] == 0
    assert column[-1] > 60
    assert ((column > 10) & (column < column[-1] - 10)).any()
    assert set(np.unique(images.instance_ids)) == {0, 7}
    assert set(np.unique(images.depth_m.round(4))) == {0, 1}


class TwoBones:
    """A strip whose upper end swings to the side."""

    def palette_at(self, time_s: float) -> FloatArray:
        upper = pose(rotation_z(0.8), (0.6, 0.2, 0.1))
        return np.stack([np.eye(4), upper])

    def pose_at(self, time_s: float) -> FloatArray:
        return np.eye(4)


def lit_scene() -> Scene:
    """A floor, a wall, and two actors: a ball, and a strip of two bones."""
    rng = np.random.default_rng(5)
    texture = np.kron(rng.integers(40, 220, (8, 8, 3)), np.ones((16, 16, 1))).astype(np.uint8)
    uv = 2 * np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    floor = quad((-3, -3, 0), (3, -3, 0), (3, 3, 0), (-3, 3, 0), uv=uv, texture=texture)
    wall = quad((-3, 3, 0), (3, 3, 0), (3, 3, 3), (-3, 3, 3), uv=uv)
    strip = np.array([[x, 0.0, z] for z in np.linspace(0, 1, 21) for x in (-0.15, 0.15)])
    first = 2 * np.arange(20)
    faces = np.concatenate([np.stack([first, first + 1, first + 3], 1), np.stack([first, first + 3, first + 2], 1)])
    weights = np.zeros((42, 4), np.float32)
    weights[:, 0], weights[:, 1] = 1 - strip[:, 2], strip[:, 2]
    bones = np.tile(np.array([0, 1, 0, 0], np.int32), (42, 1))
    skinned = surface(strip, faces, np.tile([0.0, -1, 0], (42, 1)), bones=bones, weights=weights)
    bent = replace(thing(skinned, name="strip", number=4, actor=True), motion=TwoBones())
    return Scene(
        objects=(
            thing(floor, wall, name="room", number=0),
            thing(ball((0, 0, 0), 0.3, 60), name="ball", number=3, actor=True),
            bent,
        ),
        lights=(Light(position_world=(-1.0, -0.5, 2.6), power=4.0), Light(position_world=(1.2, 0.3, 2.6), power=3.0)),
        ambient=0.3,
    )


SCENE = lit_scene()
EYE = look_at((0.3, -2.5, 1.6), (0.0, 0.5, 0.6))
MOMENT = at(EYE, ball=pose(np.eye(3), (-0.6, 0.5, 0.5))[None], strip=TwoBones().palette_at(0))
LATER = at(EYE, ball=pose(np.eye(3), (0.2, 0.2, 0.9))[None], strip=np.tile(np.eye(4), (2, 1, 1)))


def test_it_agrees_with_the_default_renderer_on_light_shadows_texture_and_skinning() -> None:
    one, other = PyrenderRenderer(SCENE, CAMERA), VisibilityBufferRenderer(SCENE, CAMERA)
    for moment in (MOMENT, LATER):
        ours, theirs = one.render(moment, normals=True), other.render(moment, normals=True)
        assert set(np.unique(theirs.instance_ids)) == {0, 3, 4}
        assert (ours.instance_ids == theirs.instance_ids).mean() > 0.998
        assert (np.abs(ours.depth_m - theirs.depth_m) < 2e-4).mean() > 0.998
        for image in (ours.rgb, ours.depth_m, ours.instance_ids, ours.normals_camera):
            assert image.flags.c_contiguous
            assert image.flags.writeable
        cosine = (ours.normals_camera * theirs.normals_camera).sum(axis=2)
        assert (cosine[theirs.depth_m > 0] > 0.9999).mean() > 0.99
        difference = np.abs(ours.rgb.astype(int) - theirs.rgb)
        assert np.median(difference.max(axis=2)) <= 2
        assert difference.mean() < 1.4  # nearly all at edges: of objects, texels, shadows
        for actor in ("ball", "strip"):
            assert one.unoccluded_pixels(actor) == pytest.approx(other.unoccluded_pixels(actor), abs=3)


@pytest.mark.parametrize("exposure_ev", [-2.0, 1.5])
def test_it_agrees_with_the_default_renderer_on_exposure(exposure_ev: float) -> None:
    camera = replace(CAMERA, exposure_ev=exposure_ev)
    ours, theirs, plain = (
        renderer.render(MOMENT).rgb.astype(int)
        for renderer in (
            PyrenderRenderer(SCENE, camera),
            VisibilityBufferRenderer(SCENE, camera),
            PyrenderRenderer(SCENE, CAMERA),
        )
    )
    difference = np.abs(ours - theirs)
    assert np.median(difference.max(axis=2)) <= 2
    assert difference.mean() < 1.4 * max(theirs.mean() / plain.mean(), 1)
    assert np.abs(ours - plain).mean() > 20


def test_a_stop_less_is_half_as_bright() -> None:
    bright, dark = (PyrenderRenderer(SCENE, replace(CAMERA, exposure_ev=ev)).render(MOMENT).rgb for ev in (-2.0, -3.0))
    np.testing.assert_allclose(dark, bright / 2.0, atol=1)  # all of it below the soft limit


def test_shadows_move_with_their_casters() -> None:
    renderer = PyrenderRenderer(SCENE, CAMERA)
    away = at(EYE, ball=pose(np.eye(3), (0, 0, -9))[None], strip=pose(np.eye(3), (0, 0, -9))[None].repeat(2, 0))
    lit, shaded = renderer.render(away), renderer.render(MOMENT)
    on_the_room = (shaded.instance_ids == 0) & (lit.instance_ids == 0)
    darker = lit.rgb.astype(int).sum(axis=2) - shaded.rgb.sum(axis=2)
    assert (darker[on_the_room] > 30).sum() > 300
    assert (darker[on_the_room] < -30).sum() < 30


def test_frames_do_not_depend_on_each_other_nor_on_the_thread_nor_on_other_renderers() -> None:
    renderer = PyrenderRenderer(SCENE, CAMERA)
    first = renderer.render(MOMENT)
    other = PyrenderRenderer(Scene(objects=(thing(pixel_quad(10, 10, 60, 60, 2.0)),), lights=()), CAMERA)
    assert other.render(at(np.eye(4))).depth_m.max() == pytest.approx(2.0, abs=1e-5)
    renderer.render(LATER)
    del other
    gc.collect()
    pair = [renderer, PyrenderRenderer(SCENE, CAMERA)]
    with ThreadPoolExecutor(2) as pool:
        again = [*pool.map(lambda r: r.render(MOMENT), pair), renderer.render(MOMENT)]
    for images in again:
        np.testing.assert_array_equal(images.rgb, first.rgb)
        np.testing.assert_array_equal(images.depth_m, first.depth_m)
        np.testing.assert_array_equal(images.instance_ids, first.instance_ids)


def test_colour_of_some_rows_is_that_of_the_whole_and_changes_no_count() -> None:
    renderer = PyrenderRenderer(SCENE, CAMERA)
    with pytest.raises(ValueError, match="render a frame first"):
        renderer.unoccluded_pixels("ball")
    whole = renderer.render(MOMENT).rgb
    count = renderer.unoccluded_pixels("ball")
    renderer.render_colour(LATER, (0, 10))
    assert renderer.unoccluded_pixels("ball") == count
    np.testing.assert_array_equal(renderer.render_colour(MOMENT, (30, 47)), whole[30:47])
    with pytest.raises(ValueError, match="rows"):
        renderer.render_colour(MOMENT, (30, 122))


def test_what_it_cannot_do_and_what_it_cannot_use_is_refused() -> None:
    renderer = PyrenderRenderer(SCENE, CAMERA)
    with pytest.raises(SimError, match="no flow: use the renderer numba"):
        renderer.render(MOMENT, flow_to=LATER)
    with pytest.raises(ValueError, match=r"missing \['strip'\], unknown \['bal'\]"):
        renderer.render(at(EYE, bal=np.eye(4)[None], ball=np.eye(4)[None]))
    with pytest.raises(ValueError, match=r"strip: expected a palette \(2, 4, 4\)"):
        renderer.render(at(EYE, ball=np.eye(4)[None], strip=np.eye(4)[None]))
    with pytest.raises(ValueError, match="no actor"):
        renderer.unoccluded_pixels("bal")


PRELUDE = """
import hashlib, importlib.util
spec = importlib.util.spec_from_file_location("here", {path!r})
m = importlib.util.module_from_spec(spec)
spec.loader.exec_module(m)
"""
DIGEST = """
images = m.PyrenderRenderer(m.SCENE, m.CAMERA).render(m.MOMENT)
print(hashlib.sha256(b"".join(i.tobytes() for i in (images.rgb, images.depth_m, images.instance_ids))).hexdigest())
"""


def in_another_process(code: str, **environment: str) -> str:
    """What `code` prints, with this module as m."""
    command = [sys.executable, "-c", PRELUDE.format(path=__file__) + code]
    done = subprocess.run(command, env={**os.environ, **environment}, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_same_bytes_in_another_process() -> None:
    assert in_another_process(DIGEST, PYTHONHASHSEED="0") == in_another_process(DIGEST, PYTHONHASHSEED="1")


def test_osmesa_serves_as_well() -> None:
    if ctypes.util.find_library("OSMesa") is None:
        pytest.skip("no OSMesa here: apt-get install libosmesa6")
    code = f"m.{test_it_agrees_with_the_default_renderer_on_light_shadows_texture_and_skinning.__name__}()"
    in_another_process(code, PYOPENGL_PLATFORM="osmesa")
