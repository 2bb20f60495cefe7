"""Cusps: where two legs meet, and how their lines are moved so that they share its point and the vehicle's heading there."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from hdvplan.arrays import FloatArray, carried, chord_of
from hdvplan.errors import RoadError
from hdvplan.road.arcs import wrapped
from hdvplan.road.legs import SAME_M, Leg
from hdvplan.road.passages import normals
from hdvplan.road.path import KNOT_SPACING_M, ReferencePath
from hdvplan.road.road import Road
from hdvplan.road.splines import path_along

LARGEST_BREAK = np.deg2rad(15.0)  # of two lines drawn by hand; of more one of them is meant otherwise
_WRONG_WAY = np.deg2rad(120.0)  # from which on a direction is wrong, not a line
_BLEND_M = 10.0  # over which a line is moved, or over half of a shorter one
_SAMPLES_M = 0.25  # of a line that is moved: half its knots' spacing
_NOTED_M, _NOTED = 1e-3, np.deg2rad(2.0)  # less is rounding of a file's coordinates, or of smoothing
_SETTLED = 1e-9  # [m] and [rad]: no end is moved by less


class _End(NamedTuple):
    """By how much an end of a line is moved, (2,) [m], and turned [rad]."""

    move: FloatArray
    turn: float

    @property
    def settled(self) -> bool:
        return bool(np.hypot(*self.move) < _SETTLED and abs(self.turn) < _SETTLED)


class _Cusp(NamedTuple):
    """Where the lines of two legs end: the one before at x, y ``place``, the one after ``apart`` from there, (2,) each [m].

    ``turn`` leads from one heading of the vehicle to the other, and ``smoothed`` is what smoothing adds to it [rad].
    """

    place: FloatArray
    apart: FloatArray
    turn: float
    smoothed: float

    @property
    def gap(self) -> float:
        """Between the two ends [m]."""
        return float(np.hypot(*self.apart))


def _cusp(before: Leg, after: Leg) -> _Cusp:
    one, other = before.road.path.at(before.ends[1]), after.road.path.at(after.ends[0])
    place, there = (np.array([end.x, end.y], dtype=float) for end in (one, other))
    return _Cusp(place, there - place, float(wrapped(other.heading - one.heading)), after.turned[0] - before.turned[1])


def joined(legs: tuple[Leg, ...], gap: float = SAME_M) -> tuple[tuple[Leg, ...], tuple[str, ...]]:
    """Return legs whose lines share point and heading at every cusp, and notes on how far they were moved; their streets stay.

    Raises:
        RoadError: two lines end further apart than ``gap`` [m], or at an angle that nobody draws by mistake.

    """
    cusps = [_cusp(before, after) for before, after in pairwise(legs)]
    for number, cusp in enumerate(cusps, start=1):
        _refuse(cusp, number, gap)
    none = _End(np.zeros(2), 0.0)
    arrive = [*(_End(0.5 * cusp.apart, 0.5 * cusp.turn) for cusp in cusps), none]  # both ends meet half-way
    leave = [none, *(_End(-0.5 * cusp.apart, -0.5 * cusp.turn) for cusp in cusps)]
    moved, offs = [], []
    for leg, first, last in zip(legs, leave, arrive, strict=True):
        low, high = (last, first) if leg.backward else (first, last)
        road = leg.road if low.settled and high.settled else _moved(leg.road, low, high)
        moved.append(replace(leg, road=road))
        offs.append(_off(leg.road.path, road.path))
    noted = ((number, cusp) for number, cusp in enumerate(cusps, start=1) if cusp.gap > _NOTED_M or abs(cusp.turn) > _NOTED)
    return tuple(moved), tuple(_note(cusp, number, max(offs[number - 1 : number + 1])) for number, cusp in noted)


def _refuse(cusp: _Cusp, number: int, gap: float) -> None:
    x, y = cusp.place
    if cusp.gap > gap:
        msg = f"leg {number + 1} begins {cusp.gap:.2f} m from the end of leg {number}, which is at x {x:.2f}, y {y:.2f}"
        dx, dy = -cusp.apart
        moved = f"it is the last axle's line: move its beginning by {dx:.2f} m in x and {dy:.2f} m in y"
        whole = "a leg begins where the one before it ends: lines are drawn in the order of driving"
        raise RoadError(msg, hint=whole if gap == SAME_M else moved)
    if abs(cusp.turn) > LARGEST_BREAK:
        degrees = abs(np.degrees(cusp.turn))
        msg = f"the vehicle's heading changes by {degrees:.0f} degrees from leg {number} to leg {number + 1}, at x {x:.2f}, y {y:.2f}"
        wrong = "is a direction wrong? lines are drawn in the order of driving, also those that are driven backward"
        back = f"draw the beginning of leg {number + 1} back over the end of leg {number}: at a cusp a vehicle cannot turn"
        back += "; the last axle's line begins straight, for a trailer's length" * (gap > SAME_M)
        if abs(cusp.turn - cusp.smoothed) <= LARGEST_BREAK:
            back = "smoothing turned the drawn lines there: try --smooth 0.2"
        raise RoadError(msg, hint=wrong if abs(cusp.turn) > _WRONG_WAY else back)


def _note(cusp: _Cusp, number: int, off: float) -> str:
    apart = f"{100.0 * cusp.gap:.1f} cm apart and " if cusp.gap > _NOTED_M else ""
    return (
        f"the lines of legs {number} and {number + 1} meet {apart}at {abs(np.degrees(cusp.turn)):.1f} degrees: "
        f"they are moved by up to {off:.2f} m"
    )


def _off(path: ReferencePath, moved: ReferencePath) -> float:
    share = np.linspace(0.0, 1.0, max(2, int(path.length / _SAMPLES_M)))
    here, there = path.at(share * path.length), moved.at(share * moved.length)
    return float(np.max(np.hypot(there.x - here.x, there.y - here.y)))


def _moved(road: Road, low: _End, high: _End) -> Road:
    """Return a road whose line's ends are moved and turned; what lies further inside stays, and so does its street."""
    path = road.path
    s = np.linspace(0.0, path.length, max(8, int(np.ceil(path.length / _SAMPLES_M))) + 1)
    here, blend = path.at(s), min(_BLEND_M, 0.5 * path.length)
    points, normal = normals(here)
    for end, inwards, turn in ((low, s, low.turn), (high, path.length - s, -high.turn)):
        u = np.minimum(inwards / blend, 1.0)  # the quintics end with no slope and no curvature
        points += (1.0 - u**3 * (10.0 - 15.0 * u + 6.0 * u**2))[:, None] * end.move
        points += (np.tan(turn) * blend * (u - 6.0 * u**3 + 8.0 * u**4 - 3.0 * u**5))[:, None] * normal
    headings = float(here.heading[0]) + low.turn, float(here.heading[-1]) + high.turn
    first, last = (np.array([np.cos(heading), np.sin(heading)]) for heading in headings)
    spline = CubicSpline(chord_of(points), points, bc_type=((1, first), (1, last)))
    moved, along, _ = path_along(spline, KNOT_SPACING_M)
    about = None if road.about is None else replace(road.about, s=np.interp(road.about.s, s, along))
    drawn = None if road.drawn is None else tuple(replace(kerb, s=carried(kerb.s, s, along)) for kerb in road.drawn)
    there = replace(road, path=moved, about=about)
    return there if drawn is None else there.with_kerbs(drawn)
