"""A kerb, parts of it, and its pieces as the core takes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records, turns_of

PIECE = core.record("hdv_piece")
STREET = core.record("hdv_street")
_TOGETHER = core.number("HDV_TOGETHER")  # pieces of a block
_ALONGSIDE = {name: np.dtype((np.float64, _TOGETHER)) for name in ("x", "y", "cos", "sin", "length")}
BLOCK = core.record("hdv_block", **_ALONGSIDE, numbers=np.dtype((np.int64, _TOGETHER)))
_SHORTEST_M = 1e-6  # two points of a kerb nearer than this are one
BACK = -1.0 + 1e-9  # cosine of a turn: a kerb that goes back on itself has no width there
_SLIVER_M, _SHARPLY = 0.005, -0.5  # a shorter side that the kerb turns to, or from, by over 120 degrees was drawn by nobody
_STRAIGHT = 1e-7  # [rad] of turn: less is rounding of coordinates of a thousand kilometres, and no corner
_WALL = 0.25  # metres of line a metre, below which a piece is a wall across the street
_CLEANED = 5  # times that such points are taken out


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
    for _ in range(_CLEANED):
        length, turn = np.hypot(*np.diff(points, axis=0).T), turns_of(points)
        sliver = (turn < _SHARPLY) & (np.minimum(length[1:], length[:-1]) < _SLIVER_M)
        back = (turn < BACK) | sliver & ~np.append(False, sliver[:-1])  # of a sliver's two turns one goes
        kept = np.append(length > _SHORTEST_M, True) & ~np.concatenate([[False], back, [False]])
        if np.all(kept):
            break
        points, s = points[kept], s[kept]
    step = np.diff(points, axis=0)
    found = np.zeros(len(step), PIECE)
    if len(found) == 0:  # inside a ring that is narrower than its width: a point bounds nothing
        return found
    found["x"], found["y"] = points[:-1].T
    found["length"] = np.hypot(*step.T)
    found["cos"], found["sin"] = (step / found["length"][:, None]).T
    for name in ("cos", "sin"):
        found[f"before_{name}"] = np.concatenate([found[name][:1], found[name][:-1]])
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
