"""What is remembered of a side that was clear: a bound that must hold however the vehicle has moved since, and along the road too."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdvplan.arrays import FloatArray
from hdvplan.centring.stationary import CentringTable
from hdvplan.planning.assembly import assemble
from hdvplan.planning.objectives import Goal
from hdvplan.planning.settings import PlannerSettings
from hdvplan.planning.stations import Stations, stations_of
from hdvplan.planning.terms.limits import CLEAR_M, ROWS_PER_SIDE, LimitsPart
from hdvplan.road.limits import Limits
from hdvplan.road.path import from_curvature
from hdvplan.road.road import Road
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle
from tests.core.chains import few, placed, winding
from tests.core.scenes import extended, horizon_at, linearised, move, part_of, shifted
from tests.core.twins.kinematics import evaluate
from tests.core.twins.street import look
from tests.nightly import nightly

STEP, STAGES, FIRST = 0.5, 12, 30
VEHICLES = [load_vehicle(name) for name in ("bus", "tractor-trailer", "a-double")]
NEAR_M = 1e-9  # rounding of coordinates of 1 km, where kerbs go on


def walled(random: np.random.Generator, *, varying: bool) -> Limits:
    """Return limits that are constant, or that jump by up to 2.5 m at random places."""
    corners = np.sort(random.uniform(5.0, 80.0, 12))
    s = np.concatenate([[0.0], np.repeat(corners, 2) + np.tile([0.0, 1e-6], 12), [110.0]])
    left, right = (np.repeat(random.uniform(3.0, 5.5, 13) if varying else np.full(13, random.uniform(2.5, 4.5)), 2) for _ in range(2))
    more = np.repeat(random.choice([0.0, 0.6], 13), 2) if varying else np.full(26, 0.4)
    return Limits(s, left, -right, left + more, -right - more)


def clearances(vehicle: Vehicle, stations: Stations, at: int, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return every side's clearance to what it must keep, and to the wheels' kerbs alone, shape (units, 2) each, looked at afresh."""
    x, y, cos, sin = evaluate(stations.path, float(stations.s[at]))[:4]
    poses = placed(vehicle, np.ascontiguousarray(z), x, y, float(np.arctan2(sin, cos)))
    assert stations.street is not None
    found = look(stations.street, vehicle, stations.s[at : at + 1], poses[None])[0]
    own: FloatArray = found["at"]["gap"].min(axis=2)
    return own, np.minimum(own, found["overhang"]["gap"].min(axis=2))


def moved_since(vehicle: Vehicle, part: LimitsPart, i: int, z: FloatArray) -> float:
    """Return a bound of how far any point has moved since a stage was looked through, as it is not while all is clear there [m]."""
    by, turned = np.abs(z - part.seen.x[i, : vehicle.states]), 1 + len(vehicle.units)
    angles = np.sum(by[1:turned]) + STEP * (np.sum(by[turned:]) + abs(part.seen.x[i, vehicle.states]))
    return float(by[0] + part.data["reach"][0] * angles)


def check(vehicle: Vehicle, stations: Stations, first: int, z: FloatArray, part: LimitsPart) -> None:
    """Hold what is recorded against looking afresh at a few stages, and the rows against what is recorded."""
    edges, live = part.seen.edges, part.scene.qp.stages["live"]
    carried = np.any(part.rows["g"] != 0.0, axis=2).reshape(len(edges), len(vehicle.units), 2, -1)
    for i in (1, 5, STAGES):
        own, wheels = clearances(vehicle, stations, first + i, z[i])
        moved = moved_since(vehicle, part, i, z[i])
        assert moved == 0.0 or part.seen.x[i, -1] - moved > CLEAR_M
        assert np.all(edges["gap"][i] - moved <= own + NEAR_M)
        if part.rows.shape[1] > 2 * ROWS_PER_SIDE * len(vehicle.units):  # what overhangs reach beyond the wheels' kerbs costs
            assert np.all(edges["clear"][i] - moved <= wheels + NEAR_M)
        assert np.all(edges["clear"][i] <= edges["gap"][i])
        bare = ~carried[i].any(axis=2)  # sides without rows
        assert np.all(own[bare] > CLEAR_M - NEAR_M)
        assert np.all(edges["never"][i][bare & np.isfinite(edges["gap"][i])] == 1.0)
        assert live[i] == float(np.any(carried[i]))


