"""Smooth a long line in windows, and put them together to one reference path.

Each window is smoothed by itself, with so much of the line around it that its ends do not matter, and is then sampled at multiples of
the knot spacing of the whole road. Around the place where one window goes over into the next, the two lines, which differ by a millimetre
or so, are blended over ``BLEND_M``. Whoever takes all windows at once and whoever takes three neighbours gets the same path.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from hdvplan.arrays import BoolArray, FloatArray, chord_of
from hdvplan.errors import RoadError
from hdvplan.road.limits import About, Limits
from hdvplan.road.line import Line, RawRoad, noted_again, offset_road, reversed_road, smoothed
from hdvplan.road.path import KNOT_SPACING_M, ReferencePath, from_samples
from hdvplan.road.pieces import Kerb
from hdvplan.road.regions import OPEN_M, Region
from hdvplan.road.road import Road

WINDOW_M = 5000.0  # about
BLEND_M = 50.0
_BESIDE_M = 150.0  # of line on either side of a window: smoothing forgets the end of its line over less
_HEADING_M = 0.5  # of headings that are followed along a line


@dataclass(frozen=True)
class _Piece:
    """A part of a line, lengths along the whole line at its points, and the whole line's length [m]."""

    line: Line
    along: FloatArray
    total: float


@dataclass(frozen=True)
class Window:
    """A part of a line, smoothed. ``road`` has arclengths of its own, which ``shift`` makes those of the whole road [m].

    It stands for the whole road from ``begin`` to ``end`` [m], multiples of the knot spacing, and reaches further on either side.
    """

    road: Road
    shift: float
    begin: float
    end: float
    last: bool


def windows_of(line: Line, length: float = WINDOW_M) -> Iterator[Window]:
    """Smooth a line of points in windows of about ``length`` metres, in driving direction and at the line's offset.

    The last window ends at the last multiple of the knot spacing, up to half a metre before the line.

    Raises:
        RoadError: the line cannot be smoothed; its message says from where its arclengths count.

    """
    chord = chord_of(line.raw.points)
    count = max(1, round(float(chord[-1]) / length))
    ends = np.linspace(0.0, float(chord[-1]), count + 1)
    begin, place = 0.0, (0.0, 0.0)
    for number, (road, s, along) in enumerate(map(_driven, _pieces(line, chord, ends))):
        start = float(road.path.project(*place, float(np.interp(ends[number], along, s)))[0]) if number else 0.0
        shift, last = begin - start, number == count - 1
        end = on_knot(shift + (road.path.length if last else float(np.interp(ends[number + 1], along, s))))
        yield Window(road, shift, begin, end, last)
        here = road.path.at(end - shift)
        place, begin = (float(here.x), float(here.y)), end


def whole_road(line: Line) -> Road:
    """Return the road of a line that is smoothed in windows.

    Raises:
        RoadError: as ``windows_of``.

    """
    windows = list(windows_of(line))
    return road_of(line.name, windows, 0.0, windows[-1].end)


def road_of(name: str, windows: Sequence[Window], s_from: float, s_to: float) -> Road:
    """Return the road that neighbouring windows make from ``s_from`` to ``s_to`` [m], multiples of the knot spacing.

    Its arclengths count from ``s_from``.
    """
    first = windows[0].road
    regions = tuple(dict.fromkeys(region for window in windows for region in window.road.regions))
    notes = tuple(dict.fromkeys(note for window in windows for note in window.road.notes))
    path = _path(windows, s_from, s_to)
    about, radius = _about(windows, s_from), first.corner_radius
    road = Road(name, path, None, None, first.to_lonlat, first.notice, regions, notes=notes, about=about, corner_radius=radius)
    limits = [_cut(window.road.limits, window) for window in windows if window.road.limits is not None]
    if not limits:
        return road
    s, left, right, left_sweep, right_sweep = (np.concatenate(column) for column in zip(*limits, strict=True))
    return road.within(Limits(s - s_from, left, right, left_sweep, right_sweep), _drawn(windows, s_from))


