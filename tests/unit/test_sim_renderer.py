"""The default renderer against analytic images."""

import hashlib
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from sim.geometry import FloatArray, look_at, pose, rotation_z
from sim.records import CameraModel, Moment, RenderedImages
from sim.renderers.visibility_buffer import NEAR_M, VisibilityBufferRenderer
from sim.scene import Light, Placed, Scene, SceneObject, Surface

CAMERA = CameraModel(width=160, height=120, fx=130.0, fy=140.0, cx=78.3, cy=61.2)
AT_ORIGIN = np.eye(4)
WHITE = np.full((4, 4, 3), 200, np.uint8)


def surface(
    vertices: npt.ArrayLike,
    faces: npt.ArrayLike,
    uv: npt.ArrayLike | None = None,
    normals: npt.ArrayLike | None = None,
    texture: npt.NDArray[np.uint8] = WHITE,
) -> Surface:
    points = np.asarray(vertices, np.float32)
    return Surface(
        vertices=points,
        normals=np.tile(np.array([0, 0, -1], np.float32), (len(points), 1))
        if normals is None
        else np.asarray(normals, np.float32),
        uv=np.zeros((len(points), 2), np.float32) if uv is None else np.asarray(uv, np.float32),
        faces=np.asarray(faces, np.int32),
        texture=texture,
    )


def quad(a: npt.ArrayLike, b: npt.ArrayLike, c: npt.ArrayLike, d: npt.ArrayLike, **rest: object) -> Surface:
    """Seen from the front, the corners run counter-clockwise."""
    corners = np.array([a, b, c, d], float)
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    rest.setdefault("normals", np.tile(normal / np.linalg.norm(normal), (4, 1)))
    return surface(corners, [[0, 1, 2], [0, 2, 3]], **rest)  # type: ignore[arg-type]  # keywords passed through


def pixel_quad(u0: float, v0: float, u1: float, v1: float, z: float, **rest: object) -> Surface:
    """A fronto-parallel rectangle between these pixel coordinates at depth z; uv (0, 0) at its upper left corner."""
    x0, x1 = ((u - CAMERA.cx) / CAMERA.fx * z for u in (u0, u1))
    y0, y1 = ((v - CAMERA.cy) / CAMERA.fy * z for v in (v0, v1))
    return quad((x0, y0, z), (x0, y1, z), (x1, y1, z), (x1, y0, z), uv=[[0, 0], [0, 1], [1, 1], [1, 0]], **rest)


def thing(*surfaces: Surface, name: str = "thing", number: int = 1, actor: bool = False) -> SceneObject:
    return SceneObject(
        name=name,
        class_name="thing",
        instance_id=number,
        surfaces=surfaces,
        motion=Placed(np.eye(4)),
        is_actor=actor,
    )


def draw_moment(
    renderer: VisibilityBufferRenderer, T_world_camera: FloatArray, palettes: dict[str, FloatArray]
) -> RenderedImages:
    return renderer.render(Moment(T_world_camera=T_world_camera, palettes=palettes))


def draw(*objects: SceneObject, T_world_camera: FloatArray = AT_ORIGIN, **options: object) -> RenderedImages:
    scene = Scene(objects=objects, lights=(), ambient=0.5)
    renderer = VisibilityBufferRenderer(scene, CAMERA, **options)  # type: ignore[arg-type]  # keywords passed through
    return draw_moment(renderer, T_world_camera, {o.name: np.eye(4)[None] for o in scene.actors})


def rays() -> FloatArray:
    u, v = np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height))
    return np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones(u.shape)], axis=-1)


def room() -> SceneObject:
    """A closed box of 6 x 5 x 3 m around (0, 0, 1.5), seen from inside, all in one surface."""
    corners = np.array([[x, y, z] for z in (0, 3) for y in (-2.5, 2.5) for x in (-3, 3)], float)
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    parts = [quad(*corners[list(side)]) for side in sides]
    return thing(*parts, name="room", number=0)


