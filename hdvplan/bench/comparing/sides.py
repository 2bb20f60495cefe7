"""What was measured of one side of a comparison, read from its folders: counters, the times of every process, and its start and memory."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from textwrap import shorten
from typing import Any

import numpy as np
import pandas as pd

from hdvplan.arrays import FloatArray
from hdvplan.bench.comparing.counters import Change, counters_of
from hdvplan.bench.comparing.work import ABOUT, LONGEST_S, SHORTEST_S, STEPS, OwnSteps, steps_of
from hdvplan.bench.measuring.samples import LOST, OK, read_plain
from hdvplan.bench.suite import AS_SET, KEY
from hdvplan.errors import OptionError
from hdvplan.fileio import read_json
from hdvplan.machine import machine_words
from hdvplan.texts import printable

Name = tuple[str, ...]  # of a cell, as in KEY
TABLES = ("timing.csv", "envelope.csv", "samples.csv.gz")
IMPORT, PEAK, CPU, START, LOAD = "import_s", "peak_bytes", "cpu_s", "start_s", "load"  # as ``ABOUT`` has them, with how long it RAN
RAN, UNREPORTED = "ran_s", "unreported_s"
MACHINE = "machine"  # as ``ABOUT`` and run.json have it
COMPARISON = "comparison"  # as ``ABOUT`` has it: a name of the comparison that measured a process
SETTINGS, FILES = "settings", "files"  # as run.json has them; the digests of files of roads and vehicles
_RECORDED = {MACHINE: dict, COMPARISON: str, SETTINGS: dict, FILES: dict}
COLD = "cold"  # the folder of processes that began with an empty home
_MOST_BYTES = 1e18  # more than any machine has
_LEAST_S = 1e-2  # beside the steps, where hardly anything is: ratios of less say nothing, and what counts is ten times as much
_LONGEST = 300  # characters of a drive's last words


@dataclass(frozen=True)
class Steps:
    """One process's planning steps of one cell, without the first plan, which is made from nothing; (rounds, steps) times [s]."""

    total: FloatArray  # by the planner's own clock
    outer: FloatArray  # by the clock of the drive around it; empty where it was not taken
    first: FloatArray = field(default_factory=lambda: np.empty(0))  # (rounds,) the first plan, from outside [s]
    s: FloatArray = field(default_factory=lambda: np.empty(0))  # (steps,) arclength where each step begins [m]

    @property
    def outside(self) -> FloatArray:
        """The times from outside, where there are such, else the planner's own."""
        return self.outer if self.outer.size else self.total


Processes = Sequence[Mapping[Name, Steps]]


@dataclass(frozen=True)
class Side:
    """One program's benchmark: the counters of its first process, and times of all, in the order of measurement."""

    counters: pd.DataFrame
    processes: tuple[Mapping[Name, Steps], ...]
    about: tuple[Mapping[str, float], ...] = ()  # of every process as a whole: IMPORT, CPU, START, UNREPORTED [s], PEAK [bytes], LOAD
    own: tuple[Mapping[Name, Mapping[str, object]], ...] = ()  # counters that a user's command printed, of every process
    lost: Mapping[Name, str] = field(default_factory=dict)  # cells that ended well in the first process, and how they did in a later one
    last_words: Mapping[Name, str] = field(default_factory=dict)  # of cells without a plan in any process: why, in one line
    cold: Processes = ()  # as ``processes``, each of which began with an empty home
    cold_about: tuple[Mapping[str, float], ...] = ()
    records: tuple[Mapping[str, Any], ...] = ()  # what run.json and ``ABOUT`` say of every process: ``_RECORDED``

    @property
    def machines(self) -> dict[str, None]:
        """What the processes were measured on, as far as they say, each machine once."""
        return dict.fromkeys(machine_words(record[MACHINE]) for record in self.records if MACHINE in record)

    @property
    def comparisons(self) -> set[str]:
        """The comparisons that measured the processes, as far as they say."""
        return {record[COMPARISON] for record in self.records if COMPARISON in record}


def read_side(path: Path) -> Side:
    """Return one side of a comparison: a folder of ``hdvplan bench``, one that holds several, numbered in order, or a file of times.

    Raises:
        OptionError: no finished benchmark is there, or one of its files is missing or damaged.

    """
    if not path.is_dir() and not (path.is_file() and path.suffix == ".json"):
        msg = f"{path} is not a folder of hdvplan bench"
        raise OptionError(msg)
    if not (folders := _folders(path)):
        msg = f"{path} holds no benchmark"
        sides = path / "base", path / "new"
        both = all(side.is_dir() for side in sides)
        raise OptionError(msg, hint="hdvplan compare {} {}".format(*sides) if both else "hdvplan bench --out DIR makes one")
    side = _side(path, folders)
    if not (cold := _folders(path / COLD)):
        return side
    beside = _side(path / COLD, cold)
    return replace(side, cold=beside.processes, cold_about=beside.about)


