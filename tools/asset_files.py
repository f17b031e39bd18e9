"""Write an asset as an npz with the same bytes in every run, and its entry in the manifest."""

import hashlib
import io
import json
import os
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt


def write_npz(path: Path, arrays: Mapping[str, npt.NDArray[Any]]) -> None:
    """Like `np.savez_compressed`, but with fixed time stamps: the same arrays give the same bytes."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(".partial")
    with zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name, array in arrays.items():
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, np.ascontiguousarray(array), allow_pickle=False)
            archive.writestr(
                zipfile.ZipInfo(f"{name}.npy", (1980, 1, 1, 0, 0, 0)), buffer.getvalue(), zipfile.ZIP_DEFLATED, 9
            )
    os.replace(partial, path)


def update_manifest(root: Path, name: str, *, source: str, licence: str, changes: str) -> None:
    """Set the entry of the file `name` below `root` in `root/manifest.json`; other entries stay.

    Args:
        root: the asset folder.
        name: path of the file below it.
        source: see `sim.assets.AssetRecord`.
        licence: likewise.
        changes: likewise.
    """
    content = (root / name).read_bytes()
    path = root / "manifest.json"
    manifest: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    manifest["schema"] = 1
    files = manifest.setdefault("files", {})
    files[name] = {
        "source": source,
        "licence": licence,
        "sha256": hashlib.sha256(content).hexdigest(),
        "bytes": len(content),
        "changes": changes,
    }
    manifest["files"] = dict(sorted(files.items()))
    partial = path.with_suffix(".partial")
    partial.write_text(json.dumps(manifest, indent=2) + "\n", encoding="utf-8")
    os.replace(partial, path)
