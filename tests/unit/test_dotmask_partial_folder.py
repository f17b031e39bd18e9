"""A folder that grows: complete at the end, absent before, and the same bytes however often it was interrupted."""

from pathlib import Path

import pytest

from dotmask.errors import SequenceFolderError
from dotmask.partial_folder import PartialFolder, partial_path

STEPS = 4


def fill(folder: PartialFolder, until: int) -> None:
    """Write the steps that are missing: a list that grows, a file a step, and a part."""
    if folder.steps == 0:
        folder.files.append("deep/list.txt", "head\n")
    while folder.steps < until:
        folder.files.write(f"images/{folder.steps}.txt", f"picture {folder.steps}")
        folder.files.append("deep/list.txt", f"line {folder.steps}\n")
        folder.parts.append("rest", bytes([folder.steps]))
        folder.commit()


def finished(folder: PartialFolder) -> dict[str, bytes]:
    folder.files.append("deep/list.txt", folder.parts.path("rest").read_bytes())
    folder.finish()
    return {str(p.relative_to(folder.out)): p.read_bytes() for p in sorted(folder.out.rglob("*")) if p.is_file()}


def whole(tmp_path: Path) -> dict[str, bytes]:
    folder = PartialFolder.create(tmp_path / "whole", {})
    fill(folder, STEPS)
    return finished(folder)


def test_it_appears_when_it_is_complete(tmp_path: Path) -> None:
    folder = PartialFolder.create(tmp_path / "a" / "b", {"x": 1})
    fill(folder, 2)
    assert not (tmp_path / "a" / "b").exists()
    assert [p.name for p in (tmp_path / "a").iterdir()] == [".b.partial"]
    files = finished(folder)
    assert sorted(files) == ["deep/list.txt", "images/0.txt", "images/1.txt"]
    assert [p.name for p in (tmp_path / "a").iterdir()] == ["b"]


@pytest.mark.parametrize("stop", range(STEPS + 1))
def test_continued_it_has_the_same_bytes(stop: int, tmp_path: Path) -> None:
    folder = PartialFolder.create(tmp_path / "out", {"seed": 0})
    fill(folder, stop)
    # Half of a step, or of the end, that no checkpoint knows.
    folder.files.append("deep/list.txt", "half a li")
    if stop < STEPS:
        folder.files.write(f"images/{stop}.txt", "half a pic")
    folder.parts.append("rest", b"half")

    again = PartialFolder.resume(tmp_path / "out", {"seed": 0})
    assert again.steps == stop
    fill(again, STEPS)
    assert finished(again) == whole(tmp_path)


def test_what_a_lost_step_began_is_begun_anew(tmp_path: Path) -> None:
    folder = PartialFolder.create(tmp_path / "out", {})
    folder.files.append("list.txt", "from the lost step")
    again = PartialFolder.resume(tmp_path / "out", {})
    again.files.append("list.txt", "new")
    assert again.files.path("list.txt").read_text() == "new"


def test_other_files_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "a.txt").write_text("keep")
    (tmp_path / "file").write_text("keep")
    for name, message in (("mine", "holds other files"), ("file", "is a file")):
        for begin in (PartialFolder.create, PartialFolder.resume):
            with pytest.raises(SequenceFolderError, match=message):
                begin(tmp_path / name, {})
    assert (tmp_path / "mine" / "a.txt").read_text() == "keep"


def test_an_empty_folder_may_be_filled(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    folder = PartialFolder.create(tmp_path / "empty", {})
    fill(folder, 1)
    assert "images/0.txt" in finished(folder)


def test_only_the_same_is_continued(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with pytest.raises(SequenceFolderError, match=r"nothing to resume: there is no .*\.out\.partial"):
        PartialFolder.resume(out, {})
    PartialFolder.create(out, {"scenario": {"name": "a", "seed": 1}, "format": "tum"})
    with pytest.raises(SequenceFolderError, match=r"scenario\.seed = 1, not 2"):
        PartialFolder.resume(out, {"scenario": {"name": "a", "seed": 2}, "format": "tum"})
    with pytest.raises(SequenceFolderError, match='format = "tum", not "coco"'):
        PartialFolder.resume(out, {"scenario": {"name": "a", "seed": 1}, "format": "coco"})
    with pytest.raises(SequenceFolderError, match="interrupted one; continue it with --resume"):
        PartialFolder.create(out, {})


@pytest.mark.parametrize("damage", ["checkpoint", "settings", "short", "missing"])
def test_a_damaged_one_is_refused(damage: str, tmp_path: Path) -> None:
    folder = PartialFolder.create(tmp_path / "out", {})
    fill(folder, 2)
    partial = partial_path(tmp_path / "out")
    if damage in ("checkpoint", "settings"):
        (partial / f"{damage}.json").write_text("{")
    elif damage == "short":
        (partial / "files" / "deep" / "list.txt").write_text("h")
    else:
        (partial / "files" / "deep" / "list.txt").unlink()
    with pytest.raises(SequenceFolderError, match="remove"):
        PartialFolder.resume(tmp_path / "out", {})


def test_discarded_it_leaves_nothing(tmp_path: Path) -> None:
    folder = PartialFolder.create(tmp_path / "out", {})
    fill(folder, 1)
    folder.discard()
    assert list(tmp_path.iterdir()) == []


def test_what_finishing_left_behind_does_not_block_a_new_one(tmp_path: Path) -> None:
    """Killed between giving the name and removing the rest."""
    folder = PartialFolder.create(tmp_path / "out", {})
    (partial_path(tmp_path / "out") / "files").rename(tmp_path / "moved away")
    with pytest.raises(SequenceFolderError, match="nothing to resume"):
        PartialFolder.resume(tmp_path / "out", {})
    assert PartialFolder.create(tmp_path / "out", {}).steps == folder.steps == 0
