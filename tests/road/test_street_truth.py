"""The same street, however it is given, is the same answer; and points of a curve are the curve."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy
import shapely
import shapely.affinity
from ezdxf.filemanagement import new
from hypothesis import Phase, assume, given, settings
from hypothesis import strategies as st

from hdvplan import api
from hdvplan.answers import NO, YES
from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.errors import RoadError
from hdvplan.judging.result import Result
from hdvplan.judging.verdict import Verdict, verdict_of
from hdvplan.road.assemble import road_of as raw_of
from hdvplan.road.features import Feature
from hdvplan.road.given import given_line
from hdvplan.road.limits import About, Limits
from hdvplan.road.line import Line, RawRoad, smoothed
from hdvplan.road.load import load_road
from hdvplan.road.options import RoadOptions
from hdvplan.road.path import evaluate_many, from_curvature
from hdvplan.road.pieces import Kerb
from hdvplan.road.regions import Kind, Region
from hdvplan.road.road import Road
from hdvplan.road.street import Street, look
from hdvplan.vehicle.kinematics import axles_behind, place_many
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle
from tests.nightly import nightly

CITARO, BUS = load_vehicle("citaro"), load_vehicle("bus")
SAME_M = 0.02  # of verdicts in one street: asked for
NEAR_M = 1.0  # what lies further from a body is found or not, and bounds nothing
few = settings(derandomize=True, phases=[Phase.explicit, Phase.generate])  # shrinking takes a minute


def road_of(raw: RawRoad) -> Road:
    return smoothed(Line("street", raw, RoadOptions()))[0]


def verdict(road: Road) -> Verdict:
    return verdict_of(api.plan(Case(road, CITARO)))


def ring_of(edges: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Return the outline of the area between two edges, closed."""
    left, right = edges
    return np.concatenate([right, left[::-1], right[:1]])


def offsets(line: FloatArray, half_width: float) -> tuple[FloatArray, FloatArray]:
    """Return the edges so far to the left and to the right of a line, with mitres."""
    drawn = shapely.LineString(line)
    left, right = (np.array(drawn.offset_curve(way * half_width, join_style="mitre").coords) for way in (1.0, -1.0))
    return left, right


def assert_same(one: Verdict, other: Verdict) -> None:
    assert one.word == other.word
    assert one.spare == pytest.approx(other.spare, abs=SAME_M)
    assert (one.part, one.side) == (other.part, other.side)


LEG = 60.0
CORNER = np.array([[0.0, 0.0], [LEG, 0.0], [LEG, LEG]])
half_widths = pytest.mark.parametrize("half_width", [*map(nightly, (2.6, 2.8, 3.0)), 3.2, 3.4, nightly(3.6)])


@half_widths
def test_a_corner_by_its_width_by_its_edges_and_as_a_polygon_is_one_street(half_width: float) -> None:
    edges = offsets(CORNER, half_width)
    np.testing.assert_allclose(edges[0], [[0.0, half_width], [LEG - half_width, half_width], [LEG - half_width, LEG]])  # a mitre indeed
    by_width = verdict(road_of(RawRoad(CORNER, np.full((4, 3), half_width))))
    assert by_width.word == (YES if half_width > 3.3 else NO)  # this bus needs so much at a right angle: 0.2 m are lacking at 3.2 m
    for drawn in (edges, edges[::-1], (ring_of(edges),), (ring_of(edges)[::-1],)):
        assert_same(verdict(road_of(RawRoad(CORNER, edges=drawn))), by_width)


@pytest.mark.slow
@half_widths
def test_a_corner_in_a_drawing_is_the_same_street(half_width: float, tmp_path: Path) -> None:
    left, right = offsets(CORNER, half_width)
    document = new("R2018")
    document.header["$INSUNITS"] = 4  # millimetres
    for layer, points in (("AXIS", CORNER), ("EDGE_LEFT", left), ("EDGE_RIGHT", right)):
        document.modelspace().add_lwpolyline((1e3 * points).tolist(), dxfattribs={"layer": layer})
    document.saveas(tmp_path / "corner.dxf")
    road = load_road(tmp_path / "corner.dxf", RoadOptions(layer="AXIS"))
    assert_same(verdict(road), verdict(road_of(RawRoad(CORNER, np.full((4, 3), half_width)))))


@st.composite
def streets(draw: st.DrawFn) -> FloatArray:
    """Return a line of straights and corners of 35 to 100 degrees, whose arms stay apart."""
    turns = draw(st.lists(st.tuples(st.floats(35.0, 100.0), st.sampled_from([-1, 1])), min_size=1, max_size=4))
    legs = draw(st.lists(st.floats(30.0, 60.0), min_size=len(turns) + 1, max_size=len(turns) + 1))
    heading = np.cumsum([0.0, *(math.radians(angle) * way for angle, way in turns)])
    line = np.vstack([[0.0, 0.0], np.cumsum(np.array(legs)[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1), axis=0)])
    for one in range(len(legs)):
        for other in range(one + 2, len(legs)):
            assume(shapely.LineString(line[one : one + 2]).distance(shapely.LineString(line[other : other + 2])) > 20.0)
    return line


