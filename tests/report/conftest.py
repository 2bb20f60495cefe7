"""Results that several tests look at, each driven once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
import pytest
from matplotlib.figure import Figure

from hdvplan.driving.drive import drive
from hdvplan.judging.result import Result, result_of
from hdvplan.planning.objectives import geometric
from hdvplan.planning.settings import PlannerSettings
from hdvplan.report import sheet
from hdvplan.road.limits import Limits
from hdvplan.road.path import from_curvature
from hdvplan.road.road import Road
from hdvplan.road.scenarios import SCENARIOS
from hdvplan.solvers.registry import solver_named
from hdvplan.vehicle.load import load_vehicle

Made = TypeVar("Made")


def once(make: Callable[[Result], Made]) -> Callable[[Result], Made]:
    """Return ``make`` as a function that makes one thing of a plan for all tests: they change nothing in it."""
    known: dict[int, tuple[Result, Made]] = {}

    def get(result: Result) -> Made:
        if id(result) not in known:
            known[id(result)] = result, make(result)  # with the plan, so that no other one gets its identity
        return known[id(result)][1]

    return get


def driven(road: Road, vehicle: str) -> Result:
    settings = PlannerSettings(horizon=50.0)
    return result_of(
        drive(road, load_vehicle(vehicle), geometric, solver_named("riccati"), settings), solver="riccati", objective="geometric"
    )


@pytest.fixture(scope="session")
def bus() -> Result:
    """A bus in the U-turn, with limits."""
    return driven(SCENARIOS["uturn"](), "bus")


@pytest.fixture(scope="session")
def trailer() -> Result:
    """A tractor-trailer in the roundabout, which crosses itself, without limits."""
    return driven(replace(SCENARIOS["roundabout"](), limits=None, notice="© the surveyors"), "tractor-trailer")


@pytest.fixture(scope="session")
def straight() -> Result:
    """A bus on a straight road due east."""
    return driven(Road("straight", from_curvature(np.array([0.0, 80.0]), np.zeros(2))).with_limits(3.0, 2.0), "bus")


@pytest.fixture(scope="session")
def long() -> Result:
    """A bus on a road of 500 m with bends at 150 m and, tighter, 350 m."""
    s = np.array([0.0, 140.0, 150.0, 160.0, 340.0, 350.0, 360.0, 500.0])
    return driven(Road("long", from_curvature(s, np.array([0.0, 0.0, 0.03, 0.0, 0.0, -0.05, 0.0, 0.0]))), "bus")


@pytest.fixture(scope="session")
def kerbed() -> Result:
    """A bus in the U-turn that breaks limits: 2 m for wheels, half a metre more for overhangs."""
    road = SCENARIOS["uturn"]()
    ends, two = np.array([0.0, road.path.length]), np.array([2.0, 2.0])
    return driven(replace(road, limits=Limits(ends, two, -two, two + 0.2, -two - 0.2)), "bus")


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """Return the figures of the sheets that are drawn from here on."""
    found: list[Figure] = []
    draw = sheet._figure

    def kept(*given: Any) -> Figure:  # noqa: ANN401 - what is passed on
        found.append(draw(*given))
        return found[-1]

    monkeypatch.setattr(sheet, "_figure", kept)
    return found
