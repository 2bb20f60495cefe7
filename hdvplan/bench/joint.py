"""Do pairs of processes agree that one side is larger, in any of many statistics together? Arrays in, numbers out.

If both sides are the same program, each pair could as well have been measured with its sides exchanged: the signs of its log ratios,
in all statistics at once, are as likely turned round. Turned in every possible way, the pairs show how large the largest agreement over
all statistics becomes by chance. What only one way in a hundred reaches is believed; so all statistics together raise a false alarm
in at most one comparison of a hundred, however many they are and however they hang together (Westfall and Young 1993, Winkler et al. 2014).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from hdvplan.arrays import FloatArray

LEVEL = 0.01  # largest chance of a false alarm, over all statistics together
FEWEST = 7  # pairs: six can be turned round in 64 ways only
_MOST_TURNED = 12  # pairs up to which all ways are looked at: 4096
_DRAWN = 9999
_LARGEST = 3.0  # a pair counts with at most this many medians of its statistic's absolute log ratios
_SURE = 2.0  # standard deviations beyond the threshold: found 9 times out of 10 where the spread is estimated from ten pairs


@dataclass(frozen=True)
class Agreement:
    """How the pairs agree in each statistic; (statistics,) arrays."""

    chance: FloatArray  # of an agreement as large as this in any of the statistics, where the sides are the same
    detectable: (
        FloatArray  # the ratio that would have been believed 9 times out of 10, of few pairs with a repeat; infinite where none would
    )


def agreement(log_ratios: FloatArray) -> Agreement:
    """Return how pairs agree; ``log_ratios`` is (statistics, pairs), positive where the new side is larger.

    The measure of agreement is the mean over the root of the mean square, 1 where all pairs show the same: turning signs changes the
    one and not the other. Single pairs of any size cannot decide it.
    """
    count, pairs = log_ratios.shape
    if not count or not pairs:
        return Agreement(np.ones(count), np.full(count, np.inf))
    size = np.abs(log_ratios)
    limit = _LARGEST * np.median(size, axis=1, keepdims=True)
    scaled = np.sign(log_ratios) * np.minimum(size, np.where(limit > 0.0, limit, np.inf))
    root = np.sqrt(np.mean(scaled**2, axis=1, keepdims=True))
    scaled = np.divide(scaled, root, out=np.zeros_like(scaled), where=root > 0.0)
    largest = np.max(_turned(pairs) @ scaled.T / pairs, axis=1)
    observed = scaled.mean(axis=1)
    chance = np.mean(largest[:, None] >= observed - 1e-9, axis=0)
    return Agreement(chance, _detectable(log_ratios, largest))


def _turned(pairs: int) -> FloatArray:
    """Return the signs of every way to turn the pairs round, (ways, pairs); of many pairs a random sample. The first is as they are."""
    if pairs <= _MOST_TURNED:
        ways = 1.0 - 2.0 * ((np.arange(2**pairs)[:, None] >> np.arange(pairs)) & 1)
    else:
        ways = np.random.default_rng(0).choice([1.0, -1.0], (_DRAWN + 1, pairs))
        ways[0] = 1.0
    return np.asarray(ways, np.float64)


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
