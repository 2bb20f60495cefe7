"""The reference path gamma(s): position, heading and curvature at an arclength, and the foot of a point.

The path is a table of quintic segments of equal arclength, each fixed by position, heading and curvature at both ends:
curvature is continuous, and a lookup needs no search. Plane coordinates in metres, x east, y north; heading psi
counter-clockwise from x; lateral offset positive to the left.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records
from hdvplan.errors import ProjectionError, RoadError

KNOT_SPACING_M = 0.5  # the quintic's position error is below 1e-9 m at a curvature of 0.2 1/m
LAST_STEP_M = 2e-5  # a Newton step this small leaves errors of its square
_LOCAL_M = 15.0  # of a search
_ROUNDING_M = 1e-3  # that a foot may lie beyond an end
_BLEND_M = 10.0  # an open road's curvature fades to zero over this length beyond its ends [m]
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)


# A path as the core takes it; ``coefficients`` is where they begin in memory.
CURVE = core.record("hdv_curve")

_evaluate_many = core.function("hdv_evaluate_many", core.POINTER, core.INT, core.POINTER, core.POINTER)
_project_many = core.function("hdv_project_many", core.POINTER, core.INT, *[core.POINTER] * 3, core.REAL, core.POINTER)


@dataclass(frozen=True)
class PathPoint:
    """Points of the reference path: arrays of equal shape, metres, radians, 1/m."""

    x: FloatArray
    y: FloatArray
    heading: FloatArray
    curvature: FloatArray


@dataclass(frozen=True)
class ReferencePath:
    """The path gamma(s) that the road-aligned frame hangs on.

    ``coefficients`` has shape (segments, 12): for each segment the six power coefficients of x, then of y, lowest
    power first, in the arclength from the segment's start. The nominal road is 0 <= s <= ``length``; the table
    reaches from ``s_first`` to ``s_last`` beyond it so that a vehicle's ends and the horizon have a foot.
    """

    coefficients: FloatArray
    s_first: float  # [m]
    spacing: float  # [m]
    length: float  # [m]
    closed: bool

    @cached_property
    def record(self) -> Records:
        """The path as the core takes it, one record of ``CURVE``. Its address is good as long as the path is."""
        coefficients = core.address(self.coefficients)
        return np.array([(coefficients, len(self.coefficients), self.s_first, self.spacing)], CURVE)

    def __post_init__(self) -> None:
        """Lay the coefficients out as the core reads them."""
        object.__setattr__(self, "coefficients", np.ascontiguousarray(self.coefficients, dtype=float))

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the record: addresses mean nothing in a copy, or in another process."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @property
    def s_last(self) -> float:
        """The arclength at which the table ends [m]."""
        return self.s_first + self.spacing * len(self.coefficients)

    def at(self, s: FloatArray | float) -> PathPoint:
        """Return the path's points at arclengths ``s`` [m], any shape.

        Raises:
            RoadError: an arclength lies outside the table.

        """
        s = np.asarray(s, dtype=float)
        outside = (s < self.s_first - 1e-9) | (s > self.s_last + 1e-9)
        if np.any(outside):
            at = float(s[outside].flat[0])
            msg = f"s = {at:z.2f} m lies outside the path, which reaches from {self.s_first:.2f} to {self.s_last:.2f} m"
            raise RoadError(msg, s_m=at)
        table = evaluate_many(self, s.ravel())
        shaped = table.reshape(5, *s.shape)
        return PathPoint(shaped[0], shaped[1], np.arctan2(shaped[3], shaped[2]), shaped[4])

    def project(self, x: FloatArray | float, y: FloatArray | float, near: FloatArray | float) -> tuple[FloatArray, FloatArray]:
        """Return arclength and signed lateral offset [m] of points, searching locally from the arclengths ``near``.

        The search is local so that a road that crosses itself is no trap. Exact to 1e-9 m; within 1 mm beyond an end, the foot is the end.

        Raises:
            ProjectionError: a point has no foot near by: it lies beyond the centre of curvature, or an end of the table.

        """
        x, y, near = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float), np.asarray(near, float))
        s, offset = project_many(self, x.ravel(), y.ravel(), near.ravel())[:2]
        lost = np.isnan(offset)
        if np.any(lost):
            s[lost], offset[lost] = self._at_an_end(x.ravel()[lost], y.ravel()[lost], near.ravel()[lost])
        return s.reshape(x.shape), offset.reshape(x.shape)

    def _at_an_end(self, x: FloatArray, y: FloatArray, near: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return arclength and offset [m] of points that were not found, (n,), where an end is no further than rounding."""
        near = np.clip(near, self.s_first, self.s_last)
        longer = self.extended(_LOCAL_M - self.s_first, _LOCAL_M + self.s_last - self.length)
        s, offset = project_many(longer, x, y, near)[:2]
        kept = np.clip(s, self.s_first, self.s_last)
        found = ~np.isnan(offset) & (np.abs(s - kept) <= _ROUNDING_M)
        if not np.all(found):
            at = int(np.argmin(found))
            at_s, beyond, aside = float(kept[at]), float(s[at] - kept[at]), float(offset[at])
            where = "before the beginning" if beyond < 0.0 else "beyond the end"
            msg = f"a point lies {abs(beyond):.2f} m {where} of the path, at s = {at_s:z.2f} m"
            if np.isnan(aside):
                at_s, point = float(near[at]), self.at(near[at])
                aside = float(np.hypot(x[at] - point.x, y[at] - point.y))
                msg = f"a point {aside:.2f} m from the path at s = {at_s:z.2f} m has no foot near there"
            raise ProjectionError(msg, s_m=at_s, offset_m=aside)
        return kept, offset

    def to_plane(self, s: FloatArray | float, offset: FloatArray | float) -> tuple[FloatArray, FloatArray]:
        """Return x, y [m] of the points at lateral ``offset`` [m] from the path's points at ``s`` [m]."""
        point = self.at(s)
        return point.x - offset * np.sin(point.heading), point.y + offset * np.cos(point.heading)

    def extended(self, before: float, after: float) -> ReferencePath:
        """Return the same path with a table that reaches at least ``before`` and ``after`` [m] beyond the road.

        A closed road is wound on; an open one leaves its end with a curvature that fades to zero, then straight.
        """
        first, last = min(-before, self.s_first), max(self.length + after, self.s_last)
        if first == self.s_first and last == self.s_last:
            return self
        if self.closed:
            return self._wound(first, last)
        head = _fade(self, self.s_first, self.s_first - first)
        tail = _fade(self, self.s_last, last - self.s_last)
        table = np.vstack([head, self.coefficients, tail])
        return ReferencePath(table, self.s_first - len(head) * self.spacing, self.spacing, self.length, self.closed)

    def stretch(self, s_from: float, s_to: float, before: float, after: float) -> ReferencePath:
        """Return the part from ``s_from`` to ``s_to`` as a separate path, whose table continues along this one ``before`` and ``after`` it.

        Arclengths count from ``s_from``; all in metres. Either end may lie beyond the road.
        """
        whole = self.extended(before - s_from, s_to + after - self.length)
        first = int(np.floor((s_from - before - whole.s_first) / whole.spacing + 1e-9))
        last = int(np.ceil((s_to + after - whole.s_first) / whole.spacing - 1e-9))
        table = whole.coefficients[first:last]
        return ReferencePath(table, whole.s_first + first * whole.spacing - s_from, whole.spacing, s_to - s_from, closed=False)

    def _wound(self, first: float, last: float) -> ReferencePath:
        segments = round(self.length / self.spacing)
        start = round(-self.s_first / self.spacing)
        lap = self.coefficients[start : start + segments]
        before, after = int(np.ceil(-first / self.spacing)), int(np.ceil(last / self.spacing))
        table = lap[np.arange(-before, after) % segments]
        return ReferencePath(table, -before * self.spacing, self.spacing, self.length, closed=True)


