"""A plan as sheets of paper to a round scale: map, tight places enlarged, vehicle with dimensions, title block."""

from __future__ import annotations

from datetime import UTC, datetime
from io import BytesIO
from textwrap import wrap
from typing import NamedTuple

import matplotlib as mpl
import shapely
from matplotlib.axes import Axes
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from hdvplan.judging.bodies import TRACK_NOTE
from hdvplan.judging.result import Result
from hdvplan.judging.verdict import tracking_line, verdict_line, verdict_of, verdict_text
from hdvplan.report.colours import INK, MUTED, answer_colour
from hdvplan.report.drawing import draw_vehicle_views
from hdvplan.report.layers import LONLAT_CODE, Drawn, drawn_features, map_system
from hdvplan.report.paper import PAPERS_MM, Page, SheetOptions, pages_of
from hdvplan.report.sheetmap import BAND_MM, draw_field, draw_inset, places_of
from hdvplan.report.style import styled
from hdvplan.version import __version__

_FRAME_MM = 8.0
_SHARE, _COLUMN_MM = 0.27, (86.0, 135.0)  # of the paper's width for the column of insets and title
_STRIP_MM = (44.0, 70.0)  # below the map, for the vehicle
_TITLE_MM, _LEGEND_MM = 74.0, 30.0
_MM_IN = 25.4
_MM_PT = _MM_IN / 72.0
_LETTER, _BOLD = 0.56, 1.12  # mean width of a letter over the type's size, and what bold adds
_SMALL, _TEXT, _VERDICT = 5.5, 7.0, 9.5  # of type [pt]
_MARGIN_MM = 3.0
_ONE_COLUMN = 3  # rows of a legend that fill one


class Box(NamedTuple):
    """A rectangle on the paper [mm], from its lower left corner."""

    x: float
    y: float
    width: float
    height: float


def sheet_bytes(result: Result, options: SheetOptions, *, date: str | None = None) -> bytes:
    """Return the sheets as one PDF: vectors and embedded fonts; ``date`` is today in UTC where none is given.

    Lengths on paper are true: at 1:200 a metre is 5 mm.

    Raises:
        OptionError: at the scale asked for not even the vehicle has room.

    """
    width, height = PAPERS_MM[options.paper]
    field, *_ = _layout(width, height)
    pages = pages_of(result, (field.width, field.height - BAND_MM), options.scale)
    features, drive, buffer = drawn_features(result), result.drive, BytesIO()
    metadata = {
        "Title": f"{drive.vehicle.name} on {drive.road.name}, {drive.road.path.length:.0f} m",
        "Subject": verdict_line(result, verdict_of(result)),
        "Creator": f"hdvplan {__version__}",
        "CreationDate": None,
    }
    with styled(), mpl.rc_context({"path.simplify": False}), PdfPages(buffer, metadata=metadata) as pdf:
        for page in pages:
            pdf.savefig(_sheet(result, features, page, options.paper, date or datetime.now(UTC).date().isoformat()))
    return buffer.getvalue()


def _layout(width: float, height: float) -> tuple[Box, Box, Box, Box, Box]:
    """Return the places of the map, the vehicle, the insets, the legend and the title on a paper of this size [mm]."""
    column = min(max(_SHARE * width, _COLUMN_MM[0]), _COLUMN_MM[1])
    strip = min(max(0.2 * height, _STRIP_MM[0]), _STRIP_MM[1])
    right, inner = width - _FRAME_MM - column, height - 2.0 * _FRAME_MM
    field = Box(_FRAME_MM, _FRAME_MM + strip, right - _FRAME_MM, inner - strip)
    vehicle = Box(_FRAME_MM, _FRAME_MM, right - _FRAME_MM, strip)
    title = Box(right, _FRAME_MM, column, _TITLE_MM)
    legend = Box(right, _FRAME_MM + _TITLE_MM, column, _LEGEND_MM)
    insets = Box(right, legend.y + _LEGEND_MM, column, inner - _TITLE_MM - _LEGEND_MM)
    return field, vehicle, insets, legend, title


