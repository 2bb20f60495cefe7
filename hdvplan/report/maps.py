"""Maps of a plan: the swept area in the plane, to scale."""

from __future__ import annotations

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from shapely.geometry.base import BaseGeometry

from hdvplan.jit import BoolArray, FloatArray
from hdvplan.report.bodies import corners, pose_at
from hdvplan.report.geojson import swept_area
from hdvplan.report.result import Result, body_name
from hdvplan.report.windows import Window
from hdvplan.road.regions import Kind
from hdvplan.vehicle.model import Vehicle

BODY_COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7")  # Okabe and Ito: distinct for colour-blind readers
_PALE = 0.4
LIMIT_COLOUR = "#D55E00"
_SPACING_M = 0.5
_ROOM_M = 3.0  # around what a map shows


def draw_map(axes: Axes, result: Result, window: Window) -> None:
    """Draw the stretch ``window`` of the road with limits, the swept area of each body, and bodies at intervals."""
    drive, envelope = result.drive, result.envelope
    path, vehicle = drive.road.path, drive.vehicle
    shown = (envelope.s >= window.s_from) & (envelope.s <= window.s_to)
    for unit in reversed(range(len(vehicle.units))):  # the lead unit on top: of the others shows what they sweep besides
        area = swept_area(path, envelope.s[shown], envelope.left[unit][shown], envelope.right[unit][shown])
        label = f"swept by {swept_label(vehicle, unit)}"
        axes.add_patch(PathPatch(_outline(area), facecolor=body_fill(unit), edgecolor="none", label=label))
    for kind, colour, hatch in ((Kind.OBSTACLE, "0.6", None), (Kind.SWEEPABLE, "none", "////")):
        areas = [region.polygon for region in drive.road.regions if region.kind is kind]
        if areas:
            shape = _outline(shapely.union_all(areas))
            axes.add_patch(PathPatch(shape, facecolor=colour, edgecolor="0.35", hatch=hatch, linewidth=0.6, zorder=0.5, label=kind))
    s = _stations(window)
    axes.plot(*path.to_plane(s, 0.0), color="0.35", linewidth=0.8, linestyle=(0, (6, 3)), label="road centre")
    if drive.road.limits is not None:
        left, right = drive.road.limits.table(s)[:2]
        axes.plot(*path.to_plane(s, left), color=LIMIT_COLOUR, linewidth=1.2, label="limits")
        axes.plot(*path.to_plane(s, right), color=LIMIT_COLOUR, linewidth=1.2)
    _draw_bodies(axes, result, window)
    _frame(axes, np.column_stack(path.to_plane(s, 0.0)), 0.5 * vehicle.width + _reach(result, shown) + _ROOM_M)


def _outline(area: BaseGeometry) -> Outline:
    rings = [ring for part in shapely.get_parts(area) if part.geom_type == "Polygon" for ring in (part.exterior, *part.interiors)]
    return Outline.make_compound_path(*(Outline(np.asarray(ring.coords), closed=True) for ring in rings))


def body_colour(unit: int) -> str:
    """Return the colour of body number ``unit``; colours repeat in long chains."""
    return BODY_COLOURS[unit % len(BODY_COLOURS)]


def body_fill(unit: int) -> tuple[float, float, float]:
    """Return the opaque pale version of a body's colour: overlaps must not mix to a third one."""
    red, green, blue = to_rgb(body_colour(unit))
    return tuple(1.0 - _PALE * (1.0 - part) for part in (red, green, blue))  # type: ignore[return-value] # three parts


def swept_label(vehicle: Vehicle, unit: int) -> str:
    """Return what the visible part of a body's swept area is."""
    name = body_name(vehicle, unit)
    return name if unit == 0 else f"{name}, not by the body ahead"


def draw_overview(axes: Axes, result: Result, windows: tuple[Window, ...]) -> None:
    """Draw the whole road as a line, with the enlarged stretches and the start marked."""
    path = result.drive.road.path
    s = np.linspace(0.0, path.length, max(2, int(path.length / _SPACING_M)))
    points = np.column_stack(path.to_plane(s, 0.0))
    axes.plot(*points.T, color="0.45", linewidth=1.4)
    axes.plot(*points[0], marker="o", color="0.15", markersize=5)
    axes.annotate("start", points[0], xytext=(6, 6), textcoords="offset points", fontsize="small")
    for window in windows:
        part = np.column_stack(path.to_plane(_stations(window), 0.0))
        axes.plot(*part.T, color=LIMIT_COLOUR, linewidth=4.0, solid_capstyle="butt")
        axes.annotate(window.label, part[len(part) // 2], xytext=(7, 7), textcoords="offset points", fontweight="bold")
    _frame(axes, points, 0.05 * float(np.max(np.ptp(points, axis=0))))
    axes.set_title("overview; the marked places are enlarged", fontsize="small", loc="left")


def _draw_bodies(axes: Axes, result: Result, window: Window) -> None:
    """Draw outlines of the bodies, a little over a vehicle length apart."""
    drive = result.drive
    apart = 1.2 * (drive.vehicle.reach_ahead + drive.vehicle.reach_behind)
    count = max(1, int((window.s_to - window.s_from) / apart))
    places = np.linspace(window.s_from, window.s_to, count + 2)[1:-1]
    outlines: list[FloatArray] = [body for s in places for body in corners(drive, pose_at(drive, float(s)))]
    colours = [body_colour(unit) for unit in range(len(drive.vehicle.units))] * len(places)
    axes.add_collection(PolyCollection(outlines, facecolors="white", edgecolors=colours, linewidths=1.2, alpha=0.85, zorder=3))


def _reach(result: Result, shown: BoolArray) -> float:
    reach = max(float(np.max(result.envelope.reach_left[shown])), -float(np.min(result.envelope.reach_right[shown])))
    limits = result.drive.road.limits
    if limits is None:
        return reach
    return max(reach, float(np.max(np.abs(limits.table(result.envelope.s[shown])[:2]))))


def _stations(window: Window) -> FloatArray:
    length = window.s_to - window.s_from
    return window.s_from + np.linspace(0.0, length, max(2, int(length / _SPACING_M) + 1))


def _frame(axes: Axes, points: FloatArray, room: float) -> None:
    """Show ``points`` (n, 2) and ``room`` [m] around them at equal scale."""
    axes.update_datalim(np.array([points.min(axis=0) - room, points.max(axis=0) + room]))
    axes.margins(0.0)
    axes.autoscale_view()
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x [m]", fontsize="small")
    axes.set_ylabel("y [m]", fontsize="small")
    axes.tick_params(labelsize="small")
