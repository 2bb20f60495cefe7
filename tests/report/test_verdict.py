"""Verdicts, summaries and tables of results."""

from __future__ import annotations

import json
import re
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import shapely
from rich.table import Table

import hdvplan
from hdvplan.answers import LINE
from hdvplan.api import plan
from hdvplan.case import Case
from hdvplan.cli.console import print_tables
from hdvplan.judging.balance import Breach
from hdvplan.judging.fit import facts_of
from hdvplan.judging.result import Result, body_name, result_of
from hdvplan.judging.sentences import breach_text
from hdvplan.judging.verdict import Verdict, verdict_details, verdict_line, verdict_of, verdict_title
from hdvplan.need.search import on_road
from hdvplan.report.grid import grid, markdown_table
from hdvplan.report.summary import summary_of
from hdvplan.report.tables import MOST_BREACHES, balance_table, breach_table, planning_table
from hdvplan.road.limits import Limits
from hdvplan.road.load import load_road
from hdvplan.road.options import RoadOptions
from hdvplan.road.regions import Kind, Region
from hdvplan.road.scenarios import SCENARIOS
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Unit, Vehicle


def judged(result: Result, **changes: object) -> Result:
    """The same drive on a road of other limits or regions, or with another clearance wanted."""
    clearance = changes.pop("clearance", 0.0)
    drive = replace(result.drive, road=replace(result.drive.road, **changes), settings=replace(result.drive.settings, clearance=clearance))  # type: ignore[arg-type] # of a test
    return result_of(drive, solver="riccati", objective="geometric")


def line(result: Result) -> str:
    return verdict_line(result, verdict_of(result))


def details(result: Result) -> str:
    return verdict_details(result, verdict_of(result))


def test_a_plan_that_keeps_its_limits_says_yes_and_what_is_to_spare_where(bus: Result) -> None:
    verdict = verdict_of(bus)
    assert verdict.fits is True
    assert verdict.spare == bus.balance.min_clearance
    where = f"s = {verdict.s:.1f} m, {verdict.part} of the bus beside the {verdict.side} limit"
    assert line(bus) == f"YES: {verdict.spare:.2f} m to spare at {where}"
    assert details(bus) == f"at x {verdict.x:.1f}, y {verdict.y:.1f}"


def test_the_first_line_is_short_and_what_it_had_no_room_for_is_in_the_second(bus: Result) -> None:
    name = "bus of the line to the new hospital by way of the old market"
    unit = replace(bus.drive.vehicle.units[0], name=name)
    named = replace(bus, drive=replace(bus.drive, vehicle=replace(bus.drive.vehicle, units=(unit,))))
    assert name not in line(named)
    assert name in details(named)
    van = Region(Kind.OBSTACLE, shapely.box(9.5, 2.5, 10.5, 60.0), "van " * 40)
    for result in (named, judged(named, regions=(van,), clearance=0.25)):
        assert len(line(result)) <= LINE
        assert line(result).startswith(verdict_of(result).word)
    verdict = verdict_of(named)
    of = " of leg 2 (backward)".ljust(LINE - len(verdict_line(named, verdict)) + len(f" beside the {verdict.side} limit"), "!")
    assert verdict_line(named, verdict, of).endswith(f", {verdict.part}")  # rather than a word that is cut
    for length in range(LINE):
        assert "obstacle" not in verdict_line(named, verdict, "!" * length)  # there is none


def test_a_road_without_limits_says_what_it_needs(trailer: Result) -> None:
    verdict = verdict_of(trailer)
    assert (verdict.fits, verdict.spare, verdict.wheels_spare) == (None, None, None)
    assert verdict.half_width == max(trailer.balance.max_left, trailer.balance.max_right)
    assert line(trailer).startswith(f"NEEDS {verdict.half_width:.2f} m to both sides for the tractor-trailer: {verdict.part} ")
    assert details(trailer).endswith("; the road has no limits")


