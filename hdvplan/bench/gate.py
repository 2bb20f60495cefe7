"""Decide from raw samples whether planning became slower. Arrays in, verdict out: nothing here reads, runs or prints.

One process's statistic is the mean over planning steps of each step's fastest round: what the planner needs, with
interruptions that hit single steps removed. Two estimates of the slowdown are made from it: the median of the ratios of
pairs that ran one after the other, which drift cannot move, and the ratio of the sides' minima over all processes, which
processes that were slow as a whole cannot move. Only what both show is believed. p-values of samples within a process are
of no use here: they ask whether two processes differ, and two processes of the same program do.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from scipy.special import bdtr

from hdvplan.arrays import FloatArray
from hdvplan.errors import OptionError

FEWEST_PAIRS = 3  # fewer say nothing about their own spread
BATCH = 5  # pairs; twice as many are two batches, and the second is the repeat that a red needs
_CONFIDENCE = 0.75  # that the interval holds the median; of five pairs all, of ten the third to the eighth


class Verdict(StrEnum):
    """What a comparison of times ends with."""

    FINE = "fine"
    REGRESSED = "regressed"
    UNMEASURABLE = "could not measure"


@dataclass(frozen=True)
class Rule:
    """What counts as a regression: slower by more than ``factor`` and by more than ``floor`` [s] on an average planning step.

    Raises:
        OptionError: a factor that is not above 1, or a negative floor.

    """

    factor: float = 1.08
    floor: float = 1e-5

    def __post_init__(self) -> None:
        """Refuse thresholds that everything or nothing exceeds."""
        if not (np.isfinite(self.factor) and self.factor > 1.0):
            msg = f"the factor of a regression must be above 1, not {self.factor:g}"
            raise OptionError(msg)
        if not (np.isfinite(self.floor) and self.floor >= 0.0):
            msg = f"the floor of a regression must be at least 0 ms, not {1e3 * self.floor:g}"
            raise OptionError(msg)


@dataclass(frozen=True)
class Decision:
    """A verdict and the numbers it rests on; NaN where there is nothing to compute them from."""

    verdict: Verdict
    pairs: int
    base: float  # mean planning step, each with its fastest sample of all [s]
    new: float
    ratio: float  # the slowdown that both estimates show: the smaller of the two
    low: float  # interval of the median of the pairs' ratios
    high: float
    noise: float  # the factor by which the times are uncertain: half the interval, or the estimates' disagreement


def judge(base: FloatArray, new: FloatArray, rule: Rule) -> Decision:
    """Decide from pairs in the order in which they were measured; from six pairs on, the later half is the repeat.

    ``base`` and ``new`` are (pairs, steps) times [s], row i of both measured one after the other, column j the same
    planning step. A slowdown that one half of the pairs does not show does not count: where that half is quiet
    the verdict is FINE, else UNMEASURABLE.

    Raises:
        ValueError: the arrays differ in shape.

    """
    together = decide(base, new, rule)
    if together.verdict is not Verdict.REGRESSED or len(base) < 2 * FEWEST_PAIRS:
        return together
    half = (len(base) + 1) // 2
    parts = [decide(base[part], new[part], rule) for part in (slice(half), slice(half, None))]
    doubting = [part for part in parts if not _exceeds(part, rule)]
    if not doubting:
        return together
    quiet = all(part.verdict is Verdict.FINE for part in doubting)
    return replace(together, verdict=Verdict.FINE if quiet else Verdict.UNMEASURABLE)


def decide(base: FloatArray, new: FloatArray, rule: Rule) -> Decision:
    """Decide from one batch of pairs; see ``judge`` for the arguments.

    Raises:
        ValueError: the arrays differ in shape.

    """
    if base.shape != new.shape or base.ndim != 2:  # noqa: PLR2004 - a table
        msg = f"pairs of planning steps cannot be formed of {base.shape} and {new.shape} times"
        raise ValueError(msg)
    pairs, steps = base.shape
    known = steps > 0 and pairs > 0 and all(np.all(np.isfinite(side) & (side > 0.0)) for side in (base, new))
    if not known or pairs < FEWEST_PAIRS:
        before, now = (float(side.min(axis=0).mean()) if known else np.nan for side in (base, new))
        return Decision(Verdict.UNMEASURABLE, pairs, before, now, now / before, np.nan, np.nan, np.nan)
    ratios = np.sort(new.mean(axis=1) / base.mean(axis=1))
    rank = median_rank(pairs)
    low, high = float(ratios[rank]), float(ratios[-1 - rank])
    fastest_base, fastest_new = float(base.min(axis=0).mean()), float(new.min(axis=0).mean())
    typical, fastest_ratio = float(np.median(ratios)), fastest_new / fastest_base
    noise = max(np.sqrt(high / low), typical / fastest_ratio, fastest_ratio / typical)
    decision = Decision(
        Verdict.FINE, pairs, fastest_base, fastest_new, min(typical, fastest_ratio), low, high, float(noise)
    )  # fmt: skip
    if _exceeds(decision, rule):
        proven = low > 1.0 and decision.ratio > noise**2  # twice the noise, as factors go
        return replace(decision, verdict=Verdict.REGRESSED if proven else Verdict.UNMEASURABLE)
    drowned = noise > rule.factor and high >= 1.0  # a regression of the size asked for could hide; one cannot where new is faster
    return replace(decision, verdict=Verdict.UNMEASURABLE) if drowned else decision


def median_rank(count: int) -> int:
    """Return r so that the sorted values number r and count - 1 - r hold the median with the confidence asked, or the widest."""
    ranks = np.arange(count // 2)
    held = 1.0 - 2.0 * bdtr(ranks, count, 0.5)
    return int(max(np.flatnonzero(held >= _CONFIDENCE), default=0))


def _exceeds(decision: Decision, rule: Rule) -> bool:
    return decision.ratio > rule.factor and (decision.ratio - 1.0) * decision.base > rule.floor
