"""Read a road from CSV: columns are known by their names, never by their number."""

from __future__ import annotations

import numpy as np

from hdvplan.errors import RoadError
from hdvplan.jit import FloatArray
from hdvplan.road.crs import LONLAT, check_lonlat, is_geographic, to_plane
from hdvplan.road.raw import RawRoad

_POSITIONS = (("x_m", "y_m"), ("x", "y"), ("lon", "lat"), ("s", "kappa"))
_WIDTHS = (("w_tr_left_m", "w_tr_right_m"), ("left", "right"))  # left, right; the order in the file is free
_SWEEPS = (("left_sweep", "right_sweep"),)
_KNOWN = {name for pair in (*_POSITIONS, *_WIDTHS, *_SWEEPS) for name in pair}
_LAYOUTS = "known columns: x_m,y_m or x,y or lon,lat or s,kappa; with w_tr_right_m,w_tr_left_m or left,right; with left_sweep,right_sweep"
_LARGEST_M = 1e8  # beyond it a double's rounding of a position shows in the curvature
_DEGREES_SPACING = 1e-2
_TIGHTEST_PROFILE = 0.5  # [1/m]


def read_csv(text: str, name: str, *, crs: str | None = None) -> RawRoad:
    """Return the road in a CSV text; ``name`` begins the messages, ``crs`` is the system of x, y.

    Raises:
        RoadError: no header, unknown or contradicting columns, or an impossible value, with its line and column.

    """
    header, lines, values = _table(text, name)
    column = dict(zip(header, values.T, strict=True))
    pair = _one_of(_POSITIONS, column, name)
    if pair is None:
        msg = f"{name}: no position columns among {', '.join(header)}"
        raise RoadError(msg, hint=_LAYOUTS)
    points = np.stack([column[pair[0]], column[pair[1]]], axis=1)
    if len(points) < 2:  # noqa: PLR2004
        msg = f"{name}: a road needs at least two points, this one has {len(points)}"
        raise RoadError(msg)
    reaches = _reaches(column, lines, name)
    if pair == ("s", "kappa"):
        _check_profile(points, lines, name)
        if crs is not None:
            msg = f"{name}: a curvature profile has no coordinates, so no coordinate reference system"
            raise RoadError(msg)
        return RawRoad(points, reaches, is_profile=True)
    if pair == ("lon", "lat"):
        check_lonlat(points, name)
        if crs is not None and not is_geographic(crs):
            msg = f"{name}: columns lon, lat are degrees, but {crs} is projected"
            raise RoadError(msg, hint="call the columns x, y if they are metres")
        plane = to_plane(points, crs or LONLAT)
        return RawRoad(plane.points, reaches, to_lonlat=plane.to_lonlat)
    if crs is not None:
        if is_geographic(crs):
            check_lonlat(points, name)
        plane = to_plane(points, crs)
        return RawRoad(plane.points, reaches, to_lonlat=plane.to_lonlat)
    _check_metres(points, lines, pair, name)
    return RawRoad(points, reaches)


def _table(text: str, name: str) -> tuple[list[str], list[int], FloatArray]:
    """Return the header, the line number of every row, and the values, shape (rows, columns)."""
    header: list[str] = []
    separator = ","
    lines: list[int] = []
    rows: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        content = line.strip()
        if content.startswith("#"):
            fields = _fields(content.lstrip("#"))
            if not header and len(fields) > 1 and _KNOWN.issuperset(fields):
                header, separator = fields, _separator(content)
        elif content and not header:
            header, separator = _header(content, name, number), _separator(content)
        elif content:
            lines.append(number)
            rows.append(_row(content.split(separator), header, f"{name}, line {number}"))
    if not header:
        msg = f"{name} is empty"
        raise RoadError(msg, hint=_LAYOUTS)
    repeated = {field for field in header if header.count(field) > 1}
    if repeated:
        msg = f"{name}: column {min(repeated)} occurs twice"
        raise RoadError(msg)
    return header, lines, np.array(rows, dtype=float).reshape(len(rows), len(header))


def _separator(line: str) -> str:
    return ";" if ";" in line else ","


def _fields(line: str) -> list[str]:
    return [field.strip().strip('"') for field in line.split(_separator(line))]


def _header(line: str, name: str, number: int) -> list[str]:
    fields = _fields(line)
    if all(_is_number(field) for field in fields):
        msg = f"{name}, line {number}: the first line must name the columns, found numbers"
        raise RoadError(msg, hint=_LAYOUTS)
    for field in fields:
        if field not in _KNOWN:
            msg = f"{name}, line {number}: unknown column {field!r}"
            raise RoadError(msg, hint=_LAYOUTS)
    return fields


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True


