"""The numbers of a plan under the names that other programs read in ``summary.json``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.case import settings_json
from hdvplan.driving.drive import Drive
from hdvplan.judging.balance import Breach
from hdvplan.judging.clearance import Approach
from hdvplan.judging.envelope import steering_of
from hdvplan.judging.fit import finding_json
from hdvplan.judging.result import Passed, Proof, Result, body_name
from hdvplan.judging.sentences import between_texts
from hdvplan.judging.verdict import Verdict, verdict_details, verdict_line, verdict_of
from hdvplan.road.regions import Side, called
from hdvplan.road.road import Road, Smoothing
from hdvplan.vehicle.kinematics import Wheel, wheels_of
from hdvplan.vehicle.model import Vehicle
from hdvplan.version import __version__

Json = dict[str, object]
TIMES = ("mean", "p50", "p95", "p99", "max", "first")


def summary_of(result: Result, *, forecast: bool = True, tracking: bool = True) -> Json:
    """Return the summary, ready for ``json.dumps``: units are in the names, numbers without a value are None.

    Without ``forecast``, which takes longer than the rest, ``fit`` is missing; without ``tracking`` nothing is told of its error.
    """
    drive, balance, settings = result.drive, result.balance, result.drive.settings
    counts = np.array([plan.qp_count for plan in drive.plans])
    merits = [plan.merit for plan in drive.plans if plan.usable and plan.merit is not None]
    verdict = verdict_of(result)
    broken = [*(breach.depth for breach in balance.breaches), *(-near.distance for near in result.entered)]
    return {
        "verdict": verdict_json(result, verdict),
        "clearance_wanted_m": settings.clearance,
        "largest_clearance_m": result.most_clearance,
        **tracking_json(result if tracking else None),
        "road": drive.road.name,
        "plane": getattr(drive.road.to_lonlat, "plane", None),
        "vehicle": drive.vehicle.name,
        **({} if result.planned else {"path": result.path}),
        "scheme": result.scheme,
        "solver": result.solver,
        "objective": result.objective,
        "status": result.status,
        "length_m": drive.road.path.length,
        "mean_bias_m": float(np.mean(result.aim)),
        "plans": len(drive.plans),
        "max_left_m": balance.max_left,
        "max_right_m": balance.max_right,
        "imbalance_m": balance.imbalance,
        "mean_abs_imbalance_m": balance.mean_abs_imbalance,
        "mean_abs_off_bias_m": float(np.mean(np.abs(0.5 * (result.envelope.reach_left + result.envelope.reach_right) - result.aim))),
        "expected_half_width_m": balance.expected_half_width,
        "tighter_than_balanced_circle": balance.saturated,
        "needed_half_width_m": balance.half_width,
        "min_clearance_m": balance.min_clearance,
        "limit_violation_m": max(broken, default=0.0),
        "breaches": [_breach_json(breach, drive) for breach in balance.breaches],
        "manners": _steering(result),
        **({"fit": [finding_json(finding) for finding in result.fit.findings]} if forecast else {}),
        "obstacles": [_obstacle_json(near, drive.vehicle) for near in result.approaches],
        "passed": [passed_json(passed) for passed in result.passed],
        "failed_steps": [float(drive.stations.s[plan.first]) for plan in result.failed],
        "rescued_steps": [{"s_m": float(drive.stations.s[plan.first]), "why": plan.instead} for plan in result.rescued],
        "attempts": [{"step_m": attempt.step, "give_way_m": attempt.give_way, "lacking_m": attempt.lacking} for attempt in result.attempts],
        "prediction_error_m": drive.prediction_error,
        "sqp_iterations_mean": float(np.mean(counts)) if result.planned else None,
        "sqp_iterations_max": int(np.max(counts)) if result.planned else None,
        "converged_plans": int(sum(plan.moved < settings.sqp_tolerance for plan in drive.plans)),
        "steps_halved": int(sum(plan.halvings for plan in drive.plans)),
        "merit_mean": float(np.mean(merits)) if merits else None,
        "merit_max": max(merits, default=None),
        "time_ms": times_json(np.array([plan.times.total for plan in drive.plans])) if result.planned else dict.fromkeys(TIMES),
        "bodies": [_body(drive.vehicle, unit) for unit in range(len(drive.vehicle.units))],
        "wheels": [_wheel(drive.vehicle, wheel) for wheel in wheels_of(drive.vehicle)],
        "smoothing": smoothing_of(drive.road.smoothing),
        "corners": corners_of(drive.road),
        "settings": settings_json(settings),
        "notice": drive.road.notice,
        "notes": [*drive.road.notes, *between_texts(result, verdict.spare)],
        "version": __version__,
    }


TRACKING = ("tracking_error_m", "tracking_length_m", "tracking_s_m", "tracking_unit", "tracking_part")


def tracking_json(result: Result | None) -> Json:
    """Return the largest tracking error, and the place that decides it, under the names that other programs read; else None."""
    tracking = None if result is None else result.tracking
    found: Json = dict.fromkeys(TRACKING)
    if result is None or tracking is None:
        return found
    found |= {"tracking_error_m": tracking.error, "tracking_length_m": tracking.length}
    if tracking.decided:
        unit = body_name(result.drive.vehicle, tracking.unit)
        found |= {"tracking_s_m": tracking.s, "tracking_unit": unit, "tracking_part": tracking.part}
    return found


def verdict_json(result: Result, verdict: Verdict) -> Json:
    """Return a verdict under the names that other programs read; x and y in path.csv's plane [m]."""
    lon, lat = verdict.lonlat or (None, None)
    return {
        "text": verdict_line(result, verdict),
        "details": verdict_details(result, verdict),
        "word": verdict.word,
        "fits": verdict.holds,
        "spare_m": verdict.spare,
        "half_width_m": verdict.half_width,
        "s_m": verdict.s,
        "x": verdict.x,
        "y": verdict.y,
        "lon": lon,
        "lat": lat,
        "side": verdict.side,
        "unit": body_name(result.drive.vehicle, verdict.unit),
        "part": verdict.part,
        "region": verdict.region,
        "obstacle": verdict.obstacle,
        "wheels_spare_m": verdict.wheels_spare,
        "proved": verdict.proved,
        "proof": None if verdict.proof is None else proof_json(verdict.proof, result.drive.vehicle),
    }


