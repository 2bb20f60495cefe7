"""From the features of a vector file to a road: one line that is chosen and joined, with its widths and what is beside it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

import numpy as np
import shapely

from hdvplan.arrays import FloatArray
from hdvplan.errors import RoadError
from hdvplan.road.checks import Unit, refuse_no_street
from hdvplan.road.crs import LONLAT, check_lonlat, is_geographic, looks_like_degrees, to_plane
from hdvplan.road.features import AREAS, LINES, POINTS, Beside, Feature, coordinates_of, flat, label_of, parts_of, role_of
from hdvplan.road.line import RawLeg, RawRoad
from hdvplan.road.options import RoadOptions, Role, unheeded
from hdvplan.road.parts import one_line
from hdvplan.road.properties import legs_among, with_properties
from hdvplan.road.recorded import smoothed_in_time, without_stops
from hdvplan.road.regions import EDGE, OPEN_M, Kind, Region, is_island, is_median, joined, seen, walls_of, without_spurs
from hdvplan.texts import counted, printable, some_of

_LISTED = 20  # lines that a question names
_UNREAD = 8  # layers that a note names
_LONGEST = 100  # letters of each
_METRES = Unit()
_Edge = tuple[FloatArray, list[shapely.Polygon], str]  # a line (n, 2) [m], walls that were drawn as its spurs, and its name


@dataclass(frozen=True)
class _Line:
    """A line feature's parts: their raw coordinates. Those of a drawing run in any direction: it knows none."""

    feature: Feature
    parts: list[Any]
    directed: bool = True


def road_of(features: list[Feature], name: str, options: RoadOptions, unit: Unit = _METRES, *, routes: bool = False) -> RawRoad:
    """Return the road, or the legs of a drive, among ``features``; ``name`` begins the messages.

    ``unit`` is that of coordinates without a system. A note tells which layers are not read, but not of
    ``routes``, whose layers are other roads and not what is beside one.

    Raises:
        RoadError: no line, several lines and none chosen, parts that do not join, impossible coordinates, several
            coordinate reference systems, or a unit that was given for nothing or is needed.

    """
    lines = _lines(features, name)
    _refuse_strange_roles(features, name, options)
    within = lines if options.layer is None else [line for line in lines if line.feature.layer == options.layer]
    legs = legs_among([line.feature for line in within], name) if options.feature is None else []
    chosen = [within[at] for at, _ in legs] if legs else [_chosen(lines, options, name)]
    parts = [coordinates_of(part, name) for line in chosen for part in line.parts]
    systems = {line.feature.system for line in chosen}
    if len(systems) > 1:
        msg = f"{name}: the legs are in {len(systems)} coordinate reference systems"
        raise RoadError(msg, hint="bring them into one system first: ogr2ogr -t_srs EPSG:N one.gpkg FILE")
    system = systems.pop()
    everything = np.concatenate(parts)
    notes: tuple[str, ...] = ()
    if system is None and looks_like_degrees(everything):
        notes = (f"{name}: coordinates are read as longitude and latitude, for metres they are too close together",)
        system = LONLAT
        features = [replace(feature, system=feature.system or LONLAT) for feature in features]
    if system is not None and unit.given is not None:
        what = f"{name}: a line in {'degrees' if is_geographic(system) else 'a coordinate reference system'}"
        raise unheeded(what, "unit")
    if system is not None and is_geographic(system):
        check_lonlat(everything, name)
    plane = None if system is None else to_plane(everything, system)
    whole = unit.metres * everything if plane is None else plane.points
    placed = np.split(whole, np.cumsum([len(part) for part in parts])[:-1])
    beside = Beside(name, system, plane, options, tuple(line.feature.geometry for line in chosen), unit.metres)
    sides = [(*beside.edges(feature), label_of(feature), feature.layer) for feature in features]
    pieces = [(edge, label, layer) for own, _, label, layer in sides for edge in own]
    before = pieces if legs else seen(pieces, shapely.MultiLineString(placed))
    hidden = sum(all(piece is not one for one in before) for piece in pieces)
    if hidden:
        notes = (*notes, f"{name}: {counted(hidden, 'edge')} left out where behind others")
    edges = [(*without_spurs(edge), label) for edge, label, _ in (before if legs else joined(before))]
    if system is None:
        refuse_no_street(placed, None, [edge for edge, _, _ in edges], unit, name)
    to_lonlat, rest = None if plane is None else plane.to_lonlat, iter(placed)
    drawn = [replace(_drawn(line, list(islice(rest, len(line.parts))), name, routes=routes), to_lonlat=to_lonlat) for line in chosen]
    regions = [Region(Kind.OBSTACLE, wall, label or EDGE) for _, walls, label in edges for wall in walls]
    if edges and not legs:
        edges, free, drawn[0] = _free(edges, drawn[0], name)
        regions += free
    regions += [Region(Kind.OBSTACLE, shapely.Polygon(hole), label) for _, holes, label, _ in sides for hole in holes]
    for feature in features:
        regions += beside.regions(feature, len(regions) + 1)
    walls, told = _walls(features, beside, name)
    regions += walls
    unread = () if routes else _unread_note(features, lines, chosen, name, options, unit.metres)
    if options.feature is None and any(role_of(line.feature, options) is Role.EDGE for line in chosen):
        notes = (*notes, f"{name}: the line that is driven along is a kerb by its name or layer: is it the right one?")
    return replace(
        drawn[0],
        points=np.concatenate([one.points for one in drawn]),
        regions=tuple(regions),
        edges=tuple(edge for edge, _, _ in edges),
        edge_names=tuple(label for _, _, label in edges),
        notes=(*notes, *dict.fromkeys(note for one in drawn for note in one.notes), *unit.notes(name, system), *told, *unread),
        legs=tuple(RawLeg(one, backward) for one, (_, backward) in zip(drawn, legs, strict=False)),
    )