def test_what_a_road_without_limits_needs_counts_from_the_line_as_given(tmp_path: Path) -> None:
    """The plan fits between limits so wide, and smoothing has moved the driven line by a metre."""
    (tmp_path / "corner.csv").write_text("x,y\n0,0\n60,0\n60,60\n", encoding="utf-8")
    road = load_road(tmp_path / "corner.csv", RoadOptions(smooth=2.0))
    assert road.smoothing is not None
    assert road.smoothing.max_deviation > 1.0
    result = plan(Case(road, load_vehicle("bus")))
    needed = verdict_of(result)
    there = verdict_of(on_road(result, road.with_limits(needed.half_width, needed.half_width)))
    assert there.spare == pytest.approx(0.0, abs=2e-3)  # the search ends within 1 mm
    assert there.s == pytest.approx(needed.s, abs=0.01)  # the same contact of the same poses
    assert (there.unit, there.part, there.side) == (needed.unit, needed.part, needed.side)
    assert result.balance.half_width == needed.half_width


def test_wheels_on_the_wrong_side_are_told_from_an_overhang_over_the_kerb(bus: Result, kerbed: Result) -> None:
    assert verdict_of(kerbed).wheels_spare == kerbed.wheel_room
    assert "; wheels, or sides between axles, leave the drivable area by " in details(kerbed)
    # In a left bend the bus's front corner is what reaches furthest to the right, over two metres ahead of its front axle.
    road = judged(bus, limits=Limits.constant(3.0, bus.balance.max_right - 0.05, 200.0))
    assert "; only overhangs pass over it, the wheels keep it; " in details(road)


def test_a_clearance_that_is_not_kept_is_a_no_although_no_limit_is_broken(bus: Result) -> None:
    least = bus.balance.min_clearance or 0.0
    enough, lacking = judged(bus, clearance=least - 0.1), judged(bus, clearance=least + 0.1)
    assert line(enough).startswith(f"YES: 0.10 m to spare beyond the {least - 0.1:.2f} m to keep at s = ")
    assert line(lacking).startswith(f"NO: 0.10 m lacking of the {least + 0.1:.2f} m to keep at s = ")
    assert " beside the " in line(lacking)
    most = judged(bus, clearance=least)  # as --clearance max finds it
    assert line(most).startswith(f"YES: the {least:.2f} m to keep are kept at s = ")
    assert (enough.status, lacking.status) == ("ok", "clearance not kept")
    assert not lacking.balance.breaches


def test_a_post_between_two_stations_of_the_envelope_is_not_driven_through_unseen(straight: Result) -> None:
    s, left, right = np.array([0.0, 30.05, 30.1, 30.15, 80.0]), np.array([3.0, 3.0, 0.5, 3.0, 3.0]), np.full(5, -2.0)
    judged_ = judged(straight, limits=Limits(s, left, right, left, right))
    verdict = verdict_of(judged_)
    assert (verdict.fits, verdict.side, verdict.s) == (False, "left", 30.1)
    # The drive keeps to its straight line to the solver's tolerance.
    assert verdict.spare == pytest.approx(0.5 - straight.balance.max_left, abs=1e-3)
    assert verdict.spare == judged_.balance.min_clearance
    assert judged_.wheel_room == pytest.approx(verdict.spare, abs=1e-3)  # as above
    assert "; wheels, or sides between axles, leave the road by " in details(judged_)


def test_what_counts_as_kept_is_never_called_lacking(bus: Result) -> None:
    least = bus.balance.min_clearance or 0.0
    kept = judged(bus, clearance=least + 0.009)
    assert line(kept).startswith(f"YES: {least:.2f} m of the {least + 0.009:.2f} m to keep at s = ")
    assert f"YES, {least:.2f} m of the {least + 0.009:.2f} m to keep" in verdict_title(kept, verdict_of(kept))


def test_the_title_and_the_summary_say_the_same(bus: Result, kerbed: Result) -> None:
    for result, word in ((bus, "YES"), (kerbed, "NO")):
        verdict: Verdict = verdict_of(result)
        told = summary_of(result)["verdict"]
        assert isinstance(told, dict)
        assert word in verdict_title(result, verdict)
        assert (told["text"], told["word"], told["fits"]) == (line(result), word, verdict.fits)
        assert (told["spare_m"], told["s_m"]) == (verdict.spare, verdict.s)


