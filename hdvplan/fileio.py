"""Tables and values as bytes, and files that appear whole or not at all."""

from __future__ import annotations

import errno
import json
import os
import shutil
import stat
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from hdvplan.errors import OptionError
from hdvplan.texts import encoded, no_formula

if TYPE_CHECKING:  # files of other kinds need none of them
    import pandas as pd
    from numpy.typing import NDArray

_NEW, _GONE = ".hdvplan-new", ".gone"  # the folder of files that are written together, and in it the names of those that go
_LONGEST = 40  # letters of a name that go into that of a file under way
_ROWS_AT_ONCE = 10_000  # of long tables
_LARGEST = 2_000_000_000  # bytes of a file that hdvplan wrote: tables of a road of thousands of kilometres


def csv_bytes(table: pd.DataFrame) -> bytes:
    """Return a table as CSV whose numbers read back exactly; missing ones are empty."""
    safe = (
        table.map(lambda cell: no_formula(cell) if isinstance(cell, str) else cell)
        if len(table.select_dtypes(exclude="number").columns)
        else table
    )
    return encoded(safe.to_csv(index=False, lineterminator="\n"))


@dataclass(frozen=True)
class Column:
    """One column of a long table, and the ``printf`` format that says how exactly they are written."""

    content: NDArray[Any]
    form: str = "%s"  # words, whole numbers, truth values


def table_bytes(table: Mapping[str, Column]) -> bytes:
    """Return columns of equal length as CSV, many rows by one format, which takes half the time; missing numbers are empty."""
    parts = [encoded(",".join(table) + "\n")]
    for begin in range(0, max(len(column.content) for column in table.values()), _ROWS_AT_ONCE):
        cells = [_cells(column.content[begin : begin + _ROWS_AT_ONCE], column.form) for column in table.values()]
        row = ",".join(form for form, _ in cells) + "\n"
        rows = list(zip(*(values for _, values in cells), strict=True))
        parts.append(encoded(row * len(rows) % tuple(chain.from_iterable(rows))))
    return b"".join(parts)


def _cells(content: NDArray[Any], form: str) -> tuple[str, Sequence[object]]:
    """Return the format of a column's rows, and what it is given."""
    values = content.tolist()
    if content.dtype.kind != "f":
        return form, [_word(value) for value in values]
    missing = content != content  # noqa: PLR0124 - NaN
    if not missing.any():
        return form, values
    return "%s", ["" if gone else form % value for value, gone in zip(values, missing.tolist(), strict=True)]


def _word(value: object) -> object:
    """Return a cell of a table of columns; words that would end it or begin a formula as CSV quotes them."""
    if not isinstance(value, str):
        return value
    word = no_formula(value)
    return '"{}"'.format(word.replace('"', '""')) if any(sign in word for sign in ',"\n\r') else word


def json_bytes(value: object, *, indent: int | None = 2) -> bytes:
    """Return JSON in UTF-8 with a newline at its end.

    Raises:
        ValueError: a number is not finite, which JSON cannot say.

    """
    return encoded(json.dumps(value, indent=indent, ensure_ascii=False, allow_nan=False) + "\n")


def read_json(path: Path) -> Any:  # noqa: ANN401 - what json.loads returns
    """Return what a JSON file says.

    Raises:
        OSError: it cannot be read, or is too large.
        ValueError: it is not JSON in UTF-8, or nested too deeply.

    """
    refuse_endless(path)
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except RecursionError as error:
        msg = f"{path.name} is nested too deeply"
        raise ValueError(msg) from error


def refuse_endless(path: Path) -> None:
    """Refuse to read a device, a pipe, a link to one, or a file larger than all that hdvplan writes: a folder may come from anybody.

    Raises:
        OSError: it is one of these, or not there.

    """
    state = path.stat()
    if not stat.S_ISREG(state.st_mode):
        raise OSError(errno.EINVAL, "it is not a file", str(path))
    if state.st_size > _LARGEST:
        raise OSError(errno.EFBIG, f"it has {state.st_size / 1e6:.0f} MB; at most {_LARGEST / 1e6:.0f} MB are read", str(path))


def write_atomically(path: Path, content: bytes) -> None:
    """Replace ``path`` by ``content``, as ``replaced`` does.

    Raises:
        OSError: the file cannot be written, or it is a folder, a device or a pipe.

    """
    with replaced(path) as file:
        file.write(content)


@contextmanager
def replaced(path: Path) -> Iterator[BinaryIO]:
    """Open what replaces ``path`` at once where the block ends, so that no reader and no crash sees half a file.

    A link is replaced, not followed.

    Raises:
        OSError: the file cannot be written, or it is a folder, a device or a pipe.

    """
    refuse_special(path)
    part = path.with_name(f".{path.name[:_LONGEST]}.{os.getpid()}.part")
    try:
        part.unlink(missing_ok=True)
        with part.open("xb") as file:  # never through a link
            yield file
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


