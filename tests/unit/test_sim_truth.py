"""The truth about actors against brute force and against motions known in closed form."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pytest

from sim.geometry import FloatArray, look_at, pose, rotation_z
from sim.records import CameraModel, Moment, ObjectTruth, RenderedImages
from sim.renderers.visibility_buffer import VisibilityBufferRenderer
from sim.scene import Scene, SceneObject, Surface
from sim.truth import SurfaceMoments, object_truth

CAMERA = CameraModel(width=160, height=120, fx=130.0, fy=140.0, cx=78.3, cy=61.2)
GREY = np.full((1, 1, 3), 100, np.uint8)


@dataclass(frozen=True)
class Moving:
    """A motion given by a function of time."""

    palette: Callable[[float], FloatArray]

    def palette_at(self, time_s: float) -> FloatArray:
        return self.palette(time_s)

    def pose_at(self, time_s: float) -> FloatArray:
        T_world_object: FloatArray = self.palette(time_s)[0]
        return T_world_object


def surface(vertices: npt.ArrayLike, faces: npt.ArrayLike) -> Surface:
    points = np.asarray(vertices, np.float32)
    normals = np.tile(np.array([0, 0, 1], np.float32), (len(points), 1))
    uv = np.zeros((len(points), 2), np.float32)
    return Surface(vertices=points, normals=normals, uv=uv, faces=np.asarray(faces, np.int32), texture=GREY)


def actor(*surfaces: Surface, motion: Callable[[float], FloatArray], number: int = 1) -> SceneObject:
    return SceneObject(
        name=f"actor{number}",
        class_name="thing",
        instance_id=number,
        surfaces=surfaces,
        motion=Moving(motion),
        is_actor=True,
    )


def nothing_seen() -> RenderedImages:
    shape = (CAMERA.height, CAMERA.width)
    return RenderedImages(
        rgb=np.zeros((*shape, 3), np.uint8),
        depth_m=np.zeros(shape, np.float32),
        instance_ids=np.zeros(shape, np.uint16),
    )


def truth_unseen(obj: SceneObject, time_s: float) -> ObjectTruth:
    palette = obj.motion.palette_at(time_s)
    return object_truth(obj, SurfaceMoments.of(obj), time_s, palette, nothing_seen(), CAMERA, np.eye(4), 0)


def posed_centroid(obj: SceneObject, palette: FloatArray) -> FloatArray:
    """Area-weighted mean of the posed triangles' centroids, by brute force."""
    total, area = np.zeros(3), 0.0
    for part in obj.surfaces:
        rest = np.c_[part.vertices.astype(float), np.ones(len(part.vertices))]
        if part.bones is None or part.weights is None:
            posed = (rest @ palette[0].T)[:, :3]
        else:
            matrices = (palette[part.bones] * part.weights[..., None, None]).sum(1)
            posed = np.einsum("nij,nj->ni", matrices, rest)[:, :3]
        a, b, c = (posed[part.faces[:, k]] for k in range(3))
        face_area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
        total += (face_area[:, None] * (a + b + c) / 3).sum(0)
        area += face_area.sum()
    return np.asarray(total / area)


def disc(radius: float, n: int = 64) -> Surface:
    angle = np.arange(n) * 2 * np.pi / n
    rim = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], 1)
    faces = [[n, k, (k + 1) % n] for k in range(n)]
    return surface(np.r_[rim, [[0, 0, 0]]], faces)


def test_centre_of_a_rigid_body_is_its_centroid() -> None:
    rng = np.random.default_rng(2)
    parts = tuple(surface(rng.normal(size=(30, 3)), rng.permutation(30).reshape(10, 3)) for _ in range(2))
    T = look_at((1.0, 2.0, 3.0), (0.3, 0.1, 0.2))[None]
    obj = actor(*parts, motion=lambda t: T)
    np.testing.assert_allclose(truth_unseen(obj, 0.0).centre_world, posed_centroid(obj, T), atol=1e-6)


