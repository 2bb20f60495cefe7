"""Convex obstacles of a site, such as walls, kerbs round a corner and rows of parked vehicles, and exact distances from bodies."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import BoolArray, FloatArray, Records
from hdvplan.vehicle.model import Vehicle

_FAR_M = 1000.0  # what has no end is drawn so far
_NO_LENGTH_M = 1e-12
_QUARTER = 64  # chords of a rounded corner: 0.5 mm off the arc at a radius of 6 m


@dataclass(frozen=True)
class Outline:
    """A rectangle on every unit [m]: how far it reaches ahead of and behind the axle, and to either side; arrays (units,)."""

    front: FloatArray
    rear: FloatArray
    half: FloatArray


def bodies_of(vehicle: Vehicle) -> Outline:
    """Return the bodies of a vehicle."""
    units = vehicle.table()
    return Outline(units["front"], units["rear_overhang"], units["half_width"])


def wheels_of(vehicle: Vehicle) -> Outline:
    """Return what stays on the carriageway: wheels and all between the first and the last axle, or the coupling, of a unit."""
    units = vehicle.table()
    return Outline(np.minimum(units["wheelbase"], units["front"]), np.zeros(len(units)), units["half_width"])


@dataclass(frozen=True)
class _Rectangles:
    """Outlines at poses: middles [m], cosine and sine of headings, half lengths and half widths [m]; all broadcast."""

    x: FloatArray
    y: FloatArray
    cos: FloatArray
    sin: FloatArray
    length: FloatArray
    half: FloatArray

    def least(self, nx: FloatArray | float, ny: FloatArray | float) -> FloatArray:
        """Return the least component along a normal [m]."""
        reach = self.length * np.abs(nx * self.cos + ny * self.sin) + self.half * np.abs(ny * self.cos - nx * self.sin)
        return nx * self.x + ny * self.y - reach

    def where(self, chosen: BoolArray) -> _Rectangles:
        """Return the chosen ones."""
        parts = (self.x, self.y, self.cos, self.sin, self.length, self.half)
        return _Rectangles(*(np.broadcast_to(part, chosen.shape)[chosen] for part in parts))

    def sides(self) -> list[tuple[FloatArray, FloatArray]]:
        """Return the normals of the outlines' sides."""
        return [(self.cos, self.sin), (-self.cos, -self.sin), (-self.sin, self.cos), (self.sin, -self.cos)]

    def corners_from(self, place: tuple[float, float]) -> list[tuple[FloatArray, FloatArray]]:
        """Return the directions of the outlines' corners from a place."""
        found = []
        for ahead, left in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)):
            x = self.x + ahead * self.length * self.cos - left * self.half * self.sin - place[0]
            y = self.y + ahead * self.length * self.sin + left * self.half * self.cos - place[1]
            away = np.maximum(np.hypot(x, y), _NO_LENGTH_M)
            found.append((x / away, y / away))
        return found


def _placed(poses: Records, outline: Outline) -> _Rectangles:
    middle, cos, sin = 0.5 * (outline.front - outline.rear), poses["cos"], poses["sin"]
    x, y = poses["x"] + middle * cos, poses["y"] + middle * sin
    return _Rectangles(x, y, cos, sin, 0.5 * (outline.front + outline.rear), outline.half)


def reach(poses: Records, outline: Outline, angle: float) -> FloatArray:
    """Return how far outlines at ``poses`` (..., units) reach from the origin in the direction ``angle`` [rad], shape (..., units) [m]."""
    return -_placed(poses, outline).least(-np.cos(angle), -np.sin(angle))


