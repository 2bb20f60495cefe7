"""Results that are older than what the program does say so."""

import json
import sys
import tomllib
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import pytest

from hdvplan.machine import behaviour, software

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import check_results
from check_results import check, check_times, why_stale
from reference_rows import AREAS

NOW = behaviour()


def folder(path: Path, **changed: object) -> Path:
    path.mkdir(parents=True)
    record = {"suite": {"solvers": ["riccati", "piqp"]}, "commit": "abc+", "software": software(("riccati", "piqp")) | changed}
    (path / "run.json").write_text(json.dumps(record), encoding="utf-8")
    return path


def stale(path: Path, areas: Sequence[str] = AREAS, *, times: bool = True) -> str:
    return why_stale(path, areas, times=times) or ""


def test_a_folder_is_stale_where_one_of_its_areas_had_another_integer(tmp_path: Path) -> None:
    assert why_stale(folder(tmp_path / "new"), AREAS, times=True) is None
    old = folder(tmp_path / "old", behaviour=NOW | {"judging": NOW["judging"] - 1, "roads": NOW["roads"] - 1})
    assert stale(old) == "judging, roads changed since"
    assert stale(old, ["planning", "roads"]) == "roads changed since"
    assert why_stale(old, ["planning", "turning"], times=True) is None
    before = folder(tmp_path / "before", behaviour={area: number for area, number in NOW.items() if area != "bench"})
    assert stale(before) == "bench changed since"  # an area that was not known then


def test_what_has_no_record_or_no_integers_is_stale(tmp_path: Path) -> None:
    (tmp_path / "bare").mkdir()
    assert stale(tmp_path / "bare") == "it has no run.json"
    made = folder(tmp_path / "made")
    record = json.loads((made / "run.json").read_text(encoding="utf-8"))
    del record["software"]["behaviour"]
    (made / "run.json").write_text(json.dumps(record), encoding="utf-8")
    assert "before behaviour was numbered" in stale(made)


def test_another_solver_makes_times_stale_and_nothing_else(tmp_path: Path) -> None:
    other = folder(tmp_path / "other", packages={"piqp": "0.1.9"})
    assert "piqp 0.1.9" in stale(other)
    assert why_stale(other, AREAS, times=False) is None


def test_a_folder_is_stale_that_was_made_before_what_it_holds_moved(tmp_path: Path) -> None:
    path, moved = folder(tmp_path / "roads"), datetime(2026, 11, 28, 16, 40, tzinfo=UTC)
    record = json.loads((path / "run.json").read_text(encoding="utf-8"))
    for made in ({"date": "2026-11-28T16:%s:00+00:00"}, {"sessions": [{"started": "2026-11-28T16:%s:00+00:00"}]}):
        for minute, old in (("39", True), ("40", False)):
            (path / "run.json").write_text(json.dumps(record | made).replace("%s", minute), encoding="utf-8")
            reason = why_stale(path, AREAS, times=False, moved=moved)
            assert (reason is not None) is old
            assert reason is None or "2026-11-28 16:40" in reason


def test_a_folder_of_several_runs_is_stale_where_one_of_them_is(tmp_path: Path) -> None:
    for name in ("first", "second"):
        folder(tmp_path / "both" / name)
    assert why_stale(tmp_path / "both", AREAS, times=True) is None
    folder(tmp_path / "both" / "third", behaviour=NOW | {"planning": 0})
    assert stale(tmp_path / "both") == "third: planning changed since"


def test_what_is_not_listed_as_it_is_is_told(tmp_path: Path) -> None:
    entry = {"areas": ["planning"], "times": False}
    folder(tmp_path / "new")
    folder(tmp_path / "old", behaviour={})
    folder(tmp_path / "known", behaviour={})
    folder(tmp_path / "unnamed")
    (tmp_path / "stale.txt").write_text("# listed\nnew\nknown\n", encoding="utf-8")
    found = check(tmp_path, dict.fromkeys(["new", "old", "known", "gone"], entry))
    assert [line.partition(":")[0] for line in found] == ["gone", "new", "old", "unnamed"]


def test_times_are_stale_where_the_gate_finds_a_change_against_their_commit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("first", "second", "exact"):
        folder(tmp_path / name)
    entries = {name: {"areas": ["planning"], "times": name != "exact"} for name in ("first", "second", "exact")}
    quick, slow, same = ({"high": high, "ratio": high} for high in (0.8, 1.2, 1.01))
    slower = "first, second: against abc: said"
    for code, times, told in (
        (0, [same], []),
        (1, [slow], [slower]),
        (2, [], [slower]),
        (3, [same], [slower]),
        (0, [same, quick], [f"{slower}; faster in 1 cells"]),
    ):
        answer = json.dumps({"summary": "said", "factor": 1.08, "times": times})
        program = f"import sys; assert sys.argv[1] == 'abc'; print({answer!r}); sys.exit({code})"
        monkeypatch.setattr(check_results, "_GATE", (sys.executable, "-c", program))
        assert check_times(tmp_path, entries) == told


def test_the_table_of_results_names_areas_that_there_are() -> None:
    table = tomllib.loads(check_results.TABLE.read_text(encoding="utf-8"))
    assert {area for entry in table.values() for area in entry["areas"]} <= set(AREAS)
    assert all(isinstance(entry["times"], bool) and entry["command"] for entry in table.values())
