"""Kerbs from lines that are drawn beside a road: on which side of it each piece of them lies, and beside which stretch."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import scipy  # its subpackages load when they are first used
import shapely

from hdvplan.arrays import BoolArray, FloatArray, IntArray, counted_up
from hdvplan.errors import RoadError
from hdvplan.road.chains import OVERLAP_M, chained, gaps, opened
from hdvplan.road.crs import refuse_far_edges
from hdvplan.road.limits import About, Limits
from hdvplan.road.path import ReferencePath, project_many
from hdvplan.road.pieces import Kerb, between
from hdvplan.road.regions import OPEN_M
from hdvplan.road.street import BEYOND_M

_LOCATED_M = 2.0  # pieces of a drawn line are located at points this near to each other
_SAMPLES_M = 1.0  # of the path, for the first guess of a foot
_STRAY = 3.0  # so many times as far along the road as along the edge: the foot has jumped to another part of the road
_AWAY = 2.0  # so many times as far from its arm of the road as where another one came nearer, and as from that: a line has left it
_SAME_M = 0.01  # from the road's line over a metre or two: no edge, but that line again
_AT_END_M = 1.0  # from an edge across the street: a line that ends there was drawn to end on it, and nobody drives onto a wall


def drawn_kerbs(
    path: ReferencePath, edges: tuple[FloatArray, ...], given: About | None = None
) -> tuple[tuple[Kerb, ...], tuple[FloatArray, ...], tuple[str, ...]]:
    """Return the kerbs that drawn lines, (n, 2) each [m], make beside ``path``, the lines in them that nobody drew, and notes on both.

    Names of lines do not count, only where they lie. A piece that goes over from one side of the road to the other beyond an end closes the
    street, as a kerb by itself; one that the road's own line ends on is where a drawn area ends, and the street is open there. Over a gap
    a kerb is straight; beyond the ends kerbs go on as the ``given`` line does, or the path.

    Raises:
        RoadError: a line crosses the road between its ends, and does not just close an area there; all lines are somewhere else.

    """
    about = About.smooth(path)
    if edges:
        refuse_far_edges(about.points, np.concatenate(edges))
    longer = path.extended(BEYOND_M, BEYOND_M)
    line = None if given is None or path.closed else shapely.LineString(_further(given.points, given.ends))
    sided = [_sided(longer, path, edge, line) for edge in edges]
    pieces = [piece for found, _ in sided for piece in found]
    open_place = about.kerbs(Limits.constant(OPEN_M, OPEN_M, path.length))
    kerbs: list[Kerb] = []
    undrawn, ends = list[FloatArray](), (given or about).ends
    notes: list[str] = []
    for left, side in ((True, "left"), (False, "right")):
        own = [piece for piece in pieces if piece.left is left and piece.goes_on]
        chains, bridges = chained(own, path)
        found = [part for kerb in chains for part in within_lap(kerb, path)]
        place, is_open = [kerb for kerb in open_place if kerb.left is left], (False, False)
        if not path.closed:
            found, is_open = opened(found, place, path, ends)
        assumed = [] if found else place
        kerbs += found + assumed
        undrawn += [bridge.ends for bridge in bridges] + [kerb.points if path.closed else _further(kerb.points, ends) for kerb in assumed]
        if not path.closed or not own:  # around a closed road the ends of what is drawn are bridged as well
            notes += gaps(own, path.length, side, is_open)
        notes += [bridge.note(side, path) for bridge in bridges]
    kerbs += [piece for piece in pieces if not piece.goes_on]
    return tuple(kerbs), tuple(undrawn), (*notes, *dict.fromkeys(note for _, told in sided for note in told))


def _further(points: FloatArray, ends: FloatArray) -> FloatArray:
    """Return a line (n, 2) beside an open road as far as bodies reach beyond the ends of that, which have these directions (2, 2) [m]."""
    first, last = BEYOND_M * ends
    return np.vstack([points[0] - first, points, points[-1] + last])


def _sided(longer: ReferencePath, path: ReferencePath, edge: FloatArray, line: shapely.LineString | None) -> tuple[list[Kerb], list[str]]:
    """Return the parts of one drawn line that lie on one side of the road, in its direction, those across it, and notes on these.

    What lies beyond the road's ends belongs to the part that it goes on from: the street may bend there, and the path does not. Where a
    line goes over to the other side, the piece that crosses the road, or what it goes straight on to, is a kerb that does not go on.
    """
    points, drawn = densely(edge)
    # corners of a ring, its first one twice; along a closed road its arclength there is another
    ring = not path.closed and len(edge) > 3 and np.array_equal(edge[0], edge[-1])  # noqa: PLR2004
    number, s, offset = _located(longer, points)
    points, drawn = points[number], drawn[number]
    offset = offset if line is None else _as_given(points, offset, line)
    left_out = np.append(np.diff(number) == 0, ring)  # by the point that a piece begins at
    beside = np.full(len(points), fill_value=True) if path.closed else (s > 0.0) & (s < path.length)
    if not np.any(beside):
        beside = ~beside
    same = np.flatnonzero(beside[1:] & (np.abs(offset[1:]) < _SAME_M) & (np.abs(offset[:-1]) < _SAME_M) & (np.diff(number) > 0))
    if same.size:
        msg = f"an edge lies on the road's line at s = {s[same[0]]:z.1f} m"
        raise RoadError(msg, hint="take what is driven along out of the edges", s_m=float(s[same[0]]))
    if ring:
        first = int(np.argmax(beside))
        count = len(s) - (abs(s[-1] - s[0]) <= _LOCATED_M)  # its last point is beside another arm of the road, or the first one again
        columns = (points, s, offset, beside, drawn, left_out)
        points, s, offset, beside, drawn, left_out = (np.roll(column[:count], -first, axis=0) for column in columns)
    found, notes = [], []
    on = np.flatnonzero(beside | left_out | np.roll(left_out, 1))
    for crossing in _crossings(offset, on, left_out, ring=ring):
        at = _crossed_at(s, offset, crossing)
        beyond = np.full(len(at), -np.inf) if path.closed else np.maximum(-at, at - path.length)
        furthest = int(np.argmax(beyond))
        far, starts = float(beyond[furthest]), bool(at[furthest] < 0.5 * path.length)
        if far < -_AT_END_M:
            _refuse_wall(path, s, offset, int(crossing[0]))
        across = drawn == drawn[crossing[furthest]]
        left_out = left_out | across  # another array: crossings are still being found by this one
        if abs(far) <= _AT_END_M:
            notes.append(f"an edge closes the street where the line {'starts' if starts else 'ends'}: it is taken as open there")
        elif 0.0 < far < BEYOND_M:
            notes.append(f"an edge closes the street {far:.1f} m {'before the line starts' if starts else 'beyond the end of the line'}")
            piece = np.flatnonzero(across & ~np.roll(across, 1))[0] + np.arange(np.count_nonzero(across) + 1)
            found.append(_closing(path, 0.0 if starts else path.length, points[piece % len(points)], s[piece % len(points)]))
    for part in _runs(left_out, ring=ring):
        inside = part[beside[part]]
        if len(part) > 1 and len(inside) and (path.closed or (np.min(s[part]) < path.length + BEYOND_M and np.max(s[part]) > -BEYOND_M)):
            told = inside if len(inside) > 1 else part
            left, own = bool(offset[inside[0]] > 0.0), points[part]
            around = len(own) > 3 and np.array_equal(own[0], own[-1]) and abs(s[part[-1]] - s[part[0]]) <= _LOCATED_M  # noqa: PLR2004 - as above
            leads_on = shapely.is_ccw(shapely.LinearRing(own)) == left if around else _leads_on(s[told], offset[told])
            along = part if leads_on else part[::-1]
            lap = path.length * np.floor(s[along[0]] / path.length) if path.closed else 0.0
            found.append(Kerb(points[along], rising(s[along], offset[along]) - lap, left))
    return found, notes


def _as_given(points: FloatArray, offset: FloatArray, line: shapely.LineString) -> FloatArray:
    """Return offsets of points of an edge with the side on which they lie of the ``line`` as it was given.

    Where that turns sharply, the path is smoothed across the corner of the kerb inside: what lies beyond the path did not cross the line.
    """
    over = np.flatnonzero(np.diff(offset > 0.0) & np.any(points[1:] != points[:-1], axis=1))  # else beside another arm of the road
    over = over[~shapely.intersects(line, shapely.linestrings(np.stack([points[over], points[over + 1]], axis=1)))]
    if not over.size:
        return offset
    turned = np.where(np.searchsorted(over, np.arange(len(offset))) % 2, -offset, offset)
    chords = np.stack([shapely.get_coordinates(line)[:-1], shapely.get_coordinates(line)[1:]], axis=1)
    nearest = chords[shapely.STRtree(np.asarray(shapely.linestrings(chords))).nearest(np.asarray(shapely.points(points)))]
    (along_x, along_y), (x, y) = (nearest[:, 1] - nearest[:, 0]).T, (points - nearest[:, 0]).T
    return turned if np.sum(np.sign(turned * (along_x * y - along_y * x))) >= 0.0 else -turned


def _crossings(offset: FloatArray, on: IntArray, over: BoolArray, *, ring: bool) -> Iterator[IntArray]:
    """Yield from one to the next point ``on`` of a line that lie on two sides of the road the points behind which it crosses that."""
    for before, after in zip(on, np.append(on[1:], on[0] + len(offset)) if ring else on[1:], strict=False):
        between = np.arange(before, after + 1) % len(offset)
        crossing = between[:-1][np.diff(offset[between] > 0.0) & ~over[between[:-1]]]
        if len(crossing) % 2:
            yield crossing


def _crossed_at(s: FloatArray, offset: FloatArray, crossing: IntArray) -> FloatArray:
    """Return the arclengths at which pieces that begin at points ``crossing`` of a line cross the road [m]."""
    after = (crossing + 1) % len(s)
    return np.asarray(s[crossing] + (s[after] - s[crossing]) * offset[crossing] / (offset[crossing] - offset[after]))


def _closing(path: ReferencePath, end: float, points: FloatArray, s: FloatArray) -> Kerb:
    """Return the kerb of a piece that closes the street beyond an ``end`` of the road [m], which lies on its street's side."""
    order = slice(None, None, 1 if s[0] <= s[-1] else -1)
    points, s = points[order], np.maximum.accumulate(s[order])
    ahead, back = points[-1] - points[0], np.stack(path.to_plane(end, 0.0)) - points[0]
    return Kerb(points, s, bool(ahead[0] * back[1] < ahead[1] * back[0]), goes_on=False)