@pytest.mark.parametrize("z", [0.7, 3.0])
def test_pixel_centres_lie_at_integers(z: float) -> None:
    images = draw(thing(pixel_quad(9.99, 4.51, 20.01, 8.49, z)))
    expected = np.zeros((CAMERA.height, CAMERA.width), np.uint16)
    expected[5:9, 10:21] = 1
    np.testing.assert_array_equal(images.instance_ids, expected)
    shrunk = draw(thing(pixel_quad(10.01, 4.51, 19.99, 8.49, z)))
    expected[:, [10, 20]] = 0
    np.testing.assert_array_equal(shrunk.instance_ids, expected)


def test_a_floor_through_the_near_plane_covers_exactly_its_pixels() -> None:
    camera = replace(CAMERA, fy=20.0)  # so wide that the near plane is in view
    height_m = 0.1
    floor = quad((-20, height_m, -5), (20, height_m, -5), (20, height_m, 10), (-20, height_m, 10))
    renderer = VisibilityBufferRenderer(Scene(objects=(thing(floor),), lights=()), camera)
    images = draw_moment(renderer, AT_ORIGIN, {})
    slope = (np.arange(camera.height) - camera.cy) / camera.fy
    z = np.where(slope > 0, height_m / np.where(slope > 0, slope, 1.0), 0.0)
    covered = (z >= NEAR_M) & (z <= 10)
    assert covered.any()
    assert not covered[-1]
    np.testing.assert_array_equal(images.depth_m > 0, np.repeat(covered[:, None], camera.width, 1))
    np.testing.assert_allclose(images.depth_m[covered, 0], z[covered], atol=1e-5)


def test_a_closed_room_has_no_hole() -> None:
    renderer = VisibilityBufferRenderer(Scene(objects=(room(),), lights=()), CAMERA)
    rng = np.random.default_rng(5)
    for _ in range(20):
        eye = rng.uniform([-2.8, -2.3, 0.2], [2.8, 2.3, 2.8])
        images = draw_moment(renderer, look_at(eye, eye + rng.normal(size=3)), {})
        assert (images.depth_m > 0).all()
        assert (images.instance_ids == 0).all()


def test_the_nearer_surface_wins_and_the_images_agree() -> None:
    far = thing(pixel_quad(20, 20, 120, 100, 3.0), name="far", number=7)
    near = thing(pixel_quad(50, 40, 80, 60, 2.0), name="near", number=65535)
    for order in ((far, near), (near, far)):
        images = draw(*order)
        assert images.instance_ids.dtype == np.uint16
        np.testing.assert_allclose(images.depth_m[images.instance_ids == 7], 3.0, atol=1e-5)
        np.testing.assert_allclose(images.depth_m[images.instance_ids == 65535], 2.0, atol=1e-5)
        nothing = images.instance_ids == 0
        assert (images.depth_m[nothing] == 0).all()
        alone = nothing.copy()  # an edge of a surface tints the pixel beside it
        alone[20:102, 20:122] = False
        assert (images.rgb[alone] == 0).all()
        assert images.instance_ids[50, 60] == 65535


def test_a_panel_shows_from_its_front_alone() -> None:
    panel = thing(quad((-1, -1, 2), (-1, 1, 2), (1, 1, 2), (1, -1, 2)))
    assert (draw(panel).depth_m > 0).any()
    behind = pose(np.diag([-1.0, 1.0, -1.0]), (0, 0, 4))
    assert (draw(panel, T_world_camera=behind).depth_m == 0).all()


def test_textures_are_not_flipped() -> None:
    texture = np.full((64, 64, 3), (0, 0, 200), np.uint8)
    texture[:16, :16] = (200, 0, 0)  # first rows, first columns
    texture[:16, 48:] = (0, 200, 0)
    rgb = draw(thing(pixel_quad(9.5, 9.5, 109.5, 89.5, 2.0, texture=texture))).rgb
    assert rgb[15, 15].argmax() == 0
    assert rgb[15, 104].argmax() == 1
    assert rgb[84, 15].argmax() == rgb[84, 104].argmax() == 2


