"""Drives of several legs as results: what decides, and where a trailer folds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hdvplan.judging.bodies import placed
from hdvplan.judging.legs import LegsResult, jackknife_of
from hdvplan.judging.result import Result
from hdvplan.report.leg_files import summary_of_legs
from hdvplan.report.leg_layers import swept_by
from hdvplan.road.legs import Leg, Legs
from hdvplan.vehicle.jackknife import critical_angles


def legs_of(*results: Result) -> LegsResult:
    """Return results as legs, every other one driven backwards."""
    legs = tuple(Leg(result.drive.road, number % 2 == 1) for number, result in enumerate(results))
    return LegsResult(Legs("yard", legs), results)


def folded(result: Result, angle: float, at: int) -> Result:
    """Return a result one of whose poses has another articulation."""
    poses = result.drive.poses_z.copy()
    poses[at, 2] = angle
    return replace(result, drive=replace(result.drive, poses_z=poses))


def test_the_leg_with_the_least_room_decides(straight: Result, bus: Result) -> None:
    driven = legs_of(straight, bus)
    spares = [verdict.spare for verdict in driven.verdicts]
    assert driven.worst == int(np.argmin(np.array(spares, dtype=float)))
    assert f" of leg {driven.worst + 1} (" in driven.text
    assert driven.fits is all(verdict.fits for verdict in driven.verdicts)


def test_an_articulation_beyond_the_critical_one_is_a_no_with_its_place(trailer: Result) -> None:
    (critical,) = critical_angles(trailer.drive.vehicle)
    assert jackknife_of(trailer.drive) is None
    assert jackknife_of(folded(trailer, -float(critical), 40).drive) is None
    broken = folded(trailer, -float(critical) - np.deg2rad(2.0), 40)
    found = jackknife_of(broken.drive)
    assert found is not None
    assert found.coupling == 0
    assert found.s == pytest.approx(broken.drive.poses_s[40])
    assert found.angle - found.critical == pytest.approx(np.deg2rad(2.0), abs=1e-12)
    coupling = placed(broken.drive, np.array([40]))[0, 1]
    assert found.x == pytest.approx(float(coupling["coupling_x"]))
    assert found.y == pytest.approx(float(coupling["coupling_y"]))
    driven = legs_of(trailer, broken)
    assert (driven.worst, driven.word, driven.fits) == (1, "NO", False)
    degrees = float(np.degrees(critical))
    answer = f"{degrees + 2.0:.0f} degrees, beyond {degrees:.1f} no steering helps"
    assert driven.text == f"NO: jack-knife at s = {found.s:.1f} m of leg 2 (backward): {answer}"
    assert len(driven.text) <= 100
    assert driven.details.startswith("between the tractor and the trailer, at x ")
    summary = summary_of_legs(driven)
    assert [leg["status"] for leg in summary["legs"]] == [trailer.status, "jack-knife"]
    assert summary["verdict"]["jackknife"]["coupling"] == 1


def test_articulations_at_the_ends_are_in_the_order_of_driving(trailer: Result) -> None:
    driven = legs_of(trailer, trailer)
    low, high = trailer.drive.z[[0, -1], 2]
    for at, ends in enumerate(((low, high), (high, low))):
        assert [float(angles[0]) for angles in driven.articulation(at)] == list(ends)


def test_what_is_swept_includes_what_lies_beyond_the_ends_of_the_line(straight: Result) -> None:
    (area,) = swept_by(straight.drive)
    vehicle, path = straight.drive.vehicle, straight.drive.road.path
    last = float(straight.drive.poses_s[-1])
    x, y = path.to_plane(0.0, 0.0)
    length = vehicle.lead.length + last  # a bus on a straight sweeps a rectangle
    assert area.area == pytest.approx(length * vehicle.width, rel=1e-3)
    assert area.bounds[0] == pytest.approx(float(x) - vehicle.reach_behind, abs=0.01)
    assert float(y) == pytest.approx(0.0, abs=1e-9)
