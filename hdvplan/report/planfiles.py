"""Read the files of a plan back, as far as a report needs them, and thin and pack their columns for its page."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pandas.api.types import is_bool_dtype, is_numeric_dtype

from hdvplan.arrays import FloatArray
from hdvplan.errors import OptionError
from hdvplan.fileio import read_json, refuse_endless, settle
from hdvplan.report.rooms import peaks

_TABLES = ("path", "envelope", "profile", "steps")
_ENTRIES = dict.fromkeys(("road", "vehicle", "scheme", "solver", "objective", "status"), str) | {"time_ms": dict}
_LISTS = {
    "bodies": ("name", "wheelbase_m", "hitch_offset_m", "front_m", "rear_m", "width_m"),
    "breaches": ("s_from", "s_to", "s_deepest", "depth_m", "side", "unit", "region", "x", "y"),
    "obstacles": ("name", "distance_m", "s_m", "unit"),
}
_REGION, _LIMIT = ("region", "rings"), ("layer", "lines")
_SUMMARIES = {"summary.json": "plan", "need.json": "need", "turn.json": "turn"}  # and what their pictures are called
_PICTURES = {"png": "png", "svg": "svg+xml"}  # that a page shows, as it calls them
_FOLDERS = "give folders of `hdvplan plan`, `judge`, `need` or `turn`; those of several vehicles are in DIR/*/"
SPACING_M = 0.5  # between two samples of the page
_HIDDEN_BELOW = 1e-9
_MISSING = -32768  # of a 16-bit number
_PLACES = 6  # tightest ones that the page lists
_APART_M = 30.0  # at least, between two of them

Json = dict[str, Any]


@dataclass(frozen=True)
class PlanFiles:
    """One plan as ``hdvplan plan`` wrote it: the summary, the regions, the limits, and the tables of the files of the same names."""

    directory: Path
    summary: dict[str, Any]
    path: pd.DataFrame
    envelope: pd.DataFrame
    profile: pd.DataFrame
    steps: pd.DataFrame
    regions: list[dict[str, Any]]
    limits: list[dict[str, Any]]


@dataclass(frozen=True)
class Pictured:
    """What a command that draws its own picture wrote: the summary, and the picture as a page takes it; "" where none was drawn."""

    directory: Path
    summary: dict[str, Any]
    picture: str


def read_pictured(directory: Path) -> Pictured | None:
    """Return the drive of several legs, the need or the turn in a folder; None where there is none; an ``OptionError`` of a damaged one."""
    try:
        settle(directory)
        for name, stem in _SUMMARIES.items():
            summary = read_json(directory / name) if (directory / name).is_file() else None
            if isinstance(summary, dict) and (stem != "plan" or "legs" in summary):
                return Pictured(directory, summary, _picture(directory / stem))
    except (OSError, ValueError) as error:
        msg = f"what {directory} holds cannot be read: {error}"
        raise OptionError(msg, hint="run the command that wrote it again") from error
    return None


def _picture(stem: Path) -> str:
    for suffix, kind in _PICTURES.items():
        file = stem.with_suffix(f".{suffix}")
        if file.exists():
            refuse_endless(file)
            return f"data:image/{kind};base64,{base64.b64encode(file.read_bytes()).decode()}"
    return ""


def read_plan(directory: Path) -> PlanFiles:
    """Return the plan in a folder; an ``OptionError``: it holds none, or one whose files are incomplete or damaged."""
    try:
        settle(directory)
        if not (directory / "summary.json").is_file():
            what = "has no plan, need or turn: summary.json is missing" if directory.is_dir() else "is not a folder"
            msg = f"{directory} {what}"
            raise OptionError(msg, hint=_FOLDERS)
        summary = read_json(directory / "summary.json")
        _check_summary(summary)
        regions, limits = (read_json(directory / f"{name}.json") for name in ("regions", "limits"))
        _check_list(regions, _REGION, "regions.json")
        _check_list(limits, _LIMIT, "limits.json")
        tables = {name: _table(directory / f"{name}.csv") for name in _TABLES}
        plan = PlanFiles(directory, summary, **tables, regions=regions, limits=limits)
        _check_tables(plan)
    except FileNotFoundError as error:
        msg = f"the plan in {directory} has no {Path(error.filename).name}"
        raise OptionError(msg, hint="plan again: a run that was stopped, or an older version, wrote it") from error
    except (OSError, ValueError) as error:
        msg = f"the plan in {directory} cannot be read: {error}"
        raise OptionError(msg, hint="plan again") from error
    return plan


def _table(path: Path) -> pd.DataFrame:
    refuse_endless(path)
    return pd.read_csv(path, low_memory=False)  # a word in a long column of numbers: an object column, and no warning


def _check_summary(summary: object) -> None:
    entries = summary if isinstance(summary, dict) else {}
    for name, kind in _ENTRIES.items():
        if not isinstance(entries.get(name), kind):
            msg = f"summary.json has no {name}"
            raise ValueError(msg)  # noqa: TRY004 - of a file's content
    for name, value in entries.items():
        if name.endswith("_m") and not isinstance(value, int | float | None):
            msg = f"{name} of summary.json must be a number, not {value!r}"
            raise ValueError(msg)
    for name, needed in _LISTS.items():
        _check_list(entries.get(name), needed, f"{name} of summary.json")


def _check_list(items: object, needed: tuple[str, ...], where: str) -> None:
    if not isinstance(items, list) or not all(isinstance(item, dict) and set(needed) <= set(item) for item in items):
        msg = f"{where} must be a list of entries with {', '.join(needed)}"
        raise ValueError(msg)


def _check_tables(plan: PlanFiles) -> None:
    bodies = len(plan.summary["bodies"])
    for table, needed in (
        (plan.path, ["s", "x", "y", "heading", "e_y", "e_psi", "kappa", *(f"beta{number}" for number in range(1, bodies))]),
        (plan.envelope, ["s", "left", "right", "left_limit", "right_limit", "expected_left", "expected_right"]),
        (plan.profile, ["s", "clearance", *(f"{side}{number}" for number in range(1, bodies + 1) for side in ("left", "right"))]),
        (plan.steps, ["s", "total_ms"] if plan.summary.get("plans") != 0 else []),  # nothing is planned along a given path
    ):
        for column in needed:
            if column not in table:
                msg = f"column {column} is missing"
                raise ValueError(msg)
            if is_bool_dtype(table[column]) or not (is_numeric_dtype(table[column]) and len(table)):
                msg = f"column {column} has {'values that are not numbers' if len(table) else 'no rows'}"
                raise ValueError(msg)
    if len(plan.envelope) != len(plan.profile):
        msg = "envelope.csv and profile.csv differ in length"
        raise ValueError(msg)


def payload_of(plan: PlanFiles) -> Json:
    """Return one plan for the page: names, bodies, packed columns at equal arclengths, broken limits, regions."""
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
        "breaches": [breach | {"x": breach["x"] - float(x[0]), "y": breach["y"] - float(y[0])} for breach in summary["breaches"]],
        "places": tight_places(plan),
        "regions": [{"region": item["region"], "rings": _beside(item["rings"], float(x[0]), float(y[0]))} for item in plan.regions],
        "limits": [item | {"lines": _beside(item["lines"], float(x[0]), float(y[0]))} for item in plan.limits],
        "notice": summary.get("notice"),
        "wheels": [[wheel["body"] - 1, wheel["ahead_m"], wheel["left_m"]] for wheel in summary.get("wheels", [])],
        "north": (summary.get("verdict") or {}).get("lon") is not None,
    }


def label_of(summary: Json) -> str:
    """Return what tells plans apart at a glance."""
    how = ", ".join(filter(None, (summary["scheme"], summary["solver"], summary["objective"])))
    return f"{summary['vehicle']} on {summary['road']}, {how}"


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


def _beside(lines: list[list[list[float]]], x: float, y: float) -> list[list[list[float]]]:
    """Return lines with their coordinates less the origin's, to 1 cm."""
    return [np.round(np.array(line) - [x, y], 2).tolist() for line in lines]


def _exact(values: FloatArray) -> Json:
    return {"data": base64.b64encode(values.astype("<f4").tobytes()).decode()}
