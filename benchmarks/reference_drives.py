"""What the behaviour reference holds of drives: planning, passing obstacles, ``need``, judging, and proofs.

Judged are prescribed motions, which no planner has touched.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from reference_scenes import Quantities, Told, case_of, error_of

from hdvplan.api import drive_case
from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.centring.stationary import CentringTable
from hdvplan.driving.drive import POSE_SPACING_M, Drive, simulate
from hdvplan.errors import HdvplanError
from hdvplan.judging.balance import KEPT_M
from hdvplan.judging.bodies import wheel_tracks
from hdvplan.judging.envelope import steering_of
from hdvplan.judging.result import Result, result_of
from hdvplan.judging.tracking import tracking_of
from hdvplan.judging.verdict import verdict_of
from hdvplan.need.answer import Need, edge_need_of, need_of
from hdvplan.need.search import OTHER, kerbs_on
from hdvplan.need.widening import Widening
from hdvplan.passing.sides import choose_sides
from hdvplan.planning.objectives import Goal
from hdvplan.planning.stations import stations_of
from hdvplan.proof.answer import follower, proof_of
from hdvplan.proof.space import beside

_SHARES = (0.3, 0.55, 0.8)  # of the road, where states are compared
_STATIONS = 4  # of a reachable set that are compared
_BEYOND_M = 50.0  # of the stretch that is followed: no point of a vehicle has its foot further away
_ROUNDING_M = 5e-3  # of a judged plan, as the reference's own room


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


def judged(told: Told) -> Quantities:
    """Return envelope, room, breaches, verdict and steering of a prescribed motion: the road's own curvature, and a sine beside it."""
    case = case_of(told)
    try:
        result = result_of(_prescribed(case, told), solver=case.solver, objective=case.objective)
    except HdvplanError as error:
        return error_of(error)
    return _of_envelope(result) | _of_room(result) | _of_verdict(result) | _of_steering(result)


def _prescribed(case: Case, told: Told) -> Drive:
    """Return the drive of curvatures that are given beforehand, without a plan.

    ``swing`` is the sine's size [1/m] and length [m], ``wheels`` the same of actively steered axles [rad], ``start`` the state at s = 0.
    """
    settings, vehicle, path = case.settings, case.vehicle, case.road.path
    stations = stations_of(case.road, vehicle, CentringTable.of(vehicle), step=settings.step, horizon=settings.horizon, bias=case.bias)
    total = int(np.ceil(path.length / settings.step - 1e-9))
    halfway = settings.step * (np.arange(total, dtype=np.float64) + 0.5)
    kappa = np.clip(path.at(halfway).curvature + _sine(told.get("swing"), halfway), -vehicle.max_curvature, vehicle.max_curvature)
    z = np.zeros(vehicle.states)
    z[: len(told.get("start", ()))] = told.get("start", ())
    wheels = np.tile(_sine(told.get("wheels"), settings.step * np.arange(total + 1.0))[:, None], (1, len(vehicle.active)))
    keep = int(np.ceil(settings.step / POSE_SPACING_M))
    poses = simulate(vehicle.table(), stations.path, 0.0, settings.step, z, kappa, keep, wheels)
    poses_s = settings.step / keep * np.arange(len(poses), dtype=np.float64)
    held = np.repeat(kappa, keep)
    return Drive(case.road, vehicle, settings, stations, Goal(()), poses[::keep], kappa, poses_s, poses, held, (), 0.0, case.bias)


def _sine(given: tuple[float, float] | None, s: FloatArray) -> FloatArray:
    size, length = given or (0.0, 1.0)
    return np.asarray(size * np.sin(2.0 * np.pi * s / length), np.float64)


def _of_envelope(result: Result) -> Quantities:
    envelope, balance = result.envelope, result.balance
    found: Quantities = {"left": balance.max_left, "right": balance.max_right, "imbalance": balance.mean_abs_imbalance}
    found |= {"expected": balance.expected_half_width, "saturated": str(balance.saturated)}
    for unit in range(len(envelope.left)):
        found |= {
            f"left mean {unit}": float(np.nanmean(envelope.left[unit])),
            f"right mean {unit}": float(np.nanmean(envelope.right[unit])),
        }
    tracks = [float(np.sum(np.hypot(*np.diff(track.points, axis=0).T))) for track in wheel_tracks(result.drive)]
    return found | {"tracks": float(np.sum(tracks)), "aim": float(np.mean(result.aim)), "forecast": result.fit.half_width}


