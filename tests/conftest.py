"""Fixtures for tests that go through the command line."""

import sys
from collections.abc import Callable
from dataclasses import dataclass

import pytest

from scenarios import cli


@dataclass(frozen=True)
class Finished:
    """A command that has ended."""

    code: int
    out: str
    err: str


@pytest.fixture
def dotmask(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., Finished]:
    """Runs `dotmask ARGUMENTS` in this process."""

    def command(*arguments: object) -> Finished:
        monkeypatch.setattr(sys, "argv", ["dotmask", *(str(a) for a in arguments)])
        monkeypatch.setenv("COLUMNS", "200")
        capsys.readouterr()
        try:
            cli.main()
            code = 0
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
        captured = capsys.readouterr()
        return Finished(code, captured.out, captured.err)

    return command
