"""Tables of ``hdvplan roads info``: a road's numbers, and which vehicles fit it."""

from __future__ import annotations

from rich.table import Table

from hdvplan.judging.fit import Fit, RoadFacts
from hdvplan.report.grid import grid
from hdvplan.report.tables import line_rows
from hdvplan.road.road import Road

_MOST_FINDINGS = 5  # of each vehicle in the table
_STRAIGHT_PER_M = 5e-5  # a radius of 20 km; less curvature is shown as 0
_COLUMN = {"width": ("width [m]", 2), "curvature": ("curvature [1/m]", 3), "circle": ("no even circle", 0)}  # words and digits


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
    rows += line_rows(road)
    if facts.narrowest is not None:
        rows.append(("narrowest limits", f"{facts.narrowest:.2f}", "m", f"apart, first at s = {facts.narrowest_s:.1f} m"))
    return grid(road.name, ("", "value", "unit", "remark"), rows, text=("", "unit", "remark"), caption=road.notice)


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
            what, digits = _COLUMN[str(finding.trouble)]
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
