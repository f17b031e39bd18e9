"""The packages are ours, the command line is quick to start, and every record of versions is complete."""

import importlib
import importlib.metadata
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

PACKAGES = ("dotmask", "sim", "scenarios", "pytest_dotmask")

HEAVY = (
    "torch",
    "pybullet",
    "pyrender",
    "numba",
    "gtsam",
    "cv2",
    "scipy",
    "trimesh",
    "gymnasium",
    "numpy",
    "matplotlib",
    "skimage",
    "pyarrow",
    "ray",
)


def test_packages_lie_under_one_root() -> None:
    roots = {Path(find_spec(name).origin).parent.parent for name in PACKAGES}
    assert len(roots) == 1


def test_pytest_is_not_to_rewrite_them_nor_to_warn_that_it_cannot() -> None:
    for name in PACKAGES:
        assert "PYTEST_DONT_REWRITE" in importlib.import_module(name).__doc__


def test_the_pytest_plugin_is_registered() -> None:
    (plugin,) = importlib.metadata.entry_points(group="pytest11", name="dotmask")
    assert plugin.value == "pytest_dotmask.plugin"


def test_a_foreign_sim_is_named(tmp_path: Path) -> None:
    (tmp_path / "sim.py").write_text("")
    code = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import scenarios"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "another package named 'sim' hides ours" in done.stderr


@pytest.mark.parametrize("arguments", [["--help"], ["run", "--help"], ["attribute", "--help"], ["sweep", "--help"]])
def test_help_loads_nothing_heavy(arguments: list[str]) -> None:
    code = (
        "import sys\nfrom scenarios import cli\n"
        f"sys.argv = ['dotmask', *{arguments!r}]\n"
        "try:\n    cli.main()\nexcept SystemExit as end:\n    assert not end.code\n"
        f"print('LOADED', [m for m in {HEAVY!r} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "LOADED []" in done.stdout
