"""The drawing of a vehicle: its stretched bodies from above, to scale, with the dimensions of its TOML entries."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle
from matplotlib.transforms import Affine2D

from hdvplan.report import INK, body_colour
from hdvplan.report.style import body_fill, styled
from hdvplan.vehicle.model import Unit, Vehicle

WIDTH_IN = 11.0
_MARGIN_IN = 0.5
_LARGEST = 0.7  # of the drawing's scales: a short vehicle must not fill the page [in/m]
_ROW_IN = 0.3  # between dimension lines
_TEXT_IN = 0.2  # between lines of text
_WHEEL_M = (1.0, 0.32)
_TURNED_DEG = 14.0  # how far steered wheels are drawn turned
_LINE = "0.25"
_ENDS = {"arrowstyle": "<->", "linewidth": 0.9, "shrinkA": 0.0, "shrinkB": 0.0, "mutation_scale": 7.0}
_VIEW_SCALES = (50, 75, 100, 125, 150, 200, 250, 300, 400, 500)  # of the view on a sheet of paper
_ROW_MM = 3.6  # between dimension lines there


@styled()
def vehicle_figure(vehicle: Vehicle) -> Figure:
    """Return the drawing of a vehicle, its front to the left, dimensions in metres and a legend of all entries."""
    total, count = vehicle.reach_ahead + vehicle.reach_behind, len(vehicle.units)
    rows = _dimension_rows(vehicle)
    scale = min(_LARGEST, (WIDTH_IN - 2.0 * _MARGIN_IN - 0.5) / total)  # [in/m]; room for the width's dimension
    heights = [0.9 + vehicle.width * scale + _ROW_IN * rows, _TEXT_IN * (count + 1) + 0.15]
    figure = Figure(figsize=(WIDTH_IN, sum(heights)))
    axes = figure.add_axes((0.0, heights[1] / sum(heights), 1.0, heights[0] / sum(heights)))
    axes.set_axis_off()
    axes.set_aspect("equal")
    middle = vehicle.reach_ahead - 0.5 * total
    axes.set_xlim(middle + 0.5 * WIDTH_IN / scale, middle - 0.5 * WIDTH_IN / scale)  # ahead is to the left
    low = -0.5 * vehicle.width - (_ROW_IN * rows + 0.1) / scale
    axes.set_ylim(low, low + heights[0] / scale)
    _draw_plan_view(axes, vehicle, _ROW_IN / scale, 0.25 / scale)
    figure.text(_MARGIN_IN / WIDTH_IN, 1.0 - 0.3 / sum(heights), vehicle.name, fontsize="large", fontweight="bold")
    for line, (text, colour) in enumerate(_legend(vehicle)):
        y = (heights[1] - _TEXT_IN * (line + 0.5)) / sum(heights)
        figure.text(_MARGIN_IN / WIDTH_IN, y, text, fontsize=8.5, color=colour, va="center")
    return figure


def _dimension_rows(vehicle: Vehicle) -> int:
    """Return how many rows of dimensions a plan view has below it; another one lies above. The last unit has no hitch offset."""
    return 2 * len(vehicle.units) - (vehicle.units[-1].front_overhang >= 0.0)


def _draw_plan_view(axes: Axes, vehicle: Vehicle, row: float, gap: float, *, fontsize: float = 8.0) -> None:
    """Draw a vehicle from above with its dimensions, rows of them ``row`` apart, and its width ``gap`` behind it [m].

    The lead rear axle lies at the origin, the front in the direction of x.
    """
    axle = 0.0  # of the unit, ahead of the lead rear axle
    for number, unit in enumerate(vehicle.units):
        _draw_unit(axes, number, unit, axle)
        _draw_dimensions(axes, number, unit, axle, -0.5 * vehicle.width - row * (2 * number + 1), row, fontsize)
        if number + 1 < len(vehicle.units):
            axle -= unit.hitch_offset
            axes.add_patch(Circle((axle, 0.0), 0.16, facecolor="white", edgecolor=_LINE, zorder=6))
            axle -= vehicle.units[number + 1].wheelbase
    whole = f"{vehicle.reach_ahead + vehicle.reach_behind:.2f} m"
    _dimension(axes, vehicle.reach_ahead, -vehicle.reach_behind, 0.5 * vehicle.width + row, whole, _LINE, fontsize)
    _draw_width(axes, vehicle, gap, fontsize)


def _draw_unit(axes: Axes, number: int, unit: Unit, axle: float) -> None:
    half = 0.5 * unit.width
    colour = body_colour(number)
    body = Rectangle((axle - unit.rear_overhang, -half), unit.length, unit.width)
    body.set(facecolor=(*body_fill(number), 0.75), edgecolor=colour, linewidth=1.4, zorder=2 + 0.1 * number)
    axes.add_patch(body)
    if unit.front_overhang < 0.0:  # the bare drawbar
        tip, base = axle + unit.wheelbase, axle + unit.front
        axes.add_patch(Polygon([(tip, 0.0), (base, 0.35 * unit.width), (base, -0.35 * unit.width)], fill=False, edgecolor=colour, zorder=3))
    steered = unit.steering_ratio > 0.0
    _draw_axle(axes, axle, half, -_TURNED_DEG if steered else 0.0, colour if steered else _LINE)
    if number == 0:
        _draw_axle(axes, axle + unit.wheelbase, half, _TURNED_DEG, _LINE)


def _draw_axle(axes: Axes, at: float, half: float, turned: float, colour: str) -> None:
    length, thick = _WHEEL_M
    axes.plot([at, at], [-half + thick, half - thick], color=colour, linewidth=1.2, zorder=4)
    for y in (-half + thick, half - thick):
        wheel = Rectangle((at - 0.5 * length, y - 0.5 * thick), length, thick, facecolor=colour, edgecolor="none", zorder=5)
        wheel.set_transform(Affine2D().rotate_deg_around(at, y, turned) + axes.transData)
        axes.add_patch(wheel)


def _draw_dimensions(axes: Axes, number: int, unit: Unit, axle: float, y: float, pitch: float, fontsize: float) -> None:
    """Draw overhangs and wheelbase in one row, and in the next what overlaps them: a drawbar's negative overhang, the hitch offset."""
    colour, front = body_colour(number), axle + unit.wheelbase
    _dimension(axes, front, axle, y, f"{unit.wheelbase:.2f}", colour, fontsize)
    if unit.rear_overhang > 0.0:
        _dimension(axes, axle, axle - unit.rear_overhang, y, f"{unit.rear_overhang:.2f}", colour, fontsize)
    if unit.front_overhang != 0.0:
        below = pitch if unit.front_overhang < 0.0 else 0.0
        _dimension(axes, front, axle + unit.front, y - below, f"{unit.front_overhang:.2f}", colour, fontsize)
    if unit.hitch_offset != 0.0:
        _dimension(axes, axle, axle - unit.hitch_offset, y - pitch, f"hitch {unit.hitch_offset:.2f}", colour, fontsize)


