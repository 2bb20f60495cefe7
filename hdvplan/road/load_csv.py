"""Read a road from a table of points: columns are known by their names, never by their number, as spreadsheets write them."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.errors import RoadError
from hdvplan.lengths import METRES
from hdvplan.road.columns import LAYOUTS, LENGTHS, Columns, columns_of, folded, has_geometry, is_header, unread_note
from hdvplan.road.crs import LONLAT, check_lonlat, is_geographic, looks_like_degrees, to_plane
from hdvplan.road.features import unheeded
from hdvplan.road.raw import RawRoad
from hdvplan.road.steps import LARGEST_M
from hdvplan.road.texts import refuse_unreadable, text_of
from hdvplan.road.units import Unit, refuse_no_street

_SEPARATORS = ("\t", ";", "|", ",")  # the first that the header has; decimal commas cannot occur in a header
_QUOTE = '"'  # which nothing can be separated by
_TIGHTEST_PROFILE = 0.5  # [1/m]
_SHOWN = 60  # letters of a cell in a message
_LOST_DECIMALS = 3  # fewer than in any other row: one or two may be trailing zeros


@dataclass(frozen=True)
class Table:
    """The cells of a table of points: every row as long as ``titles``, and the line of each row in its file.

    ``open_ended`` tells that nothing ends the last line: the file may have been cut off there.
    """

    titles: list[str]
    lines: list[int]
    rows: list[list[str]]
    open_ended: bool = False


def read_csv(text: str, name: str, *, crs: str | None = None, unit: str | None = None) -> RawRoad:
    """Return the road in a CSV text; ``name`` begins the messages, ``crs`` is the system of x, y, or ``unit`` their unit.

    Values are separated by what the header has: tabs, semicolons, bars or commas. Beside all but commas, and in quotes, a
    comma is a decimal point.

    Raises:
        RoadError: no header, contradicting columns, or an impossible value, with its line and column.

    """
    return read_table(_table(text, name), name, crs=crs, unit=unit)


def read_columns(path: Path, wanted: Sequence[str], what: str) -> list[FloatArray]:
    """Return the ``wanted`` columns of a CSV file, written as a road's may be; ``what`` the file is, is for the messages.

    A column may have its unit in its title: ``s``, ``s_m`` and ``S [m]`` are the same.

    Raises:
        RoadError: no such file of text, a column that is missing or there twice, or what is not a finite number.
        OSError: it cannot be read.

    """
    if not path.is_file():  # a pipe or a device may have no end
        raise FileNotFoundError(path)
    refuse_unreadable(path, what)
    name = f"{what} {path.name}"
    layout = f"its header is {','.join(wanted)}"
    table = _table(text_of(path, what), name, layout)
    titles = [folded(title).removesuffix("_m") for title in table.titles]
    for title in wanted:
        if titles.count(title) != 1:
            msg = f"{name}: column {title} occurs twice" if title in titles else f"{name} has no column {title!r}"
            raise RoadError(msg, hint=layout)
    at = {title: titles.index(title) for title in wanted}
    values = _numbers(table, at, name)
    return [values[title] for title in wanted]


def has_wkt(text: str) -> bool:
    """Tell whether a CSV text has a column of well-known text."""
    header = next((line for line in text.splitlines() if line.strip() and not line.startswith("#") and not _is_excel_hint(line)), "")
    return has_geometry(_fields(header, _separator(header)))


def read_table(table: Table, name: str, *, crs: str | None = None, unit: str | None = None) -> RawRoad:
    """Return the road in a table of points; as ``read_csv``.

    Raises:
        RoadError: contradicting columns, an impossible value, with its line and column, or a unit that was given for nothing or is needed.

    """
    columns = columns_of(table.titles, name)
    values = _numbers(table, columns.at, name)
    points = np.stack([values[key] for key in columns.position], axis=1)
    if unit is not None:
        _refuse_unit(points, columns, name)
    base = columns.units.get("x", unit or "m")  # of all lengths that say none
    values |= {key: METRES[columns.units.get(key, base)] * values[key] for key in values if key in LENGTHS}
    points = METRES[base] * points
    if len(points) < 2:  # noqa: PLR2004
        msg = f"{name}: a road needs at least two points, this one has {len(points)}"
        raise RoadError(msg)
    raw = RawRoad(points, _reaches(values, columns, table.lines, name), lines=tuple(table.lines), notes=unread_note(columns, name))
    if columns.position == ("s", "kappa"):
        _check_profile(points, columns, table.lines, name)
        if crs is not None:
            msg = f"{name}: a curvature profile has no coordinates, so no coordinate reference system"
            raise RoadError(msg)
        return replace(raw, is_profile=True)
    if columns.position == ("lon", "lat"):
        check_lonlat(points, name)
        if crs is not None and not is_geographic(crs):
            msg = f"{name}: columns {_titles(columns)} are degrees, but {crs} is projected"
            raise RoadError(msg, hint="call the columns x, y if they are metres")
        crs = crs or LONLAT
    elif crs is not None:
        if base != "m":
            msg = f"{name}: columns {_titles(columns)} are not in metres, but {crs} is"
            raise RoadError(msg, hint="call the columns x, y if they are coordinates of this system")
        if is_geographic(crs):
            check_lonlat(points, name)
    else:
        _check_metres(points, columns, table.lines, name)
        if unit is None and looks_like_degrees(points):
            note = f"{name}: columns {_titles(columns)} are read as longitude and latitude, for metres they are too close together"
            crs, raw = LONLAT, replace(raw, notes=(*raw.notes, note))
    if crs is None:
        if "x" not in columns.units:
            refuse_no_street([points], raw.reaches, (), Unit(unit), name, raw.lines)
        return raw
    plane = to_plane(points, crs)
    return replace(raw, points=plane.points, to_lonlat=plane.to_lonlat)


def _table(text: str, name: str, layout: str = LAYOUTS) -> Table:
    """Return the cells of a CSV text without comments and empty rows; ``layout`` is the hint where there is no header.

    Raises:
        RoadError: no header, or rows that do not fit it.

    """
    titles: list[str] = []
    separator = ""
    lines: list[int] = []
    rows: list[list[str]] = []
    numbered = enumerate(text.splitlines(), start=1)
    number = 0
    for number, line in numbered:
        content = line.strip()
        if _is_excel_hint(content):
            separator = content[4:]
        elif content.startswith("#"):
            comment = content.lstrip("#").strip()
            fields = _fields(comment, _separator(comment))
            if is_header(fields):
                titles, separator = fields, _separator(comment)
                break
        elif content:
            separator = separator or _separator(line)
            titles = _header(_fields(content, separator), name, number, layout)
            break
    if not titles:
        msg = f"{name} is empty"
        raise RoadError(msg, hint=layout)
    body = csv.reader(_uncommented(numbered), delimiter=separator, skipinitialspace=True)
    skipped = number  # lines up to the header
    try:
        for row in body:
            cells = [cell.strip() for cell in row]
            if any(cells):
                lines.append(skipped + body.line_num)
                rows.append(_fitted(cells, titles, separator, f"{name}, line {lines[-1]}"))
    except csv.Error as error:
        msg = f"{name}, line {skipped + body.line_num}: {error}"
        raise RoadError(msg, hint="is this a CSV file?") from error
    return Table(titles, lines, rows, open_ended=not text.endswith(("\n", "\r")))


def _uncommented(numbered: Iterator[tuple[int, str]]) -> Iterator[str]:
    for _, line in numbered:
        yield "" if line.lstrip().startswith("#") else line


def _is_excel_hint(line: str) -> bool:
    """Tell Excel's first line that names the separator."""
    return len(line) == 5 and line.lower().startswith("sep=") and line[4] != _QUOTE  # noqa: PLR2004


