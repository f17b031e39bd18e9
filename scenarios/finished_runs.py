"""Finished runs on disk, so that an interrupted measurement goes on where it stopped.

A finished run is one JSON file with the key that decides its figures and what came of it. A run of another scenario,
other settings, other versions or other code has another key, and its file another name: it is neither used nor
overwritten.
"""

import hashlib
import json
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any, Generic, TypeVar

from pydantic import BaseModel, ValidationError

from dotmask.atomic_file import write_atomically
from scenarios.errors import ScenarioError
from scenarios.run import RunSettings
from scenarios.run_folder import versions
from scenarios.segmenters import own_segmenter_file
from scenarios.spec import CameraSpec, Scenario

ROOT = Path(__file__).parents[1]
NOT_MEASURED_WITH = ("scenarios/tables/", "scenarios/sweep/", "scenarios/finished_runs.py", "scenarios/cli/")
"""Code that no figure depends on."""

NO_INFLUENCE = ("threads", "video")
"""Settings that change no figure but times; see `figure_settings` for what threads do to a network."""


@cache
def code_hash() -> str:
    """SHA-256 of the program's own code, apart from what only plans runs and lays out tables."""
    digest = hashlib.sha256()
    for package in ("dotmask", "scenarios", "sim"):
        for path in sorted((ROOT / package).rglob("*.py")):
            name = path.relative_to(ROOT).as_posix()
            if not name.startswith(NOT_MEASURED_WITH):
                digest.update(name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


def figure_settings(settings: RunSettings) -> dict[str, Any]:
    """The settings that decide the figures, by name.

    Of weights that is their hash, wherever they lie. With a network it is the number of threads too: sums are split
    among them, and the last bits of the answer depend on how.
    """
    found = {name: value for name, value in asdict(settings).items() if name not in NO_INFLUENCE}
    if settings.network is not None:
        del found["network"]["weights"]
        found["network"]["threads"] = settings.threads
    return found


def run_key(scenario: Scenario, settings: RunSettings) -> dict[str, Any]:
    """All that decides the figures of one run."""
    return {
        "scenario": scenario.model_dump(mode="json"),
        "trajectory": _trajectory_hash(scenario),
        "settings": figure_settings(settings),
        "own_segmenter": _own_segmenter_hash(settings.segmenter),
        "versions": versions(),
        "code": code_hash(),
    }


def _trajectory_hash(scenario: Scenario) -> str | None:
    """SHA-256 of the recorded trajectory that the camera follows; None without one, or where the run will miss it."""
    camera = scenario.camera
    if not isinstance(camera, CameraSpec) or camera.trajectory is None:
        return None
    try:
        return hashlib.sha256(Path(camera.trajectory).read_bytes()).hexdigest()
    except OSError:
        return None


def _own_segmenter_hash(name: str) -> str | None:
    """SHA-256 of the file that makes a segmenter of the user's own; None with others, or where it is not found."""
    path = own_segmenter_file(name) if ":" in name else None
    return None if path is None else hashlib.sha256(path.read_bytes()).hexdigest()


def run_name(key: dict[str, Any]) -> str:
    """A short name for the run of a key: the scenario's, and the beginning of a hash of the whole key."""
    digest = hashlib.sha256(json.dumps(key, sort_keys=True).encode()).hexdigest()
    return f"{key['scenario']['name']}-{digest[:12]}"


R = TypeVar("R", bound=BaseModel)


class FinishedRuns(Generic[R]):
    """What came of finished runs, in one folder.

    Args:
        folder: made where it is missing.
        kind: of what came of a run.

    Raises:
        ScenarioError: the folder cannot be made.
    """

    def __init__(self, folder: Path, kind: type[R]) -> None:
        self._folder, self._kind = folder, kind
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ScenarioError(f"--out {folder}: cannot be made ({error.strerror})") from error

    def path(self, key: dict[str, Any]) -> Path:
        """Where the result of a run lies, or would."""
        return self._folder / f"{run_name(key)}.json"

    def load(self, key: dict[str, Any]) -> R | None:
        """The result of a finished run, None where there is none that can be used."""
        try:
            content = json.loads(self.path(key).read_text(encoding="utf-8"))
            if content["key"] != json.loads(json.dumps(key)):
                return None
            return self._kind.model_validate(content["result"])
        except (OSError, ValueError, KeyError, TypeError, ValidationError):
            return None

    def save(self, key: dict[str, Any], result: R) -> None:
        """Keep the result of a finished run, whole or not at all.

        Raises:
            ScenarioError: the disk cannot be written to.
        """
        content = {"key": key, "result": result.model_dump(mode="json", by_alias=True)}
        path = self.path(key)
        try:
            write_atomically(path, json.dumps(content, indent=2) + "\n")
        except OSError as error:
            raise ScenarioError(f"{path}: cannot be written ({error.strerror}); make room and run it again") from error
