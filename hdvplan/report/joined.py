"""A long road that is driven piece by piece: its tables, written as the pieces come, and one summary of them all."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.case import content_digest
from hdvplan.fileio import json_bytes, table_bytes
from hdvplan.judging.balance import ONE_M
from hdvplan.judging.verdict import verdict_of
from hdvplan.pieces import Judged
from hdvplan.record import NAME, record_of
from hdvplan.report.files import FILES, LIMITS, REGIONS, SWEPT, TABLES, limits_json, regions_json
from hdvplan.report.geojson import swept_features
from hdvplan.report.summary import TRACKING, smoothing_of, summary_of, times_json, verdict_json
from hdvplan.texts import encoded

Json = dict[str, Any]

_PLACES = {"s_m", "s_from", "s_to", "s_deepest", "s_from_m", "s_to_m", "s_worst_m", "tracking_s_m"}
_PLACES |= {"max_deviation_s_m", "max_curvature_s_m"}
_ARCLENGTHS = {"nearly_all", "lock_to_lock", "failed_steps"}  # lists of them, or of pairs of them
_ONCE = {"path.csv", "envelope.csv", "profile.csv"}  # whose last row is the first of the next piece
_FIRST = (
    "clearance_wanted_m", "largest_clearance_m", "road", "vehicle", "scheme", "solver", "objective", "bodies", "wheels", "settings",
    "plane", "notice", "version",
)  # fmt: skip
_SUMS = ("length_m", "plans", "converged_plans", "steps_halved")
_MOST = (
    "max_left_m", "max_right_m", "expected_half_width_m", "needed_half_width_m", "limit_violation_m", "sqp_iterations_max",
    "prediction_error_m", "merit_max", "tighter_than_balanced_circle",
)  # fmt: skip
_BY_LENGTH = ("mean_bias_m", "mean_abs_imbalance_m", "mean_abs_off_bias_m")
_BY_PLANS = ("sqp_iterations_mean", "merit_mean")
_LISTS = ("fit", "passed", "failed_steps", "rescued_steps", "attempts", "corners")
_WORST_FIRST = ("limits broken", "obstacle entered", "clearance not kept", "some steps not solved", "some steps by another solver", "ok")


@dataclass(frozen=True)
class Kept:
    """What is kept of a judged piece until all are joined: a summary as of a road of its own, at arclengths of the whole road."""

    key: str  # of its case
    summary: Json
    obstacles: dict[bytes, Json]  # nearest approaches, by the obstacles' outlines
    regions: dict[bytes, Json]  # all regions beside it, likewise
    times: FloatArray  # of its planning steps [s]


def write_pieces(pieces: Iterable[Judged], directory: Path, *, on_progress: Callable[[float], None] | None = None) -> Json:
    """Write the files of ``hdvplan plan`` for a road that is driven piece by piece, and return what ``summary.json`` says.

    What is kept does not grow with the road but for its places and times. ``summary.json`` has the number of pieces as ``stretches``. No
    picture is drawn. ``on_progress`` receives the length that is planned [m].

    Raises:
        OptionError: the folder holds files of others.
        OSError: the folder or a file cannot be written.
        HdvplanError: what ``hdvplan.plan`` raises.

    """
    summary: Json = {}

    def fill(aside: Path) -> None:
        kept: list[Kept] = []
        record: Json = {}
        with ExitStack() as stack:
            files = {name: stack.enter_context((aside / name).open("wb")) for name in (*TABLES, SWEPT)}
            files[SWEPT].write(b'{"type": "FeatureCollection", "features": [')
            turned: float | None = None
            limits: list[Json] = []
            for one in pieces:
                turned = _write_tables(one, files, turned)
                features = ",\n".join(json.dumps(feature, ensure_ascii=False, allow_nan=False) for feature in swept_features(one.result))
                files[SWEPT].write(encoded((",\n" if kept else "") + features))
                limits += limits_json(one.result)
                record = record or record_of([one.result.case])
                kept.append(kept_of(one))
                if on_progress is not None:
                    on_progress(one.begins + kept[-1].summary["length_m"])
            files[SWEPT].write(b"]}\n")
        regions = {outline: region for one in kept for outline, region in one.regions.items()}
        (aside / REGIONS).write_bytes(json_bytes(list(regions.values()), indent=None))
        (aside / LIMITS).write_bytes(json_bytes(limits, indent=None))
        record["stretches"] = {"count": len(kept), "digest": content_digest([one.key for one in kept])}
        (aside / NAME).write_bytes(json_bytes(record))
        summary.update(joined_summary(kept))
        (aside / FILES.last).write_bytes(json_bytes(summary))

    FILES.fill(directory, (*TABLES, SWEPT, REGIONS, LIMITS, NAME, FILES.last), fill)
    return summary


def _write_tables(one: Judged, files: Mapping[str, BinaryIO], turned: float | None) -> float:
    """Write the rows of a piece at the whole road's arclengths, and headings that go on from ``turned``; return the last heading [rad]."""
    for name, table_of in TABLES.items():
        table = table_of(one.result)
        table["s"] = replace(table["s"], content=np.round(table["s"].content + one.begins, 6))
        if "heading" in table:
            heading = table["heading"].content
            full = 0.0 if turned is None else 2.0 * np.pi * np.round((turned - heading[0]) / (2.0 * np.pi))
            turned = float(heading[-1] + full)
            table["heading"] = replace(table["heading"], content=np.round(heading + full, 9))
        if name in _ONCE and not one.last:
            table = {title: replace(column, content=column.content[:-1]) for title, column in table.items()}
        header, end, rows = table_bytes(table).partition(b"\n")
        files[name].write(rows if one.begins else header + end + rows)
    assert turned is not None  # noqa: S101 - for the type checker: the path has headings
    return turned


