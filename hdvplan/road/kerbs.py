"""Kerbs: the lines parallel to a line at its widths, as they bound the street.

Beside a corner's outside they run on to the mitre. Inside a corner, and where the line bends more tightly than the width,
the plain offset line folds back and makes a loop; the loop is cut out where the offset line crosses itself. Where a street is wider than
the half turn it makes, its arms are one area, with no kerb between them.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry
from shapely.ops import substring

from hdvplan.arrays import BoolArray, FloatArray, IntArray, chord_of, counted_up, end_ways, runs_of

_MITRE = 2.0  # of the width: further out the mitre is cut square
_CHORD_M = 1e-3  # that points of a kerb may be left out
_FURTHEST_M = 100.0  # along the line that a loop is looked for: wider streets fold at no corner
_FAR = 6.0  # times the largest width on: inside corners of up to 160 degrees the kerbs have met; other arms of the road are further
_ROUNDING_M, _ROUNDING = 1e-9, 1e-6  # [m] and [rad]
_SEEN_M = 0.25  # between places of a kerb that are looked at
_WITHIN_M = 0.1  # that a place is within the street: more than chords of arcs are
_ONE_PLACE_M = 1e-5  # between points that are one place: a step of a width is so long, and has no direction of its own
_SHORT_M = 1e-3  # legs of corners that are not rounded, and points of legs left out
_LEGS = 3.0  # radii of a rounded corner's legs: enough for 140 degrees


class Parallel(NamedTuple):
    """One side's kerb along a line: ``points``, shape (k, 2) [m], and the position ``number`` (k,) of the line's point each belongs to.

    Where ``whole`` it reaches from the line's first point to its last; else there are others, and at an open line's ends it goes on beyond.
    """

    points: FloatArray
    number: FloatArray
    whole: bool


@dataclass(frozen=True)
class _Raw:
    """The plain offset line: of every point that of the line, reach [m], number, arclength of the line [m] and whether it is a corner.

    Of every segment: whether it folds back.
    """

    points: FloatArray
    line: FloatArray
    reach: FloatArray
    number: FloatArray
    s: FloatArray
    folded: BoolArray
    corner: BoolArray


@dataclass(frozen=True)
class _Cut:
    """A loop around segments ``first`` to ``last``, which fold back, and where it begins and ends (segment and share).

    Where it begins and ends in one place, that is in its stead, at the position ``number``; else (None) the kerb ends and begins again.
    """

    first: int
    last: int
    begin: float
    end: float
    number: float | None
    corner: bool = False


def kerb_of(
    points: FloatArray, number: FloatArray, sharp: BoolArray, reach: FloatArray, *, closed: bool, corner_radius: float = 0.0
) -> list[Parallel]:
    """Return the kerb at ``reach`` (m,) [m], left positive, beside a line of ``points`` (m, 2) [m] at positions ``number`` (m,).

    ``sharp`` (m,) says where the line has a corner. Between points the reach is linear; two points in one place make a step.
    The kerb inside a corner is rounded with ``corner_radius`` [m], or less where its legs are too short. A closed line
    repeats its first point at the end, and so does its kerb. Where there is none in between, the kerb is in parts.
    """
    begin, end = number[0], number[-1]
    far = float(np.clip(_FAR * np.max(np.abs(reach)), 1.0, _FURTHEST_M))
    if closed:  # three times around: the middle one knows no ends
        points, sharp, reach = (np.concatenate([values, values[1:], values[1:]]) for values in (points, sharp, reach))
        number = np.concatenate([number - (end - begin), number[1:], number[1:] + (end - begin)])
    else:  # straight on: what is inside a corner near an end is met there
        ahead = far * end_ways(points)
        points = np.concatenate([points[:1] - ahead[:1], points, points[-1:] + ahead[1:]])
        number = np.concatenate([[begin - far], number, [end + far]])
        sharp, reach = np.pad(sharp, 1), np.pad(reach, 1, mode="edge")
    parts = _trimmed(_offset(points, number, sharp, reach), far)
    kerbs = []
    for places, numbers, corners in parts:
        if np.ptp(numbers) <= 0.0:  # nothing is left
            continue
        if corner_radius > 0.0:
            places, numbers = _rounded(places, numbers, corners, corner_radius, (begin, end))  # noqa: PLW2901 - what is left of them
        if closed or len(parts) == 1:
            places, numbers = _between(places, numbers, begin, end)  # noqa: PLW2901 - as above
        if len(numbers) > 1:
            indexed = shapely.linestrings(np.column_stack([places, np.arange(len(places))]))
            kept = shapely.get_coordinates(shapely.simplify(indexed, _CHORD_M, preserve_topology=False), include_z=True)[:, 2].astype(int)
            kerbs.append(Parallel(places[kept], numbers[kept], whole=len(parts) == 1))
    return kerbs


def _offset(points: FloatArray, number: FloatArray, sharp: BoolArray, reach: FloatArray) -> _Raw:
    """Return the plain offset line: a point beside every point, at corners the ends of both legs and the mitre between them."""
    chord = np.diff(points, axis=0)
    length = np.hypot(*chord.T)
    real = np.flatnonzero(length > _ONE_PLACE_M)
    unit = chord[real] / length[real, None]
    after = np.searchsorted(real, np.arange(len(points)))  # the first real chord from the point on
    after, before = np.minimum(after, len(real) - 1), np.maximum(after - 1, 0)
    one = unit[before]
    last = np.append(length, 1.0) > _ONE_PLACE_M
    other = np.where((last | ~sharp)[:, None], unit[after], one)  # of points in one place the last has the corner
    half = 0.5 * np.arctan2(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0], np.sum(one * other, axis=1))
    middle = np.arctan2(one[:, 1], one[:, 0]) + half
    tangent, normal = np.stack([np.cos(middle), np.sin(middle)], axis=1), np.stack([-np.sin(middle), np.cos(middle)], axis=1)
    # beside a corner, along its tangent and normal, in units of the reach: where the legs end, and where the mitre's ends are
    x_leg, y_leg = np.sin(half), np.cos(half)
    y_mitre = np.minimum(1.0 / np.maximum(y_leg, 1e-9), _MITRE)
    x_mitre = (1.0 - y_mitre * y_leg) / np.where(np.abs(x_leg) > 1e-9, x_leg, 1.0)  # noqa: PLR2004 -- straight on
    parts = np.where(sharp, np.where(reach * half < 0.0, 4, 2), 1)
    of, part = counted_up(parts)
    back = np.where(2 * part < parts[of] - 1, 1.0, -1.0)
    leg = (parts[of] > 1) & ((part == 0) | (part == parts[of] - 1))
    x = back * np.where(leg, x_leg[of], np.where(parts[of] > 1, x_mitre[of], 0.0))
    y = np.where(leg, y_leg[of], y_mitre[of])
    places = points[of] + reach[of, None] * (x[:, None] * tangent[of] + y[:, None] * normal[of])
    along = np.where((of[1:] == of[:-1])[:, None], tangent[of[1:]], unit[before[of[1:]]])
    folded = np.sum(np.diff(places, axis=0) * along, axis=1) < -_ROUNDING_M
    s = np.concatenate([[0.0], np.cumsum(length)])
    return _Raw(places, points[of], reach[of], number[of], s[of], folded, (sharp & (reach * half > 0.0))[of])


def _between(places: FloatArray, numbers: FloatArray, first: float, last: float) -> tuple[FloatArray, FloatArray]:
    first, last = max(first, numbers[0]), min(last, numbers[-1])
    if last <= first:
        return places[:0], numbers[:0]
    inner = (numbers > first) & (numbers <= last)
    ends = []
    for value in (first, last):
        at = min(int(np.searchsorted(numbers, value, side="right")), len(numbers) - 1) - 1
        share = (value - numbers[at]) / (numbers[at + 1] - numbers[at])
        ends.append(places[at] + share * (places[at + 1] - places[at]))
    return np.vstack([ends[0], places[inner], ends[1]]), np.concatenate([[first], numbers[inner], [last]])


def _trimmed(raw: _Raw, far: float) -> list[tuple[FloatArray, FloatArray, IntArray]]:
    """Return the parts of the offset line without its loops: points, numbers, and which of its points are inside corners."""
    cuts: list[_Cut] = []
    for begin, behind in runs_of(raw.folded).tolist():
        cut = _cut(raw, begin, behind - 1, far)
        while cuts and cuts[-1].end >= cut.begin:  # their loops share a stretch: they are one
            before = cuts.pop()
            if before.number is None or cut.number is None:
                cut = replace(cut, first=before.first, begin=min(before.begin, cut.begin), end=max(before.end, cut.end), number=None)
            else:
                cut = _cut(raw, before.first, max(before.last, cut.last), far)
        cuts.append(cut)
    parts: list[tuple[FloatArray, FloatArray, IntArray]] = []
    pieces, numbers = list[FloatArray](), list[FloatArray]()
    corners, start = list[int](), 0
    for cut_out in (*cuts, None):
        stop = len(raw.points) if cut_out is None else math.floor(cut_out.begin) + 1
        pieces.append(raw.points[start:stop])
        numbers.append(raw.number[start:stop])
        if cut_out is not None:
            start = math.floor(cut_out.end) + 1
            place, number = _place(raw, cut_out.begin)
            pieces.append(place[None])
            numbers.append(np.array([number if cut_out.number is None else cut_out.number]))
        if cut_out is None or cut_out.number is None:
            parts.append((np.concatenate(pieces), np.concatenate(numbers), np.array(corners, dtype=np.int64)))
            pieces, numbers, corners = [], [], []
        elif cut_out.corner:
            corners.append(sum(map(len, pieces)) - 1)
        if cut_out is not None and cut_out.number is None:
            place, number = _place(raw, cut_out.end)
            pieces.append(place[None])
            numbers.append(np.array([number]))
    return parts


def _place(raw: _Raw, where: float) -> tuple[FloatArray, float]:
    """Return the place on the offset line, and its number, at a segment and a share of it."""
    at = min(int(where), len(raw.points) - 2)
    share = where - at
    return raw.points[at] + share * (raw.points[at + 1] - raw.points[at]), raw.number[at] + share * (raw.number[at + 1] - raw.number[at])


def _cut(raw: _Raw, first: int, last: int, far: float) -> _Cut:
    """Return where the offset line crosses itself around segments ``first`` to ``last`` that fold back, within ``far`` [m] of them.

    Where it does not, the width jumps, and the kerb goes straight across; or that is within the street, and there is no kerb. Kerbs of
    arms between which the line turns by more than half a turn are not one, wherever they cross.
    """
    chords = np.diff(raw.line[max(first - 1, 0) : last + 3], axis=0)
    chords = chords[np.any(chords != 0.0, axis=1)]
    looped = np.ptp(np.unwrap(np.arctan2(chords[:, 1], chords[:, 0]))) > math.pi + _ROUNDING
    if not looped and (crossing := _crossing(raw, first, last, far)) is not None:
        return crossing
    low, high = _around(raw, first, last, far)
    around, across = slice(low, high + 1), 0.5 * (raw.points[first] + raw.points[last + 1])
    line, reach = shapely.LineString(raw.line[around]), np.abs(raw.reach)
    if not looped and shapely.distance(shapely.Point(across), line) > min(reach[first], reach[last + 1]) - _WITHIN_M:
        return _Cut(first, last, first, last, raw.number[first])
    along = chord_of(raw.points[around])
    where = np.interp(np.arange(0.0, along[-1], _SEEN_M), along, np.arange(low, high + 1))
    places = np.stack([np.interp(where, np.arange(len(reach)), column) for column in (*raw.points.T, reach)], axis=1)
    on = where[shapely.distance(shapely.points(places[:, :2]), line) > places[:, 2] - _WITHIN_M]
    return _Cut(
        first, last, np.max(on[on <= first], initial=max(low - 1, 0)), np.min(on[on > last], initial=min(high + 1, len(raw.folded))), None
    )


def _around(raw: _Raw, first: int, last: int, window: float) -> tuple[int, int]:
    """Return the first segment within ``window`` [m] before a fold, and the one after the last within it beyond."""
    low, high = np.searchsorted(raw.s, [raw.s[first] - window, raw.s[last + 1] + window]).tolist()
    return max(low - 1, 0), min(high, len(raw.folded))


def _crossing(raw: _Raw, first: int, last: int, far: float) -> _Cut | None:
    """Return the least loop around segments ``first`` to ``last`` that ends where it begins, within ``far`` [m]; None without any."""
    for window in (0.1 * far, 0.3 * far, far):
        low, high = _around(raw, first, last, window)
        one = low + np.flatnonzero(~raw.folded[low:first])
        other = last + 1 + np.flatnonzero(~raw.folded[last + 1 : high])
        a, u = raw.points[one, None], (raw.points[one + 1] - raw.points[one])[:, None]
        b, v = raw.points[None, other], (raw.points[other + 1] - raw.points[other])[None]
        det = _cross(u, v)
        with np.errstate(divide="ignore", invalid="ignore"):
            t, q = _cross(b - a, v) / det, _cross(b - a, u) / det
            before = raw.s[first] - raw.s[one, None] - t * (raw.s[one + 1] - raw.s[one])[:, None]
            beyond = raw.s[other] + q * (raw.s[other + 1] - raw.s[other]) - raw.s[last + 1]
            cut_out = before + beyond
            met = (t >= 0.0) & (t <= 1.0) & (q >= 0.0) & (q <= 1.0) & (before <= window) & (beyond <= window)
        if np.any(met):
            i, j = np.unravel_index(np.argmin(np.where(met, cut_out, np.inf)), met.shape)
            middle = 0.5 * (raw.number[first] + raw.number[last + 1])
            return _Cut(first, last, one[i] + t[i, j], other[j] + q[i, j], middle, bool(np.any(raw.corner[first : last + 2])))
    return None


def _rounded(
    places: FloatArray, numbers: FloatArray, corners: IntArray, radius: float, ends: tuple[float, float]
) -> tuple[FloatArray, FloatArray]:
    """Return the kerb with its points ``corners`` rounded, each within half the way to the next one, or the way to the numbers ``ends``."""
    s = chord_of(places)
    low, high = np.interp(ends, numbers, s)
    limits = np.concatenate([[low], 0.5 * (s[corners[1:]] + s[corners[:-1]]), [high]])
    line = shapely.LineString(places)
    pieces, along, start = [], [], 0
    for at, (low, high) in zip(corners.tolist(), itertools.pairwise(limits.tolist()), strict=False):
        reach = _LEGS * radius
        legs_end = max(low, s[at] - reach), min(high, s[at] + reach)
        if min(s[at] - legs_end[0], legs_end[1] - s[at]) < _SHORT_M:
            continue
        legs = [shapely.simplify(substring(line, *part), _SHORT_M) for part in ((legs_end[0], s[at]), (s[at], legs_end[1]))]
        fits = 1.0 if _arc(legs, radius) else 0.0
        for halving in (0.5**k for k in range(1, 11) if fits < 1.0):  # the largest radius to a thousandth
            fits += halving if _arc(legs, (fits + halving) * radius) else 0.0
        arc = _arc(legs, fits * radius) if fits else None
        if arc:
            centre = np.array([arc.x, arc.y])
            feet = s[at] - legs[0].length + legs[0].project(arc), s[at] + legs[1].project(arc)
            spokes = np.stack([np.interp(feet, s, places[:, axis]) for axis in (0, 1)], axis=1) - centre
            angle = np.arctan2(spokes[:, 1], spokes[:, 0])
            sweep = (angle[1] - angle[0] + np.pi) % (2.0 * np.pi) - np.pi
            share = np.linspace(0.0, 1.0, 2 + math.ceil(abs(sweep) * math.sqrt(fits * radius / (8.0 * _CHORD_M))))
            turned = fits * radius * np.stack([np.cos(angle[0] + share * sweep), np.sin(angle[0] + share * sweep)], axis=1)
            stop = int(np.searchsorted(s, feet[0]))
            pieces += [places[start:stop], turned + centre]
            known = [np.interp(feet[0], s, numbers), numbers[at], np.interp(feet[1], s, numbers)]
            along += [numbers[start:stop], np.interp(share, [0.0, 0.5, 1.0], known)]
            start = int(np.searchsorted(s, feet[1], side="right"))
    return np.vstack([*pieces, places[start:]]), np.concatenate([*along, numbers[start:]])


def _arc(legs: Sequence[BaseGeometry], radius: float) -> shapely.Point | None:
    """Return the centre of the arc that touches both legs of a corner, if they are long enough."""
    one, other = np.diff(legs[0].coords[-2:], axis=0)[0], np.diff(legs[1].coords[:2], axis=0)[0]
    side = math.copysign(radius, float(_cross(one, other)))
    centre = shapely.intersection(*shapely.offset_curve(legs, side, join_style="bevel"))
    return None if centre.is_empty else centre.representative_point()


def _cross(one: FloatArray, other: FloatArray) -> FloatArray:
    return np.asarray(one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0])
