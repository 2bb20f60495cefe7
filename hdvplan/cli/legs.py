"""What ``hdvplan plan`` does on a file of several legs: it plans across their cusps, and judges every leg."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from hdvplan.cli.console import ExitCode, note, print_json, print_line, print_tables, progress, report_error, warn, writing
from hdvplan.errors import OptionError

if TYPE_CHECKING:
    from collections.abc import Collection
    from pathlib import Path

    from hdvplan.cli.options import Output
    from hdvplan.judging.legs import LegsResult
    from hdvplan.planning.settings import PlannerSettings
    from hdvplan.road.legs import Legs
    from hdvplan.road.line import Line
    from hdvplan.vehicle.model import Vehicle

LEAD, LAST = "lead-axle", "last-axle"  # whose line a backward leg is


def refuse_on_legs(line: Line, asked: dict[str, bool]) -> None:
    """Refuse options, by their names, that a plan of several legs does not have.

    Raises:
        OptionError: one is asked for.

    """
    name = next((name for name, given in asked.items() if given), None)
    if name is not None:
        msg = f"{name} is not for a drive of several legs, as {line.name} is"
        raise OptionError(msg, hint="leave it out, or choose one line of the file with --name")


def legs_in(line: Line, vehicle: Vehicle, reaches: tuple[float, float] | None, *, last_axle: bool, quiet: bool) -> Legs:
    """Return the legs of a file between the limits that options gave, left and right of each as the vehicle heads [m]; says what was noted.

    Raises:
        RoadError: legs that do not meet, or one that cannot be smoothed.

    """
    from hdvplan.driving.lead_line import lead_line
    from hdvplan.road.load_legs import legs_of

    with progress(f"smoothing {line.name}", quiet=quiet):
        legs = legs_of(line, partial(lead_line, vehicle) if last_axle else None)
    for remark in legs.notes:
        note(remark, quiet=quiet)
    _warn_far(legs, quiet=quiet)
    if reaches is None:
        return legs
    return replace(legs, legs=tuple(replace(leg, road=leg.road.with_limits(*reaches)) for leg in legs.legs))


def planned(
    legs: Legs, vehicle: Vehicle, objective: str, solver: str, settings: PlannerSettings, *, refine: bool, quiet: bool
) -> LegsResult:  # fmt: skip
    """Return the judged plan of all legs."""
    from hdvplan.legs import plan_legs

    with progress(f"planning {vehicle.name} along {len(legs.legs)} legs of {legs.name}", quiet=quiet) as on_progress:
        return plan_legs(legs, vehicle, objective=objective, solver=solver, settings=settings, refine=refine, on_progress=on_progress)


def finish(driven: LegsResult, directory: Path, kinds: Collection[str], output: Output) -> ExitCode:
    """Write the plan into a folder, print its verdict and a row a leg, or its summary as JSON; return the exit code."""
    from hdvplan.judging.result import solver_texts
    from hdvplan.report.files import DRAWINGS
    from hdvplan.report.leg_files import summary_of_legs, write_legs

    as_json, quiet = output.json, output.quiet
    pictures, drawings = ([kind for kind in kinds if (kind in DRAWINGS) == drawn] for drawn in (False, True))
    with progress(f"writing {directory}/", quiet=quiet) as told, writing(f"to {directory}"):
        write_legs(
            driven, directory, pictures=pictures, drawings=drawings, sheet=output.drawn_on(), animate=output.animate, on_progress=told
        )
    summary = summary_of_legs(driven)
    if as_json:
        print_json(summary)
    elif not quiet:
        print_line(driven.text)
        print_line(driven.details)
    for at, result in enumerate(driven.results):
        for text in solver_texts(result):
            warn(f"{driven.called(at)}: {text}", quiet=quiet)
    if not as_json and not quiet:
        _print_legs(summary, directory)
    _note_attempts(driven, quiet=quiet)
    if driven.fits is not False:
        return ExitCode.OK
    note("no proof is looked for on legs", quiet=quiet)
    report_error(driven.text.removeprefix("NO: "), "summary.json lists what each leg breaks")
    return ExitCode.BROKEN


def _note_attempts(driven: LegsResult, *, quiet: bool) -> None:
    """Say where the plan is not the first one, along the drawn lines."""
    if driven.past:
        moved = ", ".join(f"{abs(by):.2f} m {'past' if by >= 0.0 else 'short of'} cusp {at}" for at, by in enumerate(driven.past, start=1))
        note(f"the drawn cusps lack room: planned again, the legs end {moved}", quiet=quiet)


def _print_legs(summary: dict[str, Any], directory: Path) -> None:
    from hdvplan.report.grid import grid

    columns = ("leg", "direction", "length [m]", "answer", "to spare [m]", "at s [m]", "what decides", "articulation at its end [deg]")
    rows = []
    for leg in summary["legs"]:
        verdict = leg["verdict"]
        spare = "-" if verdict["spare_m"] is None else f"{verdict['spare_m']:.3f}"
        word = "NO" if leg["jackknife"] is not None else verdict["text"].partition(":")[0].partition(" ")[0]
        ends = ", ".join(f"{round(angle, 1) + 0.0:+.1f}" for angle in leg["articulation_end_deg"]) or "-"
        place = (f"{verdict['s_m']:.1f}", f"{verdict['part']} of the {verdict['unit']}")
        rows.append((str(leg["leg"]), leg["direction"], f"{leg['length_m']:.1f}", word, spare, *place, ends))
    title = f"{summary['vehicle']} on {summary['road']}"
    print_tables(grid(title, columns, rows, text=(columns[1], columns[3], columns[6]), caption=f"written to {directory}/"))


def _warn_far(legs: Legs, *, quiet: bool) -> None:
    """Say which regions do not count: coordinates that are swapped, or of another system, would go unnoticed."""
    import numpy as np

    from hdvplan.road.regions import OPEN_M, distances

    if not legs.regions:
        return
    apart = np.min([distances(leg.road.path, legs.regions) for leg in legs.legs], axis=0)
    far = int(np.count_nonzero(apart > OPEN_M))
    if far:
        warn(f"{far} of {len(apart)} regions lie further than {OPEN_M:.0f} m from all legs and do not count", quiet=quiet)
