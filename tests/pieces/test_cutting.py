"""Where a long road is cut, that its pieces lie on it, and that what is driven on them is what the whole road's drive does there."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from hdvplan.api import drive_case
from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.errors import OptionError, RoadError
from hdvplan.judging.envelope import Envelope
from hdvplan.pieces import Piece, pieces_of, planned
from hdvplan.planning.bias import Bias
from hdvplan.planning.settings import PlannerSettings
from hdvplan.road.load import Found, find_road, load_road
from hdvplan.road.options import RoadOptions
from hdvplan.road.path import from_curvature
from hdvplan.road.regions import OPEN_M
from hdvplan.road.road import Road, part_of
from hdvplan.road.windows import road_of, windows_of
from hdvplan.vehicle.load import load_vehicle
from tests.pieces.lanes import PLANE, found_of

ROAD = "goteborg_nya_allen"  # 1852 m


@cache
def smoothed(road: str) -> Road:
    """Return a shipped road, smoothed once for all tests."""
    return load_road(road)


def case_on(road: str = ROAD, *, vehicle: str = "bus", half_width: float | None = None) -> Case:
    track = smoothed(road)
    return Case(track if half_width is None else track.with_limits(half_width, half_width), load_vehicle(vehicle))


def of_line(found: Found, *, length: float = 500.0) -> list[Piece]:
    case = case_on()
    return list(pieces_of(found, case.vehicle, case.settings, length=length))


@pytest.fixture(autouse=True)
def _long_roads_are_short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hdvplan.road.line.LONG_M", 500.0)


@cache
def cut_from_its_line() -> tuple[Piece, ...]:
    """Return the pieces of the road's line, smoothed once for all tests."""
    return tuple(of_line(find_road(ROAD)))


def test_a_part_has_the_limits_that_were_given() -> None:
    bend = from_curvature(np.linspace(0.0, 300.0, 4), np.array([0.0, 0.02, 0.02, 0.0]))  # kerbs are chords, and met 1 mm nearer
    beside = part_of(Road("bend", bend).with_limits(4.0, 3.0), 100.0, 200.0, 20.0, 20.0).beside
    assert beside is not None
    np.testing.assert_array_equal(beside.table(np.linspace(0.0, 100.0, 9)), np.tile([[4.0], [-3.0], [4.0], [-3.0]], 9))


@pytest.mark.parametrize("whole", [True, False], ids=["of the road", "of its line"])
def test_pieces_cover_the_road_once_and_begin_where_a_plan_of_the_whole_road_begins(whole: bool) -> None:
    case = case_on()
    cut = list(pieces_of(found_of(case.road), case.vehicle, case.settings, length=500.0)) if whole else cut_from_its_line()
    begins, ends = [one.begins + one.s_from for one in cut], [one.begins + one.s_to for one in cut]
    assert begins[0] == 0.0
    assert ends[-1] == pytest.approx(case.road.path.length, abs=1e-9 if whole else 0.51)  # rounding; a knot: windows end on one
    np.testing.assert_allclose(begins[1:], ends[:-1], atol=1e-9)  # rounding
    np.testing.assert_allclose(np.mod(begins, case.settings.replan), 0.0, atol=1e-9)  # as above
    assert [one.last for one in cut] == [False, False, False, True]


def test_bodies_on_two_pieces_sweep_on_each_what_they_sweep_on_the_whole_road() -> None:
    case = case_on("goteborg_lindholmsallen_uturn", vehicle="tractor-trailer", half_width=6.0)
    whole = Envelope(drive_case(case))
    pieces = pieces_of(found_of(case.road), case.vehicle, case.settings, length=100.0)
    found = [one.result.envelope for one in planned(pieces, lambda road: replace(case, road=road))]
    assert len(found) > 2
    for side in ("left", "right"):
        joined = np.concatenate([getattr(one, side)[:, :-1] for one in found[:-1]] + [getattr(found[-1], side)], axis=1)
        np.testing.assert_allclose(joined, getattr(whole, side), atol=1e-4)  # a plan that begins anew is converged to less than that


def test_pieces_that_are_smoothed_by_themselves_lie_on_the_line_of_the_whole() -> None:
    whole = smoothed(ROAD)
    for one in cut_from_its_line():
        s = np.arange(one.s_from, one.s_to, 5.0)
        here = one.road.path.at(s)
        feet, apart = whole.path.extended(10.0, 10.0).project(here.x, here.y, s + one.begins)
        assert np.max(np.abs(apart)) < 1e-3  # 1 mm is what pieces may differ by; smoothing ends where it moves the line by less than 1 cm
        np.testing.assert_allclose(feet, s + one.begins, atol=0.01)  # lengths of lines that differ by that


def test_pieces_of_a_line_meet_in_place_heading_and_curvature() -> None:
    for before, after in pairwise(cut_from_its_line()):
        end, start = before.road.path.at(before.s_to), after.road.path.at(after.s_from)
        assert before.begins + before.s_to == pytest.approx(after.begins + after.s_from, abs=1e-9)  # rounding
        assert np.hypot(end.x - start.x, end.y - start.y) < 1e-3  # as above
        assert abs(end.curvature - start.curvature) < 1e-4  # of a radius of 100 m, 1 m


@pytest.mark.parametrize("options", [RoadOptions(reverse=True), RoadOptions(offset=-1.75), RoadOptions(reverse=True, offset=2.0)])
def test_direction_and_offset_hold_in_pieces_too(options: RoadOptions) -> None:
    found = find_road(ROAD, options)
    whole = found()
    pieces = of_line(found)
    for one in pieces:
        s = np.arange(one.s_from, one.s_to, 5.0)
        here = one.road.path.at(s)
        _, apart = whole.path.extended(10.0, 10.0).project(here.x, here.y, s + one.begins)
        assert np.max(np.abs(apart)) < 1e-3  # as above
    assert pieces[-1].begins + pieces[-1].s_to == pytest.approx(whole.path.length, abs=0.51)  # a knot: windows end on one


