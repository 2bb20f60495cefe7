"""The report: plans side by side in one HTML file that needs no network."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, Template, TemplateError

from hdvplan.answers import NO, WORDS, without_word
from hdvplan.arrays import FloatArray
from hdvplan.errors import OptionError
from hdvplan.fileio import write_atomically
from hdvplan.judging.balance import KEPT_M
from hdvplan.report.planfiles import Pictured, PlanFiles, label_of, payload_of, read_pictured, read_plan, tight_places
from hdvplan.road.regions import called
from hdvplan.texts import encoded
from hdvplan.version import __version__

_MOST = 20  # breaches, and nearest obstacles, that are listed; the summary file holds all
_LIMITS = {
    ("bridged", False): ("", "limits"),
    ("binds", "overhangs"): ("dotted", "limits of overhangs"),
    ("bridged", True): ("dashed", "assumed, not drawn"),
}
_UNITS = {"_per_m": "1/m", "_m2": "m2", "_m": "m", "_deg": "deg"}  # as names of numbers end
# Elsewhere on the page, or nothing about the answer:
_NAMED = ("vehicle", "road", "template", "leg", "notice", "version", "time_s", "plane", "x", "y", "lon", "lat")
_DIGITS = 3  # of numbers that say nothing else
_BINS = 40
_PLOT = (10.0, 310.0, 8.0, 120.0)  # of the histogram: left, right, top, bottom

Json = dict[str, Any]

# name, unit, key in the summary ("a.b" is b in a), digits (None: as it is), and what it means
_DRIVEN = (
    ("vehicle", "", "vehicle", None, ""),
    ("road", "", "road", None, ""),
    ("status", "", "status", None, "ok: the vehicle keeps all limits, to 1 cm"),
    ("road length", "m", "length_m", 1, "along the driven line"),
    ("width between limits", "m", "narrowest", 2, "where the road is narrowest, obstacles included"),
    ("max left", "m", "max_left_m", 3, "furthest that any part of the vehicle reaches to the left of the line"),
    ("max right", "m", "max_right_m", 3, "the same to the right"),
    ("imbalance", "m", "imbalance_m", 3, "max left less max right: 0 where the two extremes agree"),
    ("mean |left + right|", "m", "mean_abs_imbalance_m", 3, "the imbalance of each place, averaged over the road"),
    ("expected half width", "m", "expected_half_width_m", 3, "reach to either side in a steady circle as tight as the tightest bend"),
    ("needed half width", "m", "needed_half_width_m", 3, "beside the smoothed line, without limits the given one, for all that is swept"),
    ("min clearance", "m", "min_clearance_m", 3, "least room between the vehicle and a limit; negative: it reaches beyond"),
    ("tracking error", "m", "tracking_error_m", 3, "how far the driver may stray, so that the vehicle still keeps all limits"),
    ("limit violation", "m", "limit_violation_m", 3, "furthest that the vehicle reaches beyond a limit"),
)
_HOW = ("objective", "scheme", "solver")
_COMPUTED = (
    ("objective", "", "objective", None, "what the plan centres between the sides"),
    ("scheme", "", "scheme", None, "rti: one quadratic program a step; sqp: as many as it takes"),
    ("solver", "", "solver", None, "of the quadratic programs"),
    ("planning steps", "", "plans", None, "how often the plan was renewed along the road"),
    ("SQP iterations, mean", "", "sqp_iterations_mean", 2, "quadratic programs a step"),
    ("SQP iterations, max", "", "sqp_iterations_max", None, ""),
    ("step time, mean", "ms", "time_ms.mean", 3, "computing time of a step; nothing about the drive"),
    ("step time, p50", "ms", "time_ms.p50", 3, "the median"),
    ("step time, p95", "ms", "time_ms.p95", 3, "the 95th percentile"),
    ("step time, p99", "ms", "time_ms.p99", 3, "the 99th percentile"),
    ("step time, max", "ms", "time_ms.max", 3, ""),
)


def write_report(
    directories: Sequence[Path],
    path: Path,
    *,
    title: str = "Swept path report",
    on_progress: Callable[[float], None] | None = None,
) -> int:
    """Write the page about the plans, needs and turns in ``directories`` and return its size in bytes; ``on_progress`` receives 0 to 1.

    Raises:
        OptionError: a folder holds none of them, or a damaged one.
        OSError: the file cannot be written.

    """
    plans, pictured = list[PlanFiles](), list[Pictured]()
    for number, directory in enumerate(directories):
        if (found := read_pictured(directory)) is None:
            plans.append(read_plan(directory))
        else:
            pictured.append(found)
        if on_progress is not None:
            on_progress((number + 1) / (len(directories) + 1))
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):  # else such numbers are warned of, and the page shows nothing
            page = encoded(report_html(plans, title, pictured))
    except (ArithmeticError, AttributeError, LookupError, RecursionError, TemplateError, TypeError, ValueError) as error:
        # files from outside may hold anything
        msg = f"what {', '.join(map(str, directories))} hold cannot be shown: {error}"
        raise OptionError(msg, hint="a file of one of them is damaged: run its command again") from error
    write_atomically(path, page)
    return len(page)


def report_html(plans: Sequence[PlanFiles], title: str, pictured: Sequence[Pictured] = ()) -> str:
    """Return the page that shows ``plans`` side by side: summary, maps, diagrams, tables, step times; then what is ``pictured``."""
    widths = [plan.envelope["left_limit"] - plan.envelope["right_limit"] for plan in plans]
    narrowest = [float(width.min()) if width.notna().any() else None for width in widths]
    plans = [replace(plan, summary=plan.summary | {"narrowest": m} | _given(plan)) for plan, m in zip(plans, narrowest, strict=True)]
    summaries = [plan.summary for plan in plans]
    edges = _edges([plan.steps["total_ms"].to_numpy() for plan in plans])
    return page_template("report.html.j2").render(
        title=title,
        version=__version__,
        style=page_part("report.css"),
        script=page_part("report.js"),
        summary=[_row(summaries, *row) for row in _DRIVEN],
        computed=[_row(summaries, *row) for row in _COMPUTED],
        plans=[_panel(*each, edges) for each in zip(plans, _headings(plans), short_labels(plans), strict=True)],
        pictured=[_section(one) for one in pictured],
        data=script_json([payload_of(plan) for plan in plans]),
        directories=", ".join([*(str(plan.directory) for plan in plans), *(str(one.directory) for one in pictured)]),
    )


def short_labels(plans: Sequence[PlanFiles]) -> list[str]:
    """Return what tells these plans apart: only what differs, or the vehicle; folders where nothing does."""
    keys = ("vehicle", "road", *_HOW)
    differing = [key for key in keys if len({plan.summary[key] for plan in plans}) > 1] or ["vehicle"]
    return _apart([", ".join(filter(None, (str(plan.summary[key]) for key in differing))) for plan in plans], plans)


def _apart(labels: list[str], plans: Sequence[PlanFiles]) -> list[str]:
    return [f"{label} ({plan.directory.name})" if labels.count(label) > 1 else label for label, plan in zip(labels, plans, strict=True)]


def _given(plan: PlanFiles) -> Json:
    """Return what the summary of a given path says of how it was made: which one it is; nothing of a plan."""
    if plan.summary.get("plans") != 0:
        return {}
    return {"objective": f"given path {plan.summary.get('path') or plan.directory.name}", "scheme": "", "solver": ""}


def _row(summaries: Sequence[Json], name: str, unit: str, key: str, digits: int | None, meaning: str) -> Json:
    return {"name": name, "unit": unit, "cells": [_cell(summary, key, digits) for summary in summaries], "meaning": meaning}


def _headings(plans: Sequence[PlanFiles]) -> list[str]:
    ways = {tuple(str(plan.summary[key]) for key in _HOW) for plan in plans}
    subjects = [f"{plan.summary['vehicle']} on {plan.summary['road']}" for plan in plans]
    return _apart(subjects if len(ways) == 1 else [label_of(plan.summary) for plan in plans], plans)


def _cell(summary: Json, key: str, digits: int | None) -> Json:
    value: Any = summary
    for part in key.split("."):
        value = None if value is None else value.get(part)
    bad = (key == "status" and value != "ok") or (key == "limit_violation_m" and (value or 0.0) > 0.0)
    if digits is None and isinstance(value, float):
        digits = _DIGITS
    text = "-" if value is None or value == "" else str(value) if digits is None else f"{value:.{digits}f}"
    return {"text": text, "bad": bad}


def _panel(plan: PlanFiles, heading: str, short: str, edges: FloatArray) -> Json:
    summary = plan.summary
    breaches = sorted(summary["breaches"], key=lambda breach: -breach["depth_m"])
    return {
        "label": heading,
        "short": short,
        "verdict": verdict_text(summary),
        "bodies": [body["name"] for body in summary["bodies"]],
        "breaches": [breach | {"limit": _broken(breach)} for breach in breaches[:_MOST]],
        "more_breaches": len(breaches) - _MOST,
        "places": tight_places(plan),
        "obstacles": sorted(summary["obstacles"], key=lambda near: float(near["distance_m"]))[:_MOST],
        "kept_m": KEPT_M,
        "limits": [key for name, key in _LIMITS.items() if any(limit.get(name[0]) == name[1] for limit in plan.limits)],
        "regions": sorted({region["region"] for region in plan.regions}),
        "times": _histogram(plan.steps["total_ms"].round(4).to_numpy(), edges),
        "notice": summary.get("notice"),
    }


def _section(one: Pictured) -> Json:
    """Return what a page says of a drive of several legs, a need or a turn: its answer, picture, and a row for each number of its parts."""
    summary = one.summary
    first, *more = summary.get("text", [""])
    word = next((word for word in WORDS if first.startswith(word)), "")
    answer = {"word": word, "rest": "; ".join([without_word(first, word), *more]), "bad": word == NO}
    parts = [
        {str(name): ("no", "yes")[value] if isinstance(value, bool) else value for name, value in part.items() if name not in _NAMED}
        for part in summary.get("legs") or [summary]
    ]
    names = dict.fromkeys(name for part in parts for name, value in part.items() if isinstance(value, str | int | float))
    ends = [(name, next((end for end in _UNITS if name.endswith(end)), "")) for name in names]
    return {
        "label": ", ".join([summary["vehicle"], *(str(summary[name]) for name in ("road", "template") if summary.get(name))]),
        "verdict": verdict_text(summary) if "verdict" in summary else answer,
        "picture": one.picture,
        "columns": [f"leg {number}" for number, _ in enumerate(parts, start=1)] if "legs" in summary else [""],
        "rows": [_row(parts, name.removesuffix(end).replace("_", " "), _UNITS.get(end, ""), name, None, "") for name, end in ends],
        "notice": summary.get("notice"),
    }


def _broken(breach: Json) -> str:
    obstacle = breach.get("obstacle")
    if obstacle is not None:
        return called(obstacle)
    return "edge for overhangs" if breach.get("binds") == "overhangs" else "edge of the road"


def verdict_text(summary: Json) -> Json:
    """Return the answer that a summary holds, its first word by itself, and whether it is no."""
    verdict = summary.get("verdict") or {}
    word, text = str(verdict.get("word", "")), str(verdict.get("text", summary["status"]))
    rest = "; ".join(filter(None, (without_word(text, word), verdict.get("details"))))
    return {"word": word, "rest": rest, "bad": verdict.get("fits") is False}


def _edges(times: Sequence[FloatArray]) -> FloatArray:
    """Return the bins that all histograms share, equally wide on a logarithmic axis [ms]."""
    every = np.concatenate(times) if any(map(len, times)) else np.ones(1)  # given paths have no planning steps
    low, high = max(float(np.min(every)), 1e-6), max(float(np.max(every)), 2e-6)
    edges: FloatArray = np.geomspace(0.95 * low, 1.05 * high, _BINS + 1)
    return edges


def _histogram(times: FloatArray, edges: FloatArray) -> Json:
    """Return bars (x, y, width, height, text) and ticks (x, text) in the units of the page's drawing."""
    left, right, top, bottom = _PLOT
    counts, _ = np.histogram(times, edges)
    width, high = (right - left) / _BINS, (bottom - top) * counts / max(1, int(np.max(counts)))
    bars = [
        (left + width * at, bottom - high[at], 0.9 * width, high[at], f"{edges[at]:.3g} to {edges[at + 1]:.3g} ms: {counts[at]} steps")
        for at in np.flatnonzero(counts)
    ]
    nice = [digit * 10.0**power for power in range(-4, 6) for digit in (1, 2, 5)]
    scale = (right - left) / float(np.log(edges[-1] / edges[0]))
    ticks = [(left + scale * np.log(value / edges[0]), f"{value:g}") for value in nice if edges[0] <= value <= edges[-1]]
    return {"bars": bars, "ticks": ticks, "count": len(times)}


def script_json(value: object) -> str:
    """Return JSON that cannot end the script element which carries it."""
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")


def page_template(name: str, package: str = "hdvplan.report") -> Template:
    """Return the template of a page."""
    return Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True).from_string(page_part(name, package))


def page_part(name: str, package: str = "hdvplan.report") -> str:
    """Return a file of a package that a page is made of: its template, style or script."""
    return (resources.files(package) / "page" / name).read_text(encoding="utf-8")
