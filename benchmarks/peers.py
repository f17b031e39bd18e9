"""Other renderers that draw one of our scenes as it is at time 0: same meshes, same camera."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from sim.geometry import FloatArray, inverse
from sim.people.characters import skin
from sim.records import CameraModel
from sim.scene import Scene, Surface

NEAR_M, FAR_M = 0.1, 20.0
GL_FROM_CV = np.diag([1.0, -1.0, -1.0, 1.0])
GL_PACKAGES = "libegl1 libgl1 libxrender1"


class PeerMissingError(Exception):
    """A peer cannot run here; the message says what to install."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _PosedMesh:
    """A surface in the world, and the number of its object."""

    number: int
    vertices: FloatArray
    surface: Surface


def _posed(scene: Scene) -> Iterator[_PosedMesh]:
    for number, thing in enumerate(scene.objects):
        palette = thing.motion.palette_at(0.0)
        for surface in thing.surfaces:
            n = len(surface.vertices)
            bones = surface.bones if surface.bones is not None else np.zeros((n, 1), np.int32)
            weights = surface.weights if surface.weights is not None else np.ones((n, 1), np.float32)
            yield _PosedMesh(number=number, vertices=skin(surface.vertices, bones, weights, palette), surface=surface)


class TinyRenderer:
    """pybullet's software renderer: no textures, no shadows."""

    name = "pybullet TinyRenderer, no shadows"

    def __init__(self, scene: Scene, camera: CameraModel) -> None:
        import pybullet

        self._bullet, self._camera = pybullet, camera
        self._client = pybullet.connect(pybullet.DIRECT)
        for mesh in _posed(scene):
            shape = pybullet.createVisualShape(
                pybullet.GEOM_MESH,
                vertices=mesh.vertices.tolist(),
                indices=mesh.surface.faces.ravel().tolist(),
                physicsClientId=self._client,
            )
            pybullet.createMultiBody(baseVisualShapeIndex=shape, physicsClientId=self._client)
        depth_row = [0, 0, -(FAR_M + NEAR_M) / (FAR_M - NEAR_M), -2 * FAR_M * NEAR_M / (FAR_M - NEAR_M)]
        rows = [
            [2 * camera.fx / camera.width, 0, 1 - 2 * (camera.cx + 0.5) / camera.width, 0],
            [0, 2 * camera.fy / camera.height, 2 * (camera.cy + 0.5) / camera.height - 1, 0],
            depth_row,
            [0, 0, -1, 0],
        ]
        self._projection = list(np.array(rows).T.ravel())

    def draw(self, T_world_camera: FloatArray) -> None:
        """Draw one frame."""
        view = GL_FROM_CV @ inverse(T_world_camera)
        self._bullet.getCameraImage(
            self._camera.width,
            self._camera.height,
            list(view.T.ravel()),
            self._projection,
            renderer=self._bullet.ER_TINY_RENDERER,
            shadow=0,
            physicsClientId=self._client,
        )


class Pyrender:
    """pyrender as installed, with its 4 samples per pixel: a pass for colour and depth, one for ids; no shadows."""

    name = "pyrender as installed, no shadows"

    def __init__(self, scene: Scene, camera: CameraModel) -> None:
        os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
        vars(np).setdefault("infty", np.inf)  # pyrender 0.1.45 asks for numpy 1's name
        try:
            import pyrender
        except ModuleNotFoundError as error:
            raise PeerMissingError("pip install pyrender") from error
        except (ImportError, OSError, AttributeError) as error:
            raise PeerMissingError(f"apt-get install {GL_PACKAGES}") from error
        self._pyrender = pyrender
        self._scene = pyrender.Scene(ambient_light=[scene.ambient] * 3, bg_color=[0.0, 0.0, 0.0])
        self._ids: dict[Any, tuple[int, int, int]] = {}
        for mesh in _posed(scene):
            node = self._scene.add(self._mesh(mesh.vertices, mesh.surface))
            self._ids[node] = (mesh.number + 1, 0, 0)
        for light in scene.lights:
            pose = np.eye(4)
            pose[:3, 3] = light.position_world
            self._scene.add(pyrender.PointLight(intensity=light.power), pose=pose)
        lens = pyrender.IntrinsicsCamera(
            camera.fx, camera.fy, camera.cx + 0.5, camera.cy + 0.5, znear=NEAR_M, zfar=FAR_M
        )
        self._camera_node = self._scene.add(lens)
        try:
            self._renderer = pyrender.OffscreenRenderer(camera.width, camera.height)
        except (ImportError, OSError, AttributeError, RuntimeError) as error:
            raise PeerMissingError(f"apt-get install {GL_PACKAGES}") from error

    def draw(self, T_world_camera: FloatArray) -> None:
        """Draw one frame."""
        self._scene.set_pose(self._camera_node, T_world_camera @ GL_FROM_CV)
        self._renderer.render(self._scene)
        self._renderer.render(self._scene, flags=self._pyrender.RenderFlags.SEG, seg_node_map=self._ids)

    def _mesh(self, vertices: FloatArray, surface: Surface) -> Any:
        texture = self._pyrender.Texture(source=surface.texture, source_channels="RGB")
        material = self._pyrender.MetallicRoughnessMaterial(
            baseColorTexture=texture, metallicFactor=0.0, roughnessFactor=1.0
        )
        corners: npt.NDArray[np.int32] = surface.faces
        primitive = self._pyrender.Primitive(
            positions=vertices.astype(np.float32),
            normals=surface.normals,
            texcoord_0=surface.uv,
            indices=corners,
            material=material,
        )
        return self._pyrender.Mesh(primitives=[primitive])
