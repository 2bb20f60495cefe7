"""What ``hdvplan plan`` does on a file of several legs: it plans across their cusps, and judges every leg."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from math import degrees
from typing import TYPE_CHECKING, Any

from hdvplan.answers import NO, room_number, without_word
from hdvplan.cli.checks import warn_far_regions
from hdvplan.cli.console import ExitCode, note, print_answer, print_tables, progress, report_error, warn
from hdvplan.cli.outcome import write

if TYPE_CHECKING:
    from pathlib import Path

    from hdvplan.cli.options import Output
    from hdvplan.judging.legs import LegsResult
    from hdvplan.road.legs import Legs
    from hdvplan.road.line import Line
    from hdvplan.vehicle.model import Vehicle

LEAD, LAST = "lead-axle", "last-axle"  # whose line a backward leg is
_ENDS = "articulation at its end [deg]"
_ASKEW_DEG = 2.0  # of the place where a vehicle is parked
_FINEST_M = 0.01  # smoothing that is advised


def legs_in(line: Line, vehicle: Vehicle, reaches: tuple[float, float] | None, *, last_axle: bool, quiet: bool) -> Legs:
    """Return the legs of a file between the limits that options gave, left and right as the vehicle heads [m]; says what was noted."""
    from hdvplan.driving.lead_line import lead_line
    from hdvplan.road.load_legs import legs_of

    with progress(f"smoothing {line.name}", quiet=quiet):
        legs = legs_of(line, partial(lead_line, vehicle) if last_axle else None)
    for remark in legs.notes:
        note(remark, quiet=quiet)
    warn_far_regions(legs.regions, [leg.road.path for leg in legs.legs], quiet=quiet)
    if reaches is None:
        return legs
    return replace(legs, legs=tuple(replace(leg, road=leg.road.with_limits(*reaches)) for leg in legs.legs))


def finish(driven: LegsResult, directory: Path, output: Output) -> ExitCode:
    """Write the plan into a folder, print its verdict and a row a leg, or its summary as JSON; return the exit code."""
    from hdvplan.judging.sentences import solver_texts
    from hdvplan.report.leg_files import summary_of_legs, write_legs

    quiet = output.quiet
    write(partial(write_legs, driven), directory, output)
    summary = summary_of_legs(driven)
    print_answer(output, summary, (driven.text, driven.details))
    for at, result in enumerate(driven.results):
        for text in solver_texts(result):
            warn(f"{driven.called(at)}: {text}", quiet=quiet)
    last = driven.legs.legs[-1]
    askew = abs(degrees(last.turned[1]))
    if askew > _ASKEW_DEG and last.road.smoothing is not None:
        nearer = 0.5 * last.road.smoothing.max_deviation
        keeps = f": --smooth {nearer:.2g} keeps nearer to the drawn legs" if nearer >= _FINEST_M else ""
        warn(f"smoothing turned the end of the last leg by {askew:.1f} degrees{keeps}", quiet=quiet)
    if not output.json and not quiet:
        _print_legs(summary, directory)
    if driven.past:  # the plan is not the first one, along the drawn lines
        told = []
        for at, (by, leg) in enumerate(zip(driven.past, summary["legs"], strict=False), start=1):
            aside, turned = abs(leg["off_line_end_m"]), abs(leg["off_line_end_deg"])
            along = f"{abs(by):.2f} m {'past' if by >= 0.0 else 'short of'}"
            told.append(f"cusp {at} is {along}, {aside:.2f} m beside and {turned:.0f} degrees off")
        note(f"the drawn cusps lack room: planned again, {'; '.join(told)} the drawn one", quiet=quiet)
    if driven.fits is not False:
        return ExitCode.OK
    note("no proof is looked for on legs", quiet=quiet)
    report_error(without_word(driven.text, NO), "summary.json lists what each leg breaks")
    return ExitCode.BROKEN


def _print_legs(summary: dict[str, Any], directory: Path) -> None:
    from hdvplan.report.grid import grid

    columns = ("leg", "direction", "length [m]", "line moved by [m]", "answer", "to spare [m]", "at s [m]", "what decides", _ENDS)
    rows = []
    for leg in summary["legs"]:
        verdict = leg["verdict"]
        word = verdict["word"] if leg["jackknife"] is None else NO
        spare = "-" if verdict["spare_m"] is None else f"{room_number(verdict['spare_m'], fits=word != NO):.2f}"
        ends = ", ".join(f"{round(angle, 1) + 0.0:+.1f}" for angle in leg["articulation_end_deg"]) or "-"
        place = (f"{verdict['s_m']:z.1f}", f"{verdict['part']} of the {verdict['unit']}")
        moved = "-" if leg["smoothing"] is None else f"{leg['smoothing']['max_deviation_m']:.2f}"
        rows.append((str(leg["leg"]), leg["direction"], f"{leg['length_m']:.1f}", moved, word, spare, *place, ends))
    title = f"{summary['vehicle']} on {summary['road']}"
    print_tables(grid(title, columns, rows, text=(columns[1], columns[4], columns[7]), caption=f"written to {directory}/"))
