"""Manoeuvres of forward and backward legs, as ``turn`` and ``need`` make, write and print them."""

from __future__ import annotations

from pathlib import Path

from hdvplan.cli.checks import vehicle_named
from hdvplan.cli.console import ExitCode, print_json, print_line, print_tables, progress, report_error, writing
from hdvplan.cli.options import Output, file_name
from hdvplan.turning.reversing.options import PlaceOptions, Template

STARTS = 4  # of every search in ``turn``
MORE_STARTS = 9  # in ``need``, which says how far they are apart


def answered(template: Template, vehicle: str, place: PlaceOptions, output: Output, *, starts: int, called: str) -> ExitCode:
    """Make a manoeuvre, write it into files ``called`` so, print it, and return the exit code; ``need`` tries all numbers of legs."""
    from hdvplan.report.files import PICTURES
    from hdvplan.report.reversals import reversal_json, reversal_tables, write_reversal
    from hdvplan.report.turns import TURN_DRAWINGS
    from hdvplan.turning.reversing.answer import reversing
    from hdvplan.turning.reversing.words import details, refusal, verdict

    kinds = output.kinds(PICTURES, TURN_DRAWINGS)
    driven = vehicle_named(vehicle, quiet=output.quiet)
    with progress(f"looking for a manoeuvre of {driven.name}", quiet=output.quiet):
        answer = reversing(driven, template, place, starts=starts, all_legs=called == "need")
    suffix = ".need" if called == "need" else ""
    directory = output.out or Path(f"{file_name(f'{template}.{driven.name}')}{suffix}")
    with writing(f"to {directory}"):
        write_reversal(answer, directory, called, kinds=kinds)
    if output.json:
        print_json(reversal_json(answer))
    elif not output.quiet:
        print_line(verdict(answer))
        print_line(details(answer))
        print_tables(*reversal_tables(answer, f"{directory}/"))
    if answer.fits is False:
        report_error(refusal(answer))
        return ExitCode.BROKEN
    return ExitCode.OK
