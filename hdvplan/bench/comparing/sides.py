"""What was measured of one side of a comparison, read from its folders: counters, the times of every process, and its start and memory."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from textwrap import shorten

import numpy as np
import pandas as pd

from hdvplan.arrays import FloatArray
from hdvplan.bench.comparing.counters import counters_of
from hdvplan.bench.comparing.work import ABOUT, LONGEST_S, SHORTEST_S, STEPS, OwnSteps, steps_of
from hdvplan.bench.suite import AS_SET, KEY
from hdvplan.bench.tables import LOST, OK, keyed, read_plain
from hdvplan.errors import OptionError
from hdvplan.fileio import read_json
from hdvplan.texts import printable

Name = tuple[str, ...]  # of a cell, as in KEY
TABLES = ("timing.csv", "envelope.csv", "samples.csv.gz")
PARTS = ("linearise", "update", "solve", "check")
IMPORT, PEAK = "import_s", "peak_bytes"
_MOST_BYTES = 1e18  # more than any machine has
_LONGEST = 300  # characters of a drive's last words


@dataclass(frozen=True)
class Steps:
    """One process's planning steps of one cell, without the first plan, which is made from nothing; (rounds, steps) times [s]."""

    total: FloatArray  # by the planner's own clock
    outer: FloatArray  # by the clock of the drive around it; empty where it was not taken
    parts: Mapping[str, FloatArray] = field(default_factory=dict)  # of ``total``
    first: FloatArray = field(default_factory=lambda: np.empty(0))  # (rounds,) the first plan, from outside [s]
    s: FloatArray = field(default_factory=lambda: np.empty(0))  # (steps,) arclength where each step begins [m]

    @property
    def outside(self) -> FloatArray:
        """The times from outside, where there are such, else the planner's own."""
        return self.outer if self.outer.size else self.total


@dataclass(frozen=True)
class Side:
    """One program's benchmark: the counters of its first process, and times of all, in the order of measurement."""

    counters: pd.DataFrame
    processes: tuple[Mapping[Name, Steps], ...]
    about: tuple[Mapping[str, float], ...] = ()  # of every process as a whole: IMPORT [s], PEAK [bytes]
    own: Mapping[Name, Mapping[str, object]] = field(default_factory=dict)  # counters that a user's command printed
    lost: Mapping[Name, str] = field(default_factory=dict)  # cells that ended well in the first process, and how they did in a later one
    last_words: Mapping[Name, str] = field(default_factory=dict)  # of cells without a plan in any process: why, in one line


def read_side(path: Path) -> Side:
    """Return one side of a comparison: a directory of ``hdvplan bench``, or one that holds several, numbered in order.

    Raises:
        OptionError: no finished benchmark is there, or one of its files is missing or damaged.

    """
    if not path.is_dir():
        msg = f"{path} is not a folder of hdvplan bench"
        raise OptionError(msg)
    folders = [path] if _is_process(path) else sorted(folder for folder in path.iterdir() if _is_process(folder))
    if not folders:
        msg = f"{path} holds no benchmark"
        raise OptionError(msg, hint="hdvplan bench --out DIR makes one")
    about = tuple(_about(folder) for folder in folders)
    if (folders[0] / STEPS).is_file():
        return _own_side(folders, about)
    tables = [_tables(folder) for folder in folders]
    timing, envelope, samples = tables[0]
    try:
        times = tuple(times_of(samples) for _, _, samples in tables)
        timings = [timing for timing, _, _ in tables]
        return Side(counters_of(samples, timing, envelope), times, about, lost=_lost(timings), last_words=_last_words(timings))
    except (ArithmeticError, LookupError, TypeError, ValueError) as error:  # a damaged table may hold anything
        msg = f"{path} cannot be read: its tables are not those of hdvplan bench"
        raise OptionError(msg, hint="measure it again") from error


