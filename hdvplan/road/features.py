"""The features of vector files, whatever reads them: geometries as GeoJSON has them, names, and what they are beside a road."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.errors import OptionError, RoadError
from hdvplan.road.columns import folded
from hdvplan.road.options import OPTIONS

Json = dict[str, Any]
_IDS = ("name", "id", "@id", "osm_id", "ref")
LINES = {"LineString", "MultiLineString"}


class Role(StrEnum):
    """What a feature beside the line is."""

    OBSTACLE = "obstacle"
    SWEEPABLE = "sweepable"
    EDGE = "edge"


_SPELLINGS = {  # of layers with a role without --role; those of edges are also values of a property "edge", and names
    Role.OBSTACLE: "obstacle obstacles hinder hindernis hindernisse building buildings gebaude byggnad byggnader batiment batiments",
    Role.SWEEPABLE: "sweepable sweepables overrunnable uberfahrbar overkorbar",
    Role.EDGE: "left right left_edge right_edge edge_left edge_right edge_l edge_r left_kerb right_kerb kerb kerbs kerb_left kerb_right"
    " left_curb right_curb curb_left curb_right links rechts rand_links rand_rechts linker_rand rechter_rand fahrbahnrand vanster hoger"
    " vansterkant hogerkant vanster_kant hoger_kant kant_vanster kant_hoger vagkant gauche droite bord_gauche bord_droit",
}
_ROLES = {name: role for role, names in _SPELLINGS.items() for name in names.split()}


@dataclass(frozen=True)
class Feature:
    """A geometry as GeoJSON has it, what is known about it, the layer it lies in, and the system of its coordinates.

    Without a ``system`` coordinates are lengths in a plane of their own. ``drawn`` says that a drawing program made it, which
    knows closed lines and no polygons.
    """

    geometry: object
    properties: Json
    labels: tuple[str, ...] = ()
    layer: str = ""
    system: str | None = None
    drawn: bool = False


@dataclass(frozen=True)
class Choice:
    """Which feature is the road, in which layer, and what role other features or whole layers have, by their name."""

    feature: str | None = None
    layer: str | None = None
    roles: dict[str, Role] = field(default_factory=dict)


def roles_of(given: tuple[str, ...]) -> dict[str, Role]:
    """Return the roles in texts such as ``hoarding=obstacle``: the name of a layer or a feature, and what it is.

    Raises:
        OptionError: a text is not of this form, or names no role.

    """
    roles: dict[str, Role] = {}
    for text in given:
        name, _, role = text.rpartition("=")
        if not name or role not in list(Role):
            msg = f"--role {text!r} is not NAME=ROLE; a role is {', '.join(list(Role)[:-1])} or {list(Role)[-1]}"
            raise OptionError(msg, hint="NAME is a layer or a feature of the road file, such as --role hoarding=obstacle")
        roles[name] = Role(role)
    return roles


def refuse_unheeded(what: str, options: object, *names: str) -> None:
    """Refuse those ``options`` of these ``names`` that were given, for ``what`` cannot heed them.

    Raises:
        RoadError: one was given.

    """
    given = next((name for name in names if getattr(options, name) not in {None, ()}), None)
    if given is not None:
        raise unheeded(what, given)


def unheeded(what: str, option: str) -> RoadError:
    """Return the refusal of a given ``option``, as readers of roads call it, that has no meaning for ``what``."""
    return RoadError(f"{what} has no use for {OPTIONS[option]}", hint=f"leave {OPTIONS[option]} out")


def labels_of(item: Json) -> tuple[str, ...]:
    """Return what a GeoJSON feature may be called by: names and ids of its properties, then its own."""
    sources = (as_object(item.get("properties")), item)
    return tuple(str(source[key]) for source in sources for key in _IDS if source.get(key) is not None)


def as_object(member: object) -> Json:
    """Return a member of JSON that should be an object; an empty one where it is something else."""
    return member if isinstance(member, dict) else {}


def role_of(feature: Feature, choice: Choice) -> Role | None:
    """Return a feature's role: as the user says, as its property says, or as its layer or name says."""
    names = (*feature.labels, feature.layer)
    given = next((choice.roles[name] for name in names if name in choice.roles), None)
    if given is not None or feature.properties.get("region") is not None:
        return given
    edges = (str(feature.properties.get("edge", "")), *feature.labels[:1])
    return Role.EDGE if any(_ROLES.get(folded(name)) is Role.EDGE for name in edges) else _ROLES.get(folded(feature.layer))


def parts_of(geometry: Json, name: str) -> list[Any]:
    """Return the parts of a line geometry: their raw coordinates.

    Raises:
        RoadError: it has none.

    """
    coordinates = geometry.get("coordinates")
    parts = [coordinates] if geometry["type"] == "LineString" else coordinates
    if not isinstance(parts, list | tuple) or not parts:
        msg = f"{name}: a {geometry['type']} has no coordinates"
        raise RoadError(msg)
    return list(parts)


def is_finite(value: object) -> bool:
    """Tell a number from everything else that JSON can say, and from integers that no float can hold."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def flat(geometry: object) -> list[Json]:
    """Return the geometries of a GeoJSON geometry, those of a collection one by one; none where it is no geometry."""
    if not isinstance(geometry, dict) or not isinstance(geometry.get("type"), str):
        return []
    if geometry["type"] == "GeometryCollection":
        members = geometry.get("geometries")
        return [inner for member in members for inner in flat(member)] if isinstance(members, list | tuple) else []
    return [geometry]


def coordinates_of(part: object, name: str, *, fewest: int = 2) -> FloatArray:
    """Return the first two coordinates of a line's part or a ring, shape (n, 2); heights are dropped."""
    if not isinstance(part, list | tuple) or len(part) < fewest:
        what = "a line needs at least two points" if fewest == 2 else "a ring needs at least three points"  # noqa: PLR2004
        msg = f"{name}: {what}, this one has {len(part) if isinstance(part, list | tuple) else 0}"
        raise RoadError(msg)
    for number, position in enumerate(part, start=1):
        pair = position[:2] if isinstance(position, list | tuple) else ()
        if len(pair) < 2 or not all(is_finite(value) for value in pair):  # noqa: PLR2004
            msg = f"{name}: point {number} is not a pair of finite numbers: {json.dumps(position)[:60]}"
            raise RoadError(msg)
    return np.array([position[:2] for position in part], dtype=float)
