"""What a map should look like: the surface of all that cannot move, and how it looks from anywhere."""

from dataclasses import replace

import numpy as np
import trimesh

from dotmask.evaluation.mapping import SurfaceSamples
from dotmask.geometry import transform
from dotmask.records import DepthImage, FloatArray
from sim.records import CameraModel, Moment
from sim.renderers.visibility_buffer import VisibilityBufferRenderer
from sim.scene import Scene, SceneObject

SPACING_M = 0.02

NO_TEXTURE = np.zeros((1, 1, 3), np.uint8)


class StaticWorld:
    """A scene without its actors.

    Args:
        scene: the whole scene.
        camera: of the images.
    """

    def __init__(self, scene: Scene, camera: CameraModel) -> None:
        # Depth alone is asked for: without lights, without the memory of textures, and not by the run's own renderer.
        self._scene = Scene(objects=tuple(_plain(o) for o in scene.objects if not o.is_actor), lights=())
        self._renderer = VisibilityBufferRenderer(self._scene, camera, shadow_size=0)

    def depth_m(self, T_world_camera: FloatArray) -> DepthImage:
        """(H, W) float32 true depth from a pose (4, 4), metres, 0 = nothing hit."""
        return self._renderer.render(Moment(T_world_camera=T_world_camera, palettes={})).depth_m

    def samples(self) -> SurfaceSamples:
        """Points on all its surfaces, one for each square of SPACING_M in the mean; the same ones every time."""
        corners = [
            transform(thing.motion.palette_at(0.0)[0], surface.vertices.astype(np.float64))[surface.faces]
            for thing in self._scene.objects
            for surface in thing.surfaces
        ]
        vertices = np.concatenate(corners).reshape(-1, 3)
        whole = trimesh.Trimesh(vertices, np.arange(len(vertices)).reshape(-1, 3), process=False)
        count = max(int(whole.area / SPACING_M**2), 1)
        points, faces = trimesh.sample.sample_surface(whole, count, seed=0)
        return SurfaceSamples(
            points_m=np.asarray(points, np.float64),
            normals=np.asarray(whole.face_normals[faces], np.float64),
            spacing_m=SPACING_M,
        )


def _plain(thing: SceneObject) -> SceneObject:
    return replace(thing, surfaces=tuple(replace(surface, texture=NO_TEXTURE) for surface in thing.surfaces))
