"""The depth of the default renderer against the closed form: planes and spheres, near and far, to 0.01 mm.

Two criteria, over all pixels. The point that a pixel's depth states lies on the surface: its distance to it is at most
0.01 mm. And where the ray meets the surface at more than 30 degrees, the depth itself is that of the closed form within
0.01 mm. At a grazing ray a micrometre from the surface is many along the ray, and triangles of a few pixels reach
0.0005 pixels beyond their edges.
"""

import numpy as np
import numpy.typing as npt
import pytest

from sim.geometry import FloatArray, look_at, pose, rotation_z
from sim.records import CameraModel, Moment, RenderedImages
from sim.renderers.visibility_buffer import VisibilityBufferRenderer
from sim.scene import Placed, Scene, SceneObject, Surface

CAMERA = CameraModel(width=640, height=480, fx=535.4, fy=539.2, cx=320.1, cy=247.6)
LIMIT_M = 1e-5
NOT_GRAZING = 0.5
FAR_M = 8.0


def rays() -> FloatArray:
    """(H, W, 3): pixel (u, v) shows the point z times its ray, in the camera frame."""
    u, v = np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height))
    return np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones(u.shape)], axis=-1)


def thing(vertices: FloatArray, faces: npt.NDArray[np.int64], normals: FloatArray, *, actor: bool) -> SceneObject:
    """A mesh in the world. An actor's vertices are at rest somewhere else, and its pose brings them here."""
    T_world_rest = pose(rotation_z(2.1), (0.7, -1.9, 0.4)) if actor else np.eye(4)
    R = T_world_rest[:3, :3]
    surface = Surface(
        vertices=((vertices - T_world_rest[:3, 3]) @ R).astype(np.float32),
        normals=(normals @ R).astype(np.float32),
        uv=np.zeros((len(vertices), 2), np.float32),
        faces=faces.astype(np.int32),
        texture=np.full((4, 4, 3), 200, np.uint8),
    )
    motion = Placed(T_world_rest)
    return SceneObject(
        name="thing", class_name="thing", instance_id=1, surfaces=(surface,), motion=motion, is_actor=actor
    )


def renderer_of(obj: SceneObject) -> VisibilityBufferRenderer:
    return VisibilityBufferRenderer(Scene(objects=(obj,), lights=(), ambient=0.5), CAMERA, shadow_size=0)


def draw(renderer: VisibilityBufferRenderer, obj: SceneObject, T_world_camera: FloatArray) -> RenderedImages:
    palettes = {obj.name: obj.motion.palette_at(0.0)} if obj.is_actor else {}
    return renderer.render(Moment(T_world_camera=T_world_camera, palettes=palettes))


