"""The largest tracking error of a plan, as users receive it."""

from __future__ import annotations

from dataclasses import replace

import pytest

import hdvplan
from hdvplan.judging.result import Result
from hdvplan.judging.verdict import tracking_line, verdict_of
from hdvplan.report.summary import tracking_json
from hdvplan.road.road import Road


def planned(road: Road) -> Result:
    return hdvplan.plan(hdvplan.Case(road, hdvplan.load_vehicle("bus")))


def test_the_error_is_less_than_the_room_and_halves_with_it(straight: Result) -> None:
    road = straight.drive.road
    wide, narrow = (planned(road.with_limits(1.27 + room, 1.27 + room)) for room in (0.2, 0.1))
    errors = [one.tracking.error for one in (wide, narrow) if one.tracking is not None]
    rooms = [verdict_of(one).spare or 0.0 for one in (wide, narrow)]
    assert rooms == pytest.approx([0.2, 0.1], abs=1e-3)
    assert all(0.0 < error < room for error, room in zip(errors, rooms, strict=True))
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.05)  # the second order


def test_a_plan_that_touches_its_limits_allows_no_error(straight: Result) -> None:
    assert planned(straight.drive.road.with_limits(1.26, 1.26)).tracking.error == 0.0  # type: ignore[union-attr] # it has limits


def test_without_limits_there_is_no_tracking_error(straight: Result) -> None:
    result = planned(replace(straight.drive.road, limits=None))
    assert result.tracking is None
    assert tracking_line(result) == ""
    assert set(tracking_json(result).values()) == {None}


def test_a_tracking_error_changes_no_plan(straight: Result) -> None:
    case = straight.case
    assert replace(case, settings=replace(case.settings, tracking_error=0.2, tracking_length=4.0)).key == case.key


def test_a_line_says_how_far_the_driver_may_stray(straight: Result) -> None:
    line = tracking_line(straight)
    assert line == f"holds while the driver keeps the front axle within {straight.tracking.error:.2f} m of the path"  # type: ignore[union-attr] # it has limits
