"""Numbers, notebooks and licences of the documents are those of tables, pages and packages."""

from __future__ import annotations

import importlib
import json
import re
from importlib import metadata
from pathlib import Path
from types import ModuleType

import pytest

from hdvplan.solvers.catalogue import GENERIC, NATIVE, THROUGH


@pytest.fixture
def numbers(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    return importlib.import_module("document_numbers")


def test_every_number_of_the_documents_is_that_of_its_table(numbers: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    assert numbers.main(["--check"]) == 0, capsys.readouterr().out


def test_numbers_are_put_where_the_sentence_has_them_however_its_lines_break(numbers: ModuleType) -> None:
    figure = numbers.Figure("some.md", "it takes {} ms for the bus, {} more for others.", lambda: ["0.2", "0.15"])
    assert numbers.renewed("Fast: it takes 0.13 ms for\nthe bus, 0.1 more for others. So.", figure) == (
        "Fast: it takes 0.2 ms for\nthe bus, 0.15 more for others. So."
    )


def test_a_number_at_the_end_of_a_sentence_is_taken_whole(numbers: ModuleType) -> None:
    figure = numbers.Figure("some.md", "against {}", lambda: ["5.7"])
    assert numbers.renewed("0.78 against 5.69\n([table])", figure) == "0.78 against 5.7\n([table])"


@pytest.mark.parametrize("text", ["it took 1 s", "it takes 1 s and it takes 2 s"])
def test_a_sentence_that_is_not_there_once_is_refused(numbers: ModuleType, text: str) -> None:
    figure = numbers.Figure("some.md", "it takes {} s", lambda: ["3"])
    with pytest.raises(ValueError, match=r"some\.md: found [02] times"):
        numbers.renewed(text, figure)


@pytest.mark.parametrize("name", ["tutorial", "own-vehicle", "own-solver"])
def test_a_notebook_is_its_page_and_has_been_run(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    notebooks = importlib.import_module("notebooks")
    cells = json.loads((notebooks.FOLDER / f"{name}.ipynb").read_text(encoding="utf-8"))["cells"]
    assert [(cell["cell_type"], "".join(cell["source"])) for cell in cells] == notebooks.cells_of(name)
    assert all(cell["execution_count"] for cell in cells if cell["cell_type"] == "code")
    assert any("image/png" in output.get("data", {}) for cell in cells for output in cell.get("outputs", ()))


PAGE = Path(__file__).parents[2] / "docs" / "researchers.md"
_FAMILIES = {"LGPL": r"LGPL|lesser general public", "GPL": r"GPL|general public", "Apache": r"Apache", "BSD": r"BSD", "MIT": r"\bMIT\b"}
DISTRIBUTIONS = {name: row.distribution for name, row in NATIVE.items()} | {
    THROUGH + name: row.distribution for name, row in GENERIC.items() if name not in NATIVE
}


def _listed() -> dict[str, str]:
    """Return the licence that the page states for each solver."""
    rows = re.findall(r"^\| (`.+?) \|.*\| (.+?) \|$", PAGE.read_text(encoding="utf-8").partition("### The solvers")[2], flags=re.MULTILINE)
    return {name: licence for names, licence in rows for name in re.findall(r"`([^`]+)`", names)}


def _family(text: str) -> str | None:
    """Return the family that is named first: the GPL's own text ends with the name of the LGPL."""
    found = {match.start(): name for name, pattern in _FAMILIES.items() if (match := re.search(pattern, text, flags=re.IGNORECASE))}
    return found[min(found)] if found else None


def _stated(distribution: str) -> str | None:
    """Return the family of the licence in a package's metadata, else in its licence file."""
    told = metadata.metadata(distribution)
    classifiers = [text for text in told.get_all("Classifier") or [] if text.startswith("License")]
    files = [file for file in metadata.files(distribution) or [] if re.fullmatch(r"LICEN[CS]E(\.\w+)?", file.name)]
    fields = [*(told.get_all("License-Expression") or []), *(told.get_all("License") or []), *classifiers]
    return _family("\n".join(fields)) or next(filter(None, (_family(file.read_text()[:2000]) for file in files)), None)


def test_every_solver_has_its_row() -> None:
    missing = DISTRIBUTIONS.keys() - _listed().keys()
    assert not missing, f"docs/researchers.md does not list {sorted(missing)}"


@pytest.mark.parametrize("solver", sorted(DISTRIBUTIONS.keys() - {"hpipm", "acados"}))  # in a wheel that states none
def test_a_listed_licence_is_that_of_the_package(solver: str) -> None:
    try:
        stated = _stated(DISTRIBUTIONS[solver])
    except metadata.PackageNotFoundError:
        pytest.skip(f"{solver} is not installed")
    assert stated == _family(_listed()[solver])
