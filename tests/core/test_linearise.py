from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdvplan.arrays import FloatArray
from hdvplan.centring.stationary import CentringTable
from hdvplan.planning.assembly import assemble
from hdvplan.planning.objectives import Goal
from hdvplan.planning.settings import Discretisation, PlannerSettings
from hdvplan.planning.stations import Stations, stations_of
from hdvplan.planning.terms.centring import Centring, Residual
from hdvplan.planning.terms.steering import Dynamics, Steering
from hdvplan.planning.terms.term import Columns, Scene
from hdvplan.road.road import Road
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle
from tests.core.chains import differences, few, on_road, rates, three_units, vehicles, winding
from tests.core.rules import advance, gap
from tests.core.scenes import extended, horizon_at, move

STEP = 0.5
STAGES = 40
FIRST = 40  # the first station of the linearised horizon: s = 20 m, where the road begins to bend
VEHICLES = [load_vehicle("bus"), load_vehicle("tractor-trailer"), three_units()]
LONG = [load_vehicle("a-double"), Vehicle("five", (*three_units().units, *three_units().units[1:]))]  # the core unrolls up to four units
each_chain = pytest.mark.parametrize("vehicle", VEHICLES + LONG, ids=lambda v: v.name)
each_vehicle = pytest.mark.parametrize("vehicle", VEHICLES, ids=lambda v: v.name)
NOWHERE = Columns(0, 0, 0)  # of terms without columns and rows of their own
each_rule = pytest.mark.parametrize("rule", list(Discretisation))


def prepared(vehicle: Vehicle) -> Stations:
    return stations_of(Road("winding", winding()), vehicle, CentringTable.of(vehicle), step=STEP, horizon=STAGES * STEP)


@cache
def of_the_bus() -> Stations:
    """Return the stations of a bus; nothing may be written to them."""
    return prepared(VEHICLES[0])


def motion(vehicle: Vehicle, seed: int = 0) -> tuple[FloatArray, FloatArray]:
    """Return states and curvatures that satisfy nothing at all."""
    random = np.random.default_rng(seed)
    scale = np.array([1.0, 0.3, 0.6, 0.6, 0.4, 0.4])[: vehicle.states]
    return scale * random.uniform(-1.0, 1.0, (STAGES + 1, vehicle.states)), random.uniform(-0.1, 0.1, STAGES)


def next_state(vehicle: Vehicle, k: float, k_between: float, z: FloatArray, kappa: float, rule: Discretisation) -> FloatArray:
    out = np.empty(z.size)
    advance(rule.code, vehicle.table(), k, k_between, STEP, z, kappa, out)
    return out


def settings(rule: Discretisation = Discretisation.MIDPOINT) -> PlannerSettings:
    return PlannerSettings(horizon=STAGES * STEP, step=STEP, discretisation=rule)


def laid_out(vehicle: Vehicle, seed: int = 0, rule: Discretisation = Discretisation.MIDPOINT) -> tuple[Scene, Dynamics, Centring]:
    """Return the memory of a program at ``motion``, not yet linearised, and two terms, the second with coefficients of no meaning."""
    weights = np.random.default_rng(3).uniform(-2.0, 2.0, (3, len(prepared(vehicle).s)))
    centring = Centring(Residual(*weights))
    scene, _ = assemble(vehicle, prepared(vehicle), Goal((centring,)), settings(rule))
    move(scene, *motion(vehicle, seed))
    return scene, Dynamics(), centring


def gap_of(
    rule: Discretisation, vehicle: Vehicle, k: float, k_between: float, z: FloatArray, kappa: float, ahead: FloatArray
) -> FloatArray:
    """Return the gap that a motion leaves to a rule, written out."""
    here, between = (partial(lambda at, v: rates(vehicle, at, v, kappa), at) for at in (k, k_between))
    return gap(rule, here, between, STEP, z, np.zeros(z.size), ahead)


