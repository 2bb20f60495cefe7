"""The smoothing's quadratic program: the short way without bounds finds Clarabel's optimum, or leaves the program to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from hdvplan.arrays import FloatArray
from hdvplan.road import smooth
from hdvplan.road.load import find_road
from hdvplan.road.offsets import Program, Stations, bounded, program_of, solve_offsets, unbounded
from hdvplan.road.smooth import smooth_line

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
