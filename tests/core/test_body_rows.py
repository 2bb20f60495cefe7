from dataclasses import replace

import numpy as np
import pytest

from hdvplan.arrays import FloatArray
from hdvplan.centring.weights import CentringTable
from hdvplan.planning.assembly import assemble
from hdvplan.planning.objectives import Goal
from hdvplan.planning.settings import PlannerSettings
from hdvplan.planning.stations import LIMIT_SPACING_M, LimitTable, Stations, limit_table, stations_of
from hdvplan.planning.terms.limits import ROWS_PER_EDGE, LimitsPart
from hdvplan.road.path import from_curvature
from hdvplan.road.road import Limits, Road
from hdvplan.vehicle.body import axles_behind, edge_points
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle
from tests.core.chains import on_road, three_units, winding
from tests.core.differences import differences
from tests.core.moves import limit_at
from tests.core.scenes import extended, horizon_at, linearised, move, part_of

STEP = 0.5
STAGES = 40
FIRST = 40  # the first station of the linearised horizon: s = 20 m, where the road begins to bend
MARGIN = 0.1
WALL = 1.0  # slope of a limit from which on edges.c takes it for a wall
VEHICLES = [load_vehicle("bus"), load_vehicle("tractor-trailer"), three_units()]
each_vehicle = pytest.mark.parametrize("vehicle", VEHICLES, ids=lambda v: v.name)
EVERY = (1, 5, 9, 13, 22, 31, STAGES)


def varying_limits() -> Limits:
    """Return limits with slopes of up to 0.2 on all four lines, and with a wall that stands 0.7 m into the road."""
    s = np.array([0.0, 20.0, 27.0, 27.01, 30.0, 30.01, 45.0, 60.0, 110.0])
    left = np.array([3.0, 2.0, 3.4, 2.7, 2.9, 4.0, 3.0, 5.0, 5.0])
    return Limits(s, left, -left[::-1] - 0.3, left + np.array([0.0, 1.0, 0.5, 0.5, 0.5, 0.5, 2.0, 0.0, 1.0]), -left[::-1] - 0.9)


def prepared(vehicle: Vehicle) -> Stations:
    return stations_of(Road("winding", winding(), varying_limits()), vehicle, CentringTable.of(vehicle), step=STEP, horizon=20.0)


def motion(vehicle: Vehicle, seed: int = 0) -> FloatArray:
    """Return states that satisfy nothing at all."""
    random = np.random.default_rng(seed)
    scale = np.array([1.0, 0.3, 0.6, 0.6])[: vehicle.states]
    states: FloatArray = scale * random.uniform(-1.0, 1.0, (STAGES + 1, vehicle.states))
    return states


def looked(
    vehicle: Vehicle, stations: Stations, z: FloatArray, begin: int = 1, *, wide: float | None = None, each: int = ROWS_PER_EDGE
) -> LimitsPart:
    """Return the limits linearised from ``begin`` on; bodies are screened only with limits that are ``wide`` metres wider."""
    points, limits = stations.points.copy(), stations.limits
    points["margin"] = 0.0
    for room in ("room_left", "room_right"):
        points[room] = -np.inf if wide is None else points[room] + wide
    values = limits.values + (wide or 0.0) * np.array([[1.0], [-1.0], [1.0], [-1.0]])
    stations = replace(stations, points=points, limits=limits._replace(values=values, two_regions=each > ROWS_PER_EDGE))
    scene, parts = assemble(vehicle, stations, Goal(()), PlannerSettings(horizon=STAGES * STEP, clearance=MARGIN))
    move(scene, z)
    extended(parts, horizon_at(scene, FIRST), begin)
    if begin == 1:
        linearised(parts, horizon_at(scene, FIRST))  # from feet that are known: these are then exact
    return part_of(parts, LimitsPart)


def clearances(vehicle: Vehicle, stations: Stations, i: int, z: FloatArray, unit: int, ahead: FloatArray, over: FloatArray) -> FloatArray:
    """Return the clearance to the tabulated limits of places ``ahead`` of a unit's axle on both edges, shape (places, 2)."""
    s, half, table = float(stations.s[FIRST + i]), 0.5 * vehicle.units[unit].width, stations.limits
    local = [np.empty((0, 2)) for _ in vehicle.units]
    local[unit] = np.concatenate([np.column_stack([ahead, np.full(len(ahead), side)]) for side in (half, -half)])
    place = on_road(vehicle, stations.path, s, z, local)[unit]
    foot, offset = stations.path.project(place[:, 0], place[:, 1], s - axles_behind(vehicle)[unit] + np.tile(ahead, 2))
    grid = table.s_first + table.spacing * np.arange(table.values.shape[1])
    left, right, left_sweep, right_sweep = (np.interp(foot, grid, row) for row in table.values)
    beyond = np.tile(over, 2)
    gap = np.where(beyond, left_sweep, left) - offset
    gap[len(ahead) :] = (offset - np.where(beyond, right_sweep, right))[len(ahead) :]
    both: FloatArray = gap.reshape(2, -1).T
    return both