def _free(edges: list[_Edge], road: RawRoad, name: str) -> tuple[list[_Edge], list[Region], RawRoad]:
    """Return edges without those that the road passes on both sides, these as obstacles, and the road, open if no others are left."""
    free, left, line = list[Region](), edges, road.points
    drawn = shapely.STRtree([shapely.LineString(edge) for edge, _, _ in edges])
    pieces = shapely.STRtree(np.asarray(shapely.linestrings(np.stack([line[:-1], line[1:]], axis=1))))
    for edge, _, label in edges:
        others = [one for one in left if one[0] is not edge]
        median = is_median(edge, drawn, pieces)
        if median or is_island(edge, [other for other, _, _ in others], line):
            left = others
            free += [Region(Kind.OBSTACLE, area, label or EDGE) for area in (walls_of([edge]) if median else [shapely.Polygon(edge)])]
    if free and not left and road.reaches is None:
        told = f"{name}: no edge but between arms of the line: the street is open to {OPEN_M:g} m"
        road = replace(road, reaches=np.full((4, len(line)), OPEN_M), notes=(*road.notes, told))
    return left, free, road


def _drawn(line: _Line, parts: list[FloatArray], name: str, *, routes: bool) -> RawRoad:
    """Return a line with what its own properties say; ``parts`` are its own in the plane, of ``routes`` perhaps recorded ones."""
    times = line.feature.times
    points, notes = one_line(parts, name, directed=line.directed, recorded=times is not None)
    if times is not None and len(times) == len(points):
        points, told = smoothed_in_time(points, times, name)
        notes += told
    if routes:
        points, stops = without_stops(points, name)
        notes += stops
    raw = with_properties(points, line.feature.properties, name, parts=len(parts))
    return replace(raw, notes=(*raw.notes, *notes))


def _walls(features: list[Feature], beside: Beside, name: str) -> tuple[list[Region], list[str]]:
    """Return what lines that are not closed make where areas are expected, layer by layer, and notes on it.

    Raises:
        RoadError: those of a sweepable area enclose nothing: wheels would not be kept off it.

    """
    drawn: dict[tuple[str, Role], list[FloatArray]] = {}
    points = Counter[str]()
    for feature in features:
        key = label_of(feature), role_of(feature, beside.options) or Role.EDGE
        drawn.setdefault(key, []).extend(beside.open_lines(feature))
        points[key[0]] += key[1] in AREAS and any(geometry["type"] in POINTS for geometry in flat(feature.geometry))
    regions, notes = list[Region](), list[str]()
    for (label, role), lines in drawn.items():
        if not lines:
            continue
        walls, what = walls_of(lines), f"{name}: {counted(len(lines), 'line')} of {label!r} with open ends"
        if role is Role.SWEEPABLE and not all(wall.interiors for wall in walls):
            msg = f"{what}: a sweepable area has an outline"
            raise RoadError(msg, hint="close it in the drawing, or give the layer the role of an edge")
        regions += [Region(Kind(role), shapely.Polygon(wall.exterior), label) for wall in walls]
        notes.append(f"{what}: taken as {'walls, and ' if role is Role.OBSTACLE else ''}what they enclose")
    sizeless = ((counted(count, "point"), label) for label, count in points.items() if count)
    notes += [f"{name}: NOT READ: {count} of {label!r}, without a size: draw circles" for count, label in sizeless]
    return regions, notes


def _lines(features: list[Feature], name: str) -> list[_Line]:
    return [
        _Line(feature, parts_of(geometry, name)) for feature in features for geometry in flat(feature.geometry) if geometry["type"] in LINES
    ]


def _refuse_strange_roles(features: list[Feature], name: str, options: RoadOptions) -> None:
    """Refuse a role for what is not in the file: kerbs would be passed over for a letter."""
    known = {label for feature in features for label in (*feature.labels, feature.layer)}
    strange = next((given for given in options.named_roles if given not in known), None)
    if strange is not None:
        role = options.named_roles[strange]
        msg = f"{name}: nothing is called {strange!r}, which has the role {role}; there are {_layers_among(features)}"
        raise RoadError(msg, hint="--role takes the name of a layer or of a feature, as it is in the file")


def _layers_among(features: Iterable[Feature]) -> str:
    return ", ".join(map(repr, sorted({feature.layer for feature in features if feature.layer}))) or "no layers"


