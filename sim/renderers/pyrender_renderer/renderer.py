"""The second renderer: pyrender on OpenGL.

Projection, rasterisation, depth test, texture filtering and anti-aliasing are OpenGL's, so where the two renderers
agree, neither is likely to be wrong. Same front faces, lights and shadows as the default renderer. It gives no flow.

The bytes are the same in every run on one machine and driver, and not on another: use the default renderer where bytes
matter.
"""

import weakref
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sim.errors import SimError
from sim.geometry import FloatArray
from sim.records import CameraModel, Moment, RenderedImages
from sim.renderers.pyrender_renderer.gl_context import choose_platform, gl_context
from sim.scene import Scene, SceneObject, Surface

choose_platform()  # before pyrender is imported: PyOpenGL settles on a platform with its import

import pyrender  # noqa: E402

from sim.renderers.pyrender_renderer.gl_renderer import CeilingLight, OrderedScene, TruthRenderer  # noqa: E402

NEAR_M, FAR_M = 0.05, 100.0
"""What is closer to the camera or farther from it (z, metres) is not drawn."""

GL_FROM_CV = np.diag([1.0, -1.0, -1.0, 1.0])
"""Camera axes: OpenGL's y points up, and it looks along -z."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _PosedSurface:
    """A surface in the world: `positions` and `normals` (n, 3), and the id that its pixels carry."""

    surface: Surface
    instance_id: int
    positions: FloatArray
    normals: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Nodes:
    """The same surfaces twice: textured for the colour, solid for shadows, depth and ids."""

    textured: pyrender.Node
    solid: pyrender.Node


class PyrenderRenderer:
    """Draws one scene with one camera model, on the CPU or a GPU, whichever OpenGL finds.

    Args:
        scene: objects that are no actors are posed once, at time 0.
        camera: intrinsics, exposure, and size of the images.

    Raises:
        RendererMissingError: no OpenGL library; the message says what to install.
        ValueError: an instance id does not fit into 16 bits.
    """

    def __init__(self, scene: Scene, camera: CameraModel) -> None:
        self._context = gl_context()
        self._actors = {actor.name: actor for actor in scene.actors}
        self._bones = {actor.name: len(actor.motion.palette_at(0.0)) for actor in scene.actors}
        self._posed: Moment | None = None
        self._rendered: Moment | None = None
        for obj in scene.objects:
            if not 0 <= obj.instance_id <= np.iinfo(np.uint16).max:
                raise ValueError(f"{obj.name}: instance id {obj.instance_id} does not fit into 16 bits")

        gain = 2.0**camera.exposure_ev
        self._scene = OrderedScene(ambient_light=[gain * scene.ambient] * 3, bg_color=[0.0, 0.0, 0.0, 1.0])
        # OpenGL's centre of pixel (0, 0) is (0.5, 0.5).
        lens = pyrender.IntrinsicsCamera(camera.fx, camera.fy, camera.cx + 0.5, camera.cy + 0.5, NEAR_M, FAR_M)
        self._camera_node = self._scene.add(lens)
        for number, light in enumerate(scene.lights):
            T_world_light = np.eye(4)  # OpenGL looks along -z: straight down
            T_world_light[:3, 3] = light.position_world
            self._scene.add(CeilingLight(intensity=gain * light.power), name=f"light {number}", pose=T_world_light)

        self._materials: dict[int, pyrender.Material] = {}
        room = [
            surface for obj in scene.objects if not obj.is_actor for surface in _posed(obj, obj.motion.palette_at(0.0))
        ]
        self._room_nodes = self._add_nodes(room)
        self._actor_nodes = {a.name: self._add_nodes(_posed(a, a.motion.palette_at(0.0))) for a in scene.actors}
        self._gl = TruthRenderer(camera.width, camera.height)
        weakref.finalize(self, self._context.discard, self._gl)

    def render(self, moment: Moment, *, normals: bool = False, flow_to: Moment | None = None) -> RenderedImages:
        """Images of one moment. The arrays belong to the caller.

        Args:
            moment: where the camera and every actor are.
            normals: whether to give the normals of the flat triangles as well.
            flow_to: refused.

        Raises:
            SimError: flow is asked for.
            ValueError: an actor has no palette, a name is no actor's, or a shape is not as expected.
        """
        if flow_to is not None:
            raise SimError("the renderer pyrender gives no flow: use the renderer numba for it")
        rgb = self._colour(moment)
        with self._context.current():
            solid = [nodes.solid for nodes in self._all_nodes()]
            truth, normals_camera = self._gl.truth(self._scene, solid, normals=normals)
        self._rendered = moment
        return RenderedImages(
            rgb=rgb,
            depth_m=np.ascontiguousarray(truth[..., 1]),
            instance_ids=np.rint(truth[..., 0]).astype(np.uint16),
            normals_camera=None if normals_camera is None else np.ascontiguousarray(normals_camera),
        )

    def render_colour(self, moment: Moment, rows: tuple[int, int]) -> npt.NDArray[np.uint8]:
        """The rows first..last-1 of `render(moment).rgb` alone, (last - first, W, 3). All rows are drawn, and cut.

        Raises:
            ValueError: as `render`, or the image has no such rows.
        """
        height = self._gl.viewport_height
        if not 0 <= rows[0] < rows[1] <= height:
            raise ValueError(f"rows: expected 0 <= first < last <= {height}, got {rows}")
        return self._colour(moment)[rows[0] : rows[1]]

    def unoccluded_pixels(self, name: str) -> int:
        """Pixels inside the image that an actor of the last `render` would cover if it were alone: it is drawn alone.

        Raises:
            ValueError: no actor has this name, or nothing was rendered yet.
        """
        if name not in self._actors:
            raise ValueError(f"{name!r} is no actor of the scene; the actors are {sorted(self._actors)}")
        if self._rendered is None:
            raise ValueError("unoccluded_pixels: render a frame first")
        self._pose(self._rendered)
        with self._context.current():
            truth, _ = self._gl.truth(self._scene, [self._actor_nodes[name].solid], normals=False)
        return int(np.count_nonzero(truth[..., 1]))

    def _colour(self, moment: Moment) -> npt.NDArray[np.uint8]:
        self._pose(moment)
        nodes = self._all_nodes()
        with self._context.current():
            image = self._gl.colour(self._scene, [n.textured for n in nodes], [n.solid for n in nodes])
        return image.copy()

    def _all_nodes(self) -> list[_Nodes]:
        return [self._room_nodes, *self._actor_nodes.values()]

    def _pose(self, moment: Moment) -> None:
        """Put the camera and the actors where they are at a moment."""
        if moment is self._posed:
            return
        palettes = moment.palettes
        if palettes.keys() != self._actors.keys():
            missing = sorted(self._actors.keys() - palettes.keys())
            unknown = sorted(palettes.keys() - self._actors.keys())
            raise ValueError(f"palettes: every actor needs one and nothing else; missing {missing}, unknown {unknown}")
        for name, bones in self._bones.items():
            if palettes[name].shape != (bones, 4, 4):
                raise ValueError(f"{name}: expected a palette ({bones}, 4, 4), got {palettes[name].shape}")
        self._posed = None
        for name, actor in self._actors.items():
            surfaces, nodes = _posed(actor, palettes[name]), self._actor_nodes[name]
            nodes.textured.mesh, nodes.solid.mesh = self._textured_mesh(surfaces), _solid_mesh(surfaces)
        self._scene.set_pose(self._camera_node, moment.T_world_camera @ GL_FROM_CV)
        self._posed = moment

    def _add_nodes(self, surfaces: Sequence[_PosedSurface]) -> _Nodes:
        return _Nodes(
            textured=self._scene.add(self._textured_mesh(surfaces)), solid=self._scene.add(_solid_mesh(surfaces))
        )

    def _textured_mesh(self, surfaces: Sequence[_PosedSurface]) -> pyrender.Mesh:
        """What is drawn in colour: one primitive per texture."""
        by_texture: dict[int, list[_PosedSurface]] = {}
        for posed in surfaces:
            by_texture.setdefault(id(posed.surface.texture), []).append(posed)
        return pyrender.Mesh(
            [
                pyrender.Primitive(
                    positions=np.concatenate([p.positions for p in parts]),
                    normals=np.concatenate([p.normals for p in parts]),
                    texcoord_0=np.concatenate([p.surface.uv for p in parts]),
                    indices=_joined_faces(parts),
                    material=self._material(parts[0].surface),
                )
                for parts in by_texture.values()
            ]
        )

    def _material(self, surface: Surface) -> pyrender.Material:
        key = id(surface.texture)  # alive as long as the scene is
        if key not in self._materials:
            opaque = np.full((*surface.texture.shape[:2], 1), 255, np.uint8)
            # pyrender turns images upside down for OpenGL, whose first row is v = 0, as it is of a Surface.
            image = np.concatenate([surface.texture, opaque], axis=2)[::-1]
            texture = pyrender.Texture(source=image, source_channels="RGBA")
            self._materials[key] = pyrender.MetallicRoughnessMaterial(baseColorTexture=texture, doubleSided=False)
        return self._materials[key]


def _posed(obj: SceneObject, palette: FloatArray) -> list[_PosedSurface]:
    """The surfaces of an object in the world, by linear blend skinning."""
    posed = []
    for surface in obj.surfaces:
        if surface.bones is None or surface.weights is None:
            R, t = palette[0, :3, :3], palette[0, :3, 3]
            positions = np.einsum("ij,nj->ni", R, surface.vertices) + t
            normals = np.einsum("ij,nj->ni", R, surface.normals)
        else:
            blended = (surface.weights[:, :, None, None] * palette[surface.bones, :3, :]).sum(axis=1)
            positions = np.einsum("nij,nj->ni", blended[:, :, :3], surface.vertices) + blended[:, :, 3]
            normals = np.einsum("nij,nj->ni", blended[:, :, :3], surface.normals)
        posed.append(_PosedSurface(surface=surface, instance_id=obj.instance_id, positions=positions, normals=normals))
    return posed


def _solid_mesh(surfaces: Sequence[_PosedSurface]) -> pyrender.Mesh:
    """What the lights and the truth see: all in one primitive, whose texture coordinates are the instance ids."""
    if not surfaces:
        return pyrender.Mesh([])
    ids = [np.tile(np.array([p.instance_id, 0], np.float32), (len(p.positions), 1)) for p in surfaces]
    positions = np.concatenate([p.positions for p in surfaces])
    return pyrender.Mesh(
        [pyrender.Primitive(positions=positions, texcoord_0=np.concatenate(ids), indices=_joined_faces(surfaces))]
    )


def _joined_faces(surfaces: Sequence[_PosedSurface]) -> npt.NDArray[np.int64]:
    firsts = np.cumsum([0, *(len(p.positions) for p in surfaces[:-1])])
    return np.concatenate([p.surface.faces + first for p, first in zip(surfaces, firsts, strict=True)])
