"""The run directory: what was asked for and measured with, the parts of a run under way, the tables of a finished one."""

from __future__ import annotations

import gzip
import re
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pandas as pd

from hdvplan.bench import PICTURE
from hdvplan.bench.measuring.ranking import broken_limits, findings_of, load_of
from hdvplan.bench.measuring.samples import part_file, read_part, read_plain
from hdvplan.bench.measuring.stats import tables_of
from hdvplan.bench.measuring.timing import LAYOUTS, captions, foot_of, latex, markdown, settings_words, untuned
from hdvplan.bench.suite import Suite
from hdvplan.case import Case
from hdvplan.errors import OptionError
from hdvplan.fileio import csv_bytes, json_bytes, read_json, write_atomically
from hdvplan.machine import commit, load_average, machine_facts, software
from hdvplan.plugins import digest_of, error_text
from hdvplan.record import NAME, command, now
from hdvplan.texts import encoded

_PART = re.compile(r"\.?\d{5}\.\d+\.npz(\.\d+\.part)?")  # also one under way, left by a killed run
_SAMPLE_DIGITS = "%.7g"  # a sample's time to the nanosecond, in a third of the space
_OTHERWISE = "start over with --fresh, or choose another folder with --out"

Json = dict[str, Any]  # what read_json returns


def recorded(suite: Suite, directory: Path, *, only_drawn: bool = False) -> Json | None:
    """Return what ``run.json`` says of this very run's earlier sessions; None where there were none.

    A finished run that is ``only_drawn`` may be of changed files, other software or another machine: nothing is measured any more.

    Raises:
        OptionError: the directory holds a run with other settings, of changed files, of other software or from another machine.

    """
    try:
        before = read_json(directory / NAME)
    except OSError:
        return None
    except ValueError as error:
        msg = f"{directory / 'run.json'} cannot be read: {error}"
        raise OptionError(msg, hint=_OTHERWISE) from error
    if not isinstance(before, dict) or not isinstance(before.get("sessions"), list) or "finished" not in before:
        msg = f"{directory / 'run.json'} is not of a benchmark"
        raise OptionError(msg, hint=_OTHERWISE)
    wanted = _conditions(suite)
    if only_drawn and before["finished"] and isinstance(settings := before.get("settings"), dict):
        known = {name: value for name, value in suite.to_dict().items() if name in settings}  # a later version may have more of them
        wanted = {"settings": settings | known}
    for part, present in wanted.items():
        if before.get(part) != present:
            found = _difference(before.get(part), present)
            msg = f"{directory} holds a run with other {part}: {found}"
            again = "continue on as many cores, such as by taskset -c 0,1, " if found.startswith("usable_cores was") else ""
            raise OptionError(msg, hint=again + _OTHERWISE)
    return before


def begin(suite: Suite, cases: Iterable[Case], directory: Path, record: Json | None, *, one_thread: bool) -> None:
    """Make ``directory`` and note that a session begins; ``cases`` are the suite's, ``record`` is that of the earlier sessions.

    ``one_thread``: the libraries' threads were bound before the libraries were loaded.

    Raises:
        OSError: the directory cannot be written.

    """
    session = {"started": now(), "command": command(), "one_thread": one_thread, "load_average": load_average()}
    earlier = record["sessions"] if record else []
    briefs = [case.brief() for case in cases]
    found = {"tolerances": record["tolerances"]} if record and "tolerances" in record else {}
    opened = _conditions(suite) | found | {"cases": briefs, "commit": commit(), "sessions": [*earlier, session], "finished": None}
    directory.mkdir(parents=True, exist_ok=True)
    if record is None:
        _remove_parts(directory)  # nothing says what they were measured with
    write_atomically(directory / NAME, json_bytes(opened))


def finish(suite: Suite, directory: Path) -> None:
    """Write the tables of a completely measured run; its parts go when all is written.

    Raises:
        OSError: a file cannot be written.

    """
    cells = suite.cells()
    measured = [[read_part(part_file(directory, cell, round_)) for round_ in range(suite.rounds)] for cell in range(len(cells))]
    tables = tables_of(cells, measured, suite.accuracy)
    record = read_json(directory / NAME)
    at_end, finished = load_average(), now()
    load = load_of(tables.summary, record["sessions"], at_end, record["machine"]["usable_cores"], finished)
    findings = findings_of(tables.summary, load)
    foot = [*foot_of(suite, record.get("tolerances", {}), findings, load, tables.timing), *broken_limits(tables.summary)]
    packed = tables.samples.to_csv(index=False, lineterminator="\n", float_format=_SAMPLE_DIGITS)
    write_atomically(directory / "samples.csv.gz", gzip.compress(encoded(packed), mtime=0))
    caption = captions(suite, record["machine"], tables, record.get("tolerances"))
    for name in LAYOUTS:
        table = getattr(tables, name)
        write_atomically(directory / f"{name}.csv", csv_bytes(table))
        write_atomically(directory / f"{name}.md", encoded(markdown(table, name, caption[name], foot)))
        write_atomically(directory / f"{name}.tex", encoded(latex(table, name, caption[name], foot)))
    record |= {"finished": finished, "load_average_at_end": at_end, "load": asdict(load), "verdict": [asdict(one) for one in findings]}
    record |= {"untuned": untuned(suite, record.get("tolerances", {}), tables.timing)}
    record |= {"solvers": [settings_words(name, record.get("tolerances", {})) for name in suite.solvers]}
    write_atomically(directory / NAME, json_bytes(record))
    _remove_parts(directory)


