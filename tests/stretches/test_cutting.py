"""Where a long road is cut, and that what a stretch drives on its core is what the whole road's drive does there."""

from __future__ import annotations

import json
import pickle
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
from hdvplan.judging.envelope import envelope_of
from hdvplan.judging.result import result_of
from hdvplan.planning.bias import Bias
from hdvplan.road.line import RoadOptions
from hdvplan.road.load import Found, find_road, load_road
from hdvplan.road.regions import OPEN_M
from hdvplan.road.road import Road
from hdvplan.road.windows import road_of, windows_of
from hdvplan.stretches.clipping import clipped
from hdvplan.stretches.cutting import Stretch, reach_of, stretches_of_line, stretches_of_road
from hdvplan.vehicle.load import load_vehicle
from tests.stretches.lanes import PLANE

ROAD = "goteborg_nya_allen"  # 1852 m


@cache
def smoothed(road: str) -> Road:
    """Return a shipped road, smoothed once for all tests."""
    return load_road(road)


def case_on(road: str = ROAD, *, vehicle: str = "bus", half_width: float | None = None) -> Case:
    track = smoothed(road)
    return Case(track if half_width is None else track.with_limits(half_width, half_width), load_vehicle(vehicle))


def of_line(found: Found, *, core: float = 500.0, bias: Bias | None = None) -> list[Stretch]:
    assert found.line is not None
    usual = case_on()
    case = usual if bias is None else replace(usual, bias=bias)
    return list(
        stretches_of_line(found.line, lambda road: replace(case, road=road), reach=reach_of(case.vehicle, case.settings), core=core)
    )


@cache
def cut_from_its_line() -> tuple[Stretch, ...]:
    """Return the stretches of the road's line, smoothed once for all tests."""
    return tuple(of_line(find_road(ROAD)))


def test_cores_cover_the_road_once_and_begin_where_a_plan_of_the_whole_road_begins() -> None:
    case = case_on()
    cut = list(stretches_of_road(case, core=500.0))
    begins = [one.begins + one.core[0] for one in cut]
    ends = [one.begins + one.core[1] for one in cut]
    assert [one.number for one in cut] == [0, 1, 2, 3]
    assert begins[0] == 0.0
    assert ends[-1] == pytest.approx(case.road.path.length, abs=1e-9)  # rounding
    np.testing.assert_allclose(begins[1:], ends[:-1], atol=1e-9)  # rounding
    np.testing.assert_allclose(np.mod(begins, case.settings.replan), 0.0, atol=1e-9)  # as above
    assert [one.last for one in cut] == [False, False, False, True]


def test_a_stretch_pickles_to_the_same_case() -> None:
    for one in stretches_of_road(case_on(half_width=3.5), core=900.0):
        assert pickle.loads(pickle.dumps(one)).case.key == one.case.key  # noqa: S301 - our own


def test_a_clipped_drive_sweeps_what_the_whole_drive_sweeps_there() -> None:
    driven = drive_case(case_on("goteborg_lindholmsallen_uturn", vehicle="tractor-trailer", half_width=6.0))
    whole, part = envelope_of(driven), clipped(driven, 100.0, 200.0)
    swept = envelope_of(part)
    first = int(100.0 / 0.25)
    assert len(swept.s) == 401
    for side in ("left", "right"):
        of_whole = getattr(whole, side)[:, first : first + 401]
        np.testing.assert_allclose(getattr(swept, side), of_whole, atol=1e-9)  # arclengths are rounded otherwise


def test_a_clipped_drive_is_judged_as_a_drive_of_its_own() -> None:
    case = case_on("liechtenstein_planken", half_width=2.2)
    driven = drive_case(case)
    result = result_of(driven, solver=case.solver, objective=case.objective)
    begin = 5.0 * float(np.floor(result.balance.breaches[0].s_from / 5.0)) - 50.0  # the hairpins are too narrow
    part = result_of(clipped(driven, begin, begin + 150.0), solver=case.solver, objective=case.objective)
    there, here = result.balance.breaches[0], part.balance.breaches[0]
    assert (there.side, there.part, there.unit) == (here.side, here.part, here.unit)
    assert here.depth == pytest.approx(there.depth, abs=1e-9)  # rounding
    assert here.s_deepest == pytest.approx(there.s_deepest - begin, abs=1e-9)  # as above
    assert len(part.drive.plans) == 30
    assert part.drive.stations.s[part.drive.plans[0].first] == 0.0


