"""A folder that appears when it is complete, and that can be continued where an interrupted process left it.

While it grows, the folder `NAME` is called `.NAME.partial`:

- `files/` becomes `NAME` at the end;
- `parts/` is needed on the way and removed at the end;
- `settings.json` says what is being written, `checkpoint.json` how far it got.

Everything is written in steps. A file of the folder is written whole inside one step, or grows by appending. A
checkpoint holds the lengths of the growing files; continuing cuts them back to it, so that whatever was half done is
done again.
"""

import json
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

from dotmask.atomic_file import write_atomically
from dotmask.errors import SequenceFolderError

SETTINGS_FILE, CHECKPOINT_FILE = "settings.json", "checkpoint.json"


class GrowingFiles:
    """Files below one folder, and the lengths of those that grow."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self.sizes: dict[str, int] = {}

    def path(self, name: str) -> Path:
        """Where the file `name` lies; its folder is made."""
        path = self._root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        return path

    def write(self, name: str, data: bytes | str) -> None:
        """Write the file `name` whole."""
        self.path(name).write_bytes(data.encode() if isinstance(data, str) else data)

    def append(self, name: str, data: bytes | str) -> None:
        """Lengthen the file `name`."""
        encoded = data.encode() if isinstance(data, str) else data
        # What an interrupted process left of a file that the checkpoint does not know is overwritten.
        with self.path(name).open("ab" if name in self.sizes else "wb") as file:
            file.write(encoded)
        self.sizes[name] = self.size(name) + len(encoded)

    def size(self, name: str) -> int:
        """Length of a growing file in bytes; 0 before it begins."""
        return self.sizes.get(name, 0)

    def cut(self, sizes: Mapping[str, int]) -> None:
        """Shorten the growing files to `sizes`.

        Raises:
            SequenceFolderError: a file is missing or shorter.
        """
        for name, size in sizes.items():
            path = self._root / name
            if not path.is_file() or path.stat().st_size < size:
                raise SequenceFolderError(f"{path}: is missing or shorter than at the checkpoint; remove {self._root}")
            os.truncate(path, size)
        self.sizes = dict(sizes)


class PartialFolder:
    """A folder in the making; see the module. Made by `create` or `resume`.

    Attributes:
        out: what it will be called.
        files: what it will hold.
        parts: what is needed until then.
        steps: number of steps that are done.
    """

    def __init__(self, out: Path) -> None:
        self.out = Path(out)
        self._partial = partial_path(out)
        self.files, self.parts = GrowingFiles(self._partial / "files"), GrowingFiles(self._partial / "parts")
        self.steps = 0

    @classmethod
    def create(cls, out: Path, settings: Mapping[str, Any]) -> Self:
        """Begin a new folder.

        Args:
            out: a new or empty folder; its parents are made.
            settings: what is being written, for JSON.

        Raises:
            SequenceFolderError: `out` is a file or holds something, cannot be written, or was begun before.
        """
        folder = cls(out)
        _check_free(folder.out)
        if (folder._partial / "files").exists():
            raise SequenceFolderError(
                f"{folder._partial} holds an interrupted one; continue it with --resume, or remove it"
            )
        try:
            shutil.rmtree(folder._partial, ignore_errors=True)  # without files/ it was complete, but for its removal
            (folder._partial / "files").mkdir(parents=True)
        except OSError as error:
            raise SequenceFolderError(f"cannot write to {folder._partial.parent}: {error.strerror}") from error
        write_atomically(folder._partial / SETTINGS_FILE, _settings_text(settings))
        folder._save(0)
        return folder

    @classmethod
    def resume(cls, out: Path, settings: Mapping[str, Any]) -> Self:
        """Continue the folder that an interrupted process began.

        Args:
            out: as it was given to `create`.
            settings: as they were given to `create`.

        Raises:
            SequenceFolderError: there is nothing to continue, it was begun with other settings, or it is damaged.
        """
        folder = cls(out)
        _check_free(folder.out)
        if not (folder._partial / "files").is_dir():
            raise SequenceFolderError(f"nothing to resume: there is no {folder._partial}; leave --resume away")
        try:
            begun = json.loads((folder._partial / SETTINGS_FILE).read_text(encoding="utf-8"))
            checkpoint = json.loads((folder._partial / CHECKPOINT_FILE).read_text(encoding="utf-8"))
            folder.steps = int(checkpoint["steps"])
            files, parts = dict(checkpoint["files"]), dict(checkpoint["parts"])
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise SequenceFolderError(f"{folder._partial}: damaged ({error}); remove it and begin anew") from error
        wanted = json.loads(_settings_text(settings))
        if begun != wanted:
            difference = _first_difference(begun, wanted)
            raise SequenceFolderError(
                f"{folder._partial} was begun with {difference}; resume with the same, or remove it"
            )
        folder.files.cut(files)
        folder.parts.cut(parts)
        return folder

    def commit(self) -> None:
        """End a step: what was written up to here will be kept."""
        self._save(self.steps + 1)

    def finish(self) -> None:
        """Give the folder its name."""
        if self.out.is_dir():
            self.out.rmdir()
        os.replace(self._partial / "files", self.out)
        shutil.rmtree(self._partial)

    def discard(self) -> None:
        """Remove all that was written."""
        shutil.rmtree(self._partial)

    def _save(self, steps: int) -> None:
        checkpoint = {"steps": steps, "files": self.files.sizes, "parts": self.parts.sizes}
        write_atomically(self._partial / CHECKPOINT_FILE, json.dumps(checkpoint))
        self.steps = steps


def partial_path(out: Path) -> Path:
    """What the folder `out` is called until it is complete."""
    absolute = Path(out).absolute()
    return absolute.with_name(f".{absolute.name}.partial")


def _check_free(out: Path) -> None:
    if out.exists() and not out.is_dir():
        raise SequenceFolderError(f"{out} is a file; name a new or empty folder")
    if out.is_dir() and any(out.iterdir()):
        raise SequenceFolderError(f"{out} holds other files; name a new or empty folder")


def _settings_text(settings: Mapping[str, Any]) -> str:
    return json.dumps(settings, indent=2) + "\n"


def _first_difference(begun: Any, wanted: Any, key: str = "settings") -> str:
    """`key = value` of the first value in which `begun` differs from `wanted`."""
    if isinstance(begun, dict) and isinstance(wanted, dict):
        for name in [*begun, *wanted]:
            if begun.get(name) != wanted.get(name):
                return _first_difference(
                    begun.get(name), wanted.get(name), name if key == "settings" else f"{key}.{name}"
                )
    return f"{key} = {json.dumps(begun)}, not {json.dumps(wanted)}"
