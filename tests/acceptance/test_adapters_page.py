"""docs/adapters.md does what it says: its programs are written to files and its commands run, in order."""

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/adapters.md").read_text()
BLOCK = re.compile(r"^```(python|sh)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def test_every_program_and_command_of_the_page_runs(tmp_path: Path) -> None:
    said = []
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    for kind, text in BLOCK.findall(PAGE):
        if kind == "python":
            name = re.match(r"# (\w+\.py)\n", text)
            assert name, "a program begins with its name"
            (tmp_path / name[1]).write_text(text)
            continue
        for line in text.splitlines():
            program, *arguments = line.split()
            start = {"dotmask": ["-m", "scenarios.cli"], "python": []}[program]
            command = [sys.executable, *start, *arguments]
            done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
            assert done.returncode == 0, f"{line}: {done.stderr}"
            said += re.findall(r"ATE ([\d.]+) mm", done.stdout)
    moving_mm, frozen_mm, *standing_mm = map(float, said)
    assert frozen_mm < 20, "the program is a good one where nothing moves"
    assert moving_mm > 2 * frozen_mm, "people who move lead it astray"
    assert len(set(standing_mm)) == 1, "masks do not help an engine that looks at nothing"
    assert len(standing_mm) == 3