def point_gaps(vehicle: Vehicle, stations: Stations, i: int, z: FloatArray) -> FloatArray:
    """Return the clearance of every sampled point, shape (units, points, 2)."""
    return np.stack(
        [clearances(vehicle, stations, i, z, unit, row["ahead"], row["overhang"] > 0) for unit, row in enumerate(edge_points(vehicle))]
    )


def dense(vehicle: Vehicle, stations: Stations, i: int, z: FloatArray, unit: int) -> tuple[FloatArray, FloatArray]:
    """Return places every 5 mm along a unit, and the clearances there."""
    points = edge_points(vehicle)[unit]
    ahead = np.arange(points["ahead"][0], points["ahead"][-1] + 1e-9, 0.005)
    before = np.clip(np.searchsorted(points["ahead"], ahead, side="right") - 1, 0, len(points) - 2)
    over = (points["overhang"][before] > 0) | (points["overhang"][before + 1] > 0)
    return ahead, clearances(vehicle, stations, i, z, unit, ahead, over)


@each_vehicle
def test_the_gap_of_every_edge_is_that_of_its_tightest_place(vehicle: Vehicle) -> None:
    stations, z = prepared(vehicle), motion(vehicle)
    part = looked(vehicle, stations, z)
    edges = part.seen.edges
    assert part.violation == max(0.0, -float(np.min(edges["gap"][1:])))  # the first stage is given
    between = 0
    for i in range(1, STAGES + 1, 2):
        own = point_gaps(vehicle, stations, i, z[i])
        assert np.all(edges["gap"][i] <= own.min(axis=1) + 1e-9)  # accuracy of projection
        assert np.array_equal(edges["clear"][i], edges["gap"][i])  # of all limits, where overhangs may reach no further than wheels
        assert np.all(edges["looked"][i] == 1.0)
        for unit in range(len(vehicle.units)):
            _, places = dense(vehicle, stations, i, z[i], unit)
            # The table's entries are looked at between points, and the bow is a parabola: both are good to the road's bend over
            # 0.2 m and to its change of curvature over 3 m.
            assert np.allclose(edges["gap"][i, unit], places.min(axis=0), rtol=0.0, atol=0.01)
            between += int(np.sum(places.min(axis=0) < own[unit].min(axis=0) - 0.02))
    assert between > 2  # the wall's corner is met between sampled points


@each_vehicle
def test_rows_hold_the_tightest_place_of_both_halves_of_every_edge(vehicle: Vehicle) -> None:
    stations, z = prepared(vehicle), motion(vehicle)
    h = looked(vehicle, stations, z).rows["h"][1:]
    for i in EVERY:
        row = 0
        for unit in range(len(vehicle.units)):
            ahead, places = dense(vehicle, stations, i, z[i], unit)
            front = ahead > 0.5 * (ahead[0] + ahead[-1])
            for side in range(2):
                both = [h[i - 1, row] + MARGIN, h[i - 1, row + 1] + MARGIN]
                assert min(both) == pytest.approx(places[:, side].min(), abs=0.01)  # as above
                assert both[0] >= places[~front, side].min() - 0.01
                assert both[1] >= places[front, side].min() - 0.01
                row += ROWS_PER_EDGE
        assert row == h.shape[1]


