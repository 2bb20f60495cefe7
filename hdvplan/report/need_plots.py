"""The picture of a need: the places that decide it, and where kerb has to go."""

from __future__ import annotations

from textwrap import fill

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hdvplan.need.answer import Need
from hdvplan.need.kerbs import Patch
from hdvplan.report.colours import BREACH, answer_colour
from hdvplan.report.maps import draw_map, finish_map
from hdvplan.report.needs import need_features, need_lines, shown_plan
from hdvplan.report.rooms import Window
from hdvplan.report.style import ON_WHITE, SLIDE_IN, styled, write_head
from hdvplan.road.road import Road

_AROUND_M = 20.0  # of a place that is shown
_TITLE = 150  # characters in a line
_MOST = 4  # places shown, the largest first


@styled()
def need_figure(need: Need) -> Figure:
    """Return the picture of a need: where to widen the road's own limits, or where the room that is needed is decided.

    Raises:
        ValueError: no plan was found, so there is nothing to draw.

    """
    plan = shown_plan(need)
    if plan is None:
        msg = "no plan was found: there is nothing to draw"
        raise ValueError(msg)
    shown, patches = plan
    road, features = shown.drive.road, need_features(need, shown)
    windows = _windows(need, patches, road)
    figure = Figure(figsize=SLIDE_IN, layout="constrained")
    across = 1 if len(windows) == 1 else 2
    grid = figure.add_gridspec((len(windows) + across - 1) // across, across)
    for number, window in enumerate(windows):
        axes = figure.add_subplot(grid[divmod(number, across)])
        draw_map(axes, shown, features, window)
        _write_widening(axes, patches, window)
        finish_map(axes, north=road.to_lonlat is not None)
        axes.set_title(window.title if window.label else window.reason, fontsize="small", loc="left")
        if number == 0:
            handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower left", ncols=6)
    lines = need_lines(need)
    title = "\n".join(fill(line, _TITLE) for line in lines)
    write_head(figure, title, answer_colour(fits=not lines[0].startswith("NO")), notice=road.notice)
    return figure


def _windows(need: Need, patches: tuple[Patch, ...], road: Road) -> list[Window]:
    if patches:
        largest = sorted(patches, key=lambda patch: -float(patch.polygon.area))[:_MOST]
        ranges = [(patch.s_from, patch.s_to) for patch in largest]
    else:
        s = need.place.s if need.place is not None else 0.0
        ranges = [(s, s)]
    joined: list[tuple[float, float]] = []
    for begin, end in sorted((max(0.0, begin - _AROUND_M), min(road.path.length, end + _AROUND_M)) for begin, end in ranges):
        if joined and begin <= joined[-1][1]:
            joined[-1] = joined[-1][0], max(end, joined[-1][1])
        else:
            joined.append((begin, end))
    labels = "ABCD" if len(joined) > 1 else " "
    return [
        Window(begin, end, label.strip(), f"s = {begin:.0f} to {end:.0f} m") for label, (begin, end) in zip(labels, joined, strict=False)
    ]


def _write_widening(axes: Axes, patches: tuple[Patch, ...], window: Window) -> None:
    """Write beside every area that is to be widened how deep and how large it is."""
    for patch in patches:
        if patch.s_to >= window.s_from and patch.s_from <= window.s_to:
            x, y = np.asarray(shapely.point_on_surface(patch.polygon).coords)[0]
            text = f"{patch.depth:.2f} m, {patch.polygon.area:.1f} m²"
            axes.annotate(text, (x, y), xytext=(14, 10), textcoords="offset points", color=BREACH, fontweight="bold", bbox=ON_WHITE,
                          zorder=7, arrowprops={"arrowstyle": "-", "color": BREACH})  # fmt: skip