def test_textures_repeat_and_are_bilinear() -> None:
    texture = np.zeros((2, 2, 3), np.uint8)
    texture[:, 1] = 200
    panel = pixel_quad(-0.5, -0.5, 159.5, 119.5, 2.0, texture=texture)
    panel = replace(panel, uv=panel.uv * 2 - 3)  # two periods, 80 pixels each
    line = draw(thing(panel)).rgb[60, :, 0].astype(int)
    assert line[20] == 0  # texel centres
    assert line[60] > 60
    np.testing.assert_allclose(line[40], line[60] / 2, atol=3)  # half way between
    np.testing.assert_allclose(line[:80], line[80:], atol=1)


def test_far_textures_fade_to_their_mean() -> None:
    texture = np.zeros((256, 256, 3), np.uint8)
    texture[(np.add.outer(np.arange(256), np.arange(256)) % 2) == 1] = 200
    near = draw(thing(pixel_quad(-200, -200, 400, 400, 2.0, texture=texture))).rgb.astype(float)
    far = draw(thing(pixel_quad(60, 40, 92, 72, 2.0, texture=texture))).rgb[45:68, 65:88].astype(float)
    assert near.std() > 5 * far.std()
    assert abs(near.mean() - far.mean()) < 4


def test_textures_fade_evenly_from_level_to_level() -> None:
    texture = np.random.default_rng(4).integers(0, 255, (256, 256, 3), dtype=np.uint8)
    contrast = []
    for texels_per_pixel in (1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 3.5, 4.0):
        side = 256 / texels_per_pixel
        rgb = draw(thing(pixel_quad(20.3, 20.3, 20.3 + side, 20.3 + side, 2.0, texture=texture))).rgb[30:80, 30:80]
        contrast.append(rgb.astype(float).std())
    fall = -np.diff(np.log2(contrast))
    assert fall.min() > 0.1  # no level is used alone for long
    assert fall.max() < 0.5  # and none sets in at once


def test_light_falls_off_as_stated() -> None:
    light = Light(position_world=(0.0, 0.0, 1.0), power=0.9)
    panel = quad((-3, -3, 2), (-3, 3, 2), (3, 3, 2), (3, -3, 2))
    scene = Scene(objects=(thing(panel),), lights=(light,), ambient=0.2)
    rgb = draw_moment(VisibilityBufferRenderer(scene, CAMERA, shadow_size=0), AT_ORIGIN, {}).rgb
    point = rays() * 2.0
    squared = ((point - [0, 0, 1]) ** 2).sum(-1)
    expected = 200 * (0.2 * 0.75 + 0.9 / np.sqrt(squared) / (1 + squared))  # the normal points down the world's z
    np.testing.assert_allclose(rgb[..., 0], expected, atol=3)


def test_a_stop_of_exposure_doubles_the_brightness() -> None:
    light = Light(position_world=(0.0, 0.0, 1.0), power=0.3)
    scene = Scene(objects=(thing(pixel_quad(-1, -1, 200, 200, 2.0)),), lights=(light,), ambient=0.1)
    dark, bright = (
        draw_moment(VisibilityBufferRenderer(scene, replace(CAMERA, exposure_ev=ev)), AT_ORIGIN, {}).rgb.astype(int)
        for ev in (0.0, 1.0)
    )
    assert bright.max() < 200 * 0.7  # below the soft limit
    np.testing.assert_allclose(bright, 2 * dark, atol=2)


