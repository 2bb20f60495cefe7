"""What a plan should centre, balance or keep small, by the names that users give it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import cast

import numpy as np

from hdvplan import plugins
from hdvplan.errors import HdvplanError, OptionError, refused_in
from hdvplan.planning.settings import WEIGHTED, check_objective, share_of
from hdvplan.planning.stations import Stations
from hdvplan.planning.terms.balance import EnvelopeBalance
from hdvplan.planning.terms.centring import Centring, Reach, Residual
from hdvplan.planning.terms.term import Term
from hdvplan.vehicle.model import Vehicle


@dataclass(frozen=True)
class Goal:
    """The terms of an objective, in addition to smoothness and the terms of every program."""

    terms: tuple[Term, ...]
    rounds: int | None = None  #: most programs of a plan that iterates; None: as in the settings
    owner: str = ""  #: the user's objective that has made it, as messages name it; hdvplan sets it


Objective = Callable[[Stations, Vehicle], Goal]


def geometric(stations: Stations, vehicle: Vehicle) -> Goal:
    """Balance the swept area with the weight K of each station's curvature ([GEO] sec. IV)."""
    return _centred(_geometric(stations), stations, vehicle)


def geometric_fixed(stations: Stations, vehicle: Vehicle) -> Goal:
    """Balance with one K, that of the road's largest curvature (the alternative that [GEO] compares with)."""
    return _centred(_geometric_fixed(stations), stations, vehicle)


def lead_axle(stations: Stations, vehicle: Vehicle) -> Goal:
    """Centre the lead unit's rear axle alone (the previous method of [BUS], J1 of [ART])."""
    return art_weighted(stations, vehicle, 0.0)


def trail_axle(stations: Stations, vehicle: Vehicle) -> Goal:
    """Centre a bus's front axle or a chain's last axle alone (J2 of [ART])."""
    return art_weighted(stations, vehicle, 1.0)


def art_weighted(stations: Stations, vehicle: Vehicle, share: float | None = None) -> Goal:
    """Centre (1 - K) e_y + K e_aux (J3 of [ART]); without a ``share`` K is the geometric one of the road's largest curvature."""
    if share is None:
        fixed = _geometric_fixed(stations)
        residual = fixed.scaled(1.0 / (fixed.lead + fixed.aux))
    else:
        one = np.ones(len(stations.s))
        residual = Residual((1.0 - share) * one, share * one, 0.0 * one)
    return _centred(residual, stations, vehicle)


def axle_max(stations: Stations, vehicle: Vehicle) -> Goal:  # noqa: ARG001 - every objective receives both
    """Keep small how far any axle gets off (J4 of [ART]): lead and auxiliary axle, every unit's own in longer chains."""
    return _furthest(stations, bodies=False)


def body_max(stations: Stations, vehicle: Vehicle) -> Goal:  # noqa: ARG001 - as above
    """Keep small how far any body side reaches (J5 of [ART]): the narrowest band that holds the swept area."""
    return _furthest(stations, bodies=True)


def balanced(stations: Stations, vehicle: Vehicle) -> Goal:
    """Balance what the plan itself sweeps, place by place, where curvature changes too."""
    term = EnvelopeBalance(_aimed(_geometric(stations), stations, vehicle), stations.bias)
    return Goal((term,), rounds=10)  # points that take places from each other never quite converge


def _geometric(stations: Stations) -> Residual:
    own = stations.centring
    return Residual(own.lead, own.aux, own.target, own.axle)


def _geometric_fixed(stations: Stations) -> Residual:
    on_road = stations.s <= stations.path.length
    tightest = int(np.argmax(np.abs(stations.curvature) * on_road))
    own, one = stations.centring, np.ones(len(stations.s))
    lead, aux = own.lead[tightest] * one, own.aux[tightest] * one
    aimed = own.target[tightest] != 0.0  # then the pair does not balance by itself
    target = lead * (own.e_y - stations.bias) + aux * (own.e_aux - stations.bias)  # the bias is added where it belongs
    return Residual(lead, aux, target if aimed else 0.0 * one, own.axle)


def _centred(residual: Residual, stations: Stations, vehicle: Vehicle) -> Goal:
    return Goal((Centring(_aimed(residual, stations, vehicle)),))


def _aimed(residual: Residual, stations: Stations, vehicle: Vehicle) -> Residual:
    return residual.about(stations, vehicle) if np.any(stations.bias) else residual


def _furthest(stations: Stations, *, bodies: bool) -> Goal:
    """Return the largest reach as the objective, and centring at a hundredth of its cost.

    In [ART]'s U-turn that raises the largest reach by 1 mm (J5) and 3 mm (J4), and keeps the vehicle near the centre where
    nothing else does. The sum of every station's own largest reach is no substitute: it buys short gains elsewhere with a
    higher peak, 4.90 m instead of 4.60 m.
    """
    if np.any(stations.bias):
        msg = "an objective that keeps the largest reach small cannot be combined with a bias"
        raise OptionError(msg, hint="choose --objective geometric or balanced")
    return Goal((Centring(_geometric(stations).scaled(np.sqrt(_BESIDE))), Reach(bodies=bodies)))


_BESIDE = 0.01
OBJECTIVES: dict[str, Objective] = {
    "geometric": geometric,
    "geometric-fixed": geometric_fixed,
    "lead-axle": lead_axle,
    "trail-axle": trail_axle,
    WEIGHTED: art_weighted,
    "axle-max": axle_max,
    "body-max": body_max,
    "balanced": balanced,
}


def objective_named(objective: str | Objective) -> Objective:
    """Return the objective that users call so; ``art-weighted:0.45`` gives its weight as a number.

    ``objective`` is a name of ``objective_names``, ``package.module:name``, ``file.py:name``, or such a function itself.

    Raises:
        OptionError: there is none of that name, it cannot be loaded, or the weight is not a number from 0 to 1.

    """
    if not isinstance(objective, str):
        return _Foreign(plugins.name_of(objective), objective)
    check_objective(objective)
    share = share_of(objective)
    if share is not None:
        return partial(art_weighted, share=share)
    if objective in OBJECTIVES:
        return OBJECTIVES[objective]
    return _Foreign(objective, cast("Objective", plugins.load(plugins.OBJECTIVE, objective)))


@dataclass(frozen=True)
class _Foreign:
    """An objective from outside hdvplan: what its author's code raises becomes one line."""

    name: str
    own: Objective

    def __call__(self, stations: Stations, vehicle: Vehicle) -> Goal:
        """Return its goal.

        Raises:
            OptionError: it raises, or returns something else.

        """
        owner = f"objective {self.name!r}"
        try:
            with refused_in(owner):
                goal: object = self.own(stations, vehicle)
        except HdvplanError:
            raise
        except Exception as error:
            msg = f"{owner} raises {plugins.error_text(error)}"
            raise OptionError(msg) from error
        if not isinstance(goal, Goal):
            msg = f"{owner} returns something of type {type(goal).__name__}, not a Goal"
            raise OptionError(msg, hint="a Goal holds terms and, of centred axles, the Centring: Goal((term,))")
        return replace(goal, owner=owner)