def test_a_place_just_before_the_road_is_never_at_minus_zero(bus: Result) -> None:
    verdict = replace(verdict_of(bus), s=-0.04, x=-0.02)
    assert verdict_title(bus, verdict).endswith(" at s = 0 m")
    assert " at s = 0.0 m, " in verdict_line(bus, verdict)
    assert verdict_details(bus, verdict).startswith("at x 0.0, ")
    package = Path(hdvplan.__file__).parent
    rounded = [path.name for path in package.rglob("*.py") if re.search(r"\bs = \{[^{}]*:\.\d+f\}", path.read_text(encoding="utf-8"))]
    assert rounded == []  # of an arclength: format it as z.1f


def test_a_limit_broken_by_less_than_is_counted_as_kept_is_no_violation(bus: Result) -> None:
    grazed = replace(bus, balance=replace(bus.balance, min_clearance=-0.005))
    summary = summary_of(grazed)
    assert summary["limit_violation_m"] == 0.0
    assert summary["min_clearance_m"] == -0.005
    assert summary["status"] == "ok"


def test_steps_that_were_not_solved_are_told_where(bus: Result) -> None:
    plans = list(bus.drive.plans)
    plans[3] = replace(plans[3], usable=False)
    summary = summary_of(replace(bus, drive=replace(bus.drive, plans=tuple(plans))))
    assert summary["status"] == "some steps not solved"
    assert summary["failed_steps"] == [15.0]  # the fourth plan, 5 m apart


def test_the_summary_survives_json(trailer: Result) -> None:
    summary = summary_of(trailer)
    assert json.loads(json.dumps(summary, allow_nan=False)) == summary


def test_bodies_have_the_names_that_people_use() -> None:
    unit = Unit(6.0, 1.0, 1.0, 2.5)
    assert body_name(load_vehicle("bus"), 0) == "bus"
    assert [body_name(load_vehicle("tractor-trailer"), unit) for unit in (0, 1)] == ["tractor", "trailer"]
    assert body_name(Vehicle("road train", (unit, unit, unit)), 2) == "unit 3"


def test_facts_find_the_tightest_and_the_narrowest_place() -> None:
    road = SCENARIOS["uturn"]()
    s = np.array([0.0, 40.0, 90.0, road.path.length])
    left, right = np.array([3.0, 2.0, 3.0, 3.0]), -np.full(4, 3.0)
    facts = facts_of(replace(road, limits=Limits(s, left, right, left, right)))
    assert facts.max_curvature == pytest.approx(0.06)
    assert facts.max_curvature_s == pytest.approx(70.9, abs=0.5)  # where the ramp ends, to the sampling
    assert facts.narrowest == pytest.approx(5.0, abs=0.02)  # limits are sampled every 0.5 m
    assert facts.narrowest_s == pytest.approx(40.0, abs=0.5)


def printed(table: Table, width: int = 80) -> list[str]:
    shown = StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(shown):
        patch.setenv("COLUMNS", str(width))
        print_tables(table)
    return shown.getvalue().splitlines()


def balance_of(result: Result) -> list[str]:
    return printed(balance_table(summary_of(result), result.drive.road))


def breaches_of(result: Result) -> list[str]:
    told: dict[str, Any] = summary_of(result)
    return printed(breach_table(told["breaches"]))


@pytest.mark.parametrize("name", ["bus", "trailer", "kerbed", "straight"])
def test_the_tables_of_a_plan_fit_80_columns(name: str, request: pytest.FixtureRequest) -> None:
    lines = balance_of(request.getfixturevalue(name)) + printed(planning_table(summary_of(request.getfixturevalue(name)), "out/"))
    assert lines[-1].strip() == "written to out/"
    assert all(len(line) <= 80 for line in lines)
    assert not any("…" in line for line in lines)


