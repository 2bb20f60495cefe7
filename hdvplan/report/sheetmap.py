"""The maps on a sheet: the road at the sheet's scale, and tight places enlarged with their clearance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch, Rectangle

from hdvplan.arrays import FloatArray, IntArray
from hdvplan.judging.bodies import corners, pose_at
from hdvplan.judging.result import Result, body_name
from hdvplan.report.colours import BREACH, INK, MUTED
from hdvplan.report.layers import Drawn, Layer, outline_places
from hdvplan.report.maps import outline_of
from hdvplan.report.pages import Page
from hdvplan.report.rooms import Room, pose_touching, room_at, tightness
from hdvplan.report.style import body_colour, body_dark, body_fill
from hdvplan.report.windows import peaks

_BARS_M = (200.0, 100.0, 50.0, 20.0, 10.0, 5.0, 2.0, 1.0)
_LONGEST_BAR_MM = 105.0
_INSET_SCALES = ((1000, 200), (200, 100), (0, 50))  # from this scale of the sheet on
BAND_MM = 15.0  # below the road, for scale bar and north arrow
_PLACES_APART_M = 15.0
_BESIDE_MM = 7.0  # of an enlarged place: its text
_LONG_SHARE = 0.3  # of an enlarged place's height: longer dimensions have room for their text
_INWARDS_M = 1.2  # that the road is looked at from an enlarged place
_NEAR_M = 6.0  # limits further out than this from the swept area do not move the stations' numbers
_TICKS_M = (5.0, 10.0, 20.0, 50.0, 100.0)
_TICK_MM = 28.0  # at least, between two
_ARROWS_MM = 70.0  # between arrows along the road
_SMALL, _TINY = 7.0, 6.0  # of type [pt]
_WHITE = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
_ALONG = {"arrowstyle": "-|>", "color": INK, "linewidth": 0.8, "mutation_scale": 9.0, "shrinkA": 0.0, "shrinkB": 0.0}


@dataclass(frozen=True)
class Ground:
    """What every map of a plan draws."""

    result: Result
    features: tuple[Drawn, ...]


@dataclass(frozen=True)
class Place:
    """A tight place with its letter."""

    letter: str
    room: Room


def places_of(result: Result, page: Page, most: int) -> tuple[Place, ...]:
    """Return the tightest places of a sheet, lettered in road order."""
    s, score = result.envelope.s, tightness(result)
    inside = np.where((s >= page.s_from) & (s <= page.s_to), score, -np.inf)
    found = sorted(peaks(s, inside, _PLACES_APART_M, most))
    return tuple(Place(chr(ord("A") + number), room_at(result, at)) for number, at in enumerate(found))


def draw_field(axes: Axes, ground: Ground, page: Page, size_mm: tuple[float, float], places: tuple[Place, ...]) -> None:
    """Draw a sheet's stretch of road, filling the axes, of ``size_mm``, exactly to scale."""
    _look(axes, (page.middle[0], page.middle[1] - 0.5 * BAND_MM * page.scale / 1e3), size_mm, page.scale)
    _draw_ground(axes, ground, page)
    drive = ground.result.drive
    stand = outline_places(ground.result, page.s_from, page.s_to)
    _draw_vehicles(axes, ground.result, page, np.array([pose_at(drive, s) for s in stand]))
    mm = page.scale / 1e3  # metres that a millimetre shows
    _draw_stations(axes, ground, page, mm)
    for place in places:
        edge = place.room.beyond
        (x, y), (u, v) = page.turned(np.array([edge, edge + 9.0 * mm * place.room.outwards]))
        colour = BREACH if place.room.broken else INK
        axes.annotate(
            place.letter, (x, y), (u, v), ha="center", va="center", fontsize=8.0, fontweight="bold", color="white", zorder=8,
            bbox={"boxstyle": "circle,pad=0.2", "facecolor": colour, "edgecolor": "white"}, arrowprops={"arrowstyle": "-", "color": colour},
        )  # fmt: skip
    _draw_bar(axes, page, size_mm)
    if ground.result.drive.road.to_lonlat is not None:
        _draw_north(axes, page)


