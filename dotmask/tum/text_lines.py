"""Lines of the benchmark's text files: words and numbers, and where they stand."""

import math
import os
from collections.abc import Iterator
from pathlib import Path

PathLike = str | os.PathLike[str]


def table_lines(path: PathLike, error_type: type[Exception]) -> Iterator[tuple[str, list[str]]]:
    """`file:line` and the words of every line that is neither empty nor a comment."""
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
    except FileNotFoundError as error:
        raise error_type(f"{os.fspath(path)}: no such file") from error
    except (OSError, UnicodeDecodeError) as error:
        raise error_type(f"{os.fspath(path)}: cannot be read as text ({error})") from error
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.replace(",", " ").split()
        if words and not words[0].startswith("#"):
            yield f"{os.fspath(path)}:{number}", words


def finite_number(word: str, place: str, error_type: type[Exception]) -> float:
    """The number that `word` is, or an error that names its `place`."""
    try:
        value = float(word)
    except ValueError as error:
        raise error_type(f"{place}: {word!r} is not a number") from error
    if not math.isfinite(value):
        raise error_type(f"{place}: {word!r} is not finite")
    return value