def _chosen(lines: list[_Line], options: RoadOptions, name: str) -> _Line:
    if not lines:
        msg = f"{name}: no LineString or MultiLineString in it"
        raise RoadError(msg, hint="a road is a line feature; some simplified map exports have no geometry")
    there = lines if options.layer is None else [line for line in lines if line.feature.layer == options.layer]
    if not there:
        msg = f"{name}: no line in a layer called {options.layer!r}; there are {_layers_among(line.feature for line in lines)}"
        raise RoadError(msg)
    if options.feature is None:
        without = [line for line in there if role_of(line.feature, options) is None]
        matching = without if options.layer is None and without else there
    else:
        matching = [line for line in there if options.feature in line.feature.labels]
    if len(matching) == 1:
        return matching[0]
    if options.layer is not None and options.feature is None and all(line.feature.drawn for line in matching):
        return _Line(matching[0].feature, [part for line in matching for part in line.parts], directed=False)
    listed = _listed(matching or there)
    if options.feature is None and not any(role_of(line.feature, options) is None for line in there):
        msg = f"{name}: {len(there)} lines, all of them kerbs or obstacles by --role or their names: {listed}"
        raise RoadError(msg, hint="draw the line that is driven along, too, in a layer of its own; or choose one with --name or --id")
    if options.feature is None:
        msg = f"{name}: {len(matching)} lines, and none is chosen: {listed}"
        several = len({line.feature.layer for line in matching}) > 1
        if several and all(line.feature.drawn for line in matching):
            msg = f"{name}: {len(matching)} lines, and none is chosen; they are in layers {_layers_among(one.feature for one in matching)}"
            raise RoadError(msg, hint="choose the road's with --layer, and say with --role LAYER=edge what kerbs are")
        hint = "choose one with --name or --id" + (" or --layer" if several else "")
        if all(line.feature.drawn for line in matching):
            hint = "choose the one that is driven along with --id; if all are kerbs, draw it, too, in a layer of its own"
        raise RoadError(msg, hint=hint)
    if matching:
        msg = f"{name}: {len(matching)} lines are called {options.feature!r}"
        raise RoadError(msg, hint="choose by a unique --id")
    msg = f"{name}: no line is called {options.feature!r}; there are {listed}"
    raise RoadError(msg)


def _unread_note(
    features: list[Feature], lines: list[_Line], chosen: list[_Line], name: str, options: RoadOptions, metres: float
) -> tuple[str, ...]:
    """Return a note on the layers that are not read beside those of the ``chosen`` lines, and how one would be; none without any.

    Of a drawing, whose unit is ``metres`` long, it tells which of them lie nearer the line than all that is read.
    """
    read = [feature for feature in features if feature.properties.get("region") or role_of(feature, options)]
    used = {"", *(line.feature.layer for line in chosen), *(feature.layer for feature in read)}
    unread: dict[str, list[Feature]] = {}
    for feature in features:
        if feature.layer not in used:
            unread.setdefault(feature.layer, []).append(feature)
    if not unread:
        return ()
    near = {layer: metres * _apart(chosen, [line for line in lines if line.feature.layer == layer]) for layer in unread}
    least = metres * _apart(chosen, [line for line in lines if any(line.feature is one for one in read)])
    nearer = sorted((layer for layer in unread if near[layer] < least < np.inf), key=lambda layer: near[layer])
    layers = [*nearer, *(layer for layer in unread if layer not in nearer)]
    shown = [printable(layer)[:_LONGEST] for layer in layers]
    entities = [counted(len(unread[layer]), "entity", "entities") for layer in layers]
    listed = ", ".join(f"{one!r} ({count})" for one, count in zip(shown[:_UNREAD], entities, strict=False))
    listed += f" and {len(layers) - _UNREAD} more" if len(layers) > _UNREAD else ""
    several, reads = ("layers", "reads one") if len(layers) > 1 else ("layer", "reads it")
    told = f"{name}: NOT READ: {several} {listed}"
    if nearer:
        told += f"; {shown[0]!r} lies nearer the line, {near[nearer[0]]:.1f} m, than all that is read, {least:.1f} m"
    return (f'{told}; --role "{shown[0]}=edge" or =obstacle or =sweepable {reads}',)


def _apart(chosen: list[_Line], lines: list[_Line]) -> float:
    """Return how near drawn ``lines`` come to the chosen ones [the drawing's unit]; infinite without any."""
    own, others = (
        shapely.MultiLineString(
            [np.asarray(part, dtype=float)[:, :2] for one in those if one.feature.drawn for part in one.parts if len(part) > 1]
        )
        for those in (chosen, lines)
    )
    apart = float(shapely.distance(own, others))
    return apart if np.isfinite(apart) else np.inf


def _listed(lines: list[_Line]) -> str:
    """Return the names of lines, with their layers where there are several."""
    several = len({line.feature.layer for line in lines}) > 1
    names = (
        (repr(line.feature.labels[0][:_LONGEST]) if line.feature.labels else "(unnamed)")
        + (f" in {line.feature.layer!r}" if several else "")
        for line in lines
    )
    return some_of(names, _LISTED)