def draw_inset(axes: Axes, ground: Ground, page: Page, place: Place, size_mm: tuple[float, float]) -> None:
    """Draw the surroundings of a tight place, larger, with the vehicle where it is tightest and the clearance as a dimension."""
    result, room = ground.result, place.room
    scale = next(inset for above, inset in _INSET_SCALES if page.scale >= above)
    ends = page.turned(room.ends)
    inwards = page.turned(np.array([room.ends[0], room.ends[0] - _INWARDS_M * room.outwards]))
    middle = (ends.mean(axis=0) if room.limited else ends[0]) + inwards[1] - inwards[0]
    _look(axes, (float(middle[0]), float(middle[1])), size_mm, scale)
    _draw_ground(axes, ground, page)
    _draw_vehicles(axes, result, page, np.array([pose_touching(result, room)]))
    colour = BREACH if room.broken else INK
    style = {"arrowstyle": "|-|", "color": colour, "linewidth": 1.0, "mutation_scale": 3.0, "shrinkA": 0.0, "shrinkB": 0.0}
    axes.annotate("", ends[1], ends[0], arrowprops=style, zorder=8)
    shown = float(np.hypot(*(ends[1] - ends[0]))) < _LONG_SHARE * size_mm[1] * scale / 1e3  # else the text stands on the dimension
    beside = page.turned((room.beyond + _BESIDE_MM * scale / 1e3 * room.outwards)[None])[0] if room.limited and shown else ends.mean(axis=0)
    axes.annotate(
        room.text,
        _point(beside),
        color=colour,
        fontsize=8.0,
        fontweight="bold",
        ha="center",
        va="center",
        bbox=_WHITE,
        zorder=9,
        clip_on=True,
    )
    body = body_name(result.drive.vehicle, room.unit)
    axes.text(
        0.02, 0.97, f"{place.letter}   1:{scale}   s = {room.s:.1f} m, {body}, {room.side}", transform=axes.transAxes, fontsize=_SMALL,
        va="top", fontweight="bold", bbox=_WHITE, zorder=9,
    )  # fmt: skip
    axes.add_patch(Rectangle((0.0, 0.0), 1.0, 1.0, transform=axes.transAxes, fill=False, edgecolor=INK, linewidth=0.5))


def _look(axes: Axes, middle: tuple[float, float], size_mm: tuple[float, float], scale: int) -> None:
    """Let the axes show exactly what their size on paper has room for."""
    half = [0.5 * side * scale / 1e3 for side in size_mm]
    axes.set_xlim(middle[0] - half[0], middle[0] + half[0])
    axes.set_ylim(middle[1] - half[1], middle[1] + half[1])


def _draw_ground(axes: Axes, ground: Ground, page: Page) -> None:
    """Draw all layers but vehicles and clearances; what lies beyond the axes is cut."""
    low, high = np.array(axes.viewLim.min), np.array(axes.viewLim.max)
    view = shapely.box(*(low - 1.0), *(high + 1.0))
    for feature in sorted(ground.features, key=_order):
        if feature.layer in {Layer.VEHICLES, Layer.CLEARANCE}:
            continue
        turned = shapely.transform(feature.geometry, page.turned)
        if not shapely.intersects(turned, view):
            continue
        seen = shapely.intersection(shapely.make_valid(turned), view)
        look = dict(_LOOKS[feature.layer])
        if feature.layer is Layer.ENVELOPE:
            body = int(feature.properties["body"] or 1) - 1
            look |= {"facecolor": body_fill(body), "edgecolor": body_colour(body)}
        elif feature.layer is Layer.TRACKS:
            look["color"] = body_dark(int(feature.properties["body"] or 1) - 1)
        elif feature.layer is Layer.LIMITS and feature.properties["binds"] == "overhangs":
            look["linestyle"] = (0, (1, 1.5))
        if isinstance(feature.geometry, shapely.LineString):
            for part in shapely.get_parts(seen):
                axes.plot(*np.asarray(shapely.get_coordinates(part)).T, **look)
        else:
            axes.add_patch(PathPatch(outline_of(seen), **look))


_LOOKS: dict[Layer, dict[str, Any]] = {
    Layer.ROAD: {"color": INK, "linewidth": 0.5, "linestyle": (0, (14, 3, 2, 3)), "zorder": 4},
    Layer.OBSTACLES: {"facecolor": "0.6", "edgecolor": INK, "linewidth": 0.6, "zorder": 2},
    Layer.SWEEPABLE: {"facecolor": "none", "edgecolor": MUTED, "hatch": "////", "linewidth": 0.4, "zorder": 2},
    Layer.ENVELOPE: {"linewidth": 0.6, "zorder": 1},
    Layer.LIMITS: {"color": INK, "linewidth": 1.0, "zorder": 5},
    Layer.TRACKS: {"linewidth": 0.5, "linestyle": (0, (5, 2)), "zorder": 3},
    Layer.CONFLICTS: {"facecolor": BREACH, "edgecolor": BREACH, "linewidth": 0.8, "zorder": 6},
}


def _point(place: FloatArray) -> tuple[float, float]:
    return float(place[0]), float(place[1])


def _order(feature: Drawn) -> int:
    """Return the place in the order of drawing: of the bodies the lead unit last, on top of what only the others sweep."""
    return -int(feature.properties["body"] or 0) if feature.layer is Layer.ENVELOPE else 0


