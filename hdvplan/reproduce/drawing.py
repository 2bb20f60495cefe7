"""What the studies' figures are made of, in the layout of the papers' own: drives on a road and over s."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb

from hdvplan.arrays import FloatArray
from hdvplan.judging.bodies import corners, pose_at
from hdvplan.judging.result import Result
from hdvplan.report.geojson import swept_area
from hdvplan.report.maps import draw_area, draw_direction, finish_map, outline_of

BLUE, YELLOW, GREY = "#0072B2", "#E69F00", "0.35"  # the papers' blue and yellow, as Okabe and Ito have them
_PALE = 0.45
_BAR_SHARE = 0.2  # of a map's height, free below the road for the scale bar
BODIES_M = 15.0  # of road between two drawn buses
COLOURS = (BLUE, "#D55E00", "#009E73", YELLOW, "#CC79A7")


def area(axes: Axes, found: Result, colour: str, label: str, *, unit: int | None = None) -> None:
    """Draw the swept area of one body, or of all, in the pale version of a colour: opaque, as overlaps must not mix to a third one."""
    fill = 1.0 - _PALE * (1.0 - np.array(to_rgb(colour)))
    envelope = found.envelope
    left, right = (envelope.reach_left, envelope.reach_right) if unit is None else (envelope.left[unit], envelope.right[unit])
    outline = outline_of(swept_area(found.drive.road.path, envelope.s, left, right))
    draw_area(axes, outline, facecolor=fill, edgecolor=colour, linewidth=0.8, label=label)


def bodies(axes: Axes, found: Result, apart: float, colour: str) -> None:
    """Draw outlines of the bodies every ``apart`` [m] of road."""
    places = np.arange(apart, found.drive.road.path.length, apart)
    outlines = list(corners(found.drive, np.array([pose_at(found.drive, float(s)) for s in places])).reshape(-1, 4, 2))
    axes.add_collection(PolyCollection(outlines, facecolors="none", edgecolors=colour, linewidths=0.9, zorder=3))


def road(axes: Axes, found: Result) -> None:
    """Draw the road's centre and limits, to scale."""
    path, limits = found.drive.road.path, found.drive.road.limits
    s = np.linspace(0.0, path.length, 400)
    axes.plot(*path.to_plane(s, 0.0), color=GREY, linewidth=0.9, linestyle=(0, (6, 3)), label="road centre")
    if limits is not None:
        for number, limit in enumerate(limits.table(s)[:2]):
            axes.plot(*path.to_plane(s, limit), color="0.1", linewidth=1.4, label="limits" if number == 0 else None)
    axes.set_aspect("equal")
    axes.margins(0.06)
    low, high = axes.get_ylim()
    axes.set_ylim(low - _BAR_SHARE * (high - low), high)
    draw_direction(axes, path, 0.0, path.length, count=4)
    finish_map(axes, north=False)


def limits(axes: Axes, found: Result) -> None:
    """Draw the limits over s."""
    limits = found.drive.road.limits
    if limits is not None:
        for number, limit in enumerate(limits.table(found.envelope.s)[:2]):
            axes.plot(found.envelope.s, limit, color="0.1", linewidth=1.4, label="limits" if number == 0 else None)


def pair(axes: Axes, s: FloatArray, half_width: FloatArray, label: str) -> None:
    """Plot a half width to both sides, dashed."""
    geometric(axes, s, half_width, label)
    geometric(axes, s, -half_width, None)


def geometric(axes: Axes, s: FloatArray, values: FloatArray, label: str | None) -> None:
    """Plot what geometry alone says, dashed."""
    axes.plot(s, values, color="0.1", linewidth=1.1, linestyle=(0, (4, 2)), label=label)


def finish(axes: Axes, x: str, y: str, title: str) -> None:
    """Label a diagram, with its legend beside it."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.set_title(title, loc="left", fontsize="medium")
    axes.grid(visible=True, color="0.9", linewidth=0.6)
    axes.legend(fontsize="small", loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)


def reach(axes: Axes, found: Result, colour: str, label: str) -> None:
    """Plot how far a drive reaches to the left and, downwards, to the right."""
    axes.plot(found.envelope.s, found.envelope.reach_left, color=colour, label=label)
    axes.plot(found.envelope.s, found.envelope.reach_right, color=colour)


def sides(found: Result) -> str:
    """Return how far a drive reaches to either side, in words."""
    return f"{found.balance.max_left:.2f} m left, {found.balance.max_right:.2f} m right"
