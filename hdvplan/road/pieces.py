"""A kerb, parts of it, and its pieces as the core takes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import shapely

from hdvplan import core
from hdvplan.arrays import BoolArray, FloatArray, Records, turns_of

PIECE = core.record("hdv_piece")
STREET = core.record("hdv_street")
_TOGETHER = core.number("HDV_TOGETHER")  # pieces of a block
_ALONGSIDE = {name: np.dtype((np.float64, _TOGETHER)) for name in ("x", "y", "cos", "sin", "length")}
BLOCK = core.record("hdv_block", **_ALONGSIDE, numbers=np.dtype((np.int64, _TOGETHER)))
_SHORTEST_M = 1e-6  # two points of a kerb nearer than this are one
BACK = -1.0 + 1e-9  # cosine of a turn: a kerb that goes back on itself has no width there
_LOOP_M = 0.1  # around a loop that nobody drew: points surveyed twice and unions leave them, and within, left is right
_RUN_M = 0.25  # before and behind a point, to where the kerb runs there: single pieces of millimetres face anywhere
_STRAIGHT = 1e-7  # [rad] of turn: less is rounding of coordinates of a thousand kilometres, and no corner
_WALL = 0.25  # metres of line a metre, below which a piece is a wall across the street


@dataclass(frozen=True)
class Kerb:
    """One side of a street: ``points`` (n, 2) [m] in the direction of the line, and the line's arclengths ``s`` (n,) beside them [m].

    ``wheels`` tells the kerb that wheels must keep, which overhangs may cross, from the one that bounds all of a body. Where a kerb ends
    at an open road's ends it goes on straight, at a closed one's seam in the next lap, unless it is a shorter one of several on its side.
    """

    points: FloatArray
    s: FloatArray
    left: bool
    wheels: bool = False
    goes_on: bool = True

    def reversed(self, length: float) -> Kerb:
        """Return the kerb along the line driven the other way, which is ``length`` long [m]."""
        return replace(self, points=self.points[::-1], s=length - self.s[::-1], left=not self.left)

    def shifted(self, by: float) -> Kerb:
        """Return the kerb with arclengths that count from ``by`` [m]."""
        return replace(self, s=self.s - by)


class Pieces(NamedTuple):
    """Kerbs as the core takes them: ``record`` (1,) of ``STREET`` holds addresses of the others."""

    pieces: Records  # (n,) of ``PIECE``
    reach: FloatArray  # (n,) [m]
    blocks: Records  # (b,) of ``BLOCK``
    block_reach: FloatArray  # (b,) [m]
    record: Records


def pieces_of(kerbs: Sequence[Kerb], end: float = np.inf) -> Pieces:
    """Return the pieces of kerbs beside a road that ends at arclength ``end`` [m]."""
    return laid_out(in_order(kerbs, end), end)


def in_order(kerbs: Sequence[Kerb], end: float) -> Records:
    """Return the pieces (n,) of kerbs beside a road that ends at arclength ``end`` [m], in order of s."""
    of = [_pieces(kerb) for kerb in kerbs]
    found = np.concatenate([np.zeros(0, PIECE), *of])
    found["kerb"] = np.repeat(np.arange(len(of)), [len(pieces) for pieces in of])
    found["corner"] |= found["s_begin"] == end  # a body that has left the road in part keeps beside its side what is left of the kerb
    return found[np.argsort(found["s_low"], kind="stable")]


def laid_out(pieces: Records, end: float = np.inf) -> Pieces:
    """Return pieces (n,) of ``PIECE`` as the core takes them, in order of s, beside a road that ends at arclength ``end`` [m]."""
    found = np.ascontiguousarray(pieces[np.argsort(pieces["s_low"], kind="stable")])
    reach = np.maximum.accumulate(found["s_high"])
    blocks = _blocks(found)
    block_reach = np.maximum.accumulate(blocks["s_high"])
    arrays = (found, reach, blocks, block_reach)
    own = [core.address(array) for array in arrays]
    return Pieces(*arrays, np.array([(*own[:2], len(found), *own[2:], len(blocks), end, 0.0)], STREET))


def _blocks(pieces: Records) -> Records:
    """Return the blocks of pieces, each of one kerb, in order of s."""
    numbers = np.argsort(pieces["kerb"], kind="stable")
    kerbs = np.flatnonzero(np.diff(pieces["kerb"][numbers], prepend=-1))  # where each begins
    within = np.arange(len(numbers)) - np.repeat(kerbs, np.diff(kerbs, append=len(numbers)))
    first = np.flatnonzero(within % _TOGETHER == 0)
    found = np.zeros(len(first), BLOCK)
    found["count"] = count = np.diff(first, append=len(numbers))
    places = np.arange(_TOGETHER)
    found["numbers"] = numbers[first[:, None] + np.minimum(places, count[:, None] - 1)]
    of = pieces[found["numbers"]]
    for name in _ALONGSIDE:
        found[name] = of[name]
    for name in ("kerb", "left", "wheels"):
        found[name] = of[name][:, 0]
    found["s_low"], found["s_high"] = np.min(of["s_low"], axis=1), np.max(of["s_high"], axis=1)
    found["corners"] = np.sum((of["corner"] << places) * (places < count[:, None]), axis=1)
    return found[np.argsort(found["s_low"], kind="stable")]


def _pieces(kerb: Kerb) -> Records:
    """Return the pieces of one kerb, with the street on their left: those of a left kerb run against the line."""
    order = slice(None, None, -1) if kerb.left else slice(None)
    points, s = kerb.points[order], kerb.s[order]
    kept = np.zeros(1, bool)
    while not np.all(kept):
        kept = np.append(np.hypot(*np.diff(points, axis=0).T) > _SHORTEST_M, True)
        kept[1:-1] &= turns_of(points) >= BACK
        points, s = points[kept], s[kept]
        points, left = _unlooped(points)
        points, s, kept = points[left], s[left], np.append(kept, left)
    step = np.diff(points, axis=0)
    found = np.zeros(len(step), PIECE)
    if len(found) == 0:  # inside a ring that is narrower than its width: a point bounds nothing
        return found
    found["x"], found["y"] = points[:-1].T
    found["length"] = np.hypot(*step.T)
    found["cos"], found["sin"] = (step / found["length"][:, None]).T
    for name in ("cos", "sin"):
        found[f"before_{name}"] = np.concatenate([found[name][:1], found[name][:-1]])
    along = np.append(0.0, np.cumsum(found["length"]))
    for name, way in (("from", -_RUN_M), ("to", _RUN_M)):
        run = np.stack([np.interp(along[:-1] + way, along, column) for column in points.T]) - points[:-1].T
        found[f"{name}_cos"], found[f"{name}_sin"] = np.sign(way) * run / np.maximum(np.hypot(*run), _SHORTEST_M)
    found["s_begin"], found["s_end"] = s[:-1], s[1:]
    found["s_low"], found["s_high"] = np.minimum(s[:-1], s[1:]), np.maximum(s[:-1], s[1:])
    found["left"], found["wheels"] = kerb.left, kerb.wheels
    found["wall"] = np.abs(np.diff(s)) < _WALL * found["length"]
    found["corner"] = found["before_cos"] * found["sin"] - found["before_sin"] * found["cos"] < -_STRAIGHT
    if not kerb.goes_on:
        found = np.append(found, found[-1:])
        found[-1:][["x", "y", "length", "s_begin", "s_low", "s_high"]] = (*points[-1], 0.0, s[-1], s[-1], s[-1])
        found["corner"][[0, -1]] = found["ends_after"][-2:] = 1
    found["ends"][[0, -1]] = 1, not kerb.goes_on
    return found


def _unlooped(points: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return points (n, 2) with small loops cut where they close, the smallest first, and which of them (n,) are left."""
    drawn = np.asarray(shapely.linestrings(np.stack([points[:-1], points[1:]], axis=1)))
    along = np.append(0.0, np.cumsum(shapely.length(drawn)))
    first, last = shapely.STRtree(drawn).query(drawn, predicate="intersects")
    small = (last > first + 1) & (last - first < len(drawn) - 1) & (along[last] - along[np.minimum(first + 1, last)] < _LOOP_M)
    first, last = (found[small][np.lexsort((-first[small], last[small]))] for found in (first, last))
    points, left, beyond = points.copy(), np.ones(len(points), bool), 0
    for begin, end in zip(first, last, strict=True):
        closing = shapely.get_coordinates(shapely.intersection(drawn[begin], drawn[end]))[0]
        ways = np.sum(np.hypot(*(closing - points[[begin + 1, end]]).T))
        if begin >= beyond and along[end] - along[begin + 1] + ways < _LOOP_M:
            points[begin + 1], left[begin + 2 : end + 1], beyond = closing, False, end + 1
    return points, left


