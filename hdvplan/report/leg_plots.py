"""Drives of several legs, forwards and backwards told apart: on a map, over the way driven, and as a film."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import FloatArray
from hdvplan.judging.bodies import corners
from hdvplan.judging.legs import LegsResult
from hdvplan.report import BODY_COLOURS, BREACH, INK, MUTED, answer_colour, body_colour
from hdvplan.report.animation import LAST_MS, Pose, frames_of, gif_bytes, ground_of, paced
from hdvplan.report.layers import Drawn, kerb_features, region_features
from hdvplan.report.maps import ROOM_M, SLIDE, UNTURNED, Turn, draw_area, draw_bodies, draw_features, finish_map, frame, outline_of, point
from hdvplan.report.style import ON_WHITE, SLIDE_IN, legend_above, mark_broken, styled, write_head
from hdvplan.road.legs import direction_of
from hdvplan.road.regions import Kind
from hdvplan.vehicle.kinematics import critical_angles

_COLOURS, _DASHES = BODY_COLOURS[:2], ("solid", (0, (4, 1.5)))  # forward, backward
_DRAWN = (0, (1, 1.5))
_PALE = 0.22  # of swept areas
_ARROWS_M = 6.0  # of way, about, from one arrow to the next
_LABELS_PT = {"start": (-44.0, 20.0), "end": (16.0, -26.0)}  # they may be one place
_LABEL_PT = (16.0, 16.0)  # of cusps
_NEAR_M = 5.0  # beside what is swept, within which a wall or a kerb is on the map
_SHADE = 0.10  # behind what is driven backwards
_ROOMY_M = 3.0  # more room than that needs no place in a diagram
_SHOWN = 1.3  # times the largest articulation is a critical angle near enough to be drawn
_STANDS_MS = 900  # at a cusp, while the steering turns

Panel = Callable[[Axes, LegsResult, int, FloatArray], None]  # draws a leg, given what turns its s into the way driven


class Way(NamedTuple):
    """A leg on a map: its lead rear axle's line in the order of driving (n, 2) [m], and what is swept on it."""

    backward: bool
    line: FloatArray
    swept: BaseGeometry


class Stop(NamedTuple):
    """Where the vehicle stands: articulations [deg], place of the lead rear axle (2,) and outlines (bodies, 4, 2) [m]."""

    name: str
    angles: FloatArray
    place: FloatArray
    outlines: FloatArray

    @property
    def text(self) -> str:
        """The name with the articulation in whole degrees."""
        whole = np.round(self.angles) + 0.0  # -0 is 0
        return f"{self.name}: articulation {', '.join(f'{angle:+.0f}°' for angle in whole)}" if len(whole) else self.name


def ends_of(legs: int) -> list[tuple[int, int, str]]:
    """Return where a vehicle that drives so many legs stands: number of the leg, 0 at its begin or -1 at its end, and the name."""
    return [(0, 0, "start"), *((at, -1, f"cusp {at + 1}") for at in range(legs - 1)), (legs - 1, -1, "end")]


def ways_of(driven: LegsResult) -> tuple[Way, ...]:
    """Return the legs of a drive."""
    ways = []
    for result, leg, swept in zip(driven.results, driven.legs.legs, driven.swept, strict=True):
        drive = result.drive
        line = np.column_stack(drive.stations.path.to_plane(drive.poses_s, drive.poses_z[:, 0]))
        ways.append(Way(leg.backward, line[:: -1 if leg.backward else 1], swept))
    return tuple(ways)


def stops_of(driven: LegsResult) -> tuple[Stop, ...]:
    """Return where the vehicle stands, in the order of driving."""
    ways, stops = ways_of(driven), []
    for at, when, name in ends_of(len(ways)):
        drive = driven.results[at].drive
        pose = 0 if (when == 0) is not ways[at].backward else len(drive.poses_s) - 1
        stops.append(Stop(name, np.degrees(driven.articulation(at)[when]), ways[at].line[when], corners(drive, np.array([pose]))[0]))
    return tuple(stops)


