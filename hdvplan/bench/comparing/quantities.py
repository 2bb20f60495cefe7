"""What is compared of two programs: the quantities, and their values in every pair of processes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.bench.comparing.decision import Rule
from hdvplan.bench.comparing.sides import CPU, IMPORT, PEAK, START, UNREPORTED, Name, Processes

_GROUPS = 10  # of the rounds of a single process
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
    return Quantity("mean step", "every step's fastest round", "ms", rule.factor, 1e3 * rule.floor, "total", fastest)


def quantities(rule: Rule) -> tuple[Quantity, ...]:
    """Return the quantities besides; ``rule`` says what counts for ordinary steps, and no factor is below its own."""

    def at_least(factor: float) -> float:
        return max(factor, rule.factor)

    floor = 1e3 * rule.floor
    return (
        Quantity("from outside", "every step's fastest round, by the clock of the drive", "ms", rule.factor, floor, "outer", fastest),
        Quantity("typical", "every step's median round", "ms", rule.factor, floor, "outside", _typical),
        Quantity("first round", "before answers are known", "ms", at_least(1.25), 5.0 * floor, "outside", _first_round),
        Quantity("p99", "of all steps of all rounds", "ms", at_least(1.25), 5.0 * floor, "outside", lambda all_: np.quantile(all_, 0.99)),
        Quantity("worst", "of all steps of all rounds", "ms", at_least(1.5), 10.0 * floor, "outside", np.max),
        Quantity("first plan", "the fastest of the drives' first plans", "ms", at_least(1.25), 10.0 * floor, "first", np.min),
        Quantity("import", "loading modules, in all processes that it starts", "s", at_least(1.15), 0.1, IMPORT),
        Quantity("start-up", "until the first turn, else all beside the steps", "s", at_least(1.15), 0.1, START, when_cold=True),
        Quantity("unreported", "in its turns, beside the steps", "s", at_least(1.15), 0.1, UNREPORTED),
        Quantity("CPU", "processor time of the whole process", "s", at_least(1.08), 0.02, CPU, when_cold=True),
        Quantity("memory", "largest of the processes", "MB", at_least(1.03), 20.0, PEAK),
    )  # fmt: skip


def fastest(times: FloatArray) -> float:
    """Return the mean planning step of (rounds, steps) times, every step with its fastest round."""
    return float(times.min(axis=0).mean())


def _typical(times: FloatArray) -> float:
    return float(np.median(times, axis=0).mean())


def _first_round(times: FloatArray) -> float:
    return float(times[0].mean()) if len(times) > 1 else np.nan  # the only one is judged already


def of_cell(here: Processes, there: Processes, name: Name) -> Values:
    """Return a cell's mean planning step of both sides, (pairs,) [s], every step with its fastest round.

    One process has no pairs. Some of its rounds are left out in turn instead: that shows whether the minima rest on single rounds, but
    nothing of what differs between processes.
    """
    sides = [[process[name].total for process in side] for side in (here, there)]
    if len(here) == 1 and (rounds := len(sides[0][0])) > 1:
        groups = np.array_split(np.arange(rounds), min(rounds, _GROUPS))
        sides = [[np.delete(side[0], group, axis=0) for group in groups] for side in sides]
    base, new = (np.array([fastest(times) for times in side]) for side in sides)
    return base, new


def of_all(one: Quantity, base: tuple[Processes, Abouts], new: tuple[Processes, Abouts]) -> Values | None:
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


def cut_to(processes: Processes, name: Name) -> Processes:
    """Return the processes with one cell alone."""
    return [{name: cells[name]} for cells in processes]
