"""A drawing to scale on paper: what it may be asked for, and how a road is laid on sheets: scale, turn, and which stretches."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import shapely

from hdvplan.arrays import FloatArray
from hdvplan.errors import OptionError
from hdvplan.judging.result import Result
from hdvplan.report.rooms import room_at, shown_reach, tightest_windows, tightness
from hdvplan.road.path import ReferencePath
from hdvplan.vehicle.model import Vehicle

PAPERS_MM = {"a4": (297.0, 210.0), "a3": (420.0, 297.0), "a2": (594.0, 420.0), "a1": (841.0, 594.0), "a0": (1189.0, 841.0)}  # landscape
SCALES = (50, 100, 200, 250, 500, 1000, 2000)  # round ones, largest first: 1:50
_SMALLEST = 5000
_DIGITS = 100  # of a number that is worth reading
_SMALLEST_WHOLE = 500  # below 1:500 a wheel track is a hair: rather several sheets
_MOST_SHEETS = 12  # of a whole road; longer ones are drawn where it is tight
_OVERLAP_M = 5.0  # of neighbouring sheets
_ROOM_MM = 8.0  # around what is drawn
_SPACING_M = 1.0
_LAID = 50  # places of a line by which a scale is tried before anything is planned
_FRAME_MM = 8.0
_SHARE, _COLUMN_MM = 0.27, (86.0, 135.0)  # of the paper's width for the column of insets and title
_STRIP_MM = (44.0, 70.0)  # below the map, for the vehicle
_TITLE_MM, _LEGEND_MM = 78.0, 30.0
MM_IN = 25.4
MM_PT = MM_IN / 72.0
STAMP_MM, _MOST_STAMPS, _LONGEST_STAMP = 8.5, 10, 60  # of a row of two stamps; how many, and letters of each
BAND_MM = 15.0  # below the road, for scale bar and north arrow

Size = tuple[float, float]  # of axes on paper [mm]
Laid = Callable[[float, float, int], "Page | None"]  # a stretch of road [m] on a sheet at a scale; None where it does not fit


class Box(NamedTuple):
    """A rectangle on the paper [mm], from its lower left corner."""

    x: float
    y: float
    width: float
    height: float


@dataclass(frozen=True)
class SheetOptions:
    """Paper, of ``PAPERS_MM``, how many metres a metre of paper shows, or None for the largest round scale that fits, and stamps.

    ``stamps`` are what an office writes on every drawing, such as ``("project", "Line 18")``; their texts may be empty.

    Raises:
        OptionError: no such paper, a scale that no drawing has, or stamps that have no room.

    """

    paper: str = "a3"
    scale: int | None = None
    stamps: tuple[tuple[str, str], ...] = ()

    def __post_init__(self) -> None:
        """Refuse what cannot be drawn on."""
        if self.paper not in PAPERS_MM:
            msg = f"--sheet must be {', '.join(PAPERS_MM)}, not {self.paper!r}"
            raise OptionError(msg)
        if self.scale is not None and not 10 <= self.scale <= _SMALLEST:  # noqa: PLR2004 - 1:10 shows two metres on A4
            msg = f"--scale {self.scale} must lie between 10 and {_SMALLEST}: 200 draws 1:200"
            raise OptionError(msg)
        if len(self.stamps) > _MOST_STAMPS:
            msg = f"a sheet has room for {_MOST_STAMPS} stamps, not for {len(self.stamps)}"
            raise OptionError(msg)
        for text in (text for stamp in self.stamps for text in stamp if len(text) > _LONGEST_STAMP):
            msg = f"a stamp has room for {_LONGEST_STAMP} letters, and {text!r} has {len(text)}"
            raise OptionError(msg)

    @property
    def stamp_rows(self) -> int:
        """How many rows the stamps have, two in each."""
        return -(-len(self.stamps) // 2)

    @classmethod
    def named(cls, paper: str, scale: str | None, stamps: Sequence[str] = ()) -> SheetOptions:
        """Return the options by words: ``A3``, ``200`` or ``1:200``, and ``project=Line 18``; else an ``OptionError``."""
        parted = [stamp.partition("=") for stamp in stamps]
        wrong = next((stamp for stamp, (name, equals, _) in zip(stamps, parted, strict=True) if not (name.strip() and equals)), None)
        if wrong is not None:
            msg = f"--stamp {wrong!r} is not NAME=TEXT"
            raise OptionError(msg, hint='such as --stamp "project=Line 18" --stamp "checked by="')
        written = tuple((name.strip(), text.strip()) for name, _, text in parted)
        if scale is None:
            return cls(paper.lower(), None, written)
        digits = scale.removeprefix("1:").strip()
        if not digits.isdecimal() or len(digits) > _DIGITS:
            msg = f"--scale {scale!r} is not a scale: give 200 or 1:200"
            raise OptionError(msg)
        return cls(paper.lower(), int(digits), written)


@dataclass(frozen=True)
class Page:
    """A stretch of road on a sheet: its plane is turned by ``turn`` [rad] about the origin, then ``middle`` is the field's."""

    s_from: float  # [m]
    s_to: float  # [m]
    turn: float
    middle: tuple[float, float]  # [m], turned
    scale: int
    caption: str = ""  # which part of the road this is

    def turned(self, points: FloatArray) -> FloatArray:
        """Return points of the road's plane, shape (n, 2), as they lie on the sheet [m]."""
        cos, sin = np.cos(self.turn), np.sin(self.turn)
        turned: FloatArray = points @ np.array([[cos, sin], [-sin, cos]])
        return turned


