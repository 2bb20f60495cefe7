"""Maps of several legs: forwards and backwards told apart, and the vehicle wherever it stands, with its articulation there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.patches import PathPatch
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import FloatArray
from hdvplan.judging.bodies import corners
from hdvplan.judging.legs import LegsResult
from hdvplan.judging.result import Result
from hdvplan.report.colours import BODY_COLOURS, BREACH, INK
from hdvplan.report.layers import kerb_features, region_features
from hdvplan.report.maps import ROOM_M, SLIDE, UNTURNED, Turn, draw_bodies, draw_features, outline_of, point
from hdvplan.report.style import ON_WHITE
from hdvplan.road.legs import direction_of

COLOURS, _DASHES = (BODY_COLOURS[0], BODY_COLOURS[1]), ("solid", (0, (4, 1.5)))  # forward, backward
PALE = 0.22  # of swept areas
_ARROWS_M = 6.0  # of way, about, from one arrow to the next
_LABELS_PT = {"start": (-44.0, 20.0), "end": (16.0, -26.0)}  # they may be one place
_LABEL_PT = (16.0, 16.0)  # of cusps


class Stop(NamedTuple):
    """Where the vehicle stands: at the start, at every cusp, and at the end."""

    name: str
    leg: int  # of which this is an end, from 0
    pose: int  # of that leg
    angles: FloatArray  # articulations [deg]
    place: FloatArray  # of the lead rear axle (2,) [m]

    @property
    def text(self) -> str:
        """The name with the articulation in whole degrees."""
        whole = np.round(self.angles) + 0.0  # -0 is 0
        return f"{self.name}: articulation {', '.join(f'{angle:+.0f}°' for angle in whole)}" if len(whole) else self.name


def ends_of(legs: int) -> list[tuple[int, int, str]]:
    """Return where a vehicle that drives so many legs stands: number of the leg, 0 at its begin or -1 at its end, and the name."""
    return [(0, 0, "start"), *((at, -1, f"cusp {at + 1}") for at in range(legs - 1)), (legs - 1, -1, "end")]


def stops_of(driven: LegsResult) -> tuple[Stop, ...]:
    """Return where the vehicle stands, in the order of driving."""
    stops = []
    for at, when, name in ends_of(len(driven.results)):
        result = driven.results[at]
        pose = 0 if (when == 0) is not driven.legs.legs[at].backward else len(result.drive.poses_s) - 1
        stops.append(Stop(name, at, pose, np.degrees(driven.articulation(at)[when]), line_of(result)[pose]))
    return tuple(stops)


def line_of(result: Result) -> FloatArray:
    """Return the lead rear axle's path in order of s, (n, 2) [m]."""
    drive = result.drive
    return np.column_stack(drive.stations.path.to_plane(drive.poses_s, drive.poses_z[:, 0]))


def draw_swept(axes: Axes, driven: LegsResult, *, weight: float = SLIDE, turned: Turn = UNTURNED) -> FloatArray:
    """Draw what each leg sweeps, labelled once a direction; return points around all of it (n, 2) [m], as they lie on the paper."""
    seen, named = list[FloatArray](), set[str]()
    for swept, leg in zip(driven.swept, driven.legs.legs, strict=True):
        area = shapely.transform(swept, turned)
        seen.append(shapely.get_coordinates(area))
        draw_area(axes, area, backward=leg.backward, named=leg.direction not in named, weight=weight)
        named.add(leg.direction)
    return np.concatenate(seen)


def draw_area(axes: Axes, area: BaseGeometry, *, backward: bool, named: bool, weight: float = SLIDE) -> None:
    """Draw what is swept on a leg, ``named`` in the legend or not."""
    label = f"swept {direction_of(backward=backward)}" if named else None
    look = {"facecolor": to_rgba(COLOURS[backward], PALE), "edgecolor": COLOURS[backward], "linewidth": 0.6 * weight, "zorder": 2}
    axes.add_patch(PathPatch(outline_of(area), label=label, **look))