def _of_room(result: Result) -> Quantities:
    found: Quantities = {}
    for (side, region), gaps in result.gaps.items():
        least = np.nanmin(gaps, axis=1)
        found |= {f"room {side} {region} {unit}": float(room) if np.isfinite(room) else "no kerb" for unit, room in enumerate(least)}
    for number, breach in enumerate(result.balance.breaches, start=1):
        found |= {f"depth {number}": breach.depth, f"s_from {number}": breach.s_from, f"s_to {number}": breach.s_to}
        found |= {f"who {number}": f"{breach.side} {breach.unit} {breach.part} {breach.region}", f"hit {number}": str(breach.obstacle)}
    for number, near in enumerate(result.approaches, start=1):
        found |= {f"distance {number}": near.distance, f"x {number}": near.x, f"y {number}": near.y}
        found[f"nearest {number}"] = f"{near.side} {near.unit} {near.part}"
    if result.fit.spare is not None:
        found["forecast spare"] = result.fit.spare
    findings = result.fit.findings
    return found | {"findings": len(findings), "lacking": sum(max(one.needed - one.available, 0.0) for one in findings)}


def _of_verdict(result: Result) -> Quantities:
    verdict = verdict_of(result)
    found: Quantities = {"verdict": verdict.word, "status": result.status, "half_width": verdict.half_width}
    found |= {"s": verdict.s, "x": verdict.x, "y": verdict.y, "side": verdict.side, "unit": verdict.unit, "part": verdict.part}
    found |= {"region": str(verdict.region), "obstacle": str(verdict.obstacle)}
    return found | {name: value for name, value in (("spare", verdict.spare), ("wheels_spare", verdict.wheels_spare)) if value is not None}


def _of_steering(result: Result) -> Quantities:
    steering = steering_of(result.drive)
    found: Quantities = {"swings": len(steering.swings)}
    for name, use in (("curvature", steering.curvature), ("rate", steering.rate)):
        found |= {f"{name} share": use.share, f"{name} full": sum(last - first for first, last in use.stretches)}
    return found


def tracked(told: Told) -> Quantities:
    """Return how far a driver may stray from a prescribed motion, with a tracking length of 6 m, and what decides it."""
    case = case_of(told)
    result = result_of(_prescribed(case, told), solver=case.solver, objective=case.objective)
    tracking = tracking_of(result.drive, result.balance, 6.0)
    if tracking is None:
        return {"error": "none"}
    return {"error": tracking.error, "s": tracking.s, "who": f"{tracking.unit} {tracking.part}", "decided": str(tracking.decided)}


def proved(told: Told) -> Quantities:
    """Return what is proved of a road within its limits, or within each of several half ``widths`` [m], and what can be reached there."""
    found: Quantities = {}
    for width in told.get("widths", [None]):
        case = case_of(told if width is None else {**told, "limits": [width, width]})
        proof = proof_of(case, told.get("s_from"), told.get("s_to"))
        name = "" if width is None else f" within {width:g}"
        found[f"proof{name}"] = "none" if proof is None else proof.kind
        if proof is not None:
            found |= {f"unit{name}": proof.unit, f"s_from{name}": proof.s_from, f"s_to{name}": proof.s_to}
    return found | (_reached(told) if "reach" in told else {})


def _reached(told: Told) -> Quantities:
    """Return bounds of what the leading units reach over the stretch ``reach`` [m], at the coarsest resolution."""
    case, (first, last) = case_of(told), told["reach"]
    follow = follower(replace(case.road, path=case.road.path.extended(_BEYOND_M, _BEYOND_M)), case.vehicle)
    space = beside(case.road, first - _BEYOND_M, last + _BEYOND_M, room=KEPT_M + _ROUNDING_M)
    if follow is None or space is None:
        return {"followed": "nothing"}
    frame, reached = follow.run(space, follow.resolutions[0], first, last)
    found: Quantities = {"empty": reached.empty, "open": reached.open}
    for at in np.linspace(0, len(frame.s) - 1, _STATIONS + 2).astype(int)[1:-1]:
        bounds = {"low": reached.low, "high": reached.high, "turned right": reached.right, "turned left": reached.left}
        found |= {f"{name} at {frame.s[at]:.1f}": float(values[at]) for name, values in bounds.items() if np.isfinite(values[at])}
    return found
