"""The maps on a sheet: the road at the sheet's scale, and tight places enlarged with their clearance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import FloatArray, IntArray
from hdvplan.judging.bodies import corners, pose_at
from hdvplan.judging.result import Result, body_name
from hdvplan.report import BAND, BREACH, INK, MUTED
from hdvplan.report.layers import Drawn, outline_places
from hdvplan.report.maps import draw_bodies, draw_direction, draw_features, draw_letter, draw_north, draw_room, draw_tube
from hdvplan.report.paper import BAND_MM, MM_PT, Page, Size
from hdvplan.report.rooms import Room, nearly, peaks, pose_touching, room_at, shown_reach, tightness
from hdvplan.report.style import ON_WHITE
from hdvplan.road.path import ReferencePath

_BARS_M = (200.0, 100.0, 50.0, 20.0, 10.0, 5.0, 2.0, 1.0)
_LONGEST_BAR_MM = 105.0
_INSET_SCALES = ((1000, 200), (200, 100), (100, 50), (40, 20), (20, 10), (0, 5))  # from this scale of the sheet on: at least twice as large
_PLACES_APART_M = 15.0
_INWARDS_M = 1.2  # that the road is looked at from an enlarged place
_TICKS_M = (5.0, 10.0, 20.0, 50.0, 100.0)
_TICK_MM = 28.0  # at least, between two
_ARROWS_MM = 70.0  # between arrows along the road
_LETTER_PT = 25.0  # from the place that it names
_BUBBLE_MM, _FREE_MM = 4.0, 6.5  # of a letter's circle to the frame; from it to a station's number
_TICKED_MM, _NUMBER_MM = np.array([0.8, 2.0, 4.2]), 2.0  # of a station's tick and number to what is swept; of the number to the frame
_KEY_POINTS = 400
_LEVEL = 1e-3  # turn of a sheet with north up [rad]
_SMALL, _TINY = 7.0, 6.0  # of type [pt]


def places_of(result: Result, page: Page, size_mm: Size, most: int, shown: Sequence[float] = ()) -> list[tuple[str, Room]]:
    """Return the tightest places on a sheet's map, of ``size_mm``, and others nearly as tight, lettered in road order.

    Near those ``shown`` at s [m] only tighter ones count.
    """
    s, score = result.envelope.s, tightness(result)
    inside = np.where((s >= page.s_from) & (s <= page.s_to), score, -np.inf)
    for at in shown:
        inside[(np.abs(s - at) < _PLACES_APART_M) & (score <= np.interp(at, s, score))] = -np.inf
    for at in (0, len(s) - 1):  # what lies before and after the road counts there
        inside[at] = inside[at] if _on_map(room_at(result, at), page, size_mm) else -np.inf
    rooms = (room_at(result, at) for at in sorted(peaks(s, nearly(inside), _PLACES_APART_M, most)))
    return [(chr(ord("A") + number), room) for number, room in enumerate(room for room in rooms if _on_map(room, page, size_mm))]


def _on_map(room: Room, page: Page, size_mm: Size) -> bool:
    off = np.abs(page.turned(room.beyond[None])[0] - page.middle)
    return bool(np.all(off < 0.5 * np.array(size_mm) * page.scale / 1e3))


def draw_field(
    axes: Axes, result: Result, features: tuple[Drawn, ...], page: Page, size_mm: Size, places: list[tuple[str, Room]],
    *, tubes: bool,
) -> None:  # fmt: skip
    """Draw a sheet's stretch of road, filling the axes, of ``size_mm``, exactly to scale; ``tubes``: enlarged places have bands."""
    drive, mm = result.drive, page.scale / 1e3  # metres that a millimetre shows
    poses = np.array([pose_at(drive, s) for s in outline_places(result, page.s_from, page.s_to)])
    _draw_ground(axes, result, features, page, look_at_page(axes, page, size_mm), poses)
    if tubes:
        axes.fill([], [], color=BAND, label="with the driver's error, where enlarged")
    _draw_stations(axes, result, page, mm, [_bubble(axes, room, page) for _, room in places])
    count = max(1, int((page.s_to - page.s_from) / (_ARROWS_MM * mm)))
    draw_direction(axes, drive.road.path, page.s_from, page.s_to, count=count, weight=1.0, turned=page.turned)
    for letter, room in places:
        draw_place(axes, letter, room, page)
    draw_marks(axes, page, size_mm, north=drive.road.to_lonlat is not None)


