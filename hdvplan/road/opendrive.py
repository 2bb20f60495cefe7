"""OpenDRIVE as a file has it: reference lines of lines, arcs, spirals and cubics, and lanes of varying width beside them.

Names and meanings are those of ASAM OpenDRIVE 1.8. Lateral positions t are positive to the left of the reference line;
lanes have positive numbers on its left, negative ones on its right, counted from the middle.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from hdvplan.arrays import FloatArray
from hdvplan.errors import RoadError

DRIVEN = {"driving", "bidirectional", "entry", "exit", "onRamp", "offRamp", "connectingRamp", "slipLane", "bus", "taxi", "HOV"}
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)  # exact to rounding over several radians
_CURVES = ("line", "arc", "spiral", "poly3", "paramPoly3")
SAME_M = 1e-6  # arclengths of sections and of their functions that are meant to be the same differ by rounding
LONGEST_M = 200e3  # of a road, and of the way that is driven
_SHORTEST_M = 1e-9  # of a geometry
_LARGEST = 1e9  # of any number: from here on powers of it come to the end of what floats hold
_STEP_M = 1e-3  # for the curvature's derivative
_CELL_M = 0.05  # of a cubic's arclength


@dataclass(frozen=True)
class Pose:
    """Points of a line: x, y [m], heading [rad], curvature [1/m] and its derivative along the line [1/m^2]; equal shapes."""

    x: FloatArray
    y: FloatArray
    heading: FloatArray
    curvature: FloatArray
    sharpness: FloatArray


@dataclass(frozen=True)
class Geometry:
    """One record of a reference line: where it begins, how long it is [m], and its curve's numbers.

    ``values`` are the curvatures at both ends of a line, an arc or a spiral [1/m], the four coefficients of a poly3, or the
    eight of a paramPoly3, whose parameter runs to ``extent``.
    """

    s: float
    x: float
    y: float
    heading: float
    length: float
    kind: str
    values: tuple[float, ...]
    extent: float = 1.0

    def at(self, u: FloatArray) -> Pose:
        """Return the points at distances ``u`` [m] from the record's start."""
        along, across, heading, curvature = self._local(u)
        cos, sin = np.cos(self.heading), np.sin(self.heading)
        before, after = np.clip(u - _STEP_M, 0.0, self.length), np.clip(u + _STEP_M, 0.0, self.length)
        change = (self._local(after)[3] - self._local(before)[3]) / np.maximum(after - before, _STEP_M)
        return Pose(self.x + cos * along - sin * across, self.y + sin * along + cos * across, self.heading + heading, curvature, change)

    def _local(self, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return position along and across the start's direction, and heading and curvature."""
        if self.kind == "poly3":
            return _cubic(self._parameter(u), (0.0, 1.0, 0.0, 0.0), self.values)
        if self.kind == "paramPoly3":
            return _cubic(u * (self.extent / self.length), self.values[:4], self.values[4:])
        first, last = self.values
        rate = (last - first) / self.length
        inner = 0.5 * u[..., None] * (_NODES + 1.0)
        turned = first * inner + 0.5 * rate * inner**2
        along, across = (0.5 * u * (function(turned) @ _WEIGHTS) for function in (np.cos, np.sin))
        return along, across, first * u + 0.5 * rate * u**2, first + rate * u

    def _parameter(self, u: FloatArray) -> FloatArray:
        """Return where on its own axis a poly3 has the arclengths ``u``."""
        grid = np.linspace(0.0, self.length, max(2, int(np.ceil(self.length / _CELL_M))) + 1)
        half = 0.5 * np.diff(grid)
        _, b, c, d = self.values
        speed = [np.hypot(1.0, b + x * (2.0 * c + 3.0 * d * x)) for x in (grid[:-1, None] + half[:, None] * (_NODES + 1.0), grid)]
        arclength = np.concatenate([[0.0], np.cumsum(speed[0] @ _WEIGHTS * half)])
        return np.asarray(CubicHermiteSpline(arclength, grid, 1.0 / speed[1])(u))


def _cubic(p: FloatArray, along: tuple[float, ...], across: tuple[float, ...]) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    (x, dx, ddx), (y, dy, ddy) = (
        (a + p * (b + p * (c + p * d)), b + p * (2.0 * c + 3.0 * d * p), 2.0 * c + 6.0 * d * p) for a, b, c, d in (along, across)
    )
    return x, y, np.arctan2(dy, dx), (dx * ddy - dy * ddx) / np.hypot(dx, dy) ** 3


@dataclass(frozen=True)
class Cubics:
    """A function of s made of cubics, each from its own start: rows s, a, b, c, d in order of s; zero without any."""

    rows: FloatArray

    def at(self, s: FloatArray) -> FloatArray:
        """Return value, first and second derivative at ``s``, stacked; shape (3, ...)."""
        if not len(self.rows):
            return np.zeros((3, *s.shape))
        row = self.rows[np.clip(np.searchsorted(self.rows[:, 0], s + SAME_M, side="right") - 1, 0, len(self.rows) - 1)]
        u, (a, b, c, d) = s - row[..., 0], np.moveaxis(row[..., 1:], -1, 0)
        return np.stack([a + u * (b + u * (c + u * d)), b + u * (2.0 * c + 3.0 * d * u), 2.0 * c + 6.0 * d * u])


@dataclass(frozen=True)
class Lane:
    """A lane of a section: its kind, its width over s from the section's start, and the lanes that it goes on in."""

    number: int
    kind: str
    width: Cubics
    before: int | None
    after: int | None


@dataclass(frozen=True)
class Section:
    """The lanes between two arclengths [m] of a road, by their number."""

    start: float
    end: float
    lanes: dict[int, Lane]


@dataclass(frozen=True)
class OdrRoad:
    """A road: its reference line, the lanes' offset from it, and its sections; ``left_hand`` says on which side it is driven."""

    number: str
    length: float
    geometries: tuple[Geometry, ...]
    offset: Cubics
    sections: tuple[Section, ...]
    left_hand: bool

    def reference(self, s: FloatArray) -> Pose:
        """Return the points of the reference line at arclengths ``s`` [m]."""
        starts = np.array([geometry.s for geometry in self.geometries])
        which = np.clip(np.searchsorted(starts, s, side="right") - 1, 0, len(starts) - 1)
        out = np.empty((5, len(s)))
        for number, geometry in enumerate(self.geometries):
            at = which == number
            pose = geometry.at(s[at] - geometry.s)
            out[:, at] = pose.x, pose.y, pose.heading, pose.curvature, pose.sharpness
        return Pose(*out)

    def edges(self, section: Section, lane: int, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return t of a lane's inner and outer edge with two derivatives at ``s`` within the section; shape (3, n) each."""
        sign = 1 if lane > 0 else -1
        inner = self.offset.at(s)
        for number in range(1, abs(lane)):
            inner = inner + sign * section.lanes[sign * number].width.at(s - section.start)
        return inner, inner + sign * section.lanes[lane].width.at(s - section.start)


def read_roads(path: Path) -> tuple[dict[str, OdrRoad], str | None, tuple[str, ...]]:
    """Return the roads of an OpenDRIVE file by their id, the projection that their coordinates are in, if it says so, and notes on these.

    Where the header has an offset, roads are turned by its heading, then moved by it, into that projection (ASAM OpenDRIVE 1.8, 8.5).

    Raises:
        RoadError: the file is no OpenDRIVE, is cut off, or has a road that cannot be used; says which.

    """
    try:
        root = ET.parse(path).getroot()  # noqa: S314 - expat itself limits how far entities grow
    except (ET.ParseError, LookupError, ValueError) as error:  # the last two of an encoding that expat does not read
        msg = f"{path.name} is not XML, or was cut off: {error}"
        raise RoadError(msg) from error
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]  # newer files have a namespace
    if root.tag != "OpenDRIVE":
        msg = f"{path.name} is not an OpenDRIVE file: it begins with <{root.tag}>"
        raise RoadError(msg)
    roads: dict[str, OdrRoad] = {}
    for element in root.iter("road"):
        number = element.get("id", "")
        try:
            roads[number] = _road(element, number)
        except (ValueError, KeyError, StopIteration) as error:
            msg = f"{path.name}: road {number!r} cannot be used: {error.args[0] if error.args else 'it lacks a part'}"
            raise RoadError(msg) from error
    if not roads:
        msg = f"{path.name} has no roads"
        raise RoadError(msg)
    projection, offset = root.findtext("header/geoReference"), root.find("header/offset")
    if projection is None or offset is None:
        return roads, projection, ()
    try:
        x, y, turn = (_number(offset, name, 0.0) for name in ("x", "y", "hdg"))
    except ValueError as error:
        msg = f"{path.name}: {error}"
        raise RoadError(msg) from error
    if x == y == turn == 0.0:
        return roads, projection, ()
    moved = {number: replace(road, geometries=tuple(_moved(one, x, y, turn) for one in road.geometries)) for number, road in roads.items()}
    how = f" and turned by {np.degrees(turn):.4f} degrees" * (turn != 0.0)
    return moved, projection, (f"{path.name}: coordinates are moved by the header's offset x {x:.1f}, y {y:.1f} m{how}",)


def _moved(geometry: Geometry, x: float, y: float, turn: float) -> Geometry:
    cos, sin = np.cos(turn), np.sin(turn)
    place = {"x": x + cos * geometry.x - sin * geometry.y, "y": y + sin * geometry.x + cos * geometry.y}
    return replace(geometry, **place, heading=geometry.heading + turn)


def _number(element: ET.Element, name: str, default: float | None = None) -> float:
    text = element.get(name)
    if text is None and default is not None:
        return default
    try:
        value = float(text or "")
    except ValueError:
        value = np.nan
    if not abs(value) <= _LARGEST:
        msg = f"{name} of <{element.tag}> is {text and text[:40]!r}, not a number{'' if np.isnan(value) else ' that can be used'}"
        raise ValueError(msg)
    return value


def _road(element: ET.Element, number: str) -> OdrRoad:
    geometries = sorted((_geometry(item) for item in element.iterfind("planView/geometry")), key=lambda geometry: geometry.s)
    if not geometries:
        msg = "it has no geometry"
        raise ValueError(msg)
    length = geometries[-1].s + geometries[-1].length
    found = element.findall("lanes/laneSection")
    starts = [*(_number(item, "s") for item in found), length]
    if max(starts) - min(starts) > LONGEST_M:
        msg = f"it is {1e-3 * (max(starts) - min(starts)):.0f} km long; at most {1e-3 * LONGEST_M:.0f} km are read"
        raise ValueError(msg)
    sections = tuple(_section(item, lo, hi) for item, lo, hi in zip(found, starts[:-1], starts[1:], strict=True) if hi > lo)
    offset = _cubics(element.findall("lanes/laneOffset"), "s")
    return OdrRoad(number, length, tuple(geometries), offset, sections, element.get("rule") == "LHT")


def _geometry(element: ET.Element) -> Geometry:
    curve = next((child for child in element if child.tag in _CURVES), None)
    length = _number(element, "length")
    if curve is None or length < _SHORTEST_M:
        msg = f"the geometry at s = {element.get('s')} has no curve or no length"
        raise ValueError(msg)
    s, x, y, heading = (_number(element, name) for name in ("s", "x", "y", "hdg"))
    extent = 1.0
    if curve.tag == "line":
        values = [0.0, 0.0]
    elif curve.tag == "arc":
        values = [_number(curve, "curvature")] * 2
    elif curve.tag == "spiral":
        values = [_number(curve, "curvStart"), _number(curve, "curvEnd")]
    elif curve.tag == "poly3":
        values = [_number(curve, name) for name in "abcd"]
    else:
        values = [_number(curve, name + axis) for axis in "UV" for name in "abcd"]
        extent = length if curve.get("pRange") == "arcLength" else 1.0
    return Geometry(s, x, y, heading, length, curve.tag, tuple(values), extent)


def _section(element: ET.Element, start: float, end: float) -> Section:
    lanes: dict[int, Lane] = {}
    for item in element.iter("lane"):
        number = int(_number(item, "id"))
        if number and item.find("width") is None and item.find("border") is not None:
            msg = f"lane {number} has borders; widths are read"
            raise ValueError(msg)
        ends = [item.find(f"link/{name}") for name in ("predecessor", "successor")]
        before, after = (None if link is None else int(_number(link, "id")) for link in ends)
        lanes[number] = Lane(number, item.get("type", "none"), _cubics(item.findall("width"), "sOffset"), before, after)
    for sign in (1, -1):
        side = sorted(sign * number for number in lanes if sign * number > 0)
        gap = next((number for count, number in enumerate(side, start=1) if number != count), None)
        if gap is not None:
            msg = f"lane {sign * gap} has no lane {sign * (gap - 1)} beside it"
            raise ValueError(msg)
    return Section(start, end, lanes)


def _cubics(elements: list[ET.Element], start: str) -> Cubics:
    rows = sorted([_number(item, name, 0.0) for name in (start, "a", "b", "c", "d")] for item in elements)
    return Cubics(np.array(rows, dtype=float).reshape(len(rows), 5))
