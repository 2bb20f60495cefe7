"""Compare two benchmarks: exact counters first, then times, cell by cell and over all."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from hdvplan.arrays import FloatArray
from hdvplan.bench.counters import WORK_TOLERANCE, Change, Tolerance, changes_of
from hdvplan.bench.gate import Decision, Rule, Verdict, judge
from hdvplan.bench.joint import FEWEST, LEVEL
from hdvplan.bench.samples import LOST, OK
from hdvplan.bench.sides import Name, Side
from hdvplan.bench.statistics import Found, joint_findings
from hdvplan.bench.where import Place, place_of


@dataclass(frozen=True)
class CellTimes:
    """The decision about one cell's planning time; None where its steps cannot be paired because the sides took different ones."""

    cell: Name
    decision: Decision | None
    chance: float = 1.0  # see ``Agreement``
    detectable: float = np.inf  # the ratio that would have been found
    place: Place | None = None  # of a cell that became slower


@dataclass(frozen=True)
class Failure:
    """A program that could not be measured at all: which, what became of it in one line, and the end of what it said."""

    side: str  # "base" or "new"
    message: str
    tail: str


@dataclass(frozen=True)
class Comparison:
    """All that two benchmarks differ in, and the verdict on it."""

    changes: tuple[Change, ...]
    times: tuple[CellTimes, ...]
    verdict: Verdict
    processes: int  # pairs of processes; of one process a side the rounds are the pairs
    found: tuple[Found, ...] = ()  # the statistics over all cells
    failure: Failure | None = None
    expected: bool = False  # changed counters are no regression, as the user expects them


def compare(base: Side, new: Side, rule: Rule, tolerance: Tolerance, *, expect_changes: bool) -> Comparison:
    """Return what differs between two sides; changed counters are a regression unless ``expect_changes``.

    What was planned before and is not any more is one in any case.
    """
    changes = (*changes_of(base.counters, new.counters, tolerance), *_own_changes(base, new), *_lost_changes(base, new))
    names = [name for name in _names(base) if name in _names(new)]
    pairs = {name: _pairs(base, new, name) for name in names}
    decisions = {name: None if both is None else judge(*both, rule) for name, both in pairs.items()}
    ratios = {name: both[1].mean(axis=1) / both[0].mean(axis=1) for name, both in pairs.items() if both is not None and _known(*both)}
    found, agreed = joint_findings(base, new, rule, ratios)
    times = tuple(_cell_times(name, decisions[name], agreed.get(name), base, new) for name in names)
    verdict = _verdict(changes, times, found, expect_changes=expect_changes)
    short = _short_names([change.cell for change in changes] + names)
    return Comparison(
        tuple(replace(change, cell=short[change.cell], why=_why(change, new)) for change in changes),
        tuple(replace(entry, cell=short[entry.cell]) for entry in times),
        verdict,
        min(len(base.processes), len(new.processes)),
        found,
        expected=expect_changes,
    )


def compare_counters(baseline: pd.DataFrame, measured: pd.DataFrame) -> Comparison:
    """Return what differs from a committed baseline, with the room that another machine's rounding needs; no times."""
    changes = tuple(changes_of(baseline, measured, Tolerance(work=WORK_TOLERANCE)))
    return Comparison(changes, (), Verdict.REGRESSED if changes else Verdict.FINE, 1)


def failed(side: str, message: str, tail: str, *, blameless: bool = False) -> Comparison:
    """Return the comparison of programs of which one could not be measured: a new one is a regression, a base prevents an answer.

    So does a ``blameless`` failure, which says nothing about the program.
    """
    verdict = Verdict.REGRESSED if side == "new" and not blameless else Verdict.UNMEASURABLE
    return Comparison((), (), verdict, 0, (), Failure(side, message, tail))


def no_longer_planned(change: Change) -> bool:
    """Tell whether a change is a cell that was planned to its end before, and is not now."""
    lost = change.counter == "status" and change.base == OK and change.new in LOST
    return lost or (change.counter == "cell" and change.new == "missing")


