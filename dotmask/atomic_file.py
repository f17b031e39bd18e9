"""Writing a file so that a reader finds the old content or the new one, never half of it."""

import os
import uuid
from pathlib import Path


def write_atomically(path: str | os.PathLike[str], data: bytes | str) -> None:
    """Write `data` under a temporary name in the folder of `path`, then rename.

    Text is written as UTF-8 with its line ends as they are. When writing fails, an older file stays as it was and
    the temporary one is removed.

    Raises:
        OSError: the folder is missing, not writable or full.
    """
    target = Path(path)
    temporary = target.with_name(f".{target.name}.{uuid.uuid4().hex}.tmp")
    try:
        temporary.write_bytes(data.encode() if isinstance(data, str) else data)
        os.replace(temporary, target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
