"""The proofs' C functions against their plain twins: the same sets, to rounding."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from hdvplan.proof.answer import grid_of
from hdvplan.proof.articulated import Pair, reachable_with_trailer
from hdvplan.proof.coupling import coupling_of
from hdvplan.proof.poses import fits, outline_of, seen_from
from hdvplan.proof.reach import Reached, reachable
from hdvplan.proof.space import MOST, Beside, Frame, beside, bins_for, frame_of
from hdvplan.road.limits import Limits
from hdvplan.road.path import from_curvature
from hdvplan.road.regions import Kind, Region
from hdvplan.road.road import Road
from hdvplan.vehicle.load import load_vehicle
from tests.proof import twin

BUS, PAIR = load_vehicle("bus"), load_vehicle("tractor-trailer")
KAPPA = 0.1  # [1/m]
ROUNDING_M = 1e-9  # sums in another order, over a hundred steps that each widen


def scene(*, obstacle: bool, two_regions: bool) -> tuple[Beside, Frame]:
    """Return the space beside a bend, and a few stations of it."""
    path = from_curvature(np.array([0.0, 20.0, 30.0, 45.0, 90.0]), np.array([0.0, 0.0, 0.05, 0.0, 0.0])).extended(60.0, 60.0)
    ends, sweep = np.array([0.0, 90.0]), 0.6 if two_regions else 0.0
    limits = Limits(ends, np.array([2.4, 2.6]), np.array([-2.5, -2.2]), np.array([2.4, 2.6]) + sweep, np.array([-2.5, -2.2]) - sweep)
    x, y = (float(value[0]) for value in path.to_plane(np.array([28.0]), np.array([1.9])))
    regions = (Region(Kind.OBSTACLE, shapely.Point(x, y).buffer(0.5, quad_segs=3), "van"),) if obstacle else ()
    space = beside(Road("bend", path, limits, regions=regions), -20.0, 80.0, room=0.015)
    assert space is not None
    return space, frame_of(path, np.arange(24.0, 33.0, 0.5))


def assert_same(one: Reached, other: Reached) -> None:
    assert (one.empty, one.open) == (other.empty, other.open)
    for name in ("low", "high", "right", "left"):
        assert np.allclose(getattr(one, name), getattr(other, name), rtol=0.0, atol=ROUNDING_M, equal_nan=True), name
    assert np.array_equal(one.filled, other.filled)


each_scene = pytest.mark.parametrize(("obstacle", "two_regions"), [(False, False), (True, False), (True, True)])


@each_scene
def test_a_rigid_body_reaches_what_its_twin_reaches(*, obstacle: bool, two_regions: bool) -> None:
    space, frame = scene(obstacle=obstacle, two_regions=two_regions)
    outline, grid = outline_of(BUS.lead, two_regions=two_regions), grid_of(frame, 0.02)
    keeps = [(np.zeros((len(frame.s), grid.cells), np.int64), np.zeros((len(frame.s), grid.cells, MOST, 2))) for _ in range(2)]
    found = reachable(outline, KAPPA, space, frame, grid, two_regions=two_regions, keep=keeps[0])
    plain = twin.reachable(outline, KAPPA, space, two_regions, frame, grid, outline.reach, bins_for(outline.reach), *keeps[1])
    assert np.sum(plain.filled) > 20
    assert_same(found, plain)
    assert np.array_equal(keeps[0][0], keeps[1][0])
    assert np.allclose(keeps[0][1], keeps[1][1], rtol=0.0, atol=ROUNDING_M)


@each_scene
def test_a_trailer_reaches_what_its_twin_reaches(*, obstacle: bool, two_regions: bool) -> None:
    space, frame = scene(obstacle=obstacle, two_regions=two_regions)
    lead, trailer = (outline_of(unit, two_regions=two_regions) for unit in PAIR.units)
    pair = Pair(lead, seen_from(trailer, PAIR.units[1].wheelbase), coupling_of(*PAIR.units))
    frame, grid = Frame(*(column[:5] for column in frame)), grid_of(frame, 0.05)
    found = reachable_with_trailer(pair, KAPPA, space, frame, grid, two_regions=two_regions)
    plain = twin.reachable_with_trailer(pair, KAPPA, space, two_regions, frame, grid, pair.reach, bins_for(pair.reach))
    assert np.sum(plain.filled) > 5
    assert_same(found, plain)


@each_scene
def test_a_body_fits_where_its_twin_fits(*, obstacle: bool, two_regions: bool) -> None:
    space, frame = scene(obstacle=obstacle, two_regions=two_regions)
    frame = Frame(*(column[::4] for column in frame))
    for unit in (BUS.lead, PAIR.units[1]):
        outline = outline_of(unit, two_regions=two_regions)
        near = twin.fits(outline, space, two_regions, frame, outline.reach, bins_for(outline.reach))
        assert fits(outline, space, Frame(*map(np.ascontiguousarray, frame)), two_regions=two_regions) == near
