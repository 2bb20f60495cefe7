"""What the behaviour reference holds of planning, of passing obstacles, and of ``need``."""

from __future__ import annotations

import numpy as np
from reference_scenes import Quantities, Told, case_of, error_of

from hdvplan.api import drive_case
from hdvplan.driving.drive import Drive
from hdvplan.errors import HdvplanError
from hdvplan.need.answer import Need, edge_need_of, need_of
from hdvplan.need.search import OTHER, kerbs_on
from hdvplan.need.widening import Widening
from hdvplan.passing.sides import choose_sides

_SHARES = (0.3, 0.55, 0.8)  # of the road, where states are compared


def planned(told: Told) -> Quantities:
    """Return the executed states of a drive at a few stations, their extremes, and what the planner counted."""
    try:
        return _of_drive(drive_case(case_of(told)))
    except HdvplanError as error:
        return error_of(error)


def _of_drive(drive: Drive) -> Quantities:
    found: Quantities = {}
    names = ["e_y", "e_psi", *(f"beta_{unit}" for unit in range(1, len(drive.vehicle.units)))]
    names += [f"wheels_{unit}" for unit in drive.vehicle.active]
    for share in _SHARES:
        at = round(share * (len(drive.z) - 1))
        found |= {f"{name} at {drive.stations.s[at]:g}": float(value) for name, value in zip(names, drive.z[at], strict=True)}
        found[f"kappa at {drive.stations.s[at]:g}"] = float(drive.kappa[min(at, len(drive.kappa) - 1)])
    for name, values in [*zip(names, drive.poses_z.T, strict=True), ("kappa", drive.kappa)]:
        found |= {f"{name} least": float(np.min(values)), f"{name} most": float(np.max(values))}
    plans = drive.plans
    merits = [plan.merit for plan in plans if plan.merit is not None]
    return found | {
        "plans": len(plans),
        "qps": sum(plan.qp_count for plan in plans),
        "halvings": sum(plan.halvings for plan in plans),
        "merits": len(merits),
        "merit largest": max(merits, default=0.0),
        "breach": max(plan.violation for plan in plans),
        "prediction": drive.prediction_error,
    }


def passed(told: Told) -> Quantities:
    """Return the side of every obstacle and what the plans of either side came to."""
    try:
        _, obstacles = choose_sides(case_of(told))
    except HdvplanError as error:
        return error_of(error)
    found: Quantities = {}
    for number, one in enumerate(obstacles, start=1):
        found |= {f"side {number}": str(one.side), f"s_from {number}": one.s_from, f"s_to {number}": one.s_to}
        found |= {f"forced {number}": str(one.forced), f"reason {number}": "none" if one.reason is None else "some"}
        for name, trial in (("own", one.own), ("other", one.other)):
            if trial is not None and np.isfinite(trial.cost):
                found |= {
                    f"{what} {name} {number}": getattr(trial, what) for what in ("violation", "harm", "clearance", "off_centre", "cost")
                }
            elif trial is not None:
                found[f"plan {name} {number}"] = "none"
    return found


def needed(told: Told) -> Quantities:
    """Return the least room, where it is decided, and the least widenings of the road's own limits.

    ``side`` asks for the least reach there, ``prove`` for the room that is proved to be too little.
    """
    case, side = case_of(told), told.get("side")
    if side is None:
        return _of_need(need_of(case, prove=told.get("prove", False)))
    return _of_need(edge_need_of(case, kerbs_on(case.road, OTHER[side]), side))


def _of_need(need: Need) -> Quantities:
    found: Quantities = {"room": need.room.room, "out_of_reach": need.room.out_of_reach}
    if need.place is not None:
        found |= {"side": need.place.side, "unit": need.place.unit, "part": need.place.part, "s": need.place.s}
    if need.bound is not None:
        found |= {"proved": need.bound.room, "proof": need.bound.proof.kind}
    if need.held is not None:
        found["held"] = need.held.room
    if need.widenings is not None:
        found["fits"] = "yes" if need.widenings.fitting is not None else "no"
        for name, widening in (("area", need.widenings.area), ("depth", need.widenings.depth)):
            found |= {} if widening is None else _of_widening(name, widening)
    return found


def _of_widening(name: str, widening: Widening) -> Quantities:
    return {f"depth of least {name}": widening.depth, f"area of least {name}": widening.area}