def bent_tube() -> tuple[SceneObject, Callable[[float], FloatArray]]:
    """A limb of 0.8 m along z, 6 cm thick, whose upper half bends about its middle."""
    n, m = 24, 60
    angle, z = np.meshgrid(np.arange(n) * 2 * np.pi / n, np.linspace(0, 0.8, m), indexing="ij")
    points = np.stack([0.06 * np.cos(angle), 0.06 * np.sin(angle), z], -1).reshape(-1, 3)
    number = np.arange(n * m).reshape(n, m)
    a, b = number[:, :-1].ravel(), np.roll(number, -1, 0)[:, :-1].ravel()
    faces = np.concatenate([np.stack([a, b, b + 1], 1), np.stack([a, b + 1, a + 1], 1)])
    upper = np.clip((z.ravel() - 0.35) / 0.1, 0, 1)
    part = surface(points, faces)
    weights = np.stack([1 - upper, upper, 0 * upper, 0 * upper], 1).astype(np.float32)
    bones = np.tile(np.array([0, 1, 0, 0], np.int32), (n * m, 1))
    skinned = Surface(
        vertices=part.vertices,
        normals=part.normals,
        uv=part.uv,
        faces=part.faces,
        texture=GREY,
        bones=bones,
        weights=weights,
    )

    def palette(time_s: float) -> FloatArray:
        c, s = np.cos(0.7 * time_s), np.sin(0.7 * time_s)
        bend = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        middle = np.array([0, 0, 0.4])
        T = pose(rotation_z(0.5), (1.0, 2.0, 0.1))
        return np.stack([T, T @ pose(bend, middle - bend @ middle)])

    return actor(skinned, motion=palette), palette


def test_centre_of_a_skinned_body_is_within_millimetres_of_its_centroid() -> None:
    obj, palette = bent_tube()
    for time_s in (0.0, 1.0):  # straight, and bent by 40 degrees
        centre = truth_unseen(obj, time_s).centre_world
        assert np.linalg.norm(centre - posed_centroid(obj, palette(time_s))) < (1e-6 if time_s == 0 else 0.004)


def test_velocity_of_a_skinned_body_is_that_of_its_centre() -> None:
    obj, palette = bent_tube()
    moments, h = SurfaceMoments.of(obj), 1e-5
    expected = (moments.centre(palette(0.8 + h)) - moments.centre(palette(0.8 - h))) / (2 * h)
    np.testing.assert_allclose(truth_unseen(obj, 0.8).velocity_world, expected, atol=1e-5)


def test_velocity_on_a_circle() -> None:
    radius, rate = 1.3, 0.9

    def motion(t: float) -> FloatArray:
        return pose(np.eye(3), (radius * np.cos(rate * t), radius * np.sin(rate * t), 0.5))[None]

    truth = truth_unseen(actor(disc(0.2), motion=motion), 0.7)
    speed = radius * rate
    expected = speed * np.array([-np.sin(rate * 0.7), np.cos(rate * 0.7), 0])
    np.testing.assert_allclose(truth.velocity_world, expected, atol=1e-5)
    np.testing.assert_allclose(truth.T_world_object, motion(0.7)[0])
    assert truth.surface_speed_m_s == pytest.approx(speed, abs=1e-5)
    assert truth.is_moving


@pytest.mark.parametrize("rate", [2.0, 0.05])
def test_surface_speed_of_a_turning_disc(rate: float) -> None:
    radius = 0.4
    truth = truth_unseen(actor(disc(radius), motion=lambda t: pose(rotation_z(rate * t), (1, 2, 0))[None]), 3.0)
    expected = np.sqrt(0.95) * radius * rate  # 95 % of a disc's area lies within sqrt(0.95) of its radius
    assert truth.surface_speed_m_s == pytest.approx(expected, rel=0.01)
    assert truth.is_moving == (expected > 0.02)
    np.testing.assert_allclose(truth.velocity_world, 0, atol=1e-9)


def test_sample_points_lie_on_the_surface_and_spread_evenly() -> None:
    obj = actor(disc(1.0), motion=lambda t: np.eye(4)[None])
    points = SurfaceMoments.of(obj).points(np.eye(4)[None])
    assert np.abs(points[:, 2]).max() < 1e-9
    assert np.linalg.norm(points, axis=1).max() <= 1.0
    assert np.linalg.norm(points[:, :2].mean(0)) < 0.02
    assert (points[:, :2] ** 2).mean() == pytest.approx(0.25, rel=0.03)


