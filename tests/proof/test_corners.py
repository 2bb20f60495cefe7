"""Proofs against the least width of two straight corridors that meet at a right angle, sharp inside and outside, for a rigid vehicle.

That width was found once by optimal control in the plane, which shares nothing with planning or proving: a chain of arcs of any curvatures
up to the largest, from any offset and heading in the first corridor, moved by linear programs until the corridors are narrowest.
"""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from hdvplan.case import Case
from hdvplan.judging.balance import KEPT_M
from hdvplan.proof.answer import proof_of
from hdvplan.road.path import from_curvature
from hdvplan.road.regions import Kind, Region
from hdvplan.road.road import Road
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle

_ARM_M = 60.0  # of the corridors' walls
BUS = load_vehicle("bus")
EXACT_M = 7.1186  # of the bus, what halving the arcs converges to: 7.1148, 7.1177, 7.1186 at 0.5, 0.25, 0.125 m

LACKS_M = 0.3  # points of a body's outline are 0.4 m apart: a sharp corner pokes between them


def corner(vehicle: Vehicle, width: float, *, radius: float = 12.0, ramp: float = 6.0) -> Case:
    """Return a road round the corner of two corridors of ``width`` [m]: a rounded line between walls in the plane."""
    constant = 0.5 * np.pi * radius - ramp
    lengths = np.array([35.0, ramp, constant, ramp, 35.0])
    path = from_curvature(np.concatenate([[0.0], np.cumsum(lengths)]), np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0]) / radius)
    across = float(path.at(path.length).x)  # the line leaves there to the north; it came along y = 0
    half = 0.5 * width
    inner, outer = (across - half, half), (across + half, -half)
    block = shapely.box(inner[0] - _ARM_M, inner[1], inner[0], inner[1] + _ARM_M)
    south = shapely.box(inner[0] - _ARM_M, outer[1] - 5.0, outer[0] + 5.0, outer[1])
    east = shapely.box(outer[0], outer[1], outer[0] + 5.0, inner[1] + _ARM_M)
    regions = tuple(Region(Kind.OBSTACLE, wall, name) for wall, name in ((block, "block"), (south, "south"), (east, "east")))
    furthest = np.sqrt(2.0) * half + (np.sqrt(2.0) - 1.0) * radius  # the outer corner, from the line
    return Case(Road("corner", path, regions=regions).with_limits(half + 0.5, furthest + 0.5), vehicle)


@pytest.mark.slow
def test_corridors_as_wide_as_the_least_are_not_called_impossible() -> None:
    # What is given is kept to KEPT_M by both walls of a corridor.
    assert proof_of(corner(BUS, EXACT_M - 2.0 * KEPT_M + 2e-3)) is None


@pytest.mark.slow
def test_narrower_corridors_are_proved_impossible() -> None:
    found = proof_of(corner(BUS, EXACT_M - 2.0 * KEPT_M - LACKS_M))
    assert found is not None
    assert found.kind == "motion"
