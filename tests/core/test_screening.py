"""Bounds by which bodies are clear of all limits: never more than what they leave."""

import numpy as np
import pytest

from hdvplan.centring.weights import CentringTable
from hdvplan.planning.assembly import assemble
from hdvplan.planning.objectives import Goal
from hdvplan.planning.settings import PlannerSettings
from hdvplan.planning.stations import stations_of
from hdvplan.planning.terms.limits import CLEAR_M, LimitsPart
from hdvplan.road.path import from_curvature
from hdvplan.road.road import Road
from hdvplan.vehicle.model import Vehicle
from tests.core.scenes import extended, horizon_at, move, part_of
from tests.core.test_body_rows import FIRST, STAGES, STEP, clearances, each_vehicle

SPREAD = np.array([0.8, 0.15, 0.25, 0.25])  # of a motion: e_y as a share of the room, then angles


@each_vehicle
@pytest.mark.parametrize("k", [0.03, -0.03, 0.004, -0.004])
def test_a_bound_never_promises_more_room_than_there_is(vehicle: Vehicle, k: float) -> None:
    room = min(0.45 / abs(k), 40.0)  # as far off as bodies are screened
    road = Road("bend", from_curvature(np.array([0.0, 110.0]), np.array([k, k]))).with_limits(room, room)
    stations = stations_of(road, vehicle, CentringTable.of(vehicle), step=STEP, horizon=STAGES * STEP)
    scene, parts = assemble(vehicle, stations, Goal(()), PlannerSettings(horizon=STAGES * STEP))
    random, spread, bounded = np.random.default_rng(1), SPREAD[: vehicle.states].copy(), 0
    spread[0] *= room
    for _ in range(10):
        z = spread * random.uniform(-1.0, 1.0, (STAGES + 1, vehicle.states))
        move(scene, z)
        extended(parts, horizon_at(scene, FIRST))
        edges = part_of(parts, LimitsPart).seen.edges
        for i in range(1, STAGES + 1, 3):
            for unit, body in enumerate(vehicle.units):
                ahead = np.linspace(-body.rear_overhang, body.front, 60)
                least = clearances(vehicle, stations, i, z[i], unit, ahead, np.zeros(60, bool)).min(axis=0)
                for side in range(2):
                    if edges[i, unit, side]["looked"] == 0.0 and edges[i, unit, side]["clear"] > CLEAR_M:
                        assert edges[i, unit, side]["clear"] <= least[side] + 1e-6  # feet of planning
                        bounded += 1
    assert bounded > 50
