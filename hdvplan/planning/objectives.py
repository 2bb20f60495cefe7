"""What a plan should centre: a weighted sum of two axles' offsets, or the furthest of many points, at every station."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from hdvplan.errors import OptionError, did_you_mean
from hdvplan.jit import FloatArray
from hdvplan.planning.motion import aux_ahead
from hdvplan.planning.stations import Stations
from hdvplan.vehicle.model import Vehicle


@dataclass(frozen=True)
class Residual:
    """Coefficients of the squared lateral error (lead e_y + aux e_aux - target)^2 per station; shape (n,), ``target`` in metres.

    The auxiliary axle is the one of unit number ``axle`` (from 0, or -1 for the last), of the lead unit its front axle.
    """

    lead: FloatArray
    aux: FloatArray
    target: FloatArray
    axle: int = -1


@dataclass(frozen=True)
class Furthest:
    """The largest distance t of any watched point from the road's centre over the horizon of N stages, at the cost N t^2.

    ``beside`` is the residual to centre where the largest distance leaves a choice; light enough not to change it.
    """

    bodies: bool  # watch the points of both edges of every body; else the axles alone
    beside: Residual


@dataclass(frozen=True)
class Balanced:
    """The middle of the swept envelope at every place, measured on the plan; ``aim`` (n,) is where it should lie [m].

    ``beside`` is the stationary residual: all of it where a plan does not yet sweep a place to its end, a small share elsewhere.
    What the defaults gain and cost, and the alternatives, is measured in ``docs/balanced.md``.
    """

    beside: Residual
    aim: FloatArray
    share: float = 0.015  # of ``beside`` where the plan is measured: holds the largest reach down where the two disagree
    rounding: float = 0.05  # an imbalance counts with its square up to about this, with its magnitude beyond [m]
    relaxation: float = 4.0 / 3.0  # of the step that is safe on its own; below 2 no step makes the objective worse
    ahead: float = 50.0  # places as far ahead as this are balanced: those beyond are planned again before they are driven [m]
    rounds: int = 10  # most programs of a plan that iterates: points that take places from each other never quite stand still


def geometric(stations: Stations) -> Residual:
    """Balance the swept area with the weight K of each station's curvature ([GEO] sec. IV)."""
    balanced = stations.centring
    return Residual(balanced.lead, balanced.aux, balanced.target, balanced.axle)


def geometric_fixed(stations: Stations) -> Residual:
    """Balance with one K, that of the road's largest curvature (the alternative that [GEO] compares with)."""
    on_road = stations.s <= stations.path.length
    tightest = int(np.argmax(np.abs(stations.road[4]) * on_road))
    balanced, one = stations.centring, np.ones(len(stations.s))
    lead, aux = balanced.lead[tightest] * one, balanced.aux[tightest] * one
    aimed = balanced.target[tightest] != 0.0  # then the pair does not balance by itself
    target = lead * (balanced.e_y - stations.bias) + aux * (balanced.e_aux - stations.bias)  # the bias is added where it belongs
    return Residual(lead, aux, target if aimed else 0.0 * one, balanced.axle)


def lead_axle(stations: Stations) -> Residual:
    """Centre the lead unit's rear axle alone (the previous method of [BUS], J1 of [ART])."""
    one = np.ones(len(stations.s))
    return Residual(one, 0.0 * one, 0.0 * one)


def trail_axle(stations: Stations) -> Residual:
    """Centre a bus's front axle or a chain's last axle alone (J2 of [ART])."""
    one = np.ones(len(stations.s))
    return Residual(0.0 * one, one, 0.0 * one)


def art_weighted(stations: Stations) -> Residual:
    """Centre (1 - K) e_y + K e_aux (J3 of [ART]) with the geometric K of the road's largest curvature, 1 / (1 + its weight)."""
    balanced = geometric_fixed(stations)
    share = 1.0 / (balanced.lead + balanced.aux)
    return Residual(share * balanced.lead, share * balanced.aux, share * balanced.target, balanced.axle)


