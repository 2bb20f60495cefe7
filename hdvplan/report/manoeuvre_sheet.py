"""A manoeuvre of forward and backward legs on a sheet of paper to a round scale: its site, and the cusps enlarged beside it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import shapely
from matplotlib.axes import Axes

from hdvplan.report.leg_maps import Stop
from hdvplan.report.manoeuvre_layers import view_of
from hdvplan.report.manoeuvre_plots import draw_site, stops_in, swept_on
from hdvplan.report.paper import Page, SheetOptions, Size, map_mm, page_around
from hdvplan.report.sheet import Sheet, date_row, drawn_rows, pdf_bytes, steering_text
from hdvplan.report.sheetmap import draw_marks, head_inset, inset_scale, look_at, look_at_page
from hdvplan.turning.reversing import words
from hdvplan.turning.reversing.answer import Answer

_PAPER = 1.0  # width of lines, of those on a sheet


def reversal_sheet_bytes(answer: Answer, options: SheetOptions, *, date: str | None = None) -> bytes:
    """Return the sheet as a PDF, as ``sheet_bytes`` does of a road.

    Raises:
        OptionError: the site has no room at the scale asked for, or on the paper at any.

    """
    legs, size = answer.chosen.manoeuvre.legs, f"{answer.size:.2f} m of {answer.template.words}"
    page = page_around(shapely.get_coordinates(view_of(answer)), sum(leg.length for leg in legs), map_mm(options), options.scale)
    curvature = max(float(np.abs(leg.kappa).max(initial=0.0)) for leg in legs)
    steering = steering_text(answer.vehicle, curvature, [*np.max([np.abs(leg.beta).max(axis=0) for leg in legs], axis=0)])
    rows = (
        ("site", f"{answer.template}, {size}"), *drawn_rows(answer.vehicle, steering, page, options), date_row(date),
        ("legs", ", ".join(f"{leg.direction} {leg.length:.1f} m" for leg in legs)),
        ("note", "all turns are to the left; mirror it where one drives on the left"),
    )  # fmt: skip
    draw, text = partial(draw_site, answer=answer, swept=swept_on(answer), weight=_PAPER, turned=page.turned), words.verdict(answer)
    places = tuple(partial(_draw_stop, draw=draw, page=page, stop=stop) for stop in stops_in(answer)[1:])
    sheet = Sheet(answer.vehicle, answer.fits, text, words.details(answer), rows, partial(_draw_map, draw=draw, page=page), places)
    return pdf_bytes([sheet], options, f"{answer.vehicle.name}, {answer.template}, {size}", text)


def _draw_map(axes: Axes, size_mm: Size, draw: Callable[[Axes], None], page: Page) -> None:
    """Draw the site, filling the axes, of ``size_mm``, exactly to scale."""
    draw(axes)
    look_at_page(axes, page, size_mm)
    draw_marks(axes, page, size_mm, north=False)


def _draw_stop(axes: Axes, size_mm: Size, draw: Callable[[Axes], None], page: Page, stop: Stop) -> None:
    """Draw the vehicle where it stands, larger, and its surroundings."""
    draw(axes)
    scale = inset_scale(page)
    look_at(axes, page.turned(stop.place[None])[0], size_mm, scale)
    head_inset(axes, f"{stop.text}   1:{scale}")
