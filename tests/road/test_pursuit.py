"""Hairpins that turn more tightly than anything can be driven, and the quadratic program by which they are smoothed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from scipy.interpolate import CubicSpline

from hdvplan import api
from hdvplan.answers import NO, YES
from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.errors import RoadError
from hdvplan.judging.balance import KEPT_M
from hdvplan.judging.bodies import corners
from hdvplan.judging.verdict import verdict_of
from hdvplan.road import smooth
from hdvplan.road.line import Line, RawRoad, smoothed
from hdvplan.road.load import find_road
from hdvplan.road.offsets import Program, Stations, bounded, program_of, solve_offsets, unbounded
from hdvplan.road.options import RoadOptions
from hdvplan.road.road import Road
from hdvplan.road.smooth import smooth_line
from hdvplan.road.splines import path_through, pursued
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle
from tests.nightly import nightly

K = 0.125
LEG_M = 60.0


def hairpin(radius: float) -> FloatArray:
    """Return a half turn between two straights, a point every 15 degrees."""
    turn, legs = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 13), np.arange(-LEG_M, 0.0, 5.0)
    arms = [np.stack([legs[::way], np.full(len(legs), -way * radius)], axis=1) for way in (1, -1)]
    return np.vstack([arms[0], radius * np.stack([np.cos(turn), np.sin(turn)], axis=1), arms[1]])


def street(points: FloatArray, half_width: float, vehicle: Vehicle) -> Road:
    raw = RawRoad(points, np.full((4, len(points)), half_width))
    return smoothed(Line("hairpin", raw, RoadOptions(max_curvature=1.25 * vehicle.max_curvature)))[0]


@pytest.mark.slow
@pytest.mark.parametrize("radius", [0.05, *map(nightly, (0.5, 1.5)), 3.05])
def test_a_hairpin_whose_arms_are_too_near_to_each_other_is_driven_along(radius: float) -> None:
    points = hairpin(radius)
    line = smooth_line(points, closed=False, max_deviation=None, max_curvature=K)
    ends = line.path.at(np.array([0.0, line.path.length]))
    np.testing.assert_allclose(np.stack([ends.x, ends.y], axis=1), points[[0, -1]], atol=1e-6)  # a table's rounding
    assert line.smoothing.max_curvature <= 1.1 * K
    assert line.smoothing.max_deviation < 1.1 / K  # half a turning circle to either side of the tip, and what a turn back takes
    assert np.all(np.diff(line.s_points) >= 0.0)
    assert (line.s_points[0], line.s_points[-1]) == pytest.approx((0.0, line.path.length), abs=1e-6)
    with pytest.raises(RoadError):
        smooth_line(points, closed=False, max_deviation=5.0, max_curvature=K)


def test_what_can_be_smoothed_within_the_usual_deviation_is_and_a_point_that_turns_back_is_refused() -> None:
    points = hairpin(9.0)
    one, other = (smooth_line(points, closed=False, max_deviation=bound, max_curvature=K).path.coefficients for bound in (None, 5.0))
    np.testing.assert_array_equal(one, other)
    with pytest.raises(RoadError, match="turns back on itself near s"):
        smooth_line(np.array([[0.0, 0.0], [50.0, 0.0], [0.0, 0.1]]), closed=False, max_deviation=None, max_curvature=K)


@pytest.mark.parametrize("radius", [0.15, 1.5])
def test_a_line_round_a_hairpin_is_the_same_from_either_end(radius: float) -> None:
    points = hairpin(radius)
    one, other = (smooth_line(points[::way], closed=False, max_deviation=None, max_curvature=K).path for way in (1, -1))
    assert one.length == pytest.approx(other.length, abs=1e-6)  # a table's rounding
    s = np.linspace(0.0, one.length, 400)
    np.testing.assert_allclose(one.to_plane(s, 0.0), other.to_plane(other.length - s, 0.0), atol=1e-4)  # knots of equal arclengths


def test_where_the_mean_of_two_drives_is_too_tight_one_from_the_start_is_taken() -> None:
    step, turn = [5.0] * 3, [0.0] * 3  # 15 m, and four hairpins to the left and to the right, each with 15 m behind it
    for way in (1.0, -1.0, 1.0, -1.0):
        step += [*[3.0 * np.sin(np.pi / 24.0)] * 12, 5.0, 5.0, 5.0]
        turn += [way * np.pi / 24.0, *[way * np.pi / 12.0] * 11, way * np.pi / 24.0, 0.0, 0.0]
    heading = np.cumsum(turn)
    points = np.vstack([[0.0, 0.0], np.cumsum(np.array(step)[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1), axis=0)])
    (mean, _), (single, _) = pursued(points, 0.9 * K)
    assert path_through(mean, 1.5 * K) is None
    assert path_through(single, 1.5 * K) is not None
    assert smooth_line(points, closed=False, max_deviation=None, max_curvature=K).smoothing.max_curvature <= 1.5 * K


@pytest.mark.slow
def test_a_hairpin_and_the_same_one_driven_from_its_end_are_one_answer() -> None:
    bus = load_vehicle("bus")
    found = [verdict_of(api.plan(Case(street(hairpin(0.15)[::way], 13.0, bus), bus))) for way in (1, -1)]
    assert found[0].word == found[1].word
    assert found[0].spare == pytest.approx(found[1].spare, abs=0.02)  # as of one street that is given twice


def test_a_drive_keeps_to_a_line_that_it_can_follow_and_to_its_own_curvature_elsewhere() -> None:
    circle = 20.0 * np.stack([np.sin(np.linspace(0.0, math.pi, 60)), 1.0 - np.cos(np.linspace(0.0, math.pi, 60))], axis=1)
    for points, off in ((circle, 0.5), (hairpin(1.0), 3.0 / K)):  # towards a point 6.4 m ahead: a chord of 20 m bows by 0.26 m
        driven, along = next(pursued(points, K))
        assert np.all(np.diff(along) > 0.0)
        assert np.max(shapely.distance(shapely.points(driven), shapely.LineString(points))) < off
        heading = np.unwrap(np.arctan2(*np.diff(driven, axis=0).T[::-1]))
        assert np.max(np.abs(np.diff(heading))) <= 1.1 * K * 0.5  # over a step of half a metre


@pytest.mark.slow
@pytest.mark.parametrize(("half_width", "word"), [(3.0, NO), (22.0, YES)])
def test_a_street_round_a_tight_hairpin_is_answered(half_width: float, word: str) -> None:
    points, bus = hairpin(3.05), load_vehicle("bus")
    result = api.plan(Case(street(points, half_width, bus), bus))
    assert verdict_of(result).word == word
    on = np.flatnonzero(result.drive.poses_s <= result.drive.road.path.length)
    longer = points + np.zeros_like(points)
    longer[[0, -1], 0] -= 30.0  # beyond the ends the street goes on straight
    area = shapely.buffer(shapely.LineString(longer), half_width + KEPT_M)
    swept = shapely.polygons(corners(result.drive, on).reshape(-1, 4, 2))
    assert bool(np.all(shapely.covered_by(swept, area))) is (word == YES)


SAME_M = 1e-4  # Clarabel's point: it stops at 1e-8 of the objective, which some centimetres far from any datum hardly change
KEPT = 1e-6  # Clarabel keeps rows to 1e-8 of their size; slack and bounds are of the order of metres


def given_program(seed: int, *, closed: bool, spread: float = 0.3, deviation: float = 5.0) -> Program:
    """Return the program of a gently bent line of 60 to 300 m with data drawn a metre apart, ``spread`` [m] to its sides."""
    rng = np.random.default_rng(seed)
    stations = Stations(int(rng.integers(60, 300)), 1.01, closed)
    s = np.sort(rng.uniform(0.0, stations.length, stations.count))
    curvature = 0.02 * np.sin(2.0 * np.pi * stations.s / stations.length + rng.uniform(0.0, 6.0))
    e = spread * np.sin(2.0 * np.pi * s / stations.length * rng.integers(1, 4)) + rng.normal(0.0, 0.1 * spread, len(s))
    weights = rng.uniform(0.5, 1.5, len(s)) / 3.0**6
    return program_of(stations, curvature, s, e, weights, max_deviation=deviation, max_curvature=0.125)


def programs_of(road: str, monkeypatch: pytest.MonkeyPatch) -> list[Program]:
    """Return the programs that smoothing a shipped road poses."""
    posed: list[Program] = []

    def noted(program: Program) -> tuple[FloatArray, float] | None:
        posed.append(program)
        return solve_offsets(program)

    with monkeypatch.context() as here:
        here.setattr(smooth, "solve_offsets", noted)
        find_road(road)()
    return posed


@pytest.mark.parametrize("road", ["goteborg_lindholmsallen_uturn", "monaco_fairmont_hairpin", "kotka_e18_exit", "neubrandenburg_ring"])
def test_on_real_roads_the_short_way_finds_what_clarabel_finds(road: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for program in programs_of(road, monkeypatch):
        short, long = unbounded(program), bounded(program)
        assert short is not None
        assert long is not None
        np.testing.assert_allclose(short, long[0], atol=SAME_M)


@pytest.mark.parametrize("closed", [False, True])
def test_on_random_lines_the_short_way_finds_what_clarabel_finds(closed: bool) -> None:
    for seed in range(20):
        program = given_program(seed, closed=closed)
        short, long = unbounded(program), bounded(program)
        assert short is not None
        assert long is not None
        np.testing.assert_allclose(short, long[0], atol=SAME_M)
        assert long[1] == pytest.approx(0.0, abs=KEPT)


@pytest.mark.parametrize("closed", [False, True])
def test_a_program_whose_deviation_binds_is_left_to_clarabel(closed: bool) -> None:
    program = given_program(1, closed=closed, spread=1.0, deviation=0.15)
    assert unbounded(program) is None
    solution = solve_offsets(program)
    assert solution is not None
    offsets, missing = solution
    assert np.all(offsets <= program.highest + missing + KEPT)
    assert np.all(offsets >= program.lowest - missing - KEPT)


def test_a_corner_whose_curvature_binds_keeps_both_bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    ways: list[bool] = []

    def noted(program: Program) -> tuple[FloatArray, float] | None:
        ways.append(unbounded(program) is None)
        return solve_offsets(program)

    monkeypatch.setattr(smooth, "solve_offsets", noted)
    points = np.array([[-60.0, 0.0], [0.0, 0.0], [0.0, 60.0]])
    line = smooth_line(points, closed=False, max_deviation=2.0, max_curvature=0.125)
    assert any(ways)
    assert line.smoothing.max_deviation <= 2.001  # promised to 1 mm
    assert line.smoothing.max_curvature <= 1.01 * 0.125  # promised to 1 %


def test_a_program_that_its_data_do_not_determine_is_left_to_clarabel() -> None:
    program = given_program(3, closed=True)
    undetermined = replace(program, hessian=0.0 * program.hessian, gradient=0.0 * program.gradient)
    assert unbounded(undetermined) is None
    solution = solve_offsets(undetermined)
    assert solution is not None
    assert solution[1] == pytest.approx(0.0, abs=KEPT)
    assert np.all(solution[0] <= undetermined.highest + KEPT)
    assert np.all(solution[0] >= undetermined.lowest - KEPT)


@pytest.mark.parametrize("closed", [False, True])
def test_the_curvature_is_that_of_the_spline_through_the_offsets(closed: bool) -> None:
    program = given_program(4, closed=closed)
    unknowns = np.random.default_rng(4).normal(size=len(program.gradient))
    offsets = program.offsets @ unknowns
    wanted = np.append(offsets, offsets[0]) if closed else offsets
    spline = CubicSpline(1.01 * np.arange(len(wanted)), wanted, bc_type="periodic" if closed else "not-a-knot")
    second = spline(1.01 * np.arange(len(offsets)), 2)
    np.testing.assert_allclose(
        program.bends @ unknowns, second + program.curvature**2 * offsets, atol=1e-9
    )  # rounding of values of 1 to 10
    if not closed:
        np.testing.assert_allclose(offsets[[0, -1]], 0.0, atol=1e-12)  # rounding of the same
