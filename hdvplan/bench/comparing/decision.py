"""Decide from pairs of processes whether a program became worse. Arrays in, verdicts out: nothing here reads, runs or prints.

Every quantity, a cell's mean planning step as well as a process's memory, is one number of each process. The two of a pair ran one after
the other, or took turns: drift of the machine cancels in their ratio. The slowdown is the middle one of the pairs' ratios, of an
even number the lower one, and what is shown as base and new are the numbers of that pair. p-values of samples within a process are of no
use here: they ask whether two processes differ, and two processes of the same program do.

A slowdown is not believed unless the pairs agree. If both sides are the same program, each pair could as well have been measured with its
sides exchanged: the signs of its log ratios, in all quantities at once, are as likely turned round. Turned in every possible way, the pairs
show how large the largest agreement over all quantities becomes by chance (Westfall and Young 1993, Winkler et al. 2014). What fewer ways
than a share of them reach is believed. Who looks several times, after 10, 20, 40 and 80 pairs, may believe less each time: half the share
at every look, one in a hundred together. So at most one comparison in a hundred is a false alarm, however many quantities there are and
however they hang together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.special import bdtr, stdtrit

from hdvplan.arrays import FloatArray
from hdvplan.bench import FACTOR, FLOOR_S
from hdvplan.errors import OptionError

FEWEST_PAIRS = 3  # fewer say nothing about their own spread
LOOKS = (5, 10, 20, 40, 80)  # pairs after which it is decided; the first look can only be fine, or call for more
LEVEL = 0.01  # largest chance of a false alarm, over all quantities and looks together
FEWEST = 7  # pairs that can agree so well: six can be turned round in 64 ways only
_CONFIDENCE = 0.75  # that the interval holds the median; of five pairs all, of ten the third to the eighth
_MOST_TURNED = 12  # pairs up to which all ways are looked at: 4096
_DRAWN = 9999
_LARGEST = 2.0  # a pair counts with at most this many medians of its quantity's absolute log ratios
_SURE = 2.0  # standard deviations beyond the threshold: found 9 times out of 10 where the spread is estimated from ten pairs


class GateVerdict(StrEnum):
    """What a comparison ends with."""

    FINE = "fine"
    REGRESSED = "regressed"
    UNMEASURABLE = "could not measure"


@dataclass(frozen=True)
class Rule:
    """What counts as a regression: slower by more than ``factor`` and by more than ``floor`` [s] on an average planning step.

    Raises:
        OptionError: a factor that is not above 1, or a negative floor.

    """

    factor: float = FACTOR
    floor: float = FLOOR_S

    def __post_init__(self) -> None:
        """Refuse thresholds that everything or nothing exceeds."""
        if not (np.isfinite(self.factor) and self.factor > 1.0):
            msg = f"the factor of a regression must be above 1, not {self.factor:g}"
            raise OptionError(msg)
        if not (np.isfinite(self.floor) and self.floor >= 0.0):
            msg = f"the floor of a regression must be at least 0 ms, not {1e3 * self.floor:g}"
            raise OptionError(msg)


@dataclass(frozen=True)
class Pairs:
    """One quantity of both programs, (pairs,) arrays in the order of measurement; larger is worse.

    A change counts if it exceeds both ``factor`` and ``floor``, which has the quantity's unit. Where noise hides a change of a quantity
    that is ``needed``, there is no answer at all; of others it is told. ``independent`` is False of pairs that share their measurements:
    then nothing of them proves a regression, as the hour may differ as well as the program.
    """

    base: FloatArray
    new: FloatArray
    factor: float
    floor: float
    needed: bool = True
    independent: bool = True


@dataclass(frozen=True)
class Decision:
    """A verdict and the numbers it rests on; NaN where there is nothing to compute them from."""

    verdict: GateVerdict
    pairs: int
    base: float = np.nan  # of the pair with the middle ratio
    new: float = np.nan
    ratio: float = np.nan  # of these two
    low: float = np.nan  # interval of the median of the pairs' ratios; it contains ``ratio``
    high: float = np.nan
    counting: float = np.inf  # the ratio from which on a change counts
    chance: float = 1.0  # of an agreement as large as this in any of the quantities, where the sides are the same
    shown: float = np.inf  # the ratio that would be believed 9 times out of 10, of few pairs with a repeat; infinite where none would
    needed: bool = True
    alone: tuple[float, float, float] = (np.nan,) * 3  # the new side's median by itself, and the interval that holds it: low, middle, high

    @property
    def detectable(self) -> float:
        """The ratio that would be believed so, and that counts."""
        return max(self.shown, self.counting)

    @property
    def noise(self) -> float:
        """The factor by which the ratio is uncertain."""
        return float(np.sqrt(self.high / self.low))

    @property
    def is_doubtful(self) -> bool:
        """Whether it may well be worse, and is not proven to be: it counts, of few pairs, or all of the interval does."""
        return self.verdict is GateVerdict.UNMEASURABLE and (self.pairs < FEWEST or self.low > self.counting)

    @property
    def unseen(self) -> bool:
        """Whether nothing was found, but a change that counts could hide in the noise, which prevents no answer."""
        return (
            not self.needed
            and self.verdict is not GateVerdict.REGRESSED
            and (self.ratio > self.counting or self.detectable > self.counting)
        )


def decide(quantities: Sequence[Pairs]) -> list[Decision]:
    """Return what to believe of each quantity; all are judged together, and have the same pairs.

    REGRESSED: the ratio counts, the interval is above 1 and the independent pairs agree; of fewer than seven, which cannot agree well
    enough, a needed quantity's ratio must exceed their spread. UNMEASURABLE: it counts and that is not proven, or the interval of a needed
    quantity reaches beyond what counts.

    Raises:
        ValueError: the sides of a quantity differ in shape, or quantities in their number of independent pairs.

    """
    for one in quantities:
        if one.base.shape != one.new.shape or one.base.ndim != 1:
            msg = f"pairs cannot be formed of {one.base.shape} and {one.new.shape} numbers"
            raise ValueError(msg)
    known = [one for one in quantities if one.independent and len(one.base) and are_times(one.base) and are_times(one.new)]
    pairs = len(known[0].base) if known else 0
    chances, detectable = agreement(np.array([np.log(one.new / one.base) for one in known]).reshape(len(known), pairs))
    found = {id(one): numbers for one, *numbers in zip(known, chances.tolist(), detectable.tolist(), strict=True)}
    return [_decided(one, *found.get(id(one), (0.0, np.inf))) for one in quantities]


def _decided(one: Pairs, chance: float, shown: float) -> Decision:
    pairs = len(one.base)
    if not (are_times(one.base) and are_times(one.new)):
        return Decision(GateVerdict.UNMEASURABLE, pairs, needed=one.needed)
    ratios = one.new / one.base
    order, rank = np.argsort(ratios, kind="stable"), median_rank(pairs)
    middle = order[(pairs - 1) // 2]
    base, new, ratio = float(one.base[middle]), float(one.new[middle]), float(ratios[middle])
    counting = max(one.factor, 1.0 + one.floor / base)
    by_size = np.sort(one.new)
    alone = float(by_size[rank]), float(np.median(by_size)), float(by_size[-1 - rank])
    if pairs < FEWEST_PAIRS:
        return Decision(GateVerdict.UNMEASURABLE, pairs, base, new, ratio, counting=counting, needed=one.needed, alone=alone)
    low, high = float(ratios[order[rank]]), float(ratios[order[-1 - rank]])
    verdict = GateVerdict.FINE
    if ratio > counting:
        agree = chance <= level_of(pairs) if pairs >= FEWEST else one.needed and ratio > high / low
        verdict = GateVerdict.REGRESSED if one.independent and agree and low > 1.0 else GateVerdict.UNMEASURABLE
    elif one.needed and high > counting:
        verdict = GateVerdict.UNMEASURABLE
    return Decision(verdict, pairs, base, new, ratio, low, high, counting, chance, shown, one.needed, alone)


def level_of(pairs: int) -> float:
    """Return the chance that is believed at the look after so many pairs: half as much at each look."""
    looks = [look for look in LOOKS if look >= FEWEST]
    number = next((number for number, look in enumerate(looks) if pairs <= look), len(looks))
    return LEVEL / 2.0 ** (1 + number)


def are_times(times: FloatArray) -> bool:
    """Tell whether there are times, all of them positive and finite."""
    return times.size > 0 and bool(np.all(np.isfinite(times) & (times > 0.0)))


def median_rank(count: int) -> int:
    """Return r so that the sorted values number r and count - 1 - r hold the median with the confidence asked, or the widest."""
    held = 1.0 - 2.0 * bdtr(np.arange(count // 2), count, 0.5)
    return int(max(np.flatnonzero(held >= _CONFIDENCE), default=0))


def agreement(log_ratios: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return by which chance pairs agree so, and the ratio that would be believed, of each quantity.

    ``log_ratios`` is (quantities, pairs), positive where the new side is larger.

    The measure of agreement is the mean over the root of the mean square, 1 where all pairs show the same: turning signs changes the
    one and not the other. Single pairs of any size cannot decide it.
    """
    count, pairs = log_ratios.shape
    if not count or not pairs:
        return np.ones(count), np.full(count, np.inf)
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
    return chance, _detectable(log_ratios, largest)


