"""The behaviour reference: what counts as a move, and which areas it makes stale."""

import os
import shutil
import subprocess
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


# One or two quick cases an area.
QUICK = {
    "planning": ["bus in a bend", "bus, a road shorter than it"],
    "judging": ["bus breaks a limit by less than counts", "bus breaks a limit by a little more than counts"],
    "passing": ["bus, either side of an obstacle on the line"],
    "need": ["bus, a bend that is wide enough"],
    "proof": ["bus, no place for its body"],
    "roads": ["zigzag", "bend with a wall"],
    "turning": ["bus in a quarter turn"],
    "bench": ["gate, slower", "ranking"],
}


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a copy of the package and its reference, in which only the quick cases are recorded."""
    folder = tmp_path_factory.mktemp("copy")
    shutil.copytree(ROOT / "hdvplan", folder / "hdvplan", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(ROOT / "roads", folder / "roads")
    (folder / "benchmarks").mkdir()
    for file in (ROOT / "benchmarks").glob("reference*"):
        shutil.copy(file, folder / "benchmarks")
    return folder


def moved_areas(copy: Path, *options: str) -> list[str]:
    """Return the areas in which the quick cases moved in a copy."""
    command = [sys.executable, "benchmarks/reference.py", *options, "--only", *(name for names in QUICK.values() for name in names)]
    variables = os.environ | {"PYTHONPATH": str(copy)}
    ended = subprocess.run(command, cwd=copy, env=variables, capture_output=True, text=True, check=False)  # noqa: S603 - our own script
    assert ended.returncode in {0, 1}, ended.stderr
    areas = list(dict.fromkeys(line.partition(":")[0] for line in ended.stdout.splitlines() if " -> " in line))
    assert ended.returncode == (1 if areas and not options else 0), ended.stdout
    return areas


def edited(file: Path, old: str, new: str) -> None:
    text = file.read_text(encoding="utf-8")
    assert text.count(old) == 1, f"{file.name} has not one {old!r}"
    file.write_text(text.replace(old, new), encoding="utf-8")


def renamed(package: Path, old: str, new: str) -> None:
    """Rename a module, and what imports it."""
    file = package / f"{old.replace('.', '/')}.py"
    file.rename(file.with_stem(new.rpartition(".")[2]))
    for source in package.rglob("*.py"):
        source.write_text(source.read_text(encoding="utf-8").replace(f"hdvplan.{old} ", f"hdvplan.{new} "), encoding="utf-8")


def turned_round(file: Path) -> None:
    """Put a module's functions into the opposite order, behind all else."""
    blocks = file.read_text(encoding="utf-8").rstrip().split("\n\n\n")
    functions = [block for block in blocks if block.startswith("def ")]
    assert len(functions) > 5
    rest = [block for block in blocks if not block.startswith("def ")]
    file.write_text("\n\n\n".join([*rest, *reversed(functions)]) + "\n", encoding="utf-8")


@pytest.mark.slow
def test_words_names_and_order_move_nothing_and_each_rule_moves_exactly_its_areas(copy: Path) -> None:
    package = copy / "hdvplan"
    edited(package / "driving" / "drive.py", "m long, shorter than the vehicle", "m long, which is less than the vehicle")
    renamed(package, "judging.fit", "judging.forecast")
    turned_round(package / "judging" / "verdict.py")
    assert moved_areas(copy) == []

    def moved_by(file: str, old: str, new: str) -> list[str]:
        edited(package / file, old, new)
        try:
            return moved_areas(copy)
        finally:
            edited(package / file, new, old)

    assert moved_by("planning/settings.py", "] = 1e3  #: w_kappa", "] = 2e3  #: w_kappa") == ["planning", "passing"]
    assert moved_by("judging/balance.py", "KEPT_M = 0.01 ", "KEPT_M = 0.02 ") == ["judging", "proof"]  # proofs are of what is judged
    assert moved_by("road/smooth.py", "_SPACING_SHARE = 1.25 ", "_SPACING_SHARE = 1.5 ") == ["roads"]

    before, rows = read_behaviour(package / BEHAVIOUR.name), read_rows(copy / "benchmarks" / "reference.csv")
    edited(package / "road" / "smooth.py", "_SPACING_SHARE = 1.25 ", "_SPACING_SHARE = 1.5 ")
    assert moved_areas(copy, "--renew", "--reason", "smoother") == ["roads"]
    assert moved_areas(copy) == []
    roads = {"number": before["roads"]["number"] + 1, "reason": "smoother"}
    assert read_behaviour(package / BEHAVIOUR.name) == before | {"roads": roads}
    now = read_rows(copy / "benchmarks" / "reference.csv")
    assert [row.key for row in now] == [row.key for row in rows]
    assert {row.case for old, row in zip(rows, now, strict=True) if old != row} == {"bend with a wall"}