def _sheet(result: Result, features: tuple[Drawn, ...], page: Page, paper: str, date: str) -> Figure:
    width, height = PAPERS_MM[paper]
    figure = Figure(figsize=(width / _MM_IN, height / _MM_IN))
    boxes = _layout(width, height)
    for box in boxes:
        corner = (box.x / width, box.y / height)
        figure.add_artist(Rectangle(corner, box.width / width, box.height / height, fill=False, edgecolor=INK, linewidth=0.7))
    field, vehicle, insets, legend, title = boxes
    count = max(1, round(insets.height / (0.62 * insets.width)))
    places, each = places_of(result, page, count), insets.height / count
    drawn = _axes(figure, field)
    draw_field(drawn, result, features, page, (field.width, field.height), places)
    for number, place in enumerate(places):
        box = Box(insets.x, insets.y + insets.height - each * (number + 1), insets.width, each)
        draw_inset(_axes(figure, box), result, features, page, (box.width, box.height), place)
    draw_vehicle_views(_axes(figure, vehicle), result.drive.vehicle, (vehicle.width, vehicle.height))
    handles, labels = drawn.get_legend_handles_labels()
    rows = -(-len(handles) // 2)
    _axes(figure, legend).legend(
        handles, labels, loc="center left", ncols=1 if rows <= _ONE_COLUMN else 2, fontsize=_SMALL + 0.5, handlelength=2.2,
        labelspacing=min(0.55, 30.0 / rows / 6.0), columnspacing=1.0, borderaxespad=0.6,
    )  # fmt: skip
    _draw_title(_axes(figure, title), result, page, paper, date, (title.width, title.height))
    return figure


def _axes(figure: Figure, box: Box) -> Axes:
    width, height = (side * _MM_IN for side in figure.get_size_inches())
    axes = figure.add_axes((box.x / width, box.y / height, box.width / width, box.height / height))
    axes.set_axis_off()
    return axes


def _draw_title(axes: Axes, result: Result, page: Page, paper: str, date: str, size_mm: tuple[float, float]) -> None:
    """Write verdict, road, vehicle, scale, coordinates, date, version and source into axes of ``size_mm``."""
    width, height = size_mm
    axes.set_xlim(0.0, width)
    axes.set_ylim(0.0, height)
    drive, verdict = result.drive, verdict_of(result)
    y = height - _MARGIN_MM
    for line in _lines(verdict_text(result, verdict), width, _BOLD * _VERDICT, 4):
        axes.text(_MARGIN_MM, y, line, fontsize=_VERDICT, fontweight="bold", color=answer_colour(fits=verdict.fits), va="top")
        y -= 1.25 * _VERDICT * _MM_PT
    vehicle = f"{drive.vehicle.name}, {drive.vehicle.reach_ahead + drive.vehicle.reach_behind:.2f} x {drive.vehicle.width:.2f} m"
    rows = [
        ("road", f"{drive.road.name}, {drive.road.path.length:.1f} m"),
        ("vehicle", vehicle),
        ("drawn", f"1:{page.scale} on {paper.upper()}, {page.caption}"),
        ("position", _position(result)),
        ("date", f"{date}, hdvplan {__version__}, planned with {result.objective}, judged by simulation"),
        ("source", drive.road.notice or "road file without attribution"),
        ("wheel tracks", TRACK_NOTE),
        *([("driver", tracking_line(result))] if verdict.fits else []),
    ]
    y -= 1.5
    for name, value in rows:
        axes.plot([0.0, width], [y + 0.8, y + 0.8], color=MUTED, linewidth=0.3)
        axes.text(_MARGIN_MM, y, name, fontsize=_SMALL, color=MUTED, va="top")
        for line in _lines(value, width - 18.0, _TEXT, 3):
            axes.text(_MARGIN_MM + 16.0, y, line, fontsize=_TEXT, va="top")
            y -= 1.25 * _TEXT * _MM_PT
        y -= 1.4


def _position(result: Result) -> str:
    """Return where the road starts, in its file's coordinates."""
    road = result.drive.road
    system = map_system(road)
    start = shapely.Point(*(float(value) for value in road.path.to_plane(0.0, 0.0)))
    x, y = system.place(start).coords[0]
    digits = 6 if system.name == LONLAT_CODE else 2
    return f"s = 0 at {x:.{digits}f}, {y:.{digits}f}: {system.note}"


def _lines(text: str, width_mm: float, size: float, most: int) -> list[str]:
    """Return a text in lines that are not wider than ``width_mm`` at a ``size`` of type [pt]; what is left is cut."""
    letters = max(8, int((width_mm - _MARGIN_MM) / (_LETTER * size * _MM_PT)))
    lines = wrap(text, letters, max_lines=most, placeholder=" ...")
    return lines or [""]
