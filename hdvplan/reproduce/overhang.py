"""[BUS] figs. 6-9: overhangs that may leave the lane, at no cost, at a cost, and where a passage needs it."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd

from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.judging.balance import balance_of
from hdvplan.planning.settings import PlannerSettings
from hdvplan.reproduce import published
from hdvplan.reproduce.figures import overhang_figure
from hdvplan.reproduce.study import Progress, Row, Study
from hdvplan.reproduce.swept import Swept, road_of, swept
from hdvplan.road.limits import Limits
from hdvplan.road.road import Road
from hdvplan.road.scenarios import uturn, uturn_profile
from hdvplan.vehicle.load import load_vehicle

# [BUS]'s road is not published. On this one a rear axle in the middle lets the overhang out by about as much as theirs.
_CURVATURE, _RAMP_M, _LANE_M = 0.045, 12.0, 3.5
_SWEEPABLE_M = 8.0  # of road in all that overhangs may use: more than they can
_ROAD = f"their road is not published; ours: a right angle at up to {_CURVATURE:g} 1/m, a lane of {_LANE_M:g} m"
_ORDER = "the order is what can be compared"

_KEPT = "the bus U-turn with limits at +-3 m; ours is what sampling between stations needs. The method before [BUS] kept 0.51 m"
WORDS = ("overhang and wheelbase free", "wheelbase in the lane", "and overhangs at a cost")


def overhang(on_progress: Progress) -> Study:
    """Drive the bus by its rear axle, as [BUS] does, with three rules for what may leave the lane; then up to a hard limit."""
    bus, free = load_vehicle("bus"), PlannerSettings(overhang_cost=0.0)
    road = road_of("bend", uturn_profile(_CURVATURE, _RAMP_M, angle=0.5 * np.pi))
    half, wide = 0.5 * _LANE_M, 0.5 * _SWEEPABLE_M
    found = []
    for wheels, settings in ((wide, free), (half, free), (half, PlannerSettings())):
        found.append(swept(Case(with_regions(road, wheels, wide), bus, "lead-axle", settings=settings)))
        on_progress(0.3 * len(found))
    touching = swept(Case(uturn(), bus, "lead-axle"))
    on_progress(1.0)
    kept = balance_of(touching.drive, touching.envelope).min_clearance
    return Study(
        "overhang",
        "Overhangs outside the lane",
        f"{published.BUS} figs. 6-9",
        f"{_ROAD}. The rear axle is centred; receding horizon (RTI), envelope of the exact simulation.",
        tuple(one.case for one in (*found, touching)),
        (
            *_rows(found),
            Row("kept from a hard limit", "m", published.KEPT_FROM_LIMIT, np.nan if kept is None else kept, _KEPT, headline=True),
        ),
        _data(found, half),
        partial(overhang_figure, dict(zip(WORDS, found, strict=True)), half),
    )


def with_regions(road: Road, wheels: float, overhangs: float) -> Road:
    """Return the road with a band of half width ``wheels`` to drive on, and of ``overhangs`` for overhangs [m]."""
    s, one = np.array([0.0, road.path.length]), np.ones(2)
    return replace(road, limits=Limits(s, wheels * one, -wheels * one, overhangs * one, -overhangs * one))


def outside(found: Swept, half: float) -> FloatArray:
    """Return how far anything reaches out of a lane of half width ``half``, both sides added up, shape (n,) [m]."""
    beyond: FloatArray = np.maximum(found.left - half, 0.0) + np.maximum(found.right - half, 0.0)
    return beyond


def _rows(found: list[Swept]) -> tuple[Row, ...]:
    half, rows = 0.5 * _LANE_M, []
    for words, one, furthest, area in zip(WORDS, found, published.OVERHANG_M, published.OVERHANG_AREA_M2, strict=True):
        beyond = max(float(one.left.max()), float(one.right.max())) - half
        rows.append(Row(f"furthest outside, {words}", "m", furthest, beyond, _ORDER, headline=True))
        swept_outside = float(np.trapezoid(outside(one, half), one.envelope.s))
        rows.append(Row(f"area outside, {words}", "m^2", area, swept_outside, _ORDER, headline=True))
    return tuple(rows)


def _data(found: list[Swept], half: float) -> pd.DataFrame:
    columns = {"s": found[0].envelope.s}
    for number, one in enumerate(found, start=1):
        columns |= {f"left_{number}": one.left, f"right_{number}": -one.right, f"outside_{number}": outside(one, half)}
    return pd.DataFrame(columns)
