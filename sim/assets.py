"""The committed data files, and the manifest that says where each comes from and what its bytes are.

They lie beside the package: in `assets/` of a checkout, in `dotmask_assets/` of a wheel.
"""

import difflib
import functools
import hashlib
import json
import zipfile
from dataclasses import dataclass
from enum import Enum
from pathlib import Path, PurePosixPath
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from sim.errors import AssetError

MANIFEST = "manifest.json"


class AssetState(Enum):
    """What `verify_assets` found."""

    OK = "ok"
    MISSING = "missing"
    DAMAGED = "damaged"


@dataclass(frozen=True, slots=True, kw_only=True)
class AssetRecord:
    """One entry of the manifest.

    Attributes:
        name: path below the asset root, with forward slashes.
        source: package and version that it was made from, or "made by" a tool of this project.
        licence: SPDX identifier.
        sha256: of the file, hexadecimal.
        size_bytes: of the file.
        changes: what was done to the source.
    """

    name: str
    source: str
    licence: str
    sha256: str
    size_bytes: int
    changes: str


def asset_root() -> Path:
    """The folder of the assets: `assets/` beside the package when it holds a manifest, else `dotmask_assets/`.

    Raises:
        AssetError: neither holds a manifest.
    """
    beside = Path(__file__).resolve().parents[1]
    candidates = (beside / "assets", beside / "dotmask_assets")
    for folder in candidates:
        if (folder / MANIFEST).is_file():
            return folder
    raise AssetError(
        f"no asset manifest in {candidates[0]} or {candidates[1]}: reinstall the package, or restore the checkout"
    )


@functools.cache
def _read_manifest(path: Path, _stamp: tuple[int, int]) -> MappingProxyType[str, AssetRecord]:
    try:
        files: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))["files"]
        records = {
            name: AssetRecord(
                name=name,
                source=entry["source"],
                licence=entry["licence"],
                sha256=entry["sha256"],
                size_bytes=entry["bytes"],
                changes=entry["changes"],
            )
            for name, entry in sorted(files.items())
        }
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise AssetError(f"the asset manifest {path} cannot be read ({error!r}): restore it or reinstall") from error
    return MappingProxyType(records)


def manifest() -> MappingProxyType[str, AssetRecord]:
    """Every asset of the manifest by name, sorted.

    Raises:
        AssetError: no manifest, or it cannot be read.
    """
    path = asset_root() / MANIFEST
    stat = path.stat()
    return _read_manifest(path, (stat.st_mtime_ns, stat.st_size))


def asset_path(name: str) -> Path:
    """The file of the asset `name`, for example "humans/man.npz".

    Raises:
        AssetError: `name` leaves the asset folder, is not in the manifest, or its file is missing.
    """
    relative = PurePosixPath(name)
    if not name or relative.is_absolute() or ".." in relative.parts or "\\" in name or ":" in name:
        raise AssetError(f"asset name {name!r}: must be a path below the asset folder, such as 'humans/man.npz'")
    known = manifest()
    if name not in known:
        near = difflib.get_close_matches(name, known, n=3, cutoff=0.5)
        hint = f"did you mean {' or '.join(near)}?" if near else f"known: {', '.join(known) or 'none'}"
        raise AssetError(f"no asset named {name!r}; {hint}")
    path = asset_root() / relative
    if not path.is_file():
        raise AssetError(f"asset {name!r} is missing at {path}: restore the checkout or reinstall")
    return path


def verify_assets() -> dict[str, AssetState]:
    """Compare every file with the manifest by size and sha256: state by name, sorted.

    Raises:
        AssetError: no manifest, or it cannot be read.
    """
    root = asset_root()
    states: dict[str, AssetState] = {}
    for name, record in manifest().items():
        path = root / name
        if not path.is_file():
            states[name] = AssetState.MISSING
        elif path.stat().st_size != record.size_bytes or _sha256(path) != record.sha256:
            states[name] = AssetState.DAMAGED
        else:
            states[name] = AssetState.OK
    return states


def load_npz(name: str) -> dict[str, npt.NDArray[Any]]:
    """All arrays of the asset `name`, which must be an npz file without pickled objects.

    Raises:
        AssetError: see `asset_path`; or the file is damaged or holds pickled objects.
    """
    path = asset_path(name)
    try:
        # Opened here, because numpy leaves the file open when its archive is torn.
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
            return {key: file[key] for key in file.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise AssetError(f"asset {name!r} at {path} is damaged ({error}): restore the checkout or reinstall") from error


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
