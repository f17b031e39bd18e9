"""Tables in documents are what the commands write that are named beside them."""

import importlib
import re
import shutil
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
QUICK = ("people_table", "sensor_table", "things_table")


@pytest.mark.parametrize("tool", QUICK)
def test_a_table_is_what_its_command_writes(tool: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = importlib.import_module(f"tools.{tool}")
    copy = shutil.copy(module.PAGE, tmp_path)
    stored = module.PAGE.read_text()
    monkeypatch.setattr(module, "PAGE", Path(copy))
    module.main()
    assert Path(copy).read_text() == stored, f"run: python -m tools.{tool}"


def test_every_block_names_a_command_that_exists() -> None:
    blocks = [
        (page, command)
        for page in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
        for command in re.findall(r"<!-- begin [\w-]+: python -m ([\w.]+)", page.read_text())
    ]
    assert len(blocks) >= 5
    for page, command in blocks:
        assert (ROOT / f"{command.replace('.', '/')}.py").is_file(), f"{page.name} names {command}"
