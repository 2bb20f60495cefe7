"""``hdvplan plan``: plan vehicles along one road, judge them, write them down."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from hdvplan.cli.checks import check_bias, check_fits, meeting_of, number_of, refuse_on, smoothed, vehicles_named
from hdvplan.cli.console import note, progress, warn, writing
from hdvplan.cli.help import OUTPUT, PLANNING, ROAD, VEHICLE
from hdvplan.cli.legs import LAST, LEAD, finish, legs_in
from hdvplan.cli.options import OptionsOf, Output, RoadArgument, Room, VehiclesOption, check_folder, file_name, with_settings
from hdvplan.cli.outcome import cleared, compare, looked_again, plan_long, tell, write
from hdvplan.errors import OptionError
from hdvplan.planning.settings import LARGEST, PlannerSettings, PlanOptions
from hdvplan.report import DRAWINGS
from hdvplan.road.options import RoadOptions
from hdvplan.settings import Setting, fields_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hdvplan.case import Case
    from hdvplan.judging.result import Result
    from hdvplan.road.line import Line
    from hdvplan.road.load import Found
    from hdvplan.road.road import Road
    from hdvplan.vehicle.model import Vehicle


_OTHERS = tuple(name for name in fields_of(PlannerSettings) if name != "clearance")


@dataclass(frozen=True)
class More:
    """What no other command is asked."""

    clearance: Annotated[str, Setting("Room to keep from every limit and obstacle [m]; max: as much as can be kept.", "M|max")] = "0.0"
    leg_line: Annotated[
        str | None,
        Setting("Of several legs: which axle's line those are that are driven backwards [default: lead-axle].", choices=(LEAD, LAST)),
    ] = None
    centreline: Annotated[
        Path | None,
        Setting("Of a Lanelet2 map: write it with the line that the lead rear axle drives as its lanelets' centreline.", "MAP.osm"),
    ] = None


@dataclass(frozen=True)
class _Asked:
    """What is asked of every vehicle."""

    road: str
    reaches: tuple[float, float] | None
    reading: RoadOptions
    settings: PlannerSettings
    options: PlanOptions
    output: Output
    more: More

    @property
    def solver(self) -> str:
        from hdvplan.solvers.registry import DEFAULT

        return self.options.solver or DEFAULT

    def case(self, track: Road, vehicle: Vehicle) -> Case:
        """Return the case of a vehicle on a road, between these limits and by these sides."""
        from hdvplan.case import Case
        from hdvplan.road.meeting import beside_swept
        from hdvplan.road.regions import Side

        track = track if self.reaches is None else track.with_limits(*self.reaches)
        track = track if self.options.beside is None else beside_swept(track, Path(self.options.beside), meeting_of(self.options))
        track = track if self.options.side is None else track.passed_on(Side(self.options.side))
        return Case(track, vehicle, self.options.objective, self.solver, self.settings)


@with_settings
def plan(
    road: RoadArgument,
    vehicle: VehiclesOption,
    *,
    room: Annotated[Room, OptionsOf(Room, VEHICLE)],
    reading: Annotated[RoadOptions, OptionsOf(RoadOptions, ROAD)],
    settings: Annotated[PlannerSettings, OptionsOf(PlannerSettings, PLANNING, only=_OTHERS)],
    options: Annotated[PlanOptions, OptionsOf(PlanOptions, PLANNING, {"side": VEHICLE, "beside": VEHICLE, "meeting": VEHICLE})],
    output: Annotated[Output, OptionsOf(Output, OUTPUT)],
    more: Annotated[More, OptionsOf(More, VEHICLE, {"leg_line": ROAD, "centreline": OUTPUT})],
) -> int:
    """Plan a vehicle along a road and write what it sweeps.

    Plans in receding horizon along the whole road, simulates the plan exactly and judges the simulation. The first line is the verdict:
    YES, NO or, on a road without limits, NEEDS. DIR receives summary.json, tables as CSV, swept.geojson for a map, and the picture. Of
    several vehicles, DIR has a folder for each, compared.csv and compared.png.

    A file of several legs, with directions, is driven forwards and backwards; its tables say which leg.

    Exit code 0: the driven path keeps all limits (to 1 cm), or the road has none. 1: it breaks one, or may with the
    --tracking-error, or no plan exists. 2: bad input.
    """
    if more.clearance != LARGEST:
        settings = replace(settings, clearance=number_of("clearance", more.clearance, f"metres or {LARGEST}"))
    asked = _Asked(road, room.reaches(), reading, settings, options, output, more)
    output.drawn_on()  # a sheet or a format that cannot be is told before anything is read
    output.kinds()
    meeting_of(options)
    check_folder(output.out)
    from hdvplan.planning.settings import check_objective
    from hdvplan.solvers.registry import check_solver

    check_solver(asked.solver)
    check_objective(options.objective)
    driven = vehicles_named(vehicle, quiet=output.quiet)
    from hdvplan.road.meeting import broken_notes

    for text in () if options.beside is None else broken_notes(Path(options.beside)):
        warn(text, quiet=output.quiet)
    if more.centreline is not None:
        _check_centreline(road, [one.name for one in driven])
    return _plan_one(asked, driven[0]) if len(driven) == 1 else _plan_all(asked, driven)


def _found(asked: _Asked, vehicle: Vehicle) -> Found:
    from hdvplan.road.load import find_road

    reading = asked.reading.followed_by(vehicle.max_curvature)
    return find_road(asked.road, reading, limited=asked.reaches is not None)  # mistakes are told before more is loaded


def _plan_one(asked: _Asked, vehicle: Vehicle) -> int:
    from hdvplan.report.files import write_plan

    found, output = _found(asked, vehicle), asked.output
    if found.line is not None and found.line.raw.legs:
        return _plan_legs(asked, found.line, vehicle)
    if asked.more.leg_line is not None:
        msg = f"{asked.road} has no legs, and no use for --leg-line"
        raise OptionError(msg, hint="leave --leg-line out")
    if found.line is not None and found.line.long:
        return _plan_long(asked, found, found.line, vehicle)
    result = _planned(asked, found, vehicle)
    directory = output.out or Path(f"{file_name(result.case.road.name)}.{file_name(vehicle.name)}")
    write(partial(write_plan, result), directory, output)
    if asked.more.centreline is not None:
        _write_centreline(asked, result, asked.more.centreline)
    return tell(result, directory, output)


def _plan_all(asked: _Asked, vehicles: list[Vehicle]) -> int:
    from hdvplan.report.files import write_plan

    output = asked.output
    results: list[Result] = []
    for vehicle in vehicles:
        found = _found(asked, vehicle)
        if found.line is not None:
            refuse_on(found.line, {"--vehicle with several names": bool(found.line.raw.legs) or found.line.long})
        results.append(_planned(asked, found, vehicle, told=results[0].case.road.notes if results else None))
        directory = output.out or Path(f"{file_name(results[0].case.road.name)}.compared")
        write(partial(write_plan, results[-1]), directory / file_name(vehicle.name), output)
    return compare(results, directory, output)


def _check_centreline(road: str, vehicles: list[str]) -> None:
    """Refuse a road that is no Lanelet2 map, and several vehicles, whose lines differ."""
    from hdvplan.road.load_lanelet2 import is_lanelet2

    if len(vehicles) > 1 or not (Path(road).is_file() and is_lanelet2(Path(road))):
        msg = f"--centreline is the line of one vehicle in a Lanelet2 map, not of {', '.join(vehicles)} on {road}"
        raise OptionError(msg, hint="leave --centreline out: path.csv and swept.geojson have the line of any road")


def _write_centreline(asked: _Asked, result: Result, target: Path) -> None:
    import numpy as np
    import shapely

    from hdvplan.fileio import write_atomically
    from hdvplan.report.layers import map_system
    from hdvplan.road.load_lanelet2 import with_centreline

    drive = result.drive
    line = shapely.LineString(np.column_stack(drive.stations.path.to_plane(drive.stations.s[: len(drive.z)], drive.z[:, 0])))
    with writing(f"to {target}"):
        write_atomically(target, with_centreline(Path(asked.road), asked.reading.road_ids, map_system(drive.road).place(line)))
    note(f"the map with the driven line: {target}", quiet=asked.output.quiet)


def _plan_long(asked: _Asked, found: Found, line: Line, vehicle: Vehicle) -> int:
    from hdvplan.planning.bias import CENTRE, NONE, bias_named

    output, bias = asked.output, asked.options.bias
    dropped = {"--sheet": output.sheet is not None, "--animate": output.animate, "--bias centre": bias == CENTRE}
    dropped |= {f"--clearance {LARGEST}": asked.more.clearance == LARGEST, "--beside": asked.options.beside is not None}
    dropped |= {"--centreline": asked.more.centreline is not None}
    dropped |= {"--tracking-error": asked.settings.tracking_error > 0.0, "--format dxf,gpkg": bool({*output.kinds()} & {*DRAWINGS})}
    refuse_on(line, dropped)
    check_fits(vehicle, asked.reaches)
    along = NONE if bias is None else bias_named(bias, None)
    if bias is not None:
        check_bias(along, bias)

    def case_of(part: Road) -> Case:
        return replace(asked.case(part, vehicle), bias=along)

    folder = output.out or Path(f"{file_name(line.name)}.{file_name(vehicle.name)}")
    return plan_long(found, line, vehicle, asked.settings, case_of, folder, output)


def _plan_legs(asked: _Asked, line: Line, vehicle: Vehicle) -> int:
    from hdvplan.legs import plan_legs
    from hdvplan.report.paper import check_scale

    options, output, settings = asked.options, asked.output, asked.settings
    dropped = {
        "--beside": options.beside is not None,
        "--bias": options.bias is not None,
        f"--clearance {LARGEST}": asked.more.clearance == LARGEST,
        "--tracking-error": settings.tracking_error > 0.0,
        "--pass": options.side is not None,
    }
    refuse_on(line, dropped)
    check_fits(vehicle, asked.reaches)
    legs = legs_in(line, vehicle, asked.reaches, last_axle=asked.more.leg_line == LAST, quiet=output.quiet)
    check_scale(output.drawn_on(), [leg.road.path for leg in legs.legs], vehicle, whole=True)
    with progress(f"planning {vehicle.name} along {len(legs.legs)} legs of {legs.name}", quiet=output.quiet) as on_progress:
        driven = plan_legs(
            legs,
            vehicle,
            objective=options.objective,
            solver=asked.solver,
            settings=settings,
            refine=options.refine,
            on_progress=on_progress,
        )
    folder = output.out or Path(f"{file_name(line.name)}.{file_name(vehicle.name)}")
    return finish(driven, folder, output)


def _planned(asked: _Asked, found: Found, vehicle: Vehicle, *, told: Sequence[str] | None = None) -> Result:
    """Return the plan, judged; ``told`` is what was noted of the road for another vehicle, if there was one."""
    from hdvplan import api
    from hdvplan.report.paper import check_scale

    options, quiet = asked.options, asked.output.quiet
    track = smoothed(found, asked.road, told=told, quiet=quiet)
    if options.side is not None and not any(one.on_line and track.regions[one.region].side is None for one in track.passages):
        warn(f"--pass {options.side} has no effect: no obstacle lies on the line, or each has a side of its own", quiet=quiet)
    case = asked.case(track, vehicle)
    check_fits(vehicle, asked.reaches, case.road)
    check_scale(asked.output.drawn_on(), [case.road.path], vehicle, whole=False)
    with progress(f"planning {vehicle.name} along {case.road.name}", quiet=quiet) as on_progress:
        if options.bias is not None:
            case = api.biased(case, options.bias)
            check_bias(case.bias, options.bias)
        result = api.plan(case, on_progress=on_progress)
    result = looked_again(result, proof=options.proof, refine=options.refine, quiet=quiet)
    return cleared(result, quiet=quiet) if asked.more.clearance == LARGEST else result
