"""The maps of a plan's picture: the whole road, and what decides, enlarged: all to one scale, in road order; and the picture of a need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from textwrap import fill

import numpy as np
import shapely
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import FloatArray
from hdvplan.judging.balance import KEPT_M, Breach
from hdvplan.judging.bodies import corners
from hdvplan.judging.result import Result
from hdvplan.report import BREACH, INK, answer_colour
from hdvplan.report.kerbs import judged_stretch, tubes_of
from hdvplan.report.layers import Drawn, Layer, drawn_features
from hdvplan.report.maps import (
    around,
    centre_of,
    draw_bodies,
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
)
from hdvplan.report.rooms import LONG_ROAD_M, Window, joined, outwards_at, pose_touching
from hdvplan.report.style import SLIDE_IN, fitted_legend, mark_broken, styled, write_beside, write_head
from hdvplan.road.road import Road

_ABREAST = 2  # enlargements beside each other
_LABELS_APART_M = 8.0
_MOST_DEPTHS = 4  # written into one map, and as many of obstacles
_TOLD_M2 = 0.05  # of a widening: a smaller one has no label beside a larger one
_LETTER_M, _LETTER_PT = 7.0, 25.0  # of a letter, from the edge that it is written beside: room on the map, and its distance
_BEYOND_M = 40.0  # the road goes on beyond an enlarged stretch, as far as the map shows
_TALL = 1.25  # height over width from which a road's overview stands beside its enlargements
_AROUND_M = 20.0  # of a place that is shown
_TITLE, _HALF, _NARROW = 150, 42, 24  # characters in a line: of the head, and of what enlargements are called
_MOST = 4  # places shown, the largest first


def draw_atlas(figure: SubFigure, result: Result, windows: tuple[Window, ...]) -> None:
    """Draw the whole road and its enlarged stretches; a tall road's map stands beside them, a wide one's above."""
    path, features = result.drive.road.path, drawn_features(result)
    whole = Window(0.0, path.length)
    across, up = np.ptp(centre_of(result, whole), axis=0)
    tall = up > _TALL * across
    if tall:
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
        taken = draw_map(overview, result, features, whole)
        frame(overview, _points(result, whole), reach_within(result, whole) + _LETTER_M)
        for window in windows:
            if window.room is not None:
                x, y = _LETTER_PT * window.room.outwards
                draw_letter(overview, window.label, window.room.beyond, (float(x), float(y)), INK)
        _draw_hits(overview, result, taken)
    draw_direction(overview, path, 0.0, path.length, count=4)
    finish_map(overview, north=result.drive.road.to_lonlat is not None)
    named = _named(overview)
    extent = np.max([np.ptp(_points(result, window), axis=0) + 2.0 * reach_within(result, window) for window in windows], axis=0)
    wider = [Window(window.s_from - _BEYOND_M, window.s_to + _BEYOND_M) for window in windows]
    tubes = tubes_of(result, [(window.s_from, window.s_to) for window in wider])
    for number, window in enumerate(windows):
        axes = figure.add_subplot(cells[divmod(number, cells.ncols)])
        _draw_enlarged(axes, result, features, window, extent, tubes[number] if tubes else None)
        title = fill(window.title.replace("s = ", "s\N{NO-BREAK SPACE}=\N{NO-BREAK SPACE}"), _NARROW if tall and cells.ncols > 1 else _HALF)
        axes.set_title(title, fontsize="medium", loc="left", fontweight="bold")
        named |= _named(axes)
    fitted_legend(lambda columns: figure.legend(list(named.values()), list(named), loc="outside upper left", ncols=columns), 4)


def _draw_enlarged(
    axes: Axes, result: Result, features: tuple[Drawn, ...], window: Window, extent: FloatArray, tube: BaseGeometry | None
) -> None:
    """Draw a stretch with the vehicle where it is tightest, on a map of ``extent`` (2,) [m] like the others, and what errors add."""
    points, road, room = _points(result, window), result.drive.road, window.room
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    ends = np.array([middle - 0.5 * extent, middle + 0.5 * extent])
    taken = draw_features(axes, features, around(ends, 0.0))
    if tube is not None:
        draw_tube(axes, tube)
    if room is not None:
        taken += draw_bodies(axes, corners(result.drive, np.array([pose_touching(result, room)])))
        if room.limited and not room.broken:  # breaches have their depth
            draw_room(axes, room, f"{max(-room.depth, 0.0):.2f} m", taken)  # the title says what it is
    _draw_depths(axes, result, Window(window.s_from - _BEYOND_M, window.s_to + _BEYOND_M), taken)
    _draw_hits(axes, result, taken)
    draw_direction(axes, road.path, window.s_from, window.s_to, count=2)
    frame(axes, ends, 0.0)
    finish_map(axes, north=road.to_lonlat is not None)


def _draw_depths(axes: Axes, result: Result, window: Window, taken: list[BaseGeometry]) -> None:
    begin, end = judged_stretch(result, window.s_from, window.s_to)
    kept = list[Breach]()
    for breach in sorted(result.balance.breaches, key=lambda breach: -breach.depth):
        apart = all(abs(breach.s_deepest - other.s_deepest) > _LABELS_APART_M or breach.side != other.side for other in kept)
        if apart and breach.obstacle is None and begin <= breach.s_deepest <= end:
            kept.append(breach)
    for breach in kept[:_MOST_DEPTHS]:
        outwards = outwards_at(result, breach.s_deepest, breach.side)
        write_beside(axes, f"{breach.depth:.2f} m", np.array(breach.place), outwards, taken, BREACH)


def _draw_hits(axes: Axes, result: Result, taken: list[BaseGeometry]) -> None:
    """Mark where obstacles are hit, however small they are, and write how deep the deepest, and what they are called."""
    hits = sorted((near for near in result.approaches if near.distance < -KEPT_M), key=lambda near: near.distance)
    if not hits:
        return
    mark_broken(axes, np.array([(near.x, near.y) for near in hits]), "obstacle hit")
    for near in hits[:_MOST_DEPTHS]:
        text = f"{-near.distance:.2f} m into {near.obstacle.label or 'an obstacle'}"
        write_beside(axes, text, np.array([near.x, near.y]), outwards_at(result, near.s, near.side), taken, BREACH)


def _points(result: Result, window: Window) -> FloatArray:
    """Return the points that a map shows: of the line, and of the place that makes the stretch worth it, which may lie beyond its ends."""
    place = np.empty((0, 2)) if window.room is None else window.room.ends
    return np.concatenate([centre_of(result, window), place])


def _named(axes: Axes) -> dict[str, Artist]:
    handles, labels = axes.get_legend_handles_labels()
    return dict(zip(labels, handles, strict=True))


@styled()
def need_figure(shown: Result, features: Sequence[Drawn], lines: Sequence[str], s: float, *, fits: bool | None) -> Figure:
    """Return the picture of a need: where to widen the road's own limits, or the place ``s`` [m] that decides how much room is needed.

    ``features`` are those of its drawing, ``lines`` its answer, which ``fits`` sums up.
    """
    road, patches = shown.drive.road, [feature for feature in features if feature.layer is Layer.WIDENING]
    windows = _windows(patches, s, road)
    figure = Figure(figsize=SLIDE_IN, layout="constrained")
    across = 1 if len(windows) == 1 else 2
    grid = figure.add_gridspec((len(windows) + across - 1) // across, across)
    for number, window in enumerate(windows):
        axes = figure.add_subplot(grid[divmod(number, across)])
        _write_widening(axes, shown, patches, window, draw_map(axes, shown, features, window))
        finish_map(axes, north=road.to_lonlat is not None)
        axes.set_title(window.title if window.label else window.reason, fontsize="small", loc="left")
        if number == 0:
            handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower right", ncols=6)
    title = "\n".join(fill(line, _TITLE) for line in lines)
    write_head(figure, title, answer_colour(fits=fits), notice=road.notice)
    return figure


def _windows(patches: Sequence[Drawn], s: float, road: Road) -> list[Window]:
    largest = sorted(patches, key=lambda patch: -float(patch.geometry.area))[:_MOST]
    ranges = [_range(patch) for patch in largest] or [(s, s)]
    length = road.path.length
    stretches = joined(Window(max(0.0, begin - _AROUND_M), min(length, end + _AROUND_M)) for begin, end in ranges)
    labels = "ABCD" if len(stretches) > 1 else [""]
    return [
        replace(one, label=label, reason=f"s = {one.s_from:z.0f} to {one.s_to:z.0f} m")
        for label, one in zip(labels, stretches, strict=False)
    ]


def _range(patch: Drawn) -> tuple[float, float]:
    return float(patch.properties["s_from_m"] or 0.0), float(patch.properties["s_to_m"] or 0.0)


def _write_widening(axes: Axes, shown: Result, patches: Sequence[Drawn], window: Window, taken: list[BaseGeometry]) -> None:
    least = min(_TOLD_M2, max((patch.geometry.area for patch in patches), default=0.0))
    for patch in patches:
        begin, end = _range(patch)
        if end >= window.s_from and begin <= window.s_to and patch.geometry.area >= least:
            text = f"{patch.properties['depth_m']:.2f} m, {patch.geometry.area:.1f} m²"
            outwards = outwards_at(shown, float(patch.properties["s_m"] or 0.0), str(patch.properties["side"]))
            write_beside(axes, text, shapely.get_coordinates(shapely.point_on_surface(patch.geometry))[0], outwards, taken, BREACH)