def times_of(samples: pd.DataFrame) -> dict[Name, Steps]:
    """Return every cell's steps of one process; only whole rounds: a cell that ended at its budget has no other.

    Raises:
        ValueError: a time that no clock shows; of tables that were read, other errors as well.

    """
    outer = "outer_s" if "outer_s" in samples else None  # older versions did not take it
    parts = [part for part in PARTS if f"{part}_s" in samples]
    wholes = ["total_s", *filter(None, [outer])]
    columns = [*wholes, *(f"{part}_s" for part in parts)]
    times = np.abs(samples[columns].to_numpy(np.float64))
    if np.any(times > LONGEST_S) or np.any((times[:, : len(wholes)] > 0.0) & (times[:, : len(wholes)] < SHORTEST_S)):
        msg = "a planning step took a time that no clock shows"
        raise ValueError(msg)
    cells = {}
    for key, mine in samples.groupby(KEY, sort=False):
        steps = mine[mine["step"] > 0]
        wide = steps.pivot_table(index="round", columns="step", values=columns)
        whole = wide["total_s"].dropna().index if len(wide) else wide.index
        tables = {name: wide[name].loc[whole].to_numpy(np.float64) if len(wide) else np.empty((0, 0)) for name in columns}
        places = (
            steps.groupby("step")["s_m"].first().to_numpy(np.float64) if "s_m" in steps else np.full(tables["total_s"].shape[-1], np.nan)
        )
        cells[tuple(str(part) for part in key)] = Steps(
            tables["total_s"],
            tables[outer] if outer else np.empty((0, 0)),
            {part: tables[f"{part}_s"] for part in parts},
            mine.loc[mine["step"] == 0, outer or "total_s"].to_numpy(np.float64),
            places,
        )
    return cells


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
        if "message" not in timing:
            continue
        for *key, status, message in timing[[*KEY, "status", "message"]].itertuples(index=False, name=None):
            if status in LOST and isinstance(message, str):
                found.setdefault(tuple(map(str, key)), shorten(printable(message), _LONGEST, placeholder=" ..."))
    return found


def _tables(folder: Path) -> list[pd.DataFrame]:
    try:
        return [keyed(read_plain(folder / name)) for name in TABLES]
    except FileNotFoundError as error:
        unfinished = (folder / "parts").is_dir()
        msg = f"{folder} is {'not finished' if unfinished else f'without {Path(error.filename).name}'}"
        raise OptionError(msg, hint="run its command again: it continues the run" if unfinished else "measure it again") from error
    except (OSError, EOFError, ValueError, zlib.error) as error:
        msg = f"{folder} cannot be read: {error}"
        raise OptionError(msg, hint="measure it again") from error


def _own_side(folders: list[Path], about: tuple[Mapping[str, float], ...]) -> Side:
    """Return a side from what a user's command printed."""
    told: list[dict[str, OwnSteps]] = []
    for folder in folders:
        try:
            told.append(steps_of(read_json(folder / STEPS)))
        except (OSError, ValueError) as error:
            msg = f"{folder / STEPS} cannot be read: {error}"
            raise OptionError(msg, hint="measure it again") from error
    processes = tuple(
        {own_name(name): Steps(cell.steps, np.empty((0, 0)), {}, cell.first, cell.s) for name, cell in cells.items()} for cells in told
    )
    counters = {own_name(name): cell.counters for name, cell in told[0].items()}
    return Side(pd.DataFrame(columns=KEY), processes, about, counters)


def own_name(name: str) -> Name:
    """Return the name of a cell of a user's command as tables have it."""
    return name, "", "", "", AS_SET


def _is_process(folder: Path) -> bool:
    return (folder / "run.json").is_file() or (folder / STEPS).is_file()


def _about(folder: Path) -> dict[str, float]:
    """Return what is known of a process as a whole."""
    try:
        told = read_json(folder / ABOUT)
        known = {name: float(told[name]) for name in (IMPORT, PEAK) if told.get(name) is not None}
    except (OSError, OverflowError, ValueError, AttributeError, TypeError):
        return {}
    return {name: value for name, value in known.items() if SHORTEST_S <= value <= _MOST_BYTES}
