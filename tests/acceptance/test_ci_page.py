"""docs/ci.md does what it says: its test files run, and its commands, in order."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/ci.md").read_text()
QUICK = 'seeds=3, frames=5, overrides={"room": "desk", "people.cast": [], "things": []}'
"""A room that is built in no time."""
BLOCK = re.compile(r"^```(python|sh)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def test_every_test_file_and_command_of_the_page_runs(tmp_path: Path) -> None:
    blocks = BLOCK.findall(PAGE)
    commands = [line.split() for kind, text in blocks if kind == "sh" for line in text.splitlines()]
    files = [text for kind, text in blocks if kind == "python"]
    assert (len(files), len(commands)) == (2, 2)
    for text in files:
        name = re.match(r"# (\w+\.py)\n", text)
        assert name, "a file begins with its name"
        short, count = re.subn(r"seeds=8, frames=30", QUICK, text)
        assert count == 1
        (tmp_path / name[1]).write_text(short)
    for program, *arguments in commands:
        assert program == "pytest"
        command = [sys.executable, "-m", "pytest", "-v", "-p", "no:cacheprovider", "-W", "error", *arguments]
        environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    assert "12 passed" in done.stdout, "three tests with three seeds, and their comparisons"
    runs = json.loads((tmp_path / "baseline.json").read_text())["runs"]
    assert {run["name"] for run in runs} == {"mask", "dotmask"}
    assert "| `masks.waste` |" in (tmp_path / "summary.md").read_text()
    assert 'name="dotmask.dotmask.ate_rmse_m"' in (tmp_path / "report.xml").read_text()


def test_the_page_names_every_metric_option_and_argument() -> None:
    import inspect

    from pytest_dotmask.metrics import METRICS
    from pytest_dotmask.runs import DotmaskRun

    arguments = [name for name in inspect.signature(DotmaskRun.__call__).parameters if name != "self"]
    for name in (*(metric.name for metric in METRICS), *arguments):
        assert f"`{name}`" in PAGE, name