def icosphere(subdivisions: int) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Points of the unit sphere and triangles, counter-clockwise from outside."""
    g = (1 + 5**0.5) / 2
    points = np.array([(a, b * g, 0) for b in (1, -1) for a in (-1, 1)])
    points = np.concatenate([points, np.roll(points, 1, axis=1), np.roll(points, 2, axis=1)])
    # A face: three points whose distances are all 2. Oriented by its own direction.
    near = np.isclose(np.linalg.norm(points[:, None] - points, axis=-1), 2)
    corners = [(a, b, c) for a in range(12) for b in range(a) for c in range(b) if near[a, b] & near[b, c] & near[a, c]]
    faces = np.array([(a, b, c) if np.linalg.det(points[[a, b, c]]) > 0 else (a, c, b) for a, b, c in corners])
    for _ in range(subdivisions):
        edges, inverse = np.unique(
            np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0, return_inverse=True
        )
        ab, bc, ca = (inverse.reshape(-1, 3) + len(points)).T
        a, b, c = faces.T
        points = np.concatenate([points, points[edges].sum(axis=1)])
        faces = np.concatenate([np.stack(f, axis=1) for f in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))])
        points /= np.linalg.norm(points, axis=1, keepdims=True)
    return points, faces


@pytest.mark.parametrize("actor", [False, True])
def test_spheres_are_the_closed_form(actor: bool) -> None:
    centre, radius = np.array([1.3, -0.7, 1.1]), 0.1
    points, faces = icosphere(7)  # its facets lie up to 0.002 mm inside
    ball = thing(centre + radius * points, faces, points, actor=actor)
    renderer = renderer_of(ball)
    for distance_m, direction in [(0.5, (1, 2, 0.5)), (1.0, (-3, 1, 0.2)), (2.5, (0, -1, 0.3)), (6.0, (2, -1, -0.1))]:
        eye = centre + distance_m * np.array(direction) / np.linalg.norm(direction)
        T_world_camera = look_at(eye, centre + np.array([0.02, 0.03, -0.01]))
        images = draw(renderer, ball, T_world_camera)
        ray = rays() @ T_world_camera[:3, :3].T
        squared, half = (ray * ray).sum(axis=-1), ray @ (eye - centre)
        inside = half**2 - squared * ((eye - centre) @ (eye - centre) - radius**2)
        seen = images.instance_ids == 1
        assert seen.sum() > 200
        assert (seen != (inside > 0)).sum() <= 0.03 * seen.sum() ** 0.5 + 2  # of the outline, where facets are chords
        point = eye + ray * images.depth_m[..., None]
        from_surface_m = np.abs(np.linalg.norm(point - centre, axis=-1) - radius)
        assert from_surface_m[seen].max() < LIMIT_M
        truth = (-half - np.sqrt(np.maximum(inside, 0))) / squared
        sine = -((eye + ray * truth[..., None] - centre) * ray).sum(axis=-1) / radius / np.sqrt(squared)
        steep = seen & (inside > 0) & (sine > NOT_GRAZING)
        assert steep.sum() > 0.7 * seen.sum()
        assert np.abs(images.depth_m - truth)[steep].max() < LIMIT_M


@pytest.mark.parametrize("actor", [False, True])
@pytest.mark.parametrize("cells", [1, 8, 200])
@pytest.mark.parametrize("distance_m", [0.5, 1.0, 2.5, 6.0])
def test_planes_are_the_closed_form(distance_m: float, cells: int, actor: bool) -> None:
    """Of two triangles that reach behind the camera, of large ones, and of those that are smaller than a few pixels."""
    rng = np.random.default_rng([int(10 * distance_m), cells, actor])
    for slant in (0.0, 0.6, 3.0):
        normal = rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        right = np.cross(normal, rng.normal(size=3))
        right /= np.linalg.norm(right)
        up, foot = np.cross(normal, right), rng.uniform((-3, -3, 0), (3, 3, 2))
        s, t = np.meshgrid(*[np.linspace(-1, 1, cells + 1) * (3 if cells == 200 else 8)] * 2)
        vertices = foot + s.reshape(-1, 1) * right + t.reshape(-1, 1) * up
        number = np.arange(len(vertices)).reshape(s.shape)
        a, b, c, d = (n.ravel() for n in (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]))
        faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
        panel = thing(vertices, faces, np.tile(normal, (len(vertices), 1)), actor=actor)
        towards = normal + slant * right
        T_world_camera = look_at(foot + distance_m * towards / np.linalg.norm(towards), foot)
        images = draw(renderer_of(panel), panel, T_world_camera)
        ray = rays() @ T_world_camera[:3, :3].T
        slope, eye = ray @ normal, T_world_camera[:3, 3]
        seen = (images.instance_ids == 1) & (images.depth_m < FAR_M)
        assert seen.sum() > 10_000
        from_surface_m = np.abs((eye + ray * images.depth_m[..., None] - foot) @ normal)
        assert from_surface_m[seen].max() < LIMIT_M
        steep = seen & (-slope > NOT_GRAZING * np.linalg.norm(ray, axis=-1))
        assert steep.any()
        assert np.abs(images.depth_m[steep] - ((foot - eye) @ normal) / slope[steep]).max() < LIMIT_M
