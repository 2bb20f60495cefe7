"""The picture of a drive of several legs: one map of all of them, and what the vehicle does over the way that it drives."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch

from hdvplan.arrays import FloatArray
from hdvplan.judging.bodies import corners
from hdvplan.judging.legs import LegsResult
from hdvplan.judging.result import Result
from hdvplan.report.colours import BODY_COLOURS, BREACH, INK, MUTED, answer_colour
from hdvplan.report.kerbs import shown_kerbs
from hdvplan.report.leg_layers import swept_by
from hdvplan.report.maps import draw_bodies, finish_map, frame, outline_of, point
from hdvplan.report.style import ON_WHITE, SLIDE_IN, styled, write_head
from hdvplan.road.regions import Kind
from hdvplan.vehicle.jackknife import critical_angles

_COLOURS, _DASHES = (BODY_COLOURS[0], BODY_COLOURS[1]), ("solid", (0, (4, 1.5)))  # forward, backward
_PALE, _SHADE = 0.22, 0.10
_ROOM_M = 2.0  # around what was swept
_ARROWS_M = 6.0  # of way, about, from one arrow to the next
_LABELS_PT = {"start": (-44.0, 20.0), "end": (16.0, -26.0)}  # they may be one place
_LABEL_PT = (16.0, 16.0)  # of cusps
_ROOMY_M = 3.0  # more room than that needs no place in a diagram
_SHOWN = 1.3  # times the largest articulation is a critical angle near enough to be drawn

Panel = Callable[[Axes, LegsResult, int, FloatArray], None]  # draws a leg, given what turns its s into the way driven


@styled()
def legs_figure(driven: LegsResult) -> Figure:
    """Return the figure: the map with the vehicle at every cusp, and room, articulation and curvature over the way driven."""
    figure = Figure(figsize=SLIDE_IN, layout="constrained")
    places, profiles = figure.subfigures(1, 2, width_ratios=[1.35, 1.0], squeeze=False)[0]
    _draw_map(places.add_subplot(), driven)
    panels: list[Panel] = [_draw_room, *([_draw_articulation] if len(driven.results[0].drive.vehicle.units) > 1 else []), _draw_curvature]
    first: Axes | None = None
    for number, panel in enumerate(panels):
        axes = profiles.add_subplot(len(panels), 1, number + 1, sharex=first)
        _draw_panel(axes, driven, panel)
        axes.label_outer()
        first = first or axes
    axes.set_xlabel("way driven [m]")
    notice = driven.results[0].drive.road.notice
    title = f"{driven.results[0].drive.vehicle.name} on {driven.legs.name}: {driven.text}"
    write_head(figure, title, answer_colour(fits=driven.fits), size="large", notice=notice)
    return figure


def _way(driven: LegsResult) -> list[float]:
    """Return the way driven before each leg, and at last over all of them [m]."""
    return [0.0, *np.cumsum([float(result.drive.poses_s[-1]) for result in driven.results]).tolist()]


def _line(result: Result) -> FloatArray:
    """Return the lead rear axle's path in order of s, (n, 2) [m]."""
    drive = result.drive
    return np.column_stack(drive.stations.path.to_plane(drive.poses_s, drive.poses_z[:, 0]))