def draw_place(axes: Axes, letter: str, room: Room, page: Page) -> None:
    """Write the letter of an enlarged place beside it."""
    at, centre = shapely.get_coordinates(_bubble(axes, room, page))
    away = _LETTER_PT / np.hypot(*(centre - at)) * (centre - at)
    draw_letter(axes, letter, at, (float(away[0]), float(away[1])), BREACH if room.broken else INK)


def _bubble(axes: Axes, room: Room, page: Page) -> BaseGeometry:
    """Return the line from an enlarged place to its letter, as it lies on a sheet: outwards or, at the frame, to another side."""
    mm = page.scale / 1e3
    at, out = page.turned(np.stack([room.beyond, room.outwards]))
    inside = _inside(axes, mm, _BUBBLE_MM)
    turns = (0.0, 0.25, -0.25, 0.5, -0.5, 1.0)  # of pi
    lines = [_away(at, out, np.pi * turn, _LETTER_PT * MM_PT * mm) for turn in turns]
    return next((line for line in lines if inside.contains(shapely.Point(line.coords[1]))), lines[0])


def _inside(axes: Axes, mm: float, off: float) -> BaseGeometry:
    """Return what of a map lies above its band of marks, and so far off its frame [mm]."""
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    return shapely.box(left, low + BAND_MM * mm, right, high).buffer(-off * mm)


def _away(at: FloatArray, out: FloatArray, turn: float, long: float) -> shapely.LineString:
    cos, sin = np.cos(turn), np.sin(turn)
    return shapely.LineString([at, at + long * (out @ np.array([[cos, sin], [-sin, cos]]))])


def draw_key(axes: Axes, path: ReferencePath, page: Page) -> None:
    """Draw the whole line, small and with north above, and the stretch that a sheet shows."""
    for s_from, s_to, colour, width in ((0.0, path.length, MUTED, 0.8), (page.s_from, page.s_to, INK, 2.0)):
        axes.plot(*path.to_plane(np.linspace(s_from, s_to, _KEY_POINTS), 0.0), color=colour, linewidth=width)
    axes.margins(0.15)
    axes.set_aspect("equal", adjustable="datalim")
    axes.text(0.5, 0.97, "key plan", transform=axes.transAxes, ha="center", va="top", fontsize=_TINY, color=MUTED, bbox=ON_WHITE, zorder=9)


def draw_marks(axes: Axes, page: Page, size_mm: Size, *, north: bool) -> None:
    """Draw the scale bar and, on maps with a place on earth, a north arrow, in a strip of their own."""
    mm, (left, right), low = page.scale / 1e3, axes.get_xlim(), axes.get_ylim()[0]
    axes.add_patch(Rectangle((left, low), right - left, BAND_MM * mm, facecolor="white", edgecolor=INK, linewidth=0.5, zorder=8.5))
    _draw_bar(axes, page, size_mm)
    if north and abs(page.turn) > _LEVEL:
        place, words = (1.0 - 22.0 / size_mm[0], 7.5 / size_mm[1]), "north is not up here"
        axes.text(*place, words, transform=axes.transAxes, fontsize=_SMALL, ha="right", va="center", zorder=9)
    if north:
        draw_north(axes, (1.0 - 10.0 / size_mm[0], 12.0 / size_mm[1]), page.turn)


def draw_inset(
    axes: Axes, size_mm: Size, result: Result, features: tuple[Drawn, ...], page: Page, place: tuple[str, Room],
    tube: BaseGeometry | None = None,
) -> None:  # fmt: skip
    """Draw the surroundings of a tight place, larger, with the vehicle where it is tightest and the clearance as a dimension.

    ``tube`` is what bodies sweep there with the driver's error.
    """
    letter, room = place
    scale = inset_scale(page)
    ends = page.turned(room.ends)
    inwards = page.turned(-_INWARDS_M * room.outwards[None])[0]
    view = look_at(axes, (ends.mean(axis=0) if room.limited else ends[0]) + inwards, size_mm, scale)
    taken = _draw_ground(axes, result, features, page, view, np.array([pose_touching(result, room)]))
    if tube is not None:
        draw_tube(axes, tube, turned=page.turned)
    draw_room(axes, room, room.text, taken, turned=page.turned)
    body = body_name(result.drive.vehicle, room.unit)
    head_inset(axes, f"{letter}   1:{scale}   s = {room.s:z.1f} m, {body}, {room.side}")


def inset_scale(page: Page) -> int:
    """Return the scale of the places that are enlarged beside a page."""
    return next(inset for above, inset in _INSET_SCALES if page.scale >= above)