def _detectable(log_ratios: FloatArray, largest: FloatArray) -> FloatArray:
    """Return the ratio whose agreement exceeds what chance reaches as often as is believed, 9 times out of 10.

    Of too few pairs none would, but a suspicion has as many measured again: then it is the ratio that both batches together would show,
    with an equal share of the level for each quantity, as the ways to turn pairs that are not measured yet are not known.
    """
    count, pairs = log_ratios.shape
    whole = pairs if pairs >= FEWEST else 2 * pairs
    level = level_of(whole)
    threshold = float(np.quantile(largest, 1.0 - level, method="higher"))
    if whole < FEWEST or (whole == pairs and threshold >= 1.0):
        return np.full(count, np.inf)
    centred = np.abs(log_ratios - np.median(log_ratios, axis=1, keepdims=True))
    spread = 1.4826 * pairs / (pairs - 0.8) * np.median(centred, axis=1)  # a standard deviation, of few (Croux and Rousseeuw 1992)
    if whole == pairs:  # the same agreement as Student's t, which then scatters
        student = np.sqrt(pairs - 1.0) * threshold / np.sqrt(1.0 - threshold**2)
    else:
        student = float(stdtrit(whole - 1.0, 1.0 - level / count))
    shift = (student + _SURE * np.sqrt(1.0 + 0.5 * student**2 / (whole - 1.0))) * spread / np.sqrt(whole)
    return np.asarray(np.exp(shift), np.float64)