def _about(windows: Sequence[Window], s_from: float) -> About | None:
    """Return the line that widths count from, along all windows."""
    parts = []
    for window in windows:
        about = window.road.about
        if about is None:
            return None
        own = _own(about.s, window)
        parts.append((about.points[own], about.s[own] + window.shift - s_from, about.sharp[own]))
    points, s, sharp = (np.concatenate(column) for column in zip(*parts, strict=True))
    return About(
        points, np.maximum.accumulate(s), sharp, closed=False, offset=windows[0].road.about.offset if windows[0].road.about else 0.0
    )


def _drawn(windows: Sequence[Window], s_from: float) -> tuple[Kerb, ...] | None:
    """Return the kerbs along all windows; those that no window goes on with end there."""
    found: dict[tuple[bool, bool], list[Kerb]] = {}
    for window in windows:
        if window.road.drawn is None:
            return None
        for kerb in window.road.drawn:
            own = _own(kerb.s, window)
            found.setdefault((kerb.left, kerb.wheels), []).append(
                replace(kerb, points=kerb.points[own], s=kerb.s[own] + window.shift - s_from)
            )
    return tuple(
        replace(
            of[0], points=np.concatenate([kerb.points for kerb in of]), s=np.maximum.accumulate(np.concatenate([kerb.s for kerb in of]))
        )
        for of in found.values()
    )


def _own(s: FloatArray, window: Window) -> BoolArray:
    """Return which arclengths a window stands for; the first and the last go on as far as they are drawn."""
    begin = -np.inf if window.begin == 0.0 else window.begin - window.shift
    return (s >= begin) & (s < (np.inf if window.last else window.end - window.shift))


def on_knot(s: float) -> float:
    """Return the last multiple of the knot spacing up to ``s`` [m]."""
    return KNOT_SPACING_M * float(np.floor(s / KNOT_SPACING_M + 1e-9))


def _path(windows: Sequence[Window], s_from: float, s_to: float) -> ReferencePath:
    s = KNOT_SPACING_M * np.arange(round(s_from / KNOT_SPACING_M), round(s_to / KNOT_SPACING_M) + 1, dtype=np.float64)
    owner = np.searchsorted([window.begin for window in windows[1:]], s, side="right")
    rows = np.empty((6, len(s)))
    for number, window in enumerate(windows):
        rows[:, owner == number] = _derivatives(window, s[owner == number])
    for before, after in pairwise(windows):
        near = np.abs(s - after.begin) < 0.5 * BLEND_M
        part = (s[near] - after.begin) / BLEND_M + 0.5
        rows[:, near] = _blended(_derivatives(before, s[near]), _derivatives(after, s[near]), part)
    x, y, dx, dy, ddx, ddy = rows
    return from_samples(x, y, np.arctan2(dy, dx), (dx * ddy - dy * ddx) / np.hypot(dx, dy) ** 3, KNOT_SPACING_M)


def _derivatives(window: Window, s: FloatArray) -> FloatArray:
    """Return x, y and their first and second derivatives at the whole road's arclengths, shape (6, len(s))."""
    here = window.road.path.at(s - window.shift)
    cos, sin = np.cos(here.heading), np.sin(here.heading)
    return np.stack([here.x, here.y, cos, sin, -here.curvature * sin, here.curvature * cos])


def _blended(before: FloatArray, after: FloatArray, part: FloatArray) -> FloatArray:
    """Return rows of ``_derivatives`` that go over from one line into the other as ``part`` goes from 0 to 1."""
    weight = part**3 * (10.0 - 15.0 * part + 6.0 * part**2)
    slope = 30.0 * part**2 * (1.0 - part) ** 2 / BLEND_M
    bend = 60.0 * part * (1.0 - part) * (1.0 - 2.0 * part) / BLEND_M**2
    gap = after - before
    rows: FloatArray = before + weight * gap
    rows[2:4] += slope * gap[0:2]
    rows[4:6] += 2.0 * slope * gap[2:4] + bend * gap[0:2]
    return rows


def _cut(band: Limits | None, window: Window) -> list[FloatArray]:
    """Return the columns of a window's limits over what it stands for, at the whole road's arclengths."""
    assert band is not None  # noqa: S101 - for the type checker
    begin, end = window.begin - window.shift, window.end - window.shift
    inside = band.s[(band.s > begin) & (band.s < end)]
    s = np.concatenate([[begin], inside, [end] if window.last else []])
    return [s + window.shift, *band.table(s)]


