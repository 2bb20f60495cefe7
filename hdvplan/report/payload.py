"""What the report's page draws from: the columns of a plan, thinned and packed."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.report.planfiles import PlanFiles
from hdvplan.report.rooms import peaks

SPACING_M = 0.5  # between two samples of the page
_HIDDEN_BELOW = 1e-9
_MISSING = -32768  # of a 16-bit number
_PLACES = 6  # tightest ones that the page lists
_APART_M = 30.0  # at least, between two of them

Json = dict[str, Any]


def payload_of(plan: PlanFiles) -> Json:
    """Return one plan for the page: names, bodies, packed columns at equal arclengths, planning steps, broken limits, regions."""
    envelope, profile, summary = plan.envelope, plan.profile, plan.summary
    stride = max(1, round(SPACING_M / float(envelope["s"][1] - envelope["s"][0])))
    thin = slice(None, None, stride)
    s = envelope["s"].to_numpy()[thin]
    x, y, heading = road_frame(plan, s)
    columns: dict[str, Json] = {"x": _exact(x - x[0]), "y": _exact(y - y[0]), "heading": _exact(heading)}  # map coordinates are too large
    for name in ("e_y", "e_psi", "kappa", *(f"beta{number}" for number in range(1, len(summary["bodies"])))):
        columns[name] = packed(np.interp(s, plan.path["s"], plan.path[name]))
    for table in (envelope[["expected_left", "expected_right", "left_limit", "right_limit"]], profile.drop(columns="s")):
        columns |= {str(name): packed(table[name].to_numpy(float)[thin]) for name in table if table[name].notna().any()}
    for side in ("left", "right"):  # limits of overhangs only where they have their own
        wheels, overhangs = envelope[f"{side}_limit"], profile.get(f"{side}_sweep_limit")
        if overhangs is not None and not bool((np.abs(wheels - overhangs) > 1e-4).any()):  # noqa: PLR2004 - as rounded in the file
            columns.pop(f"{side}_sweep_limit", None)
    return {
        "label": label_of(summary),
        "road": summary["road"],
        "bodies": summary["bodies"],
        "origin": [round(float(x[0]), 3), round(float(y[0]), 3)],  # with road and count: whether two plans share a road
        "count": len(s),
        "spacing": float(s[1] - s[0]),
        "columns": columns,
        "steps": {"s": plan.steps["s"].round(2).tolist(), "ms": plan.steps["total_ms"].round(4).tolist()},
        "breaches": summary["breaches"],
        "places": tight_places(plan),
        "regions": [{"region": item["region"], "rings": _beside(item["rings"], float(x[0]), float(y[0]))} for item in plan.regions],
        "notice": summary.get("notice"),
        "wheels": [[wheel["body"] - 1, wheel["ahead_m"], wheel["left_m"]] for wheel in summary.get("wheels", [])],
        "north": (summary.get("verdict") or {}).get("lon") is not None,
    }


def label_of(summary: Json) -> str:
    """Return what tells plans apart at a glance."""
    return f"{summary['vehicle']} on {summary['road']}, {summary['scheme']}, {summary['solver']}, {summary['objective']}"


def tight_places(plan: PlanFiles) -> list[Json]:
    """Return the places of least clearance, or of furthest reach without limits: s [m], value [m] and which of the two."""
    s, clearance = plan.envelope["s"].to_numpy(), plan.profile["clearance"].to_numpy(float)
    limited = bool(np.any(np.isfinite(clearance)))
    score = -clearance if limited else np.maximum(plan.envelope["left"].to_numpy(), -plan.envelope["right"].to_numpy())
    kind, sign = ("clearance", -1.0) if limited else ("reach", 1.0)
    return [{"s": float(s[at]), "value": sign * float(score[at]), "kind": kind} for at in peaks(s, score, _APART_M, _PLACES)]


def road_frame(plan: PlanFiles, s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return x, y [m] and heading [rad] of the road's centre at arclengths ``s`` [m], from the executed path beside it."""
    path = plan.path
    heading = path["heading"].to_numpy() - path["e_psi"].to_numpy()
    x = path["x"].to_numpy() + path["e_y"].to_numpy() * np.sin(heading)
    y = path["y"].to_numpy() - path["e_y"].to_numpy() * np.cos(heading)
    at = path["s"].to_numpy()
    return np.interp(s, at, x), np.interp(s, at, y), np.interp(s, at, heading)


def packed(values: FloatArray) -> Json:
    """Return numbers as little-endian 16-bit multiples of a scale, in base64; missing ones as the lowest.

    The largest is 32767 scales: reaches of 4 m keep 0.1 mm.
    """
    finite = np.isfinite(values)
    scale = max(float(np.max(np.abs(values), where=finite, initial=0.0)) / 32767.0, _HIDDEN_BELOW)
    whole = np.where(finite, np.round(np.where(finite, values, 0.0) / scale), _MISSING).astype("<i2")
    return {"scale": scale, "data": base64.b64encode(whole.tobytes()).decode()}


def _beside(rings: list[list[list[float]]], x: float, y: float) -> list[list[list[float]]]:
    """Return rings with their coordinates less the origin's, to 1 cm."""
    return [np.round(np.array(ring) - [x, y], 2).tolist() for ring in rings]


def _exact(values: FloatArray) -> Json:
    """Return numbers in single precision: coordinates of a long road need more than 16 bits."""
    return {"data": base64.b64encode(values.astype("<f4").tobytes()).decode()}
