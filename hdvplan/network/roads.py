"""A part of a route as a road file: GeoJSON as hdvplan loads it, with the tags and the width of every stretch."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import groupby

import numpy as np

from hdvplan.arrays import FloatArray, chord_of
from hdvplan.errors import OptionError
from hdvplan.fileio import json_bytes
from hdvplan.network.osm import Places, Relation
from hdvplan.network.stitch import Part
from hdvplan.road.crs import to_plane
from hdvplan.settings import METRES
from hdvplan.version import __version__

LANE_M = 3.25  # of a lane where the map says only how many there are
_NARROWEST_M, _WIDEST_M = 1.5, 60.0  # a carriageway of another width is an error in the map
_MOST_LANES = 16
_WIDTHS = ("width:carriageway", "width", "est_width")  # tags, in the order in which they are asked
_METRES = re.compile(r"(\d+(?:[.,]\d+)?)\s*(?:m|metres?|meters?)?")
_FEET = re.compile(r"(\d+)\s*'\s*(?:(\d+)\s*\"?)?|(\d+(?:\.\d+)?)\s*(?:ft|feet)")
_ROUTE_TAGS = ("ref", "name", "from", "via", "to", "operator", "network", "colour")
_WAY_TAGS = ("highway", "name", "lanes", "width", "maxspeed", "oneway", "surface", "junction", "bridge", "tunnel")
_LONGEST_REF = 40  # letters of a ref that a file's name holds

Json = dict[str, object]


@dataclass(frozen=True)
class Widths:
    """Widths where tags give none: of a ``lane`` [m], and the ``half_width`` of ways without width and lanes [m], or None.

    Raises:
        OptionError: a number that is no width.

    """

    lane: float = LANE_M
    half_width: float | None = None

    def __post_init__(self) -> None:
        """Refuse what is no width."""
        for what, value in (("lane's width", self.lane), ("half width", self.half_width)):
            if value is not None and not 0.0 < value < _WIDEST_M:
                msg = f"a {what} must be a positive number of metres below {_WIDEST_M:g}, not {value:g}"
                raise OptionError(msg)

    def half_of(self, tags: Mapping[str, str]) -> tuple[float | None, str]:
        """Return half the width of a way's carriageway [m], or None, and what it is from: ``width``, ``lanes``, ``option`` or ""."""
        found = (_length(tags.get(key, "")) for key in _WIDTHS)
        width = next((one for one in found if one is not None), None)
        if width is not None:
            return 0.5 * width, "width"
        lanes = _count(tags.get("lanes", ""))
        if lanes is not None:
            return 0.5 * lanes * self.lane, "lanes"
        return self.half_width, "" if self.half_width is None else "option"


USUAL = Widths()


def _length(text: str) -> float | None:
    """Return a length as maps write it, in metres or in feet and inches [m]; None where it is no width of a road."""
    metres, feet = _METRES.fullmatch(text.strip().lower()), _FEET.fullmatch(text.strip().lower())
    if metres is not None:
        length = float(metres[1].replace(",", "."))
    elif feet is not None:
        length = METRES["ft"] * (float(feet[3]) if feet[3] else float(feet[1]) + float(feet[2] or 0) / 12.0)
    else:
        return None
    return length if _NARROWEST_M <= length <= _WIDEST_M else None


def _count(text: str) -> float | None:
    """Return a number of lanes, which may be a fraction; None where it is none."""
    try:
        lanes = float(text)
    except ValueError:
        return None
    return lanes if 1.0 <= lanes <= _MOST_LANES else None


@dataclass(frozen=True)
class RouteRoad:
    """A road file of a route: its name, its length and how much of that has limits [m], and what makes its content.

    The contents of all roads of a country take more memory than its routes.
    """

    file: str
    length: float
    with_limits: float
    content: Callable[[], bytes]


@dataclass(frozen=True)
class Position:
    """Which part of a route: its number, from 1, of how many, and whether of the way back."""

    number: int = 1
    parts: int = 1
    back: bool = False


@dataclass(frozen=True)
class _Section:
    """Consecutive segments on one way, ``first`` to ``end``, and half the width of the road there [m]."""

    first: int
    end: int
    half_width: float | None
    properties: Json