@pytest.mark.slow
@given(line=streets(), half_width=st.floats(2.2, 5.0))
@few
def test_the_kerbs_of_a_width_are_those_of_the_mitred_edges(line: FloatArray, half_width: float) -> None:
    edges = offsets(line, half_width)
    by_width = road_of(RawRoad(line, np.full((4, len(line)), half_width)))
    for drawn in (edges, (ring_of(edges),)):
        by_edges = road_of(RawRoad(line, edges=drawn))
        assert by_width.kerbs is not None
        assert by_edges.kerbs is not None
        for left, edge in zip((True, False), edges, strict=True):
            (one,), (other,) = ([kerb for kerb in road.kerbs.kerbs if kerb.left is left] for road in (by_width, by_edges) if road.kerbs)
            assert shapely.hausdorff_distance(shapely.LineString(one.points), shapely.LineString(edge), densify=0.05) < 1e-6  # rounding
            assert shapely.hausdorff_distance(shapely.LineString(other.points), shapely.LineString(edge), densify=0.05) < 1e-6


@pytest.mark.slow
@given(line=streets(), half_width=st.floats(2.5, 4.5))
@settings(few, max_examples=15)
def test_a_random_street_of_corners_is_the_same_answer_by_width_and_by_edges(line: FloatArray, half_width: float) -> None:
    edges = offsets(line, half_width)
    one, *others = (
        verdict(road_of(raw))
        for raw in (
            RawRoad(line, np.full((4, len(line)), half_width)),
            RawRoad(line, edges=edges),
            RawRoad(line, edges=(ring_of(edges),)),
        )
    )
    for other in others:
        assert one.word == other.word
        assert one.spare is not None
        # Kerbs are equal to rounding, the stretches of line beside them are not. Where metres are lacking plans end in other local optima.
        assert one.spare == pytest.approx(other.spare, abs=SAME_M if one.spare > -0.5 else 0.1)


@st.composite
def crossings(draw: st.DrawFn) -> tuple[FloatArray, float]:
    """Return a line round three corners that crosses its first leg, away from them, and a half width of its street."""
    along, up = draw(st.floats(60.0, 90.0)), draw(st.floats(60.0, 90.0))
    at, lean = draw(st.floats(20.0, along - 30.0)), draw(st.floats(-25.0, 25.0))
    line = np.array([[0.0, 0.0], [along, 0.0], [along + draw(st.floats(-10.0, 10.0)), up], [at - lean, up], [at + lean, -up]])
    return line, draw(st.floats(2.5, 7.0))


def assert_the_crossing_binds_nobody(line: FloatArray, half_width: float) -> None:
    """A road that passes over itself is the same answer as both its parts, each of which does not, by its edges, and by its outline."""
    before, after = line[:3], np.vstack([0.5 * (line[1] + line[2]), line[2:]])
    whole, *parts = (verdict(road_of(RawRoad(own, np.full((4, len(own)), half_width)))) for own in (line, before, after))
    least = min(parts, key=lambda part: part.spare or -math.inf)
    assert whole.word == least.word
    # Where metres are lacking plans end in other local optima.
    assert whole.spare == pytest.approx(least.spare, abs=SAME_M if (least.spare or 0.0) > -0.5 else 0.1)
    area = shapely.LineString(line).buffer(half_width, cap_style="flat", join_style="mitre")
    for edges in (mitred(line, half_width), [np.array(ring.coords) for ring in (area.exterior, *area.interiors)]):
        drawn = verdict(road_of(RawRoad(line, edges=tuple(edges))))
        assert drawn.spare == pytest.approx(whole.spare, abs=1e-3)  # the same kerbs, except where the road passes over itself


def mitred(line: FloatArray, half_width: float) -> tuple[FloatArray, FloatArray]:
    """Return the edges of a line that may cross itself: offsets of a library end where it does."""
    ahead = np.diff(line, axis=0) / np.linalg.norm(np.diff(line, axis=0), axis=1)[:, None]
    left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    before, after = np.vstack([left[:1], left]), np.vstack([left, left[-1:]])
    across = half_width * (before + after) / (1.0 + np.sum(before * after, axis=1))[:, None]
    return line + across, line - across


@pytest.mark.parametrize("half_width", [3.1, 6.0])
def test_a_road_that_passes_over_itself_is_not_bound_by_what_it_passes(half_width: float) -> None:
    assert_the_crossing_binds_nobody(np.array([[0.0, 0.0], [65.0, 0.0], [60.0, 70.0], [40.0, 70.0], [28.0, -70.0]]), half_width)


