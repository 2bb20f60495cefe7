"""``hdvplan turn``: drive a prescribed manoeuvre and print its swept figures."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import partial
from math import degrees, radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hdvplan.cli.checks import number_of, vehicle_named
from hdvplan.cli.console import ExitCode, print_answer, print_json, print_tables, progress, report_error, writing
from hdvplan.cli.help import OUTPUT, SITE
from hdvplan.cli.options import WRITTEN, OptionsOf, Output, VehicleOrNoneOption, check_folder, file_name, with_settings
from hdvplan.errors import OptionError
from hdvplan.report import TURN_DRAWINGS
from hdvplan.settings import Setting, choice
from hdvplan.turning.reversing.options import SiteOptions, Template, template_named

if TYPE_CHECKING:
    from hdvplan.turning.manoeuvre import Manoeuvre
    from hdvplan.turning.turn import Template as TurnTemplate
    from hdvplan.vehicle.model import Vehicle

_OWN, _STEADY = "vehicle", "steady"
_GUIDE = "front-axle"
_TURN = "Turn"  # options that describe it
_STARTS = 4  # of every search for a manoeuvre that reverses
_MORE_STARTS = 9  # in ``need``, which says how far they are apart
_NEAR = 1.1  # times as large as the given size is what nearly fits
_OUTPUT = {
    "out": "Where to write [default: <template>.<vehicle>/].",
    "plot": "Draw the picture turn.png.",
    "formats": "Formats of the picture: png, pdf, svg; dxf for CAD.",
}


@dataclass(frozen=True)
class TurnOptions:
    """A turn, as options describe it."""

    template: Annotated[str | None, Setting("A turn of a standard, a manoeuvre that reverses, or a file; --list.", "NAME|FILE.toml")] = None
    radius: Annotated[
        str | None,
        Setting("Radius of the guided point's path [m], or vehicle, the least that its front wheels allow; needs --angle.", "M|vehicle"),
    ] = None
    angle: Annotated[str | None, Setting("Angle of the turn [degrees]; steady: the circle, until the motion is steady.", "DEG|steady")] = (
        None
    )
    guide: Annotated[
        str | None,
        Setting("The point that follows the path: front-axle (default), outer-front-wheel, front-corner or kingpin.", "POINT"),
    ] = None
    ramp: Annotated[float | None, Setting("Length of path over which the curvature grows, and falls [m].", "M")] = None
    standstill: Annotated[bool, Setting("Turn the front wheels before the vehicle moves.")] = False

    def wanted(self, vehicle: Vehicle) -> Manoeuvre | TurnTemplate:
        """Return the manoeuvre that the options describe; an ``OptionError`` where they describe none, or two."""
        from hdvplan.turning.follow import tightest
        from hdvplan.turning.manoeuvre import GuidePoint, Manoeuvre, guide_offsets
        from hdvplan.turning.turn import load_template

        if self.template is not None:
            self.refuse_more("copy the template to a file of your own and edit it")
            return load_template(self.template)
        if self.radius is None or self.angle is None:
            msg = "a manoeuvre needs --template, or --radius and --angle"
            raise OptionError(msg, hint="`hdvplan turn --list` names the templates")
        guide = GuidePoint(choice("--guide", self.guide or _GUIDE, list(GuidePoint)))
        own, steady = self.radius == _OWN, self.angle == _STEADY
        radius = tightest(vehicle, guide_offsets(guide, vehicle)) if own else number_of("radius", self.radius, f"metres or {_OWN}")
        angle = None if steady else radians(number_of("angle", self.angle, f"degrees or {_STEADY}"))
        return Manoeuvre(radius, angle, guide, self.ramp or 0.0, standstill=self.standstill)

    def refuse_more(self, hint: str | None = None) -> None:
        """Refuse, by an ``OptionError``, options that describe a turn beside a template."""
        for field in fields(self)[1:]:
            if getattr(self, field.name) not in {None, False}:
                msg = f"--{field.name} contradicts --template, which says it already"
                raise OptionError(msg, hint=hint)


@with_settings
def turn(
    *,
    vehicle: VehicleOrNoneOption = None,
    described: Annotated[TurnOptions, OptionsOf(TurnOptions, _TURN)],
    site: Annotated[SiteOptions, OptionsOf(SiteOptions, SITE)],
    list_: Annotated[bool, typer.Option("--list", help="List the templates.", rich_help_panel=_TURN)] = False,
    output: Annotated[Output, OptionsOf(Output, OUTPUT, words=_OUTPUT, only=WRITTEN)],
) -> int:
    """Drive a prescribed turn exactly and print what it sweeps, or make a manoeuvre that reverses and fits.

    The figures of a turn are radii, width, off-tracking, swing and angles. A point of the vehicle follows a line, an arc and a line. All
    turns are to the left; a turn to the right is the mirror image.

    The templates three-point, hammerhead, side-head, dock-90 and dock-45 are manoeuvres of forward and backward legs, made for the vehicle:
    with the fewest legs that fit in the site or, where its size is not given, in the smallest site that is found. They have no film;
    `hdvplan plan DIR/legs.geojson --vehicle NAME --animate` draws one of a plan of their legs.

    Exit code 0: the vehicle drives the turn and meets the template's limits, or fits. 1: it does not, or cannot drive it. 2: bad input.
    """
    if list_:
        return _list(json=output.json)
    if vehicle is None:
        msg = "missing option '--vehicle'"
        raise OptionError(msg, hint="`hdvplan vehicles list` names the presets, `hdvplan turn --list` the templates")
    check_folder(output.out)
    reverses = template_named(described.template)
    if reverses is not None:
        described.refuse_more()
        return answered(reverses, vehicle, site, output, called="turn")
    site.refuse_all()
    if output.drawn_on() is not None:
        msg = "--sheet is for the templates that reverse"
        raise OptionError(msg, hint="--format pdf draws the turn as a picture, --format dxf to scale for CAD")
    from hdvplan.report.manoeuvres import turn_json, turn_table, write_turn
    from hdvplan.turning.turn import broken_words, verdict
    from hdvplan.turning.turn import turn as drive

    kinds, driven = output.kinds(TURN_DRAWINGS), vehicle_named(vehicle, quiet=output.quiet)
    found = drive(driven, described.wanted(driven))
    manoeuvre, name = found.driven.manoeuvre, "" if found.template is None else found.template.name
    angle = _STEADY if manoeuvre.angle is None else f"{degrees(manoeuvre.angle):g}"
    directory = output.out or Path(file_name(f"{name or f'turn-{manoeuvre.radius:g}m-{angle}'}.{found.driven.vehicle.name}"))
    with writing(f"to {directory}"):
        write_turn(found, directory, kinds=kinds)
    print_answer(output, turn_json(found), [verdict(found)], [turn_table(found, f"{directory}/")])
    broken = [limit for limit in found.limits if not limit.kept(found.figures)]
    for limit in broken:
        report_error(broken_words(limit, found))
    return ExitCode.BROKEN if broken else ExitCode.OK


def answered(template: Template, vehicle: str, site: SiteOptions, output: Output, *, called: str) -> ExitCode:
    """Make a manoeuvre, write it into files ``called`` so, print it, and return the exit code; ``need`` tries all numbers of legs.

    What nearly fits by a few searches is sought by as many as ``need`` makes: the two would contradict each other.
    """
    from hdvplan.report.manoeuvres import reversal_json, reversal_tables, write_reversal
    from hdvplan.turning.reversing.answer import reversing
    from hdvplan.turning.reversing.words import details, refusal, verdict

    kinds, sheet = output.kinds(TURN_DRAWINGS), output.drawn_on()
    driven = vehicle_named(vehicle, quiet=output.quiet)
    with progress(f"looking for a manoeuvre of {driven.name}", quiet=output.quiet) as on_progress:
        find = partial(reversing, driven, template, site, all_legs=called == "need", on_progress=on_progress)
        answer = find(starts=_MORE_STARTS if called == "need" else _STARTS)
        if answer.fits is False and answer.size < _NEAR * (answer.given or 0.0):
            answer = find(starts=_MORE_STARTS)
    suffix = ".need" if called == "need" else ""
    directory = output.out or Path(f"{file_name(f'{template}.{driven.name}')}{suffix}")
    with writing(f"to {directory}"):
        write_reversal(answer, directory, called, kinds=kinds, sheet=sheet)
    print_answer(output, reversal_json(answer), (verdict(answer), details(answer)), reversal_tables(answer, f"{directory}/"))
    if answer.fits is False:
        report_error(refusal(answer))
        return ExitCode.BROKEN
    return ExitCode.OK


def _list(*, json: bool) -> int:
    from hdvplan.report.grid import grid
    from hdvplan.turning.turn import load_template, template_names

    templates = [load_template(name) for name in template_names()]
    reversals = [{"name": str(one), "reverses": True, "source": one.sentence, "sought": one.sought} for one in Template]
    angles = [None if template.given.angle is None else degrees(template.given.angle) for template in templates]
    if json:
        print_json(
            [
                {
                    "name": template.name,
                    "source": template.source,
                    "guide": str(template.given.point),
                    "radius_m": template.radius,
                    "angle_deg": angle,
                    "standstill": template.given.standstill,
                    "limits": {limit.name: limit.value for limit in template.limits},
                }
                for template, angle in zip(templates, angles, strict=True)
            ]
            + reversals
        )
        return ExitCode.OK
    rows = [
        (
            template.name,
            "own" if template.radius is None else f"{template.radius:.2f}",
            "circle" if angle is None else f"{angle:g}",
            str(template.given.point),
            ", ".join(f"{limit.words} {'>=' if limit.least else '<='} {limit.value:g}" for limit in template.limits) or "-",
        )
        for template, angle in zip(templates, angles, strict=True)
    ]
    columns = ("template", "radius [m]", "angle [deg]", "guided point", "limits [m]")
    caption = "own: the least radius of the vehicle's front wheels; --json names the sources"
    turns = grid("prescribed turns", columns, rows, text=("template", "guided point", "limits [m]"), caption=caption)
    made = [(str(one), f"--{one.sought}", one.sentence) for one in Template]
    headings = ("template", "size", "what is driven")
    print_tables(turns, grid("manoeuvres that reverse, made for the vehicle", headings, made, text=headings))
    return ExitCode.OK