def head_inset(axes: Axes, text: str) -> None:
    """Write what an enlarged place is into its corner, and draw its frame."""
    axes.text(0.02, 0.97, text, transform=axes.transAxes, fontsize=_SMALL, va="top", fontweight="bold", bbox=ON_WHITE, zorder=9)
    axes.add_patch(Rectangle((0.0, 0.0), 1.0, 1.0, transform=axes.transAxes, fill=False, edgecolor=INK, linewidth=0.5))


def look_at_page(axes: Axes, page: Page, size_mm: Size) -> shapely.Polygon:
    """Let the axes show a page above the band of its scale bar, and return what they show."""
    middle = np.array([page.middle[0], page.middle[1] - 0.5 * BAND_MM * page.scale / 1e3])
    return look_at(axes, middle, size_mm, page.scale)


def look_at(axes: Axes, middle: FloatArray, size_mm: Size, scale: int) -> shapely.Polygon:
    """Let the axes show exactly what their size on paper has room for, and return that with a metre around it."""
    half = 0.5 * np.array(size_mm) * scale / 1e3
    low, high = middle - half, middle + half
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    return shapely.box(*(low - 1.0), *(high + 1.0))


def _draw_ground(
    axes: Axes, result: Result, features: tuple[Drawn, ...], page: Page, view: shapely.Polygon, poses: IntArray
) -> list[BaseGeometry]:
    taken = draw_features(axes, features, view, weight=1.0, turned=page.turned)
    return [*taken, *draw_bodies(axes, corners(result.drive, poses), weight=1.0, turned=page.turned)]


def _draw_stations(axes: Axes, result: Result, page: Page, mm: float, taken: list[BaseGeometry]) -> None:
    """Draw ticks with their arclength across the road's centre, on its right where ``taken`` has a letter on its left; else without it."""
    path, sides, inside = result.drive.road.path, shown_reach(result), _inside(axes, mm, _NUMBER_MM)
    step = next((step for step in _TICKS_M if step / mm >= _TICK_MM), _TICKS_M[-1])
    for s in np.arange(np.ceil(page.s_from / step), np.floor(page.s_to / step) + 1) * step:
        edges = [float(np.interp(s, result.envelope.s, side)) for side in sides]
        offsets = np.array([[-1.2 * mm, 1.2 * mm, *(edge + sign * _TICKED_MM * mm)] for edge, sign in zip(edges, (1.0, -1.0), strict=True)])
        both = page.turned(np.column_stack(path.to_plane(np.full(10, s), offsets.ravel()))).reshape(2, 5, 2)
        places = shapely.points(both[:, 4])
        free = shapely.contains(inside, places) & ~shapely.dwithin(places, shapely.union_all(taken), _FREE_MM * mm)
        ends = both[int(np.argmax(free))]
        for tick in (ends[:2], ends[2:4]):
            axes.plot(*tick.T, color=INK, linewidth=0.5, zorder=5)
        if np.any(free):
            x, y = ends[4].tolist()
            axes.text(x, y, f"{s:z.0f}", fontsize=_TINY, color=INK, ha="center", va="center", zorder=7)


def _draw_bar(axes: Axes, page: Page, size_mm: Size) -> None:
    """Draw the scale bar into the lower left corner: in the data's metres, so that it is as long as what it measures."""
    mm = page.scale / 1e3
    longest = min(_LONGEST_BAR_MM, 0.6 * size_mm[0])
    metres = next((bar for bar in _BARS_M if bar / mm <= longest), _BARS_M[-1])
    x, y = axes.get_xlim()[0] + 6.0 * mm, axes.get_ylim()[0] + 6.0 * mm
    axes.plot([x, x + metres], [y, y], color=INK, linewidth=1.2, solid_capstyle="butt", zorder=9, gid="scale-bar")
    for part in range(6):
        at, high = x + metres * part / 5, 2.0 if part in {0, 5} else 1.2
        axes.plot([at, at], [y, y + high * mm], color=INK, linewidth=0.7, zorder=9)
    for at, text in ((0.0, "0"), (0.2, f"{metres / 5:g}"), (1.0, f"{metres:g} m")):
        axes.text(x + at * metres, y + 2.6 * mm, text, fontsize=_SMALL, ha="center", va="bottom", zorder=9)
    axes.text(x + 0.5 * metres, y + 2.6 * mm, f"1:{page.scale}", fontsize=8.0, fontweight="bold", ha="center", va="bottom", zorder=9)
