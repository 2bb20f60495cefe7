"""Agreement of pairs in many statistics together. Seeds are fixed: a test either fails always or never."""

from __future__ import annotations

import numpy as np
import pytest

from hdvplan.bench.comparing.decision import LEVEL, agreement

PAIRS, STATISTICS = 10, 15


def test_equal_sides_raise_a_false_alarm_in_at_most_one_comparison_of_a_hundred_over_all_statistics() -> None:
    random = np.random.default_rng(0)
    alarms = 0
    for _ in range(1000):
        common = random.normal(0.0, 0.05, PAIRS)  # what a busy machine does to all statistics of a pair
        heavy = random.standard_t(2, (STATISTICS, PAIRS))
        spread = 10.0 ** random.uniform(-3.0, 0.0, (STATISTICS, 1))
        alarms += bool(np.any(agreement(common + spread * heavy)[0] <= LEVEL))
    assert alarms <= 18  # 10 are expected at most; 18 is 2.5 standard deviations of a count more


@pytest.mark.parametrize("spread", [0.01, 0.02, 0.05])
def test_a_change_of_the_size_that_is_called_detectable_is_believed_9_times_of_10(spread: float) -> None:
    random = np.random.default_rng(1)
    found = []
    for _ in range(400):
        noise = random.normal(0.0, spread, (STATISTICS, PAIRS))
        noise[3] += np.log(np.median(agreement(noise)[1]))
        found.append(agreement(noise)[0][3] <= LEVEL)
    assert np.mean(found) >= 0.88  # 90 %, less one standard deviation of 400 tries and a bit


def test_one_pair_of_any_size_decides_nothing() -> None:
    random = np.random.default_rng(2)
    noise = random.normal(0.0, 0.01, (STATISTICS, PAIRS))
    noise[0, 4] = 5.0
    assert agreement(noise)[0][0] > LEVEL
    shown = random.normal(0.15, 0.01, (STATISTICS, PAIRS))
    shown[0, 4] = 5.0  # and hides nothing either
    assert agreement(shown)[0][0] <= LEVEL


def test_few_pairs_are_never_enough_and_none_are_no_error() -> None:
    assert np.all(agreement(np.full((3, 6), 1.0))[0] > LEVEL)  # 64 ways to turn six
    assert np.all(np.isinf(agreement(np.full((3, 3), 1.0))[1]))  # nor are six, with a repeat
    assert agreement(np.full((1, 7), 1.0))[0][0] == 1 / 128
    assert agreement(np.empty((0, 10)))[0].shape == (0,)
    assert np.all(agreement(np.zeros((2, 10)))[0] == 1.0)  # nothing differs at all


def test_of_many_pairs_a_sample_of_the_ways_is_turned() -> None:
    random = np.random.default_rng(3)
    noise = random.normal(0.0, 0.02, (STATISTICS, 16))
    noise[1] += 0.1
    chance = agreement(noise)[0]
    assert chance[1] == pytest.approx(1e-4, abs=1e-3)  # a few of 10,000 at most
    assert np.all(np.delete(chance, 1) > LEVEL)
