"""Forward and backward legs on a sheet of paper to a round scale, along lines or in their site: tight place and cusps enlarged beside."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import shapely
from matplotlib.axes import Axes

from hdvplan.judging.legs import LegsResult
from hdvplan.report.layers import drawn_features, view_of
from hdvplan.report.leg_plots import Stop, draw_legs, points_shown, stops_of
from hdvplan.report.manoeuvre_plots import draw_site, stops_in, ways_in
from hdvplan.report.paper import Page, SheetOptions, Size, map_mm, page_around
from hdvplan.report.rooms import Room
from hdvplan.report.sheet import Sheet, date_row, drawn_rows, pdf_bytes, rows_of, steering_text
from hdvplan.report.sheetmap import draw_inset, draw_marks, draw_place, head_inset, inset_scale, look_at, look_at_page, places_of
from hdvplan.turning.reversing import words
from hdvplan.turning.reversing.answer import Answer

_PAPER = 1.0  # width of lines, of those on a sheet
_LETTER = "A"  # of the tightest place


def legs_sheet_bytes(driven: LegsResult, options: SheetOptions) -> bytes:
    """Return the sheet of a drive along several lines as a PDF, as ``sheet_bytes`` does of a road, with its errors."""
    lengths = [leg.road.path.length for leg in driven.legs.legs]
    page = page_around(points_shown(driven), sum(lengths), map_mm(options), options.scale)
    first = driven.results[0]
    each = ", ".join(f"{leg.direction} {length:.1f} m" for leg, length in zip(driven.legs.legs, lengths, strict=True))
    rows = rows_of(driven.results, driven.legs.name, page, options)
    worst = driven.results[driven.worst]  # the leg that decides
    rooms = places_of(worst, replace(page, s_to=worst.drive.road.path.length), map_mm(options), 1) if driven.fits is not None else []
    tightest, places = next((room for _, room in rooms), None), list[Callable[[Axes, Size], None]]()
    if tightest is not None:
        place = (f"{_LETTER}: {driven.called(driven.worst)}", tightest)
        places.append(partial(draw_inset, result=worst, features=drawn_features(worst), page=page, place=place))
    inset, draw = inset_scale(page), partial(draw_legs, driven=driven, weight=_PAPER, turned=page.turned)
    scale = 2 * inset if 2 * inset < page.scale else inset  # more of the surroundings, where that is still larger than on the map
    places += [partial(_draw_stop, draw=draw, page=page, stop=stop, scale=scale) for stop in stops_of(driven)[1:]]
    north = driven.legs.legs[0].road.to_lonlat is not None
    sheet = Sheet(
        first.drive.vehicle, driven.fits, driven.text, driven.details, (*rows, ("legs", each)),
        partial(_draw_map, draw=draw, page=page, north=north, tightest=tightest), tuple(places),
    )  # fmt: skip
    title = f"{driven.name}, {len(lengths)} legs, {sum(lengths):.0f} m"
    return pdf_bytes([sheet], options, title, driven.text)


def reversal_sheet_bytes(answer: Answer, options: SheetOptions) -> bytes:
    """Return the sheet of a manoeuvre in its site as a PDF, as ``sheet_bytes`` does of a road, with its errors."""
    legs, size = answer.chosen.manoeuvre.legs, f"{answer.size:.2f} m of {answer.template.words}"
    page = page_around(shapely.get_coordinates(view_of(answer)), sum(leg.length for leg in legs), map_mm(options), options.scale)
    curvature = max(float(np.abs(leg.kappa).max(initial=0.0)) for leg in legs)
    steering = steering_text(answer.vehicle, curvature, [*np.max([np.abs(leg.beta).max(axis=0) for leg in legs], axis=0)])
    rows = (
        ("site", f"{answer.template}, {size}"), *drawn_rows(answer.vehicle, steering, page, options), date_row(),
        ("legs", ", ".join(f"{leg.direction} {leg.length:.1f} m" for leg in legs)),
        ("note", "all turns are to the left; mirror it where one drives on the left"),
    )  # fmt: skip
    draw, text = partial(draw_site, answer=answer, ways=ways_in(answer), weight=_PAPER, turned=page.turned), words.verdict(answer)
    places = tuple(partial(_draw_stop, draw=draw, page=page, stop=stop, scale=inset_scale(page)) for stop in stops_in(answer)[1:])
    drawn = partial(_draw_map, draw=draw, page=page, north=False)
    sheet = Sheet(answer.vehicle, answer.fits, text, words.details(answer), rows, drawn, places)
    return pdf_bytes([sheet], options, f"{answer.vehicle.name}, {answer.template}, {size}", text)


def _draw_map(axes: Axes, size_mm: Size, draw: Callable[[Axes], None], page: Page, *, north: bool, tightest: Room | None = None) -> None:
    draw(axes)
    look_at_page(axes, page, size_mm)
    if tightest is not None:
        draw_place(axes, _LETTER, tightest, page)
    draw_marks(axes, page, size_mm, north=north)


def _draw_stop(axes: Axes, size_mm: Size, draw: Callable[[Axes], None], page: Page, stop: Stop, scale: int) -> None:
    draw(axes)
    look_at(axes, page.turned(stop.place[None])[0], size_mm, scale)
    head_inset(axes, f"{stop.text}   1:{scale}")