def replaced_by(kerb: Kerb, parts: Sequence[Kerb]) -> Kerb:
    """Return a kerb with ``parts`` in place of its own points beside their stretches of the line, in order of s."""
    points, s, begin = [], [], -np.inf
    for part in parts:
        own = (kerb.s > begin) & (kerb.s < part.s[0])
        points += [kerb.points[own], part.points]
        s += [kerb.s[own], part.s]
        begin = part.s[-1]
    own = kerb.s > begin
    return replace(kerb, points=np.concatenate([*points, kerb.points[own]]), s=np.concatenate([*s, kerb.s[own]]))


def between(kerb: Kerb, low: float, high: float) -> Kerb:
    """Return a kerb's part beside a stretch of the line, from arclength ``low`` to ``high`` [m]."""
    if high <= kerb.s[0] or low >= kerb.s[-1] or high <= low:
        return replace(kerb, points=np.empty((0, 2)), s=np.empty(0))
    inside = (kerb.s >= low) & (kerb.s <= high)
    ends = [np.array([end]) if kerb.s[0] < end < kerb.s[-1] and end not in kerb.s else np.empty(0) for end in (low, high)]
    cut = [np.stack([np.interp(end, kerb.s, column) for column in kerb.points.T], axis=1) for end in ends]
    points, s = (np.concatenate([cut[0], kerb.points[inside], cut[1]]), np.concatenate([ends[0], kerb.s[inside], ends[1]]))
    apart = np.append(True, np.hypot(*np.diff(points, axis=0).T) > _SHORTEST_M)
    return replace(kerb, points=points[apart], s=s[apart])
