"""What proofs stand on: one step between two normals, the free space as it is judged, and where a proof is looked for."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st

import hdvplan
from hdvplan import core
from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.judging.result import Result
from hdvplan.judging.verdict import verdict_of
from hdvplan.planning.settings import PlannerSettings
from hdvplan.proof.answer import MOST_M, RIGID, Stretch, follower, joined, proof_of, stretches_of
from hdvplan.proof.reach import CELLS, GRID, Grid, Reached
from hdvplan.proof.space import MOST, Beside, Frame, beside, frame_record
from hdvplan.road.line import Line, RawRoad, smoothed
from hdvplan.road.options import RoadOptions
from hdvplan.road.path import ReferencePath, from_curvature
from hdvplan.road.pieces import Kerb
from hdvplan.road.road import Road
from hdvplan.vehicle.load import load_vehicle
from tests.nightly import nightly

KAPPA = 0.1  # [1/m]
SAMPLES = 4000  # of a drive: the crossing is interpolated between two, to a nanometre
OFFSET_M, HEADING = 1e-8, 1e-8

reach_next = core.function("hdv_reach_next", core.REAL, core.POINTER, core.POINTER, core.INT, *[core.POINTER] * 4, returns=core.INT)
shares = st.floats(0.0, 1.0)
curvatures = st.lists(st.one_of(st.sampled_from([-KAPPA, KAPPA]), st.floats(-KAPPA, KAPPA)), min_size=3, max_size=3)


def frames(step: float, curvature: float) -> Frame:
    """Return two normals ``step`` apart on a circle, or a straight line."""
    s = np.array([0.0, step])
    heading, chord = curvature * s, s * np.sinc(0.5 * curvature * s / np.pi)
    return Frame(s, chord * np.cos(0.5 * heading), chord * np.sin(0.5 * heading), heading)


def crossing(frame: Frame, e: float, heading: float, kappas: list[float], switches: list[float]) -> tuple[float, float] | None:
    """Return offset and heading at the second normal; the curvature switches at shares of the road's step. None where it is not met."""
    step = float(frame.s[1])
    length = 4.0 * (step + abs(e) * abs(float(frame.heading[1])))
    arc = length / SAMPLES
    at = arc * (np.arange(SAMPLES) + 0.5)
    kappa = np.array(kappas)[np.searchsorted(np.sort(switches) * step, at)]
    turned = heading + np.concatenate([[0.0], np.cumsum(kappa * arc)])
    middle = 0.5 * (turned[1:] + turned[:-1])
    x = np.concatenate([[0.0], np.cumsum(arc * np.cos(middle))]) - frame.x[1]
    y = np.concatenate([[0.0], np.cumsum(arc * np.sin(middle))]) + e - frame.y[1]
    cos, sin = np.cos(frame.heading[1]), np.sin(frame.heading[1])
    ahead: FloatArray = x * cos + y * sin
    over = np.flatnonzero(ahead >= 0.0)
    if not len(over) or over[0] == 0:
        return None
    j = int(over[0])
    share = ahead[j - 1] / (ahead[j - 1] - ahead[j])
    offset = y * cos - x * sin
    return float(offset[j - 1] + share * (offset[j] - offset[j - 1])), float(turned[j - 1] + share * (turned[j] - turned[j - 1]))


def reached(frame: Frame, e: float, j: int, grid: Grid) -> tuple[np.ndarray[tuple[int], np.dtype[np.int64]], FloatArray]:
    """Return what one step leads to from cell ``j`` with a single offset."""
    (before, former), (number, pieces) = ((np.zeros(grid.cells, np.int64), np.zeros((grid.cells, MOST, 2))) for _ in range(2))
    before[j], former[j, 0] = 1, e
    left, slopes, stations = np.array([j, j + 1, 0, grid.cells]), np.empty((2 * grid.cells, 2)), frame_record(frame)
    old, new = (np.array([tuple(map(core.address, one))], CELLS) for one in ((before, former), (number, pieces)))
    layout = np.array([grid], GRID)
    reach_next(KAPPA, core.address(stations), core.address(layout), 1, *map(core.address, (old, left, new, slopes)))
    return number, pieces