def _draw_map(axes: Axes, driven: LegsResult) -> None:
    named = set[str]()
    for region in driven.legs.regions:
        colour = "0.6" if region.kind is Kind.OBSTACLE else "0.85"
        axes.add_patch(PathPatch(outline_of(region.polygon), facecolor=colour, edgecolor=INK, linewidth=0.8, zorder=1.5))
    seen: list[FloatArray] = []
    for result, leg in zip(driven.results, driven.legs.legs, strict=True):
        colour, area = _COLOURS[leg.backward], shapely.union_all(swept_by(result.drive))
        seen.append(shapely.get_coordinates(area))
        label = None if leg.direction in named else f"swept {leg.direction}"
        axes.add_patch(
            PathPatch(outline_of(area), facecolor=to_rgba(colour, _PALE), edgecolor=colour, linewidth=0.9, zorder=2, label=label)
        )
        if leg.road.limits is not None:
            for kerb in shown_kerbs(result):
                axes.plot(*np.asarray(kerb.line.coords).T, color=INK, linewidth=1.0, zorder=1.6)
        line = _line(result)[:: -1 if leg.backward else 1]
        label = None if leg.direction in named else f"lead rear axle {leg.direction}"
        axes.plot(*line.T, color=colour, linestyle=_DASHES[leg.backward], linewidth=2.0, zorder=4, label=label)
        _draw_arrows(axes, line, colour)
        named.add(leg.direction)
    _draw_cusps(axes, driven)
    breaches = [breach.place for result in driven.results for breach in result.balance.breaches]
    breaches += [(near.x, near.y) for result in driven.results for near in result.entered]
    breaches += [(one.x, one.y) for one in driven.jackknives if one is not None]
    if breaches:
        x, y = zip(*breaches, strict=True)
        axes.plot(x, y, linestyle="none", marker="X", color=BREACH, markersize=8, markeredgecolor="white", label="breach", zorder=6)
    frame(axes, np.concatenate(seen), _ROOM_M)
    finish_map(axes, north=driven.legs.legs[0].road.to_lonlat is not None)
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2, ncols=4)


def _draw_arrows(axes: Axes, line: FloatArray, colour: str) -> None:
    """Draw arrow heads along a line in the order of its points."""
    count = max(1, round(len(line) * float(np.hypot(*(line[1] - line[0]))) / _ARROWS_M))
    for at in ((np.arange(count) + 0.5) * (len(line) - 1) / count).astype(int):
        style = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.0, "mutation_scale": 14.0, "shrinkA": 0.0, "shrinkB": 0.0}
        axes.annotate("", point(line[at + 1]), point(line[at]), zorder=5, arrowprops=style)


def _draw_cusps(axes: Axes, driven: LegsResult) -> None:
    """Draw the vehicle at the start, at every cusp and at the end, with the articulation there."""
    stops = [(0, 0, "start"), *((at, -1, f"cusp {at + 1}") for at in range(len(driven.results) - 1)), (len(driven.results) - 1, -1, "end")]
    for at, when, name in stops:
        result, leg = driven.results[at], driven.legs.legs[at]
        pose = 0 if (when == 0) is not leg.backward else len(result.drive.poses_s) - 1
        draw_bodies(axes, corners(result.drive, np.array([pose])))
        angles = np.round(np.degrees(driven.articulation(at)[when])) + 0.0  # -0 is 0
        told = f"{name}: {', '.join(f'{angle:+.0f}°' for angle in angles)}" if len(angles) else name
        style = {"arrowstyle": "-", "color": INK, "linewidth": 0.8}
        axes.plot(*_line(result)[pose], marker="o", color="white", markeredgecolor=INK, markersize=7, zorder=7)
        axes.annotate(
            told, point(_line(result)[pose]), _LABELS_PT.get(name, _LABEL_PT), textcoords="offset points", fontsize="small",
            fontweight="bold", color=INK, bbox=ON_WHITE, zorder=8, arrowprops=style,
        )  # fmt: skip


def _draw_panel(axes: Axes, driven: LegsResult, panel: Panel) -> None:
    ways = _way(driven)
    for at, leg in enumerate(driven.legs.legs):
        begin, end = ways[at : at + 2]
        if leg.backward:
            axes.axvspan(begin, end, color=_COLOURS[1], alpha=_SHADE, linewidth=0.0, zorder=0)
        panel(axes, driven, at, np.array([end, -1.0]) if leg.backward else np.array([begin, 1.0]))
    for way in ways[1:-1]:
        axes.axvline(way, color=MUTED, linewidth=0.8, linestyle=(0, (2, 2)))
    axes.axhline(0.0, color=MUTED, linewidth=0.6)
    axes.set_xlim(0.0, ways[-1])
    axes.grid(visible=True)


