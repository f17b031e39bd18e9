"""A scene as the kernels read it: all surfaces laid out in a few arrays, static objects first."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from sim.geometry import FloatArray
from sim.renderers.textures import TextureAtlas
from sim.scene import Scene, SceneObject, Surface

MAX_ACTORS = 32
"""One bit each in the coverage image."""

Float32Array = npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True, kw_only=True)
class ActorSpan:
    """Where one actor lies in the arrays of the scene (first, last + 1), and its bit of the coverage image."""

    vertices: tuple[int, int]
    bones: tuple[int, int]
    faces: tuple[int, int]
    bit: np.uint32


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SceneArrays:
    """All surfaces of a scene. What belongs to actors comes after what belongs to the static objects.

    Attributes:
        rest: (n, 3) float32 vertices at rest, metres.
        rest_normals: (n, 3) float32.
        uv: (n, 2) float32.
        bones: (n, 4) int32 rows of `palette`.
        weights: (n, 4) float32.
        palette: (B, 4, 4) float32 rest-to-world matrices of all objects, at time 0.
        faces: (m, 3) uint32.
        face_texture: (m,) int32 number of a texture in `atlas`.
        face_id: (m,) uint16 instance ids.
        neighbours: (m, 3) int32 the face across the edge opposite to each corner, where the surface goes on smoothly;
            -1 where it ends or has a crease.
        atlas: all textures.
        static_vertices: number of vertices of static objects.
        static_faces: number of faces of static objects.
        actors: by name, in the order of the scene.
    """

    rest: Float32Array
    rest_normals: Float32Array
    uv: Float32Array
    bones: npt.NDArray[np.int32]
    weights: Float32Array
    palette: Float32Array
    faces: npt.NDArray[np.uint32]
    face_texture: npt.NDArray[np.int32]
    face_id: npt.NDArray[np.uint16]
    neighbours: npt.NDArray[np.int32]
    atlas: TextureAtlas
    static_vertices: int
    static_faces: int
    actors: dict[str, ActorSpan]

    @classmethod
    def of(cls, scene: Scene) -> "SceneArrays":
        """Lay out `scene`.

        Raises:
            ValueError: too many actors, an id beyond 16 bits, or an object that does not fit its own palette.
        """
        static = [o for o in scene.objects if not o.is_actor]
        actors = [o for o in scene.objects if o.is_actor]
        if len(actors) > MAX_ACTORS:
            raise ValueError(f"scene: this renderer can tell {MAX_ACTORS} actors apart, the scene has {len(actors)}")
        images: dict[int, int] = {}  # identity of a texture array -> its number
        textures: list[npt.NDArray[np.uint8]] = []
        columns: dict[str, list[npt.NDArray[Any]]] = {
            name: []
            for name in (
                "vertices",
                "normals",
                "uv",
                "bones",
                "weights",
                "faces",
                "face_texture",
                "face_id",
                "neighbours",
            )
        }
        palettes: list[FloatArray] = []
        spans: dict[str, ActorSpan] = {}
        vertex = face = bone = static_vertices = static_faces = 0
        for obj in [*static, *actors]:
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
                columns["neighbours"].append(_smooth_neighbours(surface, face))
                vertex, face = vertex + len(surface.vertices), face + len(surface.faces)
            palettes.append(palette)
            bone += len(palette)
            if obj.is_actor:
                spans[obj.name] = ActorSpan(
                    vertices=(start[0], vertex),
                    bones=(start[1], bone),
                    faces=(start[2], face),
                    bit=np.uint32(1 << len(spans)),
                )
            else:
                static_vertices, static_faces = vertex, face

        def joined(name: str, dtype: type, width: int | None) -> npt.NDArray[Any]:
            shape = (0,) if width is None else (0, width)
            return np.concatenate([np.zeros(shape, dtype), *columns[name]]).astype(dtype)

        return cls(
            rest=joined("vertices", np.float32, 3),
            rest_normals=joined("normals", np.float32, 3),
            uv=joined("uv", np.float32, 2),
            bones=joined("bones", np.int32, 4),
            weights=joined("weights", np.float32, 4),
            palette=np.concatenate([np.zeros((0, 4, 4)), *palettes]).astype(np.float32),
            faces=joined("faces", np.uint32, 3),
            face_texture=joined("face_texture", np.int32, None),
            face_id=joined("face_id", np.uint16, None),
            neighbours=joined("neighbours", np.int32, 3),
            atlas=TextureAtlas.of(textures),
            static_vertices=static_vertices,
            static_faces=static_faces,
            actors=spans,
        )


def _skin_of(surface: Surface, obj: SceneObject, bones: int) -> tuple[npt.NDArray[np.int32], Float32Array]:
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


def _smooth_neighbours(surface: Surface, first: int) -> npt.NDArray[np.int32]:
    """Rows of `SceneArrays.neighbours` of a surface whose faces are numbered from `first`.

    Vertices with the same place and normal count as one, so that a seam of the texture is no crease.
    """
    corners = np.ascontiguousarray(np.concatenate([surface.vertices, surface.normals], axis=1)) + np.float32(0)  # no -0
    _, welded = np.unique(corners.view(np.dtype((np.void, corners.itemsize * 6))).ravel(), return_inverse=True)
    a, b, c = welded.astype(np.int64)[surface.faces.astype(np.int64)].T
    count = np.int64(len(surface.vertices) + 1)
    here = np.stack([b * count + c, c * count + a, a * count + b], axis=1).ravel()  # directed edges
    across = np.stack([c * count + b, a * count + c, b * count + a], axis=1).ravel()
    order = np.argsort(here, kind="stable")
    sorted_edges = here[order]
    low = np.searchsorted(sorted_edges, across, side="left")
    found = np.searchsorted(sorted_edges, across, side="right") - low == 1
    neighbours = np.full(len(here), -1, np.int32)
    neighbours[found] = order[low[found]] // 3 + first
    return neighbours.reshape(-1, 3)
