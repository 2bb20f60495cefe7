"""The reference path gamma(s): position, heading and curvature at an arclength, and the foot of a point.

The path is a table of quintic segments of equal arclength, each fixed by position, heading and curvature at both ends:
curvature is continuous, and a lookup needs no search. Plane coordinates in metres, x east, y north; heading psi
counter-clockwise from x; lateral offset positive to the left.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from hdvplan.errors import ProjectionError, RoadError
from hdvplan.jit import FloatArray, compiled, inlined

KNOT_SPACING_M = 0.5  # the quintic's position error is below 1e-9 m at a curvature of 0.2 1/m
_BEYOND = 0.05  # 1 - curvature * offset below which Newton steps would overshoot
_LOCAL_M = 15.0  # a foot further from where the search began is another part of the road
LAST_STEP_M = 2e-5  # a Newton step this small leaves errors of its square
PLANNING_STEP_M = 1e-3  # the same for linearisation: the offset is then good to 1e-10 m, the foot to 1e-7 m
_BLEND_M = 10.0  # an open road's curvature fades to zero over this length beyond its ends [m]


class Curve(NamedTuple):
    """A path as kernels take it; see ``ReferencePath``."""

    coefficients: FloatArray  # (segments, 12)
    s_first: float  # [m]
    spacing: float  # [m]


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
    def curve(self) -> Curve:
        """The path as kernels take it."""
        return Curve(self.coefficients, self.s_first, self.spacing)

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
            msg = f"s = {at:.2f} m lies outside the path, which reaches from {self.s_first:.2f} to {self.s_last:.2f} m"
            raise RoadError(msg, s_m=at)
        table = evaluate_many(self.curve, s.ravel())
        shaped = table.reshape(5, *s.shape)
        return PathPoint(shaped[0], shaped[1], np.arctan2(shaped[3], shaped[2]), shaped[4])

    def project(self, x: FloatArray | float, y: FloatArray | float, near: FloatArray | float) -> tuple[FloatArray, FloatArray]:
        """Return arclength and signed lateral offset [m] of points, searching locally from the arclengths ``near``.

        The search is local so that a road that crosses itself is no trap. Exact to 1e-9 m.

        Raises:
            ProjectionError: a point has no foot near by (it lies beyond the centre of curvature).

        """
        x, y, near = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float), np.asarray(near, float))
        s, offset = project_many(self.curve, x.ravel(), y.ravel(), near.ravel())
        if not np.all(np.isfinite(offset)):
            at = int(np.argmin(np.isfinite(offset)))
            start = float(np.clip(near.ravel()[at], self.s_first, self.s_last))
            distance = float(np.hypot(x.ravel()[at] - self.at(start).x, y.ravel()[at] - self.at(start).y))
            msg = f"a point {distance:.2f} m from the path has no foot near s = {start:.2f} m"
            raise ProjectionError(msg, s_m=start, offset_m=distance)
        return s.reshape(x.shape), offset.reshape(x.shape)

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


def from_curvature(s: FloatArray, curvature: FloatArray, *, spacing: float = KNOT_SPACING_M) -> ReferencePath:
    """Build the path of a curvature profile, linear between the given arclengths [m], starting at the origin eastwards.

    The heading is exact; positions are integrated by Gauss-Legendre quadrature on every knot interval.
    """
    cells = max(1, round(float(s[-1] - s[0]) / spacing))
    step = float(s[-1] - s[0]) / cells
    knots = s[0] + step * np.arange(cells + 1)
    slope = np.diff(curvature) / np.diff(s)
    turned = np.concatenate([[0.0], np.cumsum(0.5 * (curvature[1:] + curvature[:-1]) * np.diff(s))])

    def heading(at: FloatArray) -> FloatArray:
        piece = np.clip(np.searchsorted(s, at, side="right") - 1, 0, len(s) - 2)
        over = at - s[piece]
        angle: FloatArray = turned[piece] + over * (curvature[piece] + 0.5 * over * slope[piece])
        return angle

    nodes, weights = np.polynomial.legendre.leggauss(5)
    inner = heading(knots[:-1, None] + 0.5 * step * (nodes + 1.0))
    x = np.concatenate([[0.0], np.cumsum(np.cos(inner) @ weights * 0.5 * step)])
    y = np.concatenate([[0.0], np.cumsum(np.sin(inner) @ weights * 0.5 * step)])
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


@inlined
def evaluate(curve: Curve, s: float) -> tuple[float, float, float, float, float]:
    """Return x, y, cos(psi), sin(psi), curvature at arclength ``s``; beyond the table its last segment goes on."""
    coefficients = curve.coefficients
    index = int((s - curve.s_first) / curve.spacing)
    index = min(max(index, 0), coefficients.shape[0] - 1)
    u = s - curve.s_first - index * curve.spacing
    c0, c1, c2 = coefficients[index, 0], coefficients[index, 1], coefficients[index, 2]
    c3, c4, c5 = coefficients[index, 3], coefficients[index, 4], coefficients[index, 5]
    c6, c7, c8 = coefficients[index, 6], coefficients[index, 7], coefficients[index, 8]
    c9, c10, c11 = coefficients[index, 9], coefficients[index, 10], coefficients[index, 11]
    x = c0 + u * (c1 + u * (c2 + u * (c3 + u * (c4 + u * c5))))
    y = c6 + u * (c7 + u * (c8 + u * (c9 + u * (c10 + u * c11))))
    dx = c1 + u * (2.0 * c2 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)))
    dy = c7 + u * (2.0 * c8 + u * (3.0 * c9 + u * (4.0 * c10 + u * 5.0 * c11)))
    ddx = 2.0 * c2 + u * (6.0 * c3 + u * (12.0 * c4 + u * 20.0 * c5))
    ddy = 2.0 * c8 + u * (6.0 * c9 + u * (12.0 * c10 + u * 20.0 * c11))
    # Knots are equal arclengths apart, so |gamma'| is 1 to some 1e-5: two terms of 1/sqrt(1 + over) are exact to 1e-13.
    over = dx * dx + dy * dy - 1.0
    unit = 1.0 - over * (0.5 - 0.375 * over)
    return x, y, unit * dx, unit * dy, unit * unit * unit * (dx * ddy - dy * ddx)


@compiled
def project(curve: Curve, x: float, y: float, near: float, last_step: float = LAST_STEP_M) -> tuple[float, float, float, float, float]:
    """Return foot arclength, offset, cos(psi), sin(psi), curvature at the foot of (x, y); offset NaN without a foot.

    Newton on the tangential distance, whose derivative along s is -(1 - curvature * offset). The last step is not looked
    up again: its effect on offset and heading is added to second and first order, exact to 1e-12 m for the usual ``last_step``.
    """
    s, s_last = near, curve.s_first + curve.spacing * curve.coefficients.shape[0]
    for _ in range(30):
        px, py, cos, sin, curvature = evaluate(curve, s)
        ahead = (x - px) * cos + (y - py) * sin
        offset = (y - py) * cos - (x - px) * sin
        slope = 1.0 - curvature * offset
        if slope < _BEYOND:  # at or beyond the centre of curvature: creep along the tangent instead
            slope = 1.0
        step = min(max(ahead / slope, -5.0), 5.0)
        s += step
        if abs(s - near) > _LOCAL_M or not curve.s_first - 1e-9 <= s <= s_last + 1e-9:
            break
        if abs(step) < last_step:
            if 1.0 - curvature * offset <= 0.0:
                break
            turn = curvature * step
            return s, offset - 0.5 * ahead * turn, cos - sin * turn, sin + cos * turn, curvature
    return s, np.nan, 1.0, 0.0, 0.0


@compiled
def evaluate_many(curve: Curve, s: FloatArray) -> FloatArray:
    """Return rows x, y, cos(psi), sin(psi), curvature at arclengths ``s``; shape (5, len(s))."""
    out = np.empty((5, s.size))
    for i in range(s.size):
        out[0, i], out[1, i], out[2, i], out[3, i], out[4, i] = evaluate(curve, s[i])
    return out


@compiled
def project_many(curve: Curve, x: FloatArray, y: FloatArray, near: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return foot arclengths and offsets of points; offset NaN where there is no foot."""
    s, offset = np.empty(x.size), np.empty(x.size)
    for i in range(x.size):
        s[i], offset[i], _, _, _ = project(curve, x[i], y[i], near[i])
    return s, offset
