"""The decision on simulated samples, and agreement of pairs in many statistics. Seeds are fixed: a test either fails always or never."""

from __future__ import annotations

import numpy as np
import pytest

from hdvplan.arrays import FloatArray
from hdvplan.bench.comparing.decision import LEVEL, Decision, GateVerdict, Pairs, Rule, agreement, decide, median_rank
from hdvplan.errors import OptionError

STEPS = 100
REPEATS = 100
PROCESS = 0.013  # standard deviation of a process's statistic, as a share of it: what was measured on a shared machine
RULE = Rule()
FINE, REGRESSED, UNMEASURABLE = GateVerdict.FINE, GateVerdict.REGRESSED, GateVerdict.UNMEASURABLE

Samples = tuple[FloatArray, FloatArray]


def judge(base: FloatArray, new: FloatArray, rule: Rule) -> Decision:
    """Return the decision about one cell by itself, of (pairs, steps) times."""
    here, there = (side.mean(axis=1) if side.size else side.reshape(-1)[:0] for side in (base, new))
    (decision,) = decide([Pairs(here, there, rule.factor, rule.floor)])
    return decision


def times(random: np.random.Generator, pairs: int, slow: float = 1.0, process: float = PROCESS) -> Samples:
    """Return the times of two programs [s]: steps of other length each, processes of other speed, small noise upwards."""
    true = random.uniform(1e-4, 4e-4, STEPS)

    def side(factor: float) -> FloatArray:
        speed = np.exp(random.normal(0.0, process, (pairs, 1)))
        return factor * true * speed * np.exp(np.abs(random.normal(0.0, 0.02, (pairs, STEPS))))

    return side(1.0), side(slow)


def share(verdict: GateVerdict, samples: list[Samples], rule: Rule = RULE) -> float:
    return float(np.mean([judge(base, new, rule).verdict is verdict for base, new in samples]))


def many(seed: int, pairs: int, slow: float = 1.0, process: float = PROCESS) -> list[Samples]:
    random = np.random.default_rng(seed)
    return [times(random, pairs, slow, process) for _ in range(REPEATS)]


@pytest.mark.parametrize("pairs", [5, 10])
def test_the_same_program_is_fine(pairs: int) -> None:
    assert share(FINE, many(1, pairs)) == 1.0


# The factor is 1.08: with 1.3 % of noise a process, the median of five ratios has 1 %, so that 20 % are far beyond and 10 %
# two standard deviations. This is one cell by itself; a comparison has eight to find it in.
@pytest.mark.parametrize(("slow", "at_least"), [(1.2, 1.0), (1.1, 0.75)])
@pytest.mark.parametrize("pairs", [5, 10])
def test_a_slowdown_is_found(pairs: int, slow: float, at_least: float) -> None:
    assert share(REGRESSED, many(2, pairs, slow)) >= at_least


def test_a_faster_program_is_fine_however_much() -> None:
    for slow in (0.95, 0.8, 0.5):
        assert share(FINE, many(3, 5, slow)) == 1.0


def test_drift_of_the_machine_is_not_taken_for_the_program() -> None:
    drift = np.exp(np.linspace(0.0, 0.5, 20))[:, None]  # by 65 % over the whole measurement, the sides in turns
    for base, new in many(4, 10):
        alternating = np.arange(10) % 2
        first, second = drift[::2], drift[1::2]
        mine, other = np.where(alternating[:, None] == 0, first, second), np.where(alternating[:, None] == 0, second, first)
        assert judge(base * mine, new * other, RULE).verdict is not REGRESSED


def test_bursts_that_hit_single_steps_and_whole_processes_are_no_regression() -> None:
    random = np.random.default_rng(6)
    for base, new in many(6, 5):
        hit = random.random(new.shape) < 0.05  # steps interrupted for milliseconds
        new[hit] += 3e-3
        base[random.random(base.shape) < 0.05] += 3e-3
        new[random.integers(5)] *= 3.0  # and one process under load all of its time
        assert judge(base, new, RULE).verdict is not REGRESSED


def test_processes_that_were_slow_throughout_leave_a_doubt_that_more_pairs_settle() -> None:
    random = np.random.default_rng(7)
    for pairs, verdict in ((10, UNMEASURABLE), (20, REGRESSED)):
        samples = many(7, pairs, 1.2)
        for base, _ in samples:
            base[random.integers(pairs)] *= 2.0  # makes one pair look fast
        assert share(verdict, samples) >= 0.95


def test_one_sided_outliers_on_the_new_side_only_are_no_regression() -> None:
    random = np.random.default_rng(8)
    for base, new in many(8, 10):
        new[random.permutation(10)[:4]] *= 1.5  # four of ten processes, all of their steps
        assert judge(base, new, RULE).verdict is not REGRESSED


def test_bimodal_processes_are_no_regression_and_never_a_slowdown_of_their_difference() -> None:
    random = np.random.default_rng(9)
    reds = 0
    for base, new in many(9, 10):
        modes = (np.where(random.random((10, 1)) < 0.5, 1.15, 1.0) for _ in "ab")  # each process fast or slow by chance
        reds += judge(base * next(modes), new * next(modes), RULE).verdict is REGRESSED
    assert reds == 0


