"""The least even half width of a road, and the least edge on one side while the other is held."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.need.measure import OUTWARDS, Taken
from hdvplan.need.search import Least, Question, least
from hdvplan.road.road import Limits, Road

ASKED = {"left": [0, 2], "right": [1, 3]}  # the rows of ``Taken`` that an edge is in
_HELD_M = 1e-3  # of a held edge: rounding of a plan that keeps it


def even_band(road: Road) -> Callable[[float], Limits]:
    """Return what gives the limits that lie a half width [m] to both sides of the line."""
    return lambda half: Limits.constant(half, half, road.path.length)


def edge_band(held: Limits, side: str) -> Callable[[float], Limits]:
    """Return what gives the limits ``held`` with the edge on ``side`` at a constant reach [m]."""

    def band(reach: float) -> Limits:
        rows = held.table(held.s)
        rows[ASKED[side]] = OUTWARDS[ASKED[side]] * reach
        return Limits(held.s, *rows)

    return band


def least_half_width(case: Case, *, on_progress: Callable[[float], None] | None = None) -> Least:
    """Return the least half width W for which a plan keeps +-W everywhere, and what obstacles leave of it.

    The road's own widths do not count; its obstacles and the clearance wanted do.
    """

    def needed(took: Taken) -> float:
        return float(np.max(took.reach, initial=0.0, where=took.counts)) if took.passes else np.inf

    question = Question(even_band(case.road), needed, 0.5 * case.vehicle.width)
    return least(case, question, on_progress=on_progress)


def least_edge(case: Case, held: Limits, side: str, *, on_progress: Callable[[float], None] | None = None) -> Least:
    """Return the least reach on the other ``side`` ("left" or "right") for which a plan keeps the edge of ``held`` opposite to it.

    Nothing is reached, and ``result`` is None, where no plan keeps the held edge.
    """
    asked, kept = ASKED[side], ASKED["right" if side == "left" else "left"]

    def needed(took: Taken) -> float:
        if not took.passes or np.max(took.beyond(held)[kept]) > _HELD_M:
            return np.inf
        return float(np.max(took.reach[asked], initial=0.0, where=took.counts[asked]))

    opposite: FloatArray = np.abs(held.table(held.s)[kept])
    question = Question(edge_band(held, side), needed, max(0.0, case.vehicle.width - float(np.min(opposite))))
    return least(case, question, on_progress=on_progress)
