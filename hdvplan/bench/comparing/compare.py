"""Compare two benchmarks: exact counters first, then times, cell by cell, and statistics over all of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from hdvplan.arrays import FloatArray
from hdvplan.bench.comparing.counters import WORK_TOLERANCE, Change, Tolerance, changes_of
from hdvplan.bench.comparing.decision import Decision, Rule, Verdict, agreement, are_times, judge, judge_whole
from hdvplan.bench.comparing.sides import IMPORT, PEAK, Name, Side
from hdvplan.bench.comparing.where import Place, place_of
from hdvplan.bench.tables import LOST, OK

_SCALES = {"ms": 1e3, "s": 1.0, "MB": 1e-6}
Values = tuple[FloatArray, FloatArray]  # of both sides, (pairs, cells)


@dataclass(frozen=True)
class Statistic:
    """A number of one process; larger is worse. A change counts if it exceeds both ``factor`` and ``floor`` (of the number's unit)."""

    name: str
    meaning: str
    unit: str
    factor: float
    floor: float
    times: str  # of what in a cell's ``Steps``; of the process as a whole, as ``Side.about`` names it
    of: Callable[[FloatArray], float] | None = None  # one number of the times; None: of the process as a whole

    def counting(self, base: float) -> float:
        """Return the ratio from which on a change counts."""
        return max(self.factor, 1.0 + self.floor / base) if base > 0.0 else np.inf


def statistics(rule: Rule) -> tuple[Statistic, ...]:
    """Return the statistics; ``rule`` says what counts for those of ordinary steps, and no factor is below its own."""

    def at_least(factor: float) -> float:
        return max(factor, rule.factor)

    floor = 1e3 * rule.floor
    return (
        Statistic("from outside", "every step's fastest round, by the clock of the drive", "ms", rule.factor, floor, "outside", _fastest),
        Statistic("typical", "every step's median round, by the clock of the drive", "ms", rule.factor, floor, "outside", _typical),
        Statistic("p99", "of all steps of all rounds", "ms", at_least(1.25), 5.0 * floor, "outside", lambda all_: np.quantile(all_, 0.99)),
        Statistic("worst", "of all steps of all rounds", "ms", at_least(1.5), 10.0 * floor, "outside", np.max),
        Statistic("first plan", "the fastest of the drives' first plans", "ms", at_least(1.25), 10.0 * floor, "first", np.min),
        Statistic("import", "until what plans is loaded", "s", at_least(1.15), 0.1, IMPORT),
        Statistic("memory", "largest of the processes", "MB", at_least(1.03), 20.0, PEAK),
    )


def _fastest(times: FloatArray) -> float:
    return float(times.min(axis=0).mean())


def _typical(times: FloatArray) -> float:
    return float(np.median(times, axis=0).mean())


@dataclass(frozen=True)
class Found:
    """One statistic of two programs, over all cells."""

    statistic: Statistic
    base: float  # median over the processes, mean over the cells
    new: float
    ratio: float  # median over the pairs of the geometric mean over the cells
    pairs: int
    chance: float  # see ``Agreement``
    detectable: float  # the ratio that would have been found, and counts
    verdict: Verdict

    @property
    def unseen(self) -> bool:
        """Whether nothing was found, but the pairs differ so much that a change of the size that counts could hide among them."""
        return self.verdict is Verdict.FINE and self.detectable > self.statistic.counting(self.base)


@dataclass(frozen=True)
class CellTimes:
    """The decision about one cell's planning time; None where its steps cannot be paired because the sides took different ones."""

    cell: Name
    decision: Decision | None
    chance: float = 1.0  # see ``Agreement``
    detectable: float = np.inf  # the ratio that would have been found
    place: Place | None = None  # of a cell that became slower

    @property
    def verdict(self) -> Verdict:
        """The verdict on this cell."""
        return self.decision.verdict if self.decision else Verdict.UNMEASURABLE


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

    What was planned before and is not any more is one in any case. All times are judged together: the more there are, the better the
    pairs of processes must agree in one of them.
    """
    lost = [Change(cell, "status", OK, status) for cell, status in new.lost.items() if cell not in base.lost]
    changes = (*changes_of(base.counters, new.counters, tolerance), *_own_changes(base, new), *lost)
    processes = min(len(base.processes), len(new.processes))
    there = _names(new)
    cells = {name: _pairs(base, new, name) for name in _names(base) if name in there}
    known = {name: both for name, both in cells.items() if both is not None and all(map(are_times, both)) and len(both[0]) == processes}
    whole = {one: values for one in statistics(rule) if processes > 1 and (values := _values(base, new, one, processes))}
    rows = [np.log(there.mean(axis=1) / here.mean(axis=1)) for here, there in known.values()]
    rows += [np.log(there / here).mean(axis=1) for here, there in whole.values()]
    agreed = agreement(np.array(rows).reshape(len(rows), processes))
    chances = list(zip(agreed.chance.tolist(), agreed.detectable.tolist(), strict=True))
    by_cell = dict(zip(known, chances, strict=False))
    times = tuple(_cell_times(name, both, rule, by_cell.get(name), base, new) for name, both in cells.items())
    found = tuple(
        _found(one, values, row, *chance)
        for (one, values), row, chance in zip(whole.items(), rows[len(known) :], chances[len(known) :], strict=True)
    )
    short = _short_names([change.cell for change in changes] + list(cells))
    return Comparison(
        tuple(
            replace(change, cell=short[change.cell], why=new.last_words.get(change.cell, "") if no_longer_planned(change) else "")
            for change in changes
        ),
        tuple(replace(entry, cell=short[entry.cell]) for entry in times),
        _verdict(changes, times, found, expect_changes=expect_changes),
        processes,
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


def _verdict(changes: Iterable[Change], times: Iterable[CellTimes], found: Iterable[Found], *, expect_changes: bool) -> Verdict:
    cells, wider = {entry.verdict for entry in times}, {one.verdict for one in found}
    counted = any(no_longer_planned(change) or not expect_changes for change in changes)
    if counted or Verdict.REGRESSED in cells | wider:
        return Verdict.REGRESSED
    return Verdict.FINE if cells == {Verdict.FINE} and Verdict.UNMEASURABLE not in wider else Verdict.UNMEASURABLE


def _cell_times(name: Name, both: Values | None, rule: Rule, agreed: tuple[float, float] | None, base: Side, new: Side) -> CellTimes:
    if both is None or agreed is None:
        return CellTimes(name, both and judge(*both, rule))
    chance, detectable = agreed
    decision, place = judge(*both, rule, chance), None
    if decision.verdict is Verdict.REGRESSED:
        place = place_of([one[name] for one in base.processes], [one[name] for one in new.processes])
    return CellTimes(name, decision, chance, max(detectable, decision.noise**2) if np.isfinite(detectable) else detectable, place)


def _found(one: Statistic, values: Values, log_ratios: FloatArray, chance: float, detectable: float) -> Found:
    here, there = (float(np.median(side.mean(axis=1))) for side in values)
    ratios = np.exp(log_ratios)
    verdict = judge_whole(ratios, there - here, one.factor, one.floor, chance)
    return Found(one, here, there, float(np.median(ratios)), len(ratios), chance, max(detectable, one.counting(here)), verdict)


def _own_changes(base: Side, new: Side) -> list[Change]:
    """Return the changed counters of a user's commands."""
    changes = []
    for cell in dict.fromkeys([*base.own, *new.own]):
        if cell not in base.own or cell not in new.own:
            changes.append(Change(cell, "cell", *("measured" if cell in side.own else "missing" for side in (base, new))))
            continue
        old, now = base.own[cell], new.own[cell]
        changed = [name for name in {**old, **now} if old.get(name) != now.get(name)]
        changes += [Change(cell, name, str(old.get(name, "-")), str(now.get(name, "-"))) for name in changed]
    return changes


def _names(side: Side) -> dict[Name, None]:
    """Return the cells of which any process has steps."""
    return dict.fromkeys(name for process in side.processes for name in process)


def _pairs(before: Side, now: Side, name: Name) -> Values | None:
    """Return the (pairs, steps) times of a cell, as many processes and rounds of both; None where steps differ, or a process has none.

    Every step counts with its fastest round. One process has no pairs. Its rounds are left out in turn instead: that shows whether the
    minima rest on single rounds, but nothing of what differs between processes.
    """
    sides = [[process[name].total for process in side.processes if name in process] for side in (before, now)]
    every = [times for side in sides for times in side]
    if len(every) < len(before.processes) + len(now.processes) or len({times.shape[1] for times in every}) > 1:
        return None
    processes, rounds = min(map(len, sides)), min(map(len, every))
    here, there = ([times[:rounds] for times in side[:processes]] for side in sides)
    if processes == 1 and rounds > 1:
        here, there = ([np.delete(side[0], left_out, axis=0) for left_out in range(rounds)] for side in (here, there))
    return tuple(np.array([times.min(axis=0, initial=np.inf) for times in side]) for side in (here, there))  # type: ignore[return-value] # two


def _values(base: Side, new: Side, one: Statistic, pairs: int) -> Values | None:
    """Return a statistic of both sides, (pairs, cells) in its unit; None where it is not known of all processes."""
    every, first = [*base.processes, *new.processes], base.processes[0]
    names = [
        name for name in first if all(name in process and process[name].total.shape[1] == first[name].total.shape[1] for process in every)
    ]
    tables = []
    for side in (base, new):
        if one.of is None:
            rows = [[about[one.times]] if one.times in about else [] for about in side.about[:pairs]]
        else:
            cells = [[getattr(process[name], one.times) for name in names] for process in side.processes[:pairs]]
            rows = [[one.of(times) if times.size else np.nan for times in row] for row in cells]
        if len(rows) < pairs or not all(rows):
            return None
        tables.append(_SCALES[one.unit] * np.array(rows, dtype=np.float64))
    usable = np.all([np.isfinite(table) & (table > 0.0) for table in tables], axis=(0, 1))
    return (tables[0][:, usable], tables[1][:, usable]) if np.any(usable) else None


def _short_names(cells: list[Name]) -> Mapping[Name, Name]:
    """Return cells with roads and vehicles by the name of their file alone, where that still tells them apart."""
    short = {cell: tuple(Path(part).name if Path(part).is_absolute() else part for part in cell) for cell in cells}
    return short if len(set(short.values())) == len(short) else {cell: cell for cell in cells}
