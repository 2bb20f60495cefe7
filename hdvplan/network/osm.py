"""Read the routes of an OpenStreetMap file: relations, their ways, and where the nodes of these lie. The only user of osmium."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from itertools import count, pairwise
from pathlib import Path
from types import ModuleType
from typing import Any

from hdvplan.errors import RoadError
from hdvplan.texts import did_you_mean

_NOT_DRIVEN = ("platform", "stop")  # what such roles begin with
_MOST_NAMED = 8  # kinds of routes or refs that a message lists
_MOST_MEMBERS = 100_000  # of a route: the longest have some thousands
Place = tuple[float, float]
Places = Mapping[int, Place]  # of nodes, by their ids

_METRES_PER_DEGREE = 111_195.0  # of a great circle on a sphere of 6371 km


@dataclass(frozen=True)
class Member:
    """A member of a relation: ``kind`` is n, w or r, ``ref`` the id of a node, way or relation, ``role`` as it is mapped."""

    kind: str
    ref: int
    role: str = ""


@dataclass(frozen=True)
class Relation:
    """A relation of the map, its members in their order."""

    id: int
    tags: Mapping[str, str]
    members: tuple[Member, ...] = ()


@dataclass(frozen=True)
class Way:
    """A way of the map, its nodes in its own direction."""

    id: int
    nodes: tuple[int, ...]
    tags: Mapping[str, str] = field(default_factory=dict)

    @property
    def closed(self) -> bool:
        """Whether the way is a circle: it ends where it begins."""
        return len(self.nodes) > 3 and self.nodes[0] == self.nodes[-1]  # noqa: PLR2004 - a circle has three nodes


@dataclass(frozen=True)
class Routes:
    """The routes of a map: relations whose members are ways, or relations that are missing in the map; stops and platforms are left out.

    ``ways`` are those that the map holds whole, by id; ``places`` are longitude and latitude [deg] of their nodes, by id.
    """

    relations: tuple[Relation, ...]
    ways: Mapping[int, Way]
    places: Mapping[int, tuple[float, float]]


def read_routes(path: Path, kind: str, refs: tuple[str, ...] = ()) -> Routes:
    """Return the routes of one ``kind``, such as ``bus``, in an OpenStreetMap file (.osm.pbf, .osm, .osm.gz, ...).

    ``refs`` takes only the lines of these numbers. A route's members that are relations are replaced by their members. The file is read
    three times or a little more. Only what the routes need is kept, so that memory does not grow with the map.

    Raises:
        RoadError: osmium is not installed, the file cannot be read, or it has no such route.

    """
    source = _Source(_osmium(), path)
    try:
        with path.open("rb"):
            pass
        relations = _flattened(_chosen(source, kind, refs), source)
        ways = source.ways({member.ref for relation in relations for member in relation.members if member.kind == "w"})
        places = source.places({node for way in ways.values() for node in way.nodes})
    except OSError as error:
        msg = f"map {path} cannot be read: {error.strerror or error}"
        raise RoadError(msg) from error
    except (RuntimeError, ValueError) as error:  # what osmium raises of a file that it does not understand
        msg = f"{path.name} is no map that can be read, or it is cut off: {error}"
        raise RoadError(msg, hint="give an OpenStreetMap file, such as .osm.pbf or .osm; fetch it again if it is one") from error
    return Routes(relations, {key: way for key, way in ways.items() if len(way.nodes) > 1 and places.keys() >= set(way.nodes)}, places)


def _osmium() -> ModuleType:
    """Load osmium, which only maps need."""
    try:
        return import_module("osmium")
    except ImportError as error:
        msg = f"maps are read by osmium, which cannot be loaded: {error}"
        raise RoadError(msg, hint="pip install 'hdvplan[osm]'") from error


@dataclass(frozen=True)
class _Source:
    """A map that is read from its beginning each time: objects of osmium live only until the next one."""

    osmium: ModuleType
    path: Path

    def relations(self, keys: tuple[str, ...] = (), ids: Iterable[int] = ()) -> Iterator[Relation]:
        """Return the relations that have one of the tags ``keys``, or one of the ``ids``."""
        wanted = self.osmium.filter.KeyFilter(*keys) if keys else self.osmium.filter.IdFilter(ids)
        for one in self.osmium.FileProcessor(str(self.path), self.osmium.osm.RELATION).with_filter(wanted):
            yield Relation(one.id, _tags(one), tuple(Member(member.type, member.ref, member.role) for member in one.members))

    def ways(self, ids: set[int]) -> dict[int, Way]:
        """Return the ways of these ids that are in the map."""
        return {one.id: Way(one.id, tuple(node.ref for node in one.nodes), _tags(one)) for one in self._these(self.osmium.osm.WAY, ids)}

    def places(self, ids: set[int]) -> dict[int, tuple[float, float]]:
        """Return longitude and latitude [deg] of the nodes of these ids that are in the map."""
        return {one.id: (one.location.lon, one.location.lat) for one in self._these(self.osmium.osm.NODE, ids)}

    def _these(self, entity: object, ids: set[int]) -> Iterable[Any]:
        return self.osmium.FileProcessor(str(self.path), entity).with_filter(self.osmium.filter.IdFilter(ids)) if ids else ()


def _tags(one: Any) -> dict[str, str]:  # noqa: ANN401 - an object of osmium
    return {tag.k: tag.v for tag in one.tags}


def _chosen(source: _Source, kind: str, refs: tuple[str, ...]) -> list[Relation]:
    name, kinds, of_kind = source.path.name, Counter[str](), list[Relation]()
    for relation in source.relations(("route",)):  # of all kinds: only one is kept
        if relation.tags.get("type", "route") == "route":
            kinds[relation.tags["route"]] += 1
            of_kind += [relation] if relation.tags["route"] == kind else []
    if not of_kind:
        msg = f"{name} has no route relation with route={kind}"
        there = ", ".join(f"{other} ({count})" for other, count in kinds.most_common(_MOST_NAMED))
        raise RoadError(msg, hint=f"there are routes of other kinds: {there}" if there else "a cut of a map may have lost them")
    known = sorted({route.tags["ref"] for route in of_kind if "ref" in route.tags})
    unknown = [ref for ref in refs if ref not in known]
    if unknown:
        msg = f"{name} has no route={kind} with ref={unknown[0]}"
        raise RoadError(msg, hint=did_you_mean(unknown[0], known, f"there are {', '.join(known[:_MOST_NAMED]) or 'none with a ref'}"))
    return [route for route in of_kind if not refs or route.tags.get("ref") in refs]


def _flattened(routes: list[Relation], source: _Source) -> tuple[Relation, ...]:
    """Return routes with the members of their member relations in the place of these; stops and platforms are left out."""
    known: dict[int, Relation] = {route.id: route for route in routes}
    missing: set[int] = set()
    while ahead := {member.ref for one in known.values() for member in _driven(one) if member.kind == "r"} - known.keys() - missing:
        known |= {relation.id: relation for relation in source.relations(ids=ahead)}
        missing |= ahead - known.keys()
    return tuple(replace(route, members=tuple(_members(route, known, (), count()))) for route in routes)


def _members(relation: Relation, known: Mapping[int, Relation], above: tuple[int, ...], seen: Iterator[int]) -> Iterator[Member]:
    for member in _driven(relation):
        if next(seen) >= _MOST_MEMBERS:  # relations that hold others twice, which do so too, double with each
            msg = f"relation {(*above, relation.id)[0]} has more than {_MOST_MEMBERS} members, with those of the relations in it"
            raise RoadError(msg)
        if member.kind == "w" or member.ref not in known:
            yield member
        elif member.ref not in (*above, relation.id):  # a relation in itself ends there
            yield from _members(known[member.ref], known, (*above, relation.id), seen)


def _driven(relation: Relation) -> list[Member]:
    return [member for member in relation.members if member.kind in {"w", "r"} and not member.role.startswith(_NOT_DRIVEN)]


def length_of(nodes: Sequence[int], places: Places) -> float:
    """Return the length of a line of nodes [m]."""
    return sum(distance(places[a], places[b]) for a, b in pairwise(nodes))


def distance(a: Place, b: Place) -> float:
    """Return the distance of two places [m], to half a per cent."""
    return math.hypot(*_from(a, b)) * _METRES_PER_DEGREE


def turn(before: Place, at: Place, after: Place) -> float:
    """Return by how much a line turns at a place [deg], without sign."""
    (x, y), (u, v) = _from(before, at), _from(at, after)
    return abs(math.degrees(math.atan2(x * v - y * u, x * u + y * v)))


def _from(a: Place, b: Place) -> Place:
    """Return the way from a place to one near by, east and north, in degrees of a great circle."""
    east = (b[0] - a[0] + 180.0) % 360.0 - 180.0  # across the antimeridian too
    return east * math.cos(math.radians(0.5 * (a[1] + b[1]))), b[1] - a[1]
