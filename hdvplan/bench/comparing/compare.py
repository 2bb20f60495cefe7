"""Compare two benchmarks: exact counters first, then times, cell by cell, and quantities of whole processes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from hdvplan.arrays import FloatArray
from hdvplan.bench.comparing.counters import WORK_TOLERANCE, Change, Tolerance, changes_of
from hdvplan.bench.comparing.decision import FEWEST, Decision, GateVerdict, Pairs, Rule, decide
from hdvplan.bench.comparing.sides import (
    COLD,
    CPU,
    IMPORT,
    LOAD,
    PEAK,
    START,
    UNREPORTED,
    Name,
    Processes,
    Side,
    alike,
    cold_name,
    own_changes,
)
from hdvplan.bench.tables import OK

_GROUPS = 10  # of the rounds of a single process
_BUSY = 0.8  # of the time of steps that is processor time, unless they wait
_SCALES = {"ms": 1e3, "s": 1.0, "MB": 1e-6}
Values = tuple[FloatArray, FloatArray]  # of both sides, (pairs,)
Abouts = Sequence[Mapping[str, float]]


@dataclass(frozen=True)
class Quantity:
    """A number of one process; larger is worse. A change counts if it exceeds both ``factor`` and ``floor`` (of the number's unit)."""

    name: str
    meaning: str
    unit: str
    factor: float
    floor: float
    times: str  # of what in a cell's ``Steps``; of the process as a whole, as ``Side.about`` names it
    of: Callable[[FloatArray], float] | None = None  # one number of the times; None: of the process as a whole
    when_cold: bool = False  # also of processes that begin with an empty home


def step_of(rule: Rule) -> Quantity:
    """Return the quantity of which noise prevents an answer: a cell's mean planning step."""
    return Quantity("mean step", "every step's fastest round", "ms", rule.factor, 1e3 * rule.floor, "total", _fastest)


def quantities(rule: Rule) -> tuple[Quantity, ...]:
    """Return the quantities over all cells; ``rule`` says what counts for ordinary steps, and no factor is below its own."""

    def at_least(factor: float) -> float:
        return max(factor, rule.factor)

    floor = 1e3 * rule.floor
    return (
        Quantity("from outside", "every step's fastest round, by the clock of the drive", "ms", rule.factor, floor, "outer", _fastest),
        Quantity("typical", "every step's median round", "ms", rule.factor, floor, "outside", _typical),
        Quantity("p99", "of all steps of all rounds", "ms", at_least(1.25), 5.0 * floor, "outside", lambda all_: np.quantile(all_, 0.99)),
        Quantity("worst", "of all steps of all rounds", "ms", at_least(1.5), 10.0 * floor, "outside", np.max),
        Quantity("first plan", "the fastest of the drives' first plans", "ms", at_least(1.25), 10.0 * floor, "first", np.min),
        Quantity("import", "loading modules, in all processes that it starts", "s", at_least(1.15), 0.1, IMPORT),
        Quantity("start-up", "until the first turn, else all beside the steps", "s", at_least(1.15), 0.1, START, when_cold=True),
        Quantity("unreported", "in its turns, beside the steps", "s", at_least(1.15), 0.1, UNREPORTED),
        Quantity("CPU", "processor time of the whole process", "s", at_least(1.08), 0.02, CPU, when_cold=True),
        Quantity("memory", "largest of the processes", "MB", at_least(1.03), 20.0, PEAK),
    )  # fmt: skip


def _fastest(times: FloatArray) -> float:
    return float(times.min(axis=0).mean())


def _typical(times: FloatArray) -> float:
    return float(np.median(times, axis=0).mean())


@dataclass(frozen=True)
class Entry:
    """The decision about one quantity: of a cell, or of whole processes, whose ``cell`` is empty."""

    cell: Name
    quantity: Quantity
    decision: Decision
    by_cpu: bool = False  # decided by processor time, as the clock could not

    @property
    def verdict(self) -> GateVerdict:
        """The verdict on it."""
        return self.decision.verdict

    @property
    def is_worse(self) -> bool:
        """Whether it regressed."""
        return self.verdict is GateVerdict.REGRESSED


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
    times: tuple[Entry, ...]  # of cells
    verdict: GateVerdict
    processes: int  # pairs of processes; of one process a side the rounds are the pairs
    found: tuple[Entry, ...] = ()  # of whole processes, over all cells
    failure: Failure | None = None
    expected: bool = False  # changed counters are no regression, as the user expects them
    load: float = np.nan  # the machine's load average meanwhile, where it is known
    about: str = ""  # which programs these were, and on what machine
    elsewhere: bool = False  # the sides were measured on different machines: times do not count
    apart: bool = False  # at different times: nothing proves a slower program

    @property
    def proves(self) -> bool:
        """Whether pairs of processes that ran side by side may prove a slower program: others differ by the machine's hour, too."""
        return self.processes != 1 and not self.apart

    @property
    def is_settled(self) -> bool:
        """Whether more pairs could change nothing: the times are fine, or something is proven to be worse."""
        entries = [*self.times, *self.found]
        fine = all(entry.verdict is GateVerdict.FINE for entry in entries)
        return fine or (self.processes >= FEWEST and self.verdict is GateVerdict.REGRESSED)


def compare(base: Side, new: Side, rule: Rule, tolerance: Tolerance, *, expect_changes: bool) -> Comparison:
    """Return what differs between two sides; changed counters are a regression unless ``expect_changes``.

    What was planned before and is not any more is one in any case. Times are compared over the rounds and steps that both sides have. All
    are judged together: the more there are, the better the pairs of processes must agree in one of them. Of different machines counters
    alone count, with the room that another one's rounding needs.
    """
    elsewhere = bool(base.machines and new.machines) and base.machines != new.machines
    if elsewhere:
        base, new = (replace(side, processes=(), about=(), cold=(), cold_about=()) for side in (base, new))
        tolerance = replace(tolerance, work=WORK_TOLERANCE)
    apart = bool(base.comparisons and new.comparisons) and base.comparisons != new.comparisons
    lost = [Change(cell, "status", OK, status) for cell, status in new.lost.items() if cell not in base.lost]
    changes = (*changes_of(base.counters, new.counters, tolerance), *own_changes(base, new), *lost)
    here, there = alike(base.processes, new.processes)
    cold = alike(base.cold, new.cold)
    step, pairs = step_of(rule), len(here)
    cells = {(name, step): _of_cell(here, there, name) for name in here[0]}
    cells |= {(cold_name(name), step): _of_cell(*cold, name) for name in cold[0][0]} if len(cold[0]) == pairs > 1 else {}
    whole: dict[tuple[Name, Quantity], Values | None] = {
        ((), one): _of_all(one, (here, base.about), (there, new.about)) for one in quantities(rule)
    }
    for one in quantities(rule):
        if one.when_cold:
            whole[(COLD,), one] = _of_all(one, (cold[0], base.cold_about), (cold[1], new.cold_about))
    judged = cells | {key: both for key, both in whole.items() if both is not None and len(both[0]) == pairs > 1}
    decisions = decide(
        [_pairs(one, both, needed=(name, one) in cells, independent=pairs > 1 and not apart) for (name, one), both in judged.items()]
    )
    entries = [Entry(name, one, decision) for (name, one), decision in zip(judged, decisions, strict=True)]
    found = tuple(entries[len(cells) :])
    times = [_by_cpu(entry, found, here, base.about) for entry in entries[: len(cells)]]
    missing = [name for name in _names(base) if name in _names(new) and name not in here[0]]
    times += [Entry(name, step, Decision(GateVerdict.UNMEASURABLE, 0)) for name in missing]
    short = _short_names([change.cell for change in changes] + [entry.cell for entry in times])
    return Comparison(
        tuple(
            replace(change, cell=short[change.cell], why=new.last_words.get(change.cell, "") if change.is_lost else "")
            for change in changes
        ),
        tuple(replace(entry, cell=short[entry.cell]) for entry in times),
        _verdict(changes, times, found, expect_changes=expect_changes),
        min(len(base.processes), len(new.processes)),
        found,
        expected=expect_changes,
        load=_mean([about[LOAD] for side in (base, new) for about in side.about if LOAD in about]),
        elsewhere=elsewhere,
        apart=apart,
    )


def compare_counters(baseline: pd.DataFrame, measured: pd.DataFrame) -> Comparison:
    """Return what differs from a committed baseline, with the room that another machine's rounding needs; no times."""
    changes = tuple(changes_of(baseline, measured, Tolerance(work=WORK_TOLERANCE)))
    return Comparison(changes, (), GateVerdict.REGRESSED if changes else GateVerdict.FINE, 1)


def failed(side: str, message: str, tail: str, *, blameless: bool = False) -> Comparison:
    """Return the comparison of programs of which one could not be measured: a new one is a regression, a base prevents an answer.

    So does a ``blameless`` failure, which says nothing about the program.
    """
    verdict = GateVerdict.REGRESSED if side == "new" and not blameless else GateVerdict.UNMEASURABLE
    return Comparison((), (), verdict, 0, (), Failure(side, message, tail))


def _verdict(changes: Iterable[Change], times: Sequence[Entry], found: Iterable[Entry], *, expect_changes: bool) -> GateVerdict:
    counted = any(change.is_lost or not expect_changes for change in changes)
    doubts = [entry for entry in found if entry.verdict is GateVerdict.UNMEASURABLE and entry.decision.pairs < FEWEST]
    if counted or any(entry.is_worse for entry in (*times, *found)):
        return GateVerdict.REGRESSED
    return (
        GateVerdict.FINE if times and all(entry.verdict is GateVerdict.FINE for entry in times) and not doubts else GateVerdict.UNMEASURABLE
    )


def _pairs(one: Quantity, both: Values, *, needed: bool, independent: bool) -> Pairs:
    base, new = (_SCALES[one.unit] * side for side in both)
    return Pairs(base, new, one.factor, one.floor, needed, independent)


def _of_cell(here: Processes, there: Processes, name: Name) -> Values:
    """Return a cell's mean planning step of both sides, (pairs,) [s], every step with its fastest round.

    One process has no pairs. Some of its rounds are left out in turn instead: that shows whether the minima rest on single rounds, but
    nothing of what differs between processes.
    """
    sides = [[process[name].total for process in side] for side in (here, there)]
    if len(here) == 1 and (rounds := len(sides[0][0])) > 1:
        groups = np.array_split(np.arange(rounds), min(rounds, _GROUPS))
        sides = [[np.delete(side[0], group, axis=0) for group in groups] for side in sides]
    base, new = (np.array([_fastest(times) for times in side]) for side in sides)
    return base, new


def _of_all(one: Quantity, base: tuple[Processes, Abouts], new: tuple[Processes, Abouts]) -> Values | None:
    """Return a quantity of both sides, (pairs,) in SI units, of cells their geometric mean; None where it is not known of all processes."""
    if one.of is None:
        if not all(one.times in about for _, abouts in (base, new) for about in abouts):
            return None
        here, there = (np.array([about[one.times] for about in abouts]) for _, abouts in (base, new))
        return (here, there) if here.size and here.shape == there.shape else None
    tables = [
        np.array([[one.of(times) if (times := getattr(steps, one.times)).size else np.nan for steps in cells.values()] for cells in side])
        for side, _ in (base, new)
    ]
    usable = np.all([np.isfinite(table) & (table > 0.0) for table in tables], axis=(0, 1))
    if not np.any(usable):
        return None
    here, there = (np.exp(np.log(table[:, usable]).mean(axis=1)) for table in tables)
    return here, there


def _by_cpu(entry: Entry, found: Iterable[Entry], here: Processes, about: Sequence[Mapping[str, float]]) -> Entry:
    """Return a cell that the clock leaves open as fine where the processor time of whole processes leaves no room for what counts.

    A cell takes a share of the process: its slowdown shows in that share of the processor time alone. Neither the interval of the
    processor time nor what its noise hides may leave that room.
    """
    cpu = next((one.decision for one in found if one.quantity.times == CPU and not one.cell), None)
    open_ = entry.verdict is GateVerdict.UNMEASURABLE and entry.decision.ratio <= entry.decision.counting
    if cpu is None or not open_ or cpu.verdict is not GateVerdict.FINE or cpu.pairs < FEWEST or entry.cell not in here[0]:
        return entry
    hidden = 1.0 + (max(cpu.high, cpu.shown) - 1.0) / _share(here, about, entry.cell)
    if not hidden <= entry.decision.counting:
        return entry
    return replace(entry, decision=replace(entry.decision, verdict=GateVerdict.FINE), by_cpu=True)


def _share(processes: Processes, about: Abouts, name: Name) -> float:
    """Return the share of the processor time that a cell's steps take; NaN of steps that wait instead, or of which that is not known.

    The processor time without the start must be about what all steps last, each with its fastest round.
    """
    lasted = {cell: _mean([_fastest(one[cell].outside) * one[cell].outside.size for one in processes]) for cell in processes[0]}
    beside = [
        one.get(START, np.nan) + one.get(UNREPORTED, 0.0) + sum(float(np.sum(steps.first)) for steps in cells.values())
        for cells, one in zip(processes, about, strict=False)
    ]
    spent = _mean([one[CPU] for one in about])
    return min(1.0, lasted[name] / spent) if spent - float(np.min(beside)) >= _BUSY * sum(lasted.values()) else np.nan


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if values else np.nan


def _names(side: Side) -> dict[Name, None]:
    """Return the cells of which any process has steps."""
    return dict.fromkeys(name for process in side.processes for name in process)


def _short_names(cells: list[Name]) -> Mapping[Name, Name]:
    """Return cells with roads and vehicles by the name of their file alone, where that still tells them apart."""
    short = {cell: tuple(Path(part).name if Path(part).is_absolute() else part for part in cell) for cell in cells}
    return short if len(set(short.values())) == len(short) else {cell: cell for cell in cells}