def _dimension(axes: Axes, begin: float, end: float, y: float, text: str, colour: str, fontsize: float) -> None:
    """Draw a dimension line from ``begin`` to ``end`` at height ``y``, its text above it."""
    axes.annotate("", (end, y), (begin, y), arrowprops=_ENDS | {"color": colour})
    middle = (0.5 * (begin + end), y)
    axes.annotate(text, middle, (0.0, 1.0), textcoords="offset points", fontsize=fontsize, color=colour, ha="center", va="bottom")


def _draw_width(axes: Axes, vehicle: Vehicle, gap: float, fontsize: float) -> None:
    half, x = 0.5 * vehicle.units[-1].width, -vehicle.reach_behind - gap
    axes.annotate("", (x, -half), (x, half), arrowprops=_ENDS | {"color": _LINE})
    axes.annotate(f"{2.0 * half:.2f}", (x, 0.0), (3.0, 0.0), textcoords="offset points", fontsize=fontsize, color=_LINE, va="center")


def _legend(vehicle: Vehicle) -> list[tuple[str, str]]:
    """Return the lines of text under the drawing with their colours: every unit's entries by name, then the source."""
    lines = []
    for number, unit in enumerate(vehicle.units):
        called = f" ({unit.name})" if unit.name else ""
        entries = (
            f"unit {number + 1}{called}: wheelbase {unit.wheelbase:.2f}, overhangs {unit.front_overhang:.2f} and {unit.rear_overhang:.2f}"
        )
        entries += f", width {unit.width:.2f}"
        if number + 1 < len(vehicle.units):
            entries += f", hitch_offset {unit.hitch_offset:.2f}"
        if number == 0:
            radius = 1.0 / vehicle.max_curvature
            entries += f"; front wheels to {np.rad2deg(np.arctan(unit.wheelbase * vehicle.max_curvature)):.0f}°, as a radius {radius:.1f} m"
        if unit.steering_ratio > 0.0:
            of = "the front wheels'" if number == 0 else "the articulation"
            most = np.rad2deg(unit.max_steering_angle)
            how = "axle steered by the plan, aiming at" if unit.active else "axle steered by"
            entries += f"; {how} {unit.steering_ratio:.2f} of {of} angle, to {most:.0f}°"
        lines.append((entries, body_colour(number)))
    return [*lines, (f"metres; {vehicle.source}" if vehicle.source else "metres", "0.35")]


def draw_vehicle_view(axes: Axes, vehicle: Vehicle, size_mm: tuple[float, float]) -> None:
    """Draw the vehicle from above with its dimensions, to a round scale."""
    width, height = size_mm
    total, rows = vehicle.reach_ahead + vehicle.reach_behind, _dimension_rows(vehicle)
    room = (width - 24.0, height - 12.0 - _ROW_MM * (rows + 1))
    scale = next((s for s in _VIEW_SCALES if total * 1e3 / s <= room[0] and vehicle.width * 1e3 / s <= room[1]), _VIEW_SCALES[-1])
    mm = scale / 1e3  # metres that a millimetre shows
    middle = vehicle.reach_ahead - 0.5 * total
    high = 0.5 * vehicle.width + 2.0 * _ROW_MM * mm + 3.0 * mm
    axes.set_xlim(middle + 0.5 * width * mm, middle - 0.5 * width * mm)  # ahead is to the left
    axes.set_ylim(high - height * mm, high)
    _draw_plan_view(axes, vehicle, _ROW_MM * mm, 2.0 * mm, fontsize=6.0)
    text = f"{vehicle.name}   1:{scale}   dimensions in metres"
    axes.text(3.0 / width, 3.0 / height, text, transform=axes.transAxes, fontsize=6.0, color=INK)
