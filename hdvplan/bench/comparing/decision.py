"""Decide from raw samples whether a program became slower. Arrays in, verdicts out: nothing here reads, runs or prints.

One process's statistic of a cell is the mean over planning steps of each step's fastest round: what the planner needs, with
interruptions that hit single steps removed. Two estimates of the slowdown are made from it: the median of the ratios of
pairs that ran one after the other, which drift cannot move, and the ratio of the sides' minima over all processes, which
processes that were slow as a whole cannot move. Only what both show is believed. p-values of samples within a process are
of no use here: they ask whether two processes differ, and two processes of the same program do.

Nor is it believed unless the pairs agree. If both sides are the same program, each pair could as well have been measured with its sides
exchanged: the signs of its log ratios, in all statistics at once, are as likely turned round. Turned in every possible way, the pairs show
how large the largest agreement over all statistics becomes by chance. What only one way in a hundred reaches is believed; so all
statistics together raise a false alarm in at most one comparison of a hundred, however many they are and however they hang together
(Westfall and Young 1993, Winkler et al. 2014).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from scipy.special import bdtr, stdtrit

from hdvplan.arrays import FloatArray
from hdvplan.errors import OptionError

FEWEST_PAIRS = 3  # fewer say nothing about their own spread
BATCH = 5  # pairs; twice as many are two batches, and the second is the repeat that a red needs
_CONFIDENCE = 0.75  # that the interval holds the median; of five pairs all, of ten the third to the eighth
LEVEL = 0.01  # largest chance of a false alarm, over all statistics together
FEWEST = 7  # pairs that can agree so well: six can be turned round in 64 ways only
_SUSPECT = 0.8  # share of fewer pairs that must show a change of a statistic for it to be looked at again
_MOST_TURNED = 12  # pairs up to which all ways are looked at: 4096
_DRAWN = 9999
_LARGEST = 3.0  # a pair counts with at most this many medians of its statistic's absolute log ratios
_SURE = 2.0  # standard deviations beyond the threshold: found 9 times out of 10 where the spread is estimated from ten pairs


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


@dataclass(frozen=True)
class Agreement:
    """How the pairs agree in each statistic; (statistics,) arrays."""

    chance: FloatArray  # of an agreement as large as this in any of the statistics, where the sides are the same
    detectable: FloatArray  # the ratio that would be believed 9 times out of 10, of few pairs with a repeat; infinite where none would


def judge(base: FloatArray, new: FloatArray, rule: Rule, chance: float = 0.0) -> Decision:
    """Decide from a cell's pairs in the order in which they were measured; from six pairs on, the later half is the repeat.

    ``base`` and ``new`` are (pairs, steps) times [s], row i of both measured one after the other, column j the same
    planning step. A slowdown that one half of the pairs does not show does not count: where that half is quiet
    the verdict is FINE, else UNMEASURABLE, as it is where the pairs agree by a larger ``chance`` than is believed.

    Raises:
        ValueError: the arrays differ in shape.

    """
    together = _judge_batch(base, new, rule)
    if together.verdict is not Verdict.REGRESSED:
        return together
    half = (len(base) + 1) // 2 if len(base) >= 2 * FEWEST_PAIRS else len(base)
    parts = [_judge_batch(base[part], new[part], rule) for part in (slice(half), slice(half, None)) if len(base[part])]
    doubting = [part for part in parts if not _exceeds(part, rule)]
    if doubting and all(part.verdict is Verdict.FINE for part in doubting):
        return replace(together, verdict=Verdict.FINE)
    agreed = len(base) < FEWEST or chance <= LEVEL
    return together if agreed and not doubting else replace(together, verdict=Verdict.UNMEASURABLE)


def judge_whole(ratios: FloatArray, grown: float, factor: float, floor: float, chance: float) -> Verdict:
    """Decide about a statistic of whole processes from its ratio in each pair; it has ``grown`` by so much, in the unit of its ``floor``.

    UNMEASURABLE: large enough and shown by most of too few pairs; a repeat decides.
    """
    if not (np.median(ratios) > factor and grown > floor):
        return Verdict.FINE
    if len(ratios) >= FEWEST:
        return Verdict.REGRESSED if chance <= LEVEL else Verdict.FINE
    return Verdict.UNMEASURABLE if np.mean(ratios > np.sqrt(factor)) >= _SUSPECT else Verdict.FINE


def _judge_batch(base: FloatArray, new: FloatArray, rule: Rule) -> Decision:
    """Decide from one batch of pairs; see ``judge``."""
    if base.shape != new.shape or base.ndim != 2:  # noqa: PLR2004 - a table
        msg = f"pairs of planning steps cannot be formed of {base.shape} and {new.shape} times"
        raise ValueError(msg)
    pairs, known = len(base), are_times(base) and are_times(new)
    fastest_base, fastest_new = (float(side.min(axis=0).mean()) if known else np.nan for side in (base, new))
    fastest = fastest_new / fastest_base
    if not known or pairs < FEWEST_PAIRS:
        return Decision(Verdict.UNMEASURABLE, pairs, fastest_base, fastest_new, fastest, np.nan, np.nan, np.nan)
    ratios = np.sort(new.mean(axis=1) / base.mean(axis=1))
    rank = median_rank(pairs)
    low, high, typical = float(ratios[rank]), float(ratios[-1 - rank]), float(np.median(ratios))
    noise = float(max(np.sqrt(high / low), typical / fastest, fastest / typical))
    decision = Decision(Verdict.FINE, pairs, fastest_base, fastest_new, min(typical, fastest), low, high, noise)
    if _exceeds(decision, rule):
        proven = low > 1.0 and decision.ratio > noise**2  # twice the noise, as factors go
        return replace(decision, verdict=Verdict.REGRESSED if proven else Verdict.UNMEASURABLE)
    drowned = noise > rule.factor and high >= 1.0  # a regression of the size asked for could hide; one cannot where new is faster
    return replace(decision, verdict=Verdict.UNMEASURABLE) if drowned else decision


def are_times(times: FloatArray) -> bool:
    """Tell whether there are times, all of them positive and finite."""
    return times.size > 0 and bool(np.all(np.isfinite(times) & (times > 0.0)))


def median_rank(count: int) -> int:
    """Return r so that the sorted values number r and count - 1 - r hold the median with the confidence asked, or the widest."""
    held = 1.0 - 2.0 * bdtr(np.arange(count // 2), count, 0.5)
    return int(max(np.flatnonzero(held >= _CONFIDENCE), default=0))


def _exceeds(decision: Decision, rule: Rule) -> bool:
    return decision.ratio > rule.factor and (decision.ratio - 1.0) * decision.base > rule.floor


def agreement(log_ratios: FloatArray) -> Agreement:
    """Return how pairs agree; ``log_ratios`` is (statistics, pairs), positive where the new side is larger.

    The measure of agreement is the mean over the root of the mean square, 1 where all pairs show the same: turning signs changes the
    one and not the other. Single pairs of any size cannot decide it.
    """
    count, pairs = log_ratios.shape
    if not count or not pairs:
        return Agreement(np.ones(count), np.full(count, np.inf))
    limit = _LARGEST * np.median(np.abs(log_ratios), axis=1, keepdims=True)
    limit[limit <= 0.0] = np.inf
    scaled = np.clip(log_ratios, -limit, limit)
    root = np.sqrt(np.mean(scaled**2, axis=1, keepdims=True))
    scaled = np.divide(scaled, root, out=np.zeros_like(scaled), where=root > 0.0)
    if pairs <= _MOST_TURNED:  # scipy.stats.permutation_test does the same, in four hundred times the time
        signs = 1.0 - 2.0 * ((np.arange(2**pairs)[:, None] >> np.arange(pairs)) & 1)
    else:
        signs = np.random.default_rng(0).choice([1.0, -1.0], (_DRAWN + 1, pairs))
        signs[0] = 1.0  # as they are
    largest = np.max(signs @ scaled.T / pairs, axis=1)
    chance = np.mean(largest[:, None] >= scaled.mean(axis=1) - 1e-9, axis=0)
    return Agreement(chance, _detectable(log_ratios, largest))


def _detectable(log_ratios: FloatArray, largest: FloatArray) -> FloatArray:
    """Return the ratio whose agreement exceeds what chance reaches once in a hundred ways, 9 times out of 10.

    Of too few pairs none would, but a suspicion has as many measured again: then it is the ratio that both batches together would show,
    with an equal share of the level for each statistic, as the ways to turn pairs that are not measured yet are not known.
    """
    count, pairs = log_ratios.shape
    whole = pairs if pairs >= FEWEST else 2 * pairs
    threshold = float(np.quantile(largest, 1.0 - LEVEL, method="higher"))
    if whole < FEWEST or (whole == pairs and threshold >= 1.0):
        return np.full(count, np.inf)
    centred = np.abs(log_ratios - np.median(log_ratios, axis=1, keepdims=True))
    spread = 1.4826 * pairs / (pairs - 0.8) * np.median(centred, axis=1)  # a standard deviation, of few (Croux and Rousseeuw 1992)
    if whole == pairs:  # the same agreement as Student's t, which then scatters
        student = np.sqrt(pairs - 1.0) * threshold / np.sqrt(1.0 - threshold**2)
    else:
        student = float(stdtrit(whole - 1.0, 1.0 - LEVEL / count))
    shift = (student + _SURE * np.sqrt(1.0 + 0.5 * student**2 / (whole - 1.0))) * spread / np.sqrt(whole)
    return np.asarray(np.exp(shift), np.float64)
