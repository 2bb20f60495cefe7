"""Rows of the behaviour reference: how they are written, which of them moved, and which integers that raises. Nothing is planned here."""

from __future__ import annotations

import csv
import io
import json
import math
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

AREAS = ("planning", "judging", "tracking", "regions", "passing", "need", "proof", "roads", "turning", "bench", "suites")
COLUMNS = ["case", "area", "quantity", "value", "tolerance"]
Key = tuple[str, str, str]


@dataclass(frozen=True)
class Row:
    """A quantity of a case; ``tolerance`` is empty where the value, a word or a count, is compared as it stands."""

    case: str
    area: str
    quantity: str
    value: str
    tolerance: str

    @property
    def key(self) -> Key:
        """What the row is found by."""
        return self.area, self.case, self.quantity


@dataclass(frozen=True)
class Move:
    """A row that is not what was recorded; one of both is None where the other side has no such row.

    ``behaves`` is False of the rows of a case that is wholly new or wholly gone: that is no change of behaviour.
    """

    old: Row | None
    new: Row | None
    behaves: bool = True

    @property
    def row(self) -> Row:
        """The row that there is."""
        found = self.new or self.old
        assert found is not None  # noqa: S101 - one of both is there
        return found

    @property
    def text(self) -> str:
        """The move as a line: by how much, against which tolerance."""
        before, now = ("(none)" if row is None else row.value for row in (self.old, self.new))
        by = _apart(before, now)
        much = f" by {by:.3g}, tolerance {self.row.tolerance}" if self.row.tolerance and by is not None else ""
        return f"{self.row.area}: {self.row.case}: {self.row.quantity}: {before} -> {now}{much}"


def rows_of(case: str, area: str, found: Mapping[str, float | int | str], tolerances: Mapping[tuple[str, str], str]) -> list[Row]:
    """Return the rows of a case's quantities; numbers with a fraction have the tolerance of their area and kind.

    Raises:
        KeyError: there is none.

    """
    rows = []
    for quantity, value in found.items():
        counted = isinstance(value, str) or (hasattr(value, "__index__"))
        text = str(value) if counted else f"{float(value):.10g}"
        rows.append(Row(case, area, quantity, text, "" if counted else tolerances[area, kind_of(quantity)]))
    return rows


def kind_of(quantity: str) -> str:
    """Return a quantity's kind: its first word, without a number at its end."""
    return re.sub(r"_\d+$", "", quantity.partition(" ")[0])


def tolerances_of(tables: Iterable[Mapping[str, Any]]) -> dict[tuple[str, str], str]:
    """Return the tolerance of every area and kind, as the tables ``[[tolerance]]`` give them."""
    return {(area, kind): f"{one['within']:g}" for one in tables for area in one["areas"] for kind in one["kinds"]}


def moves_of(recorded: Sequence[Row], measured: Sequence[Row]) -> list[Move]:
    """Return what moved: values beyond the tolerance that holds now, other words and counts, rows that are lost or new.

    What is not a finite number never keeps a tolerance.
    """
    before, now = {row.key: row for row in recorded}, {row.key: row for row in measured}
    known, there = ({row.key[:2] for row in rows} for rows in (recorded, measured))
    moves = []
    for key in dict.fromkeys([*now, *before]):
        old, new = before.get(key), now.get(key)
        if old is None or new is None:
            moves.append(Move(old, new, behaves=key[:2] in known & there))
        elif not _keeps(old, new):
            moves.append(Move(old, new))
    return moves


def _keeps(old: Row, new: Row) -> bool:
    if bool(old.tolerance) != bool(new.tolerance) or not new.tolerance:
        return old.tolerance == new.tolerance and old.value == new.value
    by = _apart(old.value, new.value)
    return by is not None and by <= float(new.tolerance)  # False for NaN


def _apart(before: str, now: str) -> float | None:
    try:
        by = abs(float(now) - float(before))
    except ValueError:
        return None
    return by if math.isfinite(by) else math.nan


def renewed(recorded: Sequence[Row], measured: Sequence[Row], moves: Sequence[Move]) -> list[Row]:
    """Return the rows to be recorded: those that moved as measured, the others with their old values."""
    moved, before = {move.row.key for move in moves}, {row.key: row for row in recorded}
    return [row if row.key in moved else replace(row, value=before[row.key].value) for row in measured]


def raised(behaviour: Mapping[str, Mapping[str, Any]], moves: Sequence[Move], reason: str) -> dict[str, dict[str, Any]]:
    """Return the areas with the integers of those that moved raised by one, and the ``reason`` beside them."""
    areas = {move.row.area for move in moves if move.behaves}
    return {
        area: {"number": int(table["number"]) + 1, "reason": reason} if area in areas else dict(table) for area, table in behaviour.items()
    }


def read_rows(file: Path) -> list[Row]:
    """Return the recorded rows; none where there is no file."""
    if not file.exists():
        return []
    with file.open(encoding="utf-8", newline="") as stream:
        return [Row(*(row[name] for name in COLUMNS)) for row in csv.DictReader(stream)]


def rows_text(rows: Sequence[Row]) -> str:
    """Return the rows as CSV."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerows([COLUMNS, *([getattr(row, name) for name in COLUMNS] for row in rows)])
    return stream.getvalue()


def read_behaviour(file: Path) -> dict[str, dict[str, Any]]:
    """Return the areas with their integers and reasons."""
    return tomllib.loads(file.read_text(encoding="utf-8"))


def behaviour_text(behaviour: Mapping[str, Mapping[str, Any]], head: str) -> str:
    """Return the areas as TOML under the comment ``head``."""
    tables = (f"[{area}]\nnumber = {table['number']}\nreason = {json.dumps(table['reason'])}\n" for area, table in behaviour.items())
    return head + "\n" + "\n".join(tables)
