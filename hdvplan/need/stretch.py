"""A part of a road as a separate road: places far apart are examined one by one."""

from __future__ import annotations

from dataclasses import replace

from hdvplan.case import Case
from hdvplan.planning.bias import Bias
from hdvplan.road.part import part_of


def stretch_of(case: Case, s_from: float, s_to: float) -> Case:
    """Return the case from arclength ``s_from`` to ``s_to`` [m] of its road; arclengths count from ``s_from``.

    Bodies behind the stretch's start, and plans beyond its end, lie on the road as it goes on.
    """
    beside = case.settings.horizon + case.vehicle.reach_ahead + case.vehicle.reach_behind + _ROOM_M
    cut = part_of(case.road, s_from, s_to, beside, beside)
    return replace(case, road=cut, bias=Bias(case.bias.s - s_from, case.bias.offset))


_ROOM_M = 20.0  # for bodies askew
