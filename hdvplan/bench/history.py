"""Results of comparisons by commit: a small file for each commit, kind of machine and work, in a folder that can be a branch."""

from __future__ import annotations

import json
import platform
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from hdvplan.bench.compare import Comparison
from hdvplan.bench.revisions import Revision
from hdvplan.bench.suite import Suite
from hdvplan.bench.values import Value, values_of
from hdvplan.bench.versions import versions_of
from hdvplan.bench.work import CommandWork
from hdvplan.errors import OptionError
from hdvplan.fileio import json_bytes, read_json, write_atomically
from hdvplan.machine import machine_facts
from hdvplan.record import now
from hdvplan.texts import printable

FORMAT = 1  # of the files
_FILE = re.compile(r"[0-9a-f]{12}-[0-9a-f]{8}-[0-9a-f]{8}\.json")
_MACHINE = ("processor", "usable_cores", "platform", "python_minor")  # what must be the same for times to belong together


@dataclass(frozen=True)
class Entry:
    """What was measured of one commit against a base, and on which machine."""

    revision: Revision
    measured: str  # ISO 8601
    base: str  # its commit, or how it was named
    machine: Mapping[str, object]
    packages: Mapping[str, str]  # versions of libraries, where they are known
    work: Mapping[str, object]  # what was done: equal ones can be compared
    verdict: str
    values: tuple[Value, ...]

    @property
    def kind(self) -> tuple[str, str]:
        """Return digests of the kind of machine and of the work: entries with others are another history."""
        return _digest({name: self.machine.get(name) for name in _MACHINE}), _digest(self.work)

    @property
    def file(self) -> str:
        """The name of its file."""
        return f"{str(self.revision.commit)[:12]}-{'-'.join(self.kind)}.json"


def entry_of(comparison: Comparison, revision: Revision, base: str, work: Suite | CommandWork, out: Path) -> Entry:
    """Return what a comparison, measured into ``out``, says about a commit."""
    return Entry(
        revision, now(), base, _machine(), versions_of(out / "new" / "00"), work_words(work), str(comparison.verdict), values_of(comparison)
    )  # fmt: skip


def work_words(work: Suite | CommandWork) -> dict[str, object]:
    """Return the work as plain values, without those that equal the default, and with a digest of every file that it names."""
    if isinstance(work, CommandWork):
        return {"command": list(work.words)}
    files = [Path(name) for name in (*work.roads, *work.vehicles) if Path(name).is_file()]
    usual = Suite().to_dict()
    told = {name: value for name, value in work.to_dict().items() if value != usual[name]}
    return {"suite": told, "files": {str(file): sha256(file.read_bytes()).hexdigest()[:16] for file in files}}


def write_entry(entry: Entry, folder: Path) -> Path:
    """Write an entry into a folder, in place of an earlier one of the same commit, machine and work; return its file.

    Raises:
        OSError: it cannot be written.

    """
    folder.mkdir(parents=True, exist_ok=True)
    told = asdict(entry) | {"format": FORMAT, "values": [_known(asdict(one)) for one in entry.values]}
    write_atomically(folder / entry.file, json_bytes(told))
    return folder / entry.file


def read_entries(folder: Path) -> list[Entry]:
    """Return the entries in a folder, by date of commit; files with other names are ignored.

    Raises:
        OptionError: there is no such folder, nothing in it, or a file that is damaged or of a later version.

    """
    if not folder.is_dir():
        msg = f"{folder} is no folder"
        raise OptionError(msg, hint="hdvplan bench --against REV --history DIR makes one")
    found = [_read(file) for file in sorted(folder.iterdir()) if _FILE.fullmatch(file.name)]
    if not found:
        msg = f"{folder} holds no history"
        raise OptionError(msg, hint="hdvplan bench --against REV --history DIR adds to one")
    return sorted(found, key=lambda entry: (_instant(entry.revision.committed), entry.measured))


def _read(file: Path) -> Entry:
    try:
        told = _of_this_format(read_json(file))
        entry = Entry(
            Revision(_text(told["revision"]["commit"]), _text(told["revision"]["subject"]), _text(told["revision"]["committed"])),
            _text(told["measured"]), _text(told["base"]), dict(told["machine"]),
            {_text(name): _text(version) for name, version in told["packages"].items()},
            dict(told["work"]), _text(told["verdict"]), tuple(_value(one) for one in told["values"]),
        )  # fmt: skip
        _instant(entry.revision.committed)
    except (OSError, ValueError, LookupError, TypeError, AttributeError, OverflowError) as error:
        msg = f"{file} cannot be read: {error}"
        raise OptionError(msg, hint="delete it, and measure its commit again") from error
    return entry


def _of_this_format(told: Any) -> Any:  # noqa: ANN401 - what read_json returns
    if told["format"] != FORMAT:
        msg = f"its format is {told['format']}, and this version reads {FORMAT}"
        raise ValueError(msg)
    return told


def _value(told: Mapping[str, Any]) -> Value:
    numbers = [np.nan if told[name] is None else float(told[name]) for name in ("base", "new", "noise")]
    return Value(_text(told["cell"]), _text(told["what"]), _text(told["unit"]), *numbers)


def _text(value: object) -> str:
    if not isinstance(value, str):
        msg = f"{value!r} is no text"
        raise TypeError(msg)
    return printable(value)


def _known(told: Mapping[str, object]) -> dict[str, object]:
    return {name: None if isinstance(value, float) and not np.isfinite(value) else value for name, value in told.items()}


def _instant(committed: str) -> datetime:
    instant = datetime.fromisoformat(committed)
    return instant if instant.tzinfo else instant.replace(tzinfo=UTC)  # git writes the zone, a file may lack it


def _machine() -> dict[str, object]:
    facts = machine_facts()
    python = ".".join(platform.python_version_tuple()[:2])
    return facts | {"platform": f"{platform.system()} {platform.machine()}", "python_minor": f"{platform.python_implementation()} {python}"}


def _digest(told: object) -> str:
    return sha256(json.dumps(told, sort_keys=True, default=str).encode()).hexdigest()[:8]
