"""The picture of a plan: the swept area on the road, and what it looks like over the road's length."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec

from hdvplan.jit import FloatArray
from hdvplan.report.maps import LIMIT_COLOUR, body_colour, body_fill, draw_map, draw_overview
from hdvplan.report.result import Result, body_name
from hdvplan.report.windows import Window, tightest_windows

WIDTH_IN = 11.0
LONG_ROAD_M = 300.0  # beyond it a body is a speck: an overview with enlargements instead of one map
_MAP_HEIGHT_IN = (3.0, 7.0)  # of the map panel, whatever the road's proportions
_PROFILE_HEIGHT_IN = 2.0


def plan_figure(result: Result) -> Figure:
    """Return the figure of a plan: map or overview with enlargements, envelope, curvature, articulation over s."""
    drive = result.drive
    profiles = 2 + (len(drive.vehicle.units) > 1)
    long = drive.road.path.length > LONG_ROAD_M
    map_height = _MAP_HEIGHT_IN[1] if long else _map_height(result)
    figure = Figure(figsize=(WIDTH_IN, map_height + _PROFILE_HEIGHT_IN * profiles + 1.0), layout="constrained")
    rows = figure.add_gridspec(1 + profiles, 1, height_ratios=[map_height] + [_PROFILE_HEIGHT_IN] * profiles)
    windows = tightest_windows(result) if long else ()
    if long:
        _draw_long_maps(figure, rows[0], result, windows)
    else:
        axes = figure.add_subplot(rows[0])
        draw_map(axes, result, Window(0.0, drive.road.path.length))
        axes.legend(loc="best", fontsize="small", framealpha=0.9)
    envelope = figure.add_subplot(rows[1])
    curvature = figure.add_subplot(rows[2], sharex=envelope)
    _draw_envelope(envelope, result)
    _draw_curvature(curvature, result)
    last = curvature
    if profiles > 2:  # noqa: PLR2004 - envelope and curvature come first
        last = figure.add_subplot(rows[3], sharex=envelope)
        _draw_articulation(last, result)
    for axes in (envelope, curvature, last):
        axes.label_outer()
        _mark(axes, windows)
        axes.grid(visible=True, color="0.9", linewidth=0.6)
        axes.set_xlim(0.0, drive.road.path.length)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(loc="upper left", bbox_to_anchor=(1.005, 1.0), borderaxespad=0.0, fontsize="small", frameon=False)
    last.set_xlabel("arclength s [m]")
    scheme = str(drive.settings.scheme).upper()
    figure.suptitle(f"{drive.vehicle.name} on {drive.road.name}: {scheme}, {result.solver}, {result.objective}", fontsize="large")
    if drive.road.notice is not None:
        figure.supxlabel(drive.road.notice, fontsize="x-small", color="0.35", x=0.01, ha="left")
    return figure


def _map_height(result: Result) -> float:
    """Return the height at which a map of equal scale fills the figure's width [in]."""
    path = result.drive.road.path
    x, y = path.to_plane(np.linspace(0.0, path.length, 400), 0.0)
    room = 4.0 * result.drive.vehicle.width
    filled = WIDTH_IN * (float(np.ptp(y)) + room) / (float(np.ptp(x)) + room)
    return float(np.clip(filled, *_MAP_HEIGHT_IN))


def _draw_long_maps(figure: Figure, place: SubplotSpec, result: Result, windows: tuple[Window, ...]) -> None:
    columns = place.subgridspec(1, 2, width_ratios=[1.0, 1.15])
    overview = figure.add_subplot(columns[0])
    draw_overview(overview, result, windows)
    cells = columns[1].subgridspec(len(windows), 1)
    for number, window in enumerate(windows):
        axes = figure.add_subplot(cells[number])
        draw_map(axes, result, window)
        axes.set_title(window.title, fontsize="small", loc="left")
        if number == 0:
            axes.legend(loc="best", fontsize="x-small", framealpha=0.9)


def _draw_envelope(axes: Axes, result: Result) -> None:
    envelope, drive = result.envelope, result.drive
    s = envelope.s
    for unit in reversed(range(len(drive.vehicle.units))):
        low, high = envelope.right[unit], envelope.left[unit]
        axes.fill_between(s, low, high, color=body_fill(unit), linewidth=0.0, label=body_name(drive.vehicle, unit))
    for unit in range(len(drive.vehicle.units)):
        axes.plot(s, np.column_stack([envelope.left[unit], envelope.right[unit]]), color=body_colour(unit), linewidth=1.0)
    _plot_expected(axes, s, result.expected.half_width, "geometric")
    _plot_expected(axes, s, -result.expected.half_width)
    if drive.road.limits is not None:
        left, right = drive.road.limits.table(s)[:2]
        for limit, label in ((left, "limits"), (right, None)):
            axes.plot(s, limit, color=LIMIT_COLOUR, linestyle=(0, (5, 2)), linewidth=1.2, label=label)
    for number, finding in enumerate(result.fit.findings):
        label = "does not fit, by geometry" if number == 0 else None
        axes.axvspan(finding.s_from, finding.s_to, color=LIMIT_COLOUR, alpha=0.15, linewidth=0.0, zorder=0, label=label)
    axes.axhline(0.0, color="0.6", linewidth=0.6)
    axes.set_ylabel("reach [m]\n(left positive)")


def _draw_curvature(axes: Axes, result: Result) -> None:
    drive = result.drive
    axes.plot(result.envelope.s, drive.road.path.at(result.envelope.s).curvature, color="0.65", linewidth=1.0, label="road")
    _plot_expected(axes, result.envelope.s, result.expected.kappa, "geometric")
    axes.stairs(drive.kappa, drive.stations.s[: len(drive.kappa) + 1], baseline=None, color=body_colour(0), linewidth=1.2, label="planned")
    axes.set_ylabel("curvature [1/m]")


def _draw_articulation(axes: Axes, result: Result) -> None:
    drive = result.drive
    couplings = drive.z.shape[1] - 2
    for coupling in range(couplings):
        label = "driven" if couplings == 1 else f"coupling {coupling + 1}"
        colour = body_colour(1 + coupling)
        axes.plot(drive.stations.s[: len(drive.z)], np.rad2deg(drive.z[:, 2 + coupling]), color=colour, linewidth=1.2, label=label)
        geometric = np.rad2deg(result.expected.beta[:, coupling])
        _plot_expected(axes, result.envelope.s, geometric, "geometric" if coupling == 0 else None)
    axes.set_ylabel("articulation [deg]")


def _plot_expected(axes: Axes, s: FloatArray, values: FloatArray, label: str | None = None) -> None:
    axes.plot(s, values, color="0.35", linestyle=":", linewidth=1.4, label=label)


def _mark(axes: Axes, windows: tuple[Window, ...]) -> None:
    """Shade the stretches that are enlarged."""
    for window in windows:
        axes.axvspan(window.s_from, window.s_to, color="0.88", linewidth=0.0, zorder=0)