def _draw_room(axes: Axes, driven: LegsResult, at: int, way: FloatArray) -> None:
    """Draw how near bodies come to limits, beside each place of the line, and to obstacles, at each pose; else how far they reach."""
    result, s = driven.results[at], driven.results[at].envelope.s
    if result.clearance is None:
        axes.plot(way[0] + way[1] * s, np.fmax(result.envelope.reach_left, -result.envelope.reach_right), color=INK, linewidth=1.3)
        axes.set_ylabel("furthest reach [m]")
        return
    if result.drive.road.limits is not None:
        gaps = np.min(np.concatenate([*result.gaps.values()]), axis=0)
        gaps = np.where(gaps > _ROOMY_M, np.nan, gaps)
        axes.plot(way[0] + way[1] * s, gaps, color=MUTED, linewidth=1.3, label="limits" if at == 0 else None)
    obstacles = [region.polygon for region in driven.legs.regions if region.kind is Kind.OBSTACLE]
    if obstacles:
        bodies = result.outlines.geometries.reshape(len(result.drive.poses_s), -1)
        apart = np.min(shapely.distance(bodies, shapely.union_all(obstacles)), axis=1)
        axes.plot(way[0] + way[1] * result.drive.poses_s, apart, color=INK, linewidth=1.3, label="obstacles" if at == 0 else None)
    axes.set_ylabel("room [m]")
    if at == 0:
        _legend_above(axes)


def _draw_articulation(axes: Axes, driven: LegsResult, at: int, way: FloatArray) -> None:
    drive = driven.results[at].drive
    angles = np.degrees(drive.poses_z[:, 2 : drive.vehicle.rigid_states])
    for coupling, (critical, angle) in enumerate(zip(np.degrees(critical_angles(drive.vehicle)), angles.T, strict=True)):
        colour = BODY_COLOURS[(coupling + 1) % len(BODY_COLOURS)]
        axes.plot(
            way[0] + way[1] * drive.poses_s, angle, color=colour, linewidth=1.3, label=f"coupling {coupling + 1}" if at == 0 else None
        )
        if at == 0 and critical < _SHOWN * max(float(np.max(np.abs(_all_angles(driven)[coupling]))), 1.0):
            for sign in (1.0, -1.0):
                axes.axhline(sign * critical, color=BREACH, linestyle=(0, (4, 2)), linewidth=1.0)
    axes.set_ylabel("articulation [deg]")
    if at == 0 and angles.shape[1] > 1:
        _legend_above(axes)


def _all_angles(driven: LegsResult) -> FloatArray:
    """Return the articulations of all poses of all legs, (couplings, poses) [deg]."""
    angles = np.concatenate([one.drive.poses_z[:, 2 : one.drive.vehicle.rigid_states] for one in driven.results])
    return np.asarray(np.degrees(angles.T))


def _legend_above(axes: Axes) -> None:
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.0, ncols=4)


def _draw_curvature(axes: Axes, driven: LegsResult, at: int, way: FloatArray) -> None:
    drive = driven.results[at].drive
    kappa = np.append(drive.kappa, drive.kappa[-1:])
    s = drive.stations.s[: len(kappa)]
    order = int(way[1])
    held = kappa if order > 0 else np.append(kappa[:1], kappa[:-1])
    axes.step(way[0] + order * s[::order], held[::order], where="post", color=_COLOURS[order < 0], linewidth=1.3)
    if at == 0:
        for sign in (1.0, -1.0):
            axes.axhline(sign * drive.vehicle.max_curvature, color=BREACH, linestyle=(0, (4, 2)), linewidth=1.0)
    axes.set_ylabel("curvature steered [1/m]")