def test_no_light_burns_out() -> None:
    texture = np.full((4, 4, 3), 250, np.uint8)
    texture[..., 2] = 125
    lights = tuple(Light(position_world=(0.0, 0.0, z), power=50.0) for z in (0.2, 0.5))
    scene = Scene(objects=(thing(pixel_quad(-1, -1, 200, 200, 1.0, texture=texture)),), lights=lights)
    rgb = draw_moment(VisibilityBufferRenderer(scene, CAMERA, shadow_size=0), AT_ORIGIN, {}).rgb.astype(int)
    assert rgb.max() <= 250
    np.testing.assert_allclose(rgb[..., 0], 2 * rgb[..., 2], atol=2)  # the hue is kept


@pytest.mark.parametrize("actor", [False, True])
def test_shadows_lie_under_things_and_have_soft_edges(actor: bool) -> None:
    floor = thing(quad((-3, -3, 0), (3, -3, 0), (3, 3, 0), (-3, 3, 0)), name="floor", number=0)
    plate = thing(quad((-0.5, -0.5, 1), (0.5, -0.5, 1), (0.5, 0.5, 1), (-0.5, 0.5, 1)), actor=actor)
    light = Light(position_world=(0.0, 0.0, 2.0), power=3.0)
    scene = Scene(objects=(floor, plate), lights=(light,), ambient=0.2)
    renderer = VisibilityBufferRenderer(scene, CAMERA, shadow_size=512)
    view = look_at((0.0, -2.9, 0.6), (0.0, -0.3, 0.0))
    palettes = {"thing": np.eye(4)[None]} if actor else {}
    images = draw_moment(renderer, view, palettes)
    R, eye = view[:3, :3], view[:3, 3]
    point = eye + (rays() @ R.T) * images.depth_m[..., None]
    on_floor = (images.instance_ids == 0) & (images.depth_m > 0)
    reach = np.abs(point[..., :2]).max(-1)  # the shadow of the plate is the square |x|, |y| < 1
    grey = images.rgb[..., 0].astype(int)
    ambient = int(200 * 0.2 * 1.25)
    np.testing.assert_allclose(grey[on_floor & (reach < 0.9)], ambient, atol=1)
    assert grey[on_floor & (reach > 1.1) & (reach < 1.5)].min() > ambient + 20
    edge = np.unique(grey[on_floor & (np.abs(reach - 1) < 0.03)])
    assert len(edge) > 8
    assert (draw_without(plate, scene, view, palettes) > ambient + 20).all()


def draw_without(
    obj: SceneObject, scene: Scene, view: FloatArray, palettes: dict[str, FloatArray]
) -> npt.NDArray[np.int64]:
    """Grey levels of the floor near the origin when `obj` stands elsewhere."""
    moved = replace(obj, motion=Placed(pose(np.eye(3), (50, 50, 0))))
    renderer = VisibilityBufferRenderer(replace(scene, objects=(scene.objects[0], moved)), CAMERA)
    images = draw_moment(renderer, view, {name: moved.motion.palette_at(0) for name in palettes})
    return images.rgb[60:, 60:100, 0].astype(int)


def digest(images: RenderedImages) -> str:
    joined = b"".join(a.tobytes() for a in (images.rgb, images.depth_m, images.instance_ids))
    return hashlib.sha256(joined).hexdigest()


def test_a_skin_with_one_bone_is_rigid() -> None:
    rigid = pixel_quad(30, 30, 90, 80, 2.0)
    weights = np.zeros((4, 4), np.float32)
    weights[:, 0] = 1
    skinned = replace(rigid, bones=np.zeros((4, 4), np.int32), weights=weights)
    T = pose(rotation_z(0.3), (0.1, 0.2, 0.5))[None]
    hashes = set()
    for part in (rigid, skinned):
        scene = Scene(objects=(thing(part, actor=True),), lights=())
        hashes.add(digest(draw_moment(VisibilityBufferRenderer(scene, CAMERA), AT_ORIGIN, {"thing": T})))
    assert len(hashes) == 1


