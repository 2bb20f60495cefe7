"""Compare two benchmarks: exact counters first, then times, cell by cell, and quantities of whole processes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from hdvplan.bench.comparing.counters import WORK, WORK_TOLERANCE, Change, Tolerance, broken_in_both, changes_of
from hdvplan.bench.comparing.decision import FEWEST, Decision, GateVerdict, Pairs, Rule, decide
from hdvplan.bench.comparing.quantities import Abouts, Quantity, Values, cut_to, fastest, of_all, of_cell, quantities, step_of
from hdvplan.bench.comparing.sides import (
    COLD,
    CPU,
    FILES,
    LOAD,
    SETTINGS,
    START,
    UNREPORTED,
    Name,
    Processes,
    Side,
    alike,
    cold_name,
    own_changes,
)
from hdvplan.bench.measuring.samples import OK
from hdvplan.bench.suite import KEY, cell_words
from hdvplan.errors import OptionError

_BUSY = 0.8  # of the time of steps that is processor time, unless they wait
_CHOICE = {"solvers", "vehicles", "roads", "schemes", "classes", "rounds", "budget", "step_limit", "cell_limit", "memory_limit"}
_SCALES = {"ms": 1e3, "s": 1.0, "MB": 1e-6}


@dataclass(frozen=True)
class Entry:
    """The decision about one quantity: of a cell, or of whole processes and all cells, whose ``cell`` is none."""

    cell: Name
    quantity: Quantity
    decision: Decision
    by_cpu: bool = False  # decided by processor time, as the clock could not

    @property
    def verdict(self) -> GateVerdict:
        """The verdict on it."""
        return self.decision.verdict

    @property
    def is_of_cell(self) -> bool:
        """Whether it is about one cell."""
        return len(self.cell) == len(KEY)

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
    found: tuple[Entry, ...] = ()  # of whole processes, over all cells, and besides the mean step of each of several cells
    failure: Failure | None = None
    strict: bool = False  # what could not be seen prevents an answer
    expected: bool = False  # changed counters are no regression, as the user expects them
    load: float = np.nan  # the machine's load average meanwhile, where it is known
    about: str = ""  # which programs these were, and on what machine
    elsewhere: bool = False  # the sides were measured on different machines: times do not count
    apart: bool = False  # at different times: nothing proves a slower program
    broken: tuple[Change, ...] = ()  # statuses of cells that are alike not ok on both sides
    within: tuple[Change, ...] = ()  # sums of QPs or iterations that differ by no more than another processor's rounding may make

    @property
    def proves(self) -> bool:
        """Whether pairs of processes that ran side by side may prove a slower program: others differ by the machine's hour, too."""
        return self.processes != 1 and not self.apart

    @property
    def is_settled(self) -> bool:
        """Whether more pairs could change nothing: the times are fine, or something is proven to be worse."""
        entries = [*self.times, *self.found]
        fine = all(entry.verdict is GateVerdict.FINE and not (self.strict and entry.decision.unseen) for entry in entries)
        return fine or (self.processes >= FEWEST and self.verdict is GateVerdict.REGRESSED)