@each_vehicle
def test_a_row_of_a_sampled_point_is_the_derivative_of_its_gap(vehicle: Vehicle) -> None:
    stations, z, n = prepared(vehicle), motion(vehicle), vehicle.states
    part = looked(vehicle, stations, z)
    G, h, feet = part.rows["g"][1:], part.rows["h"][1:], part.seen.feet
    compared = 0
    for i in EVERY:
        gaps = point_gaps(vehicle, stations, i, z[i])

        def flat_gaps(v: FloatArray, i: int = i) -> FloatArray:
            return point_gaps(vehicle, stations, i, v).ravel()

        slope = differences(flat_gaps, z[i]).reshape(*gaps.shape, n)
        for row in range(h.shape[1]):
            unit, side = row // (2 * ROWS_PER_EDGE), row // ROWS_PER_EDGE % 2
            point = int(np.argmin(np.abs(gaps[unit, :, side] - MARGIN - h[i - 1, row])))
            entry = (feet[i, unit, point, side] - stations.limits.s_first) / LIMIT_SPACING_M
            over = int(edge_points(vehicle)["overhang"][unit, point])
            _, steepness = limit_at(stations.limits, side + 2 * over, feet[i, unit, point, side])
            sampled = abs(gaps[unit, point, side] - MARGIN - h[i - 1, row]) < 1e-9 and abs(steepness) < WALL  # a wall's is left out
            if sampled and abs(entry - np.round(entry)) > 0.05:  # the table's corners have no derivative
                # the road's third derivative jumps a little at its knots, some of them inside the stencil
                assert np.allclose(G[i - 1, row, :n], -slope[unit, point, side], rtol=0.0, atol=1e-6)
                compared += 1
            assert G[i - 1, row, n] == 0.0
    assert compared > 5 * len(vehicle.units)


@each_vehicle
def test_a_row_between_sampled_points_foretells_how_the_edges_clearance_changes(vehicle: Vehicle) -> None:
    stations, z, n = prepared(vehicle), motion(vehicle), vehicle.states
    rows = looked(vehicle, stations, z).rows
    G, h = rows["g"][1:], rows["h"][1:]
    random, compared, moved = np.random.default_rng(5), 0, 0.0
    for i in range(1, STAGES + 1):
        own = point_gaps(vehicle, stations, i, z[i])
        for unit in range(len(vehicle.units)):
            for side in range(2):
                row = (2 * unit + side) * ROWS_PER_EDGE + int(np.argmin(h[i - 1, (2 * unit + side) * ROWS_PER_EDGE :][:ROWS_PER_EDGE]))
                if h[i - 1, row] + MARGIN > own[unit, :, side].min() - 0.05:
                    continue
                step = 0.004 * random.choice([-1.0, 1.0], n)
                here, there = (dense(vehicle, stations, i, v, unit)[1][:, side].min() for v in (z[i], z[i] + step))
                # to first order: 5 mm of edge times slopes of up to 0.5 are missed by the dense places, and squares of the step
                assert there - here == pytest.approx(-G[i - 1, row, :n] @ step, abs=0.004)
                compared, moved = compared + 1, max(moved, abs(there - here))
    assert compared > 3
    assert moved > 0.015  # so that the tolerance means something


def test_the_slope_of_a_limit_matters_to_its_row() -> None:
    vehicle = VEHICLES[0]
    stations, z = prepared(vehicle), motion(vehicle)
    with_slope = looked(vehicle, stations, z).rows["g"]
    values = stations.limits.values.copy()
    values[:] = values[:, :1]
    without = looked(vehicle, replace(stations, limits=stations.limits._replace(values=values)), z).rows["g"]
    assert np.max(np.abs(with_slope - without)) > 0.05


@each_vehicle
def test_rows_for_overhangs_measure_their_corners_from_the_wheels_limit(vehicle: Vehicle) -> None:
    stations, z, each = prepared(vehicle), motion(vehicle), 2 * ROWS_PER_EDGE
    part = looked(vehicle, stations, z, each=each)
    h, edges = part.rows["h"][1:], part.seen.edges
    wheels = replace(stations, limits=stations.limits._replace(values=stations.limits.values[[0, 1, 0, 1]]))
    points = edge_points(vehicle)
    for i in EVERY:
        gaps = point_gaps(vehicle, wheels, i, z[i])
        for unit in range(len(vehicle.units)):
            for side in range(2):
                for row, corner in ((2, 0), (3, -1)):
                    found = h[i - 1, (2 * unit + side) * each + row]
                    if points["overhang"][unit, corner] > 0:
                        assert found == pytest.approx(gaps[unit, corner, side], abs=1e-9)  # accuracy of projection
                        assert edges["clear"][i, unit, side] <= found  # an edge is clear of the wheels' limit, too
                    else:
                        assert found > 0.0  # no overhang: never binds


