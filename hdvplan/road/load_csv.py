"""Read a road from a table of points: columns are known by their names, never by their number, as spreadsheets write them."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.errors import RoadError
from hdvplan.road.checks import LARGEST_M, Unit, refuse_no_street, refuse_unreadable, text_of
from hdvplan.road.columns import LAYOUTS, LENGTHS, Columns, columns_of, has_geometry, is_header, named_among, unread_note
from hdvplan.road.crs import LONLAT, check_lonlat, is_geographic, looks_like_degrees, to_plane
from hdvplan.road.line import RawRoad
from hdvplan.road.options import USUAL, RoadOptions, unheeded
from hdvplan.road.properties import in_legs, signs_in
from hdvplan.settings import METRES
from hdvplan.texts import is_number

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

    def without(self, column: int) -> Table:
        """Return the table without one of its columns, by its number."""
        titles, *rows = ([cell for at, cell in enumerate(row) if at != column] for row in (self.titles, *self.rows))
        return Table(titles, self.lines, rows, self.open_ended)


@dataclass(frozen=True)
class _Numbers:
    """The columns of a table that have a meaning, as numbers; and for messages their titles, and the lines of the rows."""

    values: dict[str, FloatArray]
    titles: dict[str, str]
    lines: Sequence[int]
    name: str

    def refuse(self, key: str, bad: Iterable[object], text: str, *shown: Sequence[object] | FloatArray, hint: str | None = None) -> None:
        """Refuse a column some of whose rows are ``bad``; ``text`` says why, with what is ``shown`` of the first of these rows."""
        at = next((row for row, one in enumerate(bad) if one), None)
        if at is not None:
            msg = f"{self.name}, line {self.lines[at]}, column {self.titles[key]}: {text.format(*(column[at] for column in shown))}"
            raise RoadError(msg, hint=hint, s_m=float(self.values["s"][at]) if "s" in self.values else None)


def read_csv(text: str, name: str, options: RoadOptions = USUAL) -> RawRoad:
    """Return the road in a CSV text; ``name`` begins the messages, the ``options`` its system, or its unit.

    Values are separated by what the header has: tabs, semicolons, bars or commas. Beside all but commas, and in quotes, a
    comma is a decimal point.

    Raises:
        RoadError: no header, contradicting columns, or an impossible value, with its line and column.

    """
    return read_table(_table(text, name), name, options)


def read_columns(
    path: Path, wanted: Sequence[str], what: str, angles: Sequence[str] = (), instead: Sequence[str] = ()
) -> tuple[dict[str, FloatArray], list[str], list[int]]:
    """Return the ``wanted`` columns of a CSV file [m], its ``angles`` [rad], the titles of all others, and the rows' lines.

    Messages call the file ``what``.

    It is written as a road's may be, with its spellings and units in titles: ``x_mm``, ``Easting [ft]``, ``beta1_deg``.
    Where it has none of the ``wanted`` columns but all of those ``instead``, these are returned.

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
    titles, units = zip(*(named_among(title, {*wanted, *instead}, angles) for title in table.titles), strict=True)
    if instead and not set(wanted) & set(titles) and set(instead) <= set(titles):
        wanted = instead
    for title in (*wanted, *angles):
        if titles.count(title) > 1 or (title in wanted and title not in titles):
            msg = f"{name}: column {title} occurs twice" if title in titles else f"{name} has no column {title!r}"
            raise RoadError(msg, hint=layout)
    at = {title: titles.index(title) for title in (*wanted, *angles) if title in titles}
    unread = [title for number, title in enumerate(table.titles) if title and number not in at.values()]
    return {title: units[at[title]] * values for title, values in _numbers(table, at, name).values.items()}, unread, table.lines


def has_wkt(text: str) -> bool:
    """Tell whether a CSV text has a column of well-known text."""
    header = next((line for line in text.splitlines() if line.strip() and not line.startswith("#") and not _is_excel_hint(line)), "")
    return has_geometry(_fields(header, _separator(header)))