@pytest.mark.parametrize("first", [0, 3])
def test_edges_of_a_road_in_an_eight_keep_to_their_arm_wherever_they_begin(first: int) -> None:
    phi = 2.0 * math.pi * (first + np.arange(161)) / 160.0  # its first point is where it crosses itself, or 6 m behind
    line = np.stack([60.0 * np.sin(phi), 35.0 * np.sin(2.0 * phi)], axis=1)
    ahead = (
        np.stack([60.0 * np.cos(phi), 70.0 * np.cos(2.0 * phi)], axis=1) / np.hypot(60.0 * np.cos(phi), 70.0 * np.cos(2.0 * phi))[:, None]
    )
    across = 3.5 * np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    drawn, by_width = (
        verdict(road_of(raw)) for raw in (RawRoad(line, edges=(line + across, line - across)), RawRoad(line, np.full((4, 161), 3.5)))
    )
    assert drawn.word == by_width.word == YES
    assert drawn.spare == pytest.approx(
        by_width.spare, abs=0.05
    )  # edges are chords of 2.5 m: inside of 12 m they lie 0.06 m off their curve


def with_edges(line: FloatArray, *edges: FloatArray) -> Road:
    """Return the road along a line beside which edges are drawn, (n, 2) each [m]."""
    features = [Feature({"type": "LineString", "coordinates": line.tolist()}, {})]
    features += [Feature({"type": "LineString", "coordinates": edge.tolist()}, {"edge": "left"}) for edge in edges]
    return road_of(raw_of(features, "street", RoadOptions()))


def u_turn(radius: float) -> FloatArray:
    """Return a line (n, 2) [m] of two arms of 80 m, from and to x = 0, and a half circle."""
    turn = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 20)
    bend = np.column_stack([80.0 + radius * np.cos(turn), radius + radius * np.sin(turn)])
    there = np.column_stack([np.arange(0.0, 80.0, 5.0), np.zeros(16)])
    return np.concatenate([there, bend, there[::-1] + np.array([0.0, 2.0 * radius])])


def assert_kept(result: Result, *edges: FloatArray) -> None:
    """Check that what is swept meets no edge, but where the bus comes from and goes to: it does not steer yet there, or any more."""
    swept = shapely.intersection(shapely.union_all(list(result.swept)), shapely.box(5.0, -40.0, 150.0, 80.0))
    for edge in edges:  # a limit counts as kept to a centimetre
        assert not shapely.intersects(shapely.buffer(swept, -0.01), shapely.LineString(edge))


def test_a_side_is_open_where_its_edge_would_go_on_across_the_road() -> None:
    corner = np.array([[0.0, 0.0], [40.0, 0.0], [70.0, 0.0], [80.0, -10.0], [80.0, -60.0]])
    road = with_edges(corner, np.array([[0.0, 4.0], [60.0, 4.0]]))  # the road ends to the south of it
    assert any(
        note.startswith("street: no edge on the left from s = 60.0 to ") and note.endswith("it is open to 20 m there")
        for note in road.notes
    )
    assert verdict(road).word == YES


def test_an_edge_across_both_arms_of_a_u_turn_is_refused() -> None:
    line = np.array([[0.0, 0.0], [80.0, 0.0], [86.0, 4.0], [86.0, 10.0], [80.0, 14.0], [0.0, 14.0]])
    with pytest.raises(RoadError, match="crosses the road's line"):
        with_edges(line, np.array([[24.0, -0.03], [25.0, 18.0]]))


def test_an_edge_that_is_the_line_itself_is_refused() -> None:
    line, kerb = np.array([[0.0, 0.0], [100.0, 0.0]]), np.array([[0.0, 4.0], [100.0, 4.0]])
    with pytest.raises(RoadError, match=r"an edge lies on the road's line at s = 20.0 m"):
        with_edges(line, kerb, np.array([[20.0, 0.0], [60.0, 0.0]]))


@pytest.mark.parametrize("radius", [6.0, 15.0])
@pytest.mark.parametrize("edge", ["before the bend", "behind the bend", "between the arms", "into the bend"])
def test_one_edge_between_the_arms_of_a_u_turn_is_kept_by_both(radius: float, edge: str) -> None:
    x, y = {
        "before the bend": ((-5.0, 70.0), 0.9),
        "behind the bend": ((-5.0, 70.0), 2.0 * radius - 0.9),
        "between the arms": ((20.0, 60.0), radius),
        "into the bend": ((20.0, 78.0 + radius), radius),
    }[edge]
    drawn = np.column_stack([x, (y, y)])
    result = api.plan(Case(with_edges(u_turn(radius), drawn), BUS))
    assert verdict_of(result).word == YES
    assert_kept(result, drawn)


