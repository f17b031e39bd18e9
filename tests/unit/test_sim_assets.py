import hashlib
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from sim import assets
from sim.assets import AssetState, asset_path, asset_root, load_npz, manifest, verify_assets
from sim.errors import AssetError


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A small asset folder: good.npz and pickled.npz."""
    np.savez(tmp_path / "good.npz", a=np.arange(3))
    np.savez(tmp_path / "pickled.npz", a=np.array([{}], dtype=object))
    files = {}
    for path in sorted(tmp_path.glob("*.npz")):
        content = path.read_bytes()
        digest = hashlib.sha256(content).hexdigest()
        files[path.name] = {
            "source": "this test",
            "licence": "CC0-1.0",
            "sha256": digest,
            "bytes": len(content),
            "changes": "none",
        }
    (tmp_path / "manifest.json").write_text(json.dumps({"schema": 1, "files": files}))
    monkeypatch.setattr(assets, "asset_root", lambda: tmp_path)
    return tmp_path


def test_every_committed_asset_matches_the_manifest() -> None:
    states = verify_assets()
    assert states
    assert set(states.values()) == {AssetState.OK}


def test_every_committed_file_is_in_the_manifest_with_a_licence_text() -> None:
    root = asset_root()
    found = {str(p.relative_to(root)) for p in root.rglob("*") if p.is_file() and p.suffix not in (".md", ".txt")}
    assert found == {*manifest(), "manifest.json"}
    for record in manifest().values():
        assert record.source
        assert record.changes
        assert (root / "LICENSES" / f"{record.licence}.txt").is_file()


def test_changed_and_missing_files_are_found(folder: Path) -> None:
    assert verify_assets() == {"good.npz": AssetState.OK, "pickled.npz": AssetState.OK}
    content = bytearray((folder / "good.npz").read_bytes())
    content[40] ^= 1
    (folder / "good.npz").write_bytes(content)
    (folder / "pickled.npz").unlink()
    assert verify_assets() == {"good.npz": AssetState.DAMAGED, "pickled.npz": AssetState.MISSING}


@pytest.mark.parametrize(
    "name", ["../manifest.json", "humans/../../pyproject.toml", "/etc/passwd", "", "humans\\man.npz", "C:/x.npz"]
)
def test_names_that_leave_the_folder_are_refused(name: str) -> None:
    with pytest.raises(AssetError, match="must be a path below the asset folder"):
        asset_path(name)


def test_a_file_outside_the_manifest_is_refused(folder: Path) -> None:
    shutil.copy(folder / "good.npz", folder / "stray.npz")
    with pytest.raises(AssetError, match=r"no asset named 'stray\.npz'"):
        asset_path("stray.npz")


def test_an_unknown_name_gets_the_nearest() -> None:
    with pytest.raises(AssetError, match=r"did you mean humans/man\.npz"):
        asset_path("humans/men.npz")


def test_a_missing_file_says_what_to_do(folder: Path) -> None:
    (folder / "good.npz").unlink()
    with pytest.raises(AssetError, match=r"missing at .* restore"):
        asset_path("good.npz")


def test_load_npz_reads_arrays_and_refuses_pickles_and_torn_files(folder: Path) -> None:
    np.testing.assert_array_equal(load_npz("good.npz")["a"], np.arange(3))
    with pytest.raises(AssetError, match="damaged"):
        load_npz("pickled.npz")
    (folder / "good.npz").write_bytes((folder / "good.npz").read_bytes()[:60])
    with pytest.raises(AssetError, match="damaged"):
        load_npz("good.npz")


@pytest.mark.parametrize("text", ["{", "{}", '{"files": {"a": {}}}', '{"files": []}', "[]"])
def test_a_broken_manifest_says_what_to_do(folder: Path, text: str) -> None:
    (folder / "manifest.json").write_text(text)
    with pytest.raises(AssetError, match="cannot be read"):
        verify_assets()


def test_a_package_without_a_checkout_uses_the_folder_of_the_wheel(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    installed = tmp_path / "dotmask_assets"
    installed.mkdir()
    (tmp_path / "assets").mkdir()  # somebody else's folder: no manifest
    monkeypatch.setattr(assets, "__file__", str(tmp_path / "sim" / "assets.py"))
    with pytest.raises(AssetError, match="no asset manifest"):
        asset_root()
    (installed / "manifest.json").write_text("{}")
    assert asset_root() == installed
    (tmp_path / "assets" / "manifest.json").write_text("{}")
    assert asset_root() == tmp_path / "assets"
