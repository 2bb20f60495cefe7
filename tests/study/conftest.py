"""Studies small enough for a test: a road of 60 m, a horizon of 30 m."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Callable, Iterable
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from hdvplan.machine import THREADS
from hdvplan.study.cells import Cell
from hdvplan.study.engine import UNANSWERED, Done, Ending, Outcome
from hdvplan.study.pools import outcome_of
from hdvplan.study.store import KEPT
from tests.cli.conftest import Cli, cli

__all__ = ["Cli", "cli"]

BEND = "s,kappa\n0,0\n20,0\n30,0.03\n40,0\n60,0\n"
PLACED = (
    '{"type": "Feature", "properties": {"name": "lane"}, "geometry": {"type": "LineString", "coordinates": '
    "[[9.52, 47.14], [9.5203, 47.1402], [9.5206, 47.1404], [9.5208, 47.1406], [9.5209, 47.1409], [9.5209, 47.1412]]}}"
)


_OUTCOMES: dict[str, Outcome] = {}  # by the cells' keys, which stand for all that an answer depends on


def known_outcome(cell: Cell) -> Outcome:
    """Return the outcome of a cell that was worked out before in this process, or else work it out."""
    if cell.key not in _OUTCOMES:
        found = outcome_of(cell)
        if found.ending in UNANSWERED:
            return found  # a file that is another one now
        _OUTCOMES[cell.key] = found
    return _OUTCOMES[cell.key]


@dataclass
class InHere:
    """An engine that works in this process, in an order of its own, and counts what it was given.

    Cells of one key have one outcome: it is worked out once for all tests but those with an ``instead`` of their own.
    """

    order: Callable[[list[Cell]], list[Cell]] = list
    instead: Callable[[Cell], Outcome] = known_outcome
    worked: list[str] = field(default_factory=list)

    def run(self, cells: Iterable[Cell]) -> Ending:
        """Yield the cells in that order."""
        for cell in self.order(list(cells)):
            self.worked.append(cell.key)
            yield Done(cell, self.instead(cell), 1)


def kept_in(out: Path) -> int:
    """Return how many cells are on disk."""
    if not (out / KEPT).exists():
        return 0
    with closing(sqlite3.connect(out / KEPT, timeout=60.0)) as file:
        try:
            return int(file.execute("SELECT count(*) FROM cells").fetchone()[0])
        except sqlite3.OperationalError:  # there is no table yet
            return 0


@pytest.fixture(autouse=True)
def _threads_stay_as_they_were(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in THREADS:
        monkeypatch.setenv(name, os.environ.get(name, "1"))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a bend without a place on the Earth, and a lane in Liechtenstein."""
    (tmp_path / "bend.csv").write_text(BEND, encoding="utf-8")
    (tmp_path / "lane.geojson").write_text(PLACED, encoding="utf-8")
    return tmp_path


@pytest.fixture
def tiny() -> dict[str, object]:
    """Return the entries of a study of eight cells."""
    return {
        "roads": ["bend.csv", "lane.geojson"],
        "vehicles": ["bus", "tractor-trailer"],
        "half_widths": [1.6, 3.5],
        "settings": {"horizon": 30, "refine": False},
    }
