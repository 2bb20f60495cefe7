"""What the core bounds of a driver's errors, and which pairs of bodies and kerbs it keeps, against the same in plain Python."""

from __future__ import annotations

import numpy as np
import pytest

import hdvplan
from hdvplan.driving.drive import simulate
from hdvplan.judging.straying import FINER, Posed, chain_of
from hdvplan.judging.tracking import Search, Tracked, pieces_around
from hdvplan.road.path import evaluate_many
from hdvplan.vehicle.body import axles_behind
from hdvplan.vehicle.kinematics import place_many
from tests.core.twins import tracking as twin
from tests.tracking.scenes import SCENES, case_of
from tests.tracking.test_bound import LENGTH_M, bend, tracked

SAME = 1e-9  # [m], [rad]: rounding of bounds of up to some metres, over some hundred intervals
ERRORS = {"bus": 0.8, "rear-steered-bus": 0.2, "semitrailer-steered": 0.2, "a-double": 0.1}


@pytest.mark.parametrize("name", ERRORS)
def test_units_stray_no_further_than_in_python(name: str) -> None:
    chain, error = bend(name), ERRORS[name]
    units, links = chain.vehicle.table(), np.ascontiguousarray(chain.links[100:340])  # a straight, and most of a U-turn
    made = Tracked(units, links, LENGTH_M)
    made.err(error)
    expected = twin.Strays(units, links).of(error, error / LENGTH_M)
    assert np.ptp(expected["axle"][:, -1]) > 0.1 * error  # the bend counts
    for field in made.strays.dtype.names or ():
        np.testing.assert_allclose(made.strays[field], expected[field], rtol=0.0, atol=SAME, err_msg=field)


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
