"""The free space of proofs holds the street as it is judged, and no more: read from a width, from edges or from a polygon."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.proof.answer import RIGID, follower, proof_of
from hdvplan.proof.reach import Reached
from hdvplan.proof.space import Beside, beside
from hdvplan.road.line import Line, RawRoad, smoothed
from hdvplan.road.options import RoadOptions
from hdvplan.road.path import ReferencePath, from_curvature
from hdvplan.road.pieces import Kerb
from hdvplan.road.road import Road
from hdvplan.vehicle.load import load_vehicle

BUS, CITARO = load_vehicle("bus"), load_vehicle("citaro")
ARM_M, ON_M = 60.0, 30.0  # of the corner's legs; and how far beyond them is looked at
ROUNDING_M = 1e-6  # of unions of triangles
MORE_M = 5e-4  # of an arc of 0.3 m: a chord of a sixteenth of a quarter circle lies 0.36 mm inside
KERB_M = 3e-4  # that a kerb's points may be left out
READINGS = ("width", "edges", "polygon")


def corner(reading: str, half: float) -> Road:
    """Return two legs that meet at a right angle, sharp inside and outside."""
    line = np.array([[0.0, 0.0], [ARM_M, 0.0], [ARM_M, ARM_M]])
    left = np.array([[0.0, half], [ARM_M - half, half], [ARM_M - half, ARM_M]])
    right = np.array([[0.0, -half], [ARM_M + half, -half], [ARM_M + half, ARM_M]])
    ring = np.concatenate([right, left[::-1], right[:1]])
    raws = {
        "width": RawRoad(line, np.full((4, 3), half)), "edges": RawRoad(line, edges=(left, right)), "polygon": RawRoad(line, edges=(ring,))
    }  # fmt: skip
    return smoothed(Line(reading, raws[reading], RoadOptions()))[0]


def free(space: Beside) -> shapely.Geometry:
    """Return the areas for whole bodies as one."""
    first = space.begin[len(space.s) - 1]
    return shapely.union_all(shapely.polygons(space.areas[first:]))


def between(path: ReferencePath, right: FloatArray, left: FloatArray) -> Road:
    """Return a road in a drawn street of straight kerbs along x, from y to y [m]."""
    s = np.linspace(0.0, path.length, 200)
    x = np.maximum.accumulate(path.at(s).x)
    kerbs = (
        Kerb(np.stack([x, left * np.ones(200)], axis=1), s, left=True),
        Kerb(np.stack([x, right * np.ones(200)], axis=1), s, left=False),
    )
    return Road("straight street", path).with_kerbs(kerbs)


def reached(road: Road, space: Beside, s_from: float, s_to: float) -> Reached:
    """Return what the bus reaches over a stretch."""
    follow = follower(road, BUS)
    assert follow is not None
    return follow.run(space, RIGID[0], s_from, s_to)[1]


@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("room", [0.015, -0.3])
def test_the_areas_are_the_street_and_go_on_beyond_its_ends(reading: str, room: float) -> None:
    half = 3.0
    road = corner(reading, half)
    assert road.kerbs is not None
    ahead = road.kerbs.ends * 100.0
    space = beside(road, -ON_M, road.path.length + ON_M, room=room)
    assert space is not None
    found = free(space)
    begin, end = (np.array([[0.0, half], [0.0, -half]]), np.array([[ARM_M + half, ARM_M], [ARM_M - half, ARM_M]]))
    legs = [shapely.box(0.0, -half, ARM_M + half, half), shapely.box(ARM_M - half, -half, ARM_M + half, ARM_M)]
    beyond = [np.concatenate([begin, begin[::-1] - ahead[0]]), np.concatenate([end, end[::-1] + ahead[1]])]
    street = shapely.union_all([*legs, *map(shapely.Polygon, beyond)])
    inside = shapely.box(5.0 - ON_M, -2.0 * half, 2.0 * ARM_M, ARM_M + ON_M - 15.0)  # the last area ends somewhere beyond
    least = street.buffer(min(room, 0.0))
    assert least.intersection(inside).difference(shapely.buffer(found, ROUNDING_M)).area < ROUNDING_M
    most = street.buffer(room, join_style="mitre" if room > 0.0 else "round").buffer(MORE_M, join_style="mitre")
    assert inside.intersection(found).difference(most).area < ROUNDING_M


@pytest.mark.slow
def test_the_three_readings_of_a_corner_are_proved_alike() -> None:
    proofs = [proof_of(Case(corner(reading, 3.0), CITARO)) for reading in READINGS]
    assert proofs[0] is not None
    assert proofs[1:] == [proofs[0], proofs[0]]


@pytest.mark.slow
@pytest.mark.parametrize("reading", READINGS)
def test_a_corner_that_a_bus_gets_round_is_not_called_impossible(reading: str) -> None:
    # its leading unit needs a half width of 3.33 m: as for ``test_corners``
    assert proof_of(Case(corner(reading, 3.4), CITARO)) is None


def test_where_a_road_crosses_itself_the_other_arm_is_no_room() -> None:
    turn, straight = 1.5 * np.pi, 70.0  # a loop of 25 m radius to the left, which crosses the first straight
    s = np.array([0.0, straight, straight + 2.0, straight + turn * 25.0, straight + turn * 25.0 + 2.0, 2.0 * straight + turn * 25.0])
    loop = Road("loop", from_curvature(s, np.array([0.0, 0.0, 0.04, 0.04, 0.0, 0.0]))).with_limits(2.0, 2.0)
    plain = Road("plain", from_curvature(np.array([0.0, straight]), np.zeros(2))).with_limits(2.0, 2.0)
    spaces = [beside(road, -30.0, road.path.length + 30.0, room=0.015) for road in (loop, plain)]
    assert spaces[0] is not None
    assert spaces[1] is not None
    crossing = loop.path.to_plane(np.array([2.0 * straight + turn * 25.0 - 45.0]), np.array([0.0]))
    assert abs(crossing[1][0]) < 5.0  # it comes across the first straight
    assert 20.0 < crossing[0][0] < 60.0
    one, other = reached(loop, spaces[0], 20.0, 55.0), reached(plain, spaces[1], 20.0, 55.0)
    assert one.low == pytest.approx(other.low, abs=KERB_M)
    assert one.high == pytest.approx(other.high, abs=KERB_M)


def test_where_normals_cross_within_the_street_nothing_is_proved() -> None:
    radius, angle = 6.0, 1.4  # a line that winds beside a street in which the bus can drive straight on
    arc = radius * angle
    s = np.cumsum([0.0, 40.0, 1e-3, arc, 1e-3, 2.0 * arc, 1e-3, arc, 1e-3, 40.0])
    path = from_curvature(s, np.array([0.0, 0.0, 1.0, 1.0, -1.0, -1.0, 1.0, 1.0, 0.0, 0.0]) / radius)
    road = between(path, np.array(-3.0), np.array(3.0))
    space = beside(road, -40.0, path.length + 40.0, room=0.015)
    assert space is not None
    assert reached(road, space, 30.0, path.length - 30.0).empty == -1
