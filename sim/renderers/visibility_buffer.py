"""The default renderer: a software rasteriser with a visibility buffer, on the CPU.

Pass 1 finds the nearest triangle of every pixel (Burns and Hunt, "The visibility buffer: a cache-friendly approach to
deferred shading", JCGT 2013). Pass 2 visits each pixel once and writes colour, depth and instance id together, so the
three images cannot disagree. Shadow maps are pass 1 with a light as the camera; their static part is drawn once.

The bytes depend on the scene, the camera and the poses alone, not on the number of threads.
"""

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from sim.geometry import FloatArray
from sim.records import CameraModel, RenderedImages
from sim.renderers import kernels, shading_kernels
from sim.renderers.shadows import ShadowMaps, project, screen_box, simplified
from sim.renderers.textures import TextureAtlas
from sim.scene import Scene, SceneObject, Surface

NEAR_M = 0.05
"""What is closer to the camera (z, metres) is not drawn."""

MAX_ACTORS = 32
"""One bit each in the coverage image."""

_Float32Array = npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Part:
    """Where one actor lies in the arrays of the scene (first, last + 1), and its bit of the coverage image."""

    vertices: tuple[int, int]
    bones: tuple[int, int]
    faces: tuple[int, int]
    bit: np.uint32


class VisibilityBufferRenderer:
    """Draws one scene with one camera model.

    Front faces only (counter-clockwise seen from outside); a single-sided panel shows from its front. Textures repeat,
    with bilinear filtering inside a mip level and a blend between levels. Diffuse point lights with soft shadows, and
    an ambient light that is stronger from above.

    Args:
        scene: objects that are no actors are posed once, at time 0.
        camera: intrinsics and size of the images.
        threads: bands of rows that are drawn at the same time.
        shadow_size: side of each light's shadow map in pixels, 0 = no shadows.

    Raises:
        ValueError: an argument is out of its range, or an object does not fit its own palette.
    """

    def __init__(self, scene: Scene, camera: CameraModel, threads: int = 1, shadow_size: int = 1024) -> None:
        if threads < 1 or shadow_size < 0:
            raise ValueError(f"threads must be at least 1 and shadow_size at least 0, got {threads} and {shadow_size}")
        if camera.width < 1 or camera.height < 1 or not (camera.fx > 0 and camera.fy > 0):
            raise ValueError(f"camera: needs a positive size and positive focal lengths, got {camera}")
        self._camera_model = camera
        self._threads = threads
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None
        self._build(scene)
        shape = (camera.height, camera.width)
        self._inverse_depth = np.zeros(shape, np.float32)
        self._triangles = np.full(shape, -1, np.int32)
        self._coverage = np.zeros(shape, np.uint32)
        self._rendered = False
        self._ambient = np.float32(scene.ambient)
        self._lights = np.array([(*light.position_world, light.power) for light in scene.lights], np.float32)
        self._lights = self._lights.reshape(-1, 4)
        self._shadows = ShadowMaps(self._lights, shadow_size, self._in_bands)
        self._build_shadow_casters()

    def render(self, T_world_camera: FloatArray, palettes: Mapping[str, FloatArray]) -> RenderedImages:
        """Images of one moment. The arrays belong to the caller.

        Args:
            T_world_camera: (4, 4) rigid, OpenCV axes.
            palettes: the (B, 4, 4) rest-to-world matrices of every actor, by name.

        Raises:
            ValueError: an actor has no palette, a name is no actor's, or a shape is not as expected.
        """
        self._pose_actors(palettes)
        camera = self._camera_model
        lens = float(camera.fx), float(camera.fy), float(camera.cx), float(camera.cy)
        project(self._attributes, np.asarray(T_world_camera, np.float64), lens, NEAR_M, self._camera)
        T32 = np.ascontiguousarray(T_world_camera[:3], np.float32)
        self._shadows.draw(self._attributes[self._caster_vertices], self._caster_faces)
        shape = (camera.height, camera.width)
        rgb, depth_m = np.empty((*shape, 3), np.uint8), np.empty(shape, np.float32)
        ids = np.empty(shape, np.uint16)
        boxes = [screen_box(self._camera[slice(*a.vertices)], NEAR_M, *shape[::-1]) for a in self._actors.values()]
        parts = [((0, self._static_faces), (0, camera.height), np.uint32(0))]
        parts += [(a.faces, box[:2], a.bit) for a, box in zip(self._actors.values(), boxes, strict=True) if any(box)]

        def draw(first: int, last: int) -> None:
            self._inverse_depth[first:last] = 0
            self._triangles[first:last] = -1
            self._coverage[first:last] = 0
            for (face_first, face_last), (top, bottom), bit in parts:
                kernels.rasterise(
                    self._camera,
                    self._faces,
                    face_first,
                    face_last,
                    *lens,
                    max(first, top),
                    min(last, bottom),
                    NEAR_M,
                    self._inverse_depth,
                    self._triangles,
                    self._coverage,
                    bit,
                )
            shading_kernels.shade(
                self._camera,
                self._attributes,
                self._faces,
                self._face_texture,
                self._face_id,
                self._atlas.texels,
                self._atlas.offsets,
                self._atlas.sizes,
                *lens,
                T32,
                first,
                last,
                self._inverse_depth,
                self._triangles,
                self._lights,
                self._ambient,
                self._shadows.maps,
                rgb,
                depth_m,
                ids,
            )

        self._in_bands(draw, camera.height)
        self._rendered = True
        return RenderedImages(rgb=rgb, depth_m=depth_m, instance_ids=ids)

    def unoccluded_pixels(self, name: str) -> int:
        """Pixels inside the image that an actor of the last frame would cover if it were alone.

        Raises:
            ValueError: no actor has this name, or nothing was rendered yet.
        """
        if name not in self._actors:
            raise ValueError(f"{name!r} is no actor of the scene; the actors are {sorted(self._actors)}")
        if not self._rendered:
            raise ValueError("unoccluded_pixels: render a frame first")
        return int(np.count_nonzero(self._coverage & self._actors[name].bit))

    def _build(self, scene: Scene) -> None:
        """Lay all surfaces out in arrays, static objects first, and pose the static ones."""
        static = [o for o in scene.objects if not o.is_actor]
        actors = [o for o in scene.objects if o.is_actor]
        if len(actors) > MAX_ACTORS:
            raise ValueError(f"scene: this renderer can tell {MAX_ACTORS} actors apart, the scene has {len(actors)}")
        images: dict[int, int] = {}  # identity of a texture array -> its number
        textures: list[npt.NDArray[np.uint8]] = []
        columns: dict[str, list[npt.NDArray[Any]]] = {
            name: [] for name in ("vertices", "normals", "uv", "bones", "weights", "faces", "face_texture", "face_id")
        }
        palettes: list[FloatArray] = []
        self._actors: dict[str, _Part] = {}
        vertex = face = bone = 0
        for number, obj in enumerate([*static, *actors]):
            if number == len(static):
                self._static_vertices, self._static_faces = vertex, face
            if not 0 <= obj.instance_id <= np.iinfo(np.uint16).max:
                raise ValueError(f"{obj.name}: instance id {obj.instance_id} does not fit into 16 bits")
            palette = obj.motion.palette_at(0.0)
            start = vertex, bone, face
            for surface in obj.surfaces:
                bones, weights = _skin_of(surface, obj, len(palette))
                texture = images.setdefault(id(surface.texture), len(textures))
                if texture == len(textures):
                    textures.append(surface.texture)
                columns["vertices"].append(surface.vertices)
                columns["normals"].append(surface.normals)
                columns["uv"].append(surface.uv)
                columns["bones"].append(bones + bone)
                columns["weights"].append(weights)
                columns["faces"].append(surface.faces + vertex)
                columns["face_texture"].append(np.full(len(surface.faces), texture))
                columns["face_id"].append(np.full(len(surface.faces), obj.instance_id))
                vertex, face = vertex + len(surface.vertices), face + len(surface.faces)
            palettes.append(palette)
            bone += len(palette)
            if obj.is_actor:
                self._actors[obj.name] = _Part(
                    vertices=(start[0], vertex),
                    bones=(start[1], bone),
                    faces=(start[2], face),
                    bit=np.uint32(1 << len(self._actors)),
                )
        if not actors:
            self._static_vertices, self._static_faces = vertex, face

        def joined(name: str, dtype: type, width: int | None) -> npt.NDArray[Any]:
            shape = (0,) if width is None else (0, width)
            return np.concatenate([np.zeros(shape, dtype), *columns[name]]).astype(dtype)

        self._rest = joined("vertices", np.float32, 3)
        self._rest_normals = joined("normals", np.float32, 3)
        self._bones, self._weights = joined("bones", np.int32, 4), joined("weights", np.float32, 4)
        self._faces = joined("faces", np.uint32, 3)
        self._face_texture, self._face_id = joined("face_texture", np.int32, None), joined("face_id", np.uint16, None)
        self._atlas = TextureAtlas.of(textures)
        self._palette = np.concatenate([np.zeros((0, 4, 4)), *palettes]).astype(np.float32)
        self._attributes = np.zeros((vertex, 8), np.float32)
        self._attributes[:, 6:] = joined("uv", np.float32, 2)
        self._camera = np.zeros((vertex, 6), np.float32)  # x, y, z, u, v, 1/z
        self._pose(0, vertex)

    def _build_shadow_casters(self) -> None:
        """Draw the static shadows, and simplify the actors for theirs."""
        first = self._static_vertices
        self._shadows.draw_static(self._attributes[:first], self._faces[: self._static_faces])
        groups = np.zeros(len(self._rest) - first, np.int32)
        for number, actor in enumerate(self._actors.values()):
            groups[actor.vertices[0] - first : actor.vertices[1] - first] = number
        faces = self._faces[self._static_faces :] - np.uint32(first)
        kept, self._caster_faces = simplified(self._rest[first:], faces, groups)
        self._caster_vertices = kept + first

    def _pose(self, first: int, last: int) -> None:
        kernels.pose_vertices(
            self._rest, self._rest_normals, self._bones, self._weights, self._palette, first, last, self._attributes
        )

    def _pose_actors(self, palettes: Mapping[str, FloatArray]) -> None:
        if palettes.keys() != self._actors.keys():
            missing = sorted(self._actors.keys() - palettes.keys())
            unknown = sorted(palettes.keys() - self._actors.keys())
            raise ValueError(f"palettes: every actor needs one and nothing else; missing {missing}, unknown {unknown}")
        for name, part in self._actors.items():
            first, last = part.bones
            if palettes[name].shape != (last - first, 4, 4):
                raise ValueError(f"{name}: expected a palette ({last - first}, 4, 4), got {palettes[name].shape}")
            self._palette[first:last] = palettes[name]
        self._pose(self._static_vertices, len(self._rest))

    def _in_bands(self, draw: Callable[[int, int], None], height: int) -> None:
        """Call `draw(first_row, last_row)` on bands of rows. The kernels release the GIL."""
        if self._pool is None:
            draw(0, height)
            return
        edges = [height * n // self._threads for n in range(self._threads + 1)]
        list(self._pool.map(draw, edges[:-1], edges[1:]))


def _skin_of(surface: Surface, obj: SceneObject, bones: int) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.float32]]:
    """Bone indices and weights (n, 4) of a surface; a rigid one follows the first bone.

    Raises:
        ValueError: the surface names a bone that the object's palette does not have.
    """
    if surface.bones is None or surface.weights is None:
        weights = np.zeros((len(surface.vertices), 4), np.float32)
        weights[:, 0] = 1
        return np.zeros((len(surface.vertices), 4), np.int32), weights
    if surface.bones.size and not (surface.bones.min() >= 0 and surface.bones.max() < bones):
        raise ValueError(f"{obj.name}: a vertex names a bone that its palette of {bones} does not have")
    return surface.bones, surface.weights