def _folders(path: Path) -> list[Path]:
    """Return the folders of processes in order: the one that ``path`` is, or those in it."""
    if path.is_file() or _is_process(path):
        return [path]
    return sorted(folder for folder in path.iterdir() if _is_process(folder)) if path.is_dir() else []


def _side(path: Path, folders: list[Path]) -> Side:
    if path.is_file() or (folders[0] / STEPS).is_file():
        return _own_side(folders)
    tables = [_tables(folder) for folder in folders]
    timing, envelope, samples = tables[0]
    try:
        times = tuple(times_of(samples) for _, _, samples in tables)
        timings = [timing for timing, _, _ in tables]
        counters, (about, records) = counters_of(samples, timing, envelope), _told(folders, times)
        return Side(counters, times, about, lost=_lost(timings), last_words=_last_words(timings), records=records)
    except (ArithmeticError, LookupError, TypeError, ValueError) as error:  # a damaged table may hold anything
        msg = f"{path} cannot be read: its tables are not those of hdvplan bench"
        raise OptionError(msg, hint="measure it again") from error


def alike(base: Processes, new: Processes) -> tuple[Processes, Processes]:
    """Return as many processes of both sides, with the cells that all of them have, cut to the rounds and steps that all have."""
    count = min(len(base), len(new))
    every = [*base[:count], *new[:count]]
    names = [name for name in (every or [{}])[0] if all(name in process for process in every)]
    shapes = {name: np.min([process[name].total.shape for process in every], axis=0) for name in names}
    cut = [{name: _cut(process[name], *shape) for name, shape in shapes.items() if np.all(shape > 0)} for process in every]
    return (cut[:count], cut[count:]) if count else ([{}], [{}])


def _cut(steps: Steps, rounds: int, count: int) -> Steps:
    return Steps(steps.total[:rounds, :count], steps.outer[:rounds, :count], steps.first[:rounds], steps.s[:count])


def times_of(samples: pd.DataFrame) -> dict[Name, Steps]:
    """Return every cell's steps of one process; only whole rounds: a cell that ended at its budget has no other.

    Raises:
        ValueError: a time that no clock shows; of tables that were read, other errors as well.

    """
    columns = ["total_s", "outer_s"]
    times = np.abs(samples[columns].to_numpy(np.float64))
    if np.any(times > LONGEST_S) or np.any((times > 0.0) & (times < SHORTEST_S)):
        msg = "a planning step took a time that no clock shows"
        raise ValueError(msg)
    cells = {}
    for key, mine in samples.groupby(KEY, sort=False):
        steps = mine[mine["step"] > 0]
        wide = steps.pivot_table(index="round", columns="step", values=columns)
        whole = wide["total_s"].dropna().index if len(wide) else wide.index
        tables = {name: wide[name].loc[whole].to_numpy(np.float64) if len(wide) else np.empty((0, 0)) for name in columns}
        first = mine.loc[mine["step"] == 0, "outer_s"].to_numpy(np.float64)
        places = steps.groupby("step")["s_m"].first().to_numpy(np.float64)
        cells[tuple(str(part) for part in key)] = Steps(tables["total_s"], tables["outer_s"], first, places)
    return cells


def _told(
    folders: Sequence[Path], processes: Sequence[Mapping[Name, Steps]]
) -> tuple[tuple[Mapping[str, float], ...], tuple[Mapping[str, Any], ...]]:
    abouts = [_said(folder / ABOUT) for folder in folders]
    both = (about | _said(folder / "run.json") for about, folder in zip(abouts, folders, strict=True))
    records = tuple({name: one[name] for name, kind in _RECORDED.items() if isinstance(one.get(name), kind)} for one in both)
    return tuple(map(_about, abouts, processes)), records


def _said(file: Path) -> dict[str, Any]:
    try:
        found = read_json(file)
    except (FileNotFoundError, NotADirectoryError):  # the side may be a file itself
        return {}
    except (OSError, ValueError) as error:
        raise _unreadable(file, error) from error
    return found if isinstance(found, dict) else {}


def _unreadable(file: Path, error: Exception) -> OptionError:
    return OptionError(f"{file} cannot be read: {error}", hint="measure it again")