def _leads_on(s: FloatArray, offset: FloatArray) -> bool:
    """Return whether a line is drawn in the direction of the road: where it is near it, for it may begin and end in side streets."""
    weights = _weights(offset)
    return bool(np.sum(np.diff(s) * np.minimum(weights[1:], weights[:-1])) >= 0.0)


def _weights(offset: FloatArray) -> FloatArray:
    """Return how much places count for the arclengths of their line: little where they are far from the road."""
    return np.asarray((1.0 + offset**2) ** -2)


def rising(s: FloatArray, offset: FloatArray) -> FloatArray:
    """Return arclengths beside the points of a line that never fall.

    Round a side street in a bend the feet run far ahead of where the line comes back to the road: places near the road count there.
    """
    ahead: FloatArray = np.maximum.accumulate(s)
    if np.max(ahead - np.minimum.accumulate(s[::-1])[::-1]) <= OVERLAP_M:
        return ahead
    return np.asarray(scipy.optimize.isotonic_regression(s, weights=_weights(offset)).x)


def _refuse_wall(path: ReferencePath, s: FloatArray, offset: FloatArray, crossing: int) -> None:
    """Refuse a line that crosses the road behind its point ``crossing``, unless both its sides end there: the end of an area."""
    here, leaps = float(s[crossing]), np.flatnonzero(np.abs(np.diff(s)) > 2.0 * _STRAY * _LOCATED_M) + 1
    arm = np.searchsorted(leaps, np.arange(len(s)), side="right")  # of the road that a point is beside
    s, offset = s[arm == arm[crossing]], offset[arm == arm[crossing]]
    for way in (1.0, -1.0):  # all of the line lies before, or beyond
        along = way * (here - s)
        if all(np.max(along[side], initial=-np.inf) > OVERLAP_M for side in (offset > 0.0, offset <= 0.0)) and np.min(along) > -OVERLAP_M:
            return
    at = here % path.length if path.closed else here
    msg = f"a line that is drawn as an edge crosses the road's line at s = {at:z.1f} m: it would close the street"
    raise RoadError(msg, hint="take it out of the edges, or break it there", s_m=at)


