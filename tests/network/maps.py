"""Maps as files: OpenStreetMap XML of a few nodes, ways and relations."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from xml.sax.saxutils import quoteattr

from hdvplan.network.osm import Relation, Way
from tests.network.town import PLACES

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
