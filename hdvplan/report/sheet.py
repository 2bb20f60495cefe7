"""A plan as sheets of paper to a round scale: map, tight places enlarged, vehicle with dimensions, title block."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from io import BytesIO
from itertools import zip_longest
from textwrap import wrap

import matplotlib as mpl
import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from hdvplan.judging.bodies import TRACK_NOTE
from hdvplan.judging.result import Result
from hdvplan.judging.verdict import tracking_line, verdict_details, verdict_line, verdict_of
from hdvplan.report import INK, MUTED, answer_colour
from hdvplan.report.drawing import draw_vehicle_view
from hdvplan.report.kerbs import tubes_of
from hdvplan.report.layers import LONLAT_CODE, Drawn, drawn_features, map_system
from hdvplan.report.paper import MM_IN, MM_PT, PAPERS_MM, STAMP_MM, Box, Page, SheetOptions, Size, layout, map_mm, pages_of, places_on
from hdvplan.report.sheetmap import draw_field, draw_inset, draw_key, places_of
from hdvplan.report.style import styled
from hdvplan.vehicle.model import Vehicle
from hdvplan.version import __version__

_LETTER, _BOLD = 0.56, 1.12  # mean width of a letter over the type's size, and what bold adds
_SMALL, _TEXT, _VERDICT = 5.5, 7.0, 9.5  # of type [pt]
_SHRUNK = tuple(np.arange(1.0, 0.5, -0.05))  # of these sizes, the first at which a title block has room for all
_CUT = 3  # lines of each text, where not even the last has room
_MARGIN_MM = 3.0
_ONE_COLUMN = 3  # rows of a legend that fill one
_KEY = 0.3  # of a legend's width, for the key plan


@dataclass(frozen=True)
class Sheet:
    """What is drawn on one sheet: a map, enlarged places beside it, and a title block."""

    vehicle: Vehicle
    fits: bool | None
    verdict: str
    details: str
    rows: tuple[tuple[str, str], ...]  # of the title block: names and what they say
    draw_map: Callable[[Axes, Size], None]
    draw_places: tuple[Callable[[Axes, Size], None], ...]  # as many as there is room for are drawn
    draw_key: Callable[[Axes], None] | None = None  # which part of a road this is


@dataclass(frozen=True)
class Answer:
    """What a plan on a sheet answers, and what is drawn of it."""

    fits: bool | None
    text: str
    details: str
    features: tuple[Drawn, ...]
    rows: tuple[tuple[str, str], ...] = ()  # of the title block, besides
    then: Result | None = None  # the plan in a street that is widened for it, whose room is told


def sheet_bytes(result: Result, options: SheetOptions, *, answer: Answer | None = None) -> bytes:
    """Return the sheets as one PDF: vectors and embedded fonts.

    Lengths on paper are true: at 1:200 a metre is 5 mm. Without an ``answer`` of its own it is that of the plan.

    Raises:
        OptionError: at the scale asked for not even the vehicle has room.

    """
    pages, drive = pages_of(result, map_mm(options), options.scale), result.drive
    verdict = verdict_of(result)
    told = answer or Answer(verdict.holds, verdict_line(result, verdict), verdict_details(result, verdict), drawn_features(result))
    then, strays = told.then or result, tracking_line(result) if answer is None or told.fits else ""
    driver = (("driver", strays),) if strays else ()
    around, shown = drive.vehicle.reach_ahead + drive.vehicle.reach_behind, list[float]()  # a place is enlarged on one sheet

    def sheet(page: Page) -> Sheet:
        places = places_of(then, page, map_mm(options), places_on(options), shown)
        shown.extend(room.s for _, room in places)
        tubes = tubes_of(then, [(room.s - around, room.s + around) for _, room in places])
        rows = rows_of([result], f"{drive.road.name}, {drive.road.path.length:.1f} m", page, options)
        return Sheet(
            drive.vehicle, told.fits, told.text, told.details, (*rows, *told.rows, ("wheel tracks", TRACK_NOTE), *driver),
            lambda axes, size: draw_field(axes, result, told.features, page, size, places, tubes=bool(tubes)),
            tuple(
                partial(draw_inset, result=result, features=told.features, page=page, place=place, tube=tube)
                for place, tube in zip_longest(places, tubes)
            ),
            partial(draw_key, path=drive.road.path, page=page) if len(pages) > 1 else None,
        )  # fmt: skip

    title = f"{drive.vehicle.name} on {drive.road.name}, {drive.road.path.length:.0f} m"
    return pdf_bytes((sheet(page) for page in pages), options, title, told.text)


def pdf_bytes(sheets: Iterable[Sheet], options: SheetOptions, title: str, subject: str) -> bytes:
    """Return sheets as one PDF."""
    buffer = BytesIO()
    metadata = {"Title": title, "Subject": subject, "Creator": f"hdvplan {__version__}", "CreationDate": None}
    with styled(), mpl.rc_context({"path.simplify": False}), PdfPages(buffer, metadata=metadata) as pdf:
        for sheet in sheets:
            pdf.savefig(_figure(sheet, options))
    return buffer.getvalue()


def rows_of(results: Sequence[Result], road: str, page: Page, options: SheetOptions) -> tuple[tuple[str, str], ...]:
    """Return the title block's rows of a plan of one leg or several; ``road`` is what is said of the road."""
    result, drives, vehicle = results[0], [one.drive for one in results], results[0].drive.vehicle
    curvature = max(float(np.max(np.abs(drive.kappa), initial=0.0)) for drive in drives)
    angles = [np.max([np.max(np.abs(drive.poses_z[:, at])) for drive in drives]) for at in range(2, vehicle.rigid_states)]
    return (
        ("road", road),
        *drawn_rows(vehicle, steering_text(vehicle, curvature, angles), page, options),
        ("position", _position(result)),
        date_row(f"planned with {result.objective}", "judged by simulation"),
        ("source", result.drive.road.notice or "road file without attribution"),
    )


