"""Anti-aliasing of edges against exact areas."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from sim.geometry import FloatArray
from sim.records import CameraModel, Moment, RenderedImages
from sim.renderers.scene_arrays import SceneArrays
from sim.renderers.visibility_buffer import VisibilityBufferRenderer
from sim.scene import Placed, Scene, SceneObject, Surface

CAMERA = CameraModel(width=96, height=72, fx=80.0, fy=85.0, cx=47.3, cy=36.2)
LEVEL = 200
WHITE, BLACK = (np.full((1, 1, 3), value, np.uint8) for value in (LEVEL, 0))
AT_ORIGIN = Moment(T_world_camera=np.eye(4), palettes={})


def panel(pixels: npt.ArrayLike, z: float, texture: npt.NDArray[np.uint8], number: int = 1) -> SceneObject:
    """A flat polygon that faces the camera, by the pixels of its corners in clockwise order on the screen."""
    corners = np.asarray(pixels, float)
    x, y = (corners[:, 0] - CAMERA.cx) / CAMERA.fx * z, (corners[:, 1] - CAMERA.cy) / CAMERA.fy * z
    vertices = np.stack([x, y, np.full(len(x), z)], 1).astype(np.float32)
    return mesh(vertices, np.array([[0, k + 1, k] for k in range(1, len(x) - 1)]), texture, number)


def mesh(vertices: FloatArray, faces: npt.ArrayLike, texture: npt.NDArray[np.uint8], number: int = 1) -> SceneObject:
    n = len(vertices)
    part = Surface(
        vertices=np.asarray(vertices, np.float32),
        normals=np.tile(np.array([0, 0, -1], np.float32), (n, 1)),
        uv=np.zeros((n, 2), np.float32),
        faces=np.asarray(faces, np.int32),
        texture=texture,
    )
    return SceneObject(
        name=str(number), class_name="thing", instance_id=number, surfaces=(part,), motion=Placed(np.eye(4))
    )


BACKGROUND = panel([(-50, -50), (150, -50), (150, 120), (-50, 120)], 3.0, WHITE, 9)


def draw(*objects: SceneObject) -> RenderedImages:
    # Ambient light alone, 0.8 from the front: white comes out as LEVEL.
    return VisibilityBufferRenderer(Scene(objects=objects, lights=(), ambient=1.0), CAMERA).render(AT_ORIGIN)


def brightness(images: RenderedImages) -> FloatArray:
    """1 where the white background shows, 0 where something black hides it."""
    grey = images.rgb[..., 0].astype(float)
    return np.asarray(grey / grey.max())


def polygon_coverage(pixels: npt.ArrayLike) -> FloatArray:
    """Share of each pixel's square inside a convex polygon, exact but for a grid of 32 x 32 points."""
    corners = np.asarray(pixels, float)
    fine = (np.arange(32) + 0.5) / 32 - 0.5
    u = (np.arange(CAMERA.width)[:, None] + fine).ravel()
    v = (np.arange(CAMERA.height)[:, None] + fine).ravel()
    inside = np.ones((len(v), len(u)), bool)
    for (x0, y0), (x1, y1) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        inside &= (x1 - x0) * (v[:, None] - y0) - (y1 - y0) * (u[None] - x0) >= 0
    return np.asarray(inside.reshape(CAMERA.height, 32, CAMERA.width, 32).mean((1, 3)))


@pytest.mark.parametrize("angle_deg", [0.0, 3.0, 17.0, 30.0, 45.0, 60.0, 88.0, 131.0, 200.0])
@pytest.mark.parametrize("shift", [0.0, 0.37])
def test_a_slanted_edge_has_the_grey_of_its_area(angle_deg: float, shift: float) -> None:
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    square = np.array([(0, -200), (200, -200), (200, 200), (0, 200)], float)
    square = square @ np.array([[c, s], [-s, c]]) + [45.2 + shift, 33.1 - shift]
    error = brightness(draw(BACKGROUND, panel(square, 2.0, BLACK))) - (1 - polygon_coverage(square))
    on_edge = np.abs(error) > 0
    assert on_edge.sum() > 20
    assert np.abs(error).max() < 0.03
    assert np.abs(error.mean()) < 1e-3


@pytest.mark.parametrize("width_px", [1.3, 2.1, 3.7])
def test_a_thin_post_keeps_its_width(width_px: float) -> None:
    slant = np.array([(20.3, -10), (20.3 + width_px, -10), (27.8 + width_px, 90), (27.8, 90)])
    image = brightness(draw(BACKGROUND, panel(slant, 2.0, BLACK)))
    seen = (1 - image).sum(1)  # pixels of black per row
    np.testing.assert_allclose(seen, width_px, atol=0.06)


