"""Keys: the same for the same content, another one for any other."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from hdvplan.study.cells import SUMMARY, cells_of, taken
from hdvplan.study.inputs import road_digest
from hdvplan.study.spec import study_of
from tests.study.test_spec import OBJECTIVE

BASE: dict[str, object] = {"roads": ["bend.csv"], "vehicles": ["bus"], "half_widths": [3.5]}


def _key(folder: Path, entries: dict[str, object]) -> str:
    (cell,) = cells_of(study_of(entries, folder))
    return cell.key


SETTINGS = {"horizon": 30, "reverse": True, "offset": 0.5, "smooth": 1.0, "corners": "sharp", "unit": "ft", "proof": True, "refine": False}
CHANGES: list[tuple[str, object]] = [
    *(("settings", {name: value}) for name, value in SETTINGS.items()),
    *(("half_widths", [3.6]), ("schemes", ["sqp"]), ("solvers", ["piqp"]), ("objectives", ["lead-axle"]), ("need", True)),
    *(("vary", {"bus.wheelbase": [5.5]}), ("roads", ["lane.geojson"])),
]


@pytest.mark.parametrize(("name", "value"), CHANGES)
def test_whatever_changes_a_row_changes_its_key(folder: Path, name: str, value: object) -> None:
    assert _key(folder, BASE | {name: value}) != _key(folder, BASE)


def test_a_file_that_changes_changes_its_key_and_one_that_moves_does_not(folder: Path) -> None:
    before = _key(folder, BASE)
    (folder / "elsewhere").mkdir()
    moved = (folder / "bend.csv").rename(folder / "elsewhere" / "bend.csv")
    assert _key(folder, BASE | {"roads": ["elsewhere/bend.csv"]}) == before
    moved.write_text(moved.read_text(encoding="utf-8") + "70,0\n", encoding="utf-8")
    assert _key(folder, BASE | {"roads": ["elsewhere/bend.csv"]}) != before


def test_a_file_of_one_s_own_code_counts_with_its_content(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    (folder / "mine.py").write_text(OBJECTIVE, encoding="utf-8")
    before = _key(folder, BASE | {"objectives": ["mine.py:mine"]})
    assert before == _key(folder, BASE | {"objectives": ["mine.py:mine"]})
    (folder / "mine.py").write_text(OBJECTIVE + "# changed\n", encoding="utf-8")
    assert before != _key(folder, BASE | {"objectives": ["mine.py:mine"]})


def test_a_study_keeps_its_keys_while_its_files_change(folder: Path) -> None:
    (folder / "mine.py").write_text(OBJECTIVE, encoding="utf-8")
    study = study_of(BASE | {"objectives": ["mine.py:mine"]}, folder)
    before = [cell.key for cell in cells_of(study)]
    (folder / "mine.py").write_text(OBJECTIVE + "# changed\n", encoding="utf-8")
    assert [cell.key for cell in cells_of(study)] == before


def test_a_key_is_the_same_in_every_process(folder: Path) -> None:
    code = (
        "import sys; from pathlib import Path; from hdvplan.study.cells import cells_of; from hdvplan.study.spec import study_of; "
        f"print(next(cells_of(study_of({BASE!r}, Path(sys.argv[1])))).key)"
    )
    other = subprocess.run([sys.executable, "-c", code, str(folder)], capture_output=True, text=True, check=True)  # noqa: S603 - our own
    assert other.stdout.strip() == _key(folder, BASE)


@pytest.mark.parametrize(
    ("name", "part"), [("line.shp", "line.dbf"), ("line[1].shp", "line[1].dbf"), ("line.TAB", "line.MAP"), ("line.mif", "line.mid")]
)
def test_the_parts_of_a_road_in_several_files_count_together(tmp_path: Path, name: str, part: str) -> None:
    for file in (name, part):
        (tmp_path / file).write_bytes(b"1")
    before = road_digest(str(tmp_path / name))
    (tmp_path / part).write_bytes(b"2")
    assert road_digest(str(tmp_path / name)) != before


def test_obstacles_are_counted_that_are_passed_on_the_other_side_than_the_line_passes_them() -> None:
    row = taken({"passed": [{"crossed": True}, {"crossed": False}, {"crossed": True}], "breaches": [{}]}, SUMMARY)
    assert (row["crossed_sides"], row["breaches"], row["corners"]) == (2, 1, None)