def from_samples(
    x: FloatArray, y: FloatArray, heading: FloatArray, curvature: FloatArray, spacing: float, *, closed: bool = False
) -> ReferencePath:
    """Build a path from samples at equal arclengths ``spacing`` [m]; shape (n,) each, n >= 2.

    A closed path repeats its first sample at the end.
    """
    cos, sin = np.cos(heading), np.sin(heading)
    rows = _quintic(x, cos, -curvature * sin, spacing) + _quintic(y, sin, curvature * cos, spacing)
    table = np.ascontiguousarray(np.stack(rows, axis=1))
    return ReferencePath(table, 0.0, spacing, spacing * (len(x) - 1), closed)


def _quintic(value: FloatArray, first: FloatArray, second: FloatArray, h: float) -> list[FloatArray]:
    """Return the power coefficients of the quintics with given value, first and second derivative at their ends.

    Written out because scipy's ``BPoly.from_derivatives`` loops over the segments: 1.9 s for a road of 12 km.
    """
    d = np.diff(value) - h * first[:-1] - 0.5 * h**2 * second[:-1]
    e = h * (np.diff(first) - h * second[:-1])
    f = h**2 * np.diff(second)
    return [
        value[:-1],
        first[:-1],
        0.5 * second[:-1],
        (10 * d - 4 * e + 0.5 * f) / h**3,
        (-15 * d + 7 * e - f) / h**4,
        (6 * d - 3 * e + 0.5 * f) / h**5,
    ]