def kept_of(one: Judged) -> Kept:
    """Return what is kept of a judged piece."""
    result, summary = one.result, _moved(summary_of(one.result), one.begins)
    assert isinstance(summary, dict)  # noqa: S101 - for the type checker
    verdict = verdict_of(result)
    summary["verdict"] = verdict_json(result, replace(verdict, s=verdict.s + one.begins))
    summary["smoothing"] = smoothing_of(one.smoothing)
    outlines = [near.obstacle.polygon.wkb for near in result.approaches]
    road, times = result.drive.road, np.array([plan.times.total for plan in result.drive.plans])
    regions = dict(zip([region.polygon.wkb for region in road.regions], regions_json(road.regions), strict=True))
    return Kept(result.case.key, summary, dict(zip(outlines, summary.pop("obstacles"), strict=True)), regions, times)


def _moved(value: object, by: float, key: str = "") -> object:
    match value:
        case dict():
            return {name: _moved(one, by, name) for name, one in value.items()}
        case list():
            return [_moved(one, by, key) for one in value]
        case float() if key in _PLACES | _ARCLENGTHS:
            return value + by
    return value


def joined_summary(pieces: Sequence[Kept]) -> Json:
    """Return the summary of a whole road from what is kept of its pieces, in their order."""
    every: list[Json] = [one.summary for one in pieces]
    summary: Json = {"verdict": _verdict(every)}
    summary |= {key: every[0][key] for key in _FIRST}
    summary |= {key: sum(one[key] for one in every) for key in _SUMS}
    summary |= {key: _of(max, [one[key] for one in every]) for key in _MOST}
    summary["min_clearance_m"] = _of(min, [one["min_clearance_m"] for one in every])
    lengths, plans = ([float(one[key]) for one in every] for key in ("length_m", "plans"))
    summary |= {key: _mean([one[key] for one in every], lengths) for key in _BY_LENGTH}
    summary |= {key: _mean([one[key] for one in every], plans) for key in _BY_PLANS}
    summary |= {key: [item for one in every for item in one[key]] for key in _LISTS}
    strays = min(every, key=lambda one: -1.0 if one["tracking_error_m"] is None else one["tracking_error_m"])  # what breaks has none
    summary |= {key: strays[key] for key in TRACKING}
    summary["notes"] = list(dict.fromkeys(note for one in every for note in one["notes"]))
    summary["imbalance_m"] = summary["max_left_m"] - summary["max_right_m"]
    summary["status"] = min((one["status"] for one in every), key=_WORST_FIRST.index)
    summary["breaches"] = _breaches([breach for one in every for breach in one["breaches"]])
    summary["obstacles"] = _obstacles(pieces)
    summary["manners"] = {}
    for name in ("steering", "steering_rate"):
        uses = [one["manners"][name] for one in every]
        nearly_all = [stretch for use in uses for stretch in use["nearly_all"]]
        summary["manners"][name] = max(uses, key=lambda use: use["share"]) | {"nearly_all": nearly_all}
    summary["manners"]["lock_to_lock"] = [stretch for one in every for stretch in one["manners"]["lock_to_lock"]]
    summary["smoothing"] = _smoothing([one["smoothing"] for one in every], lengths)
    summary["time_ms"] = times_json(np.concatenate([one.times for one in pieces]))
    summary["stretches"] = {"count": len(every)}
    return summary


def _obstacles(pieces: Sequence[Kept]) -> list[Json]:
    """Return the nearest approach to each obstacle; two pieces may have come near the same."""
    found: dict[bytes, Json] = {}
    for outline, near in ((outline, near) for one in pieces for outline, near in one.obstacles.items()):
        found[outline] = min(found.get(outline, near), near, key=lambda one: one["distance_m"])
    return list(found.values())


def _of(pick: Callable[[list[Any]], Any], values: Sequence[Any]) -> Any:  # noqa: ANN401 - numbers or truth values
    there = [value for value in values if value is not None]
    return pick(there) if there else None


def _mean(values: Sequence[float | None], weights: Sequence[float]) -> float | None:
    there = [(value, weight) for value, weight in zip(values, weights, strict=True) if value is not None]
    return float(np.average([value for value, _ in there], weights=[weight for _, weight in there])) if there else None


def _verdict(every: Sequence[Json]) -> Json:
    """Return the verdict of the place that decides: the least room, or where no piece has limits the widest reach.

    A road without limits has pieces with obstacles, which leave room or none, and others that only say what they need.
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
    found: list[Json] = []
    for breach in sorted(breaches, key=lambda one: one["s_from"]):
        same = [one for one in found if all(one[key] == breach[key] for key in ("side", "region", "obstacle"))]
        before = next((one for one in reversed(same) if abs(breach["s_from"] - one["s_to"]) <= ONE_M), None)
        if before is None:
            found.append(dict(breach))
        else:
            deeper = breach if breach["depth_m"] > before["depth_m"] else before
            before |= {**deeper, "s_from": before["s_from"], "s_to": max(before["s_to"], breach["s_to"])}
    return found


def _smoothing(every: Sequence[Mapping[str, Any] | None], lengths: Sequence[float]) -> Json | None:
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
