"""``hdvplan plan``: plan one vehicle along one road, judge it, write it down."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hdvplan.cli import completion
from hdvplan.cli.compiling import note_compiling
from hdvplan.cli.console import note, print_json, print_line, progress
from hdvplan.cli.lengthy import plan_long, refuse_on_long
from hdvplan.cli.options import (
    CrsOption,
    FeatureOption,
    JsonOption,
    LaneOption,
    LayerOption,
    OffsetOption,
    OutOption,
    QuietOption,
    ReverseOption,
    RoadArgument,
    RoadIdsOption,
    RoleOption,
    SmoothOption,
    choice,
    file_name,
    road_options,
)
from hdvplan.cli.outcome import exit_code_of, looked_again, print_plan, warn_far_regions, warn_of
from hdvplan.errors import OptionError, RoadError

if TYPE_CHECKING:
    from collections.abc import Callable

    from hdvplan.case import Case
    from hdvplan.judging.result import Result
    from hdvplan.report.paper import SheetOptions
    from hdvplan.road.road import Road
    from hdvplan.vehicle.model import Vehicle

_NEAR_M = 0.05  # room to spare below which people ask whether more can be had


def plan(
    road: RoadArgument,
    vehicle: Annotated[
        str, typer.Option("--vehicle", metavar="NAME|FILE.toml", help="A preset or a vehicle file.", autocompletion=completion.vehicles)
    ],
    scheme: Annotated[
        str,
        typer.Option("--scheme", metavar="rti|sqp", help="One QP a step, or QPs to convergence.", autocompletion=completion.schemes),
    ] = "rti",
    solver: Annotated[
        str | None,
        typer.Option(
            "--solver",
            metavar="NAME",
            help="A name from `hdvplan solvers`, or your own: package.module:Class, file.py:Class.",
            autocompletion=completion.solvers,
        ),
    ] = None,
    objective: Annotated[
        str,
        typer.Option(
            "--objective",
            metavar="NAME",
            help="geometric, balanced, geometric-fixed, lead-axle, trail-axle, art-weighted, art-weighted:0.45, axle-max, body-max, "
            "one that an installed package offers, or your own: package.module:name, file.py:name.",
            autocompletion=completion.objectives,
        ),
    ] = "geometric",
    bias: Annotated[
        str | None,
        typer.Option(
            "--bias",
            metavar="M|FILE.csv|centre",
            help="Where the middle of the swept area should lie [m], left positive: a number, a file with columns s,bias, "
            "or half-way between the limits.",
        ),
    ] = None,
    half_width: Annotated[float | None, typer.Option("--half-width", metavar="M", help="Limits at +-M [m].")] = None,
    left: Annotated[float | None, typer.Option("--left", metavar="M", help="Left limit [m]; needs --right.")] = None,
    right: Annotated[float | None, typer.Option("--right", metavar="M", help="Right limit, positive [m]; needs --left.")] = None,
    clearance: Annotated[float, typer.Option("--clearance", metavar="M", help="Room to keep from every limit and obstacle [m].")] = 0.0,
    pass_: Annotated[
        str | None,
        typer.Option(
            "--pass",
            metavar="left|right",
            help="Pass all obstacles on the line on this side, as the vehicle drives; without it the better one is found.",
        ),
    ] = None,
    horizon: Annotated[float, typer.Option("--horizon", metavar="M", help="How far each plan looks ahead [m].")] = 100.0,
    step: Annotated[float, typer.Option("--step", metavar="M", help="Distance between stations [m].")] = 0.5,
    replan: Annotated[float, typer.Option("--replan", metavar="M", help="Distance driven before the next plan [m].")] = 5.0,
    smoothness: Annotated[float, typer.Option("--smoothness", metavar="W", help="Weight of curvature changes.")] = 1e3,
    discretisation: Annotated[
        str, typer.Option("--discretisation", metavar="midpoint|euler|gauss", help="How states are predicted.")
    ] = "midpoint",
    smooth: SmoothOption = None,
    crs: CrsOption = None,
    name: FeatureOption = None,
    layer: LayerOption = None,
    role: RoleOption = None,
    road_ids: RoadIdsOption = None,
    lane: LaneOption = None,
    offset: OffsetOption = 0.0,
    reverse: ReverseOption = False,
    out: OutOption = None,
    json: JsonOption = False,
    plot: Annotated[bool, typer.Option("--plot/--no-plot", help="Draw the picture plan.png.")] = True,
    formats: Annotated[
        str, typer.Option("--format", metavar="A,B", help="png, pdf, svg: the picture; dxf, gpkg: layers for CAD and GIS.")
    ] = "png",
    sheet: Annotated[str | None, typer.Option("--sheet", metavar="a4|a3|...", help="Draw sheet.pdf to a round scale, up to a0.")] = None,
    scale: Annotated[str | None, typer.Option("--scale", metavar="N", help="Of the sheet: 200 draws 1:200 [default: what fits].")] = None,
    proof: Annotated[
        bool, typer.Option("--proof/--no-proof", help="Where the plan breaks limits, look for a proof that nothing keeps them.")
    ] = True,
    refine: Annotated[
        bool, typer.Option("--refine/--no-refine", help="Where limits are broken by little, plan again with stations nearer together.")
    ] = True,
    animate: Annotated[bool, typer.Option("--animate", help="Write drive.gif, a film of the drive.")] = False,
    quiet: QuietOption = False,
) -> int:
    """Plan a vehicle along a road and write what it sweeps.

    Plans in receding horizon along the whole road; what is judged and written is an accurate simulation of the plan.

    Exit code 0: the driven path keeps all limits (to 1 cm). 1: it breaks one, or no plan exists. 2: bad input.
    """
    reaches = reaches_of(half_width, left, right)
    drawn_on = sheet_options(sheet, scale)
    if out is not None and out.exists() and not out.is_dir():
        msg = f"--out {out} is a file, not a folder"
        raise OptionError(msg)
    from hdvplan.planning.objective_names import check_objective
    from hdvplan.road.load import REFERENCE_SLACK, find_road
    from hdvplan.solvers.registry import DEFAULT, check_solver
    from hdvplan.vehicle.load import load_vehicle

    check_solver(solver or DEFAULT)
    check_objective(objective)
    driven = load_vehicle(vehicle)
    wanted = road_options(
        smooth, crs, name, REFERENCE_SLACK * driven.max_curvature, offset=offset, reverse=reverse, layer=layer, roles=role,
        road_ids=road_ids, lane=lane,
    )  # fmt: skip
    found = find_road(road, wanted)  # what the files have wrong is said before more is loaded
    from hdvplan import api
    from hdvplan.case import Case
    from hdvplan.judging.verdict import verdict_line, verdict_of
    from hdvplan.passing.sides import choose_sides
    from hdvplan.planning.bias import CENTRE, NONE, bias_named
    from hdvplan.planning.discretisation import Discretisation
    from hdvplan.planning.settings import PlannerSettings, Scheme
    from hdvplan.report.files import DRAWINGS, PICTURES
    from hdvplan.road.regions import Side

    kinds = [choice("--format", kind.strip(), (*PICTURES, *DRAWINGS)) for kind in formats.split(",")]
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
    note_compiling(quiet=quiet)

    def case_of(track: Road) -> Case:
        track = track if reaches is None else track.with_limits(*reaches)
        track = track if side is None else track.passed_on(side)
        return Case(track, driven, objective, solver or DEFAULT, settings)

    if found.line is not None and found.line.long:
        dropped = {"--sheet": sheet is not None, "--animate": animate, "--bias centre": bias == CENTRE}
        refuse_on_long(found.line, dropped | {"--format dxf,gpkg": bool({*kinds} & {*DRAWINGS})})
        from hdvplan.stretches.cutting import reach_of

        along = NONE if bias is None else bias_named(bias, None)
        folder = out or Path(f"{file_name(found.line.name)}.{file_name(driven.name)}")
        cases, reach = (lambda track: replace(case_of(track), bias=along)), reach_of(driven, settings)
        return plan_long(found.line, driven, cases, reach, folder, json=json, quiet=quiet)
    with progress(f"smoothing {road}", quiet=quiet):
        case = case_of(found())
    track = case.road
    for remark in track.notes:
        note(remark, quiet=quiet)
    check_fits(track, driven, reaches)
    warn_far_regions(track, quiet=quiet)
    with progress(f"planning {driven.name} along {track.name}", quiet=quiet) as on_progress:
        if bias is not None:
            sided = choose_sides(case)[0] if bias == CENTRE else track  # the middle between limits is that of the sides found
            case = replace(case, bias=bias_named(bias, sided.limits))
            _check_bias(case, bias)
        result = api.plan(case, on_progress=on_progress)
    result = looked_again(result, proof=proof, refine=refine, quiet=quiet)
    directory = out or Path(f"{file_name(track.name)}.{file_name(driven.name)}")
    with progress(f"writing {directory}/", quiet=quiet) as on_progress:
        _write(result, directory, [kind for kind in kinds if plot or kind in DRAWINGS], drawn_on, animate, on_progress)
    from hdvplan.report.summary import summary_of

    verdict = verdict_of(result)
    if json:
        print_json(summary_of(result))
    elif not quiet:
        print_line(verdict_line(result, verdict))
    if verdict.fits and verdict.spare is not None and verdict.spare < _NEAR_M:
        note("the plan goes as near as it may; --clearance M asks it to keep away", quiet=quiet)
    warn_of(result, verdict, quiet=quiet)
    if not json and not quiet:
        print_plan(result, directory)
    return exit_code_of(result, verdict)


def check_fits(road: Road, vehicle: Vehicle, reaches: tuple[float, float] | None) -> None:
    """Refuse what makes planning ``vehicle`` pointless; ``reaches`` are the limits left and right that options gave [m].

    Raises:
        RoadError: the road is shorter than the vehicle.
        OptionError: the options leave less room than the vehicle is wide.

    """
    length = vehicle.reach_ahead + vehicle.reach_behind
    if road.path.length < length:
        msg = f"the road is {road.path.length:.1f} m long, the {vehicle.name} {length:.1f} m"
        raise RoadError(msg, hint="plan along a longer part of the road")
    if reaches is not None and sum(reaches) < vehicle.width:
        msg = f"limits are {sum(reaches):.2f} m apart; the {vehicle.name} is {vehicle.width:.2f} m wide"
        raise OptionError(msg, hint="widen them with --half-width or --left and --right")


def _check_bias(case: Case, given: str) -> None:
    """Refuse a bias that leads off any road: nothing could be seen there.

    Raises:
        OptionError: it is larger than any road is wide.

    """
    from hdvplan.road.regions import OPEN_M

    largest = float(abs(case.bias.offset).max())
    if largest > OPEN_M:
        msg = f"--bias {given} leads {largest:g} m off the road's centre; at most {OPEN_M:g} m can be asked for"
        raise OptionError(msg)


def reaches_of(half_width: float | None, left: float | None, right: float | None) -> tuple[float, float] | None:
    """Return the limits given as options, left and right, or None."""
    if half_width is not None:
        if left is not None or right is not None:
            msg = "--half-width sets both limits; it cannot be combined with --left and --right"
            raise OptionError(msg)
        return half_width, half_width
    if left is None and right is None:
        return None
    if left is None or right is None:
        given, missing = ("--left", "--right") if right is None else ("--right", "--left")
        msg = f"{given} needs {missing}"
        raise OptionError(msg, hint="or give --half-width for both")
    return left, right


def sheet_options(sheet: str | None, scale: str | None) -> SheetOptions | None:
    """Return what the sheet is drawn on, or None without one.

    Raises:
        OptionError: no such paper or scale, or a scale without a sheet.

    """
    from hdvplan.report.paper import SheetOptions

    if sheet is None:
        if scale is not None:
            msg = f"--scale {scale} needs a sheet"
            raise OptionError(msg, hint="add --sheet a3")
        return None
    return SheetOptions.named(sheet, scale)


def _write(
    result: Result, directory: Path, kinds: list[str], sheet: SheetOptions | None, animate: bool, on_progress: Callable[[float], None]
) -> None:
    from hdvplan.report.files import DRAWINGS, write_plan

    pictures, drawings = ([kind for kind in kinds if (kind in DRAWINGS) == drawn] for drawn in (False, True))
    try:
        write_plan(result, directory, pictures=pictures, drawings=drawings, sheet=sheet, animate=animate, on_progress=on_progress)
    except OSError as error:
        msg = f"cannot write to {directory}: {error.strerror or error}"
        raise OptionError(msg, hint="choose another folder with --out") from error
