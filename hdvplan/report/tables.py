"""Tables for the terminal, of a plan and of ``hdvplan roads info``: numbers in, a rich table out. Nothing here prints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rich.table import Table

from hdvplan.judging.fit import Fit, RoadFacts, Trouble, facts_of
from hdvplan.planning.settings import Scheme
from hdvplan.report.grid import grid
from hdvplan.road.options import Corners
from hdvplan.road.road import Road
from hdvplan.texts import some_of

Json = dict[str, Any]

MOST_BREACHES = 10  # listed; the summary file holds all
_MOST_CORNERS = 8  # listed, likewise
_COLUMNS = ("", "value", "unit", "remark")
_TEXT = ("", "unit", "remark")
_MOST_FINDINGS = 5  # of each vehicle in the table
_STRAIGHT_PER_M = 5e-5  # a radius of 20 km; less curvature is shown as 0
_TROUBLES = {"width": ("width [m]", 2), "curvature": ("curvature [1/m]", 3), "circle": ("no even circle", 0)}  # words and digits


def needs_table(summaries: Sequence[Json], directory: str) -> Table:
    """Return the least room of several vehicles on one road, from their summaries, a vehicle a row; "-" where there is no such number."""
    sought = next(name for name in ("half_width_m", "left_m", "right_m") if name in summaries[0])
    shown = {
        sought.removesuffix("_m").replace("_", " ") + " [m]": (sought, 2),
        "at s [m]": ("s_m", 1),
        "too little, proved [m]": ("proved_below_m", 2),
        "widening [m2]": ("widening_m2", 1),
    }
    rows = [
        (one["vehicle"], *("-" if one[name] is None else f"{one[name]:.{digits}f}" for name, digits in shown.values())) for one in summaries
    ]
    title = f"{len(summaries)} vehicles on {summaries[0]['road']}"
    return grid(title, ("vehicle", *shown), rows, text=("vehicle",), caption=f"written to {directory}")


def balance_table(summary: Json, road: Road | None = None) -> Table:
    """Return the envelope balance of one plan from its summary: a quantity, its value and unit, and a remark a row.

    ``road`` adds what its file says; a long one is never there as a whole.
    """
    tightest = "geometric, where the road is tightest"
    tighter = "the road is tighter than the vehicle's tightest balanced circle" if summary["tighter_than_balanced_circle"] else tightest
    clearance = summary["min_clearance_m"]
    rows = [
        ("max left", f"{summary['max_left_m']:.3f}", "m", ""),
        ("max right", f"{summary['max_right_m']:.3f}", "m", ""),
        ("imbalance", f"{summary['imbalance_m']:+.3f}", "m", "max left - max right"),
        ("mean |left + right|", f"{summary['mean_abs_imbalance_m']:.3f}", "m", "over the whole road"),
        ("expected half width", f"{summary['expected_half_width_m']:.3f}", "m", tighter),
        ("min clearance", "-" if clearance is None else f"{clearance:.3f}", "m", _limits_remark(summary)),
    ]
    count = f"in {summary['stretches']['count']} stretches" if "stretches" in summary else ""
    known = [] if road is None else [*_line_rows(road), *_narrowest_rows(facts_of(road))]
    rows = [("road length", f"{summary['length_m']:.1f}", "m", count), *known, *rows]
    return grid(f"{summary['vehicle']} on {summary['road']}", _COLUMNS, rows, text=_TEXT)


def planning_table(summary: Json, directory: str) -> Table:
    """Return how the plan was made: times of a step, iterations and how far the prediction was off; ``directory`` holds the files."""
    if not summary["plans"]:
        return grid("driven along a given path", _COLUMNS, [("plans", "0", "", "")], text=_TEXT, caption=f"written to {directory}")
    times = summary["time_ms"]
    rows = [
        ("prediction error", f"{1e3 * summary['prediction_error_m']:.1f}", "mm", "planned against simulated position, largest"),
        ("time per step", f"{times['mean']:.2f}", "ms", f"mean; p95 {times['p95']:.2f}, max {times['max']:.2f}"),
        ("plans", f"{summary['plans']}", "", _plans_remark(summary)),
    ]
    title = f"planned by {summary['scheme']}, {summary['solver']}, {summary['objective']}"
    return grid(title, _COLUMNS, rows, text=_TEXT, caption=f"written to {directory}")


def breach_table(breaches: Sequence[Json]) -> Table:
    """Return the deepest of a summary's broken limits in order of s, and what they bind where that is not the whole body."""
    deepest = sorted(range(len(breaches)), key=lambda number: -breaches[number]["depth_m"])[:MOST_BREACHES]
    listed = [breaches[number] for number in sorted(deepest)]
    columns = ["from [m]", "to [m]", "deepest [m]", "depth [m]", "side", "body", "part"]
    rows = []
    for breach in listed:
        place = [f"{breach[name]:z.1f}" for name in ("s_from", "s_to", "s_deepest")]
        rows.append([*place, f"{breach['depth_m']:.3f}", breach["side"], breach["unit"], breach["part"]])
    if any(breach["binds"] for breach in listed):
        columns.append("binds")
        for row, breach in zip(rows, listed, strict=True):
            row.append(breach["binds"] or "all")
    if any(breach["obstacle"] is not None for breach in listed):
        columns.append("obstacle")
        for row, breach in zip(rows, listed, strict=True):
            row.append("-" if breach["obstacle"] is None else breach["obstacle"] or "unnamed")
    title = f"broken limits (the deepest {len(rows)} of {len(breaches)})" if len(breaches) > len(rows) else "broken limits"
    return grid(title, columns, rows, text=("side", "body", "part", "binds", "obstacle"))