def _lost(timings: Sequence[pd.DataFrame]) -> dict[Name, str]:
    """Return the cells that ended well in the first process, and crashed or failed in a later one."""
    first, *later = (
        {tuple(map(str, key)): str(status) for *key, status in timing[[*KEY, "status"]].itertuples(index=False, name=None)}
        for timing in timings
    )
    return {cell: status for ended in later for cell, status in ended.items() if first.get(cell) == OK and status in LOST}


def _last_words(timings: Sequence[pd.DataFrame]) -> dict[Name, str]:
    """Return what the drives without a plan said last, by cell; of several processes the first one that said something."""
    found: dict[Name, str] = {}
    for timing in timings:
        for *key, status, message in timing[[*KEY, "status", "message"]].itertuples(index=False, name=None):
            if status in LOST and isinstance(message, str):
                found.setdefault(tuple(map(str, key)), shorten(printable(message), _LONGEST, placeholder=" ..."))
    return found


def _tables(folder: Path) -> list[pd.DataFrame]:
    try:
        return [read_plain(folder / name) for name in TABLES]
    except FileNotFoundError as error:
        unfinished = (folder / "parts").is_dir()
        msg = f"{folder} is {'not finished' if unfinished else f'without {Path(error.filename).name}'}"
        raise OptionError(msg, hint="run its command again: it continues the run" if unfinished else "measure it again") from error
    except (OSError, EOFError, ValueError, zlib.error) as error:
        raise _unreadable(folder, error) from error


def _own_side(folders: list[Path]) -> Side:
    measured: list[dict[str, OwnSteps]] = []
    for folder in folders:
        file = folder if folder.is_file() else folder / STEPS
        try:
            measured.append(steps_of(read_json(file)))
        except (OSError, ValueError) as error:
            raise _unreadable(file, error) from error
    processes = tuple(
        {own_name(name): Steps(cell.steps, np.empty((0, 0)), cell.first, cell.s) for name, cell in cells.items()} for cells in measured
    )
    counters = tuple({own_name(name): _counted(cell) for name, cell in cells.items()} for cells in measured)
    about, records = _told(folders, processes)
    return Side(pd.DataFrame(columns=KEY), processes, about, counters, records=records)


def _counted(cell: OwnSteps) -> Mapping[str, object]:
    """Return the counters of a cell of a user's command; what else it tells is one too."""
    places = {} if np.all(np.isnan(cell.s)) else {"last step at [m]": f"{cell.s[-1]:.6g}"}
    return {"steps": cell.steps.shape[1], **places, "first plan": "timed" if cell.first.size else "not timed", **cell.counters}


def own_changes(base: Side, new: Side) -> list[Change]:
    """Return the changed counters of a user's commands: what all processes of the base agree in, and any of the new side does not."""
    changes = []
    for cell in dict.fromkeys(name for process in (*base.own, *new.own) for name in process):
        there = [all(cell in process for process in side.own) for side in (base, new)]
        if not there[0] and any(cell in process for process in base.own):
            continue  # not even the base always has it
        if not all(there):
            changes.append(Change(cell, "cell", *("measured" if one else "missing" for one in there)))
            continue
        counters = dict.fromkeys(name for process in (*base.own, *new.own) for name in process[cell])
        for name in counters:
            old, now = (list(dict.fromkeys(str(process[cell].get(name, "-")) for process in side.own)) for side in (base, new))
            if len(old) == 1 and now != old:
                changes.append(Change(cell, name, old[0], " or ".join(now)))
    return changes


def own_name(name: str) -> Name:
    """Return the name of a cell of a user's command as tables have it."""
    return name, "", "", "", AS_SET


def cold_name(name: Name) -> Name:
    """Return the name of a cell that was measured with an empty home."""
    return f"{name[0]} (cold)", *name[1:]


def _is_process(folder: Path) -> bool:
    return (folder / "run.json").is_file() or (folder / STEPS).is_file()


def _about(about: Mapping[str, Any], cells: Mapping[Name, Steps]) -> dict[str, float]:
    """Return what is known of a process as a whole, of which ``ABOUT`` says ``about``.

    A process that takes turns has a start, until its first. Of others all that is beside the steps that they report is one.
    """
    try:
        known = {name: float(about[name]) for name in (IMPORT, PEAK, CPU, START, RAN, LOAD) if about.get(name) is not None}
    except (OverflowError, ValueError, TypeError):
        return {}
    if RAN in known:
        reported = sum(float(np.sum(steps.outside) + np.sum(steps.first)) for steps in cells.values())
        rest = max(known[RAN] - known.get(START, 0.0) - reported, _LEAST_S)
        known[UNREPORTED if START in known else START] = rest
    return {name: value for name, value in known.items() if SHORTEST_S <= value <= _MOST_BYTES}
