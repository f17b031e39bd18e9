"""The people: dressed, skinned meshes with a skeleton, read from the assets.

Body frame: metres, z up, facing -y, +x is the person's left, the soles stand on z = 0. At rest the arms hang
obliquely away from the body and the legs stand slightly apart.
"""

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from sim.assets import load_npz
from sim.errors import AssetError
from sim.geometry import FloatArray
from sim.people.skeleton import Skeleton
from sim.scene import KeypointRig, Surface

CHARACTERS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "man": ("plaid", "green"),
        "woman": ("stripes", "blouse"),
        "tall_man": ("oxford", "sweater"),
        "short_woman": ("gingham", "dots"),
    }
)
"""The outfits of each character; the first is the default one."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Character:
    """A dressed person at rest in the body frame.

    Attributes:
        name: key of CHARACTERS.
        outfit: one of the outfits of CHARACTERS[name].
        skeleton: its bones.
        surfaces: its parts, all skinned by the skeleton's bones.
        surface_names: what each surface is: "skin", "eyes", "hair", "shirt", "trousers", "shoes" ...
        soles: for each surface the indices (k,) int32 of the vertices that can touch the floor; empty but for shoes.
        keypoints: the 17 of COCO: the tip of the nose, the pupils, the ear holes, and the joints of the skeleton.
        height_m: from the soles to the top of the hair.
    """

    name: str
    outfit: str
    skeleton: Skeleton
    surfaces: tuple[Surface, ...]
    surface_names: tuple[str, ...]
    soles: tuple[npt.NDArray[np.int32], ...]
    keypoints: KeypointRig
    height_m: float

    def surface(self, name: str) -> Surface:
        """The part called `name`.

        Raises:
            KeyError: no part has this name.
        """
        if name not in self.surface_names:
            raise KeyError(f"{self.name} has no part {name!r}, only {', '.join(self.surface_names)}")
        return self.surfaces[self.surface_names.index(name)]


def load_character(name: str, outfit: str | None = None) -> Character:
    """The character `name` in `outfit` (default: its first). Kept per process; its arrays are read-only.

    Raises:
        AssetError: no such character or outfit, or the file is missing or damaged.
    """
    if name not in CHARACTERS:
        raise AssetError(f"no character named {name!r}; choose one of {', '.join(CHARACTERS)}")
    outfits = CHARACTERS[name]
    if outfit is None:
        outfit = outfits[0]
    if outfit not in outfits:
        raise AssetError(f"{name} has no outfit {outfit!r}; choose one of {', '.join(outfits)}")
    return _load(name, outfit)


def skin(
    vertices: npt.NDArray[np.floating[Any]],
    bones: npt.NDArray[np.int32],
    weights: npt.NDArray[np.float32],
    palette: FloatArray,
) -> FloatArray:
    """Posed vertices (n, 3) by linear blend skinning.

    Args:
        vertices: (n, 3) rest positions.
        bones: (n, 4) indices into the palette.
        weights: (n, 4) that sum to 1.
        palette: (B, 4, 4) rest frame to posed frame.
    """
    posed = np.zeros((len(vertices), 3))
    points = np.asarray(vertices, float)
    for k in range(bones.shape[1]):
        matrix = palette[bones[:, k], :3]
        moved = (matrix[:, :, :3] * points[:, None, :]).sum(2) + matrix[:, :, 3]
        posed += weights[:, k, None].astype(float) * moved
    return posed


@functools.cache
def _arrays(name: str) -> dict[str, npt.NDArray[Any]]:
    return load_npz(f"humans/{name}.npz")


@functools.cache
def _load(name: str, outfit: str) -> Character:
    data = _arrays(name)
    try:
        skeleton = Skeleton(
            names=tuple(str(n) for n in data["bone_names"]),
            parents=tuple(int(p) for p in data["parents"]),
            heads=_frozen(data["heads"].astype(np.float64)),
        )
        keypoints = KeypointRig(
            points=_frozen(data["keypoint_points"].astype(np.float64)),
            bones=_frozen(data["keypoint_bones"].astype(np.int32)),
            weights=_frozen(data["keypoint_weights"].astype(np.float64)),
        )
        surfaces, names, soles = [], [], []
        for part in (str(p) for p in data["parts"]):
            key = f"texture_{part}_{outfit}"
            encoded = data.get(key, data.get(f"texture_{part}"))
            if encoded is None:  # a part of another outfit
                continue
            names.append(part)
            surfaces.append(_surface(data, part, encoded))
            soles.append(_frozen(data[f"soles_{part}"].astype(np.int32)))
    except (KeyError, ValueError, cv2.error) as error:
        raise AssetError(f"humans/{name}.npz does not hold a character ({error}): bake it again") from error
    top = max(float(s.vertices[:, 2].max()) for s in surfaces)
    return Character(
        name=name,
        outfit=outfit,
        skeleton=skeleton,
        surfaces=tuple(surfaces),
        surface_names=tuple(names),
        soles=tuple(soles),
        keypoints=keypoints,
        height_m=top,
    )


def _surface(data: dict[str, npt.NDArray[Any]], part: str, encoded: npt.NDArray[np.uint8]) -> Surface:
    image = cv2.imdecode(encoded, cv2.IMREAD_COLOR)
    if image is None:
        raise ValueError(f"the texture of {part} cannot be decoded")
    normals = data[f"normals_{part}"].astype(np.float64)
    normals /= np.sqrt((normals**2).sum(1, keepdims=True))
    # Stored as 255ths that sum to 255. As 256ths, with the one missing given to the first, they sum to 1 exactly.
    weights = data[f"weights_{part}"].astype(np.float32)
    weights[:, 0] += 1
    weights /= 256
    return Surface(
        vertices=_frozen(data[f"vertices_{part}"].astype(np.float32)),
        normals=_frozen(normals.astype(np.float32)),
        uv=_frozen(data[f"uv_{part}"].astype(np.float32)),
        faces=_frozen(data[f"faces_{part}"].astype(np.int32)),
        texture=_frozen(np.ascontiguousarray(image[..., ::-1])),
        bones=_frozen(data[f"bones_{part}"].astype(np.int32)),
        weights=_frozen(weights),
    )


def _frozen(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    array.flags.writeable = False
    return array