def read_table(table: Table, name: str, options: RoadOptions) -> RawRoad:
    """Return the road in a table of points, or the legs of a drive where a column ``direction`` has both signs; as ``read_csv``.

    Raises:
        RoadError: contradicting columns, an impossible value, with its line and column, a unit that was given for nothing or is needed,
            or a direction that changes where the line does not turn back.

    """
    signs = signs_in(table.titles, table.rows)
    if signs is None:
        return _line_in(table, name, options)
    return in_legs(_line_in(table.without(signs[0]), name, options), signs[1], name)


def _line_in(table: Table, name: str, options: RoadOptions) -> RawRoad:
    crs, unit = options.crs, options.unit
    columns = columns_of(table.titles, name)
    numbers = _numbers(table, columns.at, name)
    positions, called = columns.position, f"{name}: columns {columns.where}"
    points = np.stack([numbers.values[key] for key in positions], axis=1)
    _refuse_unit(unit, points, columns, name)
    base = columns.unit or unit or "m"  # of all lengths that say none
    for key in LENGTHS & numbers.values.keys():
        numbers.values[key] *= METRES[columns.units.get(key, base)]
    bends = positions == ("s", "kappa")
    points = points * [METRES[base], 1.0 / METRES[columns.units.get("kappa", base)]] if bends else METRES[base] * points
    if len(points) < 2:  # noqa: PLR2004
        msg = f"{name}: a road needs at least two points, this one has {len(points)}"
        raise RoadError(msg)
    raw = RawRoad(points, _reaches(numbers), lines=tuple(table.lines), notes=unread_note(columns.unread, name))
    if bends:
        s, kappa = points.T
        numbers.refuse("s", np.diff(s, prepend=-np.inf) <= 0.0, "{:g} m does not exceed the {:g} m before it", s, np.roll(s, 1))
        numbers.refuse("kappa", np.abs(kappa) > _TIGHTEST_PROFILE, f"{{:g}} 1/m is a radius below {1 / _TIGHTEST_PROFILE:g} m", kappa)
        if crs is not None:
            msg = f"{name}: a curvature profile has no coordinates, so no coordinate reference system"
            raise RoadError(msg)
        return replace(raw, is_profile=True)
    if positions == ("lon", "lat"):
        if crs is not None and not is_geographic(crs):
            msg = f"{called} are degrees, but {crs} is projected"
            raise RoadError(msg, hint="call the columns x, y if they are metres")
        crs = crs or LONLAT
    elif crs is not None and base != "m":
        msg = f"{called} have a unit of their own, and {crs} has its"
        raise RoadError(msg, hint="call the columns x, y if they are coordinates of this system")
    elif crs is None:
        for key, column in zip(positions, points.T, strict=True):
            numbers.refuse(key, np.abs(column) > LARGEST_M, "{:g} m is too large for a position", column)
        if unit is None and looks_like_degrees(points):
            if columns.unit is not None:
                msg = f"{called} look like degrees, not lengths"
                raise RoadError(msg, hint="call the columns lon,lat if they are longitude and latitude")
            note = f"{called} are read as longitude and latitude, for metres they are too close together"
            crs, raw = LONLAT, replace(raw, notes=(*raw.notes, note))
    if crs is None:
        if columns.unit is None:
            refuse_no_street([points], raw.reaches, (), Unit(unit), name, raw.lines)
        return raw
    if is_geographic(crs):
        check_lonlat(points, name)
    plane = to_plane(points, crs)
    return replace(raw, points=plane.points, to_lonlat=plane.to_lonlat)


def _table(text: str, name: str, layout: str = LAYOUTS) -> Table:
    """Return the cells of a CSV text without comments and empty rows; ``layout`` is the hint where there is no header."""
    titles: list[str] = []
    separator = ""
    lines: list[int] = []
    rows: list[list[str]] = []
    numbered = enumerate(text.splitlines(), start=1)
    skipped = 0  # lines up to the header
    for skipped, line in numbered:  # noqa: B007 - it is used below
        if _is_excel_hint(line.strip()):
            separator = line.strip()[4:]
            continue
        content = line.strip().lstrip("#").strip()
        sign = separator or _separator(content)
        fields = _fields(content, sign)
        if content and (not line.lstrip().startswith("#") or is_header(fields)):
            titles, separator = fields, sign
            break
    if not titles:
        msg = f"{name} is empty"
        raise RoadError(msg, hint=layout)
    if all(is_number(field.replace(",", ".")) for field in titles):
        msg = f"{name}, line {skipped}: the first line must name the columns, found numbers"
        raise RoadError(msg, hint=layout)
    body = csv.reader(("" if line.lstrip().startswith("#") else line for _, line in numbered), delimiter=separator, skipinitialspace=True)
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