def test_widths_along_a_line_lie_where_they_are_given(tmp_path: Path) -> None:
    x = np.arange(0.0, 2001.0, 20.0)
    rows = [f"{a:.1f},{10.0 * np.sin(a / 100.0):.3f},{3.0 + a / 1000.0:.3f},{4.0:.3f}" for a in x]
    (tmp_path / "wavy.csv").write_text("\n".join(["x,y,left,right", *rows]), encoding="utf-8")
    found = find_road(tmp_path / "wavy.csv")
    whole = found()
    assert whole.limits is not None
    for one in of_line(found):
        assert one.road.limits is not None
        s = np.arange(one.s_from, one.s_to, 7.0)
        np.testing.assert_allclose(one.road.limits.table(s), whole.limits.table(s + one.begins), atol=1e-4)  # they change by 1e-3 a metre


def test_a_bias_along_the_road_moves_with_the_pieces() -> None:
    case = replace(case_on(), bias=Bias(np.array([0.0, 2000.0]), np.array([0.0, 1.0])))
    pieces = pieces_of(found_of(case.road), case.vehicle, case.settings, length=900.0)
    for one in planned(pieces, lambda road: replace(case, road=road)):
        assert one.result.aim[0] == pytest.approx(one.begins / 2000.0, abs=1e-9)  # rounding


def test_a_corner_that_cannot_be_smoothed_is_told_with_its_place_on_the_whole_line(tmp_path: Path) -> None:
    points = [(float(x), 0.0) for x in range(0, 1501, 10)] + [(1500.0 - x, 0.5) for x in range(10, 301, 10)]
    (tmp_path / "back.csv").write_text("\n".join(["x,y", *(f"{x},{y}" for x, y in points)]), encoding="utf-8")
    with pytest.raises(RoadError, match="m along the whole line") as caught:
        of_line(find_road(tmp_path / "back.csv"))
    assert caught.value.s_m == pytest.approx(1500.0, abs=30.0)  # where it turns back, as far as smoothing tells


def test_pieces_lie_on_the_road_that_all_windows_make_to_rounding() -> None:
    found = find_road(ROAD)
    assert found.line is not None
    windows = list(windows_of(found.line, 500.0))
    whole = road_of("whole", windows, 0.0, windows[-1].end)
    for one in cut_from_its_line():
        s = np.arange(one.s_from, one.s_to, 0.7)
        here, there = one.road.path.at(s), whole.path.at(s + one.begins)
        for name in ("x", "y", "curvature"):
            np.testing.assert_allclose(getattr(here, name), getattr(there, name), atol=1e-9)  # rounding of arclengths


def test_where_no_edge_is_drawn_near_a_road_is_open_and_a_note_says_in_which_part(tmp_path: Path) -> None:
    def drawn(x: FloatArray, beside: float, **properties: str) -> dict[str, object]:
        line = np.column_stack([x, 10.0 * np.sin(x / 100.0) + beside])
        return {"type": "Feature", "properties": properties, "geometry": {"type": "LineString", "coordinates": line.tolist()}}

    x = np.arange(0.0, 2001.0, 20.0)
    features = [drawn(x, 0.0), drawn(x[:31], 3.0, edge="left"), drawn(x[:31], -3.0, edge="right")]
    crs = {"type": "name", "properties": {"name": PLANE}}
    (tmp_path / "edges.geojson").write_text(json.dumps({"type": "FeatureCollection", "crs": crs, "features": features}), encoding="utf-8")
    line = find_road(tmp_path / "edges.geojson").line
    assert line is not None
    first, *_, last = windows_of(line, 500.0)
    assert first.road.limits is not None
    assert last.road.limits is not None
    assert np.max(first.road.limits.left) == pytest.approx(3.0, abs=0.05)  # the edges lie 3 m beside it across, not along its normals
    assert np.min(last.road.limits.left) == pytest.approx(OPEN_M, abs=2e-3)  # of a kerb whose points are left out to 1 mm
    assert any("no edge on the left: it is open to 20 m; this is the part from 13" in note for note in last.road.notes)


def test_plans_too_long_for_a_piece_are_refused() -> None:
    case = case_on()
    with pytest.raises(OptionError, match="stretches of 180 m cannot be replanned every 100 m only"):
        pieces_of(found_of(case.road), case.vehicle, PlannerSettings(replan=100.0), length=180.0)


def test_windows_are_blended_without_a_kink() -> None:
    found = find_road(ROAD)
    assert found.line is not None
    windows = list(windows_of(found.line, 500.0))
    path, at_once = road_of("whole", windows, 0.0, windows[-1].end).path, smoothed(ROAD).path
    s = np.arange(0.0, path.length, 0.25)
    here = path.at(s)
    feet, apart = at_once.extended(10.0, 10.0).project(here.x, here.y, s)
    assert np.max(np.abs(apart)) < 1e-3  # as above
    assert np.max(np.abs(here.curvature - at_once.extended(10.0, 10.0).at(feet).curvature)) < 1e-3  # smoothing knows it no better
    for name in ("x", "y"):
        slope = np.diff(getattr(here, name)) / 0.25
        assert np.max(np.abs(np.diff(slope))) < 0.25 * 1.01 * np.max(np.abs(here.curvature))  # no jump of heading