def from_curvature(
    arclengths: Sequence[float] | FloatArray, curvatures: Sequence[float] | FloatArray, *, spacing: float = KNOT_SPACING_M
) -> ReferencePath:
    """Build the path of a curvature profile, linear between the given arclengths [m], starting at the origin eastwards.

    The heading is exact; positions are integrated by Gauss-Legendre quadrature on every knot interval.
    """
    s, curvature = np.asarray(arclengths, float), np.asarray(curvatures, float)
    cells = max(1, round(float(s[-1] - s[0]) / spacing))
    step = float(s[-1] - s[0]) / cells
    knots = s[0] + step * np.arange(cells + 1)
    slope = np.diff(curvature) / np.diff(s)
    turned = np.concatenate([[0.0], np.cumsum(0.5 * (curvature[1:] + curvature[:-1]) * np.diff(s))])

    def heading(at: FloatArray) -> FloatArray:
        piece = np.clip(np.searchsorted(s, at, side="right") - 1, 0, len(s) - 2)
        over = at - s[piece]
        return np.asarray(turned[piece] + over * (curvature[piece] + 0.5 * over * slope[piece]))

    inner = heading(knots[:-1, None] + 0.5 * step * (_NODES + 1.0))
    x = np.concatenate([[0.0], np.cumsum(np.cos(inner) @ _WEIGHTS * 0.5 * step)])
    y = np.concatenate([[0.0], np.cumsum(np.sin(inner) @ _WEIGHTS * 0.5 * step)])
    return from_samples(x, y, heading(knots), np.interp(knots, s, curvature), step)


def _fade(path: ReferencePath, end: float, distance: float) -> FloatArray:
    """Return the segments of an extension of ``distance`` [m] beyond one end of an open path, in order of s."""
    count = int(np.ceil(distance / path.spacing - 1e-9))
    if count == 0:
        return np.empty((0, 12))
    forward = end > path.s_first
    last = path.at(end)
    reach = max(count * path.spacing, 2 * _BLEND_M)
    profile = from_curvature(np.array([0.0, _BLEND_M, reach]), float(last.curvature) * np.array([1.0, 0.0, 0.0]), spacing=path.spacing)
    s = path.spacing * np.arange(count + 1)
    piece = profile.at(np.minimum(s, profile.s_last))
    over = np.maximum(s - profile.s_last, 0.0)  # rounding of the spacing leaves at most part of a straight segment
    u, v = piece.x + over * np.cos(piece.heading), piece.y + over * np.sin(piece.heading)
    sign = 1.0 if forward else -1.0
    cos, sin = np.cos(float(last.heading)), np.sin(float(last.heading))
    x = float(last.x) + sign * u * cos - v * sin
    y = float(last.y) + sign * u * sin + v * cos
    heading = float(last.heading) + sign * piece.heading
    order = slice(None) if forward else slice(None, None, -1)
    return from_samples(x[order], y[order], heading[order], piece.curvature[order], path.spacing).coefficients


def evaluate_many(path: ReferencePath, s: FloatArray) -> FloatArray:
    """Return rows x, y, cos(psi), sin(psi), curvature at arclengths ``s`` (n,), shape (5, n); beyond the table its end segments go on."""
    s = np.ascontiguousarray(s, dtype=float)
    points = np.empty((s.size, 5))
    _evaluate_many(core.address(path.record), s.size, core.address(s), core.address(points))
    return points.T


def project_many(path: ReferencePath, x: FloatArray, y: FloatArray, near: FloatArray, last_step: float = LAST_STEP_M) -> FloatArray:
    """Return rows s, offset, cos(psi), sin(psi), curvature at the feet of points (n,), shape (5, n); the offset is NaN without a foot.

    Each is searched from its arclength ``near`` (n,), until a Newton step is shorter than ``last_step`` [m].
    """
    x, y, near = (np.ascontiguousarray(values, dtype=float) for values in (x, y, near))
    feet = np.empty((x.size, 5))
    _project_many(core.address(path.record), x.size, *map(core.address, (x, y, near)), last_step, core.address(feet))
    return feet.T
