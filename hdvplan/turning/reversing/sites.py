"""The sites in which manoeuvres are driven: a street, turning heads, docks.

Every site is a set of blocks that stand, and of ends that are moved until the site is as small as the manoeuvre allows. All turns are to
the left; where one drives on the left, it is the mirror image.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import BoolArray, FloatArray, Records
from hdvplan.errors import OptionError
from hdvplan.turning.reversing.options import SiteOptions, Template
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


_CARRIAGEWAY_M, _KERB_RADIUS_M = 4.8, 6.0  # of a turning head, where not given
_OVERHANG_M = 1.0  # that bodies may reach over the kerbs of a head, unless told: with 0.5 m, no way was found for 11 m behind 4.8 m
_DOOR_SPACING_M = 4.0
_NEIGHBOURS = 12  # parked on the side to which the vehicle turns: beyond them it has turned


@dataclass(frozen=True)
class Site:
    """A site whose ends are yet to be found.

    ``ends`` are names and directions [rad] in which it is to be small; its size is ``base`` and how far the vehicle reaches in all of
    these. Wheels stay off all ``blocks``; bodies may reach over them by ``overhang``, and beyond ends by ``beyond_ends`` [m].
    From there all keep ``clearance`` [m].
    """

    template: Template
    blocks: tuple[Block, ...]
    ends: tuple[tuple[str, float], ...]
    base: float = 0.0
    overhang: float = 0.0
    beyond_ends: float = 0.0
    clearance: float = 0.0

    def reaches(self, vehicle: Vehicle, poses: Records) -> FloatArray:
        """Return how far the ends must be away for ``poses`` (..., units), shape (..., ends) [m]."""
        found = [reach(poses, bodies_of(vehicle), angle) - self.beyond_ends for _, angle in self.ends]
        if self.beyond_ends > 0.0:
            found = [np.maximum(far, reach(poses, wheels_of(vehicle), angle)) for far, (_, angle) in zip(found, self.ends, strict=True)]
        return np.stack([far.max(axis=-1) for far in found], axis=-1) + self.clearance

    def gaps(self, vehicle: Vehicle, poses: Records, enough: float = np.inf) -> FloatArray:
        """Return the signed room between each block and the vehicle at ``poses`` (..., units), shape (blocks, ..., units) [m].

        Room above ``enough`` may be shown too small.
        """
        return np.stack([_gap(block, vehicle, poses, self.overhang, enough) for block in self.blocks])

    def gaps_to_ends(self, vehicle: Vehicle, poses: Records, walls: tuple[Block, ...]) -> FloatArray:
        """Return the signed room between each of the ends, closed by ``walls``, and the vehicle, shape (ends, ..., units) [m]."""
        return np.stack([_gap(wall, vehicle, poses, self.beyond_ends, np.inf) for wall in walls])

    def closed(self, reaches: FloatArray, size: float) -> tuple[Block, ...]:
        """Return walls at the ends: what ``size`` [m] has to spare of ``reaches`` (ends,) is shared between them."""
        spare = (size - self.base - float(reaches.sum())) / len(self.ends)
        return tuple(wall(name, angle, float(far) + spare) for (name, angle), far in zip(self.ends, reaches, strict=True))


def _gap(block: Block, vehicle: Vehicle, poses: Records, overhang: float, enough: float) -> FloatArray:
    """Return the room between a block and wheels, and bodies, which may reach over it by ``overhang`` [m]."""
    if overhang == 0.0:  # wheels lie within bodies, but for those of a bare drawbar's unit, which are all of it
        return block.gaps(poses, bodies_of(vehicle), enough)
    wheels = block.gaps(poses, wheels_of(vehicle), enough)
    return np.minimum(wheels, block.eroded(overhang).gaps(poses, bodies_of(vehicle), enough))


def site_of(template: Template, options: SiteOptions, vehicle: Vehicle) -> Site:
    """Return the site of a template.

    Raises:
        OptionError: an option that means nothing for it, or a site in which the vehicle does not even stand.

    """
    options.check_heeded(template)
    return replace(_without_clearance(template, options, vehicle), clearance=options.clearance or 0.0)


def _without_clearance(template: Template, options: SiteOptions, vehicle: Vehicle) -> Site:
    if template is Template.THREE_POINT:
        sides = (("far side", 0.5 * np.pi), ("near side", -0.5 * np.pi))
        return Site(template, (), sides, beyond_ends=options.overhang or 0.0)
    if template.docks:
        return _docks(template, _DOOR_SPACING_M if options.door_spacing is None else options.door_spacing, vehicle)
    width = _CARRIAGEWAY_M if options.width is None else options.width
    if width < vehicle.width:
        msg = f"the carriageway is {width:g} m wide, the {vehicle.name} {vehicle.width:g} m"
        raise OptionError(msg, hint="give a larger --width")
    overhang = _OVERHANG_M if options.overhang is None else options.overhang
    radius = _KERB_RADIUS_M if options.kerb_radius is None else options.kerb_radius
    right = _corner("right kerb", (0.5 * width, 0.0), 0.5 * np.pi, radius)
    if template is Template.HAMMERHEAD:
        left = _corner("left kerb", (-0.5 * width, 0.0), 0.0, radius)
        tips = (("left tip", np.pi), ("right tip", 0.0))
        return Site(template, (left, right, wall("far kerb", 0.5 * np.pi, width)), tips, overhang=overhang)
    beyond = () if options.beyond is None else (wall("end of the road", 0.5 * np.pi, width + options.beyond),)
    ahead = _corner("kerb beyond the arm", (0.5 * width, width), np.pi, radius)
    blocks = (wall("left kerb", np.pi, 0.5 * width), right, ahead, *beyond)
    return Site(template, blocks, (("tip of the arm", 0.0),), -0.5 * width, overhang)


def _corner(name: str, tip: tuple[float, float], first: float, radius: float) -> Block:
    """Return a block with a right angle at ``tip``, rounded; its faces' normals point to ``first`` and to a quarter turn from there."""
    middle = first + 0.25 * np.pi
    back = np.sqrt(2.0) * radius
    apex = (float(tip[0] - back * np.cos(middle)), float(tip[1] - back * np.sin(middle)))
    return Block(name, (apex,), first, first + 0.5 * np.pi, radius)


