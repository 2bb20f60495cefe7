"""The line as given: points are samples of a curve, or corners, and the line goes through every one of them.

Points that turn alike sample a bend: circles through three of them give tangents, two arcs with one tangent join two of them, and
where curvature changes over more than a chord, a curve on which it does so steadily. Between such points the line is within 3 cm of
straights, arcs and clothoids of three chords or more, within 5 cm where a point stands for over 30 degrees. Of shorter ones no
circle of three points is free of their neighbours: there the line was up to 20 cm off, at ten points a circle 11 m apart.
A bend runs out beside, on its last circle and a tangent. A point that turns by itself is a corner.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from hdvplan.arrays import BoolArray, FloatArray, IntArray
from hdvplan.road.arcs import arcs_and_tangent, biarcs, half_angle, sampled, wrapped
from hdvplan.road.options import Corners

_SAME_M = 0.02  # points this close repeat their neighbour
_CHORD_M = 2e-4  # from the dense points' chords to the curve
_CORNER = math.radians(20.0)  # smaller kinks are how straights are drawn, not corners of streets
_UNEVEN = 2.0  # chords of one bend: a longer one counts so many times as long as its neighbour
_WIDEST = math.radians(70.0)  # eight points a circle turn by 45 degrees, by half as much again where the bend begins
_SAGITTA_M = 1.25  # of a bend's chord: eight points 12 m apart on a circle have 1.19 m, two corners 40 m apart 3.9 m
_ALONE = 3.0  # a point beside a bend that turns so many times as much as the bend does there turns by itself
_WIDE, _BLOCK_M = math.radians(32.0), 13.5  # points that turn by more, and stand further apart, are corners of a block
_RUN_OUT_M = 4.0  # the same where a bend runs out on its tangent: 12 m of an arc of 16 m leave it by 4.3 m
_BULGE_M = 1.5  # of a chord between points that are uneven: further off it is straight, for nobody has drawn such a bend
_STEADY = 0.45  # chords more than one over which curvature changes, from which on it changes steadily
_MANY = 9.0  # chords, as good as infinitely many
_ROUNDING = 1e-14  # [rad^2] two turns of points that are meant to lie on a straight
_KINK = 1e-3  # [rad] below which a point is no kink: 3 m beside it, a kerb's ends are 3 mm apart


_T = TypeVar("_T", np.float64, np.bool_)


@dataclass(frozen=True)
class GivenLine:
    """A line through all given points, dense where it bends.

    ``points`` has shape (m, 2) [m], chords within 0.2 mm of the line; ``number`` (m,) is the position among the given
    points, linear in arclength between two of them; ``corners`` has number and turn [rad], left positive, of every kink
    of 20 degrees and more; ``sharp`` (m,) says where a kink is.
    """

    points: FloatArray
    number: FloatArray
    corners: tuple[tuple[int, float], ...]
    sharp: BoolArray
    closed: bool


@dataclass(frozen=True)
class _Chain:
    """Distinct points, shape (n, 2) [m], and chords from them (0 m after an open line's last): length, direction, turn before [rad]."""

    points: FloatArray
    length: FloatArray
    direction: FloatArray
    turn: FloatArray
    closed: bool

    def at(self, values: NDArray[_T], step: int) -> NDArray[_T]:
        """Return the values of the points or chords ``step`` further on; zero beyond the ends."""
        moved = np.roll(values, -step)
        if not self.closed:
            moved[len(moved) - step if step > 0 else 0 : None if step > 0 else -step] = 0
        return moved


@dataclass(frozen=True)
class _Bends:
    """Which chords are bent, which points are in a bend, and the tangent's angles [rad] to both chords; their sum is the turn."""

    smooth: BoolArray
    steady: FloatArray
    inside: BoolArray
    into: FloatArray
    out: FloatArray


def given_line(points: FloatArray, *, closed: bool, corners: Corners = Corners.AUTO) -> GivenLine:
    """Return the line through points, shape (n, 2) [m], n >= 2; a closed one repeats its first point at the end.

    A point within 2 cm of the one before it lies in its place.
    """
    kept = _distinct(points, closed=closed)
    number = kept.astype(float)
    chain = _chain(points[kept], closed=closed)
    core = _alike(chain) & (corners is not Corners.SHARP)
    fixed = np.zeros(len(kept), dtype=bool)
    if corners is Corners.ROUND:
        chain, number, fixed = _with_ends(chain, number, core, float(len(points) - 1))
        core = np.full(len(number), True)
        if not closed:
            core[[0, -2, -1]] = False
    bends = _bends(chain, core, fixed)
    pieces = _pieces(chain, bends)
    return _read(chain, pieces, bends.steady, number, np.append(number[1:], len(points) - 1.0))


def _distinct(points: FloatArray, *, closed: bool) -> IntArray:
    """Return the numbers of the points that do not repeat the one before; of a closed line, without its end."""
    kept, places = [0], points.tolist()
    for at, place in enumerate(places):
        if math.dist(place, places[kept[-1]]) >= _SAME_M:
            kept.append(at)
    numbers = np.array(kept) if len(kept) > 1 else np.arange(len(points))
    while closed and len(numbers) > 1 and math.dist(points[numbers[-1]], points[0]) < _SAME_M:
        numbers = numbers[:-1]
    return numbers


def _chain(points: FloatArray, *, closed: bool) -> _Chain:
    chord = np.roll(points, -1, axis=0) - points
    direction = np.arctan2(chord[:, 1], chord[:, 0])
    turn = wrapped(direction - np.roll(direction, 1))
    length = np.hypot(*chord.T)
    if not closed:
        length[-1] = turn[0] = turn[-1] = 0.0
        direction[-1] = direction[-2]
    return _Chain(points, length, direction, turn, closed)


def _alike(chain: _Chain) -> BoolArray:
    """Return which chords lie between two points that turn alike.

    On a circle a point turns by half of either chord's arc. Where the bend begins after the point before, it may be only
    half of the inner chord's, or all of the outer's: so the turns may differ, and by more where chords are uneven.
    """
    here, ahead = np.abs(chain.turn), np.abs(chain.at(chain.turn, 1))
    length = np.maximum(chain.length, 1e-9)
    before, after = (np.minimum(chain.at(chain.length, step), _UNEVEN * length) for step in (-1, 1))
    least, most = np.minimum(here, ahead), np.maximum(here, ahead)
    alike = (here * length <= ahead * (length + 2.0 * before)) & (ahead * length <= here * (length + 2.0 * after))
    plausible = (most < _WIDEST) & (length * least / 8.0 <= _SAGITTA_M) & ((least < _WIDE) | (length < _BLOCK_M))
    core = (chain.turn * chain.at(chain.turn, 1) > _ROUNDING) & alike & plausible
    inside = core | chain.at(core, -1)
    even = chain.length <= _UNEVEN * np.maximum(chain.at(chain.length, -1), chain.at(chain.length, 1))
    between = ~inside & (here < _CORNER) & even & chain.at(even, -1) & chain.at(inside, 1) & chain.at(inside, -1)
    return core | between | chain.at(between, 1)


def _with_ends(chain: _Chain, number: FloatArray, core: BoolArray, last: float) -> tuple[_Chain, FloatArray, BoolArray]:
    """Return the chain with the ends of the straights in its chords, so that points that turn by themselves bend only beside them."""
    straight = np.flatnonzero(~core & (chain.length > 0.0))
    turn = np.abs([chain.turn[straight], chain.at(chain.turn, 1)[straight]])
    reach = np.minimum(1.0 / 3.0, 8.0 * _SAGITTA_M / np.maximum(turn * chain.length[straight], _KINK))
    share = np.stack([reach[0], 1.0 - reach[1]], axis=1)
    ahead = np.roll(chain.points, -1, axis=0)[straight]
    added = chain.points[straight, None] + share[..., None] * (ahead - chain.points[straight])[:, None]
    where = np.repeat(straight + 1, 2)
    numbers = (np.append(number[1:], last)[straight] - 1.0)[:, None] + share
    fixed = np.insert(np.zeros(len(number), dtype=bool), where, values=True)
    longer = np.insert(chain.points, where, added.reshape(-1, 2), axis=0)
    return _chain(longer, closed=chain.closed), np.insert(number, where, numbers.ravel()), fixed


def _bends(chain: _Chain, core: BoolArray, fixed: BoolArray) -> _Bends:
    """Return the bends with their tangents.

    Where curvature rises along the line, a tangent is bounded: it turns from the chord ahead at least as much as that of the circle
    through the point and its neighbours, and no more than the circles of the points ahead and behind let it. Where the curvature jumps
    within a chord it is this bound; where it changes steadily, all three circles weighted, so that the tangent of a clothoid is exact.
    """
    inside = core | chain.at(core, -1)
    soft = inside | (np.abs(chain.turn) < _CORNER)
    ahead, behind = chain.length, chain.at(chain.length, -1)
    even = (ahead > 0.0) & (ahead <= _UNEVEN * np.maximum(behind, chain.at(ahead, 1)))
    beside = inside | chain.at(inside, -1) | chain.at(inside, 1)
    linked = core | (even & soft & chain.at(soft, 1) & beside & chain.at(beside, 1) & ~_turns_alone(chain, inside))
    linked_before = chain.at(linked, -1)
    own_ahead = np.where(core, ahead, np.minimum(ahead, behind))  # a chord that is straight in part counts no more than the bend's
    own_behind = np.where(chain.at(core, -1), behind, np.minimum(ahead, behind))
    span = np.sqrt(np.maximum(own_ahead**2 + own_behind**2 + 2.0 * own_ahead * own_behind * np.cos(chain.turn), 1e-12))
    circle = np.where(soft, 2.0 * np.sin(chain.turn) / span, 0.0)
    neighbour = np.where(core, chain.at(circle, 1), chain.at(circle, -1))
    bend = np.where(inside & ~(core & chain.at(core, -1)) & (np.abs(neighbour) < np.abs(circle)), neighbour, circle)
    if not chain.closed and len(bend) > 3:  # noqa: PLR2004 - no point tells how an open line goes on: curvature as before, or falling
        for end, one, two in ((0, 1, 2), (-1, -2, -3)):
            bend[end] = np.median([0.0, bend[one], 2.0 * bend[one] - bend[two]])
    following, previous = np.where(linked, chain.at(bend, 1), 0.0), np.where(linked_before, chain.at(bend, -1), 0.0)
    forward, backward = half_angle(following, ahead), chain.turn - half_angle(previous, behind)
    central = half_angle(circle, own_ahead)
    rising, falling = (previous <= bend) & (bend <= following), (previous >= bend) & (bend >= following)
    bound = np.where(rising, np.minimum(forward, backward), np.where(falling, np.maximum(forward, backward), central))
    weighted = (4.0 * central + forward + backward) / 6.0
    weighted = np.where(rising | falling, np.clip(weighted, np.minimum(central, bound), np.maximum(central, bound)), weighted)
    spread = _spread(chain, linked, previous, bend, following)
    steady = np.clip((spread - 1.0) / _STEADY, 0.0, 1.0) * linked
    spread = np.minimum(spread, chain.at(spread, -1))
    spread = np.where(rising | falling, spread, np.minimum(chain.at(spread, -1), chain.at(spread, 1)))
    out = bound + np.clip((spread - 1.0) / _STEADY, 0.0, 1.0) * (weighted - bound)
    straight = np.where(linked, chain.turn, np.where(linked_before, 0.0, out))  # a point beside a bend turns into it
    out = np.where(fixed, 0.0, np.where(inside | (linked & linked_before), out, straight))
    if not chain.closed:
        out[[0, -1]] = forward[0], backward[-1]
    return _Bends(linked, steady, inside, chain.turn - out, out)


def _turns_alone(chain: _Chain, inside: BoolArray) -> BoolArray:
    """Return which chords lie between a bend and a point beside it that turns far more than the bend does there: a corner."""
    here, ahead = np.abs(chain.turn), np.abs(chain.at(chain.turn, 1))
    leaves, enters = inside & ~chain.at(inside, 1), ~inside & chain.at(inside, 1)
    return (leaves & (ahead > _ALONE * here + _KINK)) | (enters & (here > _ALONE * ahead + _KINK))


def _spread(chain: _Chain, linked: BoolArray, previous: FloatArray, bend: FloatArray, following: FloatArray) -> FloatArray:
    """Return over how many chords curvature changes around a chord: 1 where it jumps within it, else more.

    Of circles through three points each, those at a chord's ends contain squares of the parts of it on either side of a jump.
    """
    beyond = chain.at(following, 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        parts = np.sqrt(np.abs(2.0 * np.stack([bend - previous, beyond - following]) / (beyond - previous)))
    spread = np.where(linked, np.minimum(np.nan_to_num(parts[0] + parts[1], nan=_MANY), _MANY), 1.0)
    if not chain.closed:  # beyond the ends nothing is known
        spread[[0, -2]] = np.where(linked[[0, -2]], _MANY, 1.0)
    return spread


def _pieces(chain: _Chain, bends: _Bends) -> FloatArray:
    """Return three pieces of every chord, shape (n, 3, 5): start x and y [m], heading [rad], length [m], curvature [1/m]."""
    c, direction = chain.length, chain.direction
    start, end = chain.points, np.roll(chain.points, -1, axis=0)
    ahead = chain.at(bends.inside, 1)
    leaves, enters = bends.out, chain.at(bends.into, 1)  # angles of the tangents at both ends to the chord
    near = [np.where(chain.at(bends.smooth, step), chain.at(c, step), np.minimum(c, chain.at(c, step))) for step in (-1, 1)]
    curvature = 2.0 * np.sin([bends.into, chain.at(bends.out, 1)]) / np.maximum(near, _SAME_M)  # of the bend before and after the chord
    straight = np.zeros((len(c), 3, 5))
    straight[:, 0] = np.column_stack([start, direction, c, np.zeros(len(c))])
    straight[:, 1:, 2] = direction[:, None]
    pieces = straight.copy()
    here = np.flatnonzero((bends.smooth | bends.inside | ahead) & (c > 0.0))
    smooth, one, other = bends.smooth[here], bends.inside[here], ahead[here]
    both = np.where(smooth | one, leaves[here], enters[here]), np.where(smooth | other, enters[here], leaves[here])
    arcs = biarcs(start[here], direction[here], c[here], *both, curvature[:, here] * (smooth | (one & other)))
    headings = direction[here] - leaves[here], direction[here] + enters[here]
    runs, right = arcs_and_tangent(start[here], end[here], headings, np.where([one, other], curvature[:, here], 0.0))
    right &= ~smooth
    pieces[here] = np.where(right[:, None, None], runs, arcs)
    joints = pieces[:, 1:, :2] - start[:, None]
    bulge = np.abs(joints[..., 1] * np.cos(direction)[:, None] - joints[..., 0] * np.sin(direction)[:, None])
    allowed = np.full(len(c), _BULGE_M)
    allowed[here[right & (one != other)]] = _RUN_OUT_M
    last = here[~right & ~smooth & (one != other) & ~np.bool_(chain.closed) & np.isin(here, (0, len(c) - 2))]
    allowed[last] = 0.0  # the bend's tangent does not reach the line's end: nothing tells that it bends there
    far = np.any((bulge > allowed[:, None]) & (pieces[:, 1:, 3] > 0.0), axis=1)
    return np.where(far[:, None, None], straight, pieces)


def _steadily(biarcs: FloatArray, share: FloatArray) -> FloatArray:
    """Return how far left of two arcs a curve with the same ends lies whose curvature changes linearly, of the length squared [1/m]."""
    length, (first, second) = np.sum(biarcs[..., 3], axis=1), biarcs[:, :2, 4].T
    joint = biarcs[:, 0, 3] / length
    area, moment = first * joint + second * (1.0 - joint), 0.5 * (first * joint**2 + second * (1.0 - joint**2))
    begin, end = 4.0 * area - 6.0 * moment, 6.0 * moment - 2.0 * area
    linear = begin * share**2 / 2.0 + (end - begin) * share**3 / 6.0
    arcs = 0.5 * first * share**2 + 0.5 * (second - first) * np.maximum(share - joint, 0.0) ** 2
    return np.asarray(linear - arcs)


def _read(chain: _Chain, pieces: FloatArray, steady: FloatArray, number: FloatArray, following: FloatArray) -> GivenLine:
    """Return the dense line of the pieces; a chord runs from ``number``, of points in one place the last's, to the ``following``."""
    chords = len(number) if chain.closed else len(number) - 1
    points, chord, share = sampled(pieces[:chords], _CHORD_M)
    beside = (steady * chain.length**2)[chord] * _steadily(pieces[chord], share)
    points += beside[:, None] * np.stack([-np.sin(chain.direction[chord]), np.cos(chain.direction[chord])], axis=1)
    base = np.maximum(number, np.ceil(following) - 1.0)
    numbers = base[chord] + share * (following - base)[chord]
    first = np.flatnonzero(np.diff(chord, prepend=-1))  # the given points
    points[first], numbers[first] = chain.points[:chords], base[:chords]
    kink = wrapped(pieces[:, 0, 2] - np.roll(pieces[:, 2, 2] + pieces[:, 2, 3] * pieces[:, 2, 4], 1))
    if not chain.closed:
        kink[[0, -1]] = 0.0
    sharp = np.zeros(len(numbers), dtype=bool)
    sharp[first] = np.abs(kink[:chords]) > _KINK
    again = np.flatnonzero((base > number)[:chords])
    points, numbers = np.insert(points, first[again], chain.points[again], axis=0), np.insert(numbers, first[again], number[again])
    sharp = np.insert(sharp, first[again], sharp[first[again]])
    ends = following[-1:] if chain.closed else np.unique([number[-1], following[-1]])
    points = np.vstack([points, np.repeat(chain.points[[chords % len(number)]], len(ends), axis=0)])
    sharp = np.append(sharp, np.full(len(ends), chain.closed and sharp[0]))
    corners = tuple((int(number[at]), float(kink[at])) for at in np.flatnonzero(np.abs(kink) >= _CORNER))
    return GivenLine(points, np.append(numbers, ends), corners, sharp, chain.closed)
