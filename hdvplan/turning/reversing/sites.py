"""The sites in which manoeuvres are driven: a street, turning heads, docks.

Every site is a set of blocks that stand, and of ends that are moved until the site is as small as the manoeuvre allows. All turns are to
the left; where one drives on the left, it is the mirror image.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hdvplan.arrays import FloatArray, Records
from hdvplan.errors import OptionError
from hdvplan.turning.reversing.blocks import Block, bodies_of, reach, wall, wheels_of
from hdvplan.turning.reversing.options import SiteOptions, Template
from hdvplan.vehicle.model import Vehicle

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