@pytest.mark.slow
@given(radius=st.floats(6.0, 25.0), ends=st.lists(st.tuples(st.floats(-10.0, 100.0), st.floats(-4.0, 54.0)), min_size=4, max_size=4))
@settings(few, max_examples=40)
def test_no_yes_beside_a_u_turn_sweeps_over_any_edge(radius: float, ends: list[tuple[float, float]]) -> None:
    edges = np.round([ends[:2], ends[2:]], 2)  # as drawings have them
    with suppress(RoadError):  # most cross the line, and are refused
        result = api.plan(Case(with_edges(u_turn(radius), *edges), BUS))
        if verdict_of(result).fits:
            assert_kept(result, *edges)


@pytest.mark.slow
@given(street=crossings())
@few
def test_no_random_road_that_passes_over_itself_is_bound_by_what_it_passes(street: tuple[FloatArray, float]) -> None:
    assert_the_crossing_binds_nobody(*street)


@pytest.mark.slow
@given(line=streets(), half_width=st.floats(2.2, 5.0), offset=st.floats(-1.5, 1.5), turned=st.floats(-0.3, 0.3))
@few
def test_a_kerb_is_as_near_however_long_its_pieces_are(line: FloatArray, half_width: float, offset: float, turned: float) -> None:
    road = road_of(RawRoad(line, np.full((4, len(line)), half_width)))
    assert road.kerbs is not None
    s = np.arange(0.0, road.path.length, 0.5)
    z = np.tile([offset, turned], (len(s), 1))
    poses = place_many(BUS.table(), evaluate_many(road.path, s), z)
    whole, cut = (
        look(Street.along(road.path, kerbs).pieces(s[0] - 20.0, s[-1] + 20.0), BUS.table(), axles_behind(BUS), s, poses)["gap"]
        for kerbs in (road.kerbs.kerbs, tuple(map(in_pieces, road.kerbs.kerbs)))
    )
    np.testing.assert_allclose(np.minimum(whole, NEAR_M), np.minimum(cut, NEAR_M), atol=1e-9)


def in_pieces(kerb: Kerb) -> Kerb:
    """Return a kerb with points at most 3 m apart."""
    line = shapely.segmentize(shapely.LineString(np.column_stack([kerb.points, kerb.s])), 3.0)
    *points, s = shapely.get_coordinates(line, include_z=True).T
    return replace(kerb, points=np.stack(points, axis=1), s=s)


def test_the_place_of_a_verdict_is_the_same_however_the_street_is_given() -> None:
    edges = offsets(CORNER, 3.0)
    one, other = (verdict(road_of(raw)) for raw in (RawRoad(CORNER, np.full((4, 3), 3.0)), RawRoad(CORNER, edges=edges)))
    assert (one.x, one.y) == pytest.approx((other.x, other.y), abs=0.1)  # the deepest place among poses 5 mm apart
    # A kerb of a width carries arclengths of the corner's points, a drawn one those of feet on the path, which is shorter, and which has no
    # foot of its own for a corner within 3 m: around it the two differ by up to the width's reach, and by 1 m for the cut corner
    assert one.s == pytest.approx(other.s, abs=4.0)


# Curves by points.


RADIUS_M = 6.0  # no vehicle's rear axle turns tighter


def sampled(curvature: tuple[FloatArray, FloatArray], spacing: float, phase: float) -> tuple[FloatArray, About]:
    """Return points of a curve that are ``spacing`` apart, and the curve itself."""
    path = from_curvature(*curvature)
    s = np.concatenate([[0.0], np.arange(phase * spacing, path.length - 0.35 * spacing, spacing), [path.length]])
    return np.stack(path.to_plane(s, 0.0), axis=1), About.smooth(path)


def furthest(points: FloatArray, exact: About, half_width: float) -> float:
    """Return how far kerbs beside points lie from those beside the curve, but beside its ends, where no point tells how it goes on."""
    along = np.linspace(0.0, float(exact.s[-1]), len(points))
    limits = Limits.constant(half_width, half_width, float(along[-1]))
    ends, found = shapely.MultiPoint(points[[0, -1]]), 0.0
    spared = half_width + float(np.max(np.hypot(*np.diff(points, axis=0).T)))
    for one, other in zip(About.given(given_line(points, closed=False), along).kerbs(limits), exact.kerbs(limits), strict=True):
        for of, to in ((one.points, other.points), (other.points, one.points)):
            places = np.asarray(shapely.points(shapely.get_coordinates(shapely.segmentize(shapely.LineString(of), 0.2))))
            places = places[shapely.distance(places, ends) > spared]
            pieces = shapely.STRtree(np.asarray(shapely.linestrings(np.stack([to[:-1], to[1:]], axis=1))))
            found = max(found, float(np.max(pieces.query_nearest(places, all_matches=False, return_distance=True)[1], initial=0.0)))
    return found


def allowed(points: FloatArray) -> float:
    """Return what is asked for: 3 cm, 5 cm where a point stands for over 30 degrees."""
    steps = np.diff(points, axis=0)
    heading = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    return 0.05 if np.max(np.abs(np.diff(heading))) > math.radians(30.0) else 0.03