@given(
    st.sampled_from([0.05, 0.1, 0.2]),
    st.sampled_from([2e-4, 1e-3]),
    st.floats(-0.1, 0.1),
    st.floats(-4.0, 4.0),
    st.floats(-1.0, 1.0),
    shares,
    curvatures,
    st.lists(shares, min_size=2, max_size=2),
)
def test_any_steering_between_two_normals_ends_in_what_the_step_reaches(
    step: float, cell: float, curvature: float, e: float, off: float, share: float, kappas: list[float], switches: list[float]
) -> None:
    frame = frames(step, curvature)
    grid = Grid(-1.35, cell, int(2.7 / cell))
    j = int((off - grid.first) / cell)
    found = crossing(frame, e, grid.first + (j + share) * cell, kappas, switches)
    assume(found is not None)
    assert found is not None
    offset, heading = found
    number, pieces = reached(frame, e, j, grid)
    cells = {int((heading + by - grid.first) / cell) for by in (-HEADING, HEADING)}
    held = [(k, p) for k in cells for p in range(number[k]) if pieces[k, p, 0] - OFFSET_M <= offset <= pieces[k, p, 1] + OFFSET_M]
    assert held, f"{offset} is not held at {heading}: {[pieces[k, : number[k]] for k in cells]}"


def test_a_step_reaches_hardly_more_than_it_must() -> None:
    frame, grid = frames(0.2, 0.05), Grid(-1.35, 2e-4, 13500)
    j = 6750  # along the road
    number, pieces = reached(frame, 1.0, j, grid)
    filled = np.flatnonzero(number)
    turn = KAPPA * 0.2 / grid.size  # cells, at a radius of 20 m less the offset of 1 m somewhat fewer
    assert 0.95 * turn - 1.0 <= filled[-1] - j <= turn + 2.0
    wide = pieces[filled, 0, 1] - pieces[filled, 0, 0]
    assert np.max(wide) < 0.2 * (0.5 * KAPPA * 0.2 + 2.0 * grid.size)  # the mean heading varies by half of the turn at most


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


def reached_in(road: Road, space: Beside, s_from: float, s_to: float) -> Reached:
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
@pytest.mark.parametrize("reading", ["width", *map(nightly, READINGS[1:])])
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
    one, other = reached_in(loop, spaces[0], 20.0, 55.0), reached_in(plain, spaces[1], 20.0, 55.0)
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
    assert reached_in(road, space, 30.0, path.length - 30.0).empty == -1


def driven(half_width: float) -> Result:
    """Return a plan through two bends of 16.7 m radius, 150 m apart."""
    s = np.array([0.0, 20.0, 28.0, 45.0, 53.0, 203.0, 211.0, 228.0, 236.0, 260.0])
    path = from_curvature(s, np.array([0.0, 0.0, 0.06, 0.06, 0.0, 0.0, 0.06, 0.06, 0.0, 0.0]))
    return hdvplan.plan(Case(Road("bends", path).with_limits(half_width, half_width), BUS, settings=PlannerSettings(horizon=50.0)))


@pytest.fixture(scope="module")
def narrow() -> Result:
    return driven(2.2)


@pytest.mark.slow
def test_a_proof_is_added_to_a_plan_that_breaks_its_limits(narrow: Result) -> None:
    assert verdict_of(narrow).proof is None
    found = hdvplan.prove(narrow)
    proof = verdict_of(found).proof
    assert proof is not None
    assert verdict_of(found).proved
    assert any(stretch.s_from <= proof.s_from < proof.s_to <= stretch.s_to for stretch in stretches_of(narrow))
    assert replace(found, proof=None) == narrow


def test_a_plan_that_fits_is_returned_as_it_is() -> None:
    fits = driven(3.0)
    assert hdvplan.prove(fits) is fits


def test_tight_places_far_apart_are_examined_one_by_one(narrow: Result) -> None:
    first, second = sorted(stretches_of(narrow))
    assert first.s_to < second.s_from


def test_progress_grows_to_the_whole_where_nothing_is_proved(narrow: Result, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hdvplan.proof.answer.proof_of", lambda *_: None)
    shares: list[float] = []
    assert hdvplan.prove(narrow, on_progress=shares.append).proof is None
    assert len(shares) == len(stretches_of(narrow))
    assert all(a < b for a, b in pairwise([0.0, *shares]))
    assert shares[-1] == pytest.approx(1.0)


def test_of_a_long_tight_road_only_the_worst_stretches_are_examined() -> None:
    places = [Stretch(500.0 * n, 500.0 * n + 150.0, 0.01 * (n % 7)) for n in range(40)]
    chosen = joined(places, BUS, 20_500.0)
    assert sum(stretch.s_to - stretch.s_from for stretch in chosen) == pytest.approx(MOST_M)
    assert [stretch.lacking for stretch in chosen] == [0.06] * len(chosen)
    (whole,) = joined([Stretch(0.0, 20_000.0, 0.1)], BUS, 20_000.0)
    assert (whole.s_from, whole.s_to) == (0.0, MOST_M)