def _pieces(line: Line, chord: FloatArray, ends: FloatArray) -> Iterator[_Piece]:
    """Yield the parts of a line that windows are made of; ``ends`` are lengths along the driven line [m]."""
    total = float(chord[-1])
    for begin, end in pairwise(ends):
        first, last = float(begin) - _BESIDE_M, float(end) + _BESIDE_M
        part, along = _part(line.raw, chord, *((total - last, total - first) if line.options.reverse else (first, last)))
        yield _Piece(replace(line, raw=part), along, total)


def _driven(piece: _Piece) -> tuple[Road, FloatArray, FloatArray]:
    """Return the road of a part of a line in the direction and at the offset at which it is driven.

    Also returned are, for the line's points there, arclengths on the road and lengths along the whole line [m].

    Raises:
        RoadError: it cannot be smoothed.

    """
    along, total, options = piece.along, piece.total, piece.line.options
    try:
        road, s = smoothed(piece.line)
        if options.reverse:
            road, s, along = noted_again(reversed_road(road), piece.line.raw), (road.path.length - s)[::-1], (total - along)[::-1]
        road = replace(road, notes=(*piece.line.raw.notes, *_placed(road.notes[len(piece.line.raw.notes) :], along)))
        if options.offset:
            fine = np.linspace(0.0, road.path.length, int(np.ceil(road.path.length / _HEADING_M)) + 1)
            heading = np.unwrap(road.path.at(fine).heading)
            s = np.interp(s, fine, fine - options.offset * (heading - heading[0]))
            road = offset_road(road, options.offset)
    except RoadError as error:
        begins = float(along[0])
        msg = f"{error}; this s counts from {begins:.0f} m along the whole line"
        raise RoadError(msg, s_m=None if error.s_m is None else error.s_m + begins, hint=error.hint) from error
    return road, s, along


def _placed(notes: Iterable[str], along: FloatArray) -> list[str]:
    """Return notes on a part of a line with the lengths along the whole line between which it lies, at its points [m]."""
    return [f"{note}; this is the part from {along[0]:.0f} to {along[-1]:.0f} m of the line, and s counts from its begin" for note in notes]


def _part(raw: RawRoad, chord: FloatArray, first: float, last: float) -> tuple[RawRoad, FloatArray]:
    """Return the part of a line between two lengths along it, and the lengths along the whole line at its points [m]."""
    first, last = max(first, 0.0), min(last, float(chord[-1]))
    inside = (chord > first) & (chord < last)
    along = np.concatenate([[first], chord[inside], [last]])
    points = np.stack([np.interp(along, chord, column) for column in raw.points.T], axis=1)
    reaches = None if raw.reaches is None else _cut_rows(raw.reaches, chord, inside, first, last)
    sides = None if raw.sides is None else np.stack([_cut_rows(side.T, chord, inside, first, last).T for side in raw.sides])
    low, high = points.min(axis=0) - OPEN_M, points.max(axis=0) + OPEN_M
    near = tuple(edge for edge in raw.edges if np.all(edge.max(axis=0) >= low) and np.all(edge.min(axis=0) <= high))
    edges = near or raw.edges[:1]  # the road is open where none is near
    regions = tuple(region for region in raw.regions if _overlaps(region, low, high))
    return replace(raw, points=points, reaches=reaches, sides=sides, edges=edges, regions=regions, lines=None), along


def _cut_rows(rows: FloatArray, chord: FloatArray, inside: BoolArray, first: float, last: float) -> FloatArray:
    """Return values at a line's points, shape (k, n), for the points inside and the two places where it is cut."""
    ends = [np.array([[np.interp(at, chord, row)] for row in rows]) for at in (first, last)]
    return np.concatenate([ends[0], rows[:, inside], ends[1]], axis=1)


def _overlaps(region: Region, low: FloatArray, high: FloatArray) -> bool:
    x_low, y_low, x_high, y_high = region.polygon.bounds
    return bool(x_high >= low[0] and y_high >= low[1] and x_low <= high[0] and y_low <= high[1])