def draw_swept(axes: Axes, ways: Sequence[Way], *, weight: float = SLIDE, turned: Turn = UNTURNED) -> None:
    """Draw what is swept on each leg, labelled once a direction."""
    named = set[str]()
    for way in ways:
        label = f"swept {direction_of(backward=way.backward)}"
        look = {"facecolor": to_rgba(_COLOURS[way.backward], _PALE), "edgecolor": _COLOURS[way.backward], "linewidth": 0.6 * weight}
        area, shown = outline_of(shapely.transform(way.swept, turned)), None if label in named else label
        draw_area(axes, area, label=shown, zorder=2, **look)
        named.add(label)


def draw_lines(axes: Axes, ways: Sequence[Way], *, weight: float = SLIDE, turned: Turn = UNTURNED) -> None:
    """Draw the lead rear axle's line on each leg with arrow heads, labelled once a direction."""
    named = set[str]()
    for way in ways:
        colour, line, label = _COLOURS[way.backward], turned(way.line), f"lead rear axle {direction_of(backward=way.backward)}"
        shown = None if label in named else label
        axes.plot(*line.T, color=colour, linestyle=_DASHES[way.backward], linewidth=1.3 * weight, zorder=4, label=shown)
        named.add(label)
        count = max(1, round(len(line) * float(np.hypot(*(line[1] - line[0]))) / _ARROWS_M))
        style = {"arrowstyle": "-|>", "color": colour, "linewidth": 0.7 * weight, "mutation_scale": 9.3 * weight}
        for at in ((np.arange(count) + 0.5) * (len(line) - 1) / count).astype(int):
            axes.annotate("", point(line[at + 1]), point(line[at]), zorder=5, arrowprops=style | {"shrinkA": 0.0, "shrinkB": 0.0})


def draw_stops(axes: Axes, stops: Sequence[Stop], *, weight: float = SLIDE, turned: Turn = UNTURNED) -> None:
    """Draw the vehicle where it stands, with the names and the articulations."""
    for stop in stops:
        place = turned(stop.place[None])[0]
        draw_bodies(axes, stop.outlines[None], weight=weight, turned=turned)
        axes.plot(*place, marker="o", color="white", markeredgecolor=INK, markersize=4.7 * weight, zorder=7)
        axes.annotate(
            stop.text, point(place), _LABELS_PT.get(stop.name, _LABEL_PT), textcoords="offset points", fontsize="small",
            fontweight="bold", color=INK, bbox=ON_WHITE, zorder=8, arrowprops={"arrowstyle": "-", "color": INK, "linewidth": 0.5 * weight},
        )  # fmt: skip


def draw_ground(axes: Axes, driven: LegsResult, *, weight: float = SLIDE, turned: Turn = UNTURNED) -> None:
    """Draw what stays as it is: obstacles, kerbs, and the line of every leg with arrows, and where something is broken."""
    if ground := _features(driven):
        points = turned(shapely.get_coordinates([one.geometry for one in ground]))
        view = shapely.box(*(points.min(axis=0) - ROOM_M), *(points.max(axis=0) + ROOM_M))  # a line on its edge would be cut off
        draw_features(axes, ground, view, weight=weight, turned=turned)
    given = [turned(leg.road.about.points) for leg in driven.legs.legs if leg.road.about is not None]
    for at, line in enumerate(given):  # smoothing may have moved it, and its cusps
        label = "line as drawn" if at == 0 else None
        axes.plot(*line.T, color=MUTED, linestyle=_DRAWN, linewidth=0.9 * weight, zorder=3, label=label)
    draw_lines(axes, ways_of(driven), weight=weight, turned=turned)
    places = [breach.place for result in driven.results for breach in result.balance.breaches]
    places += [(near.x, near.y) for result in driven.results for near in result.entered]
    places += [(one.x, one.y) for one in driven.jackknives if one is not None]
    if places:
        mark_broken(axes, turned(np.array(places)), "breach")


