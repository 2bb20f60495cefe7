"""What the core computes of paths, motions, envelopes and manoeuvres, against the same in plain Python."""

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdvplan.arrays import FloatArray
from hdvplan.driving.drive import SUBSTEP_M, simulate
from hdvplan.judging import envelope
from hdvplan.road.path import evaluate_many, from_curvature, project_many
from hdvplan.turning import follow
from hdvplan.vehicle.kinematics import place_many, rates
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle
from tests.core.chains import few, vehicles, winding
from tests.core.twins import balance as envelope_twin
from tests.core.twins import kinematics as motion_twin

STEP, KEEP = 0.5, 2
each_kind = pytest.mark.parametrize("name", ["bus", "citaro-k", "semitrailer-steered", "semitrailer-active", "a-double"])


@st.composite
def steered(draw: st.DrawFn) -> Vehicle:
    chain = draw(vehicles())
    laws = draw(st.lists(st.tuples(st.floats(0.0, 1.2), st.floats(0.05, 0.7)), min_size=4, max_size=4))
    units = (replace(unit, steering_ratio=r, max_steering_angle=m) for unit, (r, m) in zip(chain.units, laws, strict=False))
    return Vehicle("drawn", tuple(units))


def wheels_of(vehicle: Vehicle, count: int) -> FloatArray:
    """Return angles of active wheels at the ends of ``count`` intervals."""
    angles: FloatArray = 0.2 * np.sin(0.3 * np.arange(count + 1)[:, None] + np.arange(len(vehicle.active)))
    return angles


def test_points_of_a_path_are_those_of_its_polynomials_also_beyond_its_ends() -> None:
    path = winding().extended(5.0, 5.0)
    s = np.random.default_rng(0).uniform(path.s_first - 0.4, path.s_last + 0.4, 500)
    expected = np.array([motion_twin.evaluate(path, at) for at in s]).T
    # rounding at 100 m; two terms of 1/sqrt(1 + over) in the rest, whose ``over`` grows beyond the ends
    np.testing.assert_allclose(evaluate_many(path, s), expected, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("last_step", [2e-5, 1e-3])
def test_feet_are_found_and_missed_where_the_search_in_python_does(last_step: float) -> None:
    path = winding().extended(5.0, 5.0)
    rng = np.random.default_rng(1)
    near, offset = rng.uniform(0.0, 110.0, 500), rng.uniform(-40.0, 40.0, 500)
    x, y = path.to_plane(np.clip(near + rng.uniform(-14.0, 14.0, 500), path.s_first, path.s_last), offset)
    found = project_many(path, x, y, near, last_step)
    expected = np.array([motion_twin.project(path, *point, last_step) for point in zip(x, y, near, strict=True)]).T
    missed = np.isnan(expected[1])
    assert 20 < np.count_nonzero(missed) < 200
    np.testing.assert_array_equal(np.isnan(found[1]), missed)
    # rounding of 30 m, through slopes of at least 0.05 in at most 30 steps
    np.testing.assert_allclose(found[:, ~missed], expected[:, ~missed], rtol=0.0, atol=1e-10)


def test_a_copy_of_a_path_reads_its_own_coefficients() -> None:
    path = winding()
    s = np.linspace(0.0, 100.0, 11)
    before = evaluate_many(path, s)
    copy = deepcopy(path)
    assert copy.record["coefficients"][0] == copy.coefficients.ctypes.data != path.record["coefficients"][0]
    np.testing.assert_array_equal(evaluate_many(copy, s), before)


@given(vehicle=steered(), draw=st.lists(st.floats(-1.0, 1.0), min_size=5, max_size=5), kappa=st.floats(-0.1, 0.1), k=st.floats(-0.2, 0.2))
@few
def test_rates_and_places_are_those_of_the_twin(vehicle: Vehicle, draw: list[float], kappa: float, k: float) -> None:
    units, z = vehicle.table(), np.array([2.0, 0.5, 1.2, 1.2, 1.2])[: vehicle.states] * draw[: vehicle.states]
    np.testing.assert_allclose(rates(units, k, z, kappa), motion_twin.rates(units, k, z, kappa), rtol=0.0, atol=1e-13)  # rounding
    point = np.array([3.0, -7.0, np.cos(2.0), np.sin(2.0), 0.0])
    poses = place_many(units, np.stack([point, point], axis=1), np.stack([z, 0.5 * z]))
    for found, at in zip(poses, (z, 0.5 * z), strict=True):
        expected = motion_twin.places(units, point[:4], at)
        given_names = np.stack([found[name] for name in ("x", "y", "cos", "sin")], axis=1)
        np.testing.assert_allclose(given_names, expected, rtol=0.0, atol=1e-13)  # rounding at 30 m


@each_kind
def test_the_simulation_is_that_of_the_twin(name: str) -> None:
    vehicle, path, count = load_vehicle(name), winding().extended(5.0, 5.0), 12
    kappa = 0.05 * np.sin(0.3 * np.arange(count))
    wheels = wheels_of(vehicle, count)
    z = np.concatenate([0.1 * np.arange(vehicle.rigid_states), wheels[0]])
    found = simulate(vehicle.table(), path, 17.3, STEP, z, kappa, KEEP, wheels)
    substeps = int(np.ceil(STEP / KEEP / SUBSTEP_M))
    expected = motion_twin.simulate(vehicle.table(), path, 17.3, STEP, z, kappa, KEEP, substeps, wheels)
    assert np.all(np.isfinite(expected))
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-13)  # rounding over 120 steps


