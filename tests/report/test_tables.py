from __future__ import annotations

from dataclasses import replace
from io import StringIO
from typing import Any

import pandas as pd
import pytest
from rich.console import Console
from rich.table import Table

from hdvplan.judging.balance import Breach
from hdvplan.judging.result import Result
from hdvplan.judging.sentences import breach_text
from hdvplan.report.grid import grid, markdown_table
from hdvplan.report.summary import summary_of
from hdvplan.report.tables import MOST_BREACHES, balance_table, breach_table, planning_table


def printed(table: Table, width: int = 80) -> list[str]:
    console = Console(file=StringIO(), width=width, color_system=None)
    console.print(table)
    assert isinstance(console.file, StringIO)
    return console.file.getvalue().splitlines()


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


def test_where_space_is_short_a_long_name_is_broken_before_digits_are_lost() -> None:
    row = ("qpsolvers/a_solver_of_my_own", "1234.567", "1.2e-10", "100%")
    shown = "".join(printed(grid("", ("solver", "worst", "off the optimum [m]", "accepted"), [row], text=("solver", "road")), width=60))
    assert all(number in shown for number in row[1:])


def test_space_that_is_short_is_taken_from_text_and_never_from_numbers() -> None:
    row = ("a_name_of_thirty_letters_or_so", "12345.678", "words " * 10)
    lines = printed(grid("", ("name", "length [m]", "kind"), [row], text=("name", "kind"), one_line=("kind",)), width=60)
    assert row[0] in lines[-2]
    assert row[1] in lines[-2]
    assert "…" in lines[-2]


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