def _features(driven: LegsResult) -> list[Drawn]:
    bounded = (one for one in driven.results if one.drive.road.limits is not None)
    return [*region_features(driven.legs.regions), *(kerb for one in bounded for kerb in kerb_features(one))]


def points_shown(driven: LegsResult) -> FloatArray:
    """Return what a map of a drive shows, (n, 2) [m]: what is swept, and of kerbs and obstacles what is near."""
    swept = shapely.union_all(driven.swept)
    near = shapely.intersection([one.geometry for one in _features(driven)], shapely.buffer(swept, _NEAR_M))
    return np.concatenate([shapely.get_coordinates(swept), shapely.get_coordinates(near)])


def draw_legs(axes: Axes, driven: LegsResult, *, weight: float = SLIDE, turned: Turn = UNTURNED) -> None:
    """Draw a drive of several legs with its ground, and the vehicle where it stands."""
    draw_swept(axes, ways_of(driven), weight=weight, turned=turned)
    draw_ground(axes, driven, weight=weight, turned=turned)
    draw_stops(axes, stops_of(driven), weight=weight, turned=turned)


@styled()
def legs_figure(driven: LegsResult) -> Figure:
    """Return the figure: the map with the vehicle at every cusp, and room, articulation and curvature over the way driven."""
    figure = Figure(figsize=SLIDE_IN, layout="constrained")
    places, profiles = figure.subfigures(1, 2, width_ratios=[1.35, 1.0], squeeze=False)[0]
    _draw_map(places.add_subplot(), driven)
    panels: list[Panel] = [_draw_room, *([_draw_articulation] if len(driven.results[0].drive.vehicle.units) > 1 else []), _draw_curvature]
    rows = profiles.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axes, panel in zip(rows, panels, strict=True):
        _draw_panel(axes, driven, panel)
    rows[-1].set_xlabel("way driven [m]")
    notice = driven.results[0].drive.road.notice
    write_head(figure, f"{driven.name}: {driven.text}", answer_colour(fits=driven.fits), size="large", notice=notice)
    return figure


def _way(driven: LegsResult) -> list[float]:
    return [0.0, *np.cumsum([float(result.drive.poses_s[-1]) for result in driven.results]).tolist()]


def _draw_map(axes: Axes, driven: LegsResult) -> None:
    draw_legs(axes, driven)
    frame(axes, points_shown(driven), ROOM_M)
    finish_map(axes, north=driven.legs.legs[0].road.to_lonlat is not None)
    legend_above(axes)


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
        legend_above(axes)


def _draw_articulation(axes: Axes, driven: LegsResult, at: int, way: FloatArray) -> None:
    drive = driven.results[at].drive
    angles = np.degrees(drive.poses_z[:, 2 : drive.vehicle.rigid_states])
    for coupling, (critical, angle) in enumerate(zip(np.degrees(critical_angles(drive.vehicle)), angles.T, strict=True)):
        label = f"coupling {coupling + 1}" if at == 0 else None
        axes.plot(way[0] + way[1] * drive.poses_s, angle, color=body_colour(coupling + 1), linewidth=1.3, label=label)
        largest = np.degrees(max(float(np.max(np.abs(one.drive.poses_z[:, 2 + coupling]))) for one in driven.results))
        if at == 0 and critical < _SHOWN * max(largest, 1.0):
            for sign in (1.0, -1.0):
                axes.axhline(sign * critical, color=BREACH, linestyle=(0, (4, 2)), linewidth=1.0)
    axes.set_ylabel("articulation [deg]")
    if at == 0 and angles.shape[1] > 1:
        legend_above(axes)


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


def legs_film_bytes(driven: LegsResult) -> bytes:
    """Return the drive as an animated GIF that waits at every cusp, and tells the articulation there."""
    first = driven.results[0].drive

    def draw(axes: Axes) -> None:
        draw_ground(axes, driven)
        frame(axes, points_shown(driven), ROOM_M)
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