def densely(edge: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return a line's points with others in between, and which piece of the line begins at each of them."""
    step = np.diff(edge, axis=0)
    counts = np.maximum(np.ceil(np.hypot(*step.T) / _LOCATED_M).astype(np.int64), 1)
    piece, part = counted_up(counts)
    return np.vstack([edge[piece] + (part / counts[piece])[:, None] * step[piece], edge[-1:]]), np.append(piece, len(step))


def _runs(left_out: BoolArray, *, ring: bool) -> list[IntArray]:
    """Return the numbers of the points of each part of a line, some of whose pieces are left out."""
    count = len(left_out)
    if not np.any(left_out):
        return [np.arange(count + ring) % count]
    first = int(np.flatnonzero(left_out & ~np.roll(left_out, -1))[0]) + 1 if ring else 0  # behind a piece that is left out
    order = np.roll(np.arange(count), -first)
    return [order[part] for part in np.split(np.arange(count), np.flatnonzero(left_out[order][: count - 1]) + 1)]


def _located(path: ReferencePath, points: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the numbers of a line's points, and their arclengths, a closed road's lap after lap, and signed offsets [m].

    A point at which the line goes over from one arm of the road to another is there twice, beside each of them.
    """
    near, reach = _near(path, points)
    over = np.flatnonzero(np.abs(np.diff(near)) > reach) + 1
    number = np.insert(np.arange(len(points)), over, over)
    near, points = np.insert(near, over, near[over - 1]), points[number]
    before = _laps(near - 0.5 * path.length, path)
    near -= before
    s, offset = project_many(path, points[:, 0], points[:, 1], near)[:2]
    lost = ~np.isfinite(offset)
    at = path.at(near)
    across = (points[:, 1] - at.y) * np.cos(at.heading) - (points[:, 0] - at.x) * np.sin(at.heading)
    return number, np.where(lost, near, s) + before, np.where(lost, across, offset)


def _near(path: ReferencePath, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return about where beside the road a line's points are, and how far from the one before the next may be on the same arm of it [m].

    The line goes over to another arm where it leaves its own, as a kerb does from the arm that a turn at a roundabout comes from to the one
    that it goes to; where the road only passes over itself it stays.
    """
    first, last = (0.0, path.length) if path.closed else (path.s_first, path.s_last)
    grid = np.linspace(first, last, int(np.ceil((last - first) / _SAMPLES_M)) + 1)
    here = np.stack([path.at(grid).x, path.at(grid).y], axis=1)
    nearest = scipy.spatial.KDTree(here).query(points)[1]
    near, apart = grid[nearest], np.hypot(*(here[nearest] - points).T)
    reach: FloatArray = _STRAY * np.hypot(*np.diff(points, axis=0).T) + _LOCATED_M

    def along(order: range, begin: int) -> tuple[list[tuple[float, float]], bool]:
        """Return where on the arm beside point ``begin``, and how far from it, points are until one is there anyway; whether they stay."""
        found, place = list[tuple[float, float]](), float(near[begin])
        for point in order:
            within = reach[point - (order.step > 0)]
            if abs(near[point] + _laps(place - near[point], path) - place) <= within:
                break
            places = grid + _laps(place - grid, path)
            around = np.flatnonzero(np.abs(places - place) <= within)
            distance = np.hypot(*(here[around] - points[point]).T)
            place, far = float(places[around[np.argmin(distance)]]), float(np.min(distance))
            found.append((place, far))
            if far > _AWAY * max(apart[point], apart[begin]):
                return found, False
        return found, True

    for i in range(1, len(points)):
        near[i] += _laps(near[i - 1] - near[i], path)
        found, stays = along(range(i, len(points)), i - 1)
        for point, own in enumerate(found if stays else (), start=i):
            near[point], apart[point] = own
        before, always = ([], True) if stays else along(range(i - 1, -1, -1), i)
        for point, other in zip(range(i - 1, -1, -1), before, strict=False):
            if not always and other[1] >= apart[point]:
                break  # further back the line is nearer to the arm that it leaves
            near[point], apart[point] = other
    return near, reach


def _laps(distance: FloatArray, path: ReferencePath) -> FloatArray:
    """Return the whole laps nearest to a distance [m]; an open road has none."""
    return path.length * np.round(distance / path.length) if path.closed else np.zeros_like(distance)


def within_lap(kerb: Kerb, path: ReferencePath) -> list[Kerb]:
    """Return what a kerb, which begins in a closed road's first lap and may go over the seam, is between the seam and the next one."""
    if not path.closed:
        return [kerb]
    kerb = between(kerb, float(kerb.s[0]), min(float(kerb.s[0]) + path.length, float(kerb.s[-1])))
    laps = [replace(kerb, s=kerb.s + lap) for lap in (-path.length, 0.0, path.length)]
    if kerb.goes_on:
        laps = [replace(kerb, points=np.concatenate([one.points for one in laps]), s=np.concatenate([one.s for one in laps]))]
    parts = [between(one, 0.0, path.length) for one in laps]
    return [part for part in parts if len(part.points) > 1]
