"""The maps of a plan's picture: the whole road, and what decides, enlarged: all to one scale, in road order."""

from __future__ import annotations

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import SubFigure
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import FloatArray
from hdvplan.judging.bodies import corners
from hdvplan.judging.result import Result
from hdvplan.report.colours import INK
from hdvplan.report.layers import Drawn, drawn_features
from hdvplan.report.maps import (
    LABEL_AWAY_M,
    around,
    draw_bodies,
    draw_depths,
    draw_direction,
    draw_features,
    draw_letter,
    draw_map,
    draw_overview,
    draw_room,
    draw_tube,
    finish_map,
    frame,
    reach_within,
    stations,
)
from hdvplan.report.rooms import LONG_ROAD_M, Window, pose_touching
from hdvplan.report.tube import tubes_of

_ABREAST = 2  # enlargements beside each other
_LETTER_M, _LETTER_PT = 7.0, 25.0  # from the edge that it is written beside: room on the map, and its distance
_BEYOND_M = 40.0  # the road goes on beyond an enlarged stretch, as far as the map shows
_TALL = 1.25  # height over width from which a road's overview stands beside its enlargements


def draw_atlas(figure: SubFigure, result: Result, windows: tuple[Window, ...]) -> None:
    """Draw the whole road and its enlarged stretches; a tall road's map stands beside them, a wide one's above."""
    path, features = result.drive.road.path, drawn_features(result)
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
        draw_map(overview, result, features, whole)
        frame(overview, _points(result, whole), reach_within(result, whole) + _LETTER_M)
        for window in windows:
            if window.room is not None:
                x, y = _LETTER_PT * window.room.outwards
                draw_letter(overview, window.label, window.room.beyond, (float(x), float(y)), INK)
    draw_direction(overview, path, 0.0, path.length, count=4)
    finish_map(overview, north=result.drive.road.to_lonlat is not None)
    named = _named(overview)
    extent = np.max([np.ptp(_points(result, window), axis=0) + 2.0 * reach_within(result, window) for window in windows], axis=0)
    wider = [Window(window.s_from - _BEYOND_M, window.s_to + _BEYOND_M) for window in windows]
    tubes = tubes_of(result, [(window.s_from, window.s_to) for window in wider])
    for number, window in enumerate(windows):
        axes = figure.add_subplot(cells[divmod(number, cells.ncols)])
        _draw_enlarged(axes, result, features, window, extent, tubes[number] if tubes else None)
        axes.set_title(window.title, fontsize="medium", loc="left", fontweight="bold")
        named |= _named(axes)
    figure.legend(list(named.values()), list(named), loc="outside upper left", ncols=4)


def _draw_enlarged(
    axes: Axes, result: Result, features: tuple[Drawn, ...], window: Window, extent: FloatArray, tube: BaseGeometry | None
) -> None:
    """Draw a stretch with the vehicle where it is tightest, on a map of ``extent`` (2,) [m] like the others, and what errors add."""
    points, road, room = _points(result, window), result.drive.road, window.room
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    ends = np.array([middle - 0.5 * extent, middle + 0.5 * extent])
    draw_features(axes, features, around(ends, 0.0))
    if tube is not None:
        draw_tube(axes, tube)
    draw_depths(axes, result, Window(window.s_from - _BEYOND_M, window.s_to + _BEYOND_M))
    if room is not None:
        draw_bodies(axes, corners(result.drive, np.array([pose_touching(result, room)])))
        if room.limited and not room.broken:  # breaches have their depth
            draw_room(axes, room, f"{max(-room.depth, 0.0):.2f} m", room.beyond + LABEL_AWAY_M * room.outwards)  # the title says what it is
    draw_direction(axes, road.path, window.s_from, window.s_to, count=2)
    frame(axes, ends, 0.0)
    finish_map(axes, north=road.to_lonlat is not None)


def _points(result: Result, window: Window) -> FloatArray:
    """Return the points that a map shows: of the line, and of the place that makes the stretch worth it, which may lie beyond its ends."""
    place = np.empty((0, 2)) if window.room is None else window.room.ends
    return np.concatenate([np.column_stack(result.drive.road.path.to_plane(stations(window), 0.0)), place])


def _named(axes: Axes) -> dict[str, Artist]:
    handles, labels = axes.get_legend_handles_labels()
    return dict(zip(labels, handles, strict=True))
