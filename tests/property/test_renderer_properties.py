"""What must hold for every triangle that the renderer draws."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.records import CameraModel, Moment
from sim.renderers.visibility_buffer import VisibilityBufferRenderer
from sim.scene import Placed, Scene, SceneObject, Surface

CAMERA = CameraModel(width=60, height=40, fx=50.0, fy=60.0, cx=29.0, cy=20.5)
GREY = np.full((1, 1, 3), 100, np.uint8)
fraction = st.floats(0.05, 0.95)


def mesh(pixels: np.ndarray, depth_m: np.ndarray, faces: np.ndarray) -> Surface:
    """A mesh given by the pixels and depths of its vertices."""
    x = (pixels[:, 0] - CAMERA.cx) / CAMERA.fx * depth_m
    y = (pixels[:, 1] - CAMERA.cy) / CAMERA.fy * depth_m
    vertices = np.stack([x, y, depth_m], 1).astype(np.float32)
    normals = np.tile(np.array([0, 0, -1], np.float32), (len(vertices), 1))
    uv = np.zeros((len(vertices), 2), np.float32)
    return Surface(vertices=vertices, normals=normals, uv=uv, faces=faces.astype(np.int32), texture=GREY)


def actor(number: int, surface: Surface) -> SceneObject:
    return SceneObject(
        name=str(number),
        class_name="thing",
        instance_id=number,
        surfaces=(surface,),
        motion=Placed(np.eye(4)),
        is_actor=True,
    )


def render(objects: list[SceneObject]) -> tuple[np.ndarray, np.ndarray, list[int]]:
    renderer = VisibilityBufferRenderer(Scene(objects=tuple(objects), lights=()), CAMERA)
    images = renderer.render(Moment(T_world_camera=np.eye(4), palettes={o.name: np.eye(4)[None] for o in objects}))
    return images.instance_ids, images.depth_m, [renderer.unoccluded_pixels(o.name) for o in objects]


@settings(max_examples=25, deadline=None)
@given(fraction, fraction, st.floats(0.3, 6.0), st.integers(0, 2**31))
def test_triangles_around_a_point_share_no_pixel_and_leave_none(a: float, b: float, z: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = np.array([[-9, -9], [-9, 49], [25, 52], [69, 49], [69, -9], [33, -15]], float)
    rim = np.concatenate([corners, [[a * 59, b * 39]]])
    depth_m = z * rng.uniform(0.7, 1.3, len(rim))
    fans = [actor(n + 1, mesh(rim, depth_m, np.array([[6, n, (n + 1) % 6]]))) for n in range(6)]
    ids, _, counts = render(fans)
    assert (ids > 0).all()
    assert sum(counts) == CAMERA.width * CAMERA.height


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**31), st.integers(15, 70))
def test_a_fine_mesh_has_no_crack(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    u, v = np.meshgrid(np.linspace(-5, 65, n), np.linspace(-5, 45, n))
    pixels = np.stack([u, v], -1) + rng.uniform(-0.3, 0.3, (n, n, 2)) * [70 / n, 50 / n]
    number = np.arange(n * n).reshape(n, n)
    a, b, c, d = (x.ravel() for x in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    depth_m = rng.uniform(1.9, 2.1, n * n)
    ids, depth, counts = render([actor(1, mesh(pixels.reshape(-1, 2), depth_m, faces))])
    assert (ids == 1).all()
    assert counts == [CAMERA.width * CAMERA.height]
    assert depth.min() >= 1.899
    assert depth.max() <= 2.101


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.floats(-20, 80), st.floats(-20, 60), st.floats(0.2, 8.0)), min_size=3, max_size=3))
def test_depth_is_that_of_the_triangles_plane(corners: list[tuple[float, float, float]]) -> None:
    points = np.array(corners)
    surface = mesh(points[:, :2], points[:, 2], np.array([[0, 1, 2], [0, 2, 1]]))  # both sides
    ids, depth, _ = render([actor(1, surface)])
    a, b, c = surface.vertices.astype(float)
    normal = np.cross(b - a, c - a)
    u, v = np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height))
    rays = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones(u.shape)], -1)
    edges = [
        ((q - p)[0] * (v - p[1]) - (q - p)[1] * (u - p[0]))
        for p, q in zip(points[:, :2], points[[1, 2, 0], :2], strict=True)
    ]
    area = edges[0] + edges[1] + edges[2]
    if abs(area.flat[0]) < 5:  # a sliver has no plane to speak of
        return
    inside = np.all([e / area > 1e-3 for e in edges], axis=0)
    outside = np.any([e / area < -1e-3 for e in edges], axis=0)
    assert (ids[inside] == 1).all()
    assert (ids[outside] == 0).all()
    truth = (normal @ a) / (rays @ normal)
    np.testing.assert_allclose(depth[inside], truth[inside], rtol=1e-4)
