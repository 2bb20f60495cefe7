"""Hold two benchmarks against each other: exact counters first, then times, cell by cell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from hdvplan.bench.counters import WORK_TOLERANCE, Change, Tolerance, changes_of, counters_of
from hdvplan.bench.gate import Decision, Rule, Verdict, judge
from hdvplan.bench.stats import keyed
from hdvplan.bench.suite import KEY
from hdvplan.errors import OptionError
from hdvplan.jit import FloatArray

Name = tuple[str, ...]  # of a cell, as in KEY
TABLES = ("timing.csv", "envelope.csv", "samples.csv.gz")


@dataclass(frozen=True)
class Side:
    """One program's benchmark: the counters of its first process, and times of all, in the order of measurement."""

    counters: pd.DataFrame
    processes: tuple[Mapping[Name, FloatArray], ...]  # as ``times_of`` returns them


@dataclass(frozen=True)
class CellTimes:
    """The decision about one cell's planning time; None where its steps cannot be paired because the sides took different ones."""

    cell: Name
    decision: Decision | None


@dataclass(frozen=True)
class Comparison:
    """All that two benchmarks differ in, and the verdict on it."""

    changes: tuple[Change, ...]
    times: tuple[CellTimes, ...]
    verdict: Verdict
    processes: int  # pairs of processes; of one process a side the rounds are the pairs


def read_side(path: Path) -> Side:
    """Return one side of a comparison: a directory of ``hdvplan bench``, or one that holds several, numbered in order.

    Raises:
        OptionError: no finished benchmark is there, or one of its files is missing or damaged.

    """
    if not path.is_dir():
        msg = f"{path} is no directory of hdvplan bench"
        raise OptionError(msg)
    folders = [path] if (path / "run.json").is_file() else sorted(folder for folder in path.iterdir() if (folder / "run.json").is_file())
    if not folders:
        msg = f"{path} holds no benchmark"
        raise OptionError(msg, hint="hdvplan bench --out DIR makes one")
    tables = []
    for folder in folders:
        try:
            tables.append([keyed(pd.read_csv(folder / name)) for name in TABLES])
        except FileNotFoundError as error:
            unfinished = (folder / "parts").is_dir()
            msg = f"{folder} is {'not finished' if unfinished else f'without {Path(error.filename).name}'}"
            raise OptionError(msg, hint="give its command again; it goes on from there" if unfinished else "measure it again") from error
        except (OSError, EOFError, ValueError) as error:
            msg = f"{folder} cannot be read: {error}"
            raise OptionError(msg, hint="measure it again") from error
    timing, envelope, samples = tables[0]
    try:
        return Side(counters_of(samples, timing, envelope), tuple(times_of(samples) for _, _, samples in tables))
    except KeyError as error:
        msg = f"{path} cannot be read: its tables are not those of hdvplan bench"
        raise OptionError(msg, hint="measure it again") from error


def times_of(samples: pd.DataFrame) -> dict[Name, FloatArray]:
    """Return of every cell the (rounds, steps) times of one process [s], without the first plan, which is made from nothing.

    Only whole rounds: a cell that ended at its budget has no other.
    """
    cells = {}
    for key, mine in samples.groupby(KEY, sort=False):
        wide = mine[mine["step"] > 0].pivot_table(index="round", columns="step", values="total_s").dropna()
        cells[tuple(str(part) for part in key)] = wide.to_numpy(np.float64)
    return cells


def compare(base: Side, new: Side, rule: Rule, tolerance: Tolerance, *, expect_changes: bool) -> Comparison:
    """Return what differs between two sides; changed counters are a regression unless ``expect_changes``."""
    changes = tuple(changes_of(base.counters, new.counters, tolerance))
    cells = [name for name in base.processes[0] if all(name in process for process in (*base.processes, *new.processes))]
    times = tuple(
        CellTimes(name, _decision([process[name] for process in base.processes], [process[name] for process in new.processes], rule))
        for name in cells
    )
    return Comparison(changes, times, _verdict(changes, times, expect_changes), min(len(base.processes), len(new.processes)))


def compare_counters(baseline: pd.DataFrame, measured: pd.DataFrame) -> Comparison:
    """Return what differs from a committed baseline, with the room that another machine's rounding needs; no times."""
    changes = tuple(changes_of(baseline, measured, Tolerance(work=WORK_TOLERANCE)))
    return Comparison(changes, (), Verdict.REGRESSED if changes else Verdict.FINE, 1)


def _verdict(changes: tuple[Change, ...], times: tuple[CellTimes, ...], expect_changes: bool) -> Verdict:
    verdicts = {entry.decision.verdict if entry.decision else Verdict.UNMEASURABLE for entry in times}
    if (changes and not expect_changes) or Verdict.REGRESSED in verdicts:
        return Verdict.REGRESSED
    return Verdict.FINE if verdicts == {Verdict.FINE} else Verdict.UNMEASURABLE


def _decision(base: list[FloatArray], new: list[FloatArray], rule: Rule) -> Decision | None:
    """Return the decision from the (rounds, steps) times of the sides' processes; as many processes and rounds of both."""
    if len({times.shape[1] for times in (*base, *new)}) > 1:
        return None
    processes, rounds = min(len(base), len(new)), min(len(times) for times in (*base, *new))
    here, there = (_rows([times[:rounds] for times in side[:processes]]) for side in (base, new))
    return judge(here, there, rule)


def _rows(processes: list[FloatArray]) -> FloatArray:
    """Return the rows of which pairs are made: every process's steps, each with its fastest round.

    One process has no such rows. Its rounds are left out in turn instead: that shows whether the minima rest on single
    rounds, but nothing of what differs between processes.
    """
    rounds = len(processes[0])
    if len(processes) == 1:
        kept = [np.delete(processes[0], left_out, axis=0) for left_out in range(rounds)] if rounds > 1 else processes
    else:
        kept = processes
    return np.array([times.min(axis=0, initial=np.inf) for times in kept])
