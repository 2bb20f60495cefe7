"""Maps of a plan, to scale: the layers of its drawing, the vehicle, letters and dimensions, and what makes a drawing a map."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.font_manager import FontProperties
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from matplotlib.transforms import ScaledTranslation
from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar  # type: ignore[import-untyped] # Matplotlib types only its core
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import FloatArray
from hdvplan.judging.bodies import corners, pose_at
from hdvplan.judging.result import Result
from hdvplan.report import BAND, BREACH, INK, MUTED, body_colour
from hdvplan.report.layers import Drawn, Layer, outline_places
from hdvplan.report.rooms import Room, Window, shown_reach
from hdvplan.report.style import BRIDGED, ON_WHITE, body_dark, body_fill, mark_broken, write_beside
from hdvplan.road.path import ReferencePath
from hdvplan.road.regions import outlines_of

Turn = Callable[[FloatArray], FloatArray]  # of points (n, 2) of the road's plane, as they lie on the paper
UNTURNED: Turn = np.asarray

SLIDE = 1.5  # how much thicker lines are on a slide than on a sheet of paper
_SPACING_M = 0.5
ROOM_M = 2.0  # around what a map shows
HEAD = 0.12  # of the lead unit's length: the arrow head in its front
_BARS_M = (1000.0, 500.0, 200.0, 100.0, 50.0, 20.0, 10.0, 5.0, 2.0, 1.0)
_SHARE = 0.3  # of the map's smaller side, at most
_ARROW_LONG = 0.05  # of the map's larger side
_NORTH_PT = 28.0  # length of its arrow

_LOOKS: dict[Layer, tuple[str, dict[str, Any]]] = {  # what the legend says, and how it is drawn on paper
    Layer.ENVELOPE: ("swept", {"linewidth": 0.6, "zorder": 1}),
    Layer.OBSTACLES: ("obstacle", {"facecolor": "0.6", "edgecolor": INK, "linewidth": 0.5, "zorder": 1.5}),
    Layer.SWEEPABLE: ("sweepable", {"facecolor": "none", "edgecolor": MUTED, "hatch": "////", "linewidth": 0.4, "zorder": 1.5}),
    Layer.KERBS: ("kerb or wall", {"color": INK, "linewidth": 1.0, "zorder": 4}),
    Layer.TRACKS: ("wheel tracks", {"linewidth": 0.5, "linestyle": (0, (5, 2)), "zorder": 2.5}),
    Layer.ROAD: (
        "road centre, s [m], direction of travel",
        {"color": MUTED, "linewidth": 0.5, "linestyle": (0, (14, 3, 2, 3)), "zorder": 2},
    ),
    Layer.LIMITS: ("limits", {"color": INK, "linewidth": 1.0, "zorder": 4}),
    Layer.CONFLICTS: ("beyond a limit", {"facecolor": BREACH, "edgecolor": BREACH, "linewidth": 0.8, "zorder": 4.5}),
    Layer.GUIDED_PATH: ("path", {"color": INK, "linewidth": 0.7, "linestyle": (0, (7, 3)), "zorder": 4}),
    Layer.WIDENING: (
        "to be widened (least area found)",
        {"facecolor": "none", "edgecolor": BREACH, "hatch": "xxxx", "linewidth": 1.0, "zorder": 6},
    ),
}


def draw_features(
    axes: Axes, features: Iterable[Drawn], view: BaseGeometry, *, weight: float = SLIDE, turned: Turn = UNTURNED
) -> list[BaseGeometry]:
    """Draw the layers of a drawing but vehicles and clearances, as far as they lie in ``view``; the first of a kind is labelled.

    Return what texts should not cover: lines, edges, and what is swept.
    """
    labels, taken, features = set[str](), list[BaseGeometry](), sorted(features, key=_order)
    names = {str(feature.properties.get("name") or "") for feature in features if feature.layer is Layer.OBSTACLES}
    for feature in features:
        if feature.layer not in _LOOKS:
            continue
        placed = shapely.transform(feature.geometry, turned)
        line = isinstance(placed, shapely.LineString)  # intersections of one that runs round and round would take minutes
        seen = shapely.clip_by_rect(placed, *view.bounds) if line else shapely.intersection(shapely.make_valid(placed), view)
        if seen.is_empty:
            continue
        label, look = _LOOKS[feature.layer]
        look = look | {"linewidth": weight * look["linewidth"]}
        body = int(feature.properties.get("body") or 1) - 1
        if feature.layer is Layer.ENVELOPE:
            label = swept_label(str(feature.properties["unit"]), body)
            look |= {"facecolor": body_fill(body), "edgecolor": body_colour(body)}
        elif feature.layer is Layer.OBSTACLES and len(names) == 1:  # "bus on short", which it meets
            label = "".join(names) or label
        elif feature.layer is Layer.TRACKS:
            look["color"] = body_dark(body)
        elif feature.layer is Layer.GUIDED_PATH:
            label = f"path of the {str(feature.properties['point']).replace('-', ' ')}"
        elif feature.layer is Layer.LIMITS and feature.properties["bridged"]:
            label = "assumed, not drawn"
            look["linestyle"] = BRIDGED
        elif feature.layer is Layer.LIMITS and feature.properties["binds"] == "overhangs":
            label = "limits of overhangs"
            look["linestyle"] = (0, (1, 1.5))
        shown = None if label in labels else label
        labels.add(label)
        taken += shapely.get_parts(seen).tolist() if line or feature.layer is Layer.ENVELOPE else outlines_of(seen)
        if line:
            for number, part in enumerate(shapely.get_parts(seen)):
                axes.plot(*np.asarray(shapely.get_coordinates(part)).T, label=shown if number == 0 else None, **look)
        else:
            draw_area(axes, outline_of(seen), label=shown, **look)
    return taken


def _order(feature: Drawn) -> int:
    """Return the place in the order of drawing: of the bodies the lead unit last, on top of what only the others sweep."""
    return -int(feature.properties["body"] or 0) if feature.layer is Layer.ENVELOPE else 0


def swept_label(name: str, unit: int) -> str:
    """Return what the visible part of the area is that the body ``name`` swept."""
    return f"swept by {name}" if unit == 0 else f"swept by {name} only"


def draw_map(axes: Axes, result: Result, features: Iterable[Drawn], window: Window) -> list[BaseGeometry]:
    """Draw a stretch of a plan with bodies that stand behind each other, without wheel tracks; return what texts should not cover."""
    points = centre_of(result, window)
    room = reach_within(result, window)
    taken = draw_features(axes, (feature for feature in features if feature.layer is not Layer.TRACKS), around(points, room))
    places = outline_places(result, window.s_from, window.s_to)
    taken += draw_bodies(axes, corners(result.drive, np.array([pose_at(result.drive, s) for s in places])))
    frame(axes, points, room)
    return taken


def draw_overview(axes: Axes, result: Result, windows: tuple[Window, ...]) -> None:
    """Draw the whole road as a line, with the enlarged stretches, the breaches and the start marked."""
    points = centre_of(result, Window(0.0, result.drive.road.path.length))
    axes.plot(*points.T, color=MUTED, linewidth=1.6)
    for window in windows:
        part = centre_of(result, window)
        axes.plot(*part.T, color=body_colour(0), linewidth=5.0, solid_capstyle="round")
        draw_letter(axes, window.label, part[len(part) // 2], (11.0, 9.0), body_colour(0))
    if result.balance.breaches:
        mark_broken(axes, np.array([breach.place for breach in result.balance.breaches]), "limit broken")
    axes.plot(*points[0], marker="o", color=INK, markersize=6)
    axes.annotate("start", points[0], xytext=(7, -4), textcoords="offset points", fontsize="small")
    frame(axes, points, 0.06 * float(np.max(np.ptp(points, axis=0))))
    axes.set_title("overview", fontsize="small", loc="left")


def draw_bodies(axes: Axes, outlines: FloatArray, *, weight: float = SLIDE, turned: Turn = UNTURNED) -> list[BaseGeometry]:
    """Draw and return outlines (poses, bodies, 4, 2), as ``corners`` has them, an arrow head in the front of the lead unit."""
    shown: FloatArray = turned(outlines.reshape(-1, 2)).reshape(outlines.shape)
    colours = [body_colour(unit) for unit in range(shown.shape[1])] * len(shown)
    drawn = PolyCollection(
        list(shown.reshape(-1, 4, 2)), facecolors="white", edgecolors=colours, linewidths=0.9 * weight, alpha=0.7, zorder=3
    )
    axes.add_collection(drawn)
    for left, right, right_back, left_back in shown[:, 0]:
        heads = np.array([left + HEAD * (left_back - left), 0.5 * (left + right), right + HEAD * (right_back - right)])
        axes.plot(*heads.T, color=body_colour(0), linewidth=0.7 * weight, zorder=3.5)
    return [shapely.Polygon(outline) for outline in shown.reshape(-1, 4, 2)]


def draw_tube(axes: Axes, tube: BaseGeometry, *, turned: Turn = UNTURNED) -> None:
    """Draw what bodies sweep at most while the driver errs as much as is allowed, as a pale band behind what they sweep."""
    placed = shapely.transform(tube, turned)
    draw_area(axes, outline_of(placed), facecolor=BAND, edgecolor="none", zorder=0.5, label="with the driver's error")


def draw_letter(axes: Axes, letter: str, at: FloatArray, away_pt: tuple[float, float], colour: str) -> None:
    """Write a letter in a circle ``away_pt`` [pt] from a place, with a line to it."""
    axes.annotate(
        letter, point(at), away_pt, textcoords="offset points", ha="center", va="center", color="white", fontsize="small",
        fontweight="bold", zorder=8, arrowprops={"arrowstyle": "-", "color": colour},
        bbox={"boxstyle": "circle,pad=0.25", "facecolor": colour, "edgecolor": "white"},
    )  # fmt: skip


def draw_room(axes: Axes, room: Room, text: str, taken: Iterable[BaseGeometry], *, turned: Turn = UNTURNED) -> None:
    """Draw the least room at a place as a dimension, with ``text`` beside it, off what is ``taken`` on the paper."""
    first, last, beyond, outwards = turned(np.stack([*room.ends, room.beyond, room.outwards]))
    colour = BREACH if room.broken else INK
    style = {"arrowstyle": "|-|", "color": colour, "linewidth": 1.1, "mutation_scale": 3.0, "shrinkA": 0.0, "shrinkB": 0.0}
    axes.annotate("", point(last), point(first), arrowprops=style, zorder=8)
    write_beside(axes, text, beyond, outwards, taken, colour)


def draw_area(axes: Axes, outline: Outline, **look: Any) -> None:  # noqa: ANN401 - Matplotlib's
    """Draw polygons that axes take in, as by ``add_patch``, which looks at every edge as a curve: a fifth of a picture's time."""
    axes.add_artist(PathPatch(outline, **look))
    axes.update_datalim(outline.vertices)