@each_rule
@given(vehicle=vehicles(), k=st.floats(-0.1, 0.1), bend=st.floats(-0.01, 0.01), kappa=st.floats(-0.1, 0.1), draw=st.integers(0, 10**6))
@few
def test_advance_leaves_no_gap_to_the_rule_written_out(
    rule: Discretisation, vehicle: Vehicle, k: float, bend: float, kappa: float, draw: int
) -> None:
    z = np.random.default_rng(draw).uniform(-0.5, 0.5, vehicle.states)
    ahead = next_state(vehicle, k, k + bend, z, kappa, rule)
    assert np.allclose(gap_of(rule, vehicle, k, k + bend, z, kappa, ahead), 0.0, rtol=0.0, atol=1e-14)  # rounding, of states of size one


@each_rule
@each_chain
def test_linearised_dynamics_are_newtons_step_to_the_rule(vehicle: Vehicle, rule: Discretisation) -> None:
    """By the gap's derivatives: 0 = gap + by_z dz + by_kappa d kappa + by_ahead dz_next."""
    scene, term, _ = laid_out(vehicle, rule=rule)
    (z, kappa), n, stations, qp = motion(vehicle), vehicle.states, scene.stations, scene.qp
    extended([term.part(scene, NOWHERE)], horizon_at(scene, FIRST))
    for i in (0, 7, 19, STAGES - 1):
        k, between = (float(stations.points[name][FIRST + i]) for name in ("curvature", "curvature_between"))

        def left(v: FloatArray, k: float = k, between: float = between) -> FloatArray:
            return gap_of(rule, vehicle, k, between, v[:n], float(v[n]), v[n + 1 :])

        at = np.concatenate([z[i], [kappa[i]], z[i + 1]])
        slope = differences(left, at)
        solved = np.linalg.solve(-slope[:, n + 1 :], np.column_stack([slope[:, : n + 1], left(at)]))
        assert np.allclose(qp.A[i, :n], solved[:, : n + 1], rtol=0.0, atol=1e-10)  # five-point rule on smooth functions of size one
        assert np.allclose(qp.B[i, :n, 0], solved[:, n], rtol=0.0, atol=1e-10)
        assert np.array_equal(qp.A[i, n], np.eye(n + 1)[n])
        assert np.allclose(qp.c[i, :n], solved[:, n + 1], rtol=0.0, atol=1e-10)
        if rule is not Discretisation.GAUSS:
            assert np.allclose(qp.c[i, :n], left(at), rtol=0.0, atol=1e-14)  # nothing to solve: rounding alone


def test_the_midpoint_uses_the_roads_curvature_half_way() -> None:
    stations = prepared(VEHICLES[0])
    half_way = winding().at(stations.s[:150] + 0.25).curvature
    assert np.max(np.abs(stations.points["curvature_between"][:150] - half_way)) < 1e-12  # same coefficients, other offsets


@each_vehicle
def test_the_objective_is_the_square_of_the_projected_offset_to_first_order(vehicle: Vehicle) -> None:
    scene, dynamics, centring = laid_out(vehicle)
    (z, _), n, stations, qp = motion(vehicle), vehicle.states, scene.stations, scene.qp
    part = centring.part(scene, NOWHERE)
    extended([dynamics.part(scene, NOWHERE), part], horizon_at(scene, FIRST))
    aux_point = [np.zeros((1, 2)) for _ in vehicle.units]
    if len(vehicle.units) == 1:
        aux_point = [np.array([[vehicle.lead.wheelbase, 0.0]])]  # a bus's front axle
    cost = 0.0
    for i in range(1, STAGES + 1):
        s = float(stations.s[FIRST + i])

        def foot_and_offset(v: FloatArray, s: float = s) -> FloatArray:
            x, y = on_road(vehicle, stations.path, s, v, aux_point)[-1][0]
            return np.array(stations.path.project(x, y, s))

        lead, aux, target = (float(values[FIRST + i]) for values in vars(centring.residual).values() if isinstance(values, np.ndarray))
        residual = lead * z[i, 0] + aux * foot_and_offset(z[i])[1] - target
        cost += residual**2
        if i not in {1, 11, 26, STAGES}:
            continue
        gradient = aux * differences(foot_and_offset, z[i])[1] + lead * np.eye(n)[0]
        # a last Newton step of 1 mm leaves half of offset times curvature's rate times its square: below 0.2 1/m times 1e-6 m^2
        assert abs(part.stages["foot"][i] - foot_and_offset(z[i])[0]) < 2e-7
        # offsets are exact to 1e-12 m by up to 20 m of lever arm, over a step of 1e-3
        assert np.allclose(qp.q[i, :n], 2.0 * residual * gradient, rtol=0.0, atol=1e-7)
        assert np.allclose(qp.Q[i, :n, :n], 2.0 * np.outer(gradient, gradient), rtol=0.0, atol=1e-7)
        assert np.all(qp.Q[i, n] == 0.0)
        assert np.all(qp.Q[i, :, n] == 0.0)
        assert qp.q[i, n] == 0.0
    assert part.price(horizon_at(scene, FIRST)) == pytest.approx(cost, rel=1e-9)  # projection's accuracy