per_circle, spacings, phases = st.integers(8, 40), st.floats(1.0, 12.0), st.floats(0.35, 1.0)


@given(count=per_circle, spacing=spacings, phase=phases, turn=st.floats(0.5, 1.5), sign=st.sampled_from([-1.0, 1.0]))
@few
def test_points_of_a_circle_are_the_circle(count: int, spacing: float, phase: float, turn: float, sign: float) -> None:
    radius = count * spacing / (2.0 * math.pi)
    assume(radius > RADIUS_M)
    length = turn * math.pi * radius
    points, exact = sampled((np.array([0.0, length]), np.full(2, sign / radius)), spacing, phase)
    assert furthest(points, exact, min(0.4 * radius, 4.0)) < allowed(points)


def fresnel(parts: list[tuple[float, float, float]], s: FloatArray) -> FloatArray:
    """Return points at arclengths of straights, arcs and clothoids: of each its length [m] and curvature at both ends [1/m]."""
    begin, heading, place = 0.0, 0.0, 0.0 + 0.0j
    found = np.zeros(len(s), complex)
    for length, first, last in parts:
        along = np.append(np.clip(s - begin, 0.0, length), length)
        rate = (last - first) / length
        if rate == 0.0:
            to = along * np.sinc(0.5 * first * along / np.pi) * np.exp(0.5j * first * along)
        else:  # from where the clothoid is straight
            scale, bow = math.sqrt(math.pi / abs(rate)), -0.5 * first**2 / rate
            sine, cosine = scipy.special.fresnel((along + first / rate) / scale)
            sine_0, cosine_0 = scipy.special.fresnel(first / rate / scale)
            to = scale * ((cosine - cosine_0) + 1j * math.copysign(1.0, rate) * (sine - sine_0)) * np.exp(1j * bow)
        own = (s >= begin) & (s <= begin + length + 1e-9)  # rounding
        found[own] = place + np.exp(1j * heading) * to[:-1][own]
        place, heading, begin = place + np.exp(1j * heading) * to[-1], heading + 0.5 * (first + last) * length, begin + length
    return np.stack([found.real, found.imag], axis=1)


@pytest.mark.parametrize("spacing", [nightly(1.0), nightly(5.0), 12.0])
@pytest.mark.parametrize("count", [8, nightly(10), nightly(12), nightly(16), nightly(24), pytest.param(40, marks=pytest.mark.slow)])
def test_kerbs_beside_points_of_exact_curves_are_their_parallels(count: int, spacing: float) -> None:
    radius = count * spacing / (2.0 * math.pi)
    if radius <= RADIUS_M:
        radius, spacing = RADIUS_M, 2.0 * math.pi * RADIUS_M / count
    k, straight, half_width = 1.0 / radius, 5.0 * spacing, min(0.4 * radius, 4.0)
    arc = max(0.5 * math.pi * radius, 3.0 * spacing)  # of fewer chords no point knows the arc alone
    ramps = [ramp * radius for ramp in (0.2, 0.5, 1.0, 2.0)]
    curves = [
        [(straight, 0.0, 0.0), (arc, k, k), (straight, 0.0, 0.0)],
        [(straight, 0.0, 0.0), (arc, k, k), (arc, -k, -k), (straight, 0.0, 0.0)],
        [(straight, 0.0, 0.0), (arc, k, k), (arc, 0.5 * k, 0.5 * k), (arc, -k, -k), (straight, 0.0, 0.0)],
        *([(straight, 0.0, 0.0), (ramp, 0.0, k), (arc, k, k), (ramp, k, 0.0), (straight, 0.0, 0.0)] for ramp in ramps),
        *(
            [(straight, 0.0, 0.0), (ramp, 0.0, k), (arc, k, k), (2.0 * ramp, k, -k), (arc, -k, -k), (ramp, -k, 0.0), (straight, 0.0, 0.0)]
            for ramp in ramps
        ),
    ]
    for parts in curves:
        length = sum(part[0] for part in parts)
        dense = np.linspace(0.0, length, int(length / 0.1) + 1)  # chords within a fifth of a millimetre
        exact = About(fresnel(parts, dense), dense, np.zeros(len(dense), bool), closed=False)
        for phase in (0.35, 0.5, 0.65, 0.8, 0.95):
            at = np.concatenate([[0.0], np.arange(phase * spacing, length - 0.35 * spacing, spacing), [length]])
            points = fresnel(parts, at)
            found = furthest(points, exact, half_width)
            assert found < allowed(points) + 0.002, (phase, parts)  # of either kerb, points are left out within 1 mm


# Tight lines in wide streets.


