"""The planner looks at places on edges and at stations; what a body sweeps between them is bounded."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hdvplan.arrays import FloatArray
from hdvplan.driving.drive import Drive, drive
from hdvplan.driving.simulate import simulate
from hdvplan.planning.assembly import assemble
from hdvplan.planning.objectives import Goal, geometric
from hdvplan.planning.settings import PlannerSettings
from hdvplan.planning.terms.limits import LimitsPart
from hdvplan.road.path import from_curvature
from hdvplan.road.road import Limits, Road
from hdvplan.solvers.riccati import RiccatiWorkspace
from hdvplan.vehicle.body import axles_behind
from hdvplan.vehicle.load import load_vehicle
from tests.core.chains import placed
from tests.core.scenes import extended, horizon_at, move, part_of

VEHICLES = {name: load_vehicle(name) for name in ("bus", "tractor-trailer")}
KEEP, EDGE_M = 10, 0.05  # simulated poses a station, and metres between the places of an edge that are looked at


def drawn(seed: int) -> Road:
    """Return a winding road of up to 0.06 1/m with walls that stand into it."""
    random = np.random.default_rng(seed)
    s = np.arange(0.0, 121.0, 15.0)
    curvature = random.uniform(-0.06, 0.06, len(s))
    curvature[0] = 0.0
    corners = np.sort(random.uniform(5.0, 115.0, 12))
    places = np.concatenate([[0.0], np.repeat(corners, 2) + np.tile([0.0, 1e-6], 12), [120.0]])
    left, right = (np.repeat(random.uniform(2.6, 4.0, 13), 2) for _ in range(2))
    more = np.repeat(random.choice([0.0, 0.5], 13), 2)
    return Road("drawn", from_curvature(s, curvature), Limits(places, left, -right, left + more, -right - more))


def gaps_at_stations(done: Drive) -> FloatArray:
    """Return what the planner finds at every executed station, shape (stations, units, 2)."""
    points = done.stations.points.copy()
    points["margin"], points["room_left"], points["room_right"] = 0.0, -np.inf, -np.inf  # nothing is screened out
    length, step = len(done.z) - 1, done.settings.step
    brief = PlannerSettings(horizon=length * step, step=step, replan=step)
    scene, parts = assemble(done.vehicle, replace(done.stations, points=points), Goal(()), brief)
    move(scene, done.z)
    extended(parts, horizon_at(scene, 0))
    found: FloatArray = part_of(parts, LimitsPart).seen.edges["gap"]
    return found


def true_gaps(done: Drive) -> FloatArray:
    """Return the least clearance to the road's own limits from each station to the next, shape (stations - 1, units, 2)."""
    vehicle, stations = done.vehicle, done.stations
    assert done.road.limits is not None
    path, units, count = stations.path, vehicle.table(), len(done.kappa)
    limits = done.road.limits.along(done.road.path, path.s_first, path.s_last)
    found = np.empty((count, len(units), 2))
    for i in range(count):
        states = simulate(units, path, float(stations.s[i]), done.settings.step, done.z[i], done.kappa[i : i + 1], KEEP)
        low = np.full((len(units), 2), np.inf)
        for j, z in enumerate(states):
            s = float(stations.s[i] + done.settings.step * j / KEEP)
            road = path.at(s)
            poses = placed(vehicle, z, float(road.x), float(road.y), float(road.heading))
            for unit, (body, behind) in enumerate(zip(vehicle.units, axles_behind(vehicle), strict=True)):
                ahead = np.arange(-body.rear_overhang, body.front, EDGE_M)
                x, y, cos, sin = (float(poses[unit][name]) for name in ("x", "y", "cos", "sin"))
                for side, sign in enumerate((1.0, -1.0)):
                    across = sign * 0.5 * body.width
                    foot, e = path.project(x + ahead * cos - across * sin, y + ahead * sin + across * cos, s - behind + ahead)
                    table = limits.table(foot)
                    limit = np.where((ahead < 0.0) | (ahead > body.wheelbase), table[side + 2], table[side])
                    low[unit, side] = min(low[unit, side], float(np.min(sign * (limit - e))))
        found[i] = low
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", VEHICLES)
@given(seed=st.integers(0, 10**6))
@settings(max_examples=12, deadline=None, derandomize=True)
def test_between_stations_and_sampled_points_a_body_reaches_no_further_than_the_margin(name: str, seed: int) -> None:
    done = drive(drawn(seed), VEHICLES[name], geometric, RiccatiWorkspace, PlannerSettings(horizon=50.0))
    seen, true = gaps_at_stations(done), true_gaps(done)
    margin = done.stations.points["margin"][: len(seen)]
    bound = np.minimum(seen[:-1], seen[1:]) - np.maximum(margin[:-1], margin[1:])[:, None, None]
    assert np.all(true[1:] >= bound[1:])
    assert np.max(margin) < 0.01  # and the bound is worth something: a limit counts as kept to a centimetre
