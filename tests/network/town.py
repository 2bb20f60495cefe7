"""A small town for routes: a grid of nodes some 100 m apart, and a roundabout."""

from __future__ import annotations

from hdvplan.network.osm import Member, Way
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