def art_weighted_by(share: float) -> Objective:
    """Return the objective that centres (1 - K) e_y + K e_aux with K = ``share``.

    Raises:
        OptionError: the share is not a number from 0 to 1.

    """
    if not 0.0 <= share <= 1.0:
        msg = f"the weight of {_WEIGHTED!r} must be a number from 0 to 1, not {share:g}"
        raise OptionError(msg)
    return partial(_weighted_by, share)


def _weighted_by(share: float, stations: Stations) -> Residual:
    one = np.ones(len(stations.s))
    return Residual((1.0 - share) * one, share * one, 0.0 * one)


def axle_max(stations: Stations) -> Furthest:
    """Keep small how far any axle gets off (J4 of [ART]): lead and auxiliary axle, every unit's own in longer chains."""
    return Furthest(bodies=False, beside=_light(geometric(stations)))


def body_max(stations: Stations) -> Furthest:
    """Keep small how far any body side reaches (J5 of [ART]): the narrowest band that holds the swept area."""
    return Furthest(bodies=True, beside=_light(geometric(stations)))


def balanced(stations: Stations) -> Balanced:
    """Balance what the plan itself sweeps, place by place, where curvature changes too."""
    return Balanced(geometric(stations), np.zeros(len(stations.s)))


def aimed(centred: Residual | Furthest | Balanced, stations: Stations, vehicle: Vehicle) -> Residual | Furthest | Balanced:
    """Return an objective of ``vehicle`` about the wanted bias of the stations.

    K (e_y - e_y*) + (e_aux - e_aux*) with the stationary offsets of the biased circle: those of the circle itself cancel by
    the choice of K, and what remains of the target is each axle's bias at its own place.

    Raises:
        OptionError: the objective has no residual.

    """
    if not np.any(stations.bias):
        return centred
    if isinstance(centred, Balanced):
        return replace(centred, beside=_about(centred.beside, stations, vehicle), aim=centred.aim + stations.bias)
    if isinstance(centred, Residual):
        return _about(centred, stations, vehicle)
    msg = "an objective that keeps the largest reach small cannot be combined with a bias"
    raise OptionError(msg, hint="choose --objective geometric or balanced")


def _about(residual: Residual, stations: Stations, vehicle: Vehicle) -> Residual:
    at_aux = np.interp(stations.s + aux_ahead(vehicle, residual.axle), stations.s, stations.bias)
    return replace(residual, target=residual.target + residual.lead * stations.bias + residual.aux * at_aux)


def _light(residual: Residual) -> Residual:
    """Return a residual at a hundredth of its cost.

    In [ART]'s U-turn that raises the largest reach by 1 mm (J5) and 3 mm (J4), and keeps the vehicle near the centre where
    nothing else does. The sum of every station's own largest reach is no substitute: it buys short gains elsewhere with a
    higher peak, 4.90 m instead of 4.60 m.
    """
    lead, aux, target = (np.sqrt(_BESIDE) * part for part in (residual.lead, residual.aux, residual.target))
    return replace(residual, lead=lead, aux=aux, target=target)


Objective = Callable[[Stations], Residual | Furthest | Balanced]

_BESIDE = 0.01
_WEIGHTED = "art-weighted"
OBJECTIVES: dict[str, Objective] = {
    "geometric": geometric,
    "geometric-fixed": geometric_fixed,
    "lead-axle": lead_axle,
    "trail-axle": trail_axle,
    _WEIGHTED: art_weighted,
    "axle-max": axle_max,
    "body-max": body_max,
    "balanced": balanced,
}


def objective_named(name: str) -> Objective:
    """Return the objective that users call ``name``; ``art-weighted:0.45`` gives its weight as a number.

    Raises:
        OptionError: there is none of that name, or the weight is not a number from 0 to 1.

    """
    known, _, share = name.partition(":")
    if known == _WEIGHTED and share:
        return art_weighted_by(_number(share))
    if name not in OBJECTIVES:
        msg = f"unknown objective {name!r}"
        raise OptionError(msg, hint=did_you_mean(name, OBJECTIVES, f"objectives: {', '.join(OBJECTIVES)}"))
    return OBJECTIVES[name]


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return float("nan")
