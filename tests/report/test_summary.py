from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from hdvplan.judging.fit import facts_of
from hdvplan.judging.result import Result, body_name
from hdvplan.report.summary import summary_of
from hdvplan.road.limits import Limits
from hdvplan.road.scenarios import SCENARIOS
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Unit, Vehicle


def test_a_limit_broken_by_less_than_is_counted_as_kept_is_no_violation(bus: Result) -> None:
    grazed = replace(bus, balance=replace(bus.balance, min_clearance=-0.005))
    summary = summary_of(grazed)
    assert summary["limit_violation_m"] == 0.0
    assert summary["min_clearance_m"] == -0.005
    assert summary["status"] == "ok"


def test_steps_that_were_not_solved_are_told_where(bus: Result) -> None:
    plans = list(bus.drive.plans)
    plans[3] = replace(plans[3], usable=False)
    summary = summary_of(replace(bus, drive=replace(bus.drive, plans=tuple(plans))))
    assert summary["status"] == "some steps not solved"
    assert summary["failed_steps"] == [15.0]  # the fourth plan, 5 m apart


def test_the_summary_survives_json(trailer: Result) -> None:
    summary = summary_of(trailer)
    assert json.loads(json.dumps(summary, allow_nan=False)) == summary


def test_bodies_have_the_names_that_people_use() -> None:
    unit = Unit(6.0, 1.0, 1.0, 2.5)
    assert body_name(load_vehicle("bus"), 0) == "bus"
    assert [body_name(load_vehicle("tractor-trailer"), unit) for unit in (0, 1)] == ["tractor", "trailer"]
    assert body_name(Vehicle("road train", (unit, unit, unit)), 2) == "unit 3"


def test_facts_find_the_tightest_and_the_narrowest_place() -> None:
    road = SCENARIOS["uturn"]()
    s = np.array([0.0, 40.0, 90.0, road.path.length])
    left, right = np.array([3.0, 2.0, 3.0, 3.0]), -np.full(4, 3.0)
    facts = facts_of(replace(road, limits=Limits(s, left, right, left, right)))
    assert facts.max_curvature == pytest.approx(0.06)
    assert facts.max_curvature_s == pytest.approx(70.9, abs=0.5)  # where the ramp ends, to the sampling
    assert facts.narrowest == pytest.approx(5.0, abs=0.02)  # limits are sampled every 0.5 m
    assert facts.narrowest_s == pytest.approx(40.0, abs=0.5)
