"""Tables in documents are written by commands, between two marks, so that none is typed by hand.

A block looks like `<!-- begin NAME: COMMAND -->`, the table, `<!-- end NAME -->`.
"""

import re
from pathlib import Path


def write_block(path: Path, name: str, command: str, text: str) -> None:
    """Replace what stands between the marks of the block `name` in a document.

    Args:
        path: of the document.
        name: of the block.
        command: that writes it, for the reader.
        text: Markdown.

    Raises:
        ValueError: the document has no such block, or more than one.
    """
    document = path.read_text(encoding="utf-8")
    marks = re.compile(rf"<!-- begin {re.escape(name)}:.*?<!-- end {re.escape(name)} -->", re.DOTALL)
    if len(marks.findall(document)) != 1:
        raise ValueError(f"{path}: needs exactly one block '<!-- begin {name}: -->' to '<!-- end {name} -->'")
    block = f"<!-- begin {name}: {command} -->\n\n{text.strip()}\n\n<!-- end {name} -->"
    path.write_text(marks.sub(lambda _: block, document), encoding="utf-8")


def figure(value: float | None, scale: float, digits: int) -> str:
    """A number as a table shows it; "-" when it was not measured."""
    return "-" if value is None else f"{scale * value:.{digits}f}"


def markdown_table(header: list[str], rows: list[list[str]]) -> str:
    """A Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)
