"""What the core bounds of a driver's errors, and which pairs of bodies and kerbs it keeps, against the same in plain Python."""

from __future__ import annotations

import numpy as np
import pytest

import hdvplan
from hdvplan.arrays import Records
from hdvplan.driving.drive import simulate
from hdvplan.judging.straying import BRUSH, FINER, SPACING_M, Posed, Tracked, chain_of
from hdvplan.judging.tracking import Search, pieces_around
from hdvplan.road.path import evaluate_many
from hdvplan.vehicle.kinematics import axles_behind, place_many
from tests.core.twins import tracking as twin
from tests.tracking.scenes import SCENES, case_of
from tests.tracking.test_bound import LENGTH_M, bend, tracked, weights, worst

SAME = 1e-9  # [m], [rad]: rounding of bounds of up to some metres, over some hundred intervals
LITTLE_M = 1e-3  # [m]: nothing of second order counts
ERRORS = {"bus": 0.8, "rear-steered-bus": 0.2, "semitrailer-steered": 0.2, "a-double": 0.1}


@pytest.mark.slow
@pytest.mark.parametrize("followed", [False, True])
@pytest.mark.parametrize("name", ERRORS)
def test_units_stray_no_further_than_in_python(name: str, followed: bool) -> None:
    chain, error = bend(name), ERRORS[name]
    units, links = chain.vehicle.table(), np.ascontiguousarray(chain.links[100:340])  # a straight, and most of a U-turn
    made = Tracked(units, links, LENGTH_M)
    made.err(error)
    if followed:
        made.follow(np.array([45.0]))  # all from there to 60 m before it
    expected = twin.Strays(units, links, made.gains).of(error, error / LENGTH_M)
    assert np.ptp(expected["axle"][:, -1]) > (0.05 if followed else 0.1) * error  # the bend counts
    for field in made.strays.dtype.names or ():
        np.testing.assert_allclose(made.strays[field], expected[field], rtol=0.0, atol=SAME, err_msg=field)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["semitrailer-steered", "a-double"])
def test_gains_are_what_the_same_errors_do_at_a_place(name: str) -> None:
    made, at, number = tracked(bend(name), LITTLE_M), 45.0, int(45.0 / SPACING_M)
    made.follow(np.array([at]))
    for unit, gain in enumerate(made.gains[number]):
        here, before = (made.links[number - back, unit] for back in (0, 1))
        middle, parts = (number + 0.5) * SPACING_M, ((1.0, 0.0), (0.0, 1.0), (here["next_by_axle"], here["next_by_heading"]))
        for field, (by_axle, by_heading) in zip(("axle", "heading", "next"), parts, strict=True):
            if unit + 1 < made.links.shape[1] or field != "next":
                most, _ = worst(weights(made, brush(unit, middle, by_axle, by_heading)), made.levels)
                assert most <= gain[field] < 1.01 * most + 0.003 * abs(by_heading)  # what errors gain that turn between nodes
        if unit + 1 < made.links.shape[1]:
            of = weights(made, brush(unit, middle, *parts[2]))
            less = weights(made, brush(unit, middle - SPACING_M, before["next_by_axle"], before["next_by_heading"]))
            length = max(len(of), len(less) + 1)
            change = np.pad(of, (0, length - len(of))) - np.pad(less, (1, length - len(less) - 1))
            most = worst(change, made.levels)[0] / (SPACING_M * made.links[number, unit + 1]["coupling_speed"])
            assert most <= gain["next_slope"] < 1.1 * most
    assert np.all(np.isinf(made.gains["axle"][number + 100 :]))  # nobody has asked


def brush(unit: int, at: float, by_axle: float, by_heading: float) -> Records:
    found = np.zeros(1, BRUSH)
    found["at"], found["unit"], found["by_axle"], found["by_heading"], found["gap"] = at, unit, by_axle, by_heading, -1.0
    return found


def test_what_is_followed_is_only_ever_nearer() -> None:
    made = tracked(bend("a-double"), 0.1)
    before = made.strays.copy()
    assert made.follow(np.array([50.0]))
    assert not made.follow(np.array([50.0]))
    near = made.strays["heading"] <= before["heading"]
    assert np.all(near)
    assert np.min(made.strays["heading"] / before["heading"]) < 0.6
    again = Tracked(made.units, made.links, LENGTH_M, made.gains)
    again.err(0.1)
    np.testing.assert_allclose(made.strays["axle"], again.strays["axle"], rtol=0.0, atol=1e-6)  # ended where nothing changed any more


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_the_pairs_that_errors_may_close_are_those_of_numpy(name: str) -> None:
    result = hdvplan.plan(case_of(SCENES[name]))
    chain = chain_of(result.drive)
    error = 0.2 if len(chain.vehicle.units) > 1 else 0.4  # the bound is finite
    made, behind = tracked(chain, error), axles_behind(chain.vehicle)
    assert result.tracking is not None
    own, units, kept = np.arange(len(chain.posed.s)), chain.vehicle.table(), 0
    near = int(np.searchsorted(chain.posed.s, result.tracking.s))
    for pieces in pieces_around(result.drive, result.balance):
        search, end = Search(chain, made, [pieces]), float(pieces.record["end"][0])
        for posed in (Posed(*(column[own % 4 == 0] for column in chain.posed)), chain.closely(near - 30, near + 30)):
            found = search._brushes(posed)
            expected = twin.brushes(units, made.links, made.strays, pieces.pieces, end, posed, behind)
            assert found is not None
            assert len(found) == len(expected)
            kept += len(found)
            order = [np.lexsort([one[field] for field in ("by_heading", "piece", "unit", "at")]) for one in (found, expected)]
            for field in found.dtype.names or ():
                np.testing.assert_allclose(found[field][order[0]], expected[field][order[1]], rtol=0.0, atol=SAME, err_msg=field)
    assert kept > 10


@pytest.mark.parametrize("name", ["bus", "semitrailer-active"])
def test_between_simulated_poses_bodies_are_where_smaller_steps_lead_them(name: str) -> None:
    chain = bend(name)
    drive, units = chain.drive, chain.vehicle.table()
    spacing, wheels = float(drive.poses_s[1] - drive.poses_s[0]), drive.poses_z[:, chain.vehicle.rigid_states :]
    z = simulate(units, drive.stations.path, float(drive.poses_s[0]), spacing, drive.poses_z[0], drive.poses_kappa, FINER, wheels)
    s = drive.poses_s[0] + spacing / FINER * np.arange(len(z))
    expected, found = place_many(units, evaluate_many(drive.stations.path, s), z), chain.closely()
    np.testing.assert_allclose(found.s, s, rtol=0.0, atol=SAME)
    for field in ("x", "y", "cos", "sin"):  # in one Runge-Kutta step of up to 0.25 m, over kinks of the curvature: it leaves 0.02 mm
        np.testing.assert_allclose(found.poses[field], expected[field], rtol=0.0, atol=5e-5)
