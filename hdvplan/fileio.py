"""Tables and values as bytes, and files that appear whole or not at all."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # files of other kinds need no pandas
    import pandas as pd


def csv_bytes(table: pd.DataFrame) -> bytes:
    """Return a table as CSV whose numbers read back exactly; missing ones are empty."""
    return table.to_csv(index=False, lineterminator="\n").encode()


def json_bytes(value: object, *, indent: int | None = 2) -> bytes:
    """Return JSON in UTF-8 with a newline at its end.

    Raises:
        ValueError: a number is not finite, which JSON cannot say.

    """
    return (json.dumps(value, indent=indent, ensure_ascii=False, allow_nan=False) + "\n").encode()


def write_atomically(path: Path, content: bytes) -> None:
    """Replace ``path`` by ``content`` at once, so that no reader and no crash sees half a file.

    Raises:
        OSError: the file cannot be written.

    """
    if path.is_dir():  # "." has no name to begin with
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        part.write_bytes(content)
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