@pytest.mark.parametrize("pairs", [5, 10])
@pytest.mark.parametrize("process", [0.2, 0.3])
def test_noise_too_large_for_the_threshold_could_not_be_measured(process: float, pairs: int) -> None:
    samples = many(10, pairs, process=process)
    assert share(UNMEASURABLE, samples) >= 0.8
    assert share(REGRESSED, samples) <= 0.01  # the acceptance's false reds, on processes that differ by 20 to 30 %


@pytest.mark.parametrize("pairs", [5, 10, 20])
@pytest.mark.parametrize("process", [0.05, 0.1, 0.2])
def test_a_quarter_more_is_not_called_fine_whatever_the_noise(process: float, pairs: int) -> None:
    assert share(FINE, many(17, pairs, 1.25, process)) <= 0.05  # the interval of the median must lie below 1.08, three standard errors off


def test_differences_below_the_floor_do_not_count() -> None:
    base, new = times(np.random.default_rng(12), 5, 1.3)
    assert judge(base, new, RULE).verdict is REGRESSED
    assert judge(base / 100.0, new / 100.0, RULE).verdict is FINE  # 30 % of 2.5 us
    assert judge(base, new, Rule(floor=2e-4)).verdict is FINE


def test_a_repeat_that_does_not_show_the_slowdown_acquits() -> None:
    base, new = times(np.random.default_rng(13), 10)
    new[:5] *= 1.25  # the machine was slow for one side during the first batch; the repeat is the same program again
    assert judge(base[:5], new[:5], RULE).verdict is REGRESSED
    assert judge(base, new, RULE).verdict is not REGRESSED


def test_the_decision_tells_the_numbers_of_the_middle_pair_and_their_quotient() -> None:
    base = np.array([2.0, 3.0, 2.0, 2.0, 2.0]) * 1e-4
    new = np.array([1.2, 1.3, 1.25, 1.4, 1.35]) * base
    (decision,) = decide([Pairs(base, new, 1.08, 1e-5)])
    assert (decision.verdict, decision.pairs) == (REGRESSED, 5)  # 1.3 is more than the pairs' spread, 1.4 / 1.2
    assert [decision.base, decision.new, decision.ratio, decision.low, decision.high] == pytest.approx([3e-4, 3.9e-4, 1.3, 1.2, 1.4])
    assert decision.noise == pytest.approx(np.sqrt(1.4 / 1.2))


def test_the_numbers_of_the_new_side_by_itself_are_no_pair_s() -> None:
    base, new = np.array([1.0, 1.0, 1.0, 1.0, 9.0]), np.array([1.1, 0.9, 1.2, 0.8, 9.0])  # in the last pair the machine was busy
    (decision,) = decide([Pairs(base, new, 1.08, 0.0)])
    assert decision.new == 9.0
    assert decision.alone == (0.8, 1.1, 9.0)  # of five processes the extremes hold the median as surely as is asked


def test_the_interval_contains_the_ratio_and_the_ratio_is_a_quotient_whatever_the_pairs() -> None:
    random = np.random.default_rng(16)
    for pairs in range(3, 21):
        base, new = np.exp(random.normal(0.0, 0.3, (2, pairs)))
        (decision,) = decide([Pairs(base, new, 1.08, 0.0)])
        assert decision.low <= decision.ratio <= decision.high
        assert decision.ratio == decision.new / decision.base


@pytest.mark.parametrize(
    ("base", "new"),
    [
        (np.ones((2, 5)), np.ones((2, 5))),  # too few pairs
        (np.ones((5, 0)), np.ones((5, 0))),  # no step
        (np.zeros((0, 5)), np.zeros((0, 5))),
        (np.ones((5, 3)), np.full((5, 3), np.nan)),
        (np.zeros((5, 3)), np.ones((5, 3))),  # a clock that stands still
    ],
)
def test_samples_that_say_nothing_could_not_be_measured(base: FloatArray, new: FloatArray) -> None:
    decision = judge(base, new, RULE)
    assert decision.verdict is UNMEASURABLE
    assert np.isnan(decision.low)


def test_sides_of_other_pairs_are_refused() -> None:
    with pytest.raises(ValueError, match=r"\(5,\) and \(4,\)"):
        judge(np.ones((5, 3)), np.ones((4, 3)), RULE)


@pytest.mark.parametrize(("factor", "floor"), [(1.0, 0.0), (0.9, 0.0), (float("nan"), 0.0), (1.1, -1e-3), (1.1, float("inf"))])
def test_thresholds_that_mean_nothing_are_refused(factor: float, floor: float) -> None:
    with pytest.raises(OptionError):
        Rule(factor, floor)


def test_the_interval_of_the_median_holds_it_as_often_as_is_said() -> None:
    random = np.random.default_rng(14)
    for pairs in (5, 6, 8, 10, 15):
        sample = np.sort(random.normal(size=(20_000, pairs)), axis=1)
        rank = median_rank(pairs)
        held = np.mean((sample[:, rank] < 0.0) & (sample[:, -1 - rank] > 0.0))
        assert held >= 0.75 - 0.01  # 20 000 draws: a standard error of 0.3 %
        if rank + 1 < pairs // 2:  # and no rank further in does
            assert np.mean((sample[:, rank + 1] < 0.0) & (sample[:, -2 - rank] > 0.0)) < 0.75


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
