"""The bound by which bodies are clear of all kerbs: never more than what they leave."""

from dataclasses import replace

import numpy as np
import pytest

from hdvplan.arrays import FloatArray
from hdvplan.centring.stationary import CentringTable
from hdvplan.planning.assembly import assemble
from hdvplan.planning.objectives import Goal
from hdvplan.planning.settings import PlannerSettings
from hdvplan.planning.stations import Stations, stations_of
from hdvplan.planning.terms.limits import CLEAR_M, LimitsPart
from hdvplan.road.path import from_curvature
from hdvplan.road.road import Road
from hdvplan.vehicle.model import Vehicle
from tests.core.scenes import extended, horizon_at, move, part_of
from tests.core.test_limit_rows import each_vehicle

STEP, STAGES, FIRST = 0.5, 40, 40
SPREAD = np.array([0.8, 0.15, 0.25, 0.25, 0.25])  # of a motion: e_y as a share of the room, then angles


@each_vehicle
@pytest.mark.parametrize("k", [0.03, -0.03, 0.004, -0.004])
def test_a_bound_never_promises_more_room_than_there_is(vehicle: Vehicle, k: float) -> None:
    room = min(0.45 / abs(k), 40.0)  # as far off as bodies are screened
    road = Road("bend", from_curvature(np.array([0.0, 110.0]), np.array([k, k]))).with_limits(room, room)
    stations = stations_of(road, vehicle, CentringTable.of(vehicle), step=STEP, horizon=STAGES * STEP)
    points = stations.points.copy()
    points["room_left"] = points["room_right"] = -np.inf  # nothing is screened out: every body is looked at
    random, spread, bounded = np.random.default_rng(1), SPREAD[: vehicle.states].copy(), 0
    spread[0] *= room

    def gaps(of: Stations, z: FloatArray) -> LimitsPart:
        scene, parts = assemble(vehicle, of, Goal(()), PlannerSettings(horizon=STAGES * STEP))
        move(scene, z)
        extended(parts, horizon_at(scene, FIRST))
        return part_of(parts, LimitsPart)

    for _ in range(10):
        z = spread * random.uniform(-1.0, 1.0, (STAGES + 1, vehicle.states))
        own, every = gaps(stations, z).seen.edges[1:], gaps(replace(stations, points=points), z).seen.edges[1:]
        guessed = (own["looked"] == 0.0) & (own["clear"] > CLEAR_M)
        # the room beside the line is known every 0.2 m, to kerbs whose chords lie within 1 mm of their arc
        assert np.all(own["clear"][guessed] <= every["gap"][guessed] + 1e-3)
        assert np.array_equal(own["gap"][~guessed], every["gap"][~guessed])
        bounded += int(np.sum(guessed))
    assert bounded > 50
