"""``hdvplan need``: the least room that a vehicle needs on a road, and what must change where it does not fit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

from hdvplan.answers import NO, without_word
from hdvplan.cli.checks import check_fits, names_in, smoothed, vehicles_named
from hdvplan.cli.console import ExitCode, print_answer, print_line, progress, report_error, writing
from hdvplan.cli.help import OUTPUT, PLANNING, ROAD, SITE, VEHICLE
from hdvplan.cli.options import WRITTEN, OptionsOf, Output, RoadOrNoneArgument, Room, VehiclesOption, check_folder, file_name, with_settings
from hdvplan.cli.outcome import warn_of_sides
from hdvplan.cli.turn import answered
from hdvplan.errors import OptionError
from hdvplan.planning.settings import SIDES, PlannerSettings
from hdvplan.road.options import RoadOptions
from hdvplan.settings import Setting
from hdvplan.turning.reversing.options import SiteOptions, Template

if TYPE_CHECKING:
    from hdvplan.need.answer import Need
    from hdvplan.road.pieces import Kerb
    from hdvplan.road.road import Road

_FIXED = ("width", "kerb_radius", "beyond", "door_spacing", "overhang")  # what is not sought
_ROOM = {
    "half_width": "The road's own limits, M to either side [m].",
    "left": "The road's own left limit, or the fixed one [m].",
    "right": "The road's own right limit, or the fixed one, positive [m].",
}
_OUTPUT = {"out": "Where to write [default: <road>.<vehicle>.need/].", "plot": "Draw the picture need.png."}


@dataclass(frozen=True)
class More:
    """What no other command is asked."""

    fix: Annotated[
        str | None,
        Setting("Fix this edge, at --left or --right or where the road has it, and find the least edge on the other side.", choices=SIDES),
    ] = None
    proof: Annotated[
        bool | None,
        Setting(
            "Find the most room that is proved to be too little [default: where the vehicle does not fit].", names=("--proof/--no-proof",)
        ),
    ] = None
    template: Annotated[
        str | None,
        Setting(
            f"Instead of a road a manoeuvre that reverses, whose site is made as small as can be found: {', '.join(Template)}.",
            "NAME",
            choices=tuple(Template),
        ),
    ] = None


@with_settings
def need(
    road: RoadOrNoneArgument = None,
    *,
    vehicle: VehiclesOption,
    room: Annotated[Room, OptionsOf(Room, VEHICLE, words=_ROOM)],
    settings: Annotated[PlannerSettings, OptionsOf(PlannerSettings, VEHICLE, only=("clearance",))],
    reading: Annotated[RoadOptions, OptionsOf(RoadOptions, ROAD)],
    output: Annotated[Output, OptionsOf(Output, OUTPUT, words=_OUTPUT, only=WRITTEN)],
    more: Annotated[More, OptionsOf(More, VEHICLE, {"proof": PLANNING, "template": SITE})],
    site: Annotated[SiteOptions, OptionsOf(SiteOptions, SITE, only=_FIXED)],
) -> int:
    """Find the least room that a vehicle needs on a road, or for a manoeuvre that reverses.

    Where the vehicle does not fit, the command also finds the least widening of the road's own street; with --fix on the other side alone.

    It asks plans for less and less room and judges each by its simulation, to 1 cm. Less room, for which no plan was found, is called out
    of reach; that is not a proof. Unless the vehicle fits, it also looks for room that is proved to be too little. Obstacles and a fixed
    edge stay where they are. DIR receives need.json, the picture need.png, and the widening as GeoJSON; with --format dxf,gpkg also as
    layers of a drawing, and with --sheet on paper to scale. Of several vehicles, DIR has a folder for each, and needs.csv.

    With --template it finds the least street width, arm or apron, to 5 cm, with which a manoeuvre of forward and backward legs was found.

    Exit code 0: the answer was found. 1: no plan exists at any width, or with the fixed edge. 2: bad input.
    """
    held, proof, template = more.fix, more.proof, more.template
    if template is not None:
        beside = (road, held, proof, room, reading)
        if beside != (None, None, None, Room(), RoadOptions()):
            msg = f"--template {template} has its own site: a road, its room and its options mean nothing for it"
            raise OptionError(msg, hint=f"give --vehicle, and of the site {', '.join(f'--{name}' for name in _FIXED)}".replace("_", "-"))
        return _of_template(template, vehicle, replace(site, clearance=settings.clearance or None), output)
    if road is None:
        msg = "missing argument 'ROAD'"
        raise OptionError(msg, hint="give a road, or --template for a turning head, a dock or a three-point turn")
    site.refuse_all()
    given, quiet = _given(held, room), output.quiet
    check_folder(output.out)
    sheet = output.drawn_on()
    from hdvplan.road.load import find_road

    vehicles, answers, directory = vehicles_named(vehicle, quiet=quiet), [], Path()
    roads = [find_road(road, reading.followed_by(driven.max_curvature), limited=given is not None) for driven in vehicles]
    from hdvplan.case import Case
    from hdvplan.need.answer import edge_need_of, need_of
    from hdvplan.report.needs import need_json, write_need
    from hdvplan.report.paper import check_scale

    kinds = output.kinds()
    several = len(vehicles) > 1
    for driven, found in zip(vehicles, roads, strict=True):
        track = smoothed(found, road, given, quiet=quiet)
        check_fits(driven, None, track)
        check_scale(sheet, [track.path], driven, whole=False)
        case = Case(track, driven, settings=settings)
        began = perf_counter()
        with progress(f"looking for the least room of {driven.name} on {track.name}", quiet=quiet) as on_progress:
            if held is None:
                answer = replace(need_of(case, prove=proof, on_progress=on_progress), given=given)
            else:
                other = "right" if held == "left" else "left"
                edge = _held(track, held, getattr(room, held))
                answer = edge_need_of(case, edge, other, prove=proof, on_progress=on_progress)
        answers.append((answer, need_json(answer, perf_counter() - began)))
        warn_of_sides(answers[-1][1], f"{driven.name}: " if several else "", quiet=quiet)
        directory = output.out or Path(f"{file_name(track.name)}.{'compared' if several else file_name(driven.name)}.need")
        with writing(f"to {directory}"):
            write_need(*answers[-1], directory / file_name(driven.name) if several else directory, kinds, sheet)
    if several:
        import pandas as pd

        from hdvplan.fileio import csv_bytes, write_atomically

        numbers = [{name: value for name, value in one.items() if not isinstance(value, list | dict)} for _, one in answers]
        with writing(f"to {directory}"):
            write_atomically(directory / "needs.csv", csv_bytes(pd.DataFrame(numbers)))
    return _told(answers, directory, output)


def _told(answers: list[tuple[Need, dict[str, Any]]], directory: Path, output: Output) -> ExitCode:
    """Print the answers; return the worst exit code. No plan at any width, or with the fixed edge, is an error."""
    from hdvplan.report.needs import need_lines, widening_tables
    from hdvplan.report.tables import needs_table

    several, summaries = len(answers) > 1, [summary for _, summary in answers]
    lines, widenings = (line for answer, _ in answers for line in need_lines(answer)), answers[0][0].widenings
    tables = [needs_table(summaries, f"{directory}/")] if several else [] if widenings is None else widening_tables(widenings)
    print_answer(output, summaries if several else summaries[0], lines, tables)
    if not (several or output.json or output.quiet):
        print_line(f"written to {directory}/")
    lacking = [answer for answer, _ in answers if answer.room.result is None]
    for answer in lacking:
        report_error(without_word(need_lines(answer)[-1], NO))
    return ExitCode.BROKEN if lacking else ExitCode.OK


def _of_template(name: str, vehicle: str, site: SiteOptions, output: Output) -> int:
    template = Template(name)
    if len(names_in(vehicle)) > 1:
        msg = f"--template {template} takes one vehicle, not {vehicle}"
        raise OptionError(msg, hint="ask for one after the other")
    if site.size(template) is not None:
        msg = f"--{template.sought} is what is sought"
        raise OptionError(msg, hint=f"`hdvplan turn --template {template} --{template.sought} M` tells whether the vehicle fits in it")
    check_folder(output.out)
    return answered(template, vehicle, site, output, called="need")


def _given(held: str | None, room: Room) -> tuple[float, float] | None:
    """Return the road's own limits given as options, or None; for a fixed edge only the option of that edge counts."""
    if held is None:
        return room.reaches()
    for extra in ("half_width", *(side for side in SIDES if side != held)):
        if getattr(room, extra) is not None:
            msg = f"--fix {held} asks for the least edge on the other side; --{extra.replace('_', '-')} says what it is"
            raise OptionError(msg, hint=f"give --{held} alone, or leave --fix out")
    return None


def _held(road: Road, side: str, reach: float | None) -> tuple[Kerb, ...]:
    from hdvplan.need.search import kerbs_on

    if reach is not None:
        if not reach > 0.0:
            msg = f"--{side} must be a positive number of metres, not {reach:g}"
            raise OptionError(msg)
        return kerbs_on(road.with_limits(reach, reach), side)
    if road.limits is None:
        msg = f"the road has no edges of its own, so --fix {side} needs --{side}"
        raise OptionError(msg)
    return kerbs_on(road, side)
