"""What is compared of two programs, besides every cell's mean step: all statistics, each with the change of it that counts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.bench.gate import Rule, Verdict
from hdvplan.bench.joint import FEWEST, LEVEL, agreement
from hdvplan.bench.sides import IMPORT, PEAK, Name, Side, Steps

_SUSPECT = 0.8  # share of a first few pairs that must show a change for it to be looked at again


@dataclass(frozen=True)
class Statistic:
    """A number of one process; larger is worse. A change counts if it exceeds both ``factor`` and ``floor`` (of the number's unit)."""

    name: str
    meaning: str
    unit: str
    factor: float
    floor: float
    of: Callable[[Steps], float] | None = None  # of one cell; None: of the process as a whole, by ``key``
    key: str = ""


def statistics(rule: Rule) -> tuple[Statistic, ...]:
    """Return the statistics; ``rule`` says what counts for those of ordinary steps, and no factor is below its own."""

    def at_least(factor: float) -> float:
        return max(factor, rule.factor)

    floor = 1e3 * rule.floor
    return (
        Statistic("from outside", "every step's fastest round, by the clock of the drive", "ms", rule.factor, floor, _fastest),
        Statistic("typical", "every step's median round, by the clock of the drive", "ms", rule.factor, floor, _typical),
        Statistic("p99", "of all steps of all rounds", "ms", at_least(1.25), 5.0 * floor, _p99),
        Statistic("worst", "of all steps of all rounds", "ms", at_least(1.5), 10.0 * floor, _worst),
        Statistic("first plan", "the fastest of the drives' first plans", "ms", at_least(1.25), 10.0 * floor, _first),
        Statistic("import", "until what plans is loaded", "s", at_least(1.15), 0.1, None, IMPORT),
        Statistic("memory", "largest of the processes", "MB", at_least(1.03), 20.0, None, PEAK),
    )


@dataclass(frozen=True)
class Found:
    """One statistic of two programs, over all cells; NaN where a side lacks it."""

    statistic: Statistic
    base: float  # median over the processes, mean over the cells
    new: float
    ratio: float  # median over the pairs of the geometric mean over the cells
    pairs: int
    chance: float  # see ``Agreement``
    detectable: float  # the ratio that would have been found, and counts
    verdict: Verdict  # UNMEASURABLE: large enough and shown by most of too few pairs; a repeat decides

    @property
    def unseen(self) -> bool:
        """Whether nothing was found, but the pairs differ so much that a change of the size that counts could hide among them."""
        return self.verdict is Verdict.FINE and self.detectable > _counting(self.statistic, self.base)


def joint_findings(
    base: Side, new: Side, rule: Rule, cells: Mapping[Name, FloatArray]
) -> tuple[tuple[Found, ...], dict[Name, tuple[float, float]]]:
    """Return the statistics of two sides, and of every cell's mean step the chance of its agreement and the detectable ratio.

    ``cells`` are the cells' ratios pair by pair, (pairs,). All are judged together.
    """
    pairs = min(len(base.processes), len(new.processes))
    known = [one for one in statistics(rule) if pairs > 1]
    values = {one.name: _values(base, new, one, pairs) for one in known}
    known = [one for one in known if values[one.name] is not None]
    rows = [np.log(ratios) for ratios in cells.values() if len(ratios) == pairs]
    rows += [_log_ratios(values[one.name]) for one in known]
    together = agreement(np.array(rows).reshape(len(rows), pairs))
    named = [name for name, ratios in cells.items() if len(ratios) == pairs]
    of_cells = {name: (float(together.chance[i]), float(together.detectable[i])) for i, name in enumerate(named)}
    found = [
        _found(one, values[one.name], pairs, float(together.chance[i]), float(together.detectable[i]))
        for i, one in enumerate(known, start=len(named))
    ]
    return tuple(found), of_cells


def _found(one: Statistic, values: tuple[FloatArray, FloatArray] | None, pairs: int, chance: float, detectable: float) -> Found:
    assert values is not None  # noqa: S101 - those without were left out
    here, there = (float(np.median(side.mean(axis=1))) for side in values)
    ratios = np.exp(_log_ratios(values))
    ratio = float(np.median(ratios))
    counts = ratio > one.factor and there - here > one.floor
    verdict = Verdict.FINE
    if counts and pairs >= FEWEST and chance <= LEVEL:
        verdict = Verdict.REGRESSED
    elif counts and pairs < FEWEST and np.mean(ratios > np.sqrt(one.factor)) >= _SUSPECT:
        verdict = Verdict.UNMEASURABLE
    return Found(one, here, there, ratio, pairs, chance, max(detectable, _counting(one, here)), verdict)


def _counting(one: Statistic, base: float) -> float:
    """Return the ratio from which on a change of a statistic counts."""
    return max(one.factor, 1.0 + one.floor / base) if base > 0.0 else np.inf


def _log_ratios(values: tuple[FloatArray, FloatArray] | None) -> FloatArray:
    """Return the pairs' log ratios, the mean over the cells."""
    assert values is not None  # noqa: S101 - as above
    base, new = values
    return np.asarray(np.log(new / base).mean(axis=1), np.float64)


def _values(base: Side, new: Side, one: Statistic, pairs: int) -> tuple[FloatArray, FloatArray] | None:
    """Return a statistic of both sides, (pairs, cells) in its unit; None where it is not known of all processes."""
    scale = {"ms": 1e3, "s": 1.0, "MB": 1e-6}[one.unit]
    everywhere = [*base.processes, *new.processes]
    names = [
        name
        for name in base.processes[0]
        if all(name in process and process[name].total.shape[1] == base.processes[0][name].total.shape[1] for process in everywhere)
    ]
    tables = []
    for side in (base, new):
        if one.of is None:
            rows = [[about[one.key]] if one.key in about else [] for about in side.about[:pairs]]
        else:
            rows = [[one.of(process[name]) for name in names] for process in side.processes[:pairs]]
        if len(rows) < pairs or not all(rows):
            return None
        tables.append(scale * np.array(rows, dtype=np.float64))
    usable = np.all(np.isfinite(tables[0]) & (tables[0] > 0.0), axis=0) & np.all(np.isfinite(tables[1]) & (tables[1] > 0.0), axis=0)
    return (tables[0][:, usable], tables[1][:, usable]) if np.any(usable) else None


def _fastest(steps: Steps) -> float:
    return float(steps.outside.min(axis=0, initial=np.inf).mean()) if steps.outside.size else np.nan


def _typical(steps: Steps) -> float:
    return float(np.median(steps.outside, axis=0).mean()) if steps.outside.size else np.nan


def _p99(steps: Steps) -> float:
    return float(np.quantile(steps.outside, 0.99)) if steps.outside.size else np.nan


def _worst(steps: Steps) -> float:
    return float(steps.outside.max()) if steps.outside.size else np.nan


def _first(steps: Steps) -> float:
    return float(steps.first.min()) if steps.first.size else np.nan
