"""``hdvplan judge``: judge a path of one's own as ``hdvplan plan`` judges its plans."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from hdvplan.cli.checks import check_fits, smoothed, vehicle_named
from hdvplan.cli.console import ExitCode, note, progress, report_error, warn, writing
from hdvplan.cli.help import LOOP, OUTPUT, PLANNING, ROAD, VEHICLE
from hdvplan.cli.options import OptionsOf, Output, RoadArgument, Room, VehicleOption, check_folder, file_name, with_settings
from hdvplan.cli.outcome import looked_again, tell, write
from hdvplan.errors import OptionError, RoadError
from hdvplan.loop import LoopSettings
from hdvplan.planning.settings import PlannerSettings, PlanOptions
from hdvplan.road.options import RoadOptions

_APART = 0.1  # between a path's articulations and the vehicle's, from which on they are not rounding [rad]
_JUDGED = ("clearance", "tracking_error", "tracking_length")


@with_settings
def judge(
    path: Annotated[
        Path,
        typer.Argument(
            metavar="PATH.csv",
            help="The path: columns x, y or lon, lat and, if known, heading, beta1, ...; or a GPX, KML, GeoJSON line.",
        ),
    ],
    road: RoadArgument,
    vehicle: VehicleOption,
    *,
    room: Annotated[Room, OptionsOf(Room, VEHICLE)],
    reading: Annotated[RoadOptions, OptionsOf(RoadOptions, ROAD)],
    settings: Annotated[PlannerSettings, OptionsOf(PlannerSettings, VEHICLE, only=_JUDGED)],
    options: Annotated[PlanOptions, OptionsOf(PlanOptions, PLANNING, only=("proof",))],
    loop: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Follow the path in a closed loop, too, and judge what is driven: driver, pure-pursuit, stanley, or your own: "
            "package.module:name, file.py:name.",
            rich_help_panel=LOOP,
        ),
    ] = None,
    looping: Annotated[dict[str, Any], OptionsOf(LoopSettings, LOOP, given=True)],
    output: Annotated[Output, OptionsOf(Output, OUTPUT)],
) -> int:
    """Judge a path of your own, of whatever planner, in the street of a road.

    The middle of the lead unit's rear axle follows PATH.csv exactly; its trailers are simulated. x and y are in the plane of the road's
    path, as in the path.csv of `hdvplan plan`, headings in radians, counter-clockwise from x. beta1 is the lead unit's heading less the
    first trailer's. Columns in degrees are called heading_deg, beta1_deg. Of a planned path give a point every 0.5 to 1 m, of a
    recorded track one every 5 to 10 m: it scatters, and no answer is better than its error.

    Prints and writes what `hdvplan plan` does. Over each metre the path may turn more tightly than the vehicle by 1 % and 0.002 1/m, which
    rounded points do.

    With --loop a simulated driver or controller follows PATH.csv, with delay, noise and gain errors; loop.csv has a row for each run,
    loop_worst.csv is the path of the run with the least room.

    Exit code 0: the path keeps all limits (to 1 cm), or the road has none. 1: it breaks one, or may with the --tracking-error or in the
    --loop, or the vehicle cannot steer it. 2: bad input.
    """
    reaches, quiet = room.reaches(), output.quiet
    if looping and loop is None:
        msg = f"--{next(iter(looping)).replace('_', '-')} is of a closed loop, and none was asked for"
        raise OptionError(msg, hint="add --loop driver")
    driving = LoopSettings(**looping)
    output.drawn_on()  # a sheet or a format that cannot be is told before anything is read
    output.kinds()
    check_folder(output.out)
    from hdvplan.road.load import find_road

    driven = vehicle_named(vehicle, quiet=quiet)
    found = find_road(road, reading.followed_by(driven.max_curvature), limited=reaches is not None)
    if found.line is not None and found.line.long:
        msg = f"{found.line.name} is too long to be judged as one road"
        raise RoadError(msg, hint="judge along a shorter part of it")
    from hdvplan import api
    from hdvplan.case import Case
    from hdvplan.driving.given import read_given_path
    from hdvplan.fileio import csv_bytes, write_atomically
    from hdvplan.loop.closed import closed_loop, loop_json
    from hdvplan.loop.track import follower_named
    from hdvplan.report.files import write_plan

    if loop is not None:
        follower_named(loop)  # a mistake is told before the path is followed
    try:
        given = read_given_path(path, driven, None if found.line is None else found.line.raw.to_lonlat)
    except OSError as error:
        msg = f"{path} cannot be read: {error.strerror or 'there is no such file'}"
        raise RoadError(msg) from error
    for text in given.notes:
        note(text, quiet=quiet)
    track = smoothed(found, road, reaches, quiet=quiet)
    check_fits(driven, reaches, track)
    with progress(f"following {path.name} along {track.name}", quiet=quiet):
        case = Case(track, driven, settings=settings)
        along = api.follow(case, given)
        result = api.given_result(case, given, along)
    for text in along.drive.road.notes[len(track.notes) :]:
        note(text, quiet=quiet)
    if along.apart is not None:
        note(f"articulations come within {along.apart:.4f} rad of those in {path.name}", quiet=quiet)
        if along.apart > _APART:
            warn("that is far: is their unit or sign another? beta1 is the lead unit's heading less the trailer's [rad]", quiet=quiet)
    result = looked_again(result, proof=options.proof, refine=False, quiet=quiet)
    directory = output.out or Path(f"{file_name(path.stem)}.{file_name(track.name)}.{file_name(driven.name)}")
    runs = looped = None
    if loop is not None:
        with progress("driving in a closed loop", quiet=quiet):
            runs = closed_loop(result, loop, driving)
        looped = {"follower": loop} | loop_json(runs)
    write(partial(write_plan, result, loop=looped), directory, output)
    if runs is not None:
        with writing(f"to {directory}"):
            write_atomically(directory / "loop.csv", csv_bytes(runs.frame))
            write_atomically(directory / "loop_worst.csv", csv_bytes(runs.driven.frame(runs.worst)))
    code = tell(result, directory, output, looped)
    if runs is None or runs.fits is not False:
        return code
    drawn = f"`hdvplan judge {directory}/loop_worst.csv ...` draws the worst one"
    report_error(
        f"{len(runs.results) - runs.kept} of {len(runs.results)} runs of the closed loop do not keep the street",
        f"loop.csv has all runs; {'loop_worst.csv is where the worst one was' if runs.results[runs.worst - 1] is None else drawn}",
    )
    return ExitCode.BROKEN