def dock_heading(template: Template) -> float:
    """Return the heading of a vehicle at its dock, the wall along x [rad]; it pulls out to the left, against x."""
    return 0.5 * np.pi if template is Template.DOCK_90 else 0.75 * np.pi


def _docks(template: Template, spacing: float, vehicle: Vehicle) -> Site:
    """Return the neighbours at a dock whose door lies at the origin, each as far along and across the axis as its door is."""
    if spacing <= vehicle.width:
        msg = f"doors {spacing:g} m apart leave no room between vehicles of {vehicle.width:g} m"
        raise OptionError(msg, hint="give a larger --door-spacing")
    heading, length, half = dock_heading(template), vehicle.reach_ahead + vehicle.reach_behind, 0.5 * vehicle.width
    step = -spacing / np.tan(heading)  # by which the next door on the left lies further ahead

    def at(ahead: float, left: float) -> tuple[float, float]:
        cos, sin = float(np.cos(heading)), float(np.sin(heading))
        return ahead * cos - left * sin, ahead * sin + left * cos

    towards = heading - 0.5 * np.pi  # normals of what stands on the left
    count = _NEIGHBOURS if template is Template.DOCK_45 else 1  # square to the wall the next one stands before all others
    left = [Block("left neighbour", (at(length + k * step, k * spacing - half),), towards, heading) for k in range(1, count + 1)]
    corners = at(length - step, -spacing - half), at(length - step, half - spacing)
    right = Block("right neighbour", corners, 0.5 * np.pi, heading + 0.5 * np.pi)  # and those behind it, along the wall
    if template is Template.DOCK_90:
        right = Block("right neighbour", corners[1:], heading, heading + 0.5 * np.pi)
    door = [Block("wall beside the door", (at(step, 0.5 * spacing),), towards, heading)] if template is Template.DOCK_45 else []
    return Site(template, (*left, right, *door), (("other side of the yard", 0.5 * np.pi),))