def read_record(directory: Path) -> Json:
    """Return what ``run.json`` of a finished run says.

    Raises:
        OptionError: it is not there, damaged, or the run is not finished.

    """
    try:
        record = read_json(directory / NAME)
    except (OSError, ValueError) as error:
        msg = f"{directory} holds no benchmark: {directory / NAME} cannot be read"
        raise OptionError(msg, hint="hdvplan bench --out DIR makes one") from error
    if not isinstance(record, dict) or not record.get("finished") or "verdict" not in record:
        msg = f"{directory} holds no finished benchmark of this version"
        raise OptionError(msg, hint=_OTHERWISE)
    return record


def note_tolerances(directory: Path, tolerances: Mapping[str, float | None]) -> None:
    """Add the tolerances that were found for the suite's accuracy to ``run.json``.

    Raises:
        OSError: the file cannot be written.

    """
    record = read_json(directory / NAME)
    write_atomically(directory / NAME, json_bytes(record | {"tolerances": dict(tolerances)}))


def read_table(directory: Path, name: str) -> pd.DataFrame:
    """Return a table of a finished run by the name of its file.

    Raises:
        OptionError: it is not there any more, or damaged.

    """
    try:
        return read_plain(directory / name)
    except (OSError, EOFError, ValueError, zlib.error) as error:
        msg = f"{directory / name} cannot be read: {getattr(error, 'strerror', None) or error}"  # that of gzip has none
        raise OptionError(msg, hint=_OTHERWISE) from error


@contextmanager
def damage_told(directory: Path) -> Iterator[None]:
    """Let what the tables of a finished run raise in the block be a refusal: a file that somebody changed may hold anything.

    Raises:
        OptionError: one of them is damaged.

    """
    try:
        yield
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        msg = f"the run in {directory} cannot be shown: {error_text(error)}"
        raise OptionError(msg, hint="a file of it is damaged: measure again with --fresh") from error


def discard(directory: Path) -> None:
    """Delete what a benchmark writes into its directory, and nothing else."""
    for name in (NAME, "samples.csv.gz", PICTURE, *(f"{table}.{kind}" for table in LAYOUTS for kind in ("csv", "md", "tex"))):
        (directory / name).unlink(missing_ok=True)
    _remove_parts(directory)


def _remove_parts(directory: Path) -> None:
    """Delete the parts of a run, and nothing else that lies there."""
    parts = directory / "parts"
    if not parts.is_dir():
        return
    there = list(parts.iterdir())
    other = next((file for file in there if not _PART.fullmatch(file.name) or not file.is_file()), None)
    if parts.is_symlink() or other is not None:
        msg = f"{other or parts} is not of a benchmark"
        raise OptionError(msg, hint="choose another folder with --out, or move it")
    for file in there:
        file.unlink()
    parts.rmdir()


def _conditions(suite: Suite) -> Json:
    digests = {name: digest_of(path) for name in (*suite.roads, *suite.vehicles) if (path := suite.file(name))}
    return {"settings": suite.to_dict(), "files": digests, "software": software(suite.solvers), "machine": machine_facts()}


def _difference(before: object, now: object) -> str:
    if not (isinstance(before, dict) and isinstance(now, dict)):
        return f"{_short(before)}, now {_short(now)}"
    name = next(name for name in {**before, **now} if (name in before) != (name in now) or before.get(name) != now.get(name))
    if (name in before) != (name in now):
        return f"{name} was {_short(before[name])}, is not known now" if name in before else f"{name} was not known, is {_short(now[name])}"
    if isinstance(before.get(name), dict) and isinstance(now.get(name), dict):
        return _difference(before[name], now[name])
    return f"{name} was {_short(before.get(name))}, is {_short(now.get(name))}"


def _short(value: object) -> str:
    return ",".join(map(str, value)) if isinstance(value, Sequence) and not isinstance(value, str) else str(value)
