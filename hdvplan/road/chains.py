"""Kerbs from the pieces that are drawn on one side of a road: which follow each other, and what is straight where none is drawn."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
import shapely

from hdvplan.arrays import BoolArray, FloatArray
from hdvplan.road.path import ReferencePath
from hdvplan.road.pieces import Kerb, between
from hdvplan.road.regions import OPEN_M
from hdvplan.road.street import BEYOND_M

GAP_M = 0.5  # ends of two lines this close are one kerb
OVERLAP_M = 1.0  # kerbs that run beside each other for longer are two
_BACK = -0.5  # cosine of the turn by which a kerb leads back along itself
_FAR = 2.0  # times as far from the road as where it is nearest: what is hidden there lies in a side street
_ALONG = 0.5  # metres of road a metre of kerb, below which it leads into a side street


class Bridge(NamedTuple):
    """A straight between two drawn pieces: its ends (2, 2) [m], and the arclengths beside them [m]."""

    ends: FloatArray
    s: tuple[float, float]

    def note(self, side: str, path: ReferencePath) -> str:
        """Return what is told of it."""
        (x, y), (to_x, to_y) = self.ends
        begin, end = np.mod(self.s, path.length) if path.closed else self.s
        where = f"from s = {begin:z.1f} to {end:z.1f} m" if abs(end - begin) > GAP_M else f"beside s = {begin:z.1f} m"  # of a side street
        apart = f"no edge on the {side} for {np.hypot(to_x - x, to_y - y):.1f} m {where}"
        return f"{apart}, x {x:.1f}, y {y:.1f} to x {to_x:.1f}, y {to_y:.1f}: it is straight there; if not so, draw it"


def chained(pieces: list[Kerb], path: ReferencePath) -> tuple[list[Kerb], list[Bridge]]:
    """Return one side's kerbs of pieces that follow each other, and what bridges the gaps between these.

    Pieces that run beside another one, perhaps a lap on, stay as they are; what leads into a side street runs beside nothing. So do those
    that are shorter than the gap between them, if another kerb runs beside all of it: walls. A line that is drawn only in a side street is
    taken from the end that is nearer to the piece before.
    """
    lap = path.length if path.closed else np.inf
    chains: list[tuple[Kerb, float, float]] = []  # each with where it begins and ends beside the road
    bridges = []
    placed = sorted(map(partial(_beside, path=path), pieces, _in_sight(pieces, path)), key=lambda one: one[1])
    for piece, begin, end in placed:
        spans = [(first, last) for _, first, last in [*chains, *placed]]
        before = [at for at, (first, last) in enumerate(spans[: len(chains)]) if begin > last - OVERLAP_M and end < first + lap + OVERLAP_M]
        before = [at for at in before if not _are_walls(spans[at], (begin, end), spans, lap)]
        if not before:
            chains.append((piece, begin, end))
            continue
        back = [replace(piece, points=piece.points[::-1], s=np.full(len(piece.s), begin))] if begin == end else []
        at, after = min(((at, way) for way in (piece, *back) for at in before), key=lambda one: _apart(chains[one[0]][0], one[1]))
        last, first, _ = chains[at]
        s = np.maximum.accumulate(np.concatenate([last.s, after.s]))
        if _apart(last, after) > GAP_M:
            bridges.append(_bridge(last, after, float(s[len(last.s)])))
        chains[at] = (replace(last, points=np.concatenate([last.points, after.points]), s=s), first, end)
    kerbs = _going_on([kerb for kerb, _, _ in chains], path)
    around = [(kerb, float(kerb.s[0]) + path.length) for kerb in kerbs if path.closed and kerb.goes_on]
    return kerbs, bridges + [_bridge(kerb, kerb, to) for kerb, to in around if kerb.s[-1] < to and _apart(kerb, kerb) > GAP_M]


def _are_walls(one: tuple[float, float], after: tuple[float, float], spans: list[tuple[float, float]], lap: float) -> bool:
    """Return whether the gap between two stretches is longer than both, and another one runs beside all of it [m]."""
    apart = after[0] - one[1] > np.ptp(one) + np.ptp(after)
    return apart and any((first <= one[1] and last >= after[0]) or last - first >= lap - GAP_M for first, last in spans)


def _in_sight(pieces: list[Kerb], path: ReferencePath) -> list[BoolArray]:
    """Return which points of each of several pieces are not far off and hidden by others from the road beside them: in a side street."""
    count = [len(piece.points) for piece in pieces]
    if len(pieces) <= 1:  # as of most roads
        return [np.ones(number, bool) for number in count]
    points, owner = np.concatenate([piece.points for piece in pieces]), np.repeat(np.arange(len(pieces)), count)
    s = np.concatenate([piece.s for piece in pieces])
    here = path.extended(max(BEYOND_M, -s.min()), max(BEYOND_M, s.max() - path.length)).at(s)
    feet = np.stack([here.x, here.y], axis=1)
    away = np.hypot(*(points - feet).T)
    before = feet + (points - feet) * np.maximum(0.0, 1.0 - GAP_M / np.maximum(away, GAP_M))[:, None]
    inner = np.flatnonzero(np.diff(owner) == 0)
    drawn = shapely.STRtree(np.asarray(shapely.linestrings(np.stack([points[inner], points[inner + 1]], axis=1))))
    way, met = drawn.query(np.asarray(shapely.linestrings(np.stack([feet, before], axis=1))), predicate="intersects")
    seen = np.ones(len(points), bool)
    seen[way[owner[way] != owner[inner[met]]]] = False
    nearest = np.full(len(pieces), np.inf)
    np.minimum.at(nearest, owner[seen], away[seen])
    return np.split(seen | (away < _FAR * nearest[owner]), np.cumsum(count)[:-1])


def _beside(piece: Kerb, seen: BoolArray, path: ReferencePath) -> tuple[Kerb, float, float]:
    """Return a piece with the arclengths of its first and last place that runs along the road: else twice that of its nearest one [m].

    What is not ``seen`` from there lies beside these, too.
    """
    along = np.diff(piece.s) > _ALONG * np.hypot(*np.diff(piece.points, axis=0).T)
    in_sight = along & seen[1:] & seen[:-1]
    along = np.flatnonzero(in_sight if np.any(in_sight) else along)
    if len(along):
        begin, end = float(piece.s[along[0]]), float(piece.s[along[-1] + 1])
        s = np.maximum.accumulate(np.where(seen, piece.s, np.clip(piece.s, begin, end)))
        return replace(piece, s=s), begin, end
    here = path.extended(BEYOND_M, BEYOND_M).at(piece.s)
    nearest = float(piece.s[np.argmin(np.hypot(here.x - piece.points[:, 0], here.y - piece.points[:, 1]))])
    return piece, nearest, nearest


def _bridge(before: Kerb, after: Kerb, to: float) -> Bridge:
    """Return the straight from the end of a kerb to the beginning of another, which is at arclength ``to`` [m]."""
    return Bridge(np.stack([before.points[-1], after.points[0]]), (float(before.s[-1]), to))


def _apart(before: Kerb, after: Kerb) -> float:
    """Return how far the end of a kerb is from the beginning of another [m]."""
    return float(np.hypot(*(after.points[0] - before.points[-1])))


def _going_on(chains: list[Kerb], path: ReferencePath) -> list[Kerb]:
    """Return one side's kerbs with those marked that go on: a single one, and of several those that run beside the whole road.

    Of an open road's, those as long as the longest are taken for such: the street is not open beyond its ends because of a lay-by's line.
    """
    reach = [float(np.ptp(kerb.s if path.closed else np.clip(kerb.s, 0.0, path.length))) for kerb in chains]
    whole = path.length if path.closed else max(reach, default=0.0)
    return [replace(kerb, goes_on=len(chains) == 1 or own >= whole - GAP_M) for kerb, own in zip(chains, reach, strict=True)]


def opened(kerbs: list[Kerb], place: list[Kerb], path: ReferencePath, ends: FloatArray) -> tuple[list[Kerb], tuple[bool, bool]]:
    """Return what bounds a side of an open road with ``kerbs``, and whether it is open before the first and behind the last of them.

    Those that go on do so straight, along the road's ``ends`` (2, 2); but not where that would lead back along them, or across the road's
    line: there a side is bound by those of an open ``place``.
    """
    found, is_open = list[Kerb](), np.zeros(2, bool)
    for kerb in kerbs:
        parts, astray = _opened(kerb, place, path, ends) if kerb.goes_on else ([kerb], (False, False))
        found, is_open = found + parts, is_open | astray
    return found, (bool(is_open[0]), bool(is_open[1]))


def _opened(kerb: Kerb, place: list[Kerb], path: ReferencePath, ends: FloatArray) -> tuple[list[Kerb], tuple[bool, bool]]:
    """Return a kerb that goes on with what bounds its side before it and behind it, and whether that is open there, see ``opened``."""
    rest, ways = (float(kerb.s[0]), path.length - float(kerb.s[-1])), (-ends[0], ends[1])
    before, behind = (rest[last] > GAP_M and _astray(kerb, path, ways[last], rest[last], last) for last in range(2))
    astray = (before, behind)
    others, goes_on = list[Kerb](), True
    for last, (low, high) in enumerate(((0.0, float(kerb.s[0])), (float(kerb.s[-1]), path.length))):
        parts = [part for one in place if astray[last] and len((part := between(one, low, high)).points) > 1]
        if len(parts) == 1:
            order = (kerb, parts[0]) if last else (parts[0], kerb)
            kerb = replace(kerb, points=np.concatenate([one.points for one in order]), s=np.concatenate([one.s for one in order]))
        elif astray[last]:  # the arms of the street are one place
            others, goes_on = others + parts, False
    if not goes_on:  # but for an end that is not open
        points = [kerb.points[:1] + BEYOND_M * ways[0], kerb.points, kerb.points[-1:] + BEYOND_M * ways[1]]
        s, kept = [kerb.s[:1] - BEYOND_M, kerb.s, kerb.s[-1:] + BEYOND_M], slice(int(before), 3 - int(behind))
        kerb = replace(kerb, points=np.concatenate(points[kept]), s=np.concatenate(s[kept]))
    return [replace(kerb, goes_on=goes_on), *others], astray


def _astray(kerb: Kerb, path: ReferencePath, way: FloatArray, rest: float, last: int) -> bool:
    """Return whether a straight along ``way`` (2,) from a kerb's first or ``last`` point leads back, or across the line's ``rest`` [m]."""
    sign, begin = (1.0, float(kerb.s[-1])) if last else (-1.0, float(kerb.s[0]))
    s = begin + sign * np.linspace(-OPEN_M, rest, 2 + int((rest + OPEN_M) / OVERLAP_M))
    here = path.extended(BEYOND_M, BEYOND_M).at(np.clip(s, -BEYOND_M, path.length + BEYOND_M))
    heading = float(path.at(np.clip(begin, 0.0, path.length)).heading)
    own = kerb.points[-1] - kerb.points[-2] if last else kerb.points[0] - kerb.points[1]
    before = np.stack([own / max(float(np.hypot(*own)), 1e-9), sign * np.array([np.cos(heading), np.sin(heading)])])
    straight = shapely.LineString([kerb.points[-last], kerb.points[-last] + rest * way])
    return bool(np.min(before @ way) < _BACK) or straight.intersects(shapely.LineString(np.column_stack([here.x, here.y])))


def gaps(pieces: list[Kerb], length: float, side: str, is_open: tuple[bool, bool]) -> list[str]:
    """Return notes on the stretches without an edge before the first piece and behind the last one; ``is_open``: see ``opened``."""
    if not pieces:
        return [f"no edge on the {side}: it is open to {OPEN_M:g} m"]
    ends = (0.0, min(float(piece.s[0]) for piece in pieces)), (max(float(piece.s[-1]) for piece in pieces), length)
    stretches = [(begin, end, how) for (begin, end), how in zip(ends, is_open, strict=True) if end - begin > GAP_M]
    hows = {False: "it goes on straight there", True: f"it is open to {OPEN_M:g} m there"}
    return [f"no edge on the {side} from s = {begin:z.1f} to {end:z.1f} m: {hows[how]}" for begin, end, how in stretches]
