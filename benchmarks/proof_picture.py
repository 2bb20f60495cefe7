"""Draw what a rigid vehicle can reach through a tight place: within limits too narrow, and some that are a little wider.

Writes reach.csv (where each set is lost, and how many cells it has), reach.png, run.json.

python benchmarks/proof_picture.py [--out results/proof-reach] [--road R] [--vehicle V] [--half-widths A,B] [--s-from S] [--s-to S]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from cases import case_within, free_case, numbers, options_of, write_results
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.judging.balance import KEPT_M
from hdvplan.proof.answer import RIGID, ROUNDING_M, grid_of
from hdvplan.proof.reach import Reached, outline_of, reachable
from hdvplan.proof.space import beside, frame_of
from hdvplan.report import BODY_COLOURS, BREACH
from hdvplan.report.style import figure_bytes, styled, write_head

_AROUND_M = 50.0  # of the stretch: no point of a rigid vehicle has its foot further away
_FINE = RIGID[1]
_SIZE_IN = (10.0, 7.0)
_ALPHA = (0.25, 0.75)  # of the sets in the background, and of the last one


@dataclass(frozen=True)
class Followed:
    """A reachable set over arclengths ``s`` (stations,) [m], and what readers call it."""

    label: str
    s: FloatArray
    reached: Reached


def main() -> None:
    """Follow the sets and draw them."""
    parser = options_of(__doc__, "proof-reach")
    parser.add_argument("--road", default="monaco_fairmont_hairpin")
    parser.add_argument("--vehicle", default="bus")
    parser.add_argument("--half-widths", type=numbers, default=[3.25, 3.05])
    parser.add_argument("--s-from", type=float, default=290.0)
    parser.add_argument("--s-to", type=float, default=345.0)
    options = parser.parse_args()
    cases = [case_within(free_case(options.road, options.vehicle), width) for width in options.half_widths]
    sets = [
        followed(case, options.s_from, options.s_to, f"limits at ±{width:.2f} m")
        for case, width in zip(cases, options.half_widths, strict=True)
    ]
    ends = [{"half_width": width, **_told(one)} for width, one in zip(options.half_widths, sets, strict=True)]
    figure = reach_figure(
        sets, f"{options.vehicle} on {options.road}: all that any steering reaches from any pose at s = {options.s_from:.0f} m"
    )
    write_results(options.out, {"reach": pd.DataFrame(ends)}, {}, cases)
    (options.out / "reach.png").write_bytes(figure_bytes(figure, "png"))


def _told(one: Followed) -> dict[str, object]:
    """Return where a set is lost [m], empty where it is not, and the mean number of its cells of heading."""
    reached = one.reached
    return {"empty_s": None if reached.empty < 0 else float(one.s[reached.empty]), "cells_mean": float(np.mean(reached.filled))}


def followed(case: Case, s_from: float, s_to: float, label: str) -> Followed:
    """Return what the leading unit of a case can reach, by the bounds and with the room of a proof."""
    road = replace(case.road, path=case.road.path.extended(_AROUND_M, _AROUND_M))
    space = beside(road, s_from - _AROUND_M, s_to + _AROUND_M, room=KEPT_M + ROUNDING_M)
    assert space is not None  # noqa: S101 - for the type checker: the road has limits
    outline = outline_of(case.vehicle.lead, two_regions=False)
    frame = frame_of(road.path, np.arange(s_from, s_to, _FINE.step))
    reached = reachable(outline, case.vehicle.max_curvature, space, frame, grid_of(frame, _FINE.cell), two_regions=False)
    return Followed(label, frame.s, reached)


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
        write_head(figure, title)
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


if __name__ == "__main__":
    main()