def draw_ground(axes: Axes, driven: LegsResult, *, weight: float = SLIDE, turned: Turn = UNTURNED) -> None:
    """Draw what stays as it is: obstacles, kerbs, and the line of every leg with arrows, and where something is broken."""
    bounded = (one for one in driven.results if one.drive.road.limits is not None)
    ground = [*region_features(driven.legs.regions), *(kerb for one in bounded for kerb in kerb_features(one))]
    if ground:
        points = turned(shapely.get_coordinates([one.geometry for one in ground]))
        view = shapely.box(*(points.min(axis=0) - ROOM_M), *(points.max(axis=0) + ROOM_M))  # a line on its edge would be cut off
        draw_features(axes, ground, view, weight=weight, turned=turned)
    named = set[str]()
    for result, leg in zip(driven.results, driven.legs.legs, strict=True):
        line = turned(line_of(result))[:: -1 if leg.backward else 1]
        draw_line(axes, line, backward=leg.backward, named=leg.direction not in named, weight=weight)
        named.add(leg.direction)
    _draw_breaches(axes, driven, turned)


def draw_line(axes: Axes, line: FloatArray, *, backward: bool, named: bool, weight: float = SLIDE) -> None:
    """Draw the lead rear axle's line on a leg, (n, 2) in the order of driving, with arrow heads; ``named`` in the legend or not."""
    colour, label = COLOURS[backward], f"lead rear axle {direction_of(backward=backward)}" if named else None
    axes.plot(*line.T, color=colour, linestyle=_DASHES[backward], linewidth=1.3 * weight, zorder=4, label=label)
    count = max(1, round(len(line) * float(np.hypot(*(line[1] - line[0]))) / _ARROWS_M))
    style = {"arrowstyle": "-|>", "color": colour, "linewidth": 0.7 * weight, "mutation_scale": 9.3 * weight}
    for at in ((np.arange(count) + 0.5) * (len(line) - 1) / count).astype(int):
        axes.annotate("", point(line[at + 1]), point(line[at]), zorder=5, arrowprops=style | {"shrinkA": 0.0, "shrinkB": 0.0})


def draw_stops(axes: Axes, driven: LegsResult, *, weight: float = SLIDE, turned: Turn = UNTURNED) -> None:
    """Draw the vehicle at the start, at every cusp and at the end, with the articulation there."""
    for stop in stops_of(driven):
        result = driven.results[stop.leg]
        draw_bodies(axes, corners(result.drive, np.array([stop.pose])), weight=weight, turned=turned)
        draw_stop(axes, stop, weight=weight, turned=turned)


def draw_stop(axes: Axes, stop: Stop, *, weight: float = SLIDE, turned: Turn = UNTURNED) -> None:
    """Mark where the lead rear axle stands, with the name and the articulation."""
    place = turned(stop.place[None])[0]
    axes.plot(*place, marker="o", color="white", markeredgecolor=INK, markersize=4.7 * weight, zorder=7)
    axes.annotate(
        stop.text, point(place), _LABELS_PT.get(stop.name, _LABEL_PT), textcoords="offset points", fontsize="small", fontweight="bold",
        color=INK, bbox=ON_WHITE, zorder=8, arrowprops={"arrowstyle": "-", "color": INK, "linewidth": 0.5 * weight},
    )  # fmt: skip


def _draw_breaches(axes: Axes, driven: LegsResult, turned: Turn) -> None:
    places = [breach.place for result in driven.results for breach in result.balance.breaches]
    places += [(near.x, near.y) for result in driven.results for near in result.entered]
    places += [(one.x, one.y) for one in driven.jackknives if one is not None]
    if places:
        x, y = turned(np.array(places)).T
        axes.plot(x, y, linestyle="none", marker="X", color=BREACH, markersize=8, markeredgecolor="white", label="breach", zorder=6)
