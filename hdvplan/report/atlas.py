"""The maps of a plan's picture: the whole road, and what decides, enlarged: all to one scale, in road order."""

from __future__ import annotations

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import SubFigure

from hdvplan.arrays import FloatArray
from hdvplan.judging.result import Result
from hdvplan.report.furniture import draw_direction, finish_map
from hdvplan.report.maps import draw_bodies, draw_map, draw_overview, draw_room, draw_tracks, frame, reach_within, stations
from hdvplan.report.rooms import pose_touching, room_at
from hdvplan.report.windows import LONG_ROAD_M, Window

_ABREAST = 2  # enlargements beside each other
_BEYOND_M = 40.0  # the road goes on beyond an enlarged stretch, as far as the map shows
_LETTER_M = 7.0  # from the edge that it is written beside
_TALL = 1.25  # height over width from which a road's overview stands beside its enlargements


def draw_atlas(figure: SubFigure, result: Result, windows: tuple[Window, ...]) -> None:
    """Draw the whole road and its enlarged stretches; a tall road's map stands beside them, a wide one's above."""
    path = result.drive.road.path
    whole = Window(0.0, path.length)
    across, up = (float(np.ptp(side)) for side in path.to_plane(stations(whole), 0.0))
    if up > _TALL * across:
        rows = len(windows) if len(windows) <= _ABREAST else -(-len(windows) // _ABREAST)
        grid = figure.add_gridspec(1, 2, width_ratios=[1.0, 1.1 if len(windows) <= _ABREAST else 1.6])
        cells = grid[1].subgridspec(rows, -(-len(windows) // rows))
    else:
        rows = -(-len(windows) // _ABREAST)
        grid = figure.add_gridspec(2, 1, height_ratios=[1.0 if rows == 1 else 0.7, 0.9 * rows])
        cells = grid[1].subgridspec(rows, min(_ABREAST, len(windows)))
    overview = figure.add_subplot(grid[0])
    if path.length > LONG_ROAD_M:
        draw_overview(overview, result, windows)
    else:
        draw_map(overview, result, whole, depths=False)
        frame(overview, _points(result, whole), _reach(result, whole) + _LETTER_M)
        _letter(overview, result, windows)
    draw_direction(overview, path, 0.0, path.length, count=4)
    _finish(overview, result)
    named = _named(overview)
    extent = _extent(result, windows)
    for number, window in enumerate(windows):
        axes = figure.add_subplot(cells[divmod(number, cells.ncols)])
        _draw_enlarged(axes, result, window, extent)
        axes.set_title(window.title, fontsize="medium", loc="left", fontweight="bold")
        named |= _named(axes)
    figure.legend(list(named.values()), list(named), loc="outside upper left", ncols=4)


def _draw_enlarged(axes: Axes, result: Result, window: Window, extent: FloatArray) -> None:
    """Draw a stretch with the vehicle where it is tightest, on a map of ``extent`` (2,) [m] like the others."""
    path = result.drive.road.path
    shown = Window(max(0.0, window.s_from - _BEYOND_M), min(path.length, window.s_to + _BEYOND_M))
    draw_map(axes, result, shown, bodies=False)
    draw_tracks(axes, result, shown)
    if window.at is not None:
        room = room_at(result, window.at)
        draw_bodies(axes, result, np.array([pose_touching(result, room)]))
        draw_room(axes, room)
    draw_direction(axes, path, window.s_from, window.s_to, count=2)
    middle = _middle(result, window)
    frame(axes, np.array([middle - 0.5 * extent, middle + 0.5 * extent]), 0.0)
    _finish(axes, result)


def _extent(result: Result, windows: tuple[Window, ...]) -> FloatArray:
    """Return the width and height that hold every stretch, so that all are drawn to one scale [m]."""
    sides = [np.ptp(_points(result, window), axis=0) + 2.0 * _reach(result, window) for window in windows]
    most: FloatArray = np.max(sides, axis=0)
    return most


def _middle(result: Result, window: Window) -> FloatArray:
    points = _points(result, window)
    middle: FloatArray = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return middle


def _points(result: Result, window: Window) -> FloatArray:
    """Return the points that a map shows: of the line, and of the place that makes the stretch worth it, which may lie beyond its ends."""
    place = np.empty((0, 2)) if window.at is None else room_at(result, window.at).ends
    return np.concatenate([np.column_stack(result.drive.road.path.to_plane(stations(window), 0.0)), place])


def _reach(result: Result, window: Window) -> float:
    s = result.envelope.s
    return reach_within(result, (s >= window.s_from) & (s <= window.s_to))


def _letter(axes: Axes, result: Result, windows: tuple[Window, ...]) -> None:
    """Write the letters of the enlarged stretches beside their tightest places."""
    for window in windows:
        if window.at is None:
            continue
        room = room_at(result, window.at)
        (x, y), (u, v) = room.beyond, room.beyond + _LETTER_M * room.outwards
        axes.annotate(
            window.label, (float(x), float(y)), (float(u), float(v)), ha="center", va="center", color="white",
            fontsize="small", fontweight="bold", zorder=8, arrowprops={"arrowstyle": "-", "color": "0.1"},
            bbox={"boxstyle": "circle,pad=0.25", "facecolor": "0.1", "edgecolor": "white"},
        )  # fmt: skip


def _finish(axes: Axes, result: Result) -> None:
    finish_map(axes, north=result.drive.road.to_lonlat is not None)


def _named(axes: Axes) -> dict[str, Artist]:
    handles, labels = axes.get_legend_handles_labels()
    return dict(zip(labels, handles, strict=True))