def seen(T_object: FloatArray, wall_z: float | None = None) -> ObjectTruth:
    """A square of 0.4 m in front of the camera at the origin, perhaps with a wall over the right half of the image."""
    square = surface([[-0.2, -0.2, 0], [-0.2, 0.2, 0], [0.2, 0.2, 0], [0.2, -0.2, 0]], [[0, 1, 2], [0, 2, 3]])
    obj = actor(square, motion=lambda t: T_object[None], number=9)
    objects = [obj]
    palettes = {"actor9": T_object[None]}
    if wall_z is not None:
        wall = surface([[0, -5, 0], [0, 5, 0], [9, 5, 0], [9, -5, 0]], [[0, 1, 2], [0, 2, 3]])
        objects.append(actor(wall, motion=lambda t: np.eye(4)[None], number=2))
        palettes["actor2"] = pose(np.eye(3), (0, 0, wall_z))[None]
    eye = look_at((0.5, -1.0, 1.2), (0.0, 3.0, 1.0))  # everything is moved along with the camera
    palettes = {name: eye @ palette for name, palette in palettes.items()}
    renderer = VisibilityBufferRenderer(Scene(objects=tuple(objects), lights=()), CAMERA)
    images = renderer.render(Moment(T_world_camera=eye, palettes=palettes))
    moments = SurfaceMoments.of(obj)
    return object_truth(
        obj, moments, 0.0, palettes["actor9"], images, CAMERA, eye, renderer.unoccluded_pixels("actor9")
    )


def in_camera(p_world: FloatArray) -> FloatArray:
    eye = look_at((0.5, -1.0, 1.2), (0.0, 3.0, 1.0))
    return np.asarray(eye[:3, :3].T @ (p_world - eye[:3, 3]))


def test_ideal_observation_of_a_fronto_parallel_square() -> None:
    z = 2.0
    truth = seen(pose(np.eye(3), (0.13, -0.07, z)))
    assert truth.ideal_world is not None
    columns = np.arange(CAMERA.width)[np.abs((np.arange(CAMERA.width) - CAMERA.cx) / CAMERA.fx * z - 0.13) <= 0.2]
    rows = np.arange(CAMERA.height)[np.abs((np.arange(CAMERA.height) - CAMERA.cy) / CAMERA.fy * z + 0.07) <= 0.2]
    u, v = (columns[0] + columns[-1]) / 2, (rows[0] + rows[-1]) / 2
    expected = [(u - CAMERA.cx) / CAMERA.fx * z, (v - CAMERA.cy) / CAMERA.fy * z, z]
    np.testing.assert_allclose(in_camera(truth.ideal_world), expected, atol=1e-5)
    np.testing.assert_allclose(in_camera(truth.centre_world), [0.13, -0.07, z], atol=1e-9)
    assert truth.visible_pixels == len(columns) * len(rows)
    assert truth.occlusion == 0.0
    assert not truth.is_truncated


def test_ideal_depth_is_the_mean_over_the_mask() -> None:
    tilt = np.array([[0.6, 0, -0.8], [0, 1, 0], [0.8, 0, 0.6]])
    truth = seen(pose(tilt, (0.0, 0.0, 1.5)))
    assert truth.ideal_world is not None
    normal, point = tilt[:, 2], np.array([0, 0, 1.5])
    u, v = np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height))
    rays = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones(u.shape)], -1)
    z = (normal @ point) / (rays @ normal)
    local = (rays * z[..., None] - point) @ tilt
    mask = (np.abs(local[..., :2]) <= 0.2).all(-1)
    assert in_camera(truth.ideal_world)[2] == pytest.approx(z[mask].mean(), abs=1e-4)


def test_half_hidden_by_a_wall() -> None:
    truth = seen(pose(np.eye(3), (0.0, 0.0, 2.0)), wall_z=1.0)
    free = seen(pose(np.eye(3), (0.0, 0.0, 2.0)))
    assert truth.occlusion == pytest.approx(0.5, abs=0.03)
    assert truth.visible_pixels == round((1 - truth.occlusion) * free.visible_pixels)
    assert not truth.is_truncated


@pytest.mark.parametrize("shift", [(-1.2, 0.0), (1.2, 0.0), (0.0, -0.9), (0.0, 0.9)])
def test_truncated_by_the_border(shift: tuple[float, float]) -> None:
    truth = seen(pose(np.eye(3), (*shift, 2.0)))
    assert truth.visible_pixels > 0
    assert truth.is_truncated
    assert truth.occlusion == 0.0


def test_out_of_view() -> None:
    truth = seen(pose(np.eye(3), (0.0, 0.0, -2.0)))
    assert truth.ideal_world is None
    assert truth.visible_pixels == 0
    assert truth.occlusion == 0.0
    assert not truth.is_truncated


def test_an_actor_without_a_surface_is_refused() -> None:
    with pytest.raises(ValueError, match="needs a surface"):
        SurfaceMoments.of(actor(motion=lambda t: np.eye(4)[None]))