def _narrowest_rows(facts: RoadFacts) -> list[tuple[str, str, str, str]]:
    if facts.narrowest is None:
        return []
    return [("narrowest limits", f"{facts.narrowest:.2f}", "m", f"apart, first at s = {facts.narrowest_s:z.1f} m")]


def _line_rows(road: Road) -> list[tuple[str, str, str, str]]:
    """Return how the given points were read, where widths count from them, and how far planning moved its line from them."""
    rows = []
    if road.about is not None and road.about.reading and road.limits is not None:
        corners = road.about.corners
        listed = some_of((f"{corner.s:z.0f}" for corner in corners), _MOST_CORNERS)
        rest = "the rest as a curve" if corners else "points as a curve"
        rest = "points joined by chords" if road.about.reading == Corners.SHARP else rest
        where = f"s = {listed} m, " if corners else ""
        rows.append(("corners read", f"{len(corners)}", "", f"{where}{rest}; --corners decides otherwise"))
    if road.smoothing is not None:
        moved, twice = road.smoothing, road.smoothing.duplicates
        dropped = f", {twice} duplicate" + ("s" if twice > 1 else "") if twice else ""
        what = f"smoothed {moved.points} points{dropped}; most at s = {moved.max_deviation_s:z.1f} m, rms {moved.rms_deviation:.2f} m"
        rows.append(("line moved by", f"{moved.max_deviation:.2f}", "m", what))
    return rows


def _limits_remark(summary: Json) -> str:
    if summary["min_clearance_m"] is None:
        return f"limits off; the plan needs a half width of {summary['needed_half_width_m']:.2f} m"
    if not summary["breaches"]:
        return "limits kept"
    deepest = max(summary["breaches"], key=lambda breach: float(breach["depth_m"]))
    return f"limits broken by {deepest['depth_m']:.3f} m at s = {deepest['s_deepest']:z.1f} m"


def _plans_remark(summary: Json) -> str:
    settings, failed, rescued = summary["settings"], len(summary["failed_steps"]), len(summary["rescued_steps"])
    text = f"every {settings['replan']:g} m, {settings['horizon']:g} m ahead"
    sqp, converged = summary["scheme"] == Scheme.SQP, summary["converged_plans"]
    text += f"; {converged} converged" if sqp and converged < summary["plans"] else ""
    text += f"; {rescued} by another solver" if rescued else ""
    return f"{text}; {failed} not solved, the vehicle followed the last plan" if failed else text


def facts_table(road: Road, facts: RoadFacts) -> Table:
    """Return a road's numbers."""
    bends = facts.max_curvature > _STRAIGHT_PER_M
    curvature = f"radius {1.0 / facts.max_curvature:.2f} m, at s = {facts.max_curvature_s:z.1f} m" if bends else "straight"
    rows = [
        ("length", f"{facts.length:.1f}", "m", "closed" if facts.closed else ""),
        ("largest curvature", f"{facts.max_curvature:.4f}", "1/m", curvature),
    ]
    if facts.point_spacing is not None:
        rows.append(("mean point spacing", f"{facts.point_spacing:.2f}", "m", "of the given points"))
    rows += _line_rows(road)
    rows += _narrowest_rows(facts)
    return grid(road.name, _COLUMNS, rows, text=_TEXT, caption=road.notice)


def fits_table(fits: list[Fit]) -> Table:
    """Return what each vehicle needs on even circles, what is to spare, and how many places to look at."""
    rows = [(fit.vehicle, f"{fit.half_width:.2f}", "-" if fit.spare is None else f"{fit.spare:+.2f}", _fit_remark(fit)) for fit in fits]
    columns, caption = ("vehicle", "needs +- [m]", "spare [m]", "places to plan"), "a plan may need less or more: `hdvplan plan` answers"
    return grid("preset vehicles on circles as tight as the road", columns, rows, text=("vehicle", "places to plan"), caption=caption)


def findings_table(fits: list[Fit]) -> list[Table]:
    """Return a table of the stretches where a circle as tight as the road is too wide or too tight; none where there are none."""
    rows = []
    for fit in fits:
        for finding in fit.findings[:_MOST_FINDINGS]:
            what, digits = _TROUBLES[str(finding.trouble)]
            numbers = [f"{value:.{digits}f}" if digits else "" for value in (finding.available, finding.needed)]
            rows.append((fit.vehicle, f"{finding.s_from:z.1f}", f"{finding.s_to:z.1f}", what, *numbers))
    left_out = sum(max(0, len(fit.findings) - _MOST_FINDINGS) for fit in fits)
    caption = f"the first {_MOST_FINDINGS} of each; --json lists {left_out} more" if left_out else None
    columns = ("vehicle", "from [m]", "to [m]", "what", "has", "needs")
    title = "places to plan, by circles as tight as the road"
    return [grid(title, columns, rows, text=("vehicle", "what"), caption=caption)] if rows else []


def _fit_remark(fit: Fit) -> str:
    if not fit.long_enough:
        return "longer than the road"
    narrow = sum(finding.trouble is Trouble.WIDTH for finding in fit.findings)
    counts = {"narrow": narrow, "tight": len(fit.findings) - narrow}
    words = ", ".join(f"{count} {kind}" for kind, count in counts.items() if count)
    return words or ("the road has no limits" if fit.spare is None else "none")
