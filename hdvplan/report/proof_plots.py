"""The picture of a proof: what a vehicle can reach along the road, down to where nothing is left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hdvplan.arrays import FloatArray
from hdvplan.proof.reach import Reached
from hdvplan.report.colours import BODY_COLOURS, BREACH
from hdvplan.report.style import styled

_SIZE_IN = (10.0, 7.0)
_ALPHA = (0.25, 0.75)  # of the sets in the background, and of the last one


@dataclass(frozen=True)
class Followed:
    """A reachable set over arclengths ``s`` (stations,) [m], and what readers call it."""

    label: str
    s: FloatArray
    reached: Reached


def reach_figure(sets: Sequence[Followed], title: str) -> Figure:
    """Return a figure of the offsets, headings and number of headings that are reached over s; the last set is in front.

    Offsets [m] and headings [deg] are those of the rear axle in the road's frame, left positive. A line marks where a set is empty.
    """
    with styled():
        figure = Figure(figsize=_SIZE_IN, layout="constrained")
        offset, heading, share = figure.subplots(3, 1, sharex=True, height_ratios=[3, 3, 2])
        for number, followed in enumerate(sets):
            _draw(offset, heading, share, followed, number, front=number == len(sets) - 1)
        offset.set_ylabel("offset of the rear axle [m]")
        heading.set_ylabel("heading off the road's [deg]")
        share.set_ylabel("cells of heading left")
        share.set_ylim(bottom=0.0)
        share.set_xlabel("s [m]")
        offset.legend(loc="upper right")
        figure.suptitle(title, x=0.01, ha="left", fontweight="bold", fontsize="medium")
    return figure


def _draw(offset: Axes, heading: Axes, share: Axes, followed: Followed, number: int, *, front: bool) -> None:
    s, reached, colour = followed.s, followed.reached, BODY_COLOURS[number % len(BODY_COLOURS)]
    bands = ((offset, reached.low, reached.high), (heading, np.degrees(reached.right), np.degrees(reached.left)))
    for axes, low, high in bands:
        axes.fill_between(s, low, high, color=colour, alpha=_ALPHA[front], linewidth=0.0, label=followed.label)
    share.plot(s, reached.filled, color=colour)
    if reached.empty >= 0:
        end = float(s[reached.empty])
        for axes in (offset, heading, share):
            axes.axvline(end, color=BREACH, linestyle="--", linewidth=1.2)
        offset.annotate(f" empty at s = {end:.1f} m", (end, 0.05), xycoords=("data", "axes fraction"), color=BREACH)