def test_units_in_square_brackets_survive() -> None:
    assert "[m]" in "".join(printed(grid("lengths [m]", ("name", "length [m]"), [("[bold]a", "1.0")], text=("name",))))
    assert "[bold]a" in "".join(printed(grid("", ("name",), [("[bold]a",)], text=("name",))))


def test_space_that_is_short_is_taken_from_text_and_never_from_numbers() -> None:
    row = ("a_name_of_thirty_letters_or_so", "12345.678", "words " * 10)
    lines = printed(grid("", ("name", "length [m]", "kind"), [row], text=("name", "kind"), one_line=("kind",)), width=60)
    assert row[0] in lines[-2]
    assert row[1] in lines[-2]
    assert "…" in lines[-2]


def test_at_forty_columns_no_digit_and_no_name_is_cut_and_remarks_stay_readable() -> None:
    columns = ("road", "vehicle", "solver", "step", "p99 [ms]", "remark")
    row = ("uturn", "bus", "riccati", "105.3", "1234.567", "so it is " * 9)
    lines = printed(grid("times", columns, [row], text=(*columns[:3], columns[-1]), caption="written to out"), width=40)
    whole = [words for line in lines if (words := line.split())[:3] in (list(columns[:3]), list(row[:3]))]
    assert len(whole) == 2  # of headings and numbers, with all names
    assert set(row[:-1]) <= set(whole[-1])
    assert sum("so it is so" in line for line in lines) == 4  # 20 columns hold 7 of 27 words


def test_a_broken_limit_is_told_with_place_depth_side_and_body(kerbed: Result) -> None:
    assert kerbed.status == "limits broken"
    deepest = max(kerbed.balance.breaches, key=lambda breach: breach.depth)
    text = breach_text(kerbed, deepest)
    for word in ("the bus", f"the {deepest.side} limit of ", f"{deepest.depth:.3f} m", f"s = {deepest.s_deepest:.1f} m"):
        assert word in text
    assert "limits broken by" in " ".join(balance_of(kerbed))


def test_the_width_that_a_plan_was_asked_to_keep_is_told(straight: Result) -> None:
    (row,) = [line for line in balance_of(straight) if "narrowest limits" in line]
    assert row.split()[2:] == ["5.00", "m", "apart,", "first", "at", "s", "=", "0.0", "m"]


def test_what_a_limit_binds_is_told_only_where_overhangs_have_limits_of_their_own(kerbed: Result, bus: Result) -> None:
    assert any("binds" in line for line in breaches_of(kerbed))
    breach = Breach(10.0, 12.0, 11.0, 0.1, "left", 0, "front corner", "sweepable", (11.0, 1.0))
    broken = replace(bus, balance=replace(bus.balance, breaches=(breach,)))
    assert not any("binds" in line for line in breaches_of(broken))
    assert breach_text(broken, breach) == "the front corner of the bus breaks the left limit by 0.100 m at s = 11.0 m"


def test_of_many_breaches_the_deepest_are_listed_in_road_order(bus: Result) -> None:
    depths = [0.1 + 0.01 * i for i in range(25)]
    breaches = tuple(Breach(i, i + 1.0, i + 0.5, depths[i], "right", 0, "rear axle", "sweepable", (i + 0.5, -1.0)) for i in range(25))
    lines = breaches_of(replace(bus, balance=replace(bus.balance, breaches=breaches)))
    assert lines[0].strip() == f"broken limits (the deepest {MOST_BREACHES} of 25)"
    rows = [line.split() for line in lines if "right" in line]
    assert [float(row[0]) for row in rows] == [float(i) for i in range(25 - MOST_BREACHES, 25)]


def test_no_value_and_no_heading_can_end_a_cell_or_a_row() -> None:
    table = pd.DataFrame({"mean |left + right|": ["a | b\nc"]})
    header, rule, row = markdown_table(table, text=()).splitlines()
    assert header == r"|   mean \|left + right\| |"
    assert row.strip("| ") == r"a \| b c"
    assert rule.endswith("-:|")  # numbers stand right