def proof_json(proof: Proof, vehicle: Vehicle) -> Json:
    """Return a proof under the names that other programs read; ``unit`` is what users call the body."""
    return {"kind": proof.kind, "s_from_m": proof.s_from, "s_to_m": proof.s_to, "unit": body_name(vehicle, proof.unit)}


def times_json(seconds: FloatArray) -> dict[str, float]:
    """Return the distribution of times of planning steps [s] in milliseconds; ``first`` is the cold start."""
    times = 1e3 * seconds
    return dict(zip(TIMES, map(float, (np.mean(times), *np.percentile(times, [50, 95, 99]), np.max(times), times[0])), strict=True))


def smoothing_of(smoothing: Smoothing | None) -> Json | None:
    """Return what smoothing did to the given points, or None for a road that needed none."""
    units = {"points": "", "duplicates": "", "max_curvature": "_per_m"}
    return None if smoothing is None else {f"{name}{units.get(name, '_m')}": value for name, value in asdict(smoothing).items()}


def corners_of(road: Road) -> list[Json]:
    """Return the corners that were read in the line as given; x and y in path.csv's plane [m], angles left positive."""
    corners = () if road.about is None else road.about.corners
    return [{"s_m": corner.s, "x": corner.x, "y": corner.y, "angle_deg": float(np.degrees(corner.turn))} for corner in corners]


def _steering(result: Result) -> Json:
    use_of = steering_of(result.drive)
    uses = {"steering": use_of.curvature, "steering_rate": use_of.rate}
    named: Json = {
        name: {"share": use.share, "s_m": use.s, "nearly_all": [list(stretch) for stretch in use.stretches]} for name, use in uses.items()
    }
    return named | {"lock_to_lock": [list(swing) for swing in use_of.swings]}


def _body(vehicle: Vehicle, unit: int) -> Json:
    """Return what drawing a body at its pose needs; lengths ahead of, and behind, its axle."""
    body = vehicle.units[unit]
    return {
        "name": body_name(vehicle, unit),
        "wheelbase_m": body.wheelbase,
        "hitch_offset_m": body.hitch_offset,
        "front_m": body.front,
        "rear_m": body.rear_overhang,
        "width_m": body.width,
    }


def _wheel(vehicle: Vehicle, wheel: Wheel) -> Json:
    """Return where a wheel whose track is drawn stands on its body: ahead of its axle, left of its axis."""
    unit = body_name(vehicle, wheel.unit)
    return {"body": wheel.unit + 1, "unit": unit, "axle": wheel.axle, "side": wheel.side, "ahead_m": wheel.ahead, "left_m": wheel.left}


def passed_json(passed: Passed) -> Json:
    """Return how an obstacle was passed; infinities, where no plan exists on the other side, are None with their reason."""
    own, other, reason = passed.own, passed.other, passed.reason
    if own is not None and not np.isfinite(own.violation):
        own = None  # planned as it was all the same
    if other is not None and not np.isfinite(other.violation):
        other, reason = None, "no plan exists on the other side"
    return {
        "name": passed.obstacle.label,
        "s_m": 0.5 * (passed.s_from + passed.s_to),
        "side": str(passed.side),
        "forced": passed.forced,
        "crossed": passed.crossed,
        "clearance_m": None if own is None else own.clearance,
        "off_centre_m": None if own is None else own.off_centre,
        "other_violation_m": None if other is None else other.violation,
        "other_clearance_m": None if other is None else other.clearance,
        "other_off_centre_m": None if other is None else other.off_centre,
        "reason": reason,
    }


def crossed_texts(summary: Mapping[str, Any]) -> list[str]:
    """Return a sentence for each obstacle that is passed on the other side than the line passes it, perhaps that of oncoming traffic."""
    return [
        f"{called(one['name'])} at s = {one['s_m']:z.1f} m is passed on the {one['side']}, the line passes it on the "
        f"{Side(one['side']).other}: a property pass = {Side(one['side']).other} keeps to that side"
        for one in summary["passed"]
        if one["crossed"]
    ]


def _breach_json(breach: Breach, drive: Drive) -> Json:
    """Return a breach; x and y in path.csv's plane [m]."""
    return {
        "s_from": breach.s_from,
        "s_to": breach.s_to,
        "s_deepest": breach.s_deepest,
        "depth_m": breach.depth,
        "side": breach.side,
        "unit": body_name(drive.vehicle, breach.unit),
        "part": breach.part,
        "region": breach.region,
        "binds": drive.road.binds(breach.side, breach.region, *breach.place) if breach.obstacle is None else None,
        "obstacle": breach.obstacle,
        "x": breach.place[0],
        "y": breach.place[1],
    }


def _obstacle_json(near: Approach, vehicle: Vehicle) -> Json:
    """Return the nearest approach to an obstacle; x and y in path.csv's plane [m]."""
    where = {"s_m": near.s, "s_from_m": near.s_from, "s_to_m": near.s_to, "x": near.x, "y": near.y}
    what = {"unit": body_name(vehicle, near.unit), "side": near.side, "part": near.part}
    return {"name": near.obstacle.label, "distance_m": near.distance} | where | what