def _why(change: Change, new: Side) -> str:
    """Return the last words of a cell that is no longer planned."""
    return new.last_words.get(change.cell, "") if no_longer_planned(change) else ""


def _cell_times(name: Name, decision: Decision | None, agreed: tuple[float, float] | None, base: Side, new: Side) -> CellTimes:
    if decision is None or agreed is None:
        return CellTimes(name, decision)
    chance, detectable = agreed
    if decision.verdict is Verdict.REGRESSED and decision.pairs >= FEWEST and len(base.processes) > 1 and chance > LEVEL:
        decision = replace(decision, verdict=Verdict.UNMEASURABLE)  # the pairs do not agree well enough
    place = None
    if decision.verdict is Verdict.REGRESSED:
        place = place_of([one[name] for one in base.processes], [one[name] for one in new.processes])
    return CellTimes(name, decision, chance, max(detectable, decision.noise**2) if np.isfinite(detectable) else detectable, place)


def _own_changes(base: Side, new: Side) -> list[Change]:
    """Return the changed counters of a user's commands."""
    changes = []
    for cell in dict.fromkeys([*base.own, *new.own]):
        if cell not in base.own or cell not in new.own:
            changes.append(Change(cell, "cell", *("measured" if cell in side.own else "missing" for side in (base, new))))
            continue
        old, now = base.own[cell], new.own[cell]
        changes += [
            Change(cell, name, str(old.get(name, "-")), str(now.get(name, "-")))
            for name in {**old, **now}
            if old.get(name) != now.get(name)
        ]
    return changes


def _verdict(changes: tuple[Change, ...], times: tuple[CellTimes, ...], found: tuple[Found, ...], *, expect_changes: bool) -> Verdict:
    verdicts = {entry.decision.verdict if entry.decision else Verdict.UNMEASURABLE for entry in times}
    wider = {one.verdict for one in found}
    counted = any(no_longer_planned(change) or not expect_changes for change in changes)
    if counted or Verdict.REGRESSED in verdicts | wider:
        return Verdict.REGRESSED
    return Verdict.FINE if verdicts == {Verdict.FINE} and Verdict.UNMEASURABLE not in wider else Verdict.UNMEASURABLE


def _lost_changes(base: Side, new: Side) -> list[Change]:
    """Return the cells that the new program lost in some of its processes, and the base in none."""
    return [Change(cell, "status", OK, status) for cell, status in new.lost.items() if cell not in base.lost]


def _names(side: Side) -> dict[Name, None]:
    """Return the cells of which any process has steps."""
    return dict.fromkeys(name for process in side.processes for name in process)


def _pairs(before: Side, now: Side, name: Name) -> tuple[FloatArray, FloatArray] | None:
    """Return the (pairs, steps) times of a cell, as many processes and rounds of both; None where steps differ, or a process has none."""
    base, new = ([process[name] for process in side.processes if name in process] for side in (before, now))
    if len(base) < len(before.processes) or len(new) < len(now.processes):
        return None
    if len({steps.total.shape[1] for steps in (*base, *new)}) > 1:
        return None
    processes, rounds = min(len(base), len(new)), min(len(steps.total) for steps in (*base, *new))
    here, there = (_rows([steps.total[:rounds] for steps in side[:processes]]) for side in (base, new))
    return here, there


def _known(base: FloatArray, new: FloatArray) -> bool:
    return base.size > 0 and all(bool(np.all(np.isfinite(side) & (side > 0.0))) for side in (base, new))


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


def _short_names(cells: list[Name]) -> Mapping[Name, Name]:
    """Return cells with roads and vehicles by the name of their file alone, where that still tells them apart."""
    short = {cell: tuple(Path(part).name if Path(part).is_absolute() else part for part in cell) for cell in cells}
    return short if len(set(short.values())) == len(short) else {cell: cell for cell in cells}