def test_an_edge_moves_smoothly() -> None:
    total = []
    for shift in np.linspace(0, 2, 41):
        corners = np.add([(20, 10), (60, 14), (56, 60), (24, 55)], [shift, 0.3 * shift])
        total.append((1 - brightness(draw(BACKGROUND, panel(corners, 2.0, BLACK)))).sum())
    area = polygon_coverage(corners).sum()
    np.testing.assert_allclose(total, area, rtol=2e-3)
    assert np.abs(np.diff(total)).max() < 1.5


def fine_disc(radius_px: float, rings: int, around: int) -> SceneObject:
    """A disc of many small triangles."""
    r, phi = np.linspace(0, radius_px, rings + 1)[1:], np.linspace(0, 2 * np.pi, around, endpoint=False)
    pixels = np.concatenate([[[0, 0]], (r[:, None, None] * np.stack([np.cos(phi), np.sin(phi)], -1)).reshape(-1, 2)])
    pixels += [46.7, 35.4]
    x, y = (pixels[:, 0] - CAMERA.cx) / CAMERA.fx * 2, (pixels[:, 1] - CAMERA.cy) / CAMERA.fy * 2
    first = [(0, 1 + (k + 1) % around, 1 + k) for k in range(around)]
    rest = []
    for ring in range(rings - 1):
        inner, outer = 1 + ring * around, 1 + (ring + 1) * around
        for k in range(around):
            n = (k + 1) % around
            rest += [(inner + k, inner + n, outer + n), (inner + k, outer + n, outer + k)]
    return mesh(np.stack([x, y, np.full(len(x), 2.0)], 1), first + rest, BLACK)


@pytest.mark.parametrize("rings", [1, 12, 40])
def test_the_outline_of_a_fine_mesh_is_that_of_a_coarse_one(rings: int) -> None:
    image = brightness(draw(BACKGROUND, fine_disc(25.0, rings, 120)))
    phi = np.linspace(0, 2 * np.pi, 120, endpoint=False)
    truth = 1 - polygon_coverage(np.stack([46.7 + 25 * np.cos(phi), 35.4 + 25 * np.sin(phi)], 1))
    assert np.abs(image - truth).max() < 0.125
    assert np.abs(image - truth)[(truth > 0) & (truth < 1)].mean() < 0.02


def test_surfaces_that_cut_through_each_other_have_a_smooth_edge() -> None:
    # A black panel tilted about the vertical axis dives through the white one along the line x = 0.13 z, z = 3.
    u = 0.13 / 3.0 * 3.0 / 3.0 * CAMERA.fx + CAMERA.cx
    near = np.array([(-1.0, -3, 2.0), (1.26, -3, 4.0), (1.26, 3, 4.0), (-1.0, 3, 2.0)])
    image = brightness(draw(BACKGROUND, mesh(near, [[0, 2, 1], [0, 3, 2]], BLACK)))
    row = image[36]
    column = int(np.round(u))
    assert row[column - 2] == 0
    assert row[column + 2] == 1
    np.testing.assert_allclose(row[column - 1 : column + 2].sum(), column + 1.5 - u, atol=0.02)


def test_colours_alone_are_blended() -> None:
    corners = np.array([(20, 10), (60, 14), (56, 60), (24, 55)], float)
    images = draw(BACKGROUND, panel(corners, 2.0, BLACK))
    unseen = draw(BACKGROUND, panel(corners, 2.0, WHITE))  # no contrast, hence no blending
    assert ((images.rgb > 0) & (images.rgb < images.rgb.max())).any()
    assert len(np.unique(unseen.rgb)) == 1
    np.testing.assert_array_equal(images.depth_m, unseen.depth_m)
    np.testing.assert_array_equal(images.instance_ids, unseen.instance_ids)
    assert set(np.unique(images.instance_ids)) == {1, 9}
    assert len(np.unique(np.round(images.depth_m, 4))) == 2


def test_a_smooth_surface_goes_on_across_seams_and_ends_at_creases() -> None:
    strip = np.array([[0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 1, 1], [1, 0, 1], [1, 1, 1], [2, 0, 2], [2, 1, 2]], float)
    thing = mesh(strip, [[0, 2, 1], [1, 2, 3], [4, 5, 6], [6, 5, 7]], BLACK)
    arrays = SceneArrays.of(Scene(objects=(BACKGROUND, thing), lights=()))
    np.testing.assert_array_equal(
        arrays.neighbours, [[-1, -1, 1], [-1, 0, -1], [3, -1, -1], [-1, 4, 2], [5, -1, 3], [-1, -1, 4]]
    )
    normals = thing.surfaces[0].normals.copy()
    normals[4:] = (0.6, 0, -0.8)
    bent = replace(thing, surfaces=(replace(thing.surfaces[0], normals=normals),))
    arrays = SceneArrays.of(Scene(objects=(BACKGROUND, bent), lights=()))
    np.testing.assert_array_equal(arrays.neighbours[2:], [[3, -1, -1], [-1, -1, 2], [5, -1, -1], [-1, -1, 4]])