def _draw_vehicles(axes: Axes, result: Result, page: Page, poses: IntArray) -> None:
    for bodies in corners(result.drive, poses):
        for unit, outline in enumerate(bodies):
            ring = page.turned(np.append(outline, outline[:1], axis=0))
            axes.plot(*ring.T, color=body_colour(unit), linewidth=0.9, zorder=6)
            if unit == 0:  # an arrow head says where its front is
                left, right, back = ring[0], ring[1], 0.12 * (ring[3] - ring[0])
                axes.plot(*np.array([left + back, 0.5 * (left + right), right + back]).T, color=body_colour(unit), linewidth=0.7, zorder=6)


def _draw_stations(axes: Axes, ground: Ground, page: Page, mm: float) -> None:
    """Draw ticks with their arclength across the road's centre, and arrows in the direction of travel."""
    path = ground.result.drive.road.path
    step = next((step for step in _TICKS_M if step / mm >= _TICK_MM), _TICKS_M[-1])
    for s in np.arange(np.ceil(page.s_from / step), np.floor(page.s_to / step) + 1) * step:
        edge = _edge_at(ground.result, s)
        offsets = np.array([-1.2 * mm, 1.2 * mm, edge + 0.8 * mm, edge + 2.0 * mm, edge + 4.2 * mm])
        ends = page.turned(np.column_stack(path.to_plane(np.full(5, s), offsets)))
        for tick in (ends[:2], ends[2:4]):
            axes.plot(*tick.T, color=INK, linewidth=0.5, zorder=5)
        axes.text(
            float(ends[4, 0]), float(ends[4, 1]), f"{s:.0f}", fontsize=_TINY, color=INK, ha="center", va="center", zorder=7, clip_on=True
        )
    count = max(1, int((page.s_to - page.s_from) / (_ARROWS_MM * mm)))
    for s in page.s_from + (np.arange(count) + 0.5) * (page.s_to - page.s_from) / count:
        tail, tip = page.turned(np.column_stack(path.to_plane(np.array([s, min(s + 8.0 * mm, path.length)]), 0.0)))
        axes.annotate("", tip, tail, arrowprops=_ALONG, zorder=7)


def _edge_at(result: Result, s: float) -> float:
    """Return how far left anything is drawn at ``s``: the swept area or a limit that is not far from it [m]."""
    at = min(int(np.searchsorted(result.envelope.s, s)), len(result.envelope.s) - 1)
    reach, limits = float(result.envelope.reach_left[at]), result.drive.road.beside
    if limits is None:
        return reach
    limit = float(limits.table(np.array([s]))[2, 0])
    return max(reach, limit) if limit < reach + _NEAR_M else reach


def _draw_bar(axes: Axes, page: Page, size_mm: tuple[float, float]) -> None:
    """Draw the scale bar into the lower left corner: in the data's metres, so that it is as long as what it measures."""
    mm = page.scale / 1e3
    longest = min(_LONGEST_BAR_MM, 0.6 * size_mm[0])
    metres = next((bar for bar in _BARS_M if bar / mm <= longest), _BARS_M[-1])
    x, y = axes.get_xlim()[0] + 6.0 * mm, axes.get_ylim()[0] + 6.0 * mm
    axes.plot([x, x + metres], [y, y], color=INK, linewidth=1.2, solid_capstyle="butt", zorder=9, gid="scale-bar")
    for part in range(6):
        at, high = x + metres * part / 5, 2.0 if part in {0, 5} else 1.2
        axes.plot([at, at], [y, y + high * mm], color=INK, linewidth=0.7, zorder=9)
    for at, text in ((0.0, "0"), (0.2, f"{metres / 5:g}"), (1.0, f"{metres:g} m")):
        axes.text(x + at * metres, y + 2.6 * mm, text, fontsize=_SMALL, ha="center", va="bottom", zorder=9)
    axes.text(x + 0.5 * metres, y + 2.6 * mm, f"1:{page.scale}", fontsize=8.0, fontweight="bold", ha="center", va="bottom", zorder=9)


def _draw_north(axes: Axes, page: Page) -> None:
    mm = page.scale / 1e3
    foot = np.array([axes.get_xlim()[1] - 10.0 * mm, axes.get_ylim()[0] + 9.5 * mm])
    north = np.array([-np.sin(page.turn), np.cos(page.turn)]) * 5.0 * mm
    axes.annotate("", _point(foot + north), _point(foot - north), arrowprops=_ALONG | {"linewidth": 1.2, "mutation_scale": 12.0}, zorder=9)
    axes.text(*_point(foot + 1.5 * north), "N", fontsize=9.0, fontweight="bold", ha="center", va="center", zorder=9)
