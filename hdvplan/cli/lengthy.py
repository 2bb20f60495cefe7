"""What ``hdvplan plan`` does on a long road: it plans and writes piece by piece."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hdvplan.answers import NO, without_word
from hdvplan.cli.console import ExitCode, note, print_json, print_line, print_tables, progress, report_error, warn, writing

if TYPE_CHECKING:
    from pathlib import Path

    from hdvplan.pieces import CaseOf
    from hdvplan.planning.settings import PlannerSettings
    from hdvplan.road.line import Line
    from hdvplan.road.load import Found
    from hdvplan.vehicle.model import Vehicle


def plan_long(
    found: Found, line: Line, vehicle: Vehicle, settings: PlannerSettings, case_of: CaseOf, directory: Path, *, json: bool, quiet: bool
) -> int:
    """Plan a vehicle along a road piece by piece, write the plan into a folder, and print its summary; return the exit code.

    ``line`` is the road's; ``case_of`` makes the case of a part of it.
    """
    from hdvplan.pieces import pieces_of, planned
    from hdvplan.report.joined import write_pieces
    from hdvplan.report.tables import balance_table, breach_table, planning_table

    note(f"{line.name} has {line.length / 1e3:.0f} km: it is planned in stretches, without pictures", quiet=quiet)
    with writing(f"to {directory}"), progress(f"planning {vehicle.name} along {line.name}", quiet=quiet) as on_progress:
        pieces = planned(pieces_of(found, vehicle, settings), case_of)
        summary = write_pieces(pieces, directory, on_progress=lambda done: on_progress(min(1.0, done / line.length)))
    for remark in summary["notes"]:
        note(remark, quiet=quiet)
    verdict = summary["verdict"]
    if json:
        print_json(summary)
    elif not quiet:
        print_line(verdict["text"])
        print_line(verdict["details"])
        two_regions = any(breach["region"] == "sweepable" for breach in summary["breaches"])
        broken = [breach_table(summary["breaches"], two_regions=two_regions)] if summary["breaches"] else []
        print_tables(balance_table(summary), *broken, planning_table(summary, f"{directory}/"))
    _warn_of_steps(summary, quiet=quiet)
    return _exit_code(summary)


def _warn_of_steps(summary: dict[str, Any], *, quiet: bool) -> None:
    """Say in how many planning steps the solver that was asked for found no plan."""
    rescued, failed, plans = summary["rescued_steps"], summary["failed_steps"], summary["plans"]
    if rescued:
        first = rescued[0]
        where = f"first at s = {first['s_m']:.1f} m: {first['why']}"
        warn(f"{summary['solver']} failed in {len(rescued)} of {plans} planning steps, {where}", quiet=quiet)
    if failed:
        where = f"first at s = {failed[0]:.1f} m: the vehicle followed the last plan"
        warn(f"{len(failed)} of {plans} planning steps were not solved, {where}", quiet=quiet)


def _exit_code(summary: dict[str, Any]) -> ExitCode:
    """Return the exit code; what is broken is an error that names the deepest place."""
    if summary["verdict"]["fits"] is not False:
        return ExitCode.OK
    from hdvplan.road.regions import called

    breach = max(summary["breaches"], key=lambda one: one["depth_m"], default=None)
    if breach is None:
        report_error(without_word(summary["verdict"]["text"], NO), "summary.json has more under verdict and obstacles")
    else:
        broken = f"breaks the {breach['side']} limit" if breach["obstacle"] is None else f"enters {called(breach['obstacle'])}"
        more = f", and at {len(summary['breaches']) - 1} more places" if len(summary["breaches"]) > 1 else ""
        report_error(
            f"the {breach['part']} of the {breach['unit']} {broken} by {breach['depth_m']:.3f} m at s = {breach['s_deepest']:.1f} m{more}",
            "summary.json lists all under breaches",
        )
    return ExitCode.BROKEN
