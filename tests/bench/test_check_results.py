"""Results that are older than the code say so."""

import json
import sys
from pathlib import Path

import pytest

from hdvplan import machine
from hdvplan.machine import planning_code, software

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
from check_results import check, why_stale


def folder(path: Path, **changed: object) -> Path:
    path.mkdir(parents=True)
    record = {"suite": {"solvers": ["riccati", "piqp"]}, "software": software(("riccati", "piqp")) | changed}
    (path / "run.json").write_text(json.dumps(record), encoding="utf-8")
    return path


def test_a_folder_is_stale_without_a_record_with_other_code_or_with_another_solver(tmp_path: Path) -> None:
    assert why_stale(folder(tmp_path / "new")) is None
    assert "has changed" in (why_stale(folder(tmp_path / "old", planning="0" * 16)) or "")
    assert "piqp 0.1.9" in (why_stale(folder(tmp_path / "other", packages={"piqp": "0.1.9"})) or "")
    (tmp_path / "bare").mkdir()
    assert why_stale(tmp_path / "bare") == "it has no run.json"
    (tmp_path / "stale.txt").write_text("# known\nnew\nold\n", encoding="utf-8")
    assert [line.partition(":")[0] for line in check(tmp_path)] == ["bare", "new", "other"]


def test_the_planning_code_s_digest_follows_code_and_not_words(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "hdvplan"
    (package / "driving").mkdir(parents=True)
    monkeypatch.setattr(machine, "_PACKAGE", package)
    drive, other = package / "driving" / "drive.py", package / "driving" / "other.py"
    digests = []
    for text, imported in (
        ("import hdvplan.x\nfrom hdvplan.driving.other import f\n", "def f():\n    return 1\n"),
        ('"""Words."""\nimport hdvplan.x\nfrom hdvplan.driving.other import f  # a comment\n', 'def f():\n    """Say."""\n    return 1\n'),
        ("import hdvplan.x\nfrom hdvplan.driving.other import f\n", "def f():\n    return 2\n"),
    ):
        drive.write_text(text, encoding="utf-8")
        other.write_text(imported, encoding="utf-8")
        planning_code.cache_clear()
        digests.append(planning_code(()))
    planning_code.cache_clear()
    assert digests[0] == digests[1] != digests[2]


def test_a_folder_of_several_runs_is_stale_where_one_of_them_is(tmp_path: Path) -> None:
    for name in ("first", "second"):
        folder(tmp_path / "both" / name)
    assert why_stale(tmp_path / "both") is None
    folder(tmp_path / "both" / "third", planning="0" * 16)
    assert (why_stale(tmp_path / "both") or "").startswith("third: the planning code has changed")