@pytest.mark.slow
@pytest.mark.parametrize(("straight", "half_width"), [nightly(40.0, 12.0), nightly(0.0, 12.0), (0.0, 15.0)])
def test_a_long_vehicle_in_hairpins_of_a_wide_street_is_answered(straight: float, half_width: float) -> None:
    """Around a line of 6 m radius; in the widest street limits lead a plan to where motion along the line has no model."""
    bend = 6.0 * math.pi
    parts = [
        (40.0, 0.0, 0.0),
        (bend, 1.0 / 6.0, 1.0 / 6.0),
        (straight + 1e-6, 0.0, 0.0),
        (bend, -1.0 / 6.0, -1.0 / 6.0),
        (straight + 1e-6, 0.0, 0.0),
    ]
    length = sum(part[0] for part in parts)
    line = fresnel(parts, np.linspace(0.0, length, round(length)))
    road = road_of(RawRoad(line, np.full((4, len(line)), half_width)))
    assert verdict_of(api.plan(Case(road, load_vehicle("a-double")))).fits


# Beyond the ends.

STRAIGHT = np.array([[0.0, 0.0], [60.0, 0.0]])


def narrowing(at: float, half_width: float) -> tuple[FloatArray, FloatArray]:
    """Return edges 3 m from a line of 60 m, which narrow so far along it, and reach 25 m beyond its ends."""
    x, y = np.array([-25.0, at - 0.5, at, at + 0.5, 85.0]), np.array([3.0, 3.0, half_width, 3.0, 3.0])
    return np.stack([x, y], axis=1), np.stack([x, -y], axis=1)


@pytest.mark.parametrize("at", [-2.0, 62.0, 66.0])
def test_edges_before_the_start_and_beyond_the_end_are_judged(at: float) -> None:
    for half_width in (1.0, 1.6):
        edges = narrowing(at, half_width)
        for drawn in (edges, (ring_of(edges),)):
            found = verdict_of(api.plan(Case(road_of(RawRoad(STRAIGHT, edges=drawn)), BUS)))
            assert found.fits is (half_width > 0.5 * BUS.width)
            assert found.s == pytest.approx(at, abs=0.5)  # the points of the edges stand there
            assert found.spare is not None
            assert found.spare < half_width - 0.5 * BUS.width + 0.005  # no drive leaves more; edges are judged in steps of 5 mm


@pytest.mark.parametrize("drawn", ["around", "alone", "jagged"])
@pytest.mark.parametrize("room", [-0.2, 0.3])
@pytest.mark.parametrize("behind", [False, True])
def test_an_edge_that_closes_the_street_beyond_an_end_counts_where_a_body_reaches_it(drawn: str, room: float, behind: bool) -> None:
    """A dead end, whose wall is nearer to the line's end than the vehicle's front."""
    at = -BUS.units[-1].rear_overhang - room if behind else 60.0 + BUS.lead.front + room
    far = 85.0 if behind else -25.0
    left, right = ([[far, side], [at, side]] for side in (3.0, -3.0))
    jag = [[at, 0.5], [at + (4.0 if at > 0.0 else -4.0), 0.1], [at, -0.4]]
    lines = {"around": [[*left, *right[::-1]]], "alone": [left, right, [left[1], right[1]]], "jagged": [[*left, *jag, *right[::-1]]]}
    road = road_of(RawRoad(STRAIGHT, edges=tuple(np.array(line) for line in lines[drawn])))
    assert any("an edge closes the street" in note for note in road.notes)
    found = verdict_of(api.plan(Case(road, BUS)))
    assert found.fits is (room > 0.0)
    if drawn != "jagged":  # there a plan that cannot keep them tries one side and the other
        assert found.spare == pytest.approx(room, abs=0.01)  # straight along the middle
        assert found.s == pytest.approx(at, abs=0.5)


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("wall", [[[30.0, -3.0], [30.0, 3.0]], [[30.0, 15.0], [31.0, -1.0]], [[-25.0, 4.0], [30.0, 4.0], [30.0, -3.0]]])
def test_an_edge_across_the_street_is_refused_and_not_driven_over(wall: list[list[float]], way: int) -> None:
    wide = np.array([[-25.0, 3.0], [85.0, 3.0]])
    with pytest.raises(RoadError, match=r"crosses the road's line at s = 3[01]\.\d m: it would close the street"):
        road_of(RawRoad(STRAIGHT, edges=(wide, wide * [1.0, -1.0], np.array(wall)[::way])))


@pytest.mark.parametrize("turned", [1, -1])
def test_an_area_that_ends_before_the_line_is_still_a_street(turned: int) -> None:
    edges = tuple(np.array([[5.0, height], [50.0, height]]) for height in (3.0, -3.0))
    for drawn in (ring_of((edges[0], edges[1])), ring_of((edges[0], edges[1]))[:-1]):
        found = verdict_of(api.plan(Case(road_of(RawRoad(STRAIGHT, edges=(drawn[::turned],))), BUS)))
        assert found.spare == pytest.approx(3.0 - 0.5 * BUS.width, abs=0.01)  # straight along the middle