def layout(options: SheetOptions) -> tuple[Box, Box, Box, Box, Box]:
    """Return the places of the map, the vehicle, the insets, the legend and the title on a paper [mm]."""
    width, height = PAPERS_MM[options.paper]
    title_mm = _TITLE_MM + STAMP_MM * options.stamp_rows
    column = min(max(_SHARE * width, _COLUMN_MM[0]), _COLUMN_MM[1])
    strip = min(max(0.2 * height, _STRIP_MM[0]), _STRIP_MM[1])
    right, inner = width - _FRAME_MM - column, height - 2.0 * _FRAME_MM
    field = Box(_FRAME_MM, _FRAME_MM + strip, right - _FRAME_MM, inner - strip)
    vehicle = Box(_FRAME_MM, _FRAME_MM, right - _FRAME_MM, strip)
    title = Box(right, _FRAME_MM, column, title_mm)
    legend = Box(right, _FRAME_MM + title_mm, column, _LEGEND_MM)
    insets = Box(right, legend.y + _LEGEND_MM, column, inner - title_mm - _LEGEND_MM)
    return field, vehicle, insets, legend, title


def map_mm(options: SheetOptions) -> Size:
    """Return the size of the map on a paper, without the band of the scale bar [mm]."""
    field, *_ = layout(options)
    return field.width, field.height - BAND_MM


def places_on(options: SheetOptions) -> int:
    """Return how many enlarged places a paper has room for."""
    insets = layout(options)[2]
    return max(1, round(insets.height / (0.62 * insets.width)))


def check_scale(options: SheetOptions | None, paths: Sequence[ReferencePath], vehicle: Vehicle, *, whole: bool) -> None:
    """Refuse, by an ``OptionError``, a scale at which a sheet has no room for a vehicle on the ``whole`` of lines, or on their begin."""
    if options is None or options.scale is None:
        return
    edges = []
    for path in paths:
        s = np.linspace(0.0, path.length if whole else min(2.0 * _OVERLAP_M, path.length), _LAID)
        edges += [np.column_stack(path.to_plane(s, np.full(_LAID, side * 0.5 * vehicle.width))) for side in (1.0, -1.0)]
    if _laid(np.concatenate(edges), Page(0.0, 0.0, 0.0, (0.0, 0.0), options.scale), map_mm(options)) is None:
        raise _refusal(options.scale, "the whole drive" if whole else f"the {vehicle.name}")


def pages_of(result: Result, field_mm: tuple[float, float], scale: int | None) -> tuple[Page, ...]:
    """Return the sheets for a plan whose map has a field of ``field_mm``, at 1:``scale`` or the largest round scale that fits.

    The whole road on one sheet, or, where even 1:500 is too large for that, on up to twelve that overlap; of longer roads the
    tightest stretches, a sheet each.

    Raises:
        OptionError: not even the vehicle has room at this scale.

    """
    path, s, what = result.drive.road.path, result.envelope.s, f"the {result.drive.vehicle.name}"
    kept = np.append(np.arange(0, len(s), max(1, round(_SPACING_M / float(s[1] - s[0])))), len(s) - 1)
    edges = [np.column_stack(path.to_plane(s[kept], side[kept])) for side in shown_reach(result)]
    room, s = room_at(result, int(np.argmax(tightness(result)))), s[kept]
    if not 0.0 <= room.s <= path.length and room.near:  # a map shows what decides, before the road or behind it, too
        s, edges = np.append(s, room.s), [np.concatenate([edge, end[None]]) for edge, end in zip(edges, room.ends, strict=True)]
    first, last = float(np.min(s)), float(np.max(s))

    def laid(begin: float, end: float, scale: int) -> Page | None:
        shown = (s >= begin - _SPACING_M) & (s <= end + _SPACING_M)
        s_from, s_to = (min(max(at, 0.0), path.length) for at in (begin, end))
        return _laid(np.concatenate([edge[shown] for edge in edges]), Page(s_from, s_to, 0.0, (0.0, 0.0), scale), field_mm)

    for round_scale in (scale,) if scale is not None else [s for s in SCALES if s <= _SMALLEST_WHOLE]:
        whole = laid(first, last, round_scale)
        if whole is not None:
            return (replace(whole, caption="whole road"),)
    pages, of_all = _parts(laid, (first, last), scale or _SMALLEST_WHOLE, what), ""
    if pages is None:
        pages = [_largest(laid, window.s_from, window.s_to, scale, what) for window in tightest_windows(result)]
        of_all = f" of {path.length:.0f} m; only the tightest stretches are drawn"
    captions = [f"sheet {n} of {len(pages)}: s = {page.s_from:z.0f} to {page.s_to:z.0f} m" for n, page in enumerate(pages, start=1)]
    return tuple(replace(page, caption=caption + of_all) for page, caption in zip(pages, captions, strict=True))


