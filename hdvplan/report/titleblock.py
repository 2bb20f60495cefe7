"""What is beside the map on a sheet: title block, legend, and the vehicle from the side and from above."""

from __future__ import annotations

from textwrap import wrap

import shapely
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Arc, Circle, Patch, Rectangle

from hdvplan.judging.bodies import TRACK_NOTE
from hdvplan.judging.result import Result, body_name
from hdvplan.report.colours import BREACH, INK, MUTED
from hdvplan.report.drawing import dimension_rows, draw_plan_view
from hdvplan.report.heading import answer_colour, answer_line
from hdvplan.report.pages import Page
from hdvplan.report.placing import LONLAT_CODE, map_system
from hdvplan.report.style import body_colour, body_fill
from hdvplan.road.regions import Kind
from hdvplan.vehicle.model import Vehicle
from hdvplan.version import __version__

_MM_PT = 25.4 / 72.0
_LETTER, _BOLD = 0.56, 1.12  # mean width of a letter over the type's size, and what bold adds
_SMALL, _TEXT, _VERDICT = 5.5, 7.0, 9.5  # of type [pt]
_VIEW_SCALES = (50, 75, 100, 125, 150, 200, 250, 300, 400, 500)
_ROW_MM = 3.6  # between dimension lines
_HEIGHTS_M = (0.95, 3.6)  # of bodies in the side view: of no particular vehicle
_WHEEL_M = 0.5  # radius
_MARGIN_MM = 3.0


def draw_title(axes: Axes, result: Result, page: Page, paper: str, date: str, size_mm: tuple[float, float]) -> None:
    """Write verdict, road, vehicle, scale, coordinates, date, version and source into axes of ``size_mm``."""
    width, height = size_mm
    _in_millimetres(axes, size_mm)
    drive = result.drive
    y = height - _MARGIN_MM
    for line in _lines(answer_line(result), width, _BOLD * _VERDICT, 4):
        axes.text(_MARGIN_MM, y, line, fontsize=_VERDICT, fontweight="bold", color=answer_colour(result), va="top")
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
    ]
    y -= 1.5
    for name, value in rows:
        axes.plot([0.0, width], [y + 0.8, y + 0.8], color=MUTED, linewidth=0.3)
        axes.text(_MARGIN_MM, y, name, fontsize=_SMALL, color=MUTED, va="top")
        for line in _lines(value, width - 18.0, _TEXT, 2):
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


