"""A plan as sheets of paper to a round scale: map, tight places enlarged, vehicle with dimensions, title block."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from io import BytesIO

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from hdvplan.judging.result import Result
from hdvplan.report.colours import INK
from hdvplan.report.heading import answer_line, subject_line
from hdvplan.report.layers import drawn_features
from hdvplan.report.pages import Page, pages_of
from hdvplan.report.paper import PAPERS_MM, SheetOptions
from hdvplan.report.sheetmap import BAND_MM, Ground, Place, draw_field, draw_inset, places_of
from hdvplan.report.style import styled
from hdvplan.report.titleblock import draw_legend, draw_title, draw_vehicle_views
from hdvplan.version import __version__

_FRAME_MM = 8.0
_SHARE, _COLUMN_MM = 0.27, (86.0, 135.0)  # of the paper's width for the column of insets and title
_STRIP_MM = (44.0, 70.0)  # below the map, for the vehicle
_TITLE_MM, _LEGEND_MM = 74.0, 30.0
_MM_IN = 25.4


@dataclass(frozen=True)
class Box:
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
    ground = Ground(result, drawn_features(result))
    buffer = BytesIO()
    metadata = {"Title": subject_line(result), "Subject": answer_line(result), "Creator": f"hdvplan {__version__}", "CreationDate": None}
    with styled(), mpl.rc_context({"path.simplify": False}), PdfPages(buffer, metadata=metadata) as pdf:
        for page in pages:
            pdf.savefig(_sheet(ground, page, options.paper, date or datetime.now(UTC).date().isoformat()))
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


def _sheet(ground: Ground, page: Page, paper: str, date: str) -> Figure:
    width, height = PAPERS_MM[paper]
    figure = Figure(figsize=(width / _MM_IN, height / _MM_IN))
    field, vehicle, insets, legend, title = _layout(width, height)
    for box in (field, vehicle, insets, legend, title):
        corner = (box.x / width, box.y / height)
        outline = Rectangle(corner, box.width / width, box.height / height, fill=False, edgecolor=INK, linewidth=0.7)
        figure.add_artist(outline)
    count = max(1, round(insets.height / (0.62 * insets.width)))
    places = places_of(ground.result, page, count)
    draw_field(_axes(figure, field), ground, page, (field.width, field.height), places)
    _draw_insets(figure, insets, ground, page, places, count)
    draw_vehicle_views(_axes(figure, vehicle), ground.result.drive.vehicle, (vehicle.width, vehicle.height))
    draw_legend(_axes(figure, legend), ground.result, (legend.width, legend.height))
    draw_title(_axes(figure, title), ground.result, page, paper, date, (title.width, title.height))
    return figure


def _draw_insets(figure: Figure, column: Box, ground: Ground, page: Page, places: tuple[Place, ...], count: int) -> None:
    each = column.height / count
    for number, place in enumerate(places):
        box = Box(column.x, column.y + column.height - each * (number + 1), column.width, each)
        draw_inset(_axes(figure, box), ground, page, place, (box.width, box.height))


def _axes(figure: Figure, box: Box) -> Axes:
    width, height = (side * _MM_IN for side in figure.get_size_inches())
    axes = figure.add_axes((box.x / width, box.y / height, box.width / width, box.height / height))
    axes.set_axis_off()
    return axes