@pytest.mark.parametrize("at", [-2.0, 62.0, 66.0])
def test_obstacles_before_the_start_and_beyond_the_end_are_judged(at: float) -> None:
    posts = tuple(Region(Kind.OBSTACLE, shapely.box(at - 0.1, low, at + 0.1, high)) for low, high in ((1.0, 3.0), (-3.0, -1.0)))
    wide = np.array([[-25.0, 3.0], [85.0, 3.0]])
    for raw in (RawRoad(STRAIGHT, np.full((4, 2), 3.0), regions=posts), RawRoad(STRAIGHT, edges=(wide, wide * [1.0, -1.0]), regions=posts)):
        found = verdict_of(api.plan(Case(road_of(raw), BUS)))
        assert found.fits is False
        assert found.spare == pytest.approx(1.0 - 0.5 * BUS.width, abs=0.01)  # on its line: the street is symmetrical
        assert found.obstacle is not None


@pytest.mark.parametrize("again", [0.0, 0.005, 0.015])  # [m] further on: within 2 cm a point repeats the one before
def test_a_repeated_point_changes_no_kerb(tmp_path: Path, again: float) -> None:
    """A step of the width, 1e-6 m long, had a direction of its own there: the kerb folded back by 8 mm, and a YES became a NO by metres."""
    angles = 4.0 * np.arange(14) / 40.0
    points = 40.0 * np.column_stack([np.sin(angles), 1.0 - np.cos(angles)])
    lines = []
    for at in (None, *range(2, 12)):
        repeated = points if at is None else np.insert(points, at, points[at - 1] + again * (points[at] - points[at - 1]) / 4.0, axis=0)
        table = np.column_stack([repeated, np.full((len(repeated), 2), 2.8)])
        np.savetxt(tmp_path / "arc.csv", table, delimiter=",", header="x,y,left,right", comments="")
        street = load_road(tmp_path / "arc.csv").kerbs
        assert street is not None
        lines.append([shapely.LineString(kerb.points) for kerb in street.kerbs])
        assert all(
            np.all(np.sum(np.diff(kerb.points, axis=0)[1:] * np.diff(kerb.points, axis=0)[:-1], axis=1) > 0.0) for kerb in street.kerbs
        )
    assert np.max(shapely.hausdorff_distance(lines[1:], lines[0])) < 5e-3  # chords of arcs that begin and end at other points


@pytest.mark.parametrize("half_width", [nightly(3.2), 3.6])
@pytest.mark.parametrize(
    ("apart", "again", "spacing"), [(1e-7, 4, 0.26), nightly(1e-5, 4, 0.26), (4e-3, 1, 0.03), nightly(4e-3, 3, 1.0), (6e-3, 4, 0.26)]
)
def test_points_beside_each_other_that_unions_and_surveys_leave_turn_no_kerb(
    half_width: float, apart: float, again: int, spacing: float
) -> None:
    clean = tuple(np.asarray(shapely.LineString(edge).segmentize(spacing).coords) for edge in offsets(CORNER, half_width))
    jitter = np.random.default_rng(1)
    torn = tuple(np.repeat(edge, again, axis=0) + jitter.uniform(-apart, apart, (again * len(edge), 2)) for edge in clean)
    spare = [verdict(road_of(RawRoad(points=CORNER, edges=edges))).spare for edges in (clean, torn)]
    assert spare[1] == pytest.approx(spare[0], abs=SAME_M if half_width < 3.3 else 0.002 + apart)  # what lacks is a local optimum's


SEMITRAILER = load_vehicle("tractor-semitrailer")
AROUND = np.array([[0.0, 0.0], [70.0, 0.0], [70.0, -70.0]])
HOUSE = [[40.0, -8.0], [40.0, -30.0], [61.0, -30.0], [61.0, -8.0]]  # 2.8 m behind the kerb inside the corner
SHARP = np.array([[0.0, 0.0], [58.39, 0.0], [65.86, -67.1]])
SHED = [[40.5, -13.61], [40.89, -15.76], [50.46, -14.02], [50.07, -11.88]]  # 5.2 m behind it


@pytest.mark.parametrize(
    ("vehicle", "line", "half_width", "radius", "house"),
    [(SEMITRAILER, AROUND, 5.0, 10.0, HOUSE), (SEMITRAILER, AROUND, 5.0, 0.0, HOUSE), (CITARO, SHARP, 3.6, 12.0, SHED)],
)
def test_a_house_behind_the_kerb_inside_a_corner_changes_nothing(
    vehicle: Vehicle, line: FloatArray, half_width: float, radius: float, house: list[list[float]]
) -> None:
    assert_what_is_behind_a_kerb_changes_nothing(vehicle, line, half_width, radius, shapely.Polygon(house))


