"""The behaviour reference: what counts as a move, and which areas it makes stale."""

import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from hdvplan.machine import BEHAVIOUR, behaviour

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
from reference_rows import (
    AREAS,
    Row,
    behaviour_text,
    kind_of,
    moves_of,
    raised,
    read_behaviour,
    read_rows,
    renewed,
    rows_of,
    rows_text,
    tolerances_of,
)

ROOT = Path(__file__).parents[2]
NUMBER = Row("bend", "planning", "e_y at 30", "0.5", "1e-06")
WORD = Row("bend", "judging", "verdict", "YES", "")
COUNT = Row("bend", "planning", "qps", "18", "")
ROWS = [NUMBER, COUNT, WORD]


def raised_by(measured: list[Row]) -> list[str]:
    before: dict[str, dict[str, object]] = {area: {"number": 3, "reason": "before"} for area in AREAS}
    after = raised(before, moves_of(ROWS, measured), "now")
    assert all(table in ({"number": 3, "reason": "before"}, {"number": 4, "reason": "now"}) for table in after.values())
    return [area for area, table in after.items() if table["number"] == 4]


def test_what_stays_within_its_tolerance_moves_nothing() -> None:
    measured = [replace(NUMBER, value="0.5000009"), COUNT, WORD]
    assert moves_of(ROWS, measured) == []
    assert raised_by(measured) == []


@pytest.mark.parametrize(
    ("row", "area"),
    [(replace(NUMBER, value="0.5000011"), "planning"), (replace(COUNT, value="19"), "planning"), (replace(WORD, value="NO"), "judging")],
)
def test_one_row_that_moved_raises_exactly_its_area(row: Row, area: str) -> None:
    measured = [row if row.key == one.key else one for one in ROWS]
    (move,) = moves_of(ROWS, measured)
    assert move.new == row
    assert raised_by(measured) == [area]


@pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
def test_what_is_no_finite_number_never_keeps_a_tolerance(value: str) -> None:
    for old, new in ((value, value), ("0.5", value), (value, "0.5")):
        assert len(moves_of([replace(NUMBER, value=old)], [replace(NUMBER, value=new)])) == 1


def test_a_case_that_is_new_or_gone_is_told_and_raises_nothing() -> None:
    fresh = replace(NUMBER, case="straight")
    assert [move.row for move in moves_of(ROWS, [*ROWS, fresh])] == [fresh]
    assert raised_by([*ROWS, fresh]) == []
    assert [move.row for move in moves_of(ROWS, [WORD])] == [NUMBER, COUNT]
    assert raised_by([WORD]) == []


def test_a_row_that_a_case_gains_or_loses_raises_its_area() -> None:
    assert raised_by([NUMBER, WORD]) == ["planning"]
    assert raised_by([*ROWS, replace(WORD, quantity="depth 1", value="0.2", tolerance="1e-06")]) == ["judging"]
    assert raised_by([NUMBER, COUNT, replace(WORD, value="0.1", tolerance="1e-06")]) == ["judging"]  # a word that became a number


def test_renewing_leaves_what_did_not_move_as_it_was_written() -> None:
    measured = [replace(NUMBER, value="0.5000009"), replace(COUNT, value="20"), WORD]
    assert renewed(ROWS, measured, moves_of(ROWS, measured)) == [NUMBER, replace(COUNT, value="20"), WORD]


def test_rows_and_integers_are_read_as_they_were_written(tmp_path: Path) -> None:
    odd = Row('bus, "wide"', "roads", "x at 0.2", "1e-12", "0.0001")
    (tmp_path / "rows.csv").write_text(rows_text([*ROWS, odd]), encoding="utf-8")
    assert read_rows(tmp_path / "rows.csv") == [*ROWS, odd]
    assert read_rows(tmp_path / "none.csv") == []
    tables: dict[str, dict[str, object]] = {"planning": {"number": 2, "reason": 'a "sharper" rule: 5 \\ 3, ä'}}
    (tmp_path / "behaviour.toml").write_text(behaviour_text(tables, "# head\n"), encoding="utf-8")
    assert read_behaviour(tmp_path / "behaviour.toml") == tables


def test_a_number_without_a_tolerance_is_refused() -> None:
    tolerances = tolerances_of([{"areas": ["planning"], "kinds": ["beta"], "within": 1e-6}])
    found = rows_of("bend", "planning", {"beta_2 at 30": 0.25, "qps": 18, "word": "yes"}, tolerances)
    assert [(row.quantity, row.value, row.tolerance) for row in found] == [
        ("beta_2 at 30", "0.25", "1e-06"), ("qps", "18", ""), ("word", "yes", ""),
    ]  # fmt: skip
    with pytest.raises(KeyError):
        rows_of("bend", "judging", {"beta_2 at 30": 0.25}, tolerances)


def test_the_record_is_of_the_cases_and_areas_that_there_are() -> None:
    document = tomllib.loads((ROOT / "benchmarks" / "reference.toml").read_text(encoding="utf-8"))
    rows = read_rows(ROOT / "benchmarks" / "reference.csv")
    assert {(row.area, row.case) for row in rows} == {(area, name) for area in AREAS for name in document[area]}
    assert tuple(behaviour()) == AREAS
    assert all(str(table["reason"]).strip() for table in read_behaviour(BEHAVIOUR).values())
    used = {(row.area, kind_of(row.quantity)) for row in rows if row.tolerance}
    assert {row.tolerance for row in rows if row.tolerance} <= set(tolerances_of(document["tolerance"]).values())
    assert used <= set(tolerances_of(document["tolerance"]))
    assert not any(value in {"nan", "inf", "-inf"} for value in (row.value for row in rows))
