"""SQP's optimum against the exact nonlinear program: two formulations that share no linearisation."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from hdvplan.centring.stationary import CentringTable
from hdvplan.planning.objectives import geometric
from hdvplan.planning.planner import Planner
from hdvplan.planning.settings import PlannerSettings, Scheme
from hdvplan.planning.stations import stations_of
from hdvplan.road.limits import Limits
from hdvplan.road.path import evaluate_many, from_curvature
from hdvplan.road.road import Road
from hdvplan.solvers.registry import solver_named
from hdvplan.vehicle.load import load_vehicle

pytest.importorskip("casadi", reason="an optional peer: pip install hdvplan[peers]")
SETTINGS = PlannerSettings(scheme=Scheme.SQP, horizon=40.0, sqp_tolerance=1e-9)
SLACK_M, TIGHT_M = 3.5, 2.0


@pytest.fixture(autouse=True)
def _scripts_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))


def bend(right: float) -> Road:
    """Return a road that turns left, with parallel kerbs, the right one at ``right`` [m]; it ends beyond the horizon."""
    road = Road("bend", from_curvature(np.array([0.0, 10.0, 20.0, 70.0]), np.array([0.0, 0.0, 0.05, 0.05])))
    return road.with_limits(SLACK_M, right)


@pytest.mark.parametrize(
    ("vehicle", "right", "method"),
    [
        *product(("bus", "tractor-trailer"), (SLACK_M, TIGHT_M), ("ipopt", "fatrop")),
        *product(("articulated-bus", "truck-dolly-semitrailer", "rear-steered-bus", "semitrailer-steered"), (SLACK_M,), ("ipopt",)),
    ],
)
def test_sqp_ends_in_the_optimum_of_the_exact_program(vehicle: str, right: float, method: Literal["ipopt", "fatrop"]) -> None:
    from exact_nlp import deepest_cut, exact_nlp  # noqa: PLC0415 - on the path only here

    units = load_vehicle(vehicle)
    road = bend(right)
    stations = stations_of(road, units, CentringTable.of(units), step=SETTINGS.step, horizon=SETTINGS.horizon)
    centred = geometric(stations, units)
    exact = exact_nlp(units, road, stations, centred, SETTINGS, 0.0, tolerance=1e-10, method=method).solve()
    start = np.zeros(units.states)
    plan = Planner(units, stations, centred, SETTINGS, solver_named("riccati")).plan(0, start, 0.0)
    assert exact.solved
    # Where limits do not bind, to SQP's tolerance. Where they do, the planner's kerbs are chords, 0.35 mm off a curve of 22 m, and it looks
    # between stations too.
    np.testing.assert_allclose(plan.z, exact.z, atol=1e-9 if right == SLACK_M else 5e-4)
    assert deepest_cut(units, stations, exact.z) < 4e-4  # the same chords
    if right == TIGHT_M:
        free = Planner(
            units, stations_of(bend(SLACK_M), units, CentringTable.of(units), step=SETTINGS.step, horizon=SETTINGS.horizon),
            centred, SETTINGS, solver_named("riccati"),
        ).plan(0, start, 0.0)  # fmt: skip
        assert np.max(np.abs(free.z[:, 0] - plan.z[:, 0])) > 0.01  # the limit does bind


def test_the_road_is_a_b_spline_without_loss() -> None:
    from exact_nlp import road_spline  # noqa: PLC0415 - on the path only here

    path = bend(SLACK_M).path.extended(30.0, 60.0)
    spline = road_spline(path, -20.0, 90.0)
    s = np.linspace(-20.0, 90.0, 1001)
    table = evaluate_many(path, s)
    np.testing.assert_allclose(spline(s).T, table[:2], atol=1e-11)  # rounding of coordinates of 100 m, solved for in a banded system
    tangent = spline.derivative()(s).T
    np.testing.assert_allclose(np.arctan2(tangent[1], tangent[0]), np.arctan2(table[3], table[2]), atol=1e-9)  # the same, per spacing


def test_a_cut_is_found_anywhere_along_an_edge() -> None:
    from exact_nlp import deepest_cut  # noqa: PLC0415 - on the path only here

    units = load_vehicle("tractor-trailer")
    s, one = np.array([0.0, 20.4, 20.5, 20.6, 60.0]), np.ones(5)
    low = np.array([-3.0, -3.0, -2.0, -3.0, -3.0])  # a post between two of the sampled points, as the tractor passes it
    road = replace(Road("post", from_curvature(np.array([0.0, 60.0]), np.zeros(2))), limits=Limits(s, 3.0 * one, low, 3.0 * one, low))
    stations = stations_of(road, units, CentringTable.of(units), step=SETTINGS.step, horizon=SETTINGS.horizon)
    straight = np.zeros((SETTINGS.stages + 1, units.states))
    straight[:, 0] = -0.8
    margin = float(stations.points["margin"][1])
    deepest = 0.8 + 0.5 * max(unit.width for unit in units.units) + margin - 2.0
    assert deepest_cut(units, stations, straight) == pytest.approx(deepest, abs=1e-9)  # rounding: a corner of a kerb
