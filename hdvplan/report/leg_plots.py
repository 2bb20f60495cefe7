"""A drive of several legs, as a picture and as a film.

The picture has one map of all legs, and what the vehicle does over the way that it drives; in the film it moves forwards and backwards.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hdvplan.arrays import FloatArray
from hdvplan.judging.bodies import corners
from hdvplan.judging.legs import LegsResult
from hdvplan.report.animation import LAST_MS, Pose, frames_of, gif_bytes, ground_of, paced
from hdvplan.report.colours import BREACH, INK, MUTED, answer_colour, body_colour
from hdvplan.report.leg_maps import COLOURS, draw_ground, draw_stops, draw_swept, stops_of
from hdvplan.report.maps import ROOM_M, finish_map, frame
from hdvplan.report.style import SLIDE_IN, styled, write_head
from hdvplan.road.legs import direction_of
from hdvplan.road.regions import Kind
from hdvplan.vehicle.kinematics import critical_angles

_SHADE = 0.10  # behind what is driven backwards
_ROOMY_M = 3.0  # more room than that needs no place in a diagram
_SHOWN = 1.3  # times the largest articulation is a critical angle near enough to be drawn

Panel = Callable[[Axes, LegsResult, int, FloatArray], None]  # draws a leg, given what turns its s into the way driven
_STANDS_MS = 900  # at a cusp, while the steering turns


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
    write_head(figure, f"{driven.name}: {driven.text}", answer_colour(fits=driven.fits), size="large", notice=notice)
    return figure


def _way(driven: LegsResult) -> list[float]:
    """Return the way driven before each leg, and at last over all of them [m]."""
    return [0.0, *np.cumsum([float(result.drive.poses_s[-1]) for result in driven.results]).tolist()]


def _draw_map(axes: Axes, driven: LegsResult) -> None:
    seen = draw_swept(axes, driven)
    draw_ground(axes, driven)
    draw_stops(axes, driven)
    frame(axes, seen, ROOM_M)
    finish_map(axes, north=driven.legs.legs[0].road.to_lonlat is not None)
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2, ncols=4)


def _draw_panel(axes: Axes, driven: LegsResult, panel: Panel) -> None:
    ways = _way(driven)
    for at, leg in enumerate(driven.legs.legs):
        begin, end = ways[at : at + 2]
        if leg.backward:
            axes.axvspan(begin, end, color=COLOURS[1], alpha=_SHADE, linewidth=0.0, zorder=0)
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
        label = f"coupling {coupling + 1}" if at == 0 else None
        axes.plot(way[0] + way[1] * drive.poses_s, angle, color=body_colour(coupling + 1), linewidth=1.3, label=label)
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
    axes.step(way[0] + order * s[::order], held[::order], where="post", color=COLOURS[order < 0], linewidth=1.3)
    if at == 0:
        for sign in (1.0, -1.0):
            axes.axhline(sign * drive.vehicle.max_curvature, color=BREACH, linestyle=(0, (4, 2)), linewidth=1.0)
    axes.set_ylabel("curvature steered [1/m]")


def legs_film_bytes(driven: LegsResult) -> bytes:
    """Return the drive as an animated GIF that waits at every cusp, and tells the articulation there."""
    first = driven.results[0].drive
    outline = np.concatenate([np.asarray(area.bounds).reshape(2, 2) for area in driven.swept])

    def draw(axes: Axes) -> None:
        draw_ground(axes, driven)
        frame(axes, outline, ROOM_M)
        finish_map(axes, north=first.road.to_lonlat is not None)

    swept = [f"swept {direction_of(backward=backward)}" for backward in (False, True)]
    head = (driven.title, answer_colour(fits=driven.fits), first.road.notice)
    return gif_bytes(frames_of(ground_of(draw, swept, head, bodies=len(first.vehicle.units)), _poses(driven)))


def _poses(driven: LegsResult) -> Iterator[Pose]:
    """Yield all poses in the order of driving; every simulated one sweeps, a few are shown, and every stop is."""
    ends = stops_of(driven)[1:]
    for at, (result, leg, end) in enumerate(zip(driven.results, driven.legs.legs, ends, strict=True)):
        drive, swept = result.drive, (int(leg.backward),) * len(result.drive.vehicle.units)
        order = np.arange(len(drive.poses_s))[:: -1 if leg.backward else 1]
        stride = paced(float(drive.poses_s[1] - drive.poses_s[0]))
        outlines = corners(drive, order)
        for number, bodies in enumerate(outlines[:-1], start=1):
            shown = (len(order) - number) % stride == 0
            yield Pose(bodies, swept, f"leg {at + 1} of {len(ends)}, {leg.direction}" if shown else None)
        yield Pose(outlines[-1], swept, end.text, LAST_MS if at == len(ends) - 1 else _STANDS_MS)
