"""A plan that lacks room, planned again so that it lacks less."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

import hdvplan
from hdvplan.case import Case
from hdvplan.errors import PlanError
from hdvplan.judging.result import Proof, Result
from hdvplan.judging.sentences import attempts_text
from hdvplan.judging.verdict import verdict_of
from hdvplan.road.limits import Limits
from hdvplan.road.path import from_curvature
from hdvplan.road.regions import Kind, Region, polygons_of
from hdvplan.road.road import Road
from hdvplan.vehicle.load import load_vehicle
from tests.cli.conftest import Cli

# A strip of constant width that swings 3 m to the side within 15 m. A bus can just use 1.74 m to both sides of its middle, where it may
# steer every 0.1 m.
S = np.arange(0.0, 120.1, 0.5)
ASIDE_M = np.interp(S, [0.0, 10.0, 40.0, 45.0, 60.0], [0.0, 0.0, -1.5, -1.5, 1.5])
MIDDLE = np.where((S > 45.0) & (S < 60.0), -1.5 * np.cos(np.pi * (S - 45.0) / 15.0), ASIDE_M)
ENOUGH_M, FAR_TOO_LITTLE_M, AMPLE_M = 1.74, 1.5, 2.0


def shifted_strip(half_width: float) -> Result:
    left, right = MIDDLE + half_width, MIDDLE - half_width
    road = Road("strip", from_curvature(np.array([0.0, 120.0]), np.zeros(2))).within(Limits(S, left, right, left, right))
    return hdvplan.plan(Case(road, load_vehicle("bus")))


@pytest.fixture(scope="module")
def missed() -> Result:
    return shifted_strip(ENOUGH_M)


@pytest.fixture(scope="module")
def much() -> Result:
    return shifted_strip(FAR_TOO_LITTLE_M)


def test_nearer_stations_find_the_plan_that_was_missed(missed: Result) -> None:
    assert verdict_of(missed).fits is False
    found = hdvplan.replanned(missed)
    assert verdict_of(found).fits is True
    assert found.attempts[-1].step == found.case.settings.step < missed.case.settings.step
    assert [attempt.lacking > 0.0 for attempt in found.attempts] == [*(True for _ in found.attempts[1:]), False]
    assert attempts_text(found).endswith("m apart, it fits: that is the plan here")


@pytest.mark.slow
def test_limits_that_give_way_find_what_is_lacking_at_least(much: Result) -> None:
    assert verdict_of(much).spare == pytest.approx(-0.34, abs=0.02)  # the sum of breaches is least, not the deepest
    found = hdvplan.replanned(much)
    lacking = -(verdict_of(found).spare or 0.0)
    assert lacking == min(attempt.lacking for attempt in found.attempts) < 0.26  # 0.24 m with stations of any distance
    assert found.case.settings.clearance == much.case.settings.clearance == 0.0  # the judge's
    assert {attempt.step for attempt in found.attempts} == {0.5}  # no finer plan could gain so much
    assert "planned again with limits that give way, 0.2" in attempts_text(found)


def test_limits_give_way_only_near_what_the_first_plan_breaks() -> None:
    """The bus would rather drive astride the line, beyond the right edge of the whole road, than beside it."""
    s, bend = np.array([0.0, 200.0]), np.array([0.0, 99.0, 100.0, 118.0, 119.0, 200.0])
    road = Road("bend", from_curvature(bend, np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0]) / 12.0))
    edges = [np.full(2, edge) for edge in (3.0, -1.1)]
    bus = load_vehicle("bus")
    first = hdvplan.plan(Case(road.within(Limits(s, *edges, *edges)), bus))
    found = hdvplan.replanned(first)
    assert verdict_of(found).spare == pytest.approx(-0.66, abs=0.02)
    assert found.case.settings.give_way > 0.6
    lengths = 2.0 * (bus.reach_ahead + bus.reach_behind)  # a body is near what is broken, or a length from there
    start = min(breach.s_from for breach in first.balance.breaches) - lengths
    end = max(breach.s_to for breach in first.balance.breaches) + lengths
    assert 60.0 < start < end < 160.0
    assert all(start < breach.s_from < breach.s_to < end for breach in found.balance.breaches)


def test_limits_give_way_only_where_the_first_plan_is_far_beyond_them() -> None:
    """Too narrow in its bend, the first plan does not settle: it enters what stands along the straight before it, too, by 2 cm."""
    bend = np.array([0.0, 60.0, 61.0, 86.0, 87.0, 150.0])
    road = Road("bend", from_curvature(bend, np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0]) / 25.0))
    s, edges = np.array([0.0, 150.0]), [np.full(2, edge) for edge in (3.0, -3.0)]
    along = road.path.at(np.arange(0.0, 150.0, 0.5))
    line = shapely.LineString(np.column_stack([along.x, along.y]))
    (swept,) = polygons_of(shapely.difference(line.buffer(3.0, single_sided=True), line.buffer(0.4)))
    other = Region(Kind.OBSTACLE, swept, "another bus")
    first = hdvplan.plan(Case(replace(road.within(Limits(s, *edges, *edges)), regions=(other,)), load_vehicle("bus")))
    assert min(near.s_from for near in first.approaches) < 20.0
    found = hdvplan.replanned(first)
    assert verdict_of(found).spare == pytest.approx(-0.31, abs=0.02)
    assert min(breach.s_from for breach in found.balance.breaches) > 40.0


@pytest.mark.slow
def test_a_clearance_gives_way_first(much: Result) -> None:
    """What is lacking with a clearance is what is lacking without, and the clearance."""
    settings = replace(much.case.settings, clearance=0.1)
    kept = hdvplan.replanned(hdvplan.plan(replace(much.case, settings=settings)))
    lacking = [verdict_of(found).spare or 0.0 for found in (kept, hdvplan.replanned(much))]
    assert lacking[0] == pytest.approx(lacking[1] - 0.1, abs=0.02)  # both searches end at 1 cm


def test_a_proof_stays_and_no_finer_plan_is_tried(missed: Result) -> None:
    proved = replace(missed, proof=Proof("motion", 40.0, 60.0, 0))
    found = hdvplan.replanned(proved)
    assert (found.proof, verdict_of(found).proved) == (proved.proof, True)
    assert {attempt.step for attempt in found.attempts} == {0.5}
    assert -(verdict_of(found).spare or 0.0) == min(attempt.lacking for attempt in found.attempts) < found.attempts[0].lacking


def test_a_yes_is_not_planned_again_and_what_cannot_be_planned_again_stays(missed: Result, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(case: Case) -> Result:
        raise PlanError(case.road.name, s_m=0.0)

    fits = shifted_strip(AMPLE_M)
    monkeypatch.setattr("hdvplan.api.plan", refused)
    for result in (fits, missed):
        assert hdvplan.replanned(result) is result


@pytest.mark.slow
def test_plan_tells_how_it_came_to_its_answer(cli: Cli, tmp_path: Path) -> None:
    rows = [f"{s:g},0,{ENOUGH_M + middle:.4f},{ENOUGH_M - middle:.4f}" for s, middle in zip(S, MIDDLE, strict=True)]
    (tmp_path / "strip.csv").write_text("\n".join(["s,kappa,left,right", *rows, ""]), encoding="utf-8")
    options = ("plan", "strip.csv", "--vehicle", "bus", "--no-plot", "--no-proof")
    found, coarse = cli(*options, "--json", "--out", "fine"), cli(*options, "--json", "--no-refine", "--out", "coarse")
    assert (found.code, coarse.code) == (0, 1)
    told = json.loads(found.out)
    last = told["attempts"][-1]
    assert (told["settings"]["step"], told["settings"]["give_way"], 0.0) == (last["step_m"], last["give_way_m"], last["lacking_m"])
    assert json.loads(coarse.out)["attempts"] == []
    said = cli(*options, "--out", "again")
    assert f"{last['step_m']:g} m apart, it fits: that is the plan here" in said.err


def test_the_largest_clearance_leaves_the_driver_more_room_and_a_larger_one_is_not_kept() -> None:
    road = hdvplan.load_road("monaco_fairmont_hairpin").with_limits(4.2, 4.2)
    first = hdvplan.plan(hdvplan.Case(road, hdvplan.load_vehicle("bus")))
    found = hdvplan.clearest(first)
    kept = found.case.settings.clearance
    assert found.balance.min_clearance == pytest.approx(kept, abs=0.02)
    assert first.tracking is not None
    assert found.tracking is not None
    assert found.tracking.error > first.tracking.error
    more = replace(found.case, settings=replace(found.case.settings, clearance=kept + 0.05))
    assert verdict_of(hdvplan.plan(more)).fits is False


def test_a_plan_that_does_not_fit_has_no_largest_clearance(much: Result) -> None:
    assert hdvplan.clearest(much) is much


@pytest.mark.slow
def test_the_largest_clearance_says_what_it_costs_in_steering(cli: Cli, tmp_path: Path) -> None:
    options = ("monaco_fairmont_hairpin", "--vehicle", "tractor-trailer", "--half-width", "5", "--no-plot", "--out", str(tmp_path / "most"))
    said = cli("plan", *options, "--clearance", "max").err
    assert re.search(r"take over 95 % of the steering, without 0\.0 m: a smaller --clearance steers more calmly", said)


def test_a_clearance_that_leads_past_a_bay_is_told(cli: Cli) -> None:
    """The plan with most room stayed in the carriageway beside a bus stop, and said YES."""
    x = np.arange(0.0, 161.0, 5.0)
    y = -3.0 * np.clip((35.0 - np.abs(x - 80.0)) / 20.0, 0.0, 1.0)
    np.savetxt("bay.csv", np.column_stack([x, y, 3.5 - y, np.full_like(x, 3.5)]), delimiter=",", header="x,y,left,right", comments="")
    plan = ("plan", "bay.csv", "--vehicle", "citaro", "--smooth", "0.2", "--no-plot", "--clearance")
    words = "m beside the line, at s = "
    assert "does it still come to where the line leads?" in next(line for line in cli(*plan, "max").err.splitlines() if words in line)
    assert words not in cli(*plan, "0.2").err
