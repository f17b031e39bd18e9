"""The session's side: gathers the runs, compares them with the baseline, and says what came of it.

A comparison is a test of its own in all that pytest reports: `test_mask.py::test_mask[smoke-mask-baseline]`.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import pytest

from dotmask.atomic_file import write_atomically
from pytest_dotmask.baseline import RunFigures, RunKey, read_baseline, renewed, write_baseline
from pytest_dotmask.comparison import LEAST_SEEDS
from pytest_dotmask.judgement import Compared, Judgement, judge
from pytest_dotmask.summary import markdown, message
from scenarios.errors import ScenarioError


class Terminal(Protocol):
    """The part of pytest's terminal that is used."""

    def line(self, text: str) -> None:
        """Write a line."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Crash:
    """What pytest's short summary and JUnit's file look for: the gist of a failure."""

    message: str


class Failure:
    """Why a comparison failed, as pytest wants it told: the gist in a line, and all of it."""

    def __init__(self, gist: str, text: str) -> None:
        self.reprcrash = Crash(message=gist)
        self._text = text

    def __str__(self) -> str:
        return self._text

    def toterminal(self, terminal: Terminal) -> None:
        """Write all of it."""
        for line in self._text.splitlines():
            terminal.line(line)


class DotmaskSession:
    """A plugin for sessions in which an option of ours is used; with pytest-xdist, for the controller's.

    Args:
        config: with the options.

    Raises:
        ScenarioError: the baseline cannot be read, or there is no folder for the summary.
    """

    def __init__(self, config: pytest.Config) -> None:
        self._path: Path | None = config.getoption("dotmask_baseline")
        self._summary: Path | None = config.getoption("dotmask_summary")
        self._is_update: bool = config.getoption("dotmask_update_baseline")
        self._stored: Mapping[RunKey, RunFigures] = {}
        if self._path is not None and (self._path.exists() or not self._is_update):
            self._stored = read_baseline(self._path)
        if self._summary is not None and not self._summary.absolute().parent.is_dir():
            raise ScenarioError(f"--dotmask-summary {self._summary}: there is no such folder")
        self._runs: dict[RunKey, RunFigures] = {}
        self._notes: list[str] = []

    def pytest_report_header(self) -> str | None:
        """Which file is compared with, or written."""
        if self._path is None:
            return None
        return f"dotmask: {'renews the ' if self._is_update else ''}baseline {self._path}, {len(self._stored)} runs"

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Gather the runs of a test."""
        for recorded in getattr(report, "dotmask", ()):
            run = RunFigures.model_validate(recorded)
            self._runs[run.key] = run

    @pytest.hookimpl(wrapper=True)
    def pytest_runtestloop(self, session: pytest.Session) -> Generator[None, object, object]:
        """After the last test: compare or renew, report, and write the summary."""
        done = yield
        if session.config.option.collectonly:
            return done
        judgement: Judgement | None = None
        if self._path is not None and self._is_update:
            self._renew(self._path, session)
        elif self._path is not None:
            judgement = judge(self._stored, self._runs)
            session.testscollected += len(judgement.compared)
            for compared in judgement.compared:
                _report(session, compared, judgement.count, self._path)
            if judgement.not_run:
                self._notes.append(f"{judgement.not_run} runs of the baseline have no partner: they were not run")
        if self._summary is not None:
            self._write_summary(self._summary, judgement)
        return done

    def _renew(self, path: Path, session: pytest.Session) -> None:
        if session.testsfailed:
            self._notes.append(f"{path}: not renewed, since tests have failed")
            return
        if not self._runs:
            raise pytest.UsageError(f"{path}: not renewed, since no test used dotmask_run")
        runs = renewed(self._stored, self._runs)
        try:
            write_baseline(path, runs.values())
        except ScenarioError as error:
            raise pytest.UsageError(str(error)) from error
        kept = sorted({run.test for run in runs.values()} - {run.test for run in self._runs.values()})
        self._notes.append(f"wrote {path}: {len(self._runs)} runs; commit it")
        if kept:
            self._notes.append(f"kept what was stored of tests that were not run: {', '.join(kept)}")
        self._notes += [
            f"{test}: no comparison will be possible with fewer than {LEAST_SEEDS} seeds"
            for test in sorted({run.test for run in self._runs.values()})
            if len({run.seed for run in self._runs.values() if run.test == test}) < LEAST_SEEDS
        ]

    def _write_summary(self, path: Path, judgement: Judgement | None) -> None:
        try:
            write_atomically(path, markdown(list(self._runs.values()), judgement))
        except OSError as error:
            raise pytest.UsageError(f"--dotmask-summary {path}: cannot be written ({error.strerror})") from error

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        """What was written, and what was not compared."""
        if self._notes:
            terminalreporter.section("dotmask")
            for note in self._notes:
                terminalreporter.line(note)


def _report(session: pytest.Session, compared: Compared, count: int, baseline: Path) -> None:
    """Tell pytest a comparison as the result of a test."""
    failure = message(compared, count, baseline)
    path, _, domain = compared.node_id.partition("::")
    location = (path, None, domain.replace("::", "."))
    hook = session.config.hook
    hook.pytest_runtest_logstart(nodeid=compared.node_id, location=location)
    for when in ("setup", "call", "teardown"):
        is_failed = when == "call" and failure is not None
        hook.pytest_runtest_logreport(
            report=pytest.TestReport(
                nodeid=compared.node_id,
                location=location,
                keywords={},
                outcome="failed" if is_failed else "passed",
                longrepr=Failure(*failure) if is_failed and failure is not None else None,  # type: ignore[arg-type]
                when=when,
                user_properties=_properties(compared),
            )
        )
    hook.pytest_runtest_logfinish(nodeid=compared.node_id, location=location)


def _properties(compared: Compared) -> Sequence[tuple[str, object]]:
    return [(f"dotmask.change.{change.metric.name}", change.text) for change in compared.changes]
