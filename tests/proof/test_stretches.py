"""Where a proof is looked for, and what is told on the way."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import hdvplan
from hdvplan.case import Case
from hdvplan.judging.result import Result
from hdvplan.judging.verdict import verdict_of
from hdvplan.planning.settings import PlannerSettings
from hdvplan.proof.answer import MOST_M, Stretch, joined, stretches_of
from hdvplan.road.path import from_curvature
from hdvplan.road.road import Road
from hdvplan.vehicle.load import load_vehicle

BUS = load_vehicle("bus")


def driven(half_width: float) -> Result:
    """Return a plan through two bends of 16.7 m radius, 150 m apart."""
    s = np.array([0.0, 20.0, 28.0, 45.0, 53.0, 203.0, 211.0, 228.0, 236.0, 260.0])
    path = from_curvature(s, np.array([0.0, 0.0, 0.06, 0.06, 0.0, 0.0, 0.06, 0.06, 0.0, 0.0]))
    return hdvplan.plan(Case(Road("bends", path).with_limits(half_width, half_width), BUS, settings=PlannerSettings(horizon=50.0)))


@pytest.fixture(scope="module")
def narrow() -> Result:
    return driven(2.2)


@pytest.mark.slow
def test_a_proof_is_added_to_a_plan_that_breaks_its_limits(narrow: Result) -> None:
    assert verdict_of(narrow).proof is None
    found = hdvplan.prove(narrow)
    proof = verdict_of(found).proof
    assert proof is not None
    assert verdict_of(found).proved
    assert any(stretch.s_from <= proof.s_from < proof.s_to <= stretch.s_to for stretch in stretches_of(narrow))
    assert replace(found, proof=None) == narrow


def test_a_plan_that_fits_is_returned_as_it_is() -> None:
    fits = driven(3.0)
    assert hdvplan.prove(fits) is fits


def test_tight_places_far_apart_are_examined_one_by_one(narrow: Result) -> None:
    first, second = sorted(stretches_of(narrow))
    assert first.s_to < second.s_from


def test_progress_grows_to_the_whole_where_nothing_is_proved(narrow: Result, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hdvplan.proof.answer.proof_of", lambda *_: None)
    shares: list[float] = []
    assert hdvplan.prove(narrow, on_progress=shares.append).proof is None
    assert len(shares) == len(stretches_of(narrow))
    assert all(a < b for a, b in pairwise([0.0, *shares]))
    assert shares[-1] == pytest.approx(1.0)


def test_of_a_long_tight_road_only_the_worst_stretches_are_examined() -> None:
    places = [Stretch(500.0 * n, 500.0 * n + 150.0, 0.01 * (n % 7)) for n in range(40)]
    chosen = joined(places, BUS, 20_500.0)
    assert sum(stretch.s_to - stretch.s_from for stretch in chosen) == pytest.approx(MOST_M)
    assert [stretch.lacking for stretch in chosen] == [0.06] * len(chosen)
    (whole,) = joined([Stretch(0.0, 20_000.0, 0.1)], BUS, 20_000.0)
    assert (whole.s_from, whole.s_to) == (0.0, MOST_M)
