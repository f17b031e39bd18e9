"""Every example runs."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dotmask.tum import read_trajectory

EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("*.py"))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs_and_prints_something(example: Path, tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, str(example)], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()


def test_the_motion_that_breaks_a_method_is_a_scenario_that_repeats(
    tmp_path: Path, dotmask: Callable[..., Any]
) -> None:
    out = tmp_path / "broken.json"
    example = next(path for path in EXAMPLES if path.stem == "06_break_it")
    command = [sys.executable, str(example), "unmasked", "12", "2", str(out)]
    said = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert f"dotmask run --from {out}" in said
    done = dotmask("run", "--from", out, "--methods", "unmasked", "--out", tmp_path / "run", "--json")
    assert done.code == 0, done.err
    report = json.loads((tmp_path / "run" / "report.json").read_text())
    scenario = json.loads(out.read_text())
    assert report["frames"] == scenario["frames"] == len(scenario["camera"]["stops"])
    # What the search looked for: off by more than 5 cm, or lost.
    truth, estimate = (read_trajectory(tmp_path / "run" / f"trajectory_{name}.txt") for name in ("truth", "unmasked"))
    off_m = np.linalg.norm(truth.T_world_camera[-1, :3, 3] - estimate.T_world_camera[-1, :3, 3])
    assert len(estimate) < len(truth) or off_m > 0.05