def test_a_posed_actor_is_where_a_placed_object_would_be() -> None:
    T = pose(rotation_z(0.3), (0.1, 0.2, 0.5))
    part = pixel_quad(30, 30, 90, 80, 2.0)
    placed = replace(thing(part), motion=Placed(T))
    actor = VisibilityBufferRenderer(Scene(objects=(thing(part, actor=True),), lights=(), ambient=0.5), CAMERA)
    assert digest(draw(placed)) == digest(draw_moment(actor, AT_ORIGIN, {"thing": T[None]}))


def test_unoccluded_pixels_counts_what_others_hide() -> None:
    hidden = thing(pixel_quad(19.5, 19.5, 59.5, 39.5, 2.0), name="hidden", number=3, actor=True)
    wall = thing(pixel_quad(39.5, 0, 159, 119, 1.0), name="wall", number=4, actor=True)
    gone = thing(quad((-1, -1, -2), (-1, 1, -2), (1, 1, -2), (1, -1, -2)), name="gone", number=5, actor=True)
    renderer = VisibilityBufferRenderer(Scene(objects=(hidden, wall, gone), lights=()), CAMERA)
    images = draw_moment(renderer, AT_ORIGIN, {name: np.eye(4)[None] for name in ("wall", "hidden", "gone")})
    assert np.count_nonzero(images.instance_ids == 3) == 20 * 20
    assert renderer.unoccluded_pixels("hidden") == 40 * 20
    assert renderer.unoccluded_pixels("wall") == np.count_nonzero(images.instance_ids == 4)
    assert renderer.unoccluded_pixels("gone") == 0
    outside = pose(np.eye(3), (-40.0 / CAMERA.fx * 2, 0, 0))[None]  # 40 pixels to the left: half leaves the image
    draw_moment(renderer, AT_ORIGIN, {"wall": np.eye(4)[None], "hidden": outside, "gone": np.eye(4)[None]})
    assert renderer.unoccluded_pixels("hidden") == 20 * 20


def test_wrong_names_and_shapes_are_refused() -> None:
    actor = thing(pixel_quad(0, 0, 9, 9, 1.0), actor=True)
    renderer = VisibilityBufferRenderer(Scene(objects=(actor,), lights=()), CAMERA)
    with pytest.raises(ValueError, match="render a frame first"):
        renderer.unoccluded_pixels("thing")
    with pytest.raises(ValueError, match=r"missing \['thing'\]"):
        draw_moment(renderer, AT_ORIGIN, {})
    with pytest.raises(ValueError, match=r"unknown \['ghost'\]"):
        draw_moment(renderer, AT_ORIGIN, {"thing": np.eye(4)[None], "ghost": np.eye(4)[None]})
    with pytest.raises(ValueError, match=r"expected a palette \(1, 4, 4\)"):
        draw_moment(renderer, AT_ORIGIN, {"thing": np.eye(4)})
    with pytest.raises(ValueError, match="is no actor"):
        renderer.unoccluded_pixels("ghost")


def test_scenes_that_cannot_be_drawn_are_refused() -> None:
    part = pixel_quad(0, 0, 9, 9, 1.0)
    weights = np.full((4, 4), 0.25, np.float32)
    wild = replace(part, bones=np.full((4, 4), 1, np.int32), weights=weights)
    crowd = tuple(thing(part, name=str(n), number=n + 1, actor=True) for n in range(33))
    for objects, message in (
        ((thing(part, number=70000),), "16 bits"),
        ((thing(wild),), "names a bone"),
        (crowd, "32 actors"),
    ):
        with pytest.raises(ValueError, match=message):
            VisibilityBufferRenderer(Scene(objects=objects, lights=()), CAMERA)
    with pytest.raises(ValueError, match="threads"):
        draw(thing(part), threads=0)
    with pytest.raises(ValueError, match="camera"):
        VisibilityBufferRenderer(Scene(objects=(), lights=()), replace(CAMERA, fx=0.0))


def test_an_empty_scene_is_black() -> None:
    images = draw()
    assert not images.rgb.any()
    assert not images.depth_m.any()