def _separator(line: str) -> str:
    return next((sign for sign in _SEPARATORS if sign in line), ",")


def _fields(line: str, separator: str) -> list[str]:
    return [field.strip().strip('"').strip() for field in line.strip().split(separator)]


def _header(fields: list[str], name: str, number: int, layout: str) -> list[str]:
    if all(_is_number(field.replace(",", ".")) for field in fields):
        msg = f"{name}, line {number}: the first line must name the columns, found numbers"
        raise RoadError(msg, hint=layout)
    return fields


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True


def _fitted(cells: list[str], titles: list[str], separator: str, where: str) -> list[str]:
    """Return a row as long as the header: empty cells at its end may be more or fewer."""
    given = len(cells)
    while len(cells) > len(titles) and not cells[-1]:
        cells = cells[:-1]
    if len(cells) != len(titles):
        msg = f"{where}: {given} values for {len(titles)} columns"
        decimal = separator == "," and len(cells) > len(titles)
        raise RoadError(msg, hint="numbers with a decimal comma need another separator: a semicolon or a tab" if decimal else None)
    return cells


def _numbers(table: Table, at: dict[str, int], name: str) -> dict[str, FloatArray]:
    """Return the columns that have a meaning as numbers; one decimal sign holds for the whole table."""
    cells = {key: [row[number] for row in table.rows] for key, number in at.items()}
    comma = any("," in cell for column in cells.values() for cell in column)
    values: dict[str, FloatArray] = {}
    for key, column in cells.items():
        title = table.titles[at[key]]
        if comma:
            odd = next((row for row, cell in enumerate(column) if "." in cell or cell.count(",") > 1), None)
            if odd is not None:
                msg = f"{name}, line {table.lines[odd]}, column {title}: {column[odd][:_SHOWN]!r} is not a number"
                raise RoadError(msg, hint="use one decimal sign throughout, and nothing between thousands")
            column = [cell.replace(",", ".") for cell in column]  # noqa: PLW2901
        bad = next((row for row, cell in enumerate(column) if not _is_number(cell)), None)
        if bad is not None:
            msg = f"{name}, line {table.lines[bad]}, column {title}: {column[bad][:_SHOWN]!r} is not a number"
            raise RoadError(msg)
        values[key] = np.array(column, dtype=float)
        endless = np.flatnonzero(~np.isfinite(values[key]))
        if endless.size:
            msg = f"{name}, line {table.lines[endless[0]]}, column {title}: {column[endless[0]][:_SHOWN]} is not a finite number"
            raise RoadError(msg)
        if table.open_ended and at[key] == len(table.titles) - 1 and _is_cut_off(column):
            msg = f"{name}, line {table.lines[-1]}, column {title}: {column[-1]!r} has lost digits, and the file ends there"
            raise RoadError(msg, hint="the file looks cut off: fetch it again, or remove its last line")
    return values