@contextmanager
def locked(path: Path, *, wait: bool = True) -> Iterator[bool]:
    """Keep other processes out of a folder, or of what a file stands for, and tell whether it is ours: without ``wait``, perhaps not.

    The lock goes with the process and leaves nothing in a folder. Where the system has no such locks, everything is ours.

    Raises:
        OSError: the file cannot be opened.

    """
    try:
        import fcntl  # noqa: PLC0415 - not on Windows
    except ImportError:
        yield True
        return
    handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR | os.O_CREAT, 0o644)
    is_ours = True
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            is_ours = False
        except OSError:  # some network file systems have none
            pass
        yield is_ours
    finally:
        os.close(handle)


def refuse_special(path: Path) -> None:
    """Refuse to replace anything but a file.

    Raises:
        OSError: there is a folder, a device or a pipe, or a link to one.

    """
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:  # nothing, or a link to nothing
        return
    if stat.S_ISDIR(mode):  # "." has no name to begin with
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "it is a device or a pipe, not a file", str(path))


@dataclass(frozen=True)
class Together:
    """Files that make one result: the name of the ``last`` one, which tells that all are there, and which names may be from before.

    A folder is ours where the JSON in one of the files in ``marks`` has the entry that stands beside it.
    """

    last: str
    names: tuple[str, ...]
    marks: Mapping[str, str]

    def write(
        self, directory: Path, contents: Mapping[str, Callable[[], bytes]], on_progress: Callable[[float], None] | None = None
    ) -> None:
        """Replace the files in ``directory`` by ``contents``, as ``fill``; ``on_progress`` receives the written share, 0 to 1."""

        def write_all(aside: Path) -> None:
            for number, (name, content) in enumerate(contents.items(), start=1):
                (aside / name).write_bytes(content())
                if on_progress is not None:
                    on_progress(number / len(contents))

        self.fill(directory, tuple(contents), write_all)

    def fill(self, directory: Path, written: Collection[str], write: Callable[[Path], None]) -> None:
        """Replace the files in ``directory``, made if need be, by those that ``write`` writes; of the other ``names`` none stays.

        All are written aside first: whatever ends the process leaves the former result or the new one, which ``settle`` completes.
        ``write`` receives that folder and writes all files called ``written``. Processes write into one folder one after the other.

        Raises:
            OptionError: files of these names are there that hdvplan did not write.
            OSError: the folder or a file cannot be written.

        """
        directory.mkdir(parents=True, exist_ok=True)
        with locked(directory):
            settle(directory)
            self._refuse_foreign(directory, written)
            for left in directory.glob(f"{_NEW}.*"):  # of a killed run
                shutil.rmtree(left, ignore_errors=True)
            aside = directory / f"{_NEW}.{os.getpid()}"
            aside.mkdir()
            try:
                write(aside)
                gone = [self.last, *(name for name in self.names if name not in written)]
                (aside / _GONE).write_text("\n".join(gone), encoding="utf-8")
                aside.replace(directory / _NEW)  # from now on the new result is the one
            except BaseException:
                shutil.rmtree(aside, ignore_errors=True)
                raise
            settle(directory)

    def _refuse_foreign(self, directory: Path, written: Collection[str]) -> None:
        for name in (*written, *self.names):
            refuse_special(directory / name)
        if any(_has_entry(directory / name, entry) for name, entry in self.marks.items()):
            return
        there = next((name for name in (*written, *self.names) if os.path.lexists(directory / name)), None)
        if there is not None:
            msg = f"{directory} holds a file {there} that hdvplan did not write"
            raise OptionError(msg, hint="choose another folder with --out, or move the file")


def settle(directory: Path) -> None:
    """Complete the result of a process that was killed after it had written all of it; see ``Together``.

    Raises:
        OSError: a file cannot be moved, or what is there is not of hdvplan.

    """
    aside = directory / _NEW
    if aside.is_symlink() or not (aside / _GONE).is_file():
        return
    gone = _names_in(aside / _GONE)
    for name in gone:
        if not (name == gone[0] and not (aside / name).exists()):  # the last file has its place already
            (directory / name).unlink(missing_ok=True)
    names = sorted(file.name for file in aside.iterdir() if file.name != _GONE)
    for name in sorted(names, key=lambda name: name == gone[0]):
        (aside / name).replace(directory / name)
    shutil.rmtree(aside)


def _names_in(path: Path) -> list[str]:
    """Return the names of files in a folder that a file lists. A folder may come from anybody: what lies elsewhere is not taken away."""
    names = path.read_text(encoding="utf-8", errors="replace").split("\n")
    if any(name in {"", ".."} or "\0" in name or Path(name).name != name for name in names):
        raise OSError(errno.EINVAL, "it names more than files of its folder", str(path))
    return names


def _has_entry(path: Path, entry: str) -> bool:
    try:
        found = read_json(path)
    except (OSError, ValueError):
        return False
    return isinstance(found, dict) and entry in found
