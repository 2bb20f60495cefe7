"""Maps of a plan: the swept area in the plane, to scale."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import BoolArray, FloatArray, IntArray
from hdvplan.judging.balance import Breach
from hdvplan.judging.bodies import corners, pose_at, wheel_tracks
from hdvplan.judging.result import Result, body_name
from hdvplan.report.colours import BREACH, INK, MUTED
from hdvplan.report.geojson import swept_area
from hdvplan.report.kerbs import judged_stretch, shown_kerbs
from hdvplan.report.layers import conflict_area, outline_places
from hdvplan.report.rooms import Room, outwards_at
from hdvplan.report.style import body_colour, body_dark, body_fill
from hdvplan.report.windows import Window
from hdvplan.road.regions import Kind
from hdvplan.vehicle.model import Vehicle

_SPACING_M = 0.5
_ROOM_M = 2.0  # around what a map shows
_LABEL_AWAY_M = 2.5  # from the edge that it is written beside
_LABELS_APART_M = 8.0
_MOST_DEPTHS = 4  # written into one map
_HEAD = 0.12  # of the lead unit's length: the arrow head in its front
_WHITE = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.8}


def draw_map(axes: Axes, result: Result, window: Window, *, bodies: bool = True, depths: bool = True) -> None:
    """Draw the stretch ``window`` of the road with limits, what each body swept, breaches with their depth, and bodies."""
    drive, envelope = result.drive, result.envelope
    path, vehicle = drive.road.path, drive.vehicle
    shown = (envelope.s >= window.s_from) & (envelope.s <= window.s_to)
    s = envelope.s[shown]
    for unit in reversed(range(len(vehicle.units))):  # the lead unit on top: of the others shows what they sweep besides
        area = swept_area(path, s, envelope.left[unit][shown], envelope.right[unit][shown])
        axes.add_patch(PathPatch(outline_of(area), facecolor=body_fill(unit), edgecolor="none", label=swept_label(vehicle, unit)))
    draw_surroundings(axes, result, window)
    if bodies:
        places = outline_places(result, window.s_from, window.s_to)
        draw_bodies(axes, result, np.array([pose_at(drive, s) for s in places]))
    _draw_breaches(axes, result, window, depths=depths)
    frame(axes, np.column_stack(path.to_plane(stations(window), 0.0)), reach_within(result, shown))


def draw_surroundings(axes: Axes, result: Result, window: Window) -> None:
    """Draw what the road itself brings along the stretch ``window``: its centre and its limits, beyond its ends as far as they are judged.

    Its obstacles and what overhangs may sweep lie below, hatched where it may be swept.
    """
    road, s = result.drive.road, stations(window)
    for kind, colour, hatch in ((Kind.OBSTACLE, "0.6", None), (Kind.SWEEPABLE, "none", "////")):
        areas = [region.polygon for region in road.regions if region.kind is kind]
        if areas:
            shape = outline_of(shapely.union_all(areas))
            axes.add_patch(PathPatch(shape, facecolor=colour, edgecolor=MUTED, hatch=hatch, linewidth=0.6, zorder=0.5, label=kind))
    axes.plot(*road.path.to_plane(s, 0.0), color=MUTED, linewidth=0.8, linestyle=(0, (7, 4)), label="road centre")
    labels = {"wheels": "limits", "overhangs": "limits of overhangs"}
    for kerb in shown_kerbs(result, window.s_from, window.s_to):
        look = {"linewidth": 1.3} if kerb.binds == "wheels" else {"linewidth": 1.1, "linestyle": (0, (1, 1.5))}
        axes.plot(*shapely.get_coordinates(kerb.line).T, color=INK, label=labels.pop(kerb.binds, None), **look)


def swept_label(vehicle: Vehicle, unit: int) -> str:
    """Return what the visible part of a body's swept area is."""
    name = body_name(vehicle, unit)
    return f"swept by {name}" if unit == 0 else f"swept by {name} only"