@pytest.mark.parametrize(
    ("vehicle", "varying"),
    [
        (VEHICLES[0], True),
        (VEHICLES[2], False),
        *(nightly(VEHICLES[row], varying) for row, varying in ((0, False), (1, False), (1, True), (2, True))),
    ],
    ids=lambda value: getattr(value, "name", str(value)),
)
@given(seed=st.integers(0, 10**6))
@few
def test_what_is_remembered_of_a_side_never_promises_too_much(vehicle: Vehicle, varying: bool, seed: int) -> None:
    random = np.random.default_rng(seed)
    limits = walled(random, varying=varying)
    road, table = Road("winding", winding(), limits), CentringTable.of(vehicle)
    stations = stations_of(road, vehicle, table, step=STEP, horizon=STAGES * STEP)
    cost = float(random.choice([0.0, 1.0]))
    scene, parts = assemble(vehicle, stations, Goal(()), PlannerSettings(horizon=STAGES * STEP, replan=STEP, overhang_cost=cost))
    part, scale = part_of(parts, LimitsPart), np.array([0.4, 0.1, *([0.3] * 4)])[: vehicle.states]
    rough = float(random.choice([0.01, 1.0]))  # motions are smooth, or are not
    z = scale * (random.uniform(-1.0, 1.0, vehicle.states) + rough * random.uniform(-1.0, 1.0, (STAGES + 1, vehicle.states)))
    first = FIRST
    move(scene, z)
    extended(parts, horizon_at(scene, first))
    check(vehicle, stations, first, z, part)
    for _ in range(6):
        binding = bool(random.choice([False, False, True]))
        if random.uniform() < 0.4:  # as the planner does
            by = int(random.integers(1, 5))
            shifted(scene, parts, by)
            first += by
            z = np.concatenate([scene.motion.z[: STAGES + 1 - by], scale * random.uniform(-1.0, 1.0, (by, vehicle.states))])
            move(scene, z)
            extended(parts, horizon_at(scene, first, binding=binding), STAGES + 1 - by)
        else:
            z = z + 10.0 ** random.uniform(-4.0, 0.0) * scale * random.uniform(-1.0, 1.0, z.shape)
            z[:, 1:] = np.clip(z[:, 1:], -0.5, 0.5)
            move(scene, z)
            linearised(parts, horizon_at(scene, first, binding=binding))
        check(vehicle, stations, first, z, part)


def test_a_side_that_was_clear_is_looked_at_again_when_it_turns_towards_a_wall() -> None:
    """A corner far ahead of the axle moves forwards, too, when the vehicle turns: past a wall, where it was clear of the limit before."""
    vehicle, heading, turn, stage = VEHICLES[0], 0.45, 0.02, 5
    settings = PlannerSettings(horizon=STAGES * STEP, replan=STEP)
    corner = (FIRST + stage) * STEP + vehicle.lead.front * np.cos(heading) - 0.5 * vehicle.width * np.sin(heading)
    path, unseen = from_curvature(np.array([0.0, 110.0]), np.zeros(2)), 0
    for wall in corner + np.arange(0.0, 1.5, 0.05):
        left = np.array([8.0, 8.0, 4.8, 4.8])
        limits = Limits(np.array([0.0, wall, wall + 1e-6, 110.0]), left, np.full(4, -8.0), left, np.full(4, -8.0))
        road = Road("wall", path, limits)
        stations = stations_of(road, vehicle, CentringTable.of(vehicle), step=STEP, horizon=STAGES * STEP)
        scene, parts = assemble(vehicle, stations, Goal(()), settings)
        z = np.tile([0.0, heading], (STAGES + 1, 1))
        move(scene, z)
        extended(parts, horizon_at(scene, FIRST, binding=False))
        part = part_of(parts, LimitsPart)
        unseen += part.seen.edges["clear"][stage, 0, 0] > 1.0
        z[:, 1] -= turn
        move(scene, z)
        linearised(parts, horizon_at(scene, FIRST, binding=False))
        check(vehicle, stations, FIRST, z, part)
    assert unseen > 5  # before it turned the wall was ahead of the corner
