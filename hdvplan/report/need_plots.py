"""The picture of a need: the places that decide it, and where kerb has to go."""

from __future__ import annotations

from textwrap import fill

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch

from hdvplan.need.answer import Need
from hdvplan.need.widening import Patch
from hdvplan.report.colours import BREACH, INK, MUTED
from hdvplan.report.maps import draw_map, outline_of
from hdvplan.report.need_layers import shown_plan
from hdvplan.report.needs import need_lines
from hdvplan.report.style import SLIDE_IN, styled
from hdvplan.report.windows import Window
from hdvplan.road.road import Road

_AROUND_M = 20.0  # of a place that is shown
_TITLE = 150  # characters in a line
_MOST = 4  # places shown, the largest first
_WHITE = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.8}


def need_figure(need: Need) -> Figure:
    """Return the picture of a need: where to widen the road's own limits, or where the room that is needed is decided.

    Raises:
        ValueError: no plan was found, so there is nothing to draw.

    """
    with styled():
        return _need_figure(need)


def _need_figure(need: Need) -> Figure:
    plan = shown_plan(need)
    if plan is None:
        msg = "no plan was found: there is nothing to draw"
        raise ValueError(msg)
    shown, patches = plan
    road = shown.drive.road
    windows = _windows(need, patches, road)
    figure = Figure(figsize=SLIDE_IN, layout="constrained")
    across = 1 if len(windows) == 1 else 2
    grid = figure.add_gridspec((len(windows) + across - 1) // across, across)
    for number, window in enumerate(windows):
        axes = figure.add_subplot(grid[divmod(number, across)])
        draw_map(axes, shown, window, depths=False)
        _draw_patches(axes, patches, window)
        axes.set_title(window.title if window.label else window.reason, fontsize="small", loc="left")
        if number == 0:
            handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower left", ncols=6)
    lines = need_lines(need)
    colour = BREACH if lines[0].startswith("NO") else INK
    figure.suptitle("\n".join(fill(line, _TITLE) for line in lines), x=0.01, ha="left", fontweight="bold", fontsize="medium", color=colour)
    if road.notice is not None:
        figure.supxlabel(road.notice, fontsize="x-small", color=MUTED, x=0.99, ha="right")
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


def _draw_patches(axes: Axes, patches: tuple[Patch, ...], window: Window) -> None:
    label: str | None = "to be widened (least area)"
    for patch in patches:
        if patch.s_to < window.s_from or patch.s_from > window.s_to:
            continue
        axes.add_patch(
            PathPatch(outline_of(patch.polygon), facecolor="none", edgecolor=BREACH, hatch="xxxx", linewidth=1.4, zorder=6, label=label)
        )
        label = None
        x, y = np.asarray(shapely.point_on_surface(patch.polygon).coords)[0]
        text = f"{patch.depth:.2f} m, {patch.polygon.area:.1f} m²"
        axes.annotate(text, (x, y), xytext=(14, 10), textcoords="offset points", color=BREACH, fontweight="bold", bbox=_WHITE, zorder=7,
                      arrowprops={"arrowstyle": "-", "color": BREACH})  # fmt: skip
