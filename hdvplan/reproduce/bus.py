"""The bus: [GEO] fig. 7, a U-turn by the previous method and the geometric weight; [BUS] figs. 6-9, overhangs that may leave the lane."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.judging.result import Result
from hdvplan.planning.settings import PlannerSettings
from hdvplan.report.style import styled
from hdvplan.reproduce import drawing, published
from hdvplan.reproduce.study import Progress, Row, Study, best_fit, explained, sides_of, swept
from hdvplan.road.limits import Limits
from hdvplan.road.road import Road
from hdvplan.road.scenarios import Scenario, uturn, uturn_profile
from hdvplan.vehicle.load import load_vehicle

_CURVATURES = (0.057, 0.061)  # that [GEO]'s road may have, which is read off a figure [1/m]
_LIMITED = "the limit is at 3.0 m: it decides both numbers"
_EXPECTED = "what the balanced circle at the largest curvature needs on either side"
# [BUS]'s road is not published. On this one a rear axle in the middle lets the overhang out by about as much as theirs.
_CURVATURE, _RAMP_M, _LANE_M = 0.045, 12.0, 3.5
_SWEEPABLE_M = 8.0  # of road in all that overhangs may use: more than they can
_BEND = f"their road is not published; ours: a right angle at up to {_CURVATURE:g} 1/m, a lane of {_LANE_M:g} m"
_ORDER = "their road is not published: the order is what can be compared"

_KEPT = "the bus U-turn with limits at +-3 m; ours is what sampling between stations needs. The method before [BUS] kept 0.51 m"
WORDS = ("overhang and wheelbase free", "wheelbase in the lane", "and overhangs at a cost")


def bus_uturn(on_progress: Progress) -> Study:
    """Drive the bus through the U-turn with limits at +-3.0 m by both methods."""
    previous, proposed = _both_methods(uturn())
    on_progress(0.2)
    expected = proposed.expected.half_width
    rows = [
        Row("previous method, max right", "m", published.UTURN_PREVIOUS_RIGHT, previous.balance.max_right, _LIMITED, fitted=True),
        Row("previous method, max left", "m", published.UTURN_PREVIOUS_LEFT, previous.balance.max_left),
        Row("proposed method, max right", "m", published.UTURN_PROPOSED_RIGHT, proposed.balance.max_right),
        Row("proposed method, max left", "m", published.UTURN_PROPOSED_LEFT, proposed.balance.max_left),
    ]

    def again(curvature: float) -> list[float]:
        other = replace(uturn, profile=uturn_profile(curvature))
        return [reach for found in _both_methods(other()) for reach in (found.balance.max_right, found.balance.max_left)]

    curvature = best_fit(rows, again, _CURVATURES)
    rows = explained(rows, again(curvature), f"{curvature:.4f} 1/m instead of 0.0600, which fits all rows best")
    on_progress(1.0)
    return Study(
        "bus-uturn",
        "Bus in a U-turn",
        f"{published.GEO} fig. 7",
        "Limits at +-3.0 m; receding horizon (RTI), envelope of the exact simulation. The road is read off the figure: a curvature up to "
        "0.060 1/m.",
        (previous.case, proposed.case),
        (*rows, Row("geometric half width", "m", None, float(expected.max()), _EXPECTED)),
        sides_of({"previous": previous, "proposed": proposed}).assign(geometric_half_width=expected),
        partial(_uturn_figure, previous, proposed),
    )


def _both_methods(road: Road) -> tuple[Result, Result]:
    """Return what the bus sweeps by the previous method and by the proposed one."""
    case = Case(road, load_vehicle("bus"))
    return swept(replace(case, objective="lead-axle")), swept(case)


@styled()
def _uturn_figure(previous: Result, proposed: Result) -> Figure:
    """Return [GEO] fig. 7: the bus on the road by the previous method, blue, and the proposed one, yellow; beside it the reaches."""
    figure = Figure(figsize=(12.0, 5.2), layout="constrained")
    road, reach = figure.subplots(1, 2, width_ratios=(1.25, 1.0))
    for found, colour, label in (
        (previous, drawing.BLUE, "previous: rear axle centred"),
        (proposed, drawing.YELLOW, "proposed: geometric weight"),
    ):
        drawing.area(road, found, colour, label)
        drawing.bodies(road, found, drawing.BODIES_M, colour)
        drawing.reach(reach, found, colour, label)
    drawing.road(road, proposed)
    drawing.limits(reach, proposed)
    drawing.pair(reach, proposed.envelope.s, proposed.expected.half_width, "geometric half width")
    drawing.finish(reach, "s [m]", "reach [m], left positive", "envelope")
    road.set_title("swept area", loc="left", fontsize="medium")
    road.legend(fontsize="small", loc="center left")
    return figure


def overhang(on_progress: Progress) -> Study:
    """Drive the bus by its rear axle, as [BUS] does, with three rules for what may leave the lane; then up to a hard limit."""
    bus, free = load_vehicle("bus"), PlannerSettings(overhang_cost=0.0)
    road = Scenario("bend", uturn_profile(_CURVATURE, _RAMP_M, angle=0.5 * np.pi))()
    half, wide = 0.5 * _LANE_M, 0.5 * _SWEEPABLE_M
    s, ones = np.array([0.0, road.path.length]), np.ones(2)
    found: list[Result] = []
    rows: list[Row] = []
    columns: dict[str, FloatArray] = {}
    for number, (wheels, settings) in enumerate(((wide, free), (half, free), (half, PlannerSettings()))):
        limits = Limits(s, wheels * ones, -wheels * ones, wide * ones, -wide * ones)
        one = swept(Case(replace(road, limits=limits), bus, "lead-axle", settings=settings))
        found.append(one)
        beyond = np.maximum(one.envelope.reach_left - half, 0.0) + np.maximum(-one.envelope.reach_right - half, 0.0)  # both sides [m]
        furthest = one.balance.half_width - half
        area = float(np.trapezoid(beyond, one.envelope.s))
        rows.append(Row(f"furthest outside, {WORDS[number]}", "m", published.OVERHANG_M[number], furthest, _ORDER))
        rows.append(Row(f"area outside, {WORDS[number]}", "m^2", published.OVERHANG_AREA_M2[number], area, _ORDER))
        columns |= {
            "s": found[0].envelope.s,
            f"left_{number + 1}": one.envelope.reach_left,
            f"right_{number + 1}": one.envelope.reach_right,
            f"outside_{number + 1}": beyond,
        }
        on_progress(0.3 * len(found))
    touching = swept(Case(uturn(), bus, "lead-axle"))
    on_progress(1.0)
    kept = touching.balance.min_clearance
    rows.append(Row("kept from a hard limit", "m", published.KEPT_FROM_LIMIT, np.nan if kept is None else kept, _KEPT))
    return Study(
        "overhang",
        "Overhangs outside the lane",
        f"{published.BUS} figs. 6-9",
        f"{_BEND}. The rear axle is centred; receding horizon (RTI), envelope of the exact simulation.",
        tuple(one.case for one in (*found, touching)),
        tuple(rows),
        pd.DataFrame(columns),
        partial(_overhang_figure, dict(zip(WORDS, found, strict=True)), half),
    )


@styled()
def _overhang_figure(found: Mapping[str, Result], half: float) -> Figure:
    """Return [BUS] figs. 6-8: what the bus sweeps outside a lane of half width ``half`` [m] by each rule, on the road and over s."""
    figure = Figure(figsize=(13.0, 5.2), layout="constrained")
    road, envelope = figure.subplots(1, 2, width_ratios=(1.0, 1.3))
    for (label, one), colour in zip(found.items(), drawing.COLOURS[:3], strict=True):
        drawing.area(road, one, colour, label)
        drawing.reach(envelope, one, colour, label)
    last = list(found.values())[-1]
    drawing.bodies(road, last, drawing.BODIES_M, "0.2")
    drawing.road(road, last)
    drawing.pair(envelope, last.envelope.s, np.full(len(last.envelope.s), half), "lane")
    drawing.finish(envelope, "s [m]", "reach [m], left positive", "envelope")
    road.set_title("swept area", loc="left", fontsize="medium")
    return figure