def drawn_rows(vehicle: Vehicle, steering: str, page: Page, options: SheetOptions) -> tuple[tuple[str, str], ...]:
    """Return the rows of every title block about what is drawn: vehicle, steering and scale."""
    return (
        ("vehicle", f"{vehicle.name}, {vehicle.reach_ahead + vehicle.reach_behind:.2f} x {vehicle.width:.2f} m"),
        ("steering", steering),
        ("drawn", f"1:{page.scale} on {options.paper.upper()}, {page.caption}"),
    )


def date_row(*how: str) -> tuple[str, str]:
    """Return the row of a title block with the date in UTC, the program, and how it was made."""
    return "date", ", ".join((datetime.now(UTC).date().isoformat(), f"hdvplan {__version__}", *how))


def steering_text(vehicle: Vehicle, curvature: float, angles: Sequence[float]) -> str:
    """Return the largest angles of the front wheels, off the middle of the first axle, by curvature [1/m], and of each coupling [rad]."""
    steered, lock = np.degrees(np.arctan(vehicle.lead.wheelbase * np.array([curvature, vehicle.max_curvature])))
    wheels = f"at most {steered:.0f} of {lock:.0f} degrees"
    return f"{wheels}; articulation {' and '.join(f'{np.degrees(angle):.0f} degrees' for angle in angles)}" if angles else wheels