def test_a_house_deep_inside_a_bend_closes_nothing() -> None:
    path = from_curvature(
        *np.array(
            [[0, 0], [20, 0], [28, -0.055], [59.5, -0.055], [67.5, 0], [86.6, 0], [94.6, -0.078], [109.6, -0.078], [117.6, 0], [155.6, 0]]
        ).T
    )
    at = path.at(np.arange(0.0, path.length, 2.0))
    house = shapely.Polygon([[18.43, -44.11], [10.69, -41.46], [9.87, -43.85], [17.61, -46.5]])  # beyond where normals of the line meet
    assert_what_is_behind_a_kerb_changes_nothing(CITARO, np.stack([at.x, at.y], axis=1), 5.64, 0.0, house)


def assert_what_is_behind_a_kerb_changes_nothing(
    vehicle: Vehicle, line: FloatArray, half_width: float, radius: float, house: shapely.Polygon
) -> None:
    without = RawRoad(line, np.full((4, len(line)), half_width), corner_radius=radius)
    alone, beside = (
        verdict_of(api.plan(Case(road_of(raw), vehicle))) for raw in (without, replace(without, regions=(Region(Kind.OBSTACLE, house),)))
    )
    assert beside.word == alone.word
    assert beside.spare == pytest.approx(alone.spare, abs=SAME_M if (alone.spare or 0.0) > -0.5 else 0.1)  # metres: other local optima


@pytest.mark.slow
@given(
    line=streets(), half_width=st.floats(3.5, 6.0), radius=st.sampled_from([0.0, 8.0, 12.0]), behind=st.floats(0.2, 8.0),
    turned=st.floats(0.0, 360.0), sides=st.tuples(st.floats(1.0, 20.0), st.floats(1.0, 20.0)),
)  # fmt: skip
@few
def test_no_random_house_behind_a_kerb_changes_anything(
    line: FloatArray, half_width: float, radius: float, behind: float, turned: float, sides: tuple[float, float]
) -> None:
    kerbs = road_of(RawRoad(line, np.full((4, len(line)), half_width), corner_radius=radius)).kerbs
    assert kerbs is not None
    left, right = (next(kerb.points for kerb in kerbs.kerbs if kerb.left is own) for own in (True, False))
    # a vehicle reaches beyond the ends of its line: a house there would be in its way
    ends = [np.array([end, end + 40.0 * (end - before) / np.hypot(*(end - before))]) for end, before in (line[[0, 1]], line[[-1, -2]])]
    onwards = [shapely.LineString(end).buffer(half_width + behind, cap_style="flat") for end in ends]
    street = shapely.union_all([shapely.Polygon(ring_of((left, right))).buffer(behind), *onwards])
    x, y = line[1]
    house = shapely.affinity.rotate(shapely.box(x, y, x + sides[0], y + sides[1]), turned, origin=(x, y))
    away = np.array([math.cos(math.radians(turned + 45.0)), math.sin(math.radians(turned + 45.0))])
    moved = (shapely.affinity.translate(house, *(step * away)) for step in np.arange(0.0, 40.0, 0.25))
    off = next((own for own in moved if not own.intersects(street)), None)
    assume(off is not None)
    assert off is not None
    assert_what_is_behind_a_kerb_changes_nothing(CITARO, line, half_width, radius, off)


def test_a_wall_as_thin_as_a_piece_that_is_left_out_stays() -> None:
    line = np.array([(0.0, 0.0), (100.0, 0.0)])
    tip = np.array([(50.0, 0.2), (50.001, 0.2)])  # 1 mm thick
    wall = np.vstack([[(-20.0, 3.0), (50.0, 3.0)], tip, [(50.001, 3.0), (120.0, 3.0)]])
    found = verdict(road_of(RawRoad(points=line, edges=(wall, np.array([(-20.0, -2.0), (120.0, -2.0)])))))
    assert found.word == NO


@pytest.mark.parametrize("corners", [3, 4, 6, 9, 91])
def test_a_breach_along_an_inner_kerb_is_one_however_far_apart_its_points_are(corners: int) -> None:
    def turned(radius: float, count: int) -> FloatArray:
        angle = np.linspace(0.0, 0.5 * np.pi, count)
        bend = np.stack([radius * np.sin(angle), 12.0 - radius * np.cos(angle)], axis=1)
        return np.vstack([[-40.0, 12.0 - radius], bend, [radius, 52.0]])

    road = road_of(RawRoad(turned(12.0, 91), edges=(turned(9.8, corners), turned(14.2, 91))))
    result = api.plan(Case(road, load_vehicle("tractor-semitrailer")))
    (along,) = (breach for breach in result.balance.breaches if breach.side == "left" and breach.depth > 0.1)
    assert (along.s_from < 50.0, along.s_to > 58.0) == (True, True)  # the semitrailer's axles, from one corner of the kerb to the next