@dataclass(frozen=True)
class Block:
    """A convex obstacle without end, rounded at its tip: a wall, a kerb round a corner, a row of parked vehicles.

    Its outward normals turn counter-clockwise from ``first`` to ``last`` [rad] by less than half a turn; where these are equal, it is a
    half plane. ``tips`` are its corners in this order [m]; of a rounded one the only tip is the centre of its ``radius`` [m].
    """

    name: str
    tips: tuple[tuple[float, float], ...]
    first: float
    last: float
    radius: float = 0.0

    def eroded(self, depth: float) -> Block:
        """Return what is left ``depth`` [m] inside all edges of a block with one tip."""
        if depth <= self.radius:
            return replace(self, radius=self.radius - depth)
        middle, half = 0.5 * (self.first + self.last), 0.5 * (self.last - self.first)
        back, (x, y) = (depth - self.radius) / np.cos(half), self.tips[0]
        return replace(self, tips=((float(x - back * np.cos(middle)), float(y - back * np.sin(middle))),), radius=0.0)

    def gaps(self, poses: Records, outline: Outline, enough: float = np.inf) -> FloatArray:
        """Return signed distances of outlines at ``poses`` (..., units) from the block, shape (..., units) [m]; negative inside.

        Two convex bodies are as far apart as the widest strip between them. Its normal is one of the block's sides, one of the
        outline's, or points from a tip to a corner (method of separating axes). Distances above ``enough`` may be shown too small.
        """
        placed = _placed(poses, outline)
        gap = self._strip(placed, np.cos(self.first), np.sin(self.first))
        if self.last > self.first:
            for angle in (self.last, *self._between):
                gap = np.maximum(gap, self._strip(placed, np.cos(angle), np.sin(angle)))
            near = gap < enough + self.radius
            gap[near] = self._widest(placed.where(near), gap[near])
        return gap - self.radius

    @property
    def _between(self) -> tuple[float, ...]:
        """The normals of the sides between its tips [rad]."""
        sides = np.diff(np.array(self.tips), axis=0)
        return tuple(float(np.arctan2(-side[0], side[1])) for side in sides)

    def _strip(self, placed: _Rectangles, nx: FloatArray | float, ny: FloatArray | float) -> FloatArray:
        """Return the width of the strips between the block's tips and outlines across a normal [m]; negative where they overlap."""
        furthest = nx * self.tips[0][0] + ny * self.tips[0][1]
        for x, y in self.tips[1:]:
            furthest = np.maximum(furthest, nx * x + ny * y)
        return placed.least(nx, ny) - furthest

    def _widest(self, placed: _Rectangles, gap: FloatArray) -> FloatArray:
        """Return ``gap``, or the width of the widest strip whose normal is not one of the block's own [m]."""
        middle, least = 0.5 * (self.first + self.last), np.cos(0.5 * (self.last - self.first))
        for nx, ny in (*placed.sides(), *(towards for tip in self.tips for towards in placed.corners_from(tip))):
            outward = nx * np.cos(middle) + ny * np.sin(middle) >= least
            gap = np.where(outward, np.maximum(gap, self._strip(placed, nx, ny)), gap)
        return gap

    def area(self, view: shapely.Polygon) -> BaseGeometry:
        """Return the part of the block that lies in ``view``, a box no larger than a kilometre."""
        middle = 0.5 * (self.first + self.last)
        ends = ((self.tips[0], unit(self.first - 0.5 * np.pi)), (self.tips[-1], unit(self.last + 0.5 * np.pi)))
        corners = [*self.tips, *(tip + _FAR_M * (ray - back * unit(middle)) for tip, ray in ends for back in (0.0, 1.0))]
        cone = shapely.convex_hull(shapely.MultiPoint(np.array(corners)))
        return shapely.intersection(shapely.buffer(cone, self.radius, quad_segs=_QUARTER), view)


def wall(name: str, angle: float, distance: float) -> Block:
    """Return the half plane that begins ``distance`` [m] from the origin in the direction ``angle`` [rad]."""
    away = distance * unit(angle)
    return Block(name, ((float(away[0]), float(away[1])),), angle + np.pi, angle + np.pi)


def unit(angle: float) -> FloatArray:
    """Return the unit vector in a direction [rad]."""
    return np.array([np.cos(angle), np.sin(angle)])
