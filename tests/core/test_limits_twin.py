"""What the core writes of limits, against the same in plain Python: rows, and what is known of every edge."""

import numpy as np
import pytest

from hdvplan.arrays import FloatArray
from hdvplan.centring.weights import CentringTable
from hdvplan.planning.assembly import assemble
from hdvplan.planning.objectives import Goal
from hdvplan.planning.settings import PlannerSettings
from hdvplan.planning.stations import LimitTable, stations_of
from hdvplan.planning.terms.limits import LimitsPart
from hdvplan.road.path import from_curvature
from hdvplan.road.road import Limits, Road
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle
from tests.core.chains import three_units, winding
from tests.core.moves import limit_at
from tests.core.scenes import extended, horizon_at, linearised, move, part_of, shifted
from tests.core.test_body_rows import varying_limits
from tests.core.twins import edges as edges_twin
from tests.core.twins.limits import Limits as Twin

STEP, STAGES, FIRST = 0.5, 12, 30
VEHICLES = [load_vehicle("bus"), load_vehicle("tractor-trailer"), three_units(), load_vehicle("semitrailer-active")]
each_vehicle = pytest.mark.parametrize("vehicle", VEHICLES, ids=lambda v: v.name)
SPREAD = np.array([0.4, 0.1, 0.2, 0.2])
NEAR = 1e-11  # rounding of 100 m is 1e-14: through slopes of feet of at least 0.5, and the division by a bow of centimetres
ENDS = np.array([0.0, 110.0])
ROADS = {
    "tight": (winding(), Limits(ENDS, *np.outer([2.2, -2.0, 2.5, -2.6], [1.0, 1.0]))),
    "wide": (winding(), Limits.constant(5.0, 4.6, 110.0)),
    "varying": (winding(), varying_limits()),
    "straight": (from_curvature(ENDS, np.zeros(2)), Limits.constant(1.6, 1.7, 110.0)),
}


def prices(part: LimitsPart) -> tuple[FloatArray, FloatArray]:
    return part.rows["linear"].copy(), part.rows["quadratic"].copy()


def assert_same(part: LimitsPart, twin: Twin, what: str) -> None:
    """Compare rows, edges, feet and what follows from them."""
    known, (linear, quadratic) = twin.memory, prices(part)
    n, rows, live = part.scene.vehicle.states, part.rows[1:], part.scene.qp.stages["live"]
    found = {"g": rows["g"][:, :, :n], "h": rows["h"], "feet": part.seen.feet[1:], "axis_feet": part.seen.axis_feet[1:]}
    found |= {name: part.seen.edges[name][1:] for name in ("clear", "gap", "looked", "never")} | {"live": live[1:]}
    for name, values in found.items():
        expected = known[name][1:].reshape(values.shape)
        np.testing.assert_allclose(values, expected, rtol=0.0, atol=NEAR, err_msg=f"{name} {what}")
    assert not np.any(rows["g"][:, :, n:])
    assert part.violation == pytest.approx(twin.violation, abs=NEAR)
    # at most 20 rows at 12 stages, each priced 1e4 a metre and more where it is deep
    assert part.functions.price(part.data.ctypes.data, part.scene.record.ctypes.data) == pytest.approx(
        twin.price(linear, quadratic), rel=1e-9, abs=1e-6
    )


@each_vehicle
@pytest.mark.parametrize("name", ROADS)
@pytest.mark.parametrize("cost", [0.0, 1.0])
def test_rows_and_what_is_known_of_edges_are_those_of_the_twin(vehicle: Vehicle, name: str, cost: float) -> None:
    random = np.random.default_rng(len(name))
    settings = PlannerSettings(horizon=STAGES * STEP, replan=STEP, overhang_cost=cost, clearance=0.05)
    stations = stations_of(Road(name, *ROADS[name]), vehicle, CentringTable.of(vehicle), step=STEP, horizon=STAGES * STEP)
    scene, parts = assemble(vehicle, stations, Goal(()), settings)
    part, first = part_of(parts, LimitsPart), FIRST
    reach, each = float(part.data["reach"][0]), part.rows.shape[1] // (2 * len(vehicle.units))
    twin = Twin(vehicle, stations, STAGES, each, reach, settings.clearance)
    z = SPREAD[: vehicle.states] * random.uniform(-1.0, 1.0, (STAGES + 1, vehicle.states))
    move(scene, z)
    extended(parts, horizon_at(scene, first, binding=False))
    twin.linearise(first, z, 1, fresh=True, binding=False)
    assert_same(part, twin, "at first")
    kept = set()
    for step, binding in enumerate([False, False, True, False, True, False]):
        size = 10.0 ** random.uniform(-4.0, -0.5)
        z = z + size * SPREAD[: vehicle.states] * random.uniform(-1.0, 1.0, z.shape)
        z[3:6] = scene.motion.z[3:6]  # some do not move at all
        if step % 2:
            by = int(random.integers(1, 5))
            shifted(scene, parts, by)
            twin.move(by)
            first, z = first + by, np.concatenate([z[by:], z[:by]])
            z[: STAGES + 1 - by] = scene.motion.z[: STAGES + 1 - by]
            move(scene, z)
            extended(parts, horizon_at(scene, first, binding=binding), STAGES + 1 - by)
            twin.linearise(first, z, STAGES + 1 - by, fresh=True, binding=binding)
        else:
            move(scene, z)
            linearised(parts, horizon_at(scene, first, binding=binding))
            twin.linearise(first, z, 1, fresh=False, binding=binding)
        assert_same(part, twin, f"after step {step}")
        kept |= set(np.unique(twin.memory["never"][1:]))
    assert 1.0 in kept or name in {"tight", "straight"}
    assert 0.0 in kept or name == "wide"


def test_a_limit_far_beyond_its_table_is_its_last_one() -> None:
    table = LimitTable(np.array([[3.0, 2.0, 4.0], [-1.0, -2.0, -3.0]]), 10.0, 0.5)
    places = [*np.random.default_rng(0).uniform(9.0, 12.0, 100), 10.0, 10.5, 11.0, -1e300, 1e300, -np.inf, np.inf]
    for s in places:
        for row in range(2):
            assert limit_at(table, row, s) == pytest.approx(edges_twin.limit_at(table, row, s), rel=1e-14)  # rounding
