"""The table of solvers names every solver, with the licence that its package states."""

from __future__ import annotations

import re
from importlib import metadata
from pathlib import Path

import pytest

from hdvplan.solvers.catalogue import GENERIC, NATIVE, THROUGH

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
