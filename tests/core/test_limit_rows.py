"""The rows that keep bodies within the street: gaps of the tightest contacts at a stage or before it, and their derivatives."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from hdvplan.arrays import BoolArray, FloatArray
from hdvplan.centring.stationary import CentringTable
from hdvplan.planning.assembly import assemble
from hdvplan.planning.objectives import Goal
from hdvplan.planning.settings import PlannerSettings
from hdvplan.planning.stations import BETWEEN, Stations, stations_of
from hdvplan.planning.terms.limits import ROWS_PER_SIDE, LimitsPart
from hdvplan.road.road import Road
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Unit, Vehicle
from tests.core.chains import differences, placed, three_units, varying_limits, winding
from tests.core.scenes import extended, horizon_at, linearised, move, moved_of, part_of
from tests.core.twins.kinematics import evaluate
from tests.core.twins.street import gaps, look, state_before
from tests.nightly import nightly

STEP, STAGES, FIRST, CLEARANCE = 0.5, 40, 40, 0.1  # the horizon begins at s = 20 m, where the road begins to bend
FOUR = Vehicle("four", (*three_units().units[:2], Unit(6.0, 0.5, 1.5, 2.5, 1.2), Unit(7.0, 1.0, 2.0, 2.55)))
VEHICLES = [load_vehicle("bus"), load_vehicle("tractor-trailer"), three_units(), load_vehicle("semitrailer-active"), FOUR]
each_vehicle = pytest.mark.parametrize("vehicle", VEHICLES, ids=lambda v: v.name)
SAME = 1e-9  # of gaps: rounding of coordinates of 1 km, where kerbs go on, through a backward step


def prepared(vehicle: Vehicle) -> Stations:
    """Return stations of a winding road with a wall and two regions, where nothing is screened out."""
    stations = stations_of(Road("winding", winding(), varying_limits()), vehicle, CentringTable.of(vehicle), step=STEP, horizon=20.0)
    points = stations.points.copy()
    points["margin"], points["room_left"], points["room_right"] = 0.0, -np.inf, -np.inf
    return replace(stations, points=points)


def motion(vehicle: Vehicle) -> tuple[FloatArray, FloatArray]:
    """Return states and curvatures that satisfy nothing at all."""
    random = np.random.default_rng(0)
    scale = np.array([0.5, 0.15, 0.3, 0.3, 0.3])[: vehicle.states]
    return scale * random.uniform(-1.0, 1.0, (STAGES + 1, vehicle.states)), random.uniform(-0.05, 0.05, STAGES)


def looked(vehicle: Vehicle, stations: Stations, begin: int = 1, *, overhang_cost: float = 0.0) -> LimitsPart:
    """Return the limits linearised from stage ``begin`` on."""
    brief = PlannerSettings(horizon=STAGES * STEP, clearance=CLEARANCE, overhang_cost=overhang_cost)
    scene, parts = assemble(vehicle, stations, Goal(()), brief)
    move(scene, *motion(vehicle))
    extended(parts, horizon_at(scene, FIRST), begin)
    return part_of(parts, LimitsPart)


def gaps_before(vehicle: Vehicle, stations: Stations, stage: int, x: FloatArray, back: float) -> FloatArray:
    """Return the gaps (units, 2, sections) so far back before a stage: ``x`` is its state, and the curvature held until it."""
    at = FIRST + stage
    found: FloatArray = gaps(vehicle, stations, stations.s[at : at + 1] - back, state_before(vehicle, stations, at, x, back)[None])[0]
    return found


def rows_of(part: LimitsPart, i: int) -> Iterator[tuple[int, int, int, float, FloatArray]]:
    """Yield unit, side, section, gap and gradient of the rows of a stage."""
    each, n = part.rows.shape[1] // (2 * len(part.scene.vehicle.units)), part.scene.vehicle.states
    for number, row in enumerate(part.rows[i]):
        if number % each < ROWS_PER_SIDE:
            unit, side = divmod(number // each, 2)
            yield unit, side, number % each, float(row["h"]) + CLEARANCE, -row["g"][: n + 1]


@pytest.mark.parametrize(
    "vehicle", [vehicle if number in {1, 3} else nightly(vehicle) for number, vehicle in enumerate(VEHICLES)], ids=lambda v: v.name
)
def test_a_row_is_the_gap_of_a_contact_and_its_derivative_by_the_state_and_the_curvature_before_it(vehicle: Vehicle) -> None:
    stations, (z, kappa) = prepared(vehicle), motion(vehicle)
    part, compared, between = looked(vehicle, stations), 0, 0
    backs = STEP * np.arange(BETWEEN) / BETWEEN
    for i in range(1, STAGES + 1):
        x = np.append(z[i], kappa[i - 1])
        seen = np.stack([gaps_before(vehicle, stations, i, x, back) for back in backs])
        for unit, side, section, gap, gradient in rows_of(part, i):
            if not np.any(gradient):
                assert gap > 0.0
                continue
            if gap > 1.0:
                continue  # between stations kerbs so far away are not looked for
            own = seen[:, unit, side, section]
            found = int(np.argmin(np.abs(own - gap)))
            assert own[found] == pytest.approx(gap, abs=SAME)
            assert gap <= own[0] + SAME  # no looser than at the stage itself

            def gap_at(v: FloatArray, i: int = i, back: float = float(backs[found]), at: tuple[int, ...] = (unit, side, section)) -> float:
                return float(gaps_before(vehicle, stations, i, v, back)[at])

            fine, coarse = (differences(gap_at, x, step)[0] for step in (1e-5, 2e-5))
            if np.allclose(fine, coarse, rtol=0.0, atol=1e-6):  # else another contact becomes the tightest within the stencil
                # rounding of 100 m over the stencil; and directions to corners of kerbs a centimetre away turn
                np.testing.assert_allclose(gradient, fine, rtol=0.0, atol=1e-6)
                compared, between = compared + 1, between + (found > 0)
    assert compared > 20 * len(vehicle.units)
    assert between > 0


@each_vehicle
def test_a_row_of_an_overhang_is_its_corner_s_gap_to_the_kerb_that_wheels_must_keep(vehicle: Vehicle) -> None:
    stations, (z, _), n = prepared(vehicle), motion(vehicle), vehicle.states
    part, compared = looked(vehicle, stations, overhang_cost=1.0), 0
    each = 2 * ROWS_PER_SIDE
    assert stations.street is not None
    stations.street.record["clearance"] = CLEARANCE  # as the term has it: nearer than that, walls lead back

    def corners(i: int, v: FloatArray) -> FloatArray:
        px, py, cos, sin = evaluate(stations.path, float(stations.s[FIRST + i]))[:4]
        poses = placed(vehicle, np.ascontiguousarray(v), px, py, float(np.arctan2(sin, cos)))
        assert stations.street is not None
        found: FloatArray = look(stations.street, vehicle, stations.s[FIRST + i : FIRST + i + 1], poses[None])["overhang"]["gap"][0].ravel()
        return found

    for i in range(1, STAGES + 1, 3):
        rows = part.rows[i].reshape(-1, each)[:, ROWS_PER_SIDE:].ravel()
        own = corners(i, z[i])
        met = np.isfinite(own)
        np.testing.assert_allclose(rows["h"][met], own[met], rtol=0.0, atol=SAME)
        assert np.all(rows["h"][~met] > 0.0)
        assert not np.any(rows["g"][~met])

        def own_gaps(v: FloatArray, i: int = i, met: BoolArray = met) -> FloatArray:
            return np.where(met, corners(i, v), 0.0)

        fine, coarse = (differences(own_gaps, z[i], step) for step in (1e-5, 2e-5))
        smooth = met & np.all(np.abs(fine - coarse) < 1e-6, axis=1)  # as above
        np.testing.assert_allclose(-rows["g"][smooth, :n], fine[smooth], rtol=0.0, atol=1e-6)
        assert not np.any(rows["g"][:, n:])  # where the stage is does not depend on how it came there
        edges = part.seen.edges[i].ravel()
        assert np.all(edges["clear"] <= own.reshape(-1, 2).min(axis=1) + SAME)
        compared += int(np.sum(smooth))
    assert compared > 20


@each_vehicle
def test_what_is_known_of_a_side_is_its_tightest_row(vehicle: Vehicle) -> None:
    part = looked(vehicle, prepared(vehicle))
    edges = part.seen.edges
    for i in range(1, STAGES + 1):
        tightest = np.full((len(vehicle.units), 2), np.inf)
        for unit, side, _, gap, gradient in rows_of(part, i):
            if np.any(gradient):
                tightest[unit, side] = min(tightest[unit, side], gap)
        finite = np.isfinite(tightest)
        gap = edges["gap"][i]
        assert np.all(gap[finite] <= tightest[finite] + 1e-12)  # rounding of h + clearance; a wall ahead, which has no row, may be nearer
        broken = finite & (tightest < 0.0)
        np.testing.assert_allclose(gap[broken], tightest[broken], rtol=0.0, atol=1e-12)  # as above
    assert part.violation == pytest.approx(max(0.0, -float(np.min(edges["gap"][1:]))), abs=1e-12)  # the first stage is given


def test_a_breach_that_was_seen_before_the_horizon_was_extended_still_counts() -> None:
    vehicle = VEHICLES[1]
    stations = prepared(vehicle)
    scene, parts = assemble(vehicle, stations, Goal(()), PlannerSettings(horizon=STAGES * STEP))
    z = np.zeros((STAGES + 1, vehicle.states))
    z[3, 0] = 8.0  # far beyond the left kerb, long before the new stages
    move(scene, z)
    horizon = horizon_at(scene, FIRST)
    extended(parts, horizon)
    part = part_of(parts, LimitsPart)
    deepest = part.violation
    assert deepest > 0.5
    extended(parts, horizon, STAGES - 2)
    assert part.violation == deepest


NEARBY_M = 1.0  # beyond, a body is led back by whichever corner of a kerb stands beside it, and that changes by leaps
BENT = 0.1  # 1/m: points move by less than the bound of it, and corners of kerbs, about which a gap bends, are rarely nearer than a metre


@each_vehicle
@pytest.mark.parametrize("size", [1e-6, 1e-5, 1e-4, 1e-3, 1e-2])
def test_rows_that_follow_a_motion_are_those_of_looking_afresh_to_second_order(vehicle: Vehicle, size: float) -> None:
    stations, (z, kappa) = prepared(vehicle), motion(vehicle)
    random = np.random.default_rng(2)
    moved = z + size * random.uniform(-1.0, 1.0, z.shape)
    curved = kappa + 0.1 * size * random.uniform(-1.0, 1.0, kappa.shape)
    brief = PlannerSettings(horizon=STAGES * STEP, clearance=CLEARANCE)
    (scene, parts), (fresh, fresh_parts) = (assemble(vehicle, stations, Goal(()), brief) for _ in range(2))
    move(scene, z, kappa)
    extended(parts, horizon_at(scene, FIRST))
    move(scene, moved, curved)
    linearised(parts, horizon_at(scene, FIRST))
    move(fresh, moved, curved)
    extended(fresh_parts, horizon_at(fresh, FIRST))
    reach = float(part_of(parts, LimitsPart).data["reach"][0])
    change, bend = np.abs(moved - z)[1:], np.abs(curved - kappa)
    far = (change[:, 0] + reach * (np.sum(change[:, 1:], axis=1) + STEP * bend))[:, None]  # what any point has moved by at most
    followed = np.any(scene.qp.G != 0.0, axis=2) & (moved_of(parts) > 0.0)
    apart, near = np.abs(scene.qp.h - fresh.qp.h), np.abs(fresh.qp.h) < NEARBY_M
    assert np.all((apart <= 2.0 * far + SAME)[followed & near])  # whichever contact has become the tightest
    straight = (apart <= BENT * far**2 + SAME)[followed]
    assert np.mean(straight) > 0.95  # elsewhere another contact has become the tightest
    assert np.sum(followed) > 40
