"""From a map to a folder of roads: every route of a kind, stitched, with a report of what is wrong with it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hdvplan.errors import RoadError
from hdvplan.fileio import Column, Together, json_bytes, read_json, table_bytes
from hdvplan.network.osm import Relation, Routes, read_routes
from hdvplan.network.roads import USUAL, Position, RouteRoad, Widths, road_of_part
from hdvplan.network.stitch import CUTS, Finding, Trouble, stitched
from hdvplan.road.scenarios import NOTICE
from hdvplan.version import __version__

RECORD = "extract.json"
REPORT = "report.csv"
_SHORTEST_M = 5.0  # what hdvplan loads as a road
_TAGS = ("ref", "name", "from", "to", "operator")

Json = dict[str, object]


@dataclass(frozen=True)
class Route:
    """A route of the map: the relation, the roads that it makes, and what is wrong with it."""

    relation: Relation
    roads: tuple[RouteRoad, ...]
    findings: tuple[Finding, ...]
    missing: int  # ways that are not in the map

    @property
    def label(self) -> str:
        """What messages call it."""
        ref = self.relation.tags.get("ref")
        return f"relation {self.relation.id}" + (f" (ref {ref})" if ref else "")

    @property
    def length(self) -> float:
        """Of all its roads [m]."""
        return sum(road.length for road in self.roads)

    def count(self, *troubles: Trouble) -> int:
        """Return the number of findings of these kinds."""
        return sum(finding.trouble in troubles for finding in self.findings)

    @property
    def whole(self) -> bool:
        """Whether all of it is one road, or one there and one back."""
        return bool(self.roads) and not self.count(*CUTS)


def extract(
    path: Path,
    directory: Path,
    *,
    kind: str = "bus",
    refs: tuple[str, ...] = (),
    widths: Widths = USUAL,
    on_progress: Callable[[float], None] | None = None,
) -> tuple[Route, ...]:
    """Write the routes of one ``kind`` in the map ``path`` into ``directory`` as road files, with ``report.csv`` and ``extract.json``.

    A route with gaps becomes several roads. Files of an earlier extraction in the folder are removed. ``on_progress`` receives the share of
    the routes that are stitched, 0 to 1.

    Raises:
        RoadError: osmium is missing, the file cannot be read, it has no such route, or no way of any.
        OptionError: the folder holds files of others.
        OSError: the folder or a file cannot be written.

    """
    found = read_routes(path, kind, refs)
    relations = Counter(_line(relation) for relation in found.relations)
    routes: list[Route] = []
    for relation in found.relations:
        alone = relations[_line(relation)] == 1
        routes.append(_route(relation, found, kind, widths, path.name, alone=alone))
        if on_progress is not None:
            on_progress(len(routes) / len(found.relations))
    if not any(route.roads for route in routes):
        msg = f"{path.name}: none of the {len(routes)} routes has a way in it"
        raise RoadError(msg, hint="take an extract of the map that holds the routes' ways and their nodes")
    contents: dict[str, Callable[[], bytes]] = {road.file: road.content for route in routes for road in route.roads}
    contents[REPORT] = lambda: table_bytes(_table(routes))
    contents[RECORD] = lambda: json_bytes(record_of(routes, path.name, kind, widths))
    Together(RECORD, _former(directory), {RECORD: "hdvplan_routes"}).write(directory, contents)
    return tuple(routes)


def _line(relation: Relation) -> tuple[str, ...]:
    """Return what relations of the same line have in common; a relation without a ref is a line by itself."""
    ref = relation.tags.get("ref")
    return (str(relation.id),) if ref is None else ("ref", ref, relation.tags.get("network", ""))


def _route(relation: Relation, found: Routes, kind: str, widths: Widths, source: str, *, alone: bool) -> Route:
    """Return a route: the way there, and the way back where its relation, ``alone`` on its line, is mapped for both directions at once."""
    roads: list[RouteRoad] = []
    findings: list[Finding] = []
    for back, members in ((False, relation.members), (True, relation.members[::-1])):
        if back and not (alone and any(finding.trouble is Trouble.OTHER for finding in findings)):
            break
        parts, found_here = stitched(members, found.ways, found.places, kind)
        for number, part in enumerate(parts, start=1):
            road = road_of_part(relation, part, Position(number, len(parts), back), found.places, widths, source)
            roads += [road] if road.length >= _SHORTEST_M else []
        findings += [replace(one, text=f"on the way back, {one.text}") for one in found_here] if back else found_here
    missing = sum(member.kind != "w" or member.ref not in found.ways for member in relation.members)
    return Route(relation, tuple(roads), tuple(findings), missing)


def record_of(routes: Sequence[Route], source: str, kind: str, widths: Widths) -> Json:
    """Return the content of ``extract.json``: the map, what was asked for, and every route with its files and findings."""
    found = [
        {
            "relation": route.relation.id,
            **{key: route.relation.tags.get(key) for key in _TAGS},
            "whole": route.whole,
            "members": len(route.relation.members),
            "missing": route.missing,
            "length_m": round(route.length, 3),
            "roads": [
                {"file": road.file, "length_m": round(road.length, 3), "with_limits_m": round(road.with_limits, 3)} for road in route.roads
            ],
            "findings": [
                {"kind": str(one.trouble), "cuts": one.trouble in CUTS, "text": one.text, "lon_lat": one.place} for one in route.findings
            ],
        }
        for route in routes
    ]
    asked: Json = {"source_file": source, "route": kind, "lane_m": widths.lane, "half_width_m": widths.half_width}
    return {**asked, "attribution": NOTICE, "version": __version__, "hdvplan_routes": found}


def _table(routes: Sequence[Route]) -> dict[str, Column]:
    cells = [
        {
            "relation": route.relation.id,
            **{key: route.relation.tags.get(key, "") for key in _TAGS},
            "whole": "yes" if route.whole else "no",
            "roads": len(route.roads),
            "ways": len(route.relation.members),
            "ways_missing": route.missing,
            "gaps": route.count(Trouble.GAP),
            "wrong_order": route.count(Trouble.ORDER),
            "turns_back": route.count(Trouble.TURN),
            "remarks": len(route.findings) - route.count(*CUTS),
            "length_m": f"{route.length:.1f}",
            "with_limits_m": f"{sum(road.with_limits for road in route.roads):.1f}",
            "findings": "; ".join(finding.text for finding in route.findings),
        }
        for route in routes
    ]
    return {key: Column(np.array([row[key] for row in cells], dtype=object)) for key in cells[0]}


def _former(directory: Path) -> tuple[str, ...]:
    """Return the road files that an earlier extraction wrote into a folder, as its record names them."""
    try:
        record = read_json(directory / RECORD)
        names = [road["file"] for route in record["hdvplan_routes"] for road in route["roads"]]
    except (OSError, ValueError, KeyError, TypeError):
        return ()
    return tuple(name for name in names if isinstance(name, str) and name.endswith(".geojson") and Path(name).name == name)