def test_stretches_that_are_smoothed_by_themselves_lie_on_the_line_of_the_whole() -> None:
    whole = smoothed(ROAD)
    for one in cut_from_its_line():
        s = np.arange(one.core[0], one.core[1], 5.0)
        here = one.case.road.path.at(s)
        feet, apart = whole.path.extended(10.0, 10.0).project(here.x, here.y, s + one.begins)
        assert (
            np.max(np.abs(apart)) < 1e-3
        )  # 1 mm is what stretches may differ by; smoothing ends where it moves the line by less than 1 cm
        np.testing.assert_allclose(feet, s + one.begins, atol=0.01)  # lengths of lines that differ by that


def test_stretches_of_a_line_meet_in_place_heading_and_curvature() -> None:
    for before, after in pairwise(cut_from_its_line()):
        end, start = before.case.road.path.at(before.core[1]), after.case.road.path.at(after.core[0])
        assert before.begins + before.core[1] == pytest.approx(after.begins + after.core[0], abs=1e-9)  # rounding
        assert np.hypot(end.x - start.x, end.y - start.y) < 1e-3  # as above
        assert abs(end.curvature - start.curvature) < 1e-4  # of a radius of 100 m, 1 m


@pytest.mark.parametrize("options", [RoadOptions(reverse=True), RoadOptions(offset=-1.75), RoadOptions(reverse=True, offset=2.0)])
def test_direction_and_offset_hold_in_stretches_too(options: RoadOptions) -> None:
    found = find_road(ROAD, options)
    whole = found()
    stretches = of_line(found)
    for one in stretches:
        s = np.arange(one.core[0], one.core[1], 5.0)
        here = one.case.road.path.at(s)
        _, apart = whole.path.extended(10.0, 10.0).project(here.x, here.y, s + one.begins)
        assert np.max(np.abs(apart)) < 1e-3  # as above
    assert stretches[-1].begins + stretches[-1].core[1] == pytest.approx(whole.path.length, abs=0.51)  # a knot: windows end on one


def test_widths_along_a_line_lie_where_they_are_given(tmp_path: Path) -> None:
    x = np.arange(0.0, 2001.0, 20.0)
    rows = [f"{a:.1f},{10.0 * np.sin(a / 100.0):.3f},{3.0 + a / 1000.0:.3f},{4.0:.3f}" for a in x]
    (tmp_path / "wavy.csv").write_text("\n".join(["x,y,left,right", *rows]), encoding="utf-8")
    found = find_road(tmp_path / "wavy.csv")
    whole = found()
    assert whole.limits is not None
    for one in of_line(found):
        assert one.case.road.limits is not None
        s = np.arange(one.core[0], one.core[1], 7.0)
        np.testing.assert_allclose(
            one.case.road.limits.table(s), whole.limits.table(s + one.begins), atol=1e-4
        )  # they change by 1e-3 a metre


def test_a_bias_along_the_road_moves_with_the_stretches() -> None:
    bias = Bias(np.array([0.0, 2000.0]), np.array([0.0, 1.0]))
    for one in of_line(find_road(ROAD), bias=bias):
        assert one.case.bias.at(np.array([one.core[0]]))[0] == pytest.approx((one.begins + one.core[0]) / 2000.0, abs=1e-9)  # rounding


def test_a_curvature_profile_is_not_planned_in_stretches(tmp_path: Path) -> None:
    (tmp_path / "profile.csv").write_text("s,kappa\n0,0\n600,0\n", encoding="utf-8")
    with pytest.raises(RoadError, match="only lines of points are planned in stretches"):
        of_line(find_road(tmp_path / "profile.csv"))


def test_a_corner_that_cannot_be_smoothed_is_told_with_its_place_on_the_whole_line(tmp_path: Path) -> None:
    points = [(float(x), 0.0) for x in range(0, 1501, 10)] + [(1500.0 - x, 0.5) for x in range(10, 301, 10)]
    (tmp_path / "back.csv").write_text("\n".join(["x,y", *(f"{x},{y}" for x, y in points)]), encoding="utf-8")
    with pytest.raises(RoadError, match="m along the whole line") as caught:
        of_line(find_road(tmp_path / "back.csv"))
    assert caught.value.s_m == pytest.approx(1500.0, abs=30.0)  # where it turns back, as far as smoothing tells


def test_stretches_lie_on_the_road_that_all_windows_make_to_rounding() -> None:
    found = find_road(ROAD)
    assert found.line is not None
    windows = list(windows_of(found.line, 500.0))
    whole = road_of("whole", windows, 0.0, windows[-1].end)
    for one in cut_from_its_line():
        s = np.arange(one.core[0], one.core[1], 0.7)
        here, there = one.case.road.path.at(s), whole.path.at(s + one.begins)
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


def test_plans_too_long_for_a_stretch_are_refused() -> None:
    case = case_on()
    with pytest.raises(OptionError, match="stretches of 180 m cannot be replanned every 100 m only"):
        next(stretches_of_road(replace(case, settings=replace(case.settings, replan=100.0)), core=180.0))


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
