"""Where a vehicle turns about: plan legs again with cusps beyond the drawn ones, or short of them, where the drawn ones lack room."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import scipy

from hdvplan.arrays import FloatArray
from hdvplan.driving.drive import POSE_SPACING_M
from hdvplan.errors import HdvplanError
from hdvplan.judging.legs import LegsResult
from hdvplan.road.joints import joined
from hdvplan.road.legs import Leg, Legs
from hdvplan.road.load_legs import within
from hdvplan.road.regions import Kind
from hdvplan.road.road import part_of

_FURTHEST_M = 6.0  # that a cusp is moved past the drawn one
_SHORT_M = 8.0  # that a leg stops short of it
_FIRST_M = 1.5  # of the first trials
_TRIALS = 16  # a cusp
_FOUND_M = 0.02  # to which cusps are sought
_ROOM_M = 100.0  # of a line beyond its ends: further than bodies reach


def past(legs: Legs, by: FloatArray) -> Legs:
    """Return legs that are driven ``by`` past their cusps (cusps,), or stop short of them where negative [m]; first and last ends stay.

    Raises:
        RoadError: lines that stop short no longer meet.

    """
    ends = np.concatenate([[0.0], by, [0.0]])
    moved = []
    for leg, before, after in zip(legs.legs, ends[:-1], ends[1:], strict=True):
        low, high = (after, before) if leg.backward else (before, after)
        road = part_of(leg.road, -float(low), leg.road.path.length + float(high), _ROOM_M, _ROOM_M)
        if leg.road.limits is None and leg.road.drawn is None:  # the bounds of an open place are no street
            road = replace(road, drawn=None)
        moved.append(Leg(road, leg.backward))
    own, _ = joined(tuple(moved), 2.0 * _FURTHEST_M)
    return replace(legs, legs=tuple(within(leg, legs.regions) for leg in own))


def with_room(drawn: LegsResult, plan: Callable[[Legs], LegsResult]) -> LegsResult:
    """Return the plan with the most room among those with cusps near the drawn ones; the first that fits, where one does."""
    best, count = drawn, len(drawn.legs.legs) - 1
    if not count:  # a single leg, backwards
        return drawn

    def lacking(by: FloatArray) -> float:
        nonlocal best
        if best.fits:  # what is still tried costs nothing
            return -best.room
        try:
            found = replace(plan(past(drawn.legs, by)), past=tuple(by.tolist()))
        except HdvplanError:
            return float(np.inf)
        best = max(best, found, key=lambda one: one.room)
        return _entered(found) - found.room

    simplex = np.vstack([np.zeros(count), _FIRST_M * np.eye(count)])
    options: Any = {"initial_simplex": simplex, "maxfev": _TRIALS * count, "xatol": _FOUND_M, "fatol": _FOUND_M}  # typed by method
    bounds = [(-_SHORT_M, _FURTHEST_M)] * count
    scipy.optimize.minimize(lacking, np.zeros(count), method="Nelder-Mead", bounds=bounds, options=options)
    return best


def _entered(found: LegsResult) -> float:
    """Return the way over which bodies are in obstacles [m]: how deep one is in a wall says little, or how far beyond it it is driven."""
    obstacles = [region.polygon for region in found.legs.regions if region.kind is Kind.OBSTACLE]
    inside = (np.unique(result.outlines.query(obstacles, predicate="intersects")[1]).size for result in found.results)
    return POSE_SPACING_M * sum(inside)
