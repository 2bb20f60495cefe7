"""A drive of several legs on a sheet of paper to a round scale: the tightest place and the cusps enlarged beside it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import shapely
from matplotlib.axes import Axes

from hdvplan.judging.legs import LegsResult
from hdvplan.report.layers import drawn_features
from hdvplan.report.leg_maps import Stop, draw_ground, draw_stops, draw_swept, stops_of
from hdvplan.report.paper import Page, SheetOptions, Size, map_mm, page_around
from hdvplan.report.rooms import Room
from hdvplan.report.sheet import Sheet, pdf_bytes, rows_of
from hdvplan.report.sheetmap import draw_inset, draw_marks, draw_place, head_inset, inset_scale, look_at, look_at_page, places_of

_PAPER = 1.0  # width of lines, of those on a sheet
_LETTER = "A"  # of the tightest place


def legs_sheet_bytes(driven: LegsResult, options: SheetOptions, *, date: str | None = None) -> bytes:
    """Return the sheet as a PDF, as ``sheet_bytes`` does of a road.

    Raises:
        OptionError: the drive has no room at the scale asked for, or on the paper at any.

    """
    lengths = [leg.road.path.length for leg in driven.legs.legs]
    outline = shapely.get_coordinates(driven.swept)
    page = page_around(outline, sum(lengths), map_mm(options), options.scale)
    first = driven.results[0]
    each = ", ".join(f"{leg.direction} {length:.1f} m" for leg, length in zip(driven.legs.legs, lengths, strict=True))
    rows = rows_of(driven.results, (driven.legs.name, first.drive.road.notice), page, options, date)
    tightest = _tightest(driven, page) if driven.fits is not None else None
    places = [] if tightest is None else [_enlarged(driven, page, tightest)]
    places += [partial(_draw_stop, driven=driven, page=page, stop=stop) for stop in stops_of(driven)[1:]]
    sheet = Sheet(
        first.drive.vehicle, driven.fits, driven.text, driven.details, (*rows, ("legs", each)),
        partial(_draw_map, driven=driven, page=page, tightest=tightest), tuple(places),
    )  # fmt: skip
    title = f"{driven.name}, {len(lengths)} legs, {sum(lengths):.0f} m"
    return pdf_bytes([sheet], options, title, driven.text)


def _tightest(driven: LegsResult, page: Page) -> Room | None:
    """Return the place of least room on the leg that decides."""
    result = driven.results[driven.worst]
    whole = replace(page, s_to=result.drive.road.path.length)
    return next((room for _, room in places_of(result, whole, 1)), None)


def _enlarged(driven: LegsResult, page: Page, room: Room) -> Callable[[Axes, Size], None]:
    result = driven.results[driven.worst]
    place = (f"{_LETTER}: {driven.called(driven.worst)}", room)
    return partial(draw_inset, result=result, features=drawn_features(result), page=page, place=place)


def _draw_map(axes: Axes, size_mm: Size, driven: LegsResult, page: Page, tightest: Room | None) -> None:
    """Draw all legs, filling the axes, of ``size_mm``, exactly to scale."""
    _draw_legs(axes, driven, page)
    look_at_page(axes, page, size_mm)
    if tightest is not None:
        draw_place(axes, _LETTER, tightest, page)
    draw_marks(axes, page, size_mm, north=driven.legs.legs[0].road.to_lonlat is not None)


def _draw_stop(axes: Axes, size_mm: Size, driven: LegsResult, page: Page, stop: Stop) -> None:
    """Draw the vehicle where it stands, larger, and its surroundings."""
    _draw_legs(axes, driven, page)
    inset = inset_scale(page)
    scale = 2 * inset if 2 * inset < page.scale else inset  # more of the surroundings, where that is still larger than on the map
    look_at(axes, page.turned(stop.place[None])[0], size_mm, scale)
    head_inset(axes, f"{stop.text}   1:{scale}")


def _draw_legs(axes: Axes, driven: LegsResult, page: Page) -> None:
    draw_swept(axes, driven, weight=_PAPER, turned=page.turned)
    draw_ground(axes, driven, weight=_PAPER, turned=page.turned)
    draw_stops(axes, driven, weight=_PAPER, turned=page.turned)
