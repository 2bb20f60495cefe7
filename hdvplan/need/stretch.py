"""A part of a road as a separate road: places far apart are examined one by one."""

from __future__ import annotations

from dataclasses import replace

from hdvplan.case import Case
from hdvplan.planning.bias import Bias


def stretch_of(case: Case, s_from: float, s_to: float) -> Case:
    """Return the case from arclength ``s_from`` to ``s_to`` [m] of its road; arclengths count from ``s_from``.

    Bodies behind the stretch's start, and plans beyond its end, lie on the road as it goes on.
    """
    road, vehicle, settings = case.road, case.vehicle, case.settings
    beside = settings.horizon + vehicle.reach_ahead + vehicle.reach_behind + _ROOM_M
    path = road.path.stretch(s_from, s_to, beside, beside)
    limits = road.own_limits
    if limits is not None:
        limits = limits.along(road.path, s_from - beside, s_to + beside)
        limits = replace(limits, s=limits.s - s_from)
    cut = replace(road, path=path, smoothing=None, limits=None, band=None).within(limits)
    return replace(case, road=cut, bias=Bias(case.bias.s - s_from, case.bias.offset))


_ROOM_M = 20.0  # for bodies askew
