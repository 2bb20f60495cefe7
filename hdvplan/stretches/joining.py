"""Join judged stretches: one summary of the whole road, and how well the stretches meet."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from hashlib import sha256
from itertools import pairwise
from typing import Any

import numpy as np

from hdvplan.judging.balance import ONE_M
from hdvplan.report.summary import times_json
from hdvplan.stretches.judging import Kept

Json = dict[str, Any]

_FIRST = (
    "clearance_wanted_m", "road", "vehicle", "scheme", "solver", "objective", "bodies", "wheels", "settings", "notice", "version",
)  # fmt: skip
_SUMS = ("length_m", "plans", "converged_plans", "steps_halved")
_MOST = (
    "max_left_m", "max_right_m", "expected_half_width_m", "needed_half_width_m", "limit_violation_m", "sqp_iterations_max",
    "prediction_error_m", "merit_max", "tighter_than_balanced_circle",
)  # fmt: skip
_LEAST = ("min_clearance_m",)
_BY_LENGTH = ("mean_bias_m", "mean_abs_imbalance_m", "mean_abs_off_bias_m")
_BY_PLANS = ("sqp_iterations_mean", "merit_mean")
_LISTS = ("fit", "passed", "failed_steps", "rescued_steps", "attempts", "corners")
_WORST_FIRST = ("limits broken", "obstacle entered", "clearance not kept", "some steps not solved", "some steps by another solver", "ok")


def joined_summary(stretches: Sequence[Kept]) -> Json:
    """Return the summary of a whole road from what is kept of its stretches, in their order."""
    every: list[Json] = [one.summary for one in stretches]
    summary: Json = {"verdict": _verdict(every)}
    summary |= {key: every[0][key] for key in _FIRST}
    summary |= {key: sum(one[key] for one in every) for key in _SUMS}
    summary |= {key: _of(max, [one[key] for one in every]) for key in _MOST} | {
        key: _of(min, [one[key] for one in every]) for key in _LEAST
    }
    lengths, plans = ([float(one[key]) for one in every] for key in ("length_m", "plans"))
    summary |= {key: _mean([one[key] for one in every], lengths) for key in _BY_LENGTH}
    summary |= {key: _mean([one[key] for one in every], plans) for key in _BY_PLANS}
    summary |= {key: [item for one in every for item in one[key]] for key in _LISTS}
    summary["notes"] = list(dict.fromkeys(note for one in every for note in one["notes"]))
    summary["imbalance_m"] = summary["max_left_m"] - summary["max_right_m"]
    summary["status"] = min((one["status"] for one in every), key=_WORST_FIRST.index)
    summary["breaches"] = _breaches([breach for one in every for breach in one["breaches"]])
    summary["obstacles"] = _obstacles(stretches)
    summary["manners"] = _manners([one["manners"] for one in every])
    summary["smoothing"] = _smoothing([one["smoothing"] for one in every], lengths)
    summary["time_ms"] = times_json(np.concatenate([one.times for one in stretches]))
    apart = max((_apart(*two) for two in pairwise(stretches)), default=0.0)
    summary["stretches"] = {"count": len(every), "processes": len({one.process for one in stretches}), "apart_m": apart}
    return summary


def digest_of(stretches: Sequence[Kept]) -> str:
    """Return a digest of the cases of a road's stretches."""
    return sha256("".join(one.key for one in stretches).encode()).hexdigest()


def _apart(before: Kept, after: Kept) -> float:
    """Return the largest distance of a body's corner from itself where one stretch goes over into the next [m]."""
    return float(np.max(np.hypot(*np.moveaxis(after.enters - before.leaves, -1, 0))))


def _obstacles(stretches: Sequence[Kept]) -> list[Json]:
    """Return the nearest approach to each obstacle; two stretches may have come near the same."""
    found: dict[bytes, Json] = {}
    for outline, near in ((outline, near) for one in stretches for outline, near in one.obstacles.items()):
        found[outline] = min(found.get(outline, near), near, key=lambda one: one["distance_m"])
    return list(found.values())


def _of(pick: Callable[[list[Any]], Any], values: Sequence[Any]) -> Any:  # noqa: ANN401 - numbers or truth values
    """Return the largest or the least of the values that there are, None without any."""
    there = [value for value in values if value is not None]
    return pick(there) if there else None


def _mean(values: Sequence[float | None], weights: Sequence[float]) -> float | None:
    there = [(value, weight) for value, weight in zip(values, weights, strict=True) if value is not None]
    return float(np.average([value for value, _ in there], weights=[weight for _, weight in there])) if there else None


def _verdict(every: Sequence[Json]) -> Json:
    """Return the verdict of the place that decides: the least room, or where no stretch has limits the widest reach.

    A road without limits has stretches with obstacles, which leave room or none, and others that only say what they need.
    """
    verdicts: list[Json] = [one["verdict"] for one in every]
    judged = [verdict for verdict in verdicts if verdict["spare_m"] is not None]
    if not judged:
        return max(verdicts, key=lambda one: one["half_width_m"])
    decides = min(judged, key=lambda one: one["spare_m"])
    known = decides["wheels_spare_m"] is not None
    wheels = _of(min, [one["wheels_spare_m"] for one in judged]) if known else None
    return decides | {"half_width_m": max(one["needed_half_width_m"] for one in every), "wheels_spare_m": wheels}


def _breaches(breaches: list[Json]) -> list[Json]:
    """Return breaches in order of s; one that goes on over a cut is one."""
    found: list[Json] = []
    for breach in sorted(breaches, key=lambda one: one["s_from"]):
        before = next((one for one in reversed(found) if _goes_on(one, breach)), None)
        if before is None:
            found.append(dict(breach))
        else:
            deeper = breach if breach["depth_m"] > before["depth_m"] else before
            before |= {**deeper, "s_from": before["s_from"], "s_to": max(before["s_to"], breach["s_to"])}
    return found


def _goes_on(before: Json, after: Json) -> bool:
    same = all(before[key] == after[key] for key in ("side", "region", "obstacle"))
    return same and abs(after["s_from"] - before["s_to"]) <= ONE_M


def _manners(every: list[Json]) -> Json:
    return {
        "steering": _use([one["steering"] for one in every]),
        "steering_rate": _use([one["steering_rate"] for one in every]),
        "lock_to_lock": [stretch for one in every for stretch in one["lock_to_lock"]],
    }


def _use(uses: list[Json]) -> Json:
    return dict(max(uses, key=lambda use: use["share"])) | {"nearly_all": [stretch for use in uses for stretch in use["nearly_all"]]}


def _smoothing(every: Sequence[Mapping[str, Any] | None], lengths: Sequence[float]) -> Json | None:
    """Return what smoothing did to the whole line; points in an overlap count twice."""
    there = [(one, length) for one, length in zip(every, lengths, strict=True) if one is not None]
    if not there:
        return None
    moved, bent = (max((one for one, _ in there), key=lambda one: one[key]) for key in ("max_deviation_m", "max_curvature_per_m"))
    squares = [one["rms_deviation_m"] ** 2 for one, _ in there]
    return {
        "points": sum(one["points"] for one, _ in there),
        "duplicates": sum(one["duplicates"] for one, _ in there),
        **{key: moved[key] for key in ("max_deviation_m", "max_deviation_s_m")},
        "rms_deviation_m": float(np.sqrt(np.average(squares, weights=[length for _, length in there]))),
        **{key: bent[key] for key in ("max_curvature_per_m", "max_curvature_s_m")},
    }