def outline_of(area: BaseGeometry) -> Outline:
    """Return polygons with their holes as one outline; lines and points that repairs left over are dropped."""
    rings = [Outline(np.asarray(ring.coords), closed=True) for ring in outlines_of(area)]
    return Outline.make_compound_path(*rings) if rings else Outline(np.empty((0, 2)))


def point(place: FloatArray) -> tuple[float, float]:
    """Return a place (2,) as Matplotlib's annotations want it."""
    return float(place[0]), float(place[1])


def reach_within(result: Result, window: Window) -> float:
    """Return how far around the centre a map shows [m]."""
    s = result.envelope.s
    left, right = (side[(s >= window.s_from) & (s <= window.s_to)] for side in shown_reach(result))
    return ROOM_M + max(float(np.max(left)), -float(np.min(right)))


def centre_of(result: Result, window: Window) -> FloatArray:
    """Return points along a stretch of the road's line, dense enough to draw it (n, 2) [m]."""
    length = window.s_to - window.s_from
    s = window.s_from + np.linspace(0.0, length, max(2, int(length / _SPACING_M) + 1))
    return np.column_stack(result.drive.road.path.to_plane(s, 0.0))


def around(points: FloatArray, room: float) -> shapely.Polygon:
    """Return a box around what a map shows that holds all of its panel, whatever that one's shape."""
    low, high = points.min(axis=0) - room, points.max(axis=0) + room
    most = float(np.max(high - low))
    box: shapely.Polygon = shapely.box(*(low - most), *(high + most))
    return box


