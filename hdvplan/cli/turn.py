"""``hdvplan turn``: drive a prescribed manoeuvre and print its swept figures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hdvplan.cli import completion
from hdvplan.cli.checks import check_folder, vehicle_named
from hdvplan.cli.console import ExitCode, print_json, print_line, print_tables, report_error, writing
from hdvplan.cli.help import OUTPUT
from hdvplan.cli.options import JsonOption, QuietOption, VehicleOrNoneOption, drawn_formats, file_name
from hdvplan.errors import OptionError

if TYPE_CHECKING:
    from hdvplan.turning.manoeuvre import Manoeuvre
    from hdvplan.turning.templates import Template
    from hdvplan.turning.turn import Turn

_STEADY = "steady"
_GUIDE = "front-axle"
_TURN = "Turn"  # options that describe it


def turn(
    vehicle: VehicleOrNoneOption = None,
    template: Annotated[
        str | None,
        typer.Option(
            "--template",
            metavar="NAME|FILE.toml",
            help="A turn of a standard, from --list, or a file.",
            autocompletion=completion.templates,
            rich_help_panel=_TURN,
        ),
    ] = None,
    radius: Annotated[
        float | None,
        typer.Option("--radius", metavar="M", help="Radius of the guided point's path [m]; needs --angle.", rich_help_panel=_TURN),
    ] = None,
    angle: Annotated[
        str | None,
        typer.Option(
            "--angle",
            metavar="DEG|steady",
            help="Angle of the turn [degrees]; steady: the circle, until the motion is steady.",
            rich_help_panel=_TURN,
        ),
    ] = None,
    guide: Annotated[
        str | None,
        typer.Option(
            "--guide",
            metavar="POINT",
            help="The point that follows the path: front-axle (default), outer-front-wheel, front-corner or kingpin.",
            rich_help_panel=_TURN,
        ),
    ] = None,
    ramp: Annotated[
        float | None,
        typer.Option("--ramp", metavar="M", help="Length of path over which the curvature grows, and falls [m].", rich_help_panel=_TURN),
    ] = None,
    standstill: Annotated[
        bool, typer.Option("--standstill", help="Turn the front wheels before the vehicle moves.", rich_help_panel=_TURN)
    ] = False,
    list_: Annotated[bool, typer.Option("--list", help="List the templates.", rich_help_panel=_TURN)] = False,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Where to write [default: <template>.<vehicle>/].", rich_help_panel=OUTPUT)
    ] = None,
    json: JsonOption = False,
    plot: Annotated[bool, typer.Option("--plot/--no-plot", help="Draw the picture turn.png.", rich_help_panel=OUTPUT)] = True,
    formats: Annotated[
        str, typer.Option("--format", metavar="A,B", help="Formats of the picture: png, pdf, svg; dxf for CAD.", rich_help_panel=OUTPUT)
    ] = "png",
    quiet: QuietOption = False,
) -> int:
    """Drive a prescribed turn exactly and print what it sweeps.

    The figures are radii, width, off-tracking, swing and angles. A point of the vehicle follows a line, an arc and a line. All turns are to
    the left; a turn to the right is the mirror image.

    Exit code 0: the vehicle drives the turn and meets the template's limits. 1: it does not meet them, or cannot drive it. 2: bad input.
    """
    if list_:
        return _list(json=json)
    if vehicle is None:
        msg = "missing option '--vehicle'"
        raise OptionError(msg, hint="`hdvplan vehicles list` names the presets, `hdvplan turn --list` the templates")
    check_folder(out)
    from hdvplan.report.files import PICTURES
    from hdvplan.report.turns import TURN_DRAWINGS, turn_json, turn_table, write_turn
    from hdvplan.turning.turn import broken_words, verdict
    from hdvplan.turning.turn import turn as drive

    kinds = drawn_formats(formats, PICTURES, TURN_DRAWINGS, plot=plot)
    wanted = _wanted(template, radius, angle, guide, ramp, standstill=standstill)
    found = drive(vehicle_named(vehicle, quiet=quiet), wanted)
    directory = out or Path(_folder(found))
    with writing(f"to {directory}"):
        write_turn(found, directory, kinds=kinds)
    if json:
        print_json(turn_json(found))
    elif not quiet:
        print_line(verdict(found))
        print_tables(turn_table(found, f"{directory}/"))
    broken = [limit for limit in found.limits if not limit.kept(found.figures)]
    for limit in broken:
        report_error(broken_words(limit, found))
    return ExitCode.BROKEN if broken else ExitCode.OK


def _wanted(
    template: str | None, radius: float | None, angle: str | None, guide: str | None, ramp: float | None, *, standstill: bool
) -> Manoeuvre | Template:
    """Return the manoeuvre that the options describe.

    Raises:
        OptionError: they describe none, or two.

    """
    from math import radians

    from hdvplan.turning.manoeuvre import Manoeuvre
    from hdvplan.turning.templates import guide_point, load_template

    if template is not None:
        given = {"--radius": radius, "--angle": angle, "--guide": guide, "--ramp": ramp, "--standstill": standstill or None}
        for option, value in given.items():
            if value is not None:
                msg = f"{option} contradicts --template, which says it already"
                raise OptionError(msg, hint="copy the template to a file of your own and edit it")
        return load_template(template)
    if radius is None or angle is None:
        msg = "a manoeuvre needs --template, or --radius and --angle"
        raise OptionError(msg, hint="`hdvplan turn --list` names the templates")
    if angle == _STEADY:
        turned = None
    else:
        try:
            turned = radians(float(angle))
        except ValueError as error:
            msg = f"--angle must be a number of degrees or {_STEADY}, not {angle!r}"
            raise OptionError(msg) from error
    return Manoeuvre(radius, turned, guide_point(guide or _GUIDE, "--guide"), ramp or 0.0, standstill=standstill)


def _folder(found: Turn) -> str:
    """Return the default folder's name."""
    from math import degrees

    manoeuvre = found.driven.manoeuvre
    angle = _STEADY if manoeuvre.angle is None else f"{degrees(manoeuvre.angle):g}"
    name = f"turn-{manoeuvre.radius:g}m-{angle}" if found.template is None else found.template.name
    return file_name(f"{name}.{found.driven.vehicle.name}")


def _list(*, json: bool) -> int:
    """Print the shipped templates."""
    from math import degrees

    from hdvplan.report.grid import grid
    from hdvplan.turning.templates import load_template, template_names

    templates = [load_template(name) for name in template_names()]
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
    print_tables(grid("templates", columns, rows, text=("template", "guided point", "limits [m]"), caption=caption))
    return ExitCode.OK