def _row(fields: list[str], header: list[str], where: str) -> list[float]:
    if len(fields) != len(header):
        msg = f"{where}: {len(fields)} values for {len(header)} columns"
        raise RoadError(msg)
    values = []
    for field, column in zip(fields, header, strict=True):
        text = field.strip().strip('"')
        if not _is_number(text):
            msg = f"{where}, column {column}: {text!r} is not a number"
            raise RoadError(msg, hint="use a decimal point" if "," in text else None)
        if not np.isfinite(float(text)):
            msg = f"{where}, column {column}: {text} is not a finite number"
            raise RoadError(msg)
        values.append(float(text))
    return values


def _one_of(pairs: tuple[tuple[str, str], ...], column: dict[str, FloatArray], name: str) -> tuple[str, str] | None:
    """Return the one pair of columns that the file has, None if it has none of them."""
    present = [pair for pair in pairs if pair[0] in column or pair[1] in column]
    if not present:
        return None
    if len(present) > 1:
        msg = f"{name}: columns {', '.join(present[0])} and {', '.join(present[1])} contradict each other"
        raise RoadError(msg, hint=_LAYOUTS)
    for own, other in (present[0], present[0][::-1]):
        if own not in column:
            msg = f"{name}: column {own} is missing beside {other}"
            raise RoadError(msg, hint=_LAYOUTS)
    return present[0]


def _reaches(column: dict[str, FloatArray], lines: list[int], name: str) -> FloatArray | None:
    """Return left, right, left_sweep, right_sweep as positive reaches, shape (4, rows)."""
    widths, sweeps = _one_of(_WIDTHS, column, name), _one_of(_SWEEPS, column, name)
    if widths is None:
        if sweeps is not None:
            msg = f"{name}: {sweeps[0]} and {sweeps[1]} need left and right beside them"
            raise RoadError(msg, hint=_LAYOUTS)
        return None
    for side in widths:
        bad = np.flatnonzero(column[side] < 0.0)
        if bad.size:
            msg = f"{name}, line {lines[bad[0]]}, column {side}: {column[side][bad[0]]:g} m is negative"
            raise RoadError(msg, hint="both widths are reaches from the centre line, positive to either side")
    for inner, outer in zip(widths, sweeps or widths, strict=True):
        bad = np.flatnonzero(column[outer] < column[inner])
        if bad.size:
            at = bad[0]
            msg = f"{name}, line {lines[at]}, column {outer}: {column[outer][at]:g} m is less than {inner}, {column[inner][at]:g} m"
            raise RoadError(msg)
    return np.stack([column[side] for side in (*widths, *(sweeps or widths))])


def _check_profile(points: FloatArray, lines: list[int], name: str) -> None:
    back = np.flatnonzero(np.diff(points[:, 0]) <= 0.0)
    if back.size:
        at = back[0] + 1
        msg = f"{name}, line {lines[at]}, column s: {points[at, 0]:g} m does not exceed the {points[at - 1, 0]:g} m before it"
        raise RoadError(msg, s_m=float(points[at, 0]))
    tight = np.flatnonzero(np.abs(points[:, 1]) > _TIGHTEST_PROFILE)
    if tight.size:
        at = tight[0]
        msg = f"{name}, line {lines[at]}, column kappa: {points[at, 1]:g} 1/m is a radius below {1 / _TIGHTEST_PROFILE:g} m"
        raise RoadError(msg, s_m=float(points[at, 0]))


def _check_metres(points: FloatArray, lines: list[int], pair: tuple[str, str], name: str) -> None:
    large = np.argwhere(np.abs(points) > _LARGEST_M)
    if large.size:
        row, axis = large[0]
        msg = f"{name}, line {lines[row]}, column {pair[axis]}: {points[row, axis]:g} m is too large for a position"
        raise RoadError(msg)
    spacing = np.hypot(*np.diff(points, axis=0).T)
    looks_like_degrees = np.all(np.abs(points) <= np.array([180.0, 90.0])) and np.median(spacing) < _DEGREES_SPACING
    if looks_like_degrees and np.any(spacing > 0.0):
        msg = f"{name}: columns {pair[0]}, {pair[1]} look like degrees (points {np.median(spacing):.2g} apart), not metres"
        raise RoadError(msg, hint="call the columns lon,lat if they are longitude and latitude")