def _is_excel_hint(line: str) -> bool:
    """Tell Excel's first line that names the separator."""
    return len(line) == 5 and line.lower().startswith("sep=") and line[4] != _QUOTE  # noqa: PLR2004


def _separator(line: str) -> str:
    return next((sign for sign in _SEPARATORS if sign in line), ",")


def _fields(line: str, separator: str) -> list[str]:
    return [field.strip().strip('"').strip() for field in line.strip().split(separator)]


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


def _numbers(table: Table, at: dict[str, int], name: str) -> _Numbers:
    """Return the columns that have a meaning as numbers; one decimal sign holds for the whole table."""
    cells = {key: [row[number] for row in table.rows] for key, number in at.items()}
    comma = any("," in cell for column in cells.values() for cell in column)
    found = _Numbers({}, {key: table.titles[number] for key, number in at.items()}, table.lines, name)
    for key, given in cells.items():
        shown = [cell[:_SHOWN] for cell in given]
        if comma:
            odd = ("." in cell or cell.count(",") > 1 for cell in given)
            found.refuse(key, odd, "{!r} is not a number", shown, hint="use one decimal sign throughout, and nothing between thousands")
        column = [cell.replace(",", ".") for cell in given]
        found.refuse(key, (not is_number(cell) for cell in column), "{!r} is not a number", shown)
        values = np.array(column, dtype=float)
        found.refuse(key, ~np.isfinite(values), "{} is not a finite number", shown)
        decimals = [len(cell.partition(".")[2]) for cell in column]
        if table.open_ended and at[key] == len(table.titles) - 1 and len(column) > 2:  # noqa: PLR2004 - all others have more decimals
            cut_off = [*[False] * (len(column) - 1), decimals[-1] + _LOST_DECIMALS <= min(decimals[:-1])]
            hint = "the file looks cut off: fetch it again, or remove its last line"
            found.refuse(key, cut_off, "{!r} has lost digits, and the file ends there", column, hint=hint)
        found.values[key] = values
    return found


def _reaches(numbers: _Numbers) -> FloatArray | None:
    """Return left, right, left_sweep, right_sweep as positive reaches, shape (4, rows)."""
    values = numbers.values
    for side in ("width", "left", "right"):
        hint = "both widths are reaches from the centre line, positive to either side"
        numbers.refuse(side, values.get(side, np.zeros(0)) < 0.0, "{:g} m is negative", values.get(side, ()), hint=hint)
    if "width" in values:
        return np.tile(0.5 * values["width"], (4, 1))
    if "left" not in values:
        return None
    sweeps = ("left_sweep", "right_sweep") if "left_sweep" in values else ("left", "right")
    for inner, outer in zip(("left", "right"), sweeps, strict=True):
        titles = [numbers.titles[inner]] * len(values[inner])
        bad = values[outer] < values[inner]
        numbers.refuse(outer, bad, "{:g} m is less than {}, {:g} m", values[outer], titles, values[inner])
    return np.stack([values[side] for side in ("left", "right", *sweeps)])


def _refuse_unit(unit: str | None, points: FloatArray, columns: Columns, name: str) -> None:
    """Refuse that a unit was given for a table that says its own, or has no lengths for positions."""
    if unit is None:
        return
    degrees = columns.position == ("lon", "lat") or (columns.position == ("x", "y") and looks_like_degrees(points))
    if degrees or columns.unit is not None:
        what = f"{name}: {'positions in degrees' if degrees else f'a table that says its unit, as {columns.where},'}"
        raise unheeded(what, "unit")