def compare(base: Side, new: Side, rule: Rule, tolerance: Tolerance, *, expect_changes: bool, strict: bool = False) -> Comparison:
    """Return what differs between two sides; changed counters are a regression unless ``expect_changes``.

    What could not be seen prevents no answer unless ``strict``.

    What was planned before and is not any more is one in any case, a cell that is new in none. Times are compared over the rounds and steps
    that both sides have. All are judged together: the more there are, the better the pairs of processes must agree in one of them. Of
    different machines counters alone count, with the room that another one's rounding needs.
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
    cells = {(name, step): of_cell(here, there, name) for name in here[0]}
    cells |= {(cold_name(name), step): of_cell(*cold, name) for name in cold[0][0]} if len(cold[0]) == pairs > 1 else {}
    whole: dict[tuple[Name, Quantity], Values | None] = {
        ((), one): of_all(one, (here, base.about), (there, new.about)) for one in quantities(rule)
    }
    for one in quantities(rule):
        if one.when_cold:
            whole[(COLD,), one] = of_all(one, (cold[0], base.cold_about), (cold[1], new.cold_about))
    if len(here[0]) > 1:  # of cells one alone, too: in their mean a faster one would pay for another's stalls
        sides = {name: ((cut_to(here, name), ()), (cut_to(there, name), ())) for name in here[0]}
        whole |= {(name, one): of_all(one, *both) for name, both in sides.items() for one in quantities(rule) if one.of is not None}
    judged = cells | {key: both for key, both in whole.items() if both is not None and len(both[0]) == pairs > 1}
    decisions = decide(
        [_pairs(one, both, needed=(name, one) in cells, independent=pairs > 1 and not apart) for (name, one), both in judged.items()]
    )
    entries = [Entry(name, one, decision) for (name, one), decision in zip(judged, decisions, strict=True)]
    found = tuple(entries[len(cells) :])
    times = [_by_cpu(entry, found, here, base.about) for entry in entries[: len(cells)]]
    missing = [name for name in _names(base) if name in _names(new) and name not in here[0]]
    times += [Entry(name, step, Decision(GateVerdict.UNMEASURABLE, 0)) for name in missing]
    broken = broken_in_both(base.counters, new.counters)
    short = _short_names([change.cell for change in (*changes, *broken)] + [entry.cell for entry in times])
    return Comparison(
        tuple(
            replace(change, cell=short[change.cell], why=new.last_words.get(change.cell, "") if change.is_lost else "")
            for change in changes
        ),
        tuple(replace(entry, cell=short[entry.cell]) for entry in times),
        _verdict(changes, times, found, expect_changes=expect_changes, strict=strict),
        min(len(base.processes), len(new.processes)),
        tuple(replace(entry, cell=short.get(entry.cell, entry.cell)) for entry in found),
        strict=strict,
        expected=expect_changes,
        load=_mean([about[LOAD] for side in (base, new) for about in side.about if LOAD in about]),
        elsewhere=elsewhere,
        apart=apart,
        broken=tuple(replace(change, cell=short[change.cell]) for change in broken),
    )


def compare_counters(baseline: pd.DataFrame, measured: pd.DataFrame, *, exact: bool = False) -> Comparison:
    """Return what differs from a committed baseline, without times; unless ``exact`` with the room that another machine's rounding needs.

    A cell that the baseline does not have is no regression.
    """
    changes = tuple(changes_of(baseline, measured, Tolerance(work=0.0 if exact else WORK_TOLERANCE)))
    within = tuple(one for one in changes_of(baseline, measured, Tolerance()) if one.counter in WORK and one not in changes)
    verdict = GateVerdict.REGRESSED if any(one.is_red(expected=False) for one in changes) else GateVerdict.FINE
    return Comparison(changes, (), verdict, 1, broken=tuple(broken_in_both(baseline, measured)), within=within)


def failed(side: str, message: str, tail: str, *, blameless: bool = False) -> Comparison:
    """Return the comparison of programs of which one could not be measured: a new one is a regression, a base prevents an answer.

    So does a ``blameless`` failure, which says nothing about the program.
    """
    verdict = GateVerdict.REGRESSED if side == "new" and not blameless else GateVerdict.UNMEASURABLE
    return Comparison((), (), verdict, 0, (), Failure(side, message, tail))


def _verdict(
    changes: Iterable[Change], times: Sequence[Entry], found: Iterable[Entry], *, expect_changes: bool, strict: bool
) -> GateVerdict:
    counted = any(change.is_red(expected=expect_changes) for change in changes)
    doubts = [entry for entry in found if entry.decision.is_doubtful or (strict and entry.decision.unseen)]
    if counted or any(entry.is_worse for entry in (*times, *found)):
        return GateVerdict.REGRESSED
    return (
        GateVerdict.FINE if times and all(entry.verdict is GateVerdict.FINE for entry in times) and not doubts else GateVerdict.UNMEASURABLE
    )


def _pairs(one: Quantity, both: Values, *, needed: bool, independent: bool) -> Pairs:
    base, new = (_SCALES[one.unit] * side for side in both)
    return Pairs(base, new, one.factor, one.floor, needed, independent)


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
    lasted = {cell: _mean([fastest(one[cell].outside) * one[cell].outside.size for one in processes]) for cell in processes[0]}
    beside = [
        one.get(START, np.nan) + one.get(UNREPORTED, 0.0) + sum(float(np.sum(steps.first)) for steps in cells.values())
        for cells, one in zip(processes, about, strict=False)
    ]
    spent = _mean([one[CPU] for one in about])
    return min(1.0, lasted[name] / spent) if spent - float(np.min(beside)) >= _BUSY * sum(lasted.values()) else np.nan


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if values else np.nan


def check_comparable(base: Side, new: Side) -> None:
    """Refuse sides whose cells are not the same: none has the same name, or settings or the content of files differ.

    Which cells there are, and how often, is no such setting.

    Raises:
        OptionError: they are such.

    """
    ours, theirs = _names(base), _names(new)
    if ours and theirs and not ours.keys() & theirs.keys():
        msg = f"no cell is in both: the base has {cell_words(next(iter(ours)))}, the new run {cell_words(next(iter(theirs)))}"
        raise OptionError(msg, hint="compare two runs of the same cells: --suite FILE keeps them")
    words = [f"{name} was {was}, is {now}" for name, was, now in _differing(base, new, SETTINGS) if name not in _CHOICE]
    words += [f"{name} has another content" for name, _, _ in _differing(base, new, FILES)]
    if words:
        msg = f"these are not the same cells: {'; '.join(words)}"
        raise OptionError(msg, hint="measure both with the same settings and files; --suite FILE keeps settings")


def _differing(base: Side, new: Side, name: str) -> list[tuple[str, object, object]]:
    was, now = (side.records[0].get(name, {}) if side.records else {} for side in (base, new))
    return [(entry, was[entry], now[entry]) for entry in was if entry in now and was[entry] != now[entry]]


def _names(side: Side) -> dict[Name, None]:
    return dict.fromkeys(name for process in side.processes for name in process)


def _short_names(cells: list[Name]) -> Mapping[Name, Name]:
    """Return cells with roads and vehicles by the name of their file alone, where that still tells them apart."""
    short = {cell: tuple(Path(part).name if Path(part).is_absolute() else part for part in cell) for cell in cells}
    return short if len(set(short.values())) == len(short) else {cell: cell for cell in cells}