def frame(axes: Axes, points: FloatArray, room: float) -> None:
    """Show ``points`` (n, 2) and ``room`` [m] around them at equal scale."""
    axes.ignore_existing_data_limits = True  # else limits far away would shrink what matters
    axes.update_datalim(np.array([points.min(axis=0) - room, points.max(axis=0) + room]))
    axes.margins(0.0)
    axes.autoscale_view()
    axes.set_aspect("equal", adjustable="datalim")


def finish_map(axes: Axes, *, north: bool) -> None:
    """Replace the axes' numbers by a scale bar and, on maps with a place on earth, a north arrow, when the map's extent is known."""
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set(visible=True, color=MUTED)
    scale_bar(axes)
    if north:
        draw_north(axes, (0.97, 0.98))


def scale_bar(axes: Axes) -> None:
    """Draw a round number of metres into the lower left corner; its length is that of the data, wherever the axes' limits end up."""
    extent = min(float(np.ptp(axes.get_xlim())), float(np.ptp(axes.get_ylim())))
    metres = next((bar for bar in _BARS_M if bar <= _SHARE * extent), _BARS_M[-1])
    text = f"{metres / 1e3:g} km" if metres >= 1e3 else f"{metres:g} m"  # noqa: PLR2004 - metres in a kilometre
    bar = AnchoredSizeBar(
        axes.transData, metres, text, "lower left", pad=0.3, borderpad=0.3, sep=3, frameon=True, color=INK, label_top=True,
        size_vertical=0.0, fontproperties=FontProperties(size="small"),
    )  # fmt: skip
    bar.size_bar.get_children()[0].set(linewidth=2.2, edgecolor=INK)
    bar.patch.set(facecolor="white", edgecolor="none", alpha=0.8)
    axes.add_artist(bar)


