"""What stands in the world: surfaces with textures, objects made of them, lights.

An object is rigid, or skinned by linear blend skinning. Both are posed in the same way: a palette of bone
matrices (B, 4, 4) maps rest vertices into the world; a rigid object has one bone.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from sim.geometry import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Surface:
    """A textured triangle mesh in the object's rest frame.

    Attributes:
        vertices: (n, 3) float32, metres.
        normals: (n, 3) float32, outward, unit length.
        uv: (n, 2) float32; v = 0 is the texture's first image row; repeats outside 0..1.
        faces: (m, 3) int32, counter-clockwise seen from outside.
        texture: (S, S, 3) uint8, S a power of two.
        bones: (n, 4) int32 bone indices of a skinned surface, None when rigid.
        weights: (n, 4) float32 bone weights that sum to 1, None when rigid.
    """

    vertices: npt.NDArray[np.float32]
    normals: npt.NDArray[np.float32]
    uv: npt.NDArray[np.float32]
    faces: npt.NDArray[np.int32]
    texture: npt.NDArray[np.uint8]
    bones: npt.NDArray[np.int32] | None = None
    weights: npt.NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        """Check shapes, indices and the texture's size."""
        n = len(self.vertices)
        for name, shape in (("vertices", (n, 3)), ("normals", (n, 3)), ("uv", (n, 2))):
            if getattr(self, name).shape != shape:
                raise ValueError(f"{name}: expected shape {shape}, got {getattr(self, name).shape}")
        if self.faces.ndim != 2 or self.faces.shape[1] != 3:
            raise ValueError(f"faces: expected shape (any, 3), got {self.faces.shape}")
        if len(self.faces) and not (self.faces.min() >= 0 and self.faces.max() < n):
            raise ValueError("faces: an index points at no vertex")
        size = self.texture.shape[0]
        if self.texture.shape != (size, size, 3) or size & (size - 1) or self.texture.dtype != np.uint8:
            raise ValueError("texture: must be a square uint8 RGB image with a power-of-two size")
        if (self.bones is None) != (self.weights is None):
            raise ValueError("a skinned surface needs bones and weights")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class KeypointRig:
    """The 17 COCO keypoints at rest, moved by the palette like vertices.

    Attributes:
        points: (17, 3) float64 metres, in COCO's order.
        bones: (17, 4) int32 bone indices.
        weights: (17, 4) float64, sum to 1.
    """

    points: FloatArray
    bones: npt.NDArray[np.int32]
    weights: FloatArray


class Motion(Protocol):
    """Where an object is: a pure function of time, so any frame can be rendered alone."""

    def palette_at(self, time_s: float) -> FloatArray:
        """(B, 4, 4) rest frame to world, at any time."""
        ...

    def pose_at(self, time_s: float) -> FloatArray:
        """`T_world_object` (4, 4): the object's root frame (origin on the floor under it, z up)."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """The motion of an object that never moves.

    Attributes:
        T_world_object: (4, 4).
    """

    T_world_object: FloatArray

    def palette_at(self, time_s: float) -> FloatArray:
        """(1, 4, 4)."""
        return self.T_world_object[None]

    def pose_at(self, time_s: float) -> FloatArray:
        """(4, 4)."""
        return self.T_world_object


@dataclass(frozen=True, slots=True, eq=False)
class Frozen:
    """A motion stopped at time 0.

    Attributes:
        motion: what would have moved.
    """

    motion: Motion

    def palette_at(self, time_s: float) -> FloatArray:
        """(B, 4, 4), always the same."""
        return self.motion.palette_at(0.0)

    def pose_at(self, time_s: float) -> FloatArray:
        """(4, 4), always the same."""
        return self.motion.pose_at(0.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SceneObject:
    """One thing in the world.

    Attributes:
        name: unique in the scene.
        class_name: COCO class name where there is one ("person", "chair"), else a plain word ("wall").
        instance_id: what its pixels carry; 0 for the room itself (background), else unique.
        surfaces: its parts, all posed by the one palette.
        motion: where it is over time.
        is_actor: whether it can move, hence whether its truth is stated per frame.
        keypoints: of a person.
    """

    name: str
    class_name: str
    instance_id: int
    surfaces: tuple[Surface, ...]
    motion: Motion
    is_actor: bool = False
    keypoints: KeypointRig | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Light:
    """A point light near the ceiling that casts shadows downwards.

    Attributes:
        position_world: metres.
        power: brightness of a facing white surface at distance d is `power / (1 + d²)`.
    """

    position_world: tuple[float, float, float]
    power: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """All objects and lights.

    Attributes:
        objects: names unique; instance ids unique but for the background's 0.
        lights: at most 8.
        ambient: brightness of what no light reaches, 0..1.
    """

    objects: tuple[SceneObject, ...]
    lights: tuple[Light, ...]
    ambient: float = 0.35

    def __post_init__(self) -> None:
        """Refuse two objects with one name or one id."""
        names = [o.name for o in self.objects]
        ids = [o.instance_id for o in self.objects if o.instance_id]
        if len(set(names)) != len(names) or len(set(ids)) != len(ids):
            raise ValueError("scene: two objects have the same name or instance id")

    @property
    def actors(self) -> tuple[SceneObject, ...]:
        """The objects that can move."""
        return tuple(o for o in self.objects if o.is_actor)