@each_vehicle
def test_a_range_of_stages_gives_what_the_whole_horizon_gives(vehicle: Vehicle) -> None:
    stations, z = prepared(vehicle), motion(vehicle)
    whole, part = (looked(vehicle, stations, z, begin) for begin in (2, 17))
    assert np.array_equal(whole.rows[17:], part.rows[17:])
    for one, other in zip(whole.seen, part.seen, strict=True):
        assert np.array_equal(one[17:], other[17:])
    assert np.all(part.rows["h"][:17] == 0.0)


def test_a_limit_is_linear_between_its_entries_and_held_beyond_them() -> None:
    table = LimitTable(np.array([[1.0, 2.0, 0.0], [5.0, 5.0, 5.0]]), 10.0, 0.25)
    for s, value, slope in ((10.0, 1.0, 4.0), (10.125, 1.5, 4.0), (10.25, 2.0, -8.0), (10.375, 1.0, -8.0)):
        assert limit_at(table, 0, s) == pytest.approx((value, slope), abs=1e-12)
    assert limit_at(table, 0, 9.0)[0] == 1.0
    assert limit_at(table, 0, 30.0)[0] == 0.0


def test_a_limit_that_is_held_has_no_slope() -> None:
    table = LimitTable(np.array([[1.0, 2.0, 0.0]]), 10.0, 0.25)
    assert limit_at(table, 0, 9.0)[1] == 0.0
    assert limit_at(table, 0, 30.0)[1] == 0.0


@each_vehicle
def test_a_body_is_screened_only_where_every_point_keeps_its_distance(vehicle: Vehicle) -> None:
    stations, z, screened = prepared(vehicle), motion(vehicle), 0
    for wide in (0.0, 2.0, 6.0):  # metres of room added: nothing, some and everything is screened
        part = looked(vehicle, stations, z, wide=wide)
        for i in range(1, STAGES + 1):
            # limits are tabulated and interpolated; the road's own bend between the table's entries by < 1e-3 m
            true = point_gaps(vehicle, stations, i, z[i]).min(axis=1) + wide
            assert np.all(part.seen.edges["gap"][i] <= true + 1e-3)
            assert np.all(part.seen.edges["clear"][i] <= true + 1e-3)
        screened += int(np.sum(np.all(part.rows["g"][1:] == 0.0, axis=2)))
    assert screened > 0


@pytest.mark.parametrize("seed", range(5))
def test_tabulated_limits_are_the_narrowest_within_a_stations_reach(seed: int) -> None:
    random = np.random.default_rng(seed)
    s = np.sort(random.uniform(0.0, 60.0, 20))
    s[5] = s[6]  # a jump
    reach = random.uniform(1.0, 5.0, (2, 20))
    road = Road("drawn", from_curvature(np.array([0.0, 60.0]), np.zeros(2)), Limits(s, reach[0], -reach[1], reach[0] + 1.0, -reach[1]))
    table = limit_table(road, road.path, STEP)
    assert road.limits is not None
    places = np.append(np.linspace(0.0, 60.0, 6001), s)
    exact = road.limits.table(places)
    exact[:, -20:] = reach[0], -reach[1], reach[0] + 1.0, -reach[1]
    for at in random.uniform(0.0, 60.0, 200):
        within, wider = np.abs(places - at) <= STEP, np.abs(places - at) <= 1.25 * STEP + 3 * LIMIT_SPACING_M
        for row, narrowest in zip(range(4), (np.min, np.max) * 2, strict=True):
            found, sign = limit_at(table, row, at)[0], 1.0 - 2.0 * (row % 2)
            assert sign * found <= sign * narrowest(exact[row, within]) + 1e-9  # rounding
            assert sign * found >= sign * narrowest(exact[row, wider]) - 1e-9


def test_constant_limits_stay_what_they_are() -> None:
    road = Road("straight", from_curvature(np.array([0.0, 60.0]), np.zeros(2))).with_limits(3.0, 2.0)
    assert np.all(limit_table(road, road.path, STEP).values == np.array([[3.0], [-2.0], [3.0], [-2.0]]))


@each_vehicle
def test_a_breach_that_was_seen_before_the_horizon_was_extended_still_counts(vehicle: Vehicle) -> None:
    stations, z = prepared(vehicle), np.zeros((STAGES + 1, vehicle.states))
    z[3, 0] = 8.0  # far beyond the left limit, long before the new stages
    part = looked(vehicle, stations, z)
    deepest = part.violation
    assert deepest > 0.5
    assert part.extend(horizon_at(part.scene, FIRST), STAGES - 2) == -1
    assert part.violation == deepest
