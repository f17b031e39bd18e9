from pathlib import Path

import pytest

from scenarios.errors import ScenarioError
from scenarios.run_folder import RunFolder, versions


def test_the_folder_appears_complete_at_the_end(tmp_path: Path) -> None:
    out = tmp_path / "deep" / "run"
    with RunFolder(out) as folder:
        folder.write("a.txt", "hello")
        folder.append("rows.csv", ("x", "y"), (1, None))
        folder.append("rows.csv", ("x", "y"), (2, 3))
        assert not out.exists()
    assert (out / "a.txt").read_text() == "hello"
    assert (out / "rows.csv").read_text() == "x,y\n1,\n2,3\n"
    assert [p.name for p in out.parent.iterdir()] == ["run"]


def test_an_interrupted_run_leaves_nothing(tmp_path: Path) -> None:
    def interrupted() -> None:
        with RunFolder(tmp_path / "run") as folder:
            folder.append("rows.csv", ("x",), (1,))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert list(tmp_path.iterdir()) == []


def test_other_files_are_never_touched(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("keep")
    with pytest.raises(ScenarioError, match="holds other files; give --out a new or empty folder"):
        RunFolder(tmp_path)
    with pytest.raises(ScenarioError, match="is a file"):
        RunFolder(tmp_path / "mine.txt")
    assert (tmp_path / "mine.txt").read_text() == "keep"


def test_an_empty_folder_may_be_filled(tmp_path: Path) -> None:
    out = tmp_path / "empty"
    out.mkdir()
    with RunFolder(out) as folder:
        folder.write("a.txt", "x")
    assert (out / "a.txt").exists()


def test_versions_name_what_can_change_a_figure() -> None:
    assert {"python", "machine", "dotmask", "numpy", "numba", "opencv-python-headless"} <= set(versions())