def road_of_part(route: Relation, part: Part, at: Position, places: Places, widths: Widths, source: str) -> RouteRoad:
    """Return a part of a route as a road; ``source`` is the map's name.

    The line is the ways' own vertices, longitude and latitude; where the width changes, a vertex is there twice. Limits, half the width to
    either side of the line, are in it where every stretch has one.
    """
    s = chord_of(to_plane(_lonlat(part, places)).points)  # in the plane in which hdvplan will load it
    limited = float(sum(s[one.end] - s[one.first] for one in _sections(part, s, widths) if one.half_width is not None))
    return RouteRoad(_file_name(route, at), float(s[-1]), limited, partial(_content, route, part, at, places, widths, source, s))


def _content(route: Relation, part: Part, at: Position, places: Places, widths: Widths, source: str, s: FloatArray) -> bytes:
    """Return a road file; ``s`` are the lengths along the line at its vertices [m]."""
    lonlat, sections = _lonlat(part, places), _sections(part, s, widths)
    vertices, reaches = _vertices(lonlat, sections)
    tags = {key: route.tags[key] for key in _ROUTE_TAGS if key in route.tags}
    if at.back:
        tags |= {key: route.tags[other] for key, other in (("from", "to"), ("to", "from")) if other in route.tags}
    properties: Json = {
        **tags,
        "relation": route.id,
        "route": route.tags.get("route", ""),
        "direction": "back" if at.back else "there",
        "part": at.number,
        "parts": at.parts,
        "length_m": round(float(s[-1]), 3),
        **({} if reaches is None else {"left_m": reaches, "right_m": reaches}),
        "lane_m": widths.lane,
        "stretches": [one.properties for one in sections],
        "attribution": "© OpenStreetMap contributors",
        "licence": "ODbL-1.0",
        "source_file": source,
        "extracted_by": f"hdvplan {__version__}",
    }
    content: Json = {"type": "Feature", "properties": properties, "geometry": {"type": "LineString", "coordinates": vertices.tolist()}}
    return json_bytes(content, indent=None)


def _lonlat(part: Part, places: Places) -> FloatArray:
    return np.array([places[node] for node in part.nodes])


def _sections(part: Part, s: FloatArray, widths: Widths) -> list[_Section]:
    found, first = [], 0
    for way, segments in groupby(part.ways, key=lambda way: way):
        end = first + len(list(segments))
        half, from_ = widths.half_of(way.tags)
        properties: Json = {"s_from_m": round(float(s[first]), 3), "s_to_m": round(float(s[end]), 3), "way": way.id}
        properties |= {key: way.tags[key] for key in _WAY_TAGS if key in way.tags}
        found.append(_Section(first, end, half, properties | {"half_width_m": half, "half_width_from": from_}))
        first = end
    return found


def _vertices(lonlat: FloatArray, sections: list[_Section]) -> tuple[FloatArray, list[float] | None]:
    """Return the vertices of the line, those at a change of width twice, and the half widths at them [m]; None where one is unknown."""
    halves = [one.half_width for one in sections]
    known = [half for half in halves if half is not None]
    if len(known) < len(halves):
        return lonlat, None
    rows, reaches = [0], [known[0]]
    for number, (one, half) in enumerate(zip(sections, known, strict=True)):
        if number and half != known[number - 1]:
            rows.append(one.first)
            reaches.append(half)
        rows += range(one.first + 1, one.end + 1)
        reaches += [half] * (one.end - one.first)
    return lonlat[rows], reaches


def _file_name(route: Relation, at: Position) -> str:
    """Return what the file is called: kind, ref and relation, the direction if it is the way back, and the part where there are several."""
    words = [route.tags.get("route", "route"), route.tags.get("ref", "")[:_LONGEST_REF], str(route.id)]
    words += [*(["back"] if at.back else []), *([str(at.number)] if at.parts > 1 else [])]
    plain = [re.sub(r"[^\w.]+", "_", word).strip("._") for word in words]
    return "-".join(word for word in plain if word) + ".geojson"
