"""``hdvplan reproduce`` as users run it."""

import json
import sys
from pathlib import Path

import pandas as pd
import pytest

from hdvplan.cli.reproduce import NAMES
from tests.cli.conftest import Cli, cli  # noqa: F401 - a fixture

COMMAND = (sys.executable, "-m", "hdvplan", "reproduce")


def test_a_study_writes_its_files_and_prints_a_table_that_fits_a_terminal(cli: Cli, tmp_path: Path) -> None:  # noqa: F811 - the fixture
    outcome = cli("reproduce", "bus-uturn")
    assert (outcome.code, outcome.err) == (0, "")
    names = {"bus-uturn.md", "bus-uturn.csv", "bus-uturn.png", "bus-uturn-data.csv", "bus-uturn-run.json"}
    assert {path.name for path in (tmp_path / "results").iterdir()} == names
    record = json.loads((tmp_path / "results" / "bus-uturn-run.json").read_text(encoding="utf-8"))
    assert [case["objective"] for case in record["cases"]] == ["lead-axle", "geometric"]
    assert "proposed method, max right [m]" in outcome.out
    assert max(len(line) for line in outcome.out.splitlines()) <= 80


def test_json_holds_the_rows_and_nothing_else_is_said(cli: Cli, tmp_path: Path) -> None:  # noqa: F811 - the fixture
    outcome = cli("reproduce", "bus-uturn", "--json", "--out", "there")
    assert (outcome.code, outcome.err) == (0, "")
    rows = json.loads(outcome.out)["bus-uturn"]
    written = pd.read_csv(tmp_path / "there" / "bus-uturn.csv")
    assert [row["ours"] for row in rows] == written["ours"].tolist()
    assert [row["quantity"] for row in rows] == written["quantity"].tolist()
    assert rows[-1]["published"] is None


@pytest.mark.nightly  # each study has tests of its own
def test_all_writes_every_study_and_a_summary(cli: Cli, tmp_path: Path) -> None:  # noqa: F811 - the fixture
    outcome = cli("reproduce", "all", "--out", "all")
    before, *told = (line for line in outcome.err.splitlines() if not line.startswith("reproducing: "))  # one every ten seconds
    assert (outcome.code, before) == (0, "this takes about 3 min")
    assert told == [f"wrote all/{name}.md, .csv, .png, -data.csv and -run.json" for name in NAMES]
    written = {path.name for path in (tmp_path / "all").iterdir()}
    tables = {f"{name}{end}" for name in NAMES for end in (".md", ".csv", ".png", "-data.csv", "-run.json")}
    assert written == tables | {"summary.md", "summary.csv"}
    assert set(pd.read_csv(tmp_path / "all" / "summary.csv")["study"]) == set(NAMES)
    assert max(len(line) for line in outcome.out.splitlines()) <= 80
    times = pd.read_csv(tmp_path / "all" / "timing.csv", index_col="quantity").filter(like=": mean", axis="index")
    assert len(times) > 0
    assert (times["ours"] < times["published"]).all()
