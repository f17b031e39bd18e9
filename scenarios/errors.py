"""Errors of the command line and the runner; each says what to do."""

import difflib
from collections.abc import Iterable


class ScenarioError(Exception):
    """Bad input from the user: ends the command with exit code 2 and one line."""


def unknown(kind: str, name: str, known: Iterable[str]) -> ScenarioError:
    """The error for a name that does not exist, with near matches and all valid names."""
    names = sorted(known)
    near = difflib.get_close_matches(name, names, n=3, cutoff=0.5)
    hint = f" Did you mean {' or '.join(near)}?" if near else ""
    return ScenarioError(f"unknown {kind} '{name}'.{hint} Known: {', '.join(names)}")
