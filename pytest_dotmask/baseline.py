"""The stored figures, one line a run, that later runs of the same tests and seeds are compared with."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from dotmask.atomic_file import write_atomically
from scenarios.errors import ScenarioError

RunKey = tuple[str, str, int]
"""Test, name of the run in it, seed."""


class Stored(BaseModel):
    """Common rules of what is stored."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class RunFigures(Stored):
    """One run.

    Attributes:
        test: its name without the seed.
        name: of the run; a test may have several.
        scenario: its name.
        seed: of the scenario.
        frame_hash: SHA-256 of the images that it was given.
        version: of dotmask.
        figures: by name, see `pytest_dotmask.metrics.METRICS`; null where not measured.
    """

    test: str
    name: str
    scenario: str
    seed: int
    frame_hash: str
    version: str
    figures: dict[str, float | None]

    @property
    def key(self) -> RunKey:
        """What makes it the partner of another one."""
        return self.test, self.name, self.seed


class Baseline(Stored):
    """The file, schema 1.

    Attributes:
        runs: in the order of their keys.
    """

    schema_version: Annotated[Literal[1], Field(alias="schema")]
    runs: tuple[RunFigures, ...]


def read_baseline(path: Path) -> dict[RunKey, RunFigures]:
    """The runs of a file.

    Raises:
        ScenarioError: there is none, or it is no baseline.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ScenarioError(
            f"--dotmask-baseline {path}: there is no such file; write it with --dotmask-update-baseline, and commit it"
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioError(f"--dotmask-baseline {path}: cannot be read ({error})") from error
    try:
        return {run.key: run for run in Baseline.model_validate_json(text).runs}
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"])) or "file"
        raise ScenarioError(
            f"--dotmask-baseline {path}: not a baseline ({where}: {first['msg']}); "
            "remove it and write it again with --dotmask-update-baseline"
        ) from error


def write_baseline(path: Path, runs: Iterable[RunFigures]) -> None:
    """Write a file, whole or not at all.

    Raises:
        ScenarioError: it cannot be written.
    """
    lines = [json.dumps(run.model_dump(mode="json")) for run in sorted(runs, key=lambda run: run.key)]
    text = '{"schema": 1, "runs": [\n' + ",\n".join(lines) + "\n]}\n"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, text)
    except OSError as error:
        raise ScenarioError(f"--dotmask-baseline {path}: cannot be written ({error.strerror})") from error


def renewed(stored: Mapping[RunKey, RunFigures], runs: Mapping[RunKey, RunFigures]) -> dict[RunKey, RunFigures]:
    """The stored runs with those replaced whose tests were run, whatever their seeds were."""
    tests = {run.test for run in runs.values()}
    return {**{key: run for key, run in stored.items() if run.test not in tests}, **runs}
