"""The picture of a manoeuvre of forward and backward legs in its place, to scale."""

from __future__ import annotations

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch

from hdvplan.report.colours import BODY_COLOURS, BREACH, INK, answer_colour
from hdvplan.report.maps import draw_bodies, outline_of, scale_bar
from hdvplan.report.reversal_layers import leg_area, line_of, view_of
from hdvplan.report.style import ON_WHITE, styled, write_head
from hdvplan.road.legs import direction_of
from hdvplan.turning.reversing.answer import Answer
from hdvplan.turning.reversing.words import details, verdict
from hdvplan.vehicle.body import corners_at

_LEG_COLOURS = {False: BODY_COLOURS[0], True: BODY_COLOURS[1]}  # forward, backward, as in pictures of planned legs
_LEG_LINES = {False: "-", True: (0, (4, 1.5))}
_WIDE = 11.0  # [inches]


@styled()
def reversal_figure(answer: Answer) -> Figure:
    """Return the picture of a manoeuvre."""
    left, low, right, high = view_of(answer).bounds
    figure = Figure(figsize=(_WIDE, min(max(_WIDE * (high - low) / (right - left), 5.0), 11.0) + 1.0), layout="constrained")
    axes = figure.add_subplot()
    draw_reversal(axes, answer)
    write_head(figure, verdict(answer), answer_colour(fits=answer.fits), notice=details(answer))
    return figure


def draw_reversal(axes: Axes, answer: Answer) -> None:
    """Draw what stands, what is swept, the lead rear axle's lines, the vehicle at begin, cusps and end, and the size of the place."""
    view, manoeuvre = view_of(answer), answer.chosen.manoeuvre
    for number, block in enumerate(answer.blocks):
        label = "walls, kerbs, parked vehicles" if number == 0 else None
        axes.add_patch(PathPatch(outline_of(block.area(view)), facecolor="0.8", edgecolor=INK, linewidth=1.2, label=label, zorder=0.5))
    for backward in (False, True):
        legs = [leg for leg in manoeuvre.legs if leg.backward is backward]
        if not legs:
            continue
        area = shapely.union_all([leg_area(answer, leg, unit) for leg in legs for unit in range(len(answer.vehicle.units))])
        words, colour = direction_of(backward=backward), _LEG_COLOURS[backward]
        axes.add_patch(
            PathPatch(
                outline_of(area), facecolor=(*to_rgb(colour), 0.18), edgecolor=colour, linewidth=0.8, label=f"swept {words}", zorder=1
            )
        )
        for number, leg in enumerate(legs):
            line = line_of(leg)
            label = f"lead rear axle, {words}" if number == 0 else None
            axes.plot(*line.T, color=colour, linestyle=_LEG_LINES[backward], linewidth=2.0, label=label, zorder=5)
            tail, tip = line[len(line) // 2], line[min(len(line) // 2 + 1, len(line) - 1)]
            axes.annotate(
                "", (tip[0], tip[1]), (tail[0], tail[1]), arrowprops={"arrowstyle": "-|>", "color": colour, "linewidth": 2.0}, zorder=6
            )
    shown = np.concatenate([manoeuvre.legs[0].poses[:1], *(leg.poses[-1:] for leg in manoeuvre.legs)])
    draw_bodies(axes, corners_at(answer.vehicle, shown))
    _draw_cusps(axes, answer)
    left, low, right, high = view.bounds
    axes.set_xlim(left, right)
    axes.set_ylim(low, high)
    axes.set_aspect("equal")
    axes.set_axis_off()
    scale_bar(axes)
    axes.legend(loc="upper left", bbox_to_anchor=(0.0, 0.0), ncols=3, borderaxespad=0.2)


def _draw_cusps(axes: Axes, answer: Answer) -> None:
    """Mark the cusps with their numbers and the articulation there, the largest of a vehicle's."""
    legs = answer.chosen.manoeuvre.legs
    for number, leg in enumerate(legs[:-1], start=1):
        x, y = (float(value) for value in leg.lead[-1, :2])
        angle = f": {np.rad2deg(np.max(np.abs(leg.beta[-1]))):.1f}°" if leg.beta.size else ""
        label = "cusp, with the articulation there" if angle else "cusp"
        axes.plot(
            x,
            y,
            marker="D",
            color=BREACH,
            markeredgecolor="white",
            markersize=8,
            linestyle="none",
            zorder=8,
            label=label if number == 1 else None,
        )
        axes.annotate(
            f"{number}{angle}", (x, y), (8.0, 6.0), textcoords="offset points", color=BREACH, fontweight="bold", bbox=ON_WHITE, zorder=9
        )
