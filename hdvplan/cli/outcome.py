"""What is written and printed about a judged drive, a long one too: files, verdict, warnings, tables, exit code and its message."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hdvplan.answers import NO, without_word
from hdvplan.cli.console import ExitCode, note, print_answer, print_tables, progress, report_error, warn, writing
from hdvplan.errors import RoadError

if TYPE_CHECKING:
    from collections.abc import Callable

    from rich.table import Table

    from hdvplan.cli.options import Output
    from hdvplan.judging.result import Result
    from hdvplan.judging.verdict import Verdict
    from hdvplan.pieces import CaseOf
    from hdvplan.planning.settings import PlannerSettings
    from hdvplan.road.line import Line
    from hdvplan.road.load import Found
    from hdvplan.road.road import Road
    from hdvplan.vehicle.model import Vehicle

Json = dict[str, Any]

_MOST_WARNINGS = 5
_ASIDE_M = 1.0  # further beside the line than without the largest clearance: less is not told


def looked_again(result: Result, *, proof: bool, refine: bool, quiet: bool) -> Result:
    """Return a plan that breaks its limits with a proof that nothing keeps them, and one that lacks less, where either is found.

    One that fits with hardly any room to spare is returned with how much another can keep.
    """
    from hdvplan import api
    from hdvplan.judging.verdict import verdict_of

    if proof and verdict_of(result).fits is False:
        with progress("looking for a proof that nothing fits", quiet=quiet) as on_progress:
            result = api.prove(result, on_progress=on_progress)
    if refine and verdict_of(result).fits is False:
        with progress("planning again so that less is lacking", quiet=quiet) as on_progress:
            result = api.replanned(result, on_progress=on_progress)
    if not (refine and result.planned and api.is_near(result)):
        return result
    if result.drive.road.path.length > api.LONG_M:
        note("the plan comes as near as limits allow; --clearance M keeps it away from them", quiet=quiet)
    else:
        with progress("looking for the largest clearance", quiet=quiet) as on_progress:
            most = api.clearest(result, on_progress=on_progress).case.settings.clearance
            result = replace(result, most_clearance=most)
    return result


def cleared(result: Result, *, quiet: bool) -> Result:
    """Return the plan with the largest clearance that can be kept, of one that fits, and say what it gives the driver."""
    from hdvplan.api import clearest
    from hdvplan.judging.envelope import steering_of
    from hdvplan.judging.verdict import stray_text

    with progress("planning again with more clearance", quiet=quiet) as on_progress:
        found = clearest(result, on_progress=on_progress)
    before, after = result.tracking, found.tracking
    if before is not None and after is not None:
        note(
            f"the {found.case.vehicle.name} can keep a clearance of {found.case.settings.clearance:.2f} m; "
            f"with it the driver may stray by {stray_text(after.error)}, without by {stray_text(before.error)}",
            quiet=quiet,
        )
    beside = [abs(one.drive.z[:, 0]) for one in (found, result)]
    if beside[0].max() > beside[1].max() + _ASIDE_M:
        where = f"at s = {found.drive.stations.s[beside[0].argmax()]:z.1f} m"
        text = f"with it the lead axle drives up to {beside[0].max():.1f} m beside the line, {where}, without {beside[1].max():.1f} m"
        warn(f"{text}: does it still come to where the line leads?", quiet=quiet)
    step, uses = result.drive.settings.step, [steering_of(one.drive) for one in (found, result)]
    for name, what in (("curvature", "steering"), ("rate", "steering rate")):
        more, less = (getattr(use, name).length(step) for use in uses)
        if more > less:
            words = f"with it {more:.1f} m of road take over 95 % of the {what}, without {less:.1f} m"
            note(f"{words}: a smaller --clearance steers more calmly", quiet=quiet)
    return found


def write(files: Callable[..., None], directory: Path, output: Output) -> None:
    """Write a judged drive by ``write_plan`` or ``write_legs`` into a folder, with the pictures and drawings that are asked for."""
    with progress(f"writing {directory}/", quiet=output.quiet) as on_progress, writing(f"to {directory}"):
        files(directory, pictures=output.kinds(), sheet=output.drawn_on(), animate=output.animate, on_progress=on_progress)


def tell(result: Result, directory: Path, output: Output, loop: Json | None = None) -> ExitCode:
    """Print verdict, warnings and tables of a judged drive, or its summary as JSON; return the exit code."""
    from hdvplan.judging.verdict import tracking_line, verdict_details, verdict_line, verdict_of
    from hdvplan.report.summary import summary_of

    verdict, summary, quiet = verdict_of(result), summary_of(result), output.quiet
    details = [verdict_details(result, verdict), tracking_line(result) if verdict.fits else ""]
    lines = [verdict_line(result, verdict), "; ".join(text for text in details if text)]
    if loop is not None:
        lines.insert(0 if loop["fits"] is False else len(lines), loop["text"])  # what does not hold is read first
    print_answer(output, summary | ({} if loop is None else {"loop": loop}), lines)
    warn_of_sides(summary, quiet=quiet)
    warn_of(result, verdict, quiet=quiet)
    if not output.json and not quiet:
        print_tables(*plan_tables(summary, directory, road=result.drive.road))
    return exit_code_of(result, verdict)


def compare(results: list[Result], directory: Path, output: Output) -> ExitCode:
    """Write and print the answers of several vehicles beside each other; return the worst exit code."""
    from hdvplan.fileio import csv_bytes, write_atomically
    from hdvplan.judging.verdict import verdict_of
    from hdvplan.report.compared import answer_of, answer_rows, answer_texts, compared_figure
    from hdvplan.report.grid import grid
    from hdvplan.report.style import figure_bytes
    from hdvplan.report.summary import summary_of

    quiet = output.quiet
    if any(result.most_clearance for result in results):
        note("plans come as near as limits allow; with --clearance max the table says how much room each can keep", quiet=quiet)
    table = answer_rows(results)
    with progress(f"writing {directory}/", quiet=quiet), writing(f"to {directory}"):
        write_atomically(directory / "compared.csv", csv_bytes(table))
        if "png" in output.kinds():
            write_atomically(directory / "compared.png", figure_bytes(compared_figure(results), "png"))
    summaries = [summary_of(result) for result in results]
    shown = answer_texts(table)
    columns, rows = tuple(shown.columns), shown.itertuples(index=False, name=None)
    title = f"{len(results)} vehicles on {results[0].drive.road.name}"
    answers = grid(title, columns, rows, text=(columns[0], columns[1], columns[-1]), caption=f"written to {directory}/")
    print_answer(output, summaries, [answer_of(results)], [answers])
    for summary in summaries:
        warn_of_sides(summary, f"{summary['vehicle']}: ", quiet=quiet)
    return max(exit_code_of(result, verdict_of(result)) for result in results)


def warn_of_sides(summary: dict[str, Any], who: str = "", *, quiet: bool) -> None:
    """Warn of each obstacle that is passed on the other side than the line passes it, perhaps that of oncoming traffic."""
    from hdvplan.report.summary import crossed_texts

    for text in crossed_texts(summary):
        warn(f"{who}{text}", quiet=quiet)


def warn_of(result: Result, verdict: Verdict, *, quiet: bool) -> None:
    """Warn of what a driver would find too much and, where a vehicle does not fit, of the places that the fit check calls too narrow."""
    from hdvplan.judging.envelope import steering_of, steering_texts
    from hdvplan.judging.fit import finding_text, folded_text
    from hdvplan.judging.sentences import attempts_text, between_texts, solver_texts

    for text in solver_texts(result):
        warn(text, quiet=quiet)
    if result.attempts:
        note(attempts_text(result), quiet=quiet)
    for text, tell_it in zip(between_texts(result, verdict.spare), (note, warn), strict=False):
        tell_it(text, quiet=quiet)
    for text in steering_texts(result.drive, steering_of(result.drive)):
        warn(text, quiet=quiet)
    findings = () if verdict.fits else result.fit.findings
    folded = folded_text(result.drive.road, findings)
    if folded is not None:
        warn(folded, quiet=quiet)
    for finding in findings[:_MOST_WARNINGS]:
        warn(finding_text(finding, result.drive.vehicle.name), quiet=quiet)
    if len(findings) > _MOST_WARNINGS:
        warn(f"{len(findings) - _MOST_WARNINGS} more such places; summary.json lists all under fit", quiet=quiet)


def plan_tables(summary: dict[str, Any], directory: Path, *, road: Road | None = None) -> list[Table]:
    """Return what a drive sweeps and breaks, then how it was planned, from its summary; ``road`` as in ``balance_table``."""
    from hdvplan.report.tables import balance_table, breach_table, planning_table

    broken = [breach_table(summary["breaches"])] if summary["breaches"] else []
    return [balance_table(summary, road), *broken, planning_table(summary, f"{directory}/")]


def exit_code_of(result: Result, verdict: Verdict) -> ExitCode:
    """Return the exit code; what is broken is an error that names the deepest place."""
    from hdvplan.judging.clearance import half_width_of
    from hdvplan.judging.sentences import breach_text, entered_text
    from hdvplan.judging.verdict import strays_text

    what = "plan" if result.planned else "path"
    if verdict.strays is not None:
        more = "--clearance M plans with more room to err" if result.planned else "`hdvplan plan --clearance M` plans with more room to err"
        report_error(f"the {what} {strays_text(verdict)}", more)
        return ExitCode.BROKEN
    if verdict.fits is not False:
        return ExitCode.OK
    breach = max(result.balance.breaches, key=lambda breach: breach.depth, default=None)
    hit = min(result.entered, key=lambda approach: approach.distance, default=None)
    met = next((region.plan for region in result.drive.road.regions if region.plan), None)
    apart = f"the plan in {met} takes its share: --meeting FROM:TO lets the two meet elsewhere"
    if breach is not None and (hit is None or breach.depth >= -hit.distance):
        swept = ""  # of a line that goes back and forth no half width is found
        with suppress(RoadError):
            half, _ = half_width_of(result.drive, result.envelope.s, verdict.half_width)
            swept = f"this {what} sweeps a half width of {half:.2f} m about the line as given; "
        report_error(
            breach_text(result, breach),
            apart if met is not None else f"{swept}`hdvplan need ROAD --vehicle NAME` finds the least room that a plan needs",
        )
    elif hit is not None:
        report_error(
            entered_text(result, hit),
            "limits hold along the road; this obstacle lies before its start or beyond its end",
        )
    else:
        kept = verdict.clearance_wanted + (verdict.spare or 0.0)
        report_error(
            f"only {kept:.3f} m of the wanted clearance of {verdict.clearance_wanted:.3f} m are kept "
            f"from {'an obstacle' if verdict.obstacle is not None else f'the {verdict.side} limit'} at s = {verdict.s:z.1f} m",
            "the vehicle fits without that clearance; "
            + (apart if met is not None else "`hdvplan need ROAD --vehicle NAME --clearance M` finds the room that it takes"),
        )
    return ExitCode.BROKEN


def plan_long(
    found: Found, line: Line, vehicle: Vehicle, settings: PlannerSettings, case_of: CaseOf, directory: Path, output: Output
) -> ExitCode:
    """Plan a vehicle along a road piece by piece, write the plan into a folder, and print its summary; return the exit code.

    ``line`` is the road's; ``case_of`` makes the case of a part of it.
    """
    from hdvplan.pieces import pieces_of, planned
    from hdvplan.report.joined import write_pieces

    quiet = output.quiet
    note(f"{line.name} has {line.length / 1e3:.0f} km: it is planned in stretches, without pictures", quiet=quiet)
    with writing(f"to {directory}"), progress(f"planning {vehicle.name} along {line.name}", quiet=quiet) as on_progress:
        pieces = planned(pieces_of(found, vehicle, settings), case_of)
        summary = write_pieces(pieces, directory, on_progress=lambda done: on_progress(min(1.0, done / line.length)))
    for remark in summary["notes"]:
        note(remark, quiet=quiet)
    verdict = summary["verdict"]
    print_answer(output, summary, (verdict["text"], verdict["details"]), plan_tables(summary, directory))
    warn_of_sides(summary, quiet=quiet)
    warn_of_steps(summary, quiet=quiet)
    return long_exit_code(summary)


def warn_of_steps(summary: dict[str, Any], *, quiet: bool) -> None:
    """Say in how many planning steps the solver that was asked for found no plan."""
    rescued, failed, plans = summary["rescued_steps"], summary["failed_steps"], summary["plans"]
    if rescued:
        first = rescued[0]
        where = f"first at s = {first['s_m']:z.1f} m: {first['why']}"
        warn(f"{summary['solver']} failed in {len(rescued)} of {plans} planning steps, {where}", quiet=quiet)
    if failed:
        where = f"first at s = {failed[0]:z.1f} m: the vehicle followed the last plan"
        warn(f"{len(failed)} of {plans} planning steps were not solved, {where}", quiet=quiet)


def long_exit_code(summary: dict[str, Any]) -> ExitCode:
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
            f"the {breach['part']} of the {breach['unit']} {broken} by {breach['depth_m']:.3f} m at s = {breach['s_deepest']:z.1f} m{more}",
            "summary.json lists all under breaches",
        )
    return ExitCode.BROKEN
