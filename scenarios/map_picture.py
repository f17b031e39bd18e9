"""The picture of the maps of a run: the same view of each, side by side, as in the paper's figure of maps.

A map is drawn from outside of the room, looking down into it. Its surfaces are seen from their fronts alone, so the
walls nearest to the viewer do not hide what is inside, and what is as high as the ceiling is left out.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import cv2
import numpy as np
import numpy.typing as npt

from dotmask.geometry import inverse, project, transform
from dotmask.mapping.tsdf import Mesh
from dotmask.records import FloatArray, Intrinsics
from sim.records import CameraModel, Moment
from sim.renderers.visibility_buffer import VisibilityBufferRenderer
from sim.scene import Placed, Scene, SceneObject, Surface

WIDTH, HEIGHT = 900, 700
FOCAL_PX = 1000.0
DOWN_RAD = np.deg2rad(38.0)
ASIDE_RAD = np.deg2rad(20.0)
"""The viewer looks as the camera did in the mean, turned by this and down by the other."""

SHOWN = 0.985
"""Share of the vertices that the picture is wide enough for: a few far ones must not make the rest small."""

CEILING_M = 0.2
"""So much below the top of a map its ceiling begins: noise turns some of it up."""

BACKGROUND = (250, 250, 250)
AMBIENT, OVERSAMPLING = 1.0, 2

Picture = npt.NDArray[np.uint8]


def draw_maps(maps: Mapping[str, Mesh], T_world_cameras: Sequence[FloatArray]) -> Picture:
    """All maps from one viewpoint, side by side.

    Args:
        maps: by the title to print; the last one chooses the viewpoint.
        T_world_cameras: (4, 4) poses that the last map was seen from.

    Returns:
        (HEIGHT, WIDTH per map, 3) uint8 RGB.
    """
    last = list(maps.values())[-1]
    camera = Intrinsics(width=WIDTH, height=HEIGHT, fx=FOCAL_PX, fy=FOCAL_PX, cx=(WIDTH - 1) / 2, cy=(HEIGHT - 1) / 2)
    top_m = float(np.percentile(last.vertices_m[:, 2], 99)) - CEILING_M if len(last.vertices_m) else np.inf
    T_world_viewer = viewpoint(last.vertices_m, T_world_cameras, camera)
    return np.hstack([_panel(title, _drawn(mesh, top_m, T_world_viewer)) for title, mesh in maps.items()])


def viewpoint(points_m: FloatArray, T_world_cameras: Sequence[FloatArray], camera: Intrinsics) -> FloatArray:
    """`T_world_viewer` (4, 4), far enough back for nearly all points (N, 3) to be in the image."""
    ahead = np.array([1e-9, 0.0]) + sum((pose[:2, 2] for pose in T_world_cameras), np.zeros(2))
    heading = float(np.arctan2(ahead[1], ahead[0])) + ASIDE_RAD
    forward = np.array([np.cos(DOWN_RAD) * np.cos(heading), np.cos(DOWN_RAD) * np.sin(heading), -np.sin(DOWN_RAD)])
    right = np.array([np.sin(heading), -np.cos(heading), 0.0])
    T = np.eye(4)
    T[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    if not len(points_m):
        return T
    middle = (np.percentile(points_m, 1, axis=0) + np.percentile(points_m, 99, axis=0)) / 2
    for distance_m in np.geomspace(1.0, 100.0, 60):
        T[:3, 3] = middle - distance_m * forward
        u, v = project(transform(inverse(T), points_m), camera).T
        if ((u > 0) & (u < camera.width) & (v > 0) & (v < camera.height)).mean() >= SHOWN:
            break
    return T


def _drawn(mesh: Mesh, top_m: float, T_world_viewer: FloatArray) -> Picture:
    """The mesh up to a height on a plain background, each triangle in one colour."""
    scale = OVERSAMPLING
    faces = mesh.faces[(mesh.vertices_m[:, 2] < top_m)[mesh.faces].all(axis=1)]
    if not len(faces):
        return np.full((HEIGHT, WIDTH, 3), BACKGROUND, np.uint8)
    camera = CameraModel(
        width=scale * WIDTH,
        height=scale * HEIGHT,
        fx=scale * FOCAL_PX,
        fy=scale * FOCAL_PX,
        cx=(scale * WIDTH - 1) / 2,
        cy=(scale * HEIGHT - 1) / 2,
    )
    thing = SceneObject(
        name="map",
        class_name="map",
        instance_id=1,
        surfaces=(_surface(replace(mesh, faces=faces)),),
        motion=Placed(np.eye(4)),
    )
    renderer = VisibilityBufferRenderer(Scene(objects=(thing,), lights=(), ambient=AMBIENT), camera, shadow_size=0)
    images = renderer.render(Moment(T_world_camera=T_world_viewer, palettes={}))
    rgb = np.where(images.depth_m[..., None] > 0, images.rgb, np.array(BACKGROUND, np.uint8))
    return np.asarray(cv2.resize(rgb, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA), np.uint8)


def _surface(mesh: Mesh) -> Surface:
    """The mesh for the renderer: every triangle has corners of its own, which all look at its texel."""
    count = len(mesh.faces)
    side = 1 << int(np.ceil(np.log2(max(np.sqrt(count), 1.0))))
    texture = np.zeros((side * side, 3), np.uint8)
    texture[:count] = np.rint(mesh.colours[mesh.faces].mean(axis=1))
    corners = mesh.vertices_m[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    number = np.arange(count)
    texel = np.stack([(number % side + 0.5) / side, (number // side + 0.5) / side], axis=1)
    return Surface(
        vertices=corners.reshape(-1, 3).astype(np.float32),
        normals=np.repeat(normals, 3, axis=0).astype(np.float32),
        uv=np.repeat(texel, 3, axis=0).astype(np.float32),
        faces=np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        texture=texture.reshape(side, side, 3),
    )


def _panel(title: str, picture: Picture) -> Picture:
    """With its title."""
    cv2.putText(picture, title, (16, 34), cv2.FONT_HERSHEY_SIMPLEX, 0.8, (30, 30, 30), 2, cv2.LINE_AA)
    return picture