def test_a_simulation_ends_where_the_twins_does() -> None:
    vehicle, path = load_vehicle("bus"), from_curvature(np.array([0.0, 60.0]), np.zeros(2))
    kappa, z = np.full(25, 0.1), np.zeros(2)
    found = simulate(vehicle.table(), path, 0.0, STEP, z, kappa, KEEP)
    expected = motion_twin.simulate(vehicle.table(), path, 0.0, STEP, z, kappa, KEEP, 5, np.empty((26, 0)))
    assert np.isnan(expected[-1, 0])
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9)  # rounding, divided by the cosine of nearly a quarter turn


def test_the_envelope_is_that_of_the_twin() -> None:
    vehicle, path = load_vehicle("tractor-trailer"), winding().extended(30.0, 30.0)
    units, begin = vehicle.table(), 20.0
    kappa = evaluate_many(path, begin + STEP * np.arange(12, dtype=np.float64))[4]
    z = simulate(units, path, begin, STEP, np.array([0.3, 0.05, 0.1]), kappa, KEEP)
    s, outlines = begin + STEP / KEEP * np.arange(len(z), dtype=np.float64), envelope._outlines(units)
    stations = envelope.SPACING_M * np.arange(160, dtype=np.float64)
    low, high = envelope._sweep(units, outlines, path, s, z, stations)
    expected = envelope_twin.sweep(units, outlines, path, s, z, stations)
    for found, reach in zip((low, high), expected, strict=True):
        # a last step of 2e-5 m leaves its square times the curvature in a foot
        np.testing.assert_allclose(found, reach, rtol=0.0, atol=1e-10)


def test_a_pose_beyond_the_centre_of_curvature_is_left_out_and_the_others_count() -> None:
    vehicle, path = load_vehicle("bus"), from_curvature(np.array([0.0, 60.0]), np.full(2, 0.2)).extended(20.0, 20.0)
    units, z, s = vehicle.table(), np.array([[0.0, 0.0], [0.5, 0.0], [4.5, 0.0], [4.5, 0.0]]), 20.0 + 0.25 * np.arange(4, dtype=np.float64)
    outlines, stations = envelope._outlines(units), 0.25 * np.arange(100.0)
    some, every = (envelope._sweep(units, outlines, path, s[:count], z[:count], stations) for count in (2, 4))
    np.testing.assert_array_equal(some, every)
    assert np.any(np.isfinite(some))


@each_kind
def test_a_driven_manoeuvre_is_that_of_the_twin(name: str) -> None:
    vehicle = load_vehicle(name)
    units, point, most = follow.passive(vehicle).table(), (vehicle.lead.wheelbase, 0.5), 0.2
    pieces, counts = np.array([[1.0, 0.0, 0.0], [2.0, 0.0, 0.06], [4.0, 0.06, 0.06]]), np.array([2, 4, 5])
    found = follow.integrate(units, point, pieces, counts, 3, 0.1, most)
    for own, expected in zip(found, motion_twin.follow(units, point, pieces, counts, 3, 0.1, most), strict=True):
        assert np.all(np.isfinite(expected))
        np.testing.assert_allclose(own, expected, rtol=0.0, atol=1e-13)  # both find kappa to 1e-15


def test_a_manoeuvre_ends_where_the_front_wheels_stop() -> None:
    units, pieces, counts = load_vehicle("bus").table(), np.array([[10.0, 0.0, 0.1]]), np.array([20])
    found = follow.integrate(units, (6.0, 0.0), pieces, counts, 2, 0.0, 0.03)
    expected = motion_twin.follow(units, (6.0, 0.0), pieces, counts, 2, 0.0, 0.03)
    assert 2 < np.count_nonzero(np.isfinite(expected[1])) < 20
    for own, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(own, other, rtol=0.0, atol=1e-13)
