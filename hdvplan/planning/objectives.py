"""What a plan should centre: the residual lead * e_y + aux * e_aux - target at every station."""

from __future__ import annotations

import difflib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hdvplan.errors import OptionError
from hdvplan.jit import FloatArray
from hdvplan.planning.stations import Stations


@dataclass(frozen=True)
class Residual:
    """Coefficients of the squared lateral error, one per station; shape (n,) each. ``target`` in metres."""

    lead: FloatArray
    aux: FloatArray
    target: FloatArray


def geometric(stations: Stations) -> Residual:
    """Balance the swept area with the weight K of each station's curvature ([GEO] sec. IV)."""
    weight = stations.centering.weight
    return Residual(weight, np.ones_like(weight), np.zeros_like(weight))


def geometric_fixed(stations: Stations) -> Residual:
    """Balance with one K, that of the road's largest curvature (the alternative that [GEO] compares with)."""
    on_road = stations.s <= stations.path.length
    tightest = int(np.argmax(np.abs(stations.road[4]) * on_road))
    weight = np.full(len(stations.s), stations.centering.weight[tightest])
    return Residual(weight, np.ones_like(weight), np.zeros_like(weight))


def lead_axle(stations: Stations) -> Residual:
    """Centre the lead unit's rear axle alone (the previous method of [BUS], J1 of [ART])."""
    one = np.ones(len(stations.s))
    return Residual(one, 0.0 * one, 0.0 * one)


def trail_axle(stations: Stations) -> Residual:
    """Centre the auxiliary axle alone: a bus's front axle, a chain's last axle (J2 of [ART])."""
    one = np.ones(len(stations.s))
    return Residual(0.0 * one, one, 0.0 * one)


Objective = Callable[[Stations], Residual]

OBJECTIVES: dict[str, Objective] = {
    "geometric": geometric,
    "geometric-fixed": geometric_fixed,
    "lead-axle": lead_axle,
    "trail-axle": trail_axle,
}


def objective_named(name: str) -> Objective:
    """Return the objective that users call ``name``.

    Raises:
        OptionError: there is none of that name.

    """
    if name not in OBJECTIVES:
        close = difflib.get_close_matches(name, OBJECTIVES, n=1)
        msg = f"unknown objective {name!r}"
        raise OptionError(msg, hint=f"did you mean {close[0]!r}?" if close else f"objectives: {', '.join(OBJECTIVES)}")
    return OBJECTIVES[name]
