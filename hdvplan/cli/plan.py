"""``hdvplan plan``: plan one vehicle along one road, judge it, write it down."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from hdvplan.cli.checks import check_bias, check_fits, check_room, vehicle_named, warn_far_regions
from hdvplan.cli.console import note, progress
from hdvplan.cli.help import OUTPUT, PLANNING, ROAD, VEHICLE
from hdvplan.cli.lengthy import plan_long, refuse_on_long
from hdvplan.cli.options import Output, RoadArgument, Room, VehicleOption, check_folder, file_name
from hdvplan.cli.outcome import exit_code_of, looked_again, tell, write
from hdvplan.cli.settings import OptionsOf, with_settings
from hdvplan.planning.settings import PlannerSettings, PlanOptions
from hdvplan.road.options import RoadOptions

if TYPE_CHECKING:
    from hdvplan.road.road import Road


@with_settings
def plan(
    road: RoadArgument,
    vehicle: VehicleOption,
    *,
    room: Annotated[Room, OptionsOf(Room, VEHICLE)],
    reading: Annotated[RoadOptions, OptionsOf(RoadOptions, ROAD)],
    settings: Annotated[PlannerSettings, OptionsOf(PlannerSettings, PLANNING, {"clearance": VEHICLE})],
    options: Annotated[PlanOptions, OptionsOf(PlanOptions, PLANNING, {"side": VEHICLE})],
    output: Annotated[Output, OptionsOf(Output, OUTPUT)],
) -> int:
    """Plan a vehicle along a road and write what it sweeps.

    Plans in receding horizon along the whole road, simulates the plan exactly and judges the simulation. The first line is the verdict:
    YES, NO or, on a road without limits, NEEDS. DIR receives summary.json, tables as CSV, swept.geojson for a map, and the picture.

    Exit code 0: the driven path keeps all limits (to 1 cm), or the road has none. 1: it breaks one, or may with the
    --tracking-error, or no plan exists. 2: bad input.
    """
    reaches, bias, quiet = room.reaches(), options.bias, output.quiet
    drawn_on = output.drawn_on()
    check_folder(output.out)
    from hdvplan.planning.objective_names import check_objective
    from hdvplan.solvers.registry import DEFAULT, check_solver

    check_solver(options.solver or DEFAULT)
    check_objective(options.objective)
    driven = vehicle_named(vehicle, quiet=quiet)
    from hdvplan.road.load import find_road

    found = find_road(road, reading.followed_by(driven.max_curvature))  # mistakes are told before more is loaded
    from hdvplan import api
    from hdvplan.case import Case
    from hdvplan.planning.bias import CENTRE, NONE, bias_named
    from hdvplan.report.files import DRAWINGS, PICTURES
    from hdvplan.road.regions import Side

    kinds = output.kinds(PICTURES, DRAWINGS)

    def case_of(track: Road) -> Case:
        track = track if reaches is None else track.with_limits(*reaches)
        track = track if options.side is None else track.passed_on(Side(options.side))
        return Case(track, driven, options.objective, options.solver or DEFAULT, settings)

    if found.line is not None and found.line.long:
        dropped = {"--sheet": output.sheet is not None, "--animate": output.animate, "--bias centre": bias == CENTRE}
        dropped |= {"--tracking-error": settings.tracking_error > 0.0, "--format dxf,gpkg": bool({*kinds} & {*DRAWINGS})}
        refuse_on_long(found.line, dropped)
        check_room(driven, reaches)
        along = NONE if bias is None else bias_named(bias, None)
        if bias is not None:
            check_bias(along, bias)
        folder = output.out or Path(f"{file_name(found.line.name)}.{file_name(driven.name)}")
        return plan_long(
            found, found.line, driven, settings, lambda part: replace(case_of(part), bias=along), folder, json=output.json, quiet=quiet
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
    result = looked_again(result, proof=options.proof, refine=options.refine, quiet=quiet)
    directory = output.out or Path(f"{file_name(track.name)}.{file_name(driven.name)}")
    write(result, directory, kinds, drawn_on, animate=output.animate, quiet=quiet)
    verdict = tell(result, directory, as_json=output.json, quiet=quiet)
    return exit_code_of(result, verdict)
