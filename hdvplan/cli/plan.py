"""``hdvplan plan``: plan one vehicle along one road, judge it, write it down."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hdvplan.cli import completion
from hdvplan.cli.checks import (
    check_bias,
    check_fits,
    check_folder,
    check_room,
    reaches_of,
    sheet_options,
    vehicle_named,
    warn_far_regions,
)
from hdvplan.cli.console import note, print_json, print_line, progress, writing
from hdvplan.cli.help import OUTPUT, PLANNING, VEHICLE
from hdvplan.cli.lengthy import plan_long, refuse_on_long
from hdvplan.cli.options import (
    ClearanceOption,
    FormatsOption,
    HalfWidthOption,
    JsonOption,
    ObjectiveOption,
    OutOption,
    QuietOption,
    RoadArgument,
    VehicleOption,
    choice,
    drawn_formats,
    file_name,
)
from hdvplan.cli.outcome import exit_code_of, looked_again, print_plan, warn_of
from hdvplan.cli.reading import AS_SAID, Reading, reads_road

if TYPE_CHECKING:
    from collections.abc import Callable

    from hdvplan.judging.result import Result
    from hdvplan.report.paper import SheetOptions
    from hdvplan.road.road import Road

_NEAR_M = 0.05  # room to spare below which people ask whether more can be had


@reads_road
def plan(
    road: RoadArgument,
    vehicle: VehicleOption,
    half_width: HalfWidthOption = None,
    left: Annotated[
        float | None,
        typer.Option("--left", metavar="M", help="Limit at M to the left of the line [m]; needs --right.", rich_help_panel=VEHICLE),
    ] = None,
    right: Annotated[
        float | None,
        typer.Option(
            "--right",
            metavar="M",
            help="Limit at M to the right of the line, a positive number [m]; needs --left.",
            rich_help_panel=VEHICLE,
        ),
    ] = None,
    clearance: ClearanceOption = 0.0,
    pass_: Annotated[
        str | None,
        typer.Option(
            "--pass",
            metavar="left|right",
            help="Pass all obstacles on the line on this side, seen in the direction of travel [default: the better side].",
            rich_help_panel=VEHICLE,
        ),
    ] = None,
    reading: Reading = AS_SAID,
    scheme: Annotated[
        str,
        typer.Option(
            "--scheme",
            metavar="rti|sqp",
            help="rti: the real-time iteration, one quadratic program (QP) a step; sqp: QPs to convergence.",
            autocompletion=completion.schemes,
            rich_help_panel=PLANNING,
        ),
    ] = "rti",
    solver: Annotated[
        str | None,
        typer.Option(
            "--solver",
            metavar="NAME",
            help="A name from `hdvplan solvers`, or your own: package.module:Class, file.py:Class [default: riccati].",
            autocompletion=completion.solvers,
            rich_help_panel=PLANNING,
        ),
    ] = None,
    objective: ObjectiveOption = "geometric",
    bias: Annotated[
        str | None,
        typer.Option(
            "--bias",
            metavar="M|FILE.csv|centre",
            help="Where the middle of the swept area should lie [m], left positive: a number, a file with columns s,bias, "
            "or half-way between the limits.",
            rich_help_panel=PLANNING,
        ),
    ] = None,
    horizon: Annotated[
        float, typer.Option("--horizon", metavar="M", help="How far each plan looks ahead [m].", rich_help_panel=PLANNING)
    ] = 100.0,
    step: Annotated[float, typer.Option("--step", metavar="M", help="Distance between stations [m].", rich_help_panel=PLANNING)] = 0.5,
    replan: Annotated[
        float, typer.Option("--replan", metavar="M", help="Distance driven before the next plan [m].", rich_help_panel=PLANNING)
    ] = 5.0,
    smoothness: Annotated[
        float,
        typer.Option(
            "--curvature-weight",
            "--smoothness",
            metavar="W",
            help="Weight of curvature changes in the objective: more makes the steering gentler. The road's line is smoothed by --smooth.",
            rich_help_panel=PLANNING,
        ),
    ] = 1e3,
    discretisation: Annotated[
        str,
        typer.Option(
            "--discretisation", metavar="midpoint|euler|gauss", help="Rule by which states are predicted.", rich_help_panel=PLANNING
        ),
    ] = "midpoint",
    proof: Annotated[
        bool,
        typer.Option(
            "--proof/--no-proof",
            help="If the plan breaks limits, look for a proof that no plan keeps them.",
            rich_help_panel=PLANNING,
        ),
    ] = True,
    refine: Annotated[
        bool,
        typer.Option(
            "--refine/--no-refine",
            help="If the plan breaks limits, plan again so that less is lacking.",
            rich_help_panel=PLANNING,
        ),
    ] = True,
    out: OutOption = None,
    json: JsonOption = False,
    plot: Annotated[bool, typer.Option("--plot/--no-plot", help="Draw the picture plan.png.", rich_help_panel=OUTPUT)] = True,
    formats: FormatsOption = "png",
    sheet: Annotated[
        str | None,
        typer.Option("--sheet", metavar="a4|a3|...", help="Draw sheet.pdf at a round scale; up to a0.", rich_help_panel=OUTPUT),
    ] = None,
    scale: Annotated[
        str | None,
        typer.Option("--scale", metavar="N", help="Scale of the sheet: 200 draws 1:200 [default: what fits].", rich_help_panel=OUTPUT),
    ] = None,
    animate: Annotated[bool, typer.Option("--animate", help="Write drive.gif, a film of the drive.", rich_help_panel=OUTPUT)] = False,
    quiet: QuietOption = False,
) -> int:
    """Plan a vehicle along a road and write what it sweeps.

    Plans in receding horizon along the whole road, simulates the plan exactly and judges the simulation. The first line is the verdict:
    YES, NO or, on a road without limits, NEEDS. DIR receives summary.json, tables as CSV, swept.geojson for a map, and the picture.

    Exit code 0: the driven path keeps all limits (to 1 cm), or the road has none. 1: it breaks one, or no plan exists. 2: bad input.
    """
    reaches = reaches_of(half_width, left, right)
    drawn_on = sheet_options(sheet, scale)
    check_folder(out)
    from hdvplan.planning.objective_names import check_objective
    from hdvplan.road.load import REFERENCE_SLACK, find_road
    from hdvplan.solvers.registry import DEFAULT, check_solver

    check_solver(solver or DEFAULT)
    check_objective(objective)
    driven = vehicle_named(vehicle, quiet=quiet)
    found = find_road(road, reading.options(REFERENCE_SLACK * driven.max_curvature))  # mistakes are told before more is loaded
    from hdvplan import api
    from hdvplan.case import Case
    from hdvplan.judging.verdict import verdict_line, verdict_of
    from hdvplan.planning.bias import CENTRE, NONE, bias_named
    from hdvplan.planning.settings import Discretisation, PlannerSettings, Scheme
    from hdvplan.report.files import DRAWINGS, PICTURES
    from hdvplan.road.regions import Side

    kinds = drawn_formats(formats, PICTURES, DRAWINGS, plot=plot)
    side = None if pass_ is None else Side(choice("--pass", pass_, list(Side)))
    settings = PlannerSettings(
        scheme=Scheme(choice("--scheme", scheme, list(Scheme))),
        horizon=horizon,
        step=step,
        replan=replan,
        smoothness=smoothness,
        clearance=clearance,
        discretisation=Discretisation(choice("--discretisation", discretisation, list(Discretisation))),
    )

    def case_of(track: Road) -> Case:
        track = track if reaches is None else track.with_limits(*reaches)
        track = track if side is None else track.passed_on(side)
        return Case(track, driven, objective, solver or DEFAULT, settings)

    if found.line is not None and found.line.long:
        dropped = {"--sheet": sheet is not None, "--animate": animate, "--bias centre": bias == CENTRE}
        refuse_on_long(found.line, dropped | {"--format dxf,gpkg": bool({*kinds} & {*DRAWINGS})})
        check_room(driven, reaches)
        along = NONE if bias is None else bias_named(bias, None)
        if bias is not None:
            check_bias(along, bias)
        folder = out or Path(f"{file_name(found.line.name)}.{file_name(driven.name)}")
        return plan_long(
            found, found.line, driven, settings, lambda part: replace(case_of(part), bias=along), folder, json=json, quiet=quiet
        )
    with progress(f"smoothing {road}", quiet=quiet):
        case = case_of(found())
    track = case.road
    for remark in track.notes:
        note(remark, quiet=quiet)
    check_fits(track, driven, reaches)
    warn_far_regions(track, quiet=quiet)
    with progress(f"planning {driven.name} along {track.name}", quiet=quiet) as on_progress:
        if bias is not None:
            case = api.biased(case, bias)
            check_bias(case.bias, bias)
        result = api.plan(case, on_progress=on_progress)
    result = looked_again(result, proof=proof, refine=refine, quiet=quiet)
    directory = out or Path(f"{file_name(track.name)}.{file_name(driven.name)}")
    with progress(f"writing {directory}/", quiet=quiet) as on_progress:
        _write(result, directory, kinds, drawn_on, animate, on_progress)
    from hdvplan.report.summary import summary_of

    verdict = verdict_of(result)
    if json:
        print_json(summary_of(result))
    elif not quiet:
        print_line(verdict_line(result, verdict))
    if verdict.fits and verdict.spare is not None and verdict.spare < _NEAR_M:
        note("the plan comes as near as limits allow; --clearance M keeps it away from them", quiet=quiet)
    warn_of(result, verdict, quiet=quiet)
    if not json and not quiet:
        print_plan(result, directory)
    return exit_code_of(result, verdict)


def _write(
    result: Result, directory: Path, kinds: list[str], sheet: SheetOptions | None, animate: bool, on_progress: Callable[[float], None]
) -> None:
    from hdvplan.report.files import DRAWINGS, write_plan

    pictures, drawings = ([kind for kind in kinds if (kind in DRAWINGS) == drawn] for drawn in (False, True))
    with writing(f"to {directory}"):
        write_plan(result, directory, pictures=pictures, drawings=drawings, sheet=sheet, animate=animate, on_progress=on_progress)
