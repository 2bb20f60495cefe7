"""Keys: the same for the same content, another one for any other."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from hdvplan.study.cells import cells_of
from hdvplan.study.inputs import road_digest
from hdvplan.study.spec import study_of

BASE: dict[str, object] = {"roads": ["bend.csv"], "vehicles": ["bus"], "half_widths": [3.5]}


def _key(folder: Path, entries: dict[str, object]) -> str:
    (cell,) = cells_of(study_of(entries, folder))
    return cell.key


@pytest.mark.parametrize(
    "change",
    [
        {"half_widths": [3.6]},
        {"vehicles": ["semitrailer-steered"]},
        {"objectives": ["lead-axle"]},
        {"schemes": ["sqp"]},
        {"solvers": ["piqp"]},
        {"need": True},
        {"settings": {"horizon": 30}},
        {"settings": {"reverse": True}},
        {"settings": {"offset": 0.5}},
        {"settings": {"smooth": 1.0}},
        {"settings": {"proof": True}},
        {"settings": {"refine": False}},
        {"settings": {"bias": 0.1}},
        {"settings": {"pass": "left"}},
        {"vary": {"bus.wheelbase": [5.5]}},
        {"roads": ["lane.geojson"]},
    ],
    ids=str,
)
def test_whatever_changes_a_row_changes_its_key(folder: Path, change: dict[str, object]) -> None:
    assert _key(folder, BASE | change) != _key(folder, BASE)


def test_a_file_that_changes_changes_its_key_and_one_that_moves_does_not(folder: Path) -> None:
    before = _key(folder, BASE)
    (folder / "elsewhere").mkdir()
    moved = (folder / "bend.csv").rename(folder / "elsewhere" / "bend.csv")
    assert _key(folder, BASE | {"roads": ["elsewhere/bend.csv"]}) == before
    moved.write_text(moved.read_text(encoding="utf-8") + "70,0\n", encoding="utf-8")
    assert _key(folder, BASE | {"roads": ["elsewhere/bend.csv"]}) != before


def test_a_file_of_one_s_own_code_counts_with_its_content(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    source = "from hdvplan.planning.objectives import objective_named\n\n\ndef mine():\n    return objective_named('geometric')\n"
    (folder / "mine.py").write_text(source, encoding="utf-8")
    before = _key(folder, BASE | {"objectives": ["mine.py:mine"]})
    assert before == _key(folder, BASE | {"objectives": ["mine.py:mine"]})
    from hdvplan.study import cells  # noqa: PLC0415 - another process would read the file anew

    cells._software.cache_clear()
    (folder / "mine.py").write_text(source + "# changed\n", encoding="utf-8")
    assert before != _key(folder, BASE | {"objectives": ["mine.py:mine"]})


def test_a_key_is_the_same_in_every_process(folder: Path) -> None:
    code = (
        "import sys; from pathlib import Path; from hdvplan.study.cells import cells_of; from hdvplan.study.spec import study_of; "
        f"print(next(cells_of(study_of({BASE!r}, Path(sys.argv[1])))).key)"
    )
    other = subprocess.run([sys.executable, "-c", code, str(folder)], capture_output=True, text=True, check=True)  # noqa: S603 - our own
    assert other.stdout.strip() == _key(folder, BASE)


def test_the_parts_of_a_shapefile_count_together(tmp_path: Path) -> None:
    for part in ("shp", "dbf"):
        (tmp_path / f"line.{part}").write_bytes(b"1")
    before = road_digest(str(tmp_path / "line.shp"))
    (tmp_path / "line.dbf").write_bytes(b"2")
    assert road_digest(str(tmp_path / "line.shp")) != before
