"""Change points of made-up series. Seeds are fixed: a test either fails always or never."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from hdvplan.arrays import FloatArray
from hdvplan.bench.changepoints import change_points
from hdvplan.errors import OptionError

LEVEL = 0.01
pytest.importorskip("ruptures")


def stepped(random: np.random.Generator, *levels: tuple[int, float]) -> FloatArray:
    """Return times that differ by 2 % around the levels of so many commits each."""
    return np.concatenate([level * np.exp(random.normal(0.0, 0.02, count)) for count, level in levels])


@pytest.mark.slow  # a few seconds each
@pytest.mark.parametrize(("heavy", "most"), [(False, 7), (True, 14)])
def test_few_unchanged_histories_show_a_change_in_any_of_their_series(heavy: bool, most: int) -> None:
    random = np.random.default_rng(0)
    alarms = 0
    for number in range(300):
        count = (10, 30, 60)[number % 3]
        common = random.normal(0.0, 0.02, count)  # what a busy hour does to all series of a commit
        own = 0.02 * (random.standard_t(2, (8, count)) if heavy else random.normal(size=(8, count)))
        alarms += any(change_points(np.exp(common + own), LEVEL))
    assert alarms <= most  # of 300: 1 % and 2.4 %, and two and a half standard deviations of a count more


@pytest.mark.parametrize("seed", range(5))
def test_a_slowdown_is_found_in_its_commit_and_so_is_its_repair(seed: int) -> None:
    random = np.random.default_rng(seed)
    table = np.stack([stepped(random, (25, 1.0), (10, 1.12), (20, 1.0)), stepped(random, (55, 3.0))])
    first, second = change_points(table, LEVEL)
    assert first == [25, 35]
    assert second == []


def test_a_step_beyond_the_noise_shows_in_its_second_commit_and_stays() -> None:
    random = np.random.default_rng(1)
    noise = stepped(random, (40, 1.0), (10, 1.2))
    table = np.stack([noise, stepped(random, (50, 2.0))])
    after = [count for count in range(1, 11) if change_points(table[:, : 40 + count], LEVEL)[0] == [40]]
    assert after == list(range(after[0], 11))
    assert after[0] <= 3  # one measurement decides nothing, and two of them may still be taken for outliers


def test_one_measurement_of_any_size_is_no_change() -> None:
    random = np.random.default_rng(2)
    table = stepped(random, (40, 1.0))[None]
    table[0, 20] = 50.0
    table[0, -1] = 50.0
    assert change_points(table, LEVEL) == [[]]


def test_few_or_equal_values_have_no_changes() -> None:
    random = np.random.default_rng(3)
    for count in (0, 1, 3, 4, 7):
        assert change_points(stepped(random, (count, 1.0))[None], LEVEL) == [[]]
    assert change_points(np.empty((0, 30)), LEVEL) == []
    assert change_points(np.ones((2, 30)), LEVEL) == [[], []]


def test_without_the_library_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ruptures", None)
    with pytest.raises(OptionError, match="not installed") as caught:
        change_points(np.ones((1, 30)), LEVEL)
    assert caught.value.hint == "pip install 'hdvplan[history]'"
