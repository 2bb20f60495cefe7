"""A row of results that is made again is compared with the committed one, and what was falsified is found."""

import ast
import shutil
import string
import sys
from pathlib import Path

import pandas as pd
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import mutants
import spot_checks
from spot_checks import FOLDERS, RESULTS, Row, Spot, compared, main, rows_of

WIDTHS = Spot("widths.csv", key=("road", "vehicle", "half_width"))


def test_every_folder_says_how_a_row_is_made_again_with_columns_that_its_file_has() -> None:
    assert {path.name for path in RESULTS.iterdir() if path.is_dir()} == set(FOLDERS)
    for name, table in FOLDERS.items():
        for entry in table["again"]:
            spot = Spot(**entry)
            columns = rows_of(RESULTS / name / spot.file)[0]
            asked = {field for _, field, _, _ in string.Formatter().parse(spot.run + spot.made) if field}
            assert asked | {*spot.key, *spot.only} <= set(columns), (name, spot.file)


def test_a_falsified_number_or_word_is_caught_and_rounding_is_not() -> None:
    row = next(row for row in rows_of(RESULTS / "widths" / "widths.csv") if row["verdict"] == "broken")
    assert all(apart == 0.0 for apart in compared(WIDTHS, row, row).values())
    nearly = {name: f"{float(row[name]) + 1e-4:.4f}" for name in ("max_left", "max_right", "violation")}  # the file's last digit
    assert max(compared(WIDTHS, row, row | nearly).values()) < 1.0
    false = {"max_left": "2.9700", "violation": "1.3321", "plans": "1338.0000", "verdict": "kept", "message": row["message"] + " wheel"}
    for name, value in false.items():
        apart = compared(WIDTHS, row, row | {name: value})
        assert [column for column in apart if apart[column] > 1.0] == [name]
    elsewhere = row["message"].rpartition("= ")[0] + "= 12.0 m"
    assert compared(WIDTHS, row, row | {"message": elsewhere})["message"] > 1.0


def test_a_row_that_differs_is_an_error_unless_its_folder_is_listed_as_stale(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "widths").mkdir()
    shutil.copy(RESULTS / "widths" / "widths.csv", tmp_path / "widths")
    false = {"max_left": "99.0"}
    for change, stale, code, word in (({}, "", 0, "same"), (false, "", 1, "DIFFERS"), (false, "widths\n", 0, "stale")):

        def again(_: str, spot: Spot, row: Row, out: Path, change: Row = change) -> Row:  # noqa: ARG001 - as the one that it stands for
            return {**row, **change}

        monkeypatch.setattr(spot_checks, "again", again)
        (tmp_path / "stale.txt").write_text(stale, encoding="utf-8")
        assert main(["--only", "widths", "--seed", "1"], tmp_path) == code
        assert capsys.readouterr().out.splitlines()[-1].startswith(f"{word:<8} widths: widths.csv, ")


@pytest.mark.slow
def test_committed_rows_can_be_made_again_and_a_falsified_table_cannot(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    quick = ["widths", "obstacles", "proof-reach"]
    assert main(["--only", *quick, "--seed", "1"]) == 0  # stale.txt may list some: then they may differ
    assert "cannot be made" not in capsys.readouterr().out
    for name in ("widths", "proof-reach"):
        shutil.copytree(RESULTS / name, tmp_path / name)
    (tmp_path / "stale.txt").touch()
    widths, reach = tmp_path / "widths" / "widths.csv", tmp_path / "proof-reach" / "reach.csv"
    pd.read_csv(widths).assign(max_right=7.0).to_csv(widths, index=False, float_format="%.4f")
    pd.read_csv(reach).assign(empty_s=311.0).to_csv(reach, index=False, float_format="%.4f")
    assert main(["--only", "widths", "proof-reach", "--seed", "1"], tmp_path) == 1
    assert capsys.readouterr().out.count("DIFFERS") == 2


def test_every_mutant_is_one_change_of_code_that_runs_two_for_each_area_and_more() -> None:
    for mutant in mutants.MUTANTS.values():
        text = mutants.mutated(mutant)
        if mutant["file"].endswith(".py"):  # one of the core is compiled before it runs
            ast.parse(text)
        assert "area" in mutant or (mutants.ROOT / mutant["tests"]).is_file()
    areas = [mutant.get("area") for mutant in mutants.MUTANTS.values()]
    assert min(areas.count(area) for area in ("planning", "judging", "passing", "need", "proof", "roads")) >= 2
