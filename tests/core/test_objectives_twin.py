"""What the core writes of the largest reach and of the balance of the swept envelope, against the same in plain Python."""

import numpy as np
import pytest

from hdvplan.arrays import FloatArray
from hdvplan.centring.stationary import CentringTable
from hdvplan.planning.assembly import assemble
from hdvplan.planning.objectives import Goal, balanced
from hdvplan.planning.settings import PlannerSettings
from hdvplan.planning.stations import Stations, stations_of
from hdvplan.planning.terms.balance import BalancePart, EnvelopeBalance, tracing_points
from hdvplan.road.road import Road
from hdvplan.vehicle.kinematics import axles_behind
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle
from tests.core.chains import three_units, winding
from tests.core.scenes import extended, horizon_at, linearised, move, part_of
from tests.core.twins.balance import Balance

VEHICLES = [load_vehicle("bus"), load_vehicle("tractor-trailer"), three_units(), load_vehicle("semitrailer-active")]
each_vehicle = pytest.mark.parametrize("vehicle", VEHICLES, ids=lambda v: v.name)
FIRST, STEP = 30, 0.5
NEAR = 1e-12  # rounding of 100 m, 1e-14, through slopes of feet of at least 0.5 and lever arms of 20 m


def stations_for(vehicle: Vehicle, horizon: float) -> Stations:
    return stations_of(Road("winding", winding()), vehicle, CentringTable.of(vehicle), step=STEP, horizon=horizon)


def swaying(vehicle: Vehicle, count: int, random: np.random.Generator) -> FloatArray:
    """Return a motion whose bodies turn to and fro."""
    waves = random.uniform(0.05, 0.4, (3, vehicle.states)) * np.arange(count)[:, None, None] + random.uniform(0.0, 6.0, (3, vehicle.states))
    found: FloatArray = np.sum([0.3, 0.1, 0.1, 0.1][: vehicle.states] * np.sin(waves), axis=1) / 3.0
    return found


@each_vehicle
def test_the_envelope_is_measured_and_balanced_as_by_the_twin(vehicle: Vehicle) -> None:
    random, horizon = np.random.default_rng(2), 40.0 if vehicle is VEHICLES[0] else 60.0
    stations = stations_for(vehicle, horizon)
    (term,) = balanced(stations, vehicle).terms
    assert isinstance(term, EnvelopeBalance)
    settings = PlannerSettings(horizon=horizon)
    scene, parts = assemble(vehicle, stations, Goal((term,)), settings)
    part, count, first = part_of(parts, BalancePart), settings.stages + 1, FIRST
    n = vehicle.rigid_states  # wheels move nobody, but cost something of their own
    reached, driven = part.measured.reached.copy(), part.measured.driven.copy()
    points = tracing_points(vehicle, axles_behind(vehicle), STEP)
    twin = Balance(vehicle, stations, points, term.aim, term.rounding, term.relaxation, part.window, reached, driven)
    turned_back = 0
    for by in (0, 0, 10, 0, 4, 0, 0):
        first, fresh = first + by, twin.since is None
        fixed = 0 if first == FIRST else 10
        move(scene, swaying(vehicle, count, random))
        here = horizon_at(scene, first, fixed=fixed)
        if by:  # what is new is centred alone
            extended(parts, here, count - by)
        feet = part.centring.stages.copy()
        if fresh:
            twin.begin()
        (extended if fresh else linearised)(parts, here)
        hessians, gradients = scene.qp.Q[1:, :n, :n].copy(), scene.qp.q[1:, :n].copy()
        beside = part.beside.price(here)
        part.centring.stages[:] = feet
        linearised(parts[:1], here)
        (extended if fresh else linearised)((part.beside,), here)
        hessians -= scene.qp.Q[1:, :n, :n]
        gradients -= scene.qp.q[1:, :n]
        twin.measure(first, scene.motion.z)
        np.testing.assert_allclose(part.measured.track_points["foot"][: len(twin.axles)], twin.traced[0], rtol=0.0, atol=NEAR)
        np.testing.assert_allclose(part.measured.track_points["offset"][: len(twin.axles)], twin.traced[1], rtol=0.0, atol=NEAR)
        for found, expected in ((part.measured.reached, twin.reached), (part.measured.driven, twin.driven)):
            for name in ("reach", "slope", "ahead", "stage", "unit"):
                # slopes divide offsets by tenths of a metre
                np.testing.assert_allclose(found[name], expected[name], rtol=0.0, atol=10.0 * NEAR, err_msg=f"{name} at {first}")
        hessian, gradient, value = twin.added(first, fixed, (count, n))
        np.testing.assert_allclose(hessians, hessian[1:], rtol=1e-11, atol=1e-10)  # squares of 20 m, less the squares beside them
        np.testing.assert_allclose(gradients, gradient[1:], rtol=1e-11, atol=1e-10)
        assert part.price(here) == pytest.approx(value + beside, rel=1e-12)
        own = part.measured.reached
        turned_back += int(np.count_nonzero(~np.isin(own["ahead"][own["stage"] >= first], points["ahead"])))
    assert turned_back > 0  # some place belongs to an edge between its tracing points
    assert np.any(np.isfinite(part.measured.driven["reach"]))