def _figure(sheet: Sheet, options: SheetOptions) -> Figure:
    width, height = PAPERS_MM[options.paper]
    figure = Figure(figsize=(width / MM_IN, height / MM_IN))
    boxes = layout(options)
    for box in boxes:
        corner = (box.x / width, box.y / height)
        figure.add_artist(Rectangle(corner, box.width / width, box.height / height, fill=False, edgecolor=INK, linewidth=0.7))
    field, vehicle, insets, legend, title = boxes
    drawn, count = _axes(figure, field), places_on(options)
    sheet.draw_map(drawn, (field.width, field.height))
    for number, draw in enumerate(sheet.draw_places[:count]):
        each = insets.height / count
        box = Box(insets.x, insets.y + insets.height - each * (number + 1), insets.width, each)
        draw(_axes(figure, box), (box.width, box.height))
    draw_vehicle_view(_axes(figure, vehicle), sheet.vehicle, (vehicle.width, vehicle.height))
    handles, labels = drawn.get_legend_handles_labels()
    columns = 1 if len(handles) <= 2 * _ONE_COLUMN or sheet.draw_key is not None else 2
    rows = -(-len(handles) // columns)
    _axes(figure, legend).legend(
        handles, labels, loc="center left", ncols=columns, fontsize=_SMALL + 0.5, handlelength=2.2,
        labelspacing=min(0.55, 24.0 / rows / 6.0), columnspacing=1.0, borderaxespad=0.6,
    )  # fmt: skip
    if sheet.draw_key is not None:
        sheet.draw_key(_axes(figure, legend._replace(x=legend.x + (1.0 - _KEY) * legend.width, width=_KEY * legend.width)))
    _draw_title(_axes(figure, title), sheet, options, (title.width, title.height))
    return figure


def _axes(figure: Figure, box: Box) -> Axes:
    width, height = (side * MM_IN for side in figure.get_size_inches())
    axes = figure.add_axes((box.x / width, box.y / height, box.width / width, box.height / height))
    axes.set_axis_off()
    return axes


def _draw_title(axes: Axes, sheet: Sheet, options: SheetOptions, size_mm: Size) -> None:
    width, height = size_mm
    axes.set_xlim(0.0, width)
    axes.set_ylim(0.0, height)
    y, answer = height - _MARGIN_MM, answer_colour(fits=sheet.fits)
    for share in _SHRUNK:
        text, bold, most = share * _TEXT, share * _VERDICT, _CUT if share == _SHRUNK[-1] else None
        head, details = _lines(sheet.verdict, width, _BOLD * bold, most), _lines(sheet.details, width, text, most)
        rows, pitch = [(name, _lines(value, width - 18.0, text, most)) for name, value in sheet.rows], 1.25 * text * MM_PT
        taken = 1.25 * bold * MM_PT * len(head) + pitch * (len(details) + sum(len(lines) for _, lines in rows)) + 1.0 + 1.2 * len(rows)
        if taken <= y - _MARGIN_MM - STAMP_MM * options.stamp_rows:
            break
    for lines, size, weight in ((head, bold, "bold"), (details, text, "normal")):
        for line in lines:
            axes.text(_MARGIN_MM, y, line, fontsize=size, fontweight=weight, color=answer, va="top")
            y -= 1.25 * size * MM_PT
    y -= 1.0
    for name, lines in rows:
        axes.plot([0.0, width], [y + 0.7, y + 0.7], color=MUTED, linewidth=0.3)
        axes.text(_MARGIN_MM, y, name, fontsize=_SMALL, color=MUTED, va="top")
        for line in lines:
            axes.text(_MARGIN_MM + 16.0, y, line, fontsize=text, va="top")
            y -= pitch
        y -= 1.2
    for number, (name, value) in enumerate(options.stamps):
        x, top = 0.5 * width * (number % 2), STAMP_MM * (options.stamp_rows - number // 2)
        axes.add_patch(Rectangle((x, top - STAMP_MM), 0.5 * width, STAMP_MM, fill=False, edgecolor=INK, linewidth=0.4))
        for words, largest, colour, below in ((name, _SMALL, MUTED, 1.0), (value, _TEXT + 1.0, INK, 3.7)):
            size = min(largest, (0.5 * width - 1.5 * _MARGIN_MM) / (_LETTER * MM_PT * max(1, len(words))))
            axes.text(x + _MARGIN_MM, top - below, words, fontsize=size, color=colour, va="top")


def _position(result: Result) -> str:
    road = result.drive.road
    system = map_system(road)
    start = shapely.Point(*(float(value) for value in road.path.to_plane(0.0, 0.0)))
    x, y = system.place(start).coords[0]
    digits = 6 if system.name == LONLAT_CODE else 2
    return f"s = 0 at {x:.{digits}f}, {y:.{digits}f}: {system.note}"


def _lines(text: str, width_mm: float, size: float, most: int | None) -> list[str]:
    """Return a text in lines that are not wider than ``width_mm`` at a ``size`` of type [pt]; what ``most`` lines leave is cut."""
    letters = max(8, int((width_mm - _MARGIN_MM) / (_LETTER * size * MM_PT)))
    lines = wrap(text, letters, max_lines=most, placeholder=" ...")
    return lines or [""]
