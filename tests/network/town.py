"""A small town for routes: a grid of nodes some 100 m apart, and a roundabout; and maps of it as files."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from xml.sax.saxutils import quoteattr

from hdvplan.network.osm import Member, Relation, Way
from hdvplan.network.stitch import Finding, Part, Trouble, stitched

_LON, _LAT, _STEP = 9.5, 47.1, 0.001  # deg; a step is 76 m east, 111 m north
_RING = 0.0002  # radius of the roundabout [deg]

PLACES = {100 * row + column: (_LON + _STEP * column, _LAT + _STEP * row) for row in range(1, 9) for column in range(9)}
EAST, NORTH, WEST, SOUTH = 901, 902, 903, 904  # of the roundabout, which lies around node 404
for _node, (_x, _y) in zip((EAST, NORTH, WEST, SOUTH), ((1, 0), (0, 1), (-1, 0), (0, -1)), strict=True):
    PLACES[_node] = (PLACES[404][0] + _RING * _x, PLACES[404][1] + _RING * _y)

RING = (EAST, NORTH, WEST, SOUTH, EAST)  # counter-clockwise, as traffic runs where it keeps to the right


def way(number: int, *nodes: int, **tags: str) -> Way:
    """Return a way; underscores in the names of tags are colons."""
    return Way(number, nodes, {key.replace("_", ":"): value for key, value in tags.items()})


def stitch(*ways: Way, order: tuple[int | tuple[int, str], ...] = ()) -> tuple[list[tuple[int, ...]], list[Finding]]:
    """Return the nodes of every part of a route over ways, and what is wrong; ``order`` has ids, or ids with roles."""
    parts, findings = parts_of(*ways, order=order)
    return [part.nodes for part in parts], findings


def parts_of(*ways: Way, order: tuple[int | tuple[int, str], ...] = ()) -> tuple[tuple[Part, ...], list[Finding]]:
    """Return the parts of a route over ways, and what is wrong; as ``stitch``."""
    members = [Member("w", *one) if isinstance(one, tuple) else Member("w", one) for one in order or [one.id for one in ways]]
    parts, findings = stitched(members, {one.id: one for one in ways}, PLACES)
    return parts, list(findings)


def kinds(findings: list[Finding]) -> list[Trouble]:
    """Return what kinds of things are wrong."""
    return [finding.trouble for finding in findings]


_KINDS = {"n": "node", "w": "way", "r": "relation"}


def write_map(path: Path, ways: Collection[Way], relations: Collection[Relation], *, without: Collection[int] = ()) -> Path:
    """Write ways with their nodes, but for those ``without``, and relations to ``path``; return it."""
    nodes = sorted({node for way in ways for node in way.nodes} - set(without))
    lines = ["<?xml version='1.0' encoding='UTF-8'?>", '<osm version="0.6">']
    lines += [f'<node id="{node}" version="1" lon="{PLACES[node][0]:.7f}" lat="{PLACES[node][1]:.7f}"/>' for node in nodes]
    for way in sorted(ways, key=lambda one: one.id):
        lines += [f'<way id="{way.id}" version="1">', *(f'<nd ref="{node}"/>' for node in way.nodes), *_tags(way.tags), "</way>"]
    for relation in sorted(relations, key=lambda one: one.id):
        members = [f'<member type="{_KINDS[one.kind]}" ref="{one.ref}" role="{one.role}"/>' for one in relation.members]
        lines += [f'<relation id="{relation.id}" version="1">', *members, *_tags(relation.tags), "</relation>"]
    path.write_text("\n".join([*lines, "</osm>\n"]), encoding="utf-8")
    return path


def _tags(tags: Mapping[str, str]) -> list[str]:
    return [f"<tag k={quoteattr(key)} v={quoteattr(value)}/>" for key, value in tags.items()]
