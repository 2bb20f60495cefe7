"""Tables for the terminal, of a plan and of ``hdvplan roads info``: numbers in, a rich table out. Nothing here prints."""

from __future__ import annotations

from rich.table import Table

from hdvplan.judging.fit import Fit, RoadFacts, facts_of
from hdvplan.judging.result import Result, body_name
from hdvplan.report.grid import grid
from hdvplan.report.summary import step_times_ms
from hdvplan.road.options import Corners
from hdvplan.road.road import Road, Smoothing

MOST_BREACHES = 10  # listed; the summary file holds all
_MOST_CORNERS = 8  # listed, likewise
_COLUMNS = ("", "value", "unit", "remark")
_MOST_FINDINGS = 5  # of each vehicle in the table
_STRAIGHT_PER_M = 5e-5  # a radius of 20 km; less curvature is shown as 0
_TROUBLES = {"width": ("width [m]", 2), "curvature": ("curvature [1/m]", 3), "circle": ("no even circle", 0)}  # words and digits


def balance_table(result: Result) -> Table:
    """Return the envelope balance of one plan: a quantity, its value and unit, and a remark a row."""
    drive, balance = result.drive, result.balance
    tighter = (
        "the road is tighter than the vehicle's tightest balanced circle" if balance.saturated else "geometric, where the road is tightest"
    )
    rows = [
        ("max left", f"{balance.max_left:.3f}", "m", ""),
        ("max right", f"{balance.max_right:.3f}", "m", ""),
        ("imbalance", f"{balance.imbalance:+.3f}", "m", "max left - max right"),
        ("mean |left + right|", f"{balance.mean_abs_imbalance:.3f}", "m", "over the whole road"),
        ("expected half width", f"{balance.expected_half_width:.3f}", "m", tighter),
        ("min clearance", "-" if balance.min_clearance is None else f"{balance.min_clearance:.3f}", "m", _limits_remark(result)),
    ]
    length = ("road length", f"{drive.road.path.length:.1f}", "m", "")
    rows = [length, *_line_rows(drive.road), *_narrowest_rows(facts_of(drive.road)), *rows]
    title = f"{drive.vehicle.name} on {drive.road.name}"
    return grid(title, _COLUMNS, rows, text=("", "unit", "remark"))


def planning_table(result: Result, directory: str) -> Table:
    """Return how the plan was made: times of a step, iterations and how far the prediction was off; ``directory`` holds the files."""
    drive, times = result.drive, step_times_ms(result)
    rows = [
        ("prediction error", f"{1e3 * drive.prediction_error:.1f}", "mm", "planned against simulated position, largest"),
        ("time per step", f"{times['mean']:.2f}", "ms", f"mean; p95 {times['p95']:.2f}, max {times['max']:.2f}"),
        ("plans", f"{len(drive.plans)}", "", _plans_remark(result)),
    ]
    title = f"planned by {drive.settings.scheme}, {result.solver}, {result.objective}"
    return grid(title, _COLUMNS, rows, text=("", "unit", "remark"), caption=f"written to {directory}")


def breach_table(result: Result) -> Table:
    """Return the first broken limits in order of s; the region only where overhangs have separate limits."""
    breaches = result.balance.breaches
    columns = ["from [m]", "to [m]", "deepest [m]", "depth [m]", "side", "body", "part"]
    rows = []
    for breach in breaches[:MOST_BREACHES]:
        place = [f"{breach.s_from:.1f}", f"{breach.s_to:.1f}", f"{breach.s_deepest:.1f}"]
        rows.append([*place, f"{breach.depth:.3f}", breach.side, body_name(result.drive.vehicle, breach.unit), breach.part])
        if result.two_regions:
            rows[-1].append(breach.region)
    if result.two_regions:
        columns.append("region")
    if any(breach.obstacle is not None for breach in breaches):
        columns.append("obstacle")
        for row, breach in zip(rows, breaches, strict=False):
            row.append("-" if breach.obstacle is None else breach.obstacle or "unnamed")
    title = f"broken limits ({len(rows)} of {len(breaches)})" if len(breaches) > len(rows) else "broken limits"
    return grid(title, columns, rows, text=("side", "body", "part", "region", "obstacle"))


def _narrowest_rows(facts: RoadFacts) -> list[tuple[str, str, str, str]]:
    if facts.narrowest is None:
        return []
    return [("narrowest limits", f"{facts.narrowest:.2f}", "m", f"apart, first at s = {facts.narrowest_s:.1f} m")]