def _is_cut_off(column: list[str]) -> bool:
    """Tell whether the last of several numbers has lost decimals that all others have."""
    decimals = [len(cell.partition(".")[2]) for cell in column]
    return len(column) > 2 and decimals[-1] + _LOST_DECIMALS <= min(decimals[:-1])  # noqa: PLR2004


def _titles(columns: Columns) -> str:
    return ", ".join(columns.titles[key] for key in columns.position)


def _reaches(values: dict[str, FloatArray], columns: Columns, lines: list[int], name: str) -> FloatArray | None:
    """Return left, right, left_sweep, right_sweep as positive reaches, shape (4, rows)."""
    if "width" in values:
        _check_positive(values, "width", columns, lines, name)
        return np.tile(0.5 * values["width"], (4, 1))
    if "left" not in values:
        return None
    for side in ("left", "right"):
        _check_positive(values, side, columns, lines, name)
    sweeps = ("left_sweep", "right_sweep") if "left_sweep" in values else ("left", "right")
    for inner, outer in zip(("left", "right"), sweeps, strict=True):
        bad = np.flatnonzero(values[outer] < values[inner])
        if bad.size:
            at = bad[0]
            msg = (
                f"{name}, line {lines[at]}, column {columns.titles[outer]}: {values[outer][at]:g} m is less than"
                f" {columns.titles[inner]}, {values[inner][at]:g} m"
            )
            raise RoadError(msg)
    return np.stack([values[side] for side in ("left", "right", *sweeps)])


def _check_positive(values: dict[str, FloatArray], side: str, columns: Columns, lines: list[int], name: str) -> None:
    bad = np.flatnonzero(values[side] < 0.0)
    if bad.size:
        msg = f"{name}, line {lines[bad[0]]}, column {columns.titles[side]}: {values[side][bad[0]]:g} m is negative"
        raise RoadError(msg, hint="both widths are reaches from the centre line, positive to either side")


def _check_profile(points: FloatArray, columns: Columns, lines: list[int], name: str) -> None:
    s, kappa = (columns.titles[key] for key in columns.position)
    back = np.flatnonzero(np.diff(points[:, 0]) <= 0.0)
    if back.size:
        at = back[0] + 1
        msg = f"{name}, line {lines[at]}, column {s}: {points[at, 0]:g} m does not exceed the {points[at - 1, 0]:g} m before it"
        raise RoadError(msg, s_m=float(points[at, 0]))
    tight = np.flatnonzero(np.abs(points[:, 1]) > _TIGHTEST_PROFILE)
    if tight.size:
        at = tight[0]
        msg = f"{name}, line {lines[at]}, column {kappa}: {points[at, 1]:g} 1/m is a radius below {1 / _TIGHTEST_PROFILE:g} m"
        raise RoadError(msg, s_m=float(points[at, 0]))


def _refuse_unit(points: FloatArray, columns: Columns, name: str) -> None:
    """Refuse that a unit was given for a table that says its own, or has no lengths for positions."""
    degrees = columns.position == ("lon", "lat") or (columns.position == ("x", "y") and looks_like_degrees(points))
    why = "a curvature profile" if columns.position == ("s", "kappa") else "positions in degrees" if degrees else None
    if why is not None or "x" in columns.units:
        what = f"{name}: {why or f'a table that says its unit, as {_titles(columns)},'}"
        raise unheeded(what, "unit")


def _check_metres(points: FloatArray, columns: Columns, lines: list[int], name: str) -> None:
    large = np.argwhere(np.abs(points) > LARGEST_M)
    if large.size:
        row, axis = large[0]
        title = columns.titles[columns.position[axis]]
        msg = f"{name}, line {lines[row]}, column {title}: {points[row, axis]:g} m is too large for a position"
        raise RoadError(msg)
    if "x" in columns.units and looks_like_degrees(points):
        msg = f"{name}: columns {_titles(columns)} look like degrees, not lengths"
        raise RoadError(msg, hint="call the columns lon,lat if they are longitude and latitude")
