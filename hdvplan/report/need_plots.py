"""The picture of a need: the places that decide it, and where kerb has to go."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from textwrap import fill

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hdvplan.judging.result import Result
from hdvplan.report.colours import BREACH, answer_colour
from hdvplan.report.layers import Drawn, Layer
from hdvplan.report.maps import draw_map, finish_map
from hdvplan.report.rooms import Window, joined
from hdvplan.report.style import ON_WHITE, SLIDE_IN, styled, write_head
from hdvplan.road.road import Road

_AROUND_M = 20.0  # of a place that is shown
_TITLE = 150  # characters in a line
_MOST = 4  # places shown, the largest first


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
        draw_map(axes, shown, features, window)
        _write_widening(axes, patches, window)
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
        replace(one, label=label, reason=f"s = {one.s_from:.0f} to {one.s_to:.0f} m") for label, one in zip(labels, stretches, strict=False)
    ]


def _range(patch: Drawn) -> tuple[float, float]:
    return float(patch.properties["s_from_m"] or 0.0), float(patch.properties["s_to_m"] or 0.0)


def _write_widening(axes: Axes, patches: Sequence[Drawn], window: Window) -> None:
    """Write beside every area that is to be widened how deep and how large it is."""
    for patch in patches:
        begin, end = _range(patch)
        if end >= window.s_from and begin <= window.s_to:
            x, y = np.asarray(shapely.point_on_surface(patch.geometry).coords)[0]
            text = f"{patch.properties['depth_m']:.2f} m, {patch.geometry.area:.1f} m²"
            axes.annotate(text, (x, y), xytext=(14, 10), textcoords="offset points", color=BREACH, fontweight="bold", bbox=ON_WHITE,
                          zorder=7, arrowprops={"arrowstyle": "-", "color": BREACH})  # fmt: skip