def _line_rows(road: Road) -> list[tuple[str, str, str, str]]:
    """Return how the given points were read, where widths count from them, and how far planning moved its line from them."""
    rows = []
    if road.about is not None and road.about.reading and road.limits is not None:
        corners = road.about.corners
        listed = ", ".join(f"{corner.s:.0f}" for corner in corners[:_MOST_CORNERS]) + (", ..." if len(corners) > _MOST_CORNERS else "")
        rest = "the rest as a curve" if corners else "points as a curve"
        rest = "points joined by chords" if road.about.reading == Corners.SHARP else rest
        where = f"s = {listed} m, " if corners else ""
        rows.append(("corners read", f"{len(corners)}", "", f"{where}{rest}; --corners decides otherwise"))
    if road.smoothing is not None:
        rows.append(("line moved by", f"{road.smoothing.max_deviation:.2f}", "m", _smoothing_remark(road.smoothing)))
    return rows


def _smoothing_remark(smoothing: Smoothing) -> str:
    """Return what smoothing did, in words."""
    dropped = f", {smoothing.duplicates} duplicate" + ("s" if smoothing.duplicates > 1 else "") if smoothing.duplicates else ""
    return (
        f"smoothed {smoothing.points} points{dropped}; most at s = {smoothing.max_deviation_s:.1f} m, rms {smoothing.rms_deviation:.2f} m"
    )


def _limits_remark(result: Result) -> str:
    balance = result.balance
    if balance.min_clearance is None:
        return f"limits off; the plan needs a half width of {result.balance.half_width:.2f} m"
    if not balance.breaches:
        return "limits kept"
    deepest = max(balance.breaches, key=lambda breach: breach.depth)
    return f"limits broken by {deepest.depth:.3f} m at s = {deepest.s_deepest:.1f} m"


def _plans_remark(result: Result) -> str:
    settings, failed = result.drive.settings, len(result.failed)
    text = f"every {settings.replan:g} m, {settings.horizon:g} m ahead"
    text += f"; {len(result.rescued)} by another solver" if result.rescued else ""
    return f"{text}; {failed} not solved, the vehicle followed the last plan" if failed else text


def facts_table(road: Road, facts: RoadFacts) -> Table:
    """Return a road's numbers."""
    bends = facts.max_curvature > _STRAIGHT_PER_M
    curvature = f"radius {1.0 / facts.max_curvature:.2f} m, at s = {facts.max_curvature_s:.1f} m" if bends else "straight"
    rows = [
        ("length", f"{facts.length:.1f}", "m", "closed" if facts.closed else ""),
        ("largest curvature", f"{facts.max_curvature:.4f}", "1/m", curvature),
    ]
    if facts.point_spacing is not None:
        rows.append(("mean point spacing", f"{facts.point_spacing:.2f}", "m", "of the given points"))
    rows += _line_rows(road)
    rows += _narrowest_rows(facts)
    return grid(road.name, _COLUMNS, rows, text=("", "unit", "remark"), caption=road.notice)


def fits_table(fits: list[Fit]) -> Table:
    """Return what each vehicle needs, what is to spare, and the verdict."""
    rows = [(fit.vehicle, f"{fit.half_width:.2f}", "-" if fit.spare is None else f"{fit.spare:+.2f}", _fit_remark(fit)) for fit in fits]
    columns = ("vehicle", "needs +- [m]", "spare [m]", "verdict")
    return grid("preset vehicles, balanced by geometry", columns, rows, text=("vehicle", "verdict"))


def findings_table(fits: list[Fit]) -> list[Table]:
    """Return a table of the stretches that vehicles do not fit; none where all fit."""
    rows = []
    for fit in fits:
        for finding in fit.findings[:_MOST_FINDINGS]:
            what, digits = _TROUBLES[str(finding.trouble)]
            numbers = [f"{value:.{digits}f}" if digits else "" for value in (finding.available, finding.needed)]
            rows.append((fit.vehicle, f"{finding.s_from:.1f}", f"{finding.s_to:.1f}", what, *numbers))
    left_out = sum(max(0, len(fit.findings) - _MOST_FINDINGS) for fit in fits)
    caption = f"the first {_MOST_FINDINGS} of each; --json lists {left_out} more" if left_out else None
    columns = ("vehicle", "from [m]", "to [m]", "what", "has", "needs")
    return [grid("stretches where a vehicle does not fit", columns, rows, text=("vehicle", "what"), caption=caption)] if rows else []


def _fit_remark(fit: Fit) -> str:
    if not fit.long_enough:
        return "longer than the road"
    if fit.findings:
        count = len(fit.findings)
        return f"no: {count} place{'s' if count > 1 else ''}, see below"
    return "the road has no limits" if fit.spare is None else "fits everywhere"
