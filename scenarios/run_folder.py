"""The folder that a run leaves behind: complete, or not there at all."""

import csv
import importlib.metadata
import os
import platform
import shutil
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TextIO

from scenarios.errors import ScenarioError

PACKAGES = (
    "dotmask",
    "numpy",
    "numba",
    "scipy",
    "opencv-python-headless",
    "trimesh",
    "scikit-image",
    "pybullet",
    "gtsam",
    "pydantic",
)
OPTIONAL_PACKAGES = ("depthai", "torch", "torchvision")
"""Those that need not be there: RTAB-Map lies in depthai, networks run on the others."""


def versions() -> dict[str, str]:
    """Versions of everything that can change a figure."""
    installed = {name: importlib.metadata.version(name) for name in PACKAGES}
    for name in OPTIONAL_PACKAGES:
        with suppress(importlib.metadata.PackageNotFoundError):
            installed[name] = importlib.metadata.version(name)
    return {
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}",
        **installed,
    }


def check_free(out: Path) -> None:
    """Refuse an output folder that holds something.

    Raises:
        ScenarioError: `out` is a file, or a folder with other files in it, or its parent cannot be made.
    """
    if out.exists() and not out.is_dir():
        raise ScenarioError(f"{out} is a file; give --out a new or empty folder")
    if out.is_dir() and any(out.iterdir()):
        raise ScenarioError(f"{out} holds other files; give --out a new or empty folder")


class RunFolder:
    """Collects files in a hidden folder beside `out` and renames it to `out` when the block ends well.

    An interrupted or failed block leaves nothing.

    Raises:
        ScenarioError: `out` is not free, or cannot be written to.
    """

    def __init__(self, out: Path) -> None:
        check_free(out)
        self.out = out
        self._tables: dict[str, tuple[TextIO, Any]] = {}

    def __enter__(self) -> Self:
        try:
            self.out.parent.mkdir(parents=True, exist_ok=True)
            self.path = Path(tempfile.mkdtemp(prefix=f".{self.out.name}.partial-", dir=self.out.parent))
            self.path.chmod(0o755)
        except OSError as error:
            raise ScenarioError(f"cannot write to {self.out.parent}: {error.strerror}") from error
        return self

    def append(self, name: str, header: Sequence[str], row: Sequence[object]) -> None:
        """Append a row to the CSV file `name`; the first call writes the header."""
        if name not in self._tables:
            file = (self.path / name).open("w", newline="", encoding="utf-8")
            self._tables[name] = file, csv.writer(file, lineterminator="\n")
            self._tables[name][1].writerow(header)
        self._tables[name][1].writerow(["" if value is None else value for value in row])

    def write(self, name: str, text: str) -> None:
        """Write the text file `name`."""
        (self.path / name).write_text(text, encoding="utf-8")

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for file, _ in self._tables.values():
            file.close()
        if kind is not None:
            shutil.rmtree(self.path, ignore_errors=True)
            return
        if self.out.is_dir():
            self.out.rmdir()
        os.replace(self.path, self.out)