def draw_north(axes: Axes, tip: tuple[float, float], turn: float = 0.0) -> None:
    """Draw a north arrow on a map that is turned by ``turn`` [rad], about the middle of one upright to ``tip``, shares of the axes."""
    ahead = 0.5 * _NORTH_PT * np.array([-np.sin(turn), np.cos(turn)])
    x, y = (ahead - [0.0, 0.5 * _NORTH_PT]) / 72.0
    places = axes.transAxes + ScaledTranslation(x, y, axes.figure.dpi_scale_trans)
    axes.annotate(
        "N", tip, point(-2.0 * ahead), xycoords=places, textcoords="offset points",
        ha="center", va="center", fontsize="small", fontweight="bold", bbox=ON_WHITE,
        arrowprops={"arrowstyle": "-|>", "color": INK, "linewidth": 1.2}, zorder=9,
    )  # fmt: skip


def draw_direction(
    axes: Axes, path: ReferencePath, s_from: float, s_to: float, *, count: int, weight: float = SLIDE, turned: Turn = UNTURNED
) -> None:
    """Draw arrows in the direction of travel on the road's centre, ``count`` of them between two arclengths [m]."""
    points = np.column_stack(path.to_plane(np.linspace(s_from, s_to, 50), 0.0))
    long = min(_ARROW_LONG * float(np.max(np.ptp(points, axis=0))), 0.2 * (s_to - s_from) / count)
    style = {"arrowstyle": "-|>", "color": INK, "linewidth": 0.8 * weight, "mutation_scale": 9.0 * weight, "shrinkA": 0.0, "shrinkB": 0.0}
    for s in s_from + (np.arange(count) + 0.5) * (s_to - s_from) / count:
        ends = np.column_stack(path.to_plane(np.array([s, min(s + long, path.length)]), 0.0))
        tail, tip = turned(ends)
        axes.annotate("", point(tip), point(tail), zorder=7, arrowprops=style)
