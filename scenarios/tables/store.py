"""Finished runs on disk, so that an interrupted measurement goes on where it stopped.

A finished run is one JSON file with the key that decides its figures and its report. A run of another scenario, other
settings, other versions or other code has another key, and its file another name: it is neither used nor overwritten.
"""

import hashlib
import json
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from dotmask.atomic_file import write_atomically
from scenarios.errors import ScenarioError
from scenarios.report import Report
from scenarios.run_folder import versions
from scenarios.spec import Scenario
from scenarios.tables.plan import TablePlan

ROOT = Path(__file__).parents[2]
NOT_MEASURED_WITH = ("scenarios/tables/", "scenarios/cli.py")
"""Code that no figure depends on."""


@cache
def code_hash() -> str:
    """SHA-256 of the program's own code, apart from what only lays out tables."""
    digest = hashlib.sha256()
    for package in ("dotmask", "scenarios", "sim"):
        for path in sorted((ROOT / package).rglob("*.py")):
            name = path.relative_to(ROOT).as_posix()
            if not name.startswith(NOT_MEASURED_WITH):
                digest.update(name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


def run_key(plan: TablePlan, scenario: Scenario) -> dict[str, Any]:
    """All that decides the figures of one run."""
    return {
        "scenario": scenario.model_dump(mode="json"),
        "settings": plan.figure_settings(),
        "versions": versions(),
        "code": code_hash(),
    }


class ReportStore:
    """The reports of finished runs in one folder.

    Args:
        folder: made where it is missing.

    Raises:
        ScenarioError: it cannot be made.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ScenarioError(f"--out {folder}: cannot be made ({error.strerror})") from error

    def path(self, key: dict[str, Any]) -> Path:
        """Where the report of a run lies, or would."""
        digest = hashlib.sha256(json.dumps(key, sort_keys=True).encode()).hexdigest()
        return self._folder / f"{key['scenario']['name']}-{digest[:12]}.json"

    def load(self, key: dict[str, Any]) -> Report | None:
        """The report of a finished run, None where there is none that can be used."""
        try:
            content = json.loads(self.path(key).read_text(encoding="utf-8"))
            if content["key"] != json.loads(json.dumps(key)):
                return None
            return Report.model_validate(content["report"])
        except (OSError, ValueError, KeyError, TypeError, ValidationError):
            return None

    def save(self, key: dict[str, Any], report: Report) -> None:
        """Keep the report of a finished run, whole or not at all.

        Raises:
            ScenarioError: the disk cannot be written to.
        """
        content = {"key": key, "report": report.model_dump(mode="json", by_alias=True)}
        path = self.path(key)
        try:
            write_atomically(path, json.dumps(content, indent=2) + "\n")
        except OSError as error:
            raise ScenarioError(f"{path}: cannot be written ({error.strerror}); make room and run it again") from error