def draw_legend(axes: Axes, result: Result, size_mm: tuple[float, float]) -> None:
    """Draw what lines and areas mean into axes of ``size_mm``."""
    _in_millimetres(axes, size_mm)
    vehicle, road = result.drive.vehicle, result.drive.road
    handles: list[Patch | Line2D] = []
    for unit in range(len(vehicle.units)):
        only = "" if unit == 0 else " only"
        handles.append(
            Patch(facecolor=body_fill(unit), edgecolor=body_colour(unit), label=f"swept by {body_name(vehicle, unit)}{only}", linewidth=0.6)
        )
    handles.append(Line2D([], [], color=body_colour(0), linewidth=0.6, linestyle=(0, (5, 2)), label="wheel tracks"))
    handles.append(Line2D([], [], color=INK, linewidth=0.5, marker=">", markersize=4, label="road centre, s [m], direction of travel"))
    if road.limits is not None:
        handles.append(Line2D([], [], color=INK, linewidth=1.0, label="limits"))
        if road.limits.two_regions:
            handles.append(Line2D([], [], color=INK, linewidth=1.0, linestyle=(0, (1, 1.5)), label="limits of overhangs"))
    if result.balance.breaches:
        handles.append(Patch(facecolor=BREACH, edgecolor=BREACH, label="beyond a limit"))
    kinds = {region.kind for region in road.regions}
    if Kind.OBSTACLE in kinds:
        handles.append(Patch(facecolor="0.6", edgecolor=INK, label="obstacle", linewidth=0.6))
    if Kind.SWEEPABLE in kinds:
        handles.append(Patch(facecolor="none", edgecolor=MUTED, hatch="////", label="sweepable", linewidth=0.4))
    rows = -(-len(handles) // 2)
    spacing = min(0.55, 30.0 / rows / 6.0)
    axes.legend(
        handles=handles, loc="center left", ncols=1 if rows <= 3 else 2, fontsize=_SMALL + 0.5, handlelength=2.2, labelspacing=spacing,  # noqa: PLR2004 - six lines fill one column
        columnspacing=1.0, borderaxespad=0.6,
    )  # fmt: skip


def draw_vehicle_views(axes: Axes, vehicle: Vehicle, size_mm: tuple[float, float]) -> None:
    """Draw the vehicle from the side and, with its dimensions, from above, both to one round scale."""
    width, height = size_mm
    total, rows = vehicle.reach_ahead + vehicle.reach_behind, dimension_rows(vehicle)
    room = (0.5 * width - 14.0, height - 12.0 - _ROW_MM * (rows + 1))
    scale = next((s for s in _VIEW_SCALES if total * 1e3 / s <= room[0] and vehicle.width * 1e3 / s <= room[1]), _VIEW_SCALES[-1])
    mm = scale / 1e3  # metres that a millimetre shows
    middle = vehicle.reach_ahead - 0.5 * total
    high = 0.5 * vehicle.width + 2.0 * _ROW_MM * mm + 3.0 * mm
    plan_x = 0.25 * width * mm  # of the plan view's middle, right of the strip's
    axes.set_xlim(middle + plan_x + 0.5 * width * mm, middle + plan_x - 0.5 * width * mm)  # ahead is to the left
    axes.set_ylim(high - height * mm, high)
    draw_plan_view(axes, vehicle, _ROW_MM * mm, 2.0 * mm, fontsize=_TEXT - 1.0)
    side_x, ground = 0.5 * width * mm, -0.5 * vehicle.width - 0.5 * _ROW_MM * rows * mm
    _draw_side_view(axes, vehicle, side_x, ground)
    text = f"{vehicle.name}   1:{scale}   dimensions in metres; heights and wheels of the side view are no particular vehicle's"
    axes.text(_MARGIN_MM / width, _MARGIN_MM / height, text, transform=axes.transAxes, fontsize=_SMALL + 0.5, color=INK)


def _draw_side_view(axes: Axes, vehicle: Vehicle, x: float, ground: float) -> None:
    """Draw bodies and wheels as seen from their left side, ``x`` ahead of the plan view, on a ground line."""
    low, high = _HEIGHTS_M
    axle = x
    for number, unit in enumerate(vehicle.units):
        corner = (axle - unit.rear_overhang, ground + low)
        axes.add_patch(
            Rectangle(corner, unit.length, high - low, facecolor=body_fill(number), edgecolor=body_colour(number), linewidth=0.8)
        )
        for at in (axle + unit.wheelbase, axle) if number == 0 else (axle,):
            axes.add_patch(
                Arc((at, ground + low), 2.6 * _WHEEL_M, 2.2 * _WHEEL_M, theta1=0.0, theta2=180.0, color=INK, linewidth=0.5, zorder=3)
            )
            axes.add_patch(Circle((at, ground + _WHEEL_M), _WHEEL_M, facecolor="white", edgecolor=INK, linewidth=0.9, zorder=4))
            axes.add_patch(Circle((at, ground + _WHEEL_M), 0.4 * _WHEEL_M, facecolor="none", edgecolor=INK, linewidth=0.5, zorder=4))
        if number + 1 < len(vehicle.units):
            behind = vehicle.units[number + 1]
            axle -= unit.hitch_offset
            axes.plot(
                [axle + unit.hitch_offset, axle, axle - max(0.0, -behind.front_overhang)], [ground + 0.8] * 3, color=INK, linewidth=1.0
            )
            axes.plot([axle], [ground + 0.8], marker="o", color=INK, markersize=2.5, zorder=5)
            axle -= behind.wheelbase
    axes.plot([x + vehicle.reach_ahead + 0.5, x - vehicle.reach_behind - 0.5], [ground, ground], color=INK, linewidth=0.6)


def _in_millimetres(axes: Axes, size_mm: tuple[float, float]) -> None:
    axes.set_xlim(0.0, size_mm[0])
    axes.set_ylim(0.0, size_mm[1])


def _lines(text: str, width_mm: float, size: float, most: int) -> list[str]:
    """Return a text in lines that are not wider than ``width_mm`` at a ``size`` of type [pt]; what is left is cut."""
    letters = max(8, int((width_mm - _MARGIN_MM) / (_LETTER * size * _MM_PT)))
    lines = wrap(text, letters, max_lines=most, placeholder=" ...")
    return lines or [""]