def test_an_axle_beyond_the_centre_of_curvature_is_centred_across_the_line() -> None:
    vehicle = VEHICLES[0]
    scene, dynamics, _ = laid_out(vehicle)
    one = np.ones(len(scene.stations.s))
    (z, kappa), horizon = motion(vehicle), horizon_at(scene, FIRST)
    z[28] = 1.0 / 0.06 - 5.7, 0.5 * np.pi  # the front axle 0.3 m beyond the centre of the arc
    move(scene, z, kappa)
    extended([dynamics.part(scene, NOWHERE)], horizon)
    part = Centring(Residual(one, one, one)).part(scene, NOWHERE)
    assert (part.extend(horizon, 1), part.linearise(horizon)) == (-1, -1)
    assert np.all(np.isfinite(scene.qp.Q[28]))
    assert np.any(scene.qp.Q[28] > 0.0)


@given(seed=st.integers(0, 10**6))
@few
def test_inputs_bound_and_weigh_the_curvature_and_its_change(seed: int) -> None:
    random, vehicle, weight = np.random.default_rng(seed), VEHICLES[0], 700.0
    before, most, change = float(random.uniform(-0.1, 0.1)), 0.1, 0.05
    scene, _ = assemble(
        replace(vehicle, max_curvature=most, max_curvature_rate=change / STEP),
        of_the_bus(),
        Goal(()),
        replace(settings(), smoothness=weight),
    )
    scene.qp.buffer[:] = np.nan
    qp, part, horizon = scene.qp, Steering().part(scene, NOWHERE), horizon_at(scene, FIRST, before=before)
    kappa, z = random.uniform(-0.1, 0.1, STAGES), np.zeros((STAGES + 1, vehicle.states))
    move(scene, z, kappa)
    extended([part], horizon)
    u = random.uniform(-0.05, 0.05, STAGES)  # moves of the changes; those of kappa are their sums
    moved = kappa + np.cumsum(u)

    def cost(values: FloatArray) -> float:
        return weight * float(np.sum(np.diff(np.concatenate([[before], values])) ** 2))

    quadratic = float(0.5 * np.sum(qp.R[:, 0, 0] * u**2) + qp.r[:, 0] @ u)
    assert abs(quadratic - (cost(moved) - cost(kappa))) < 1e-10  # rounding at cost 500
    assert part.price(horizon) == pytest.approx(cost(kappa), rel=1e-12)
    assert np.allclose(qp.x_low[:, 0] + kappa, -most, rtol=0.0, atol=1e-15)
    assert np.allclose(qp.x_high[:, 0] + kappa, most, rtol=0.0, atol=1e-15)
    changes = np.diff(np.concatenate([[before], kappa]))
    assert np.allclose(qp.u_low[:, 0] + changes, -change, rtol=0.0, atol=1e-15)
    assert np.allclose(qp.u_high[:, 0] + changes, change, rtol=0.0, atol=1e-15)