def draw_overview(axes: Axes, result: Result, windows: tuple[Window, ...]) -> None:
    """Draw the whole road as a line, with the enlarged stretches, the breaches and the start marked."""
    path = result.drive.road.path
    s = np.linspace(0.0, path.length, max(2, int(path.length / _SPACING_M)))
    points = np.column_stack(path.to_plane(s, 0.0))
    axes.plot(*points.T, color=MUTED, linewidth=1.6)
    for window in windows:
        part = np.column_stack(path.to_plane(stations(window), 0.0))
        middle = part[len(part) // 2]
        axes.plot(*part.T, color=body_colour(0), linewidth=5.0, solid_capstyle="round")
        axes.annotate(
            window.label, middle, xytext=(11, 9), textcoords="offset points", fontweight="bold", color="white", fontsize="small",
            bbox={"boxstyle": "circle,pad=0.25", "facecolor": body_colour(0), "edgecolor": "white"}, zorder=5,
        )  # fmt: skip
    if result.balance.breaches:
        x, y = zip(*(breach.place for breach in result.balance.breaches), strict=True)
        axes.plot(x, y, linestyle="none", marker="X", color=BREACH, markersize=7, markeredgecolor="white", label="limit broken", zorder=4)
    axes.plot(*points[0], marker="o", color=INK, markersize=6)
    axes.annotate("start", points[0], xytext=(7, -4), textcoords="offset points", fontsize="small")
    frame(axes, points, 0.06 * float(np.max(np.ptp(points, axis=0))))
    axes.set_title("overview", fontsize="small", loc="left")


def draw_bodies(axes: Axes, result: Result, poses: IntArray) -> None:
    """Draw the outlines of all bodies at simulated poses of these numbers, an arrow head in the front of the lead unit."""
    outlines = corners(result.drive, poses)
    colours = [body_colour(unit) for unit in range(outlines.shape[1])] * len(poses)
    axes.add_collection(
        PolyCollection(list(outlines.reshape(-1, 4, 2)), facecolors="white", edgecolors=colours, linewidths=1.3, alpha=0.7, zorder=3)
    )
    for left, right, right_back, left_back in outlines[:, 0]:
        heads = np.array([left + _HEAD * (left_back - left), 0.5 * (left + right), right + _HEAD * (right_back - right)])
        axes.plot(*heads.T, color=body_colour(0), linewidth=1.0, zorder=3.5)


def draw_tracks(axes: Axes, result: Result, window: Window) -> None:
    """Draw the tracks of all outer wheels along a stretch."""
    drive = result.drive
    near = (drive.poses_s >= window.s_from) & (drive.poses_s <= window.s_to + drive.vehicle.reach_behind)
    for number, track in enumerate(wheel_tracks(drive)):
        label = "wheel tracks" if number == 0 else None
        axes.plot(*track.points[near].T, color=body_dark(track.wheel.unit), linewidth=0.8, linestyle=(0, (5, 2)), zorder=2.5, label=label)


def draw_room(axes: Axes, room: Room) -> None:
    """Draw the least room at a place as a dimension, where there is a limit that is kept: breaches have their depth."""
    if not room.limited or room.broken:
        return
    (x, y), (u, v) = room.ends
    style = {"arrowstyle": "|-|", "color": INK, "linewidth": 1.2, "mutation_scale": 3.0, "shrinkA": 0.0, "shrinkB": 0.0}
    axes.annotate("", (float(u), float(v)), (float(x), float(y)), arrowprops=style, zorder=6)
    a, b = room.beyond + _LABEL_AWAY_M * room.outwards
    axes.annotate(
        f"{max(-room.depth, 0.0):.2f} m", (float(a), float(b)), ha="center", va="center", zorder=7, fontweight="bold", bbox=_WHITE
    )


def _draw_breaches(axes: Axes, result: Result, window: Window, *, depths: bool) -> None:
    """Fill what was swept beyond a limit, and write how deep the deepest places are if ``depths`` are wanted."""
    begin, end = judged_stretch(result, window.s_from, window.s_to)
    breaches = [breach for breach in result.balance.breaches if begin <= breach.s_deepest <= end]
    for number, breach in enumerate(breaches):
        outline = outline_of(conflict_area(result, breach))
        label = "beyond a limit" if number == 0 else None
        axes.add_patch(PathPatch(outline, facecolor=BREACH, edgecolor=BREACH, linewidth=1.2, label=label, zorder=4))
    for breach in _spread(breaches if depths else ()):
        u, v = np.array(breach.place) + _LABEL_AWAY_M * outwards_at(result, breach.s_deepest, breach.side)
        axes.annotate(
            f"{breach.depth:.2f} m", breach.place, xytext=(float(u), float(v)), ha="center", va="center", zorder=6,
            color=BREACH, fontweight="bold", fontsize="small", arrowprops={"arrowstyle": "-", "color": BREACH, "linewidth": 0.8},
            bbox=_WHITE,
        )  # fmt: skip


def _spread(breaches: Iterable[Breach]) -> list[Breach]:
    """Return the deepest breaches that are far enough apart to be written beside each other."""
    kept = list[Breach]()
    for breach in sorted(breaches, key=lambda breach: -breach.depth):
        if all(abs(breach.s_deepest - other.s_deepest) > _LABELS_APART_M or breach.side != other.side for other in kept):
            kept.append(breach)
    return kept[:_MOST_DEPTHS]


def outline_of(area: BaseGeometry) -> Outline:
    """Return polygons with their holes as one outline; lines and points that repairs left over are dropped."""
    polygons = [part for part in shapely.get_parts(shapely.get_parts(area)) if isinstance(part, shapely.Polygon) and not part.is_empty]
    rings = [Outline(np.asarray(ring.coords), closed=True) for part in polygons for ring in (part.exterior, *part.interiors)]
    return Outline.make_compound_path(*rings) if rings else Outline(np.empty((0, 2)))


def reach_within(result: Result, shown: BoolArray) -> float:
    """Return how far around the centre a map shows; limits far beyond what was swept are not shown [m]."""
    reach = max(float(np.max(result.envelope.reach_left[shown])), -float(np.min(result.envelope.reach_right[shown])))
    limits = result.drive.road.beside
    if limits is None:
        return reach + _ROOM_M
    return _ROOM_M + max(reach, min(2.0 * reach, float(np.max(np.abs(limits.table(result.envelope.s[shown]))))))


def stations(window: Window) -> FloatArray:
    """Return arclengths along a stretch, dense enough to draw it [m]."""
    length = window.s_to - window.s_from
    return window.s_from + np.linspace(0.0, length, max(2, int(length / _SPACING_M) + 1))


def frame(axes: Axes, points: FloatArray, room: float) -> None:
    """Show ``points`` (n, 2) and ``room`` [m] around them at equal scale."""
    axes.ignore_existing_data_limits = True  # else limits far away would shrink what matters
    axes.update_datalim(np.array([points.min(axis=0) - room, points.max(axis=0) + room]))
    axes.margins(0.0)
    axes.autoscale_view()
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x [m]", fontsize="small", labelpad=1.0)
    axes.set_ylabel("y [m]", fontsize="small", labelpad=1.0)
