"""A JSON file that ends in a list and grows item by item, so that it never has to be held whole."""

import json
from typing import Any

from dotmask.partial_folder import GrowingFiles


class JsonList:
    """Writes `{"key": value, ..., "LIST": [item, item, ...], "key": ...}`.

    Args:
        files: where it lies.
        name: of the file.
        head: what comes before the list.
        key: of the list.
    """

    def __init__(self, files: GrowingFiles, name: str, head: dict[str, Any], key: str) -> None:
        self._files, self._name = files, name
        start = "".join(f"{json.dumps(name)}: {json.dumps(value)},\n" for name, value in head.items())
        self._opening = f"{{\n{start}{json.dumps(key)}: ["

    def begin(self) -> None:
        """Write what comes before the items."""
        self._files.append(self._name, self._opening)

    def add(self, item: Any) -> None:
        """Append an item."""
        first = self._files.size(self._name) == len(self._opening.encode())
        text = json.dumps(item, separators=(",", ":"), allow_nan=False)
        self._files.append(self._name, ("\n" if first else ",\n") + text)

    def finish(self) -> None:
        """Close the list and the file."""
        self._files.append(self._name, "\n]}\n")