def page_around(points: FloatArray, length: float, field_mm: tuple[float, float], scale: int | None) -> Page:
    """Return one sheet with all of ``points`` (n, 2) [m], at 1:``scale`` or the largest round scale that fits; else an ``OptionError``."""
    scales = (scale,) if scale is not None else SCALES
    laid = (_laid(points, Page(0.0, length, 0.0, (0.0, 0.0), one, "whole drive"), field_mm) for one in scales)
    found = next((page for page in laid if page is not None), None)
    if found is None:
        raise _refusal(scales[-1], "the whole drive")
    return found


def _laid(points: FloatArray, page: Page, field_mm: tuple[float, float]) -> Page | None:
    """Return a page turned and moved so that it holds ``points``, north up if they fit so; None where they fit neither way."""
    room = [(side - 2.0 * _ROOM_MM) * page.scale / 1e3 for side in field_mm]
    for turn in (0.0, _levelling(points)):
        turned = replace(page, turn=turn)
        low, high = (pick(turned.turned(points), axis=0) for pick in (np.min, np.max))
        if np.all(high - low <= room):
            middle = 0.5 * (low + high)
            return replace(turned, middle=(float(middle[0]), float(middle[1])))
    return None


def _refusal(scale: int, what: str) -> OptionError:
    return OptionError(
        f"at 1:{scale} the sheet has no room for {what}", hint="leave --scale out for the largest that fits, or take a larger sheet"
    )


def _parts(laid: Laid, stretch: tuple[float, float], scale: int, what: str) -> list[Page] | None:
    pages, (begin, end) = list[Page](), stretch
    while len(pages) < _MOST_SHEETS:
        last = laid(begin, end, scale)
        if last is not None:
            return [*pages, last]
        fits, fails = min(begin + 2.0 * _OVERLAP_M, end), end
        page = laid(begin, fits, scale)
        if page is None:
            raise _refusal(scale, what)
        while fails - fits > _SPACING_M:
            middle = 0.5 * (fits + fails)
            longer = laid(begin, middle, scale)
            page, fits, fails = (page, fits, middle) if longer is None else (longer, middle, fails)
        pages.append(page)
        begin = fits - _OVERLAP_M
    return None


def _largest(laid: Laid, begin: float, end: float, scale: int | None, what: str) -> Page:
    """Return a tight stretch at the largest round scale that it fits at; at a given scale, as much of its middle as fits."""
    for round_scale in SCALES if scale is None else (scale,):
        page = laid(begin, end, round_scale)
        if page is not None:
            return page
    smallest = scale or SCALES[-1]
    middle, half = 0.5 * (begin + end), 0.5 * (end - begin)
    while half > _OVERLAP_M:
        half -= _SPACING_M
        page = laid(middle - half, middle + half, smallest)
        if page is not None:
            return page
    raise _refusal(smallest, what)


def _levelling(points: FloatArray) -> float:
    """Return the turn [rad], within +-90 degrees, that lays the long side of the points' narrowest rectangle level."""
    ring = np.asarray(shapely.get_coordinates(shapely.oriented_envelope(shapely.MultiPoint(points))))
    sides = np.diff(ring, axis=0)
    if len(sides) < 2:  # noqa: PLR2004 - points in one line
        sides = points[-1:] - points[:1]
    long = sides[int(np.argmax(np.hypot(*sides.T)))]
    angle = float(np.arctan2(long[1], long[0]))
    return -(angle - np.pi * round(angle / np.pi))
