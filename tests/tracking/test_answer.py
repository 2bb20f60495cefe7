"""The largest tracking error of a plan, as users receive it."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import pytest
from matplotlib.text import Text

import hdvplan
from hdvplan.cli.console import ExitCode
from hdvplan.cli.options import Output
from hdvplan.cli.outcome import exit_code_of, tell
from hdvplan.judging.result import Result
from hdvplan.judging.tracking import tracking_of
from hdvplan.judging.verdict import tracking_line, verdict_of, verdict_title
from hdvplan.need.answer import need_of
from hdvplan.planning.settings import PlannerSettings
from hdvplan.report import answer_colour
from hdvplan.report.compared import answer_rows
from hdvplan.report.kerbs import tubes_of
from hdvplan.report.needs import need_json, need_lines
from hdvplan.report.plots import plan_figure
from hdvplan.report.summary import tracking_json, verdict_json
from hdvplan.road.road import Road


def planned(road: Road, wanted: float = 0.05) -> Result:
    return hdvplan.plan(hdvplan.Case(road, hdvplan.load_vehicle("bus"), settings=PlannerSettings(tracking_error=wanted)))


def test_the_error_is_less_than_the_room_and_halves_with_it(straight: Result) -> None:
    road = straight.drive.road
    wide, narrow = (planned(road.with_limits(1.27 + room, 1.27 + room)) for room in (0.2, 0.1))
    errors = [one.tracking.error for one in (wide, narrow) if one.tracking is not None]
    rooms = [verdict_of(one).spare or 0.0 for one in (wide, narrow)]
    assert rooms == pytest.approx([0.2, 0.1], abs=1e-3)
    assert all(0.0 < error < room for error, room in zip(errors, rooms, strict=True))
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.05)  # the second order


def test_a_plan_that_touches_its_limits_allows_no_error(straight: Result) -> None:
    assert planned(straight.drive.road.with_limits(1.265, 1.265)).tracking.error == 0.0  # type: ignore[union-attr] # it has limits


def test_without_limits_there_is_no_tracking_error(straight: Result) -> None:
    result = planned(replace(straight.drive.road, limits=None))
    assert result.tracking is None
    assert tracking_line(result) == ""
    assert set(tracking_json(result).values()) == {None}


def test_a_tracking_error_changes_no_plan(straight: Result) -> None:
    case = straight.case
    assert replace(case, settings=replace(case.settings, tracking_error=0.2, tracking_length=4.0)).key == case.key


def test_a_plan_that_breaks_its_limits_has_no_tracking_error(straight: Result) -> None:
    result = planned(straight.drive.road.with_limits(1.1, 1.1))
    assert verdict_of(result).fits is False
    assert result.tracking is None
    assert set(tracking_json(result).values()) == {None}


def test_it_is_told_whether_asked_for_or_not(straight: Result) -> None:
    result = planned(straight.drive.road.with_limits(1.47, 1.47), 0.0)
    assert result.case.settings.tracking_error == 0.0
    assert tracking_line(result).startswith("holds while")
    assert tracking_json(result)["tracking_error_m"] == tracking_of(result.drive, result.balance, 6.0).error  # type: ignore[union-attr]


def test_more_than_a_metre_is_not_looked_for(straight: Result) -> None:
    result = planned(straight.drive.road.with_limits(5.0, 5.0))
    assert result.tracking is not None
    assert result.tracking.error == 1.0
    assert not result.tracking.decided
    assert tracking_json(result)["tracking_part"] is None


@pytest.mark.parametrize("more", [False, True])
def test_lines_and_the_exit_code_say_whether_the_driver_may_stray_as_far_as_asked(
    straight: Result, more: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    road = straight.drive.road.with_limits(1.47, 1.47)
    first = planned(road).tracking
    assert first is not None
    result = planned(road, first.error + (0.01 if more else -0.01))
    found = tracking_json(result)
    assert found["tracking_error_m"] == first.error  # whatever is asked for
    assert found["tracking_part"] == first.part
    line, degrees = tracking_line(result), math.degrees(first.error / first.length)
    held, course = (float(number) for number in re.findall(r"within (\S+)", line))
    assert first.error - 0.01 < held <= first.error
    assert degrees - 0.1 < course <= degrees
    assert line.startswith("holds while the driver keeps the front axle within")
    assert "decided at s = " in line
    assert exit_code_of(result, verdict_of(result)) == (ExitCode.BROKEN if more else ExitCode.OK)
    tell(result, Path("bus"), Output())
    first_line, second_line, *_ = capsys.readouterr().out.splitlines()
    strays = f"NO: holds for a driver who strays by {first.error:.3f} m, not for the "
    assert first_line.startswith(strays if more else "YES: 0.20 m to spare at s = ")
    assert second_line.startswith("0.20 m to spare at s = ") == more
    assert tracking_line(result) in second_line


@pytest.mark.parametrize("more", [False, True])
def test_files_and_pictures_say_so_too(straight: Result, more: bool) -> None:
    road = straight.drive.road.with_limits(1.47, 1.47)
    error = planned(road).tracking.error  # type: ignore[union-attr]
    result = planned(road, error + (0.01 if more else -0.01))
    word = "NO" if more else "YES"
    verdict = verdict_json(result, verdict_of(result))
    assert (verdict["word"], verdict["fits"]) == (word, not more)
    assert str(verdict["text"]).startswith(f"{word}: ")
    assert verdict["spare_m"] == pytest.approx(0.2, abs=1e-6)
    row = answer_rows([result]).iloc[0]
    assert row["answer"] == word
    assert row["decides"].startswith("holds for a driver who strays by") == more
    assert f": {word}, " in verdict_title(result, verdict_of(result))
    answer = answer_colour(fits=not more)
    assert any(text.get_color() == answer for text in plan_figure(result).findobj(Text))


def test_where_larger_errors_have_no_bound_no_place_decides() -> None:
    road = hdvplan.load_road("uturn").with_limits(5.0, 5.0)
    result = hdvplan.plan(hdvplan.Case(road, hdvplan.load_vehicle("a-double"), settings=PlannerSettings(tracking_error=0.5)))
    assert result.tracking is not None
    assert 0.0 < result.tracking.error < (result.balance.min_clearance or 0.0)
    assert not result.tracking.decided
    assert tracking_line(result).endswith("; of more nothing is known")
    assert tracking_json(result)["tracking_part"] is None
    assert exit_code_of(result, verdict_of(result)) == ExitCode.BROKEN


def test_need_tells_it_of_a_plan_that_fits(straight: Result) -> None:
    road = straight.drive.road.with_limits(1.47, 1.47)
    need = need_of(hdvplan.Case(road, hdvplan.load_vehicle("bus")))
    assert need.widenings is not None
    assert need.widenings.fitting is not None
    tracking = need.widenings.fitting.tracking
    assert tracking is not None
    assert need_lines(need)[0].endswith(tracking_line(need.widenings.fitting))
    assert need_json(need, 1.0)["tracking_error_m"] == tracking.error


def test_the_tube_in_the_picture_lies_around_what_is_swept_and_within_the_street(straight: Result) -> None:
    result = planned(straight.drive.road.with_limits(1.47, 1.47))
    assert result.tracking is not None
    tubes = tubes_of(result, [(10.0, 30.0), (20.0, 22.0)])
    for tube, (s_from, s_to) in zip(tubes, ((10.0, 30.0), (20.0, 22.0)), strict=True):
        first, low, last, high = tube.bounds
        assert (low, high) == pytest.approx((-1.47, 1.47), abs=5e-3)  # a corner decides: it comes to the kerb
        assert last - first == pytest.approx(s_to - s_from + 12.0, abs=0.3)  # the bus is 12 m long, poses are 0.25 m apart
    assert tubes_of(planned(straight.drive.road.with_limits(1.265, 1.265)), [(10.0, 30.0)]) == []


def test_a_plan_with_a_millimetre_to_spare_leaves_its_driver_no_room(straight: Result) -> None:
    half = 0.5 * straight.drive.vehicle.width + 1e-3
    assert tracking_line(planned(straight.drive.road.with_limits(half, half))).startswith(
        "leaves the driver no room to stray; decided at s = "
    )


def test_a_plan_that_lacks_millimetres_says_that_they_count_as_kept(straight: Result) -> None:
    half = 0.5 * straight.drive.vehicle.width - 4e-3
    result = planned(straight.drive.road.with_limits(half, half))
    assert verdict_of(result).fits is True
    assert "no room to stray: 4 mm are lacking, of which up to 10 count as kept; decided" in tracking_line(result)
