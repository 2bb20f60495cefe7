"""The picture of a plan: the swept area on the road, and what it looks like over the road's length."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import MaxNLocator

from hdvplan.arrays import BoolArray, FloatArray
from hdvplan.judging.result import Result, body_name
from hdvplan.judging.verdict import verdict_of, verdict_title
from hdvplan.report import BREACH, INK, MUTED, answer_colour, body_colour
from hdvplan.report.atlas import draw_atlas
from hdvplan.report.kerbs import judged_stretch
from hdvplan.report.rooms import FEW_BELOW_M, Window, breach_place, tightest_windows
from hdvplan.report.style import ON_WHITE, SLIDE_IN, body_fill, legend_above, mark_broken, styled, write_head

Panel = Callable[[Axes, Result, Window], None]
_SHADE = "0.90"
_NEAR_LIMIT = 3.0  # a curvature limit more than so many times the plan's largest would flatten the curve
_BY_END = 0.08  # of a panel's length: text there is written inwards
_FAR = 2.0  # limits this many reaches away would flatten the envelope


@styled()
def plan_figure(result: Result, fails: str = "") -> Figure:
    """Return the figure of a plan: map, or overview with enlargements; beside it envelope, curvature, articulation.

    ``fails`` ends the title: what does not hold, whatever the verdict.
    """
    drive, verdict = result.drive, verdict_of(result)
    length = drive.road.path.length
    windows = tightest_windows(result)
    figure = Figure(figsize=SLIDE_IN, layout="constrained")
    places, profiles = figure.subfigures(1, 2, width_ratios=[1.35, 1.0], squeeze=False)[0]
    draw_atlas(places, result, windows)
    if length > FEW_BELOW_M:
        _draw_long_profiles(profiles, result, windows)
    else:
        _draw_profiles(profiles, result, windows)
    title = f"{verdict_title(result, verdict)}{fails and '; '}{fails}"
    colour = answer_colour(fits=False if fails else verdict.holds)
    write_head(figure, title, colour, size="x-large", notice=drive.road.notice)
    figure.text(0.99, 0.008, result.origin, ha="right", va="bottom", fontsize="x-small", color=MUTED)
    return figure


def _panels(result: Result) -> list[Panel]:
    return [_draw_envelope, _draw_curvature, *([_draw_articulation] if len(result.drive.vehicle.units) > 1 else [])]


def _draw_profiles(figure: SubFigure, result: Result, windows: tuple[Window, ...]) -> None:
    draw = _panels(result)
    rows = figure.subplots(len(draw), 1, sharex=True, squeeze=False, height_ratios=[1.5] + [1.0] * (len(draw) - 1))[:, 0]
    for axes, draw_panel in zip(rows, draw, strict=True):
        draw_panel(axes, result, _whole(result))
        _finish_whole(axes, result, windows, named=axes is rows[0])
    rows[-1].set_xlabel("arclength s [m]")


def _draw_long_profiles(figure: SubFigure, result: Result, windows: tuple[Window, ...]) -> None:
    """Draw the reach over the whole length of a road on which bends are but spikes; the rest where it is enlarged."""
    draw = _panels(result)
    grid = figure.add_gridspec(2, 1, height_ratios=[1.1, 0.8 + len(draw)])
    axes = figure.add_subplot(grid[0])
    _draw_envelope(axes, result, _whole(result))
    _finish_whole(axes, result, windows, named=True)
    axes.set_xlabel("arclength s [m]", labelpad=1.0)
    cells = grid[1].subgridspec(len(draw), len(windows), height_ratios=[1.5] + [1.0] * (len(draw) - 1))
    panels = cells.subplots(sharey="row", squeeze=False)
    for row, draw_panel in enumerate(draw):
        for axes, window in zip(panels[row], windows, strict=True):
            draw_panel(axes, result, window)
            axes.grid(visible=True)
            axes.set_xlim(window.s_from, window.s_to)
            axes.label_outer()
            axes.xaxis.set_major_locator(MaxNLocator(2, integer=True))
            axes.set_title(window.label if row == 0 else " ", fontsize="small", fontweight="bold", loc="right")
    for axes in panels[1:, 0]:  # the whole road's envelope has the first row's legend
        legend_above(axes, columns=5).set_in_layout(False)  # it is wider than one column
    panels[-1, 0].set_xlabel("s [m]")  # which also keeps the numbers off the line below


def _whole(result: Result) -> Window:
    return Window(0.0, result.drive.road.path.length)


def _within(s: FloatArray, window: Window) -> BoolArray:
    """Return which samples a panel over ``window`` needs; one more on either side joins its lines to its edges."""
    margin = 2.0 * (s[1] - s[0])
    inside: BoolArray = (s >= window.s_from - margin) & (s <= window.s_to + margin)
    return inside


def _finish_whole(axes: Axes, result: Result, windows: tuple[Window, ...], *, named: bool) -> None:
    axes.grid(visible=True)
    length = result.drive.road.path.length
    within = all(0.0 <= breach.s_deepest <= length for breach in result.balance.breaches)
    axes.set_xlim(*((0.0, length) if within else judged_stretch(result, 0.0, length)))
    for number, window in enumerate(windows):
        label = "enlarged on maps" if named and number == 0 else None
        axes.axvspan(window.s_from, window.s_to, color=_SHADE, linewidth=0.0, zorder=0, label=label)
        if named:
            axes.text(
                window.s_from,
                0.03,
                window.label,
                transform=axes.get_xaxis_transform(),
                ha="left",
                bbox=ON_WHITE,
                fontsize="small",
                fontweight="bold",
            )
    legend_above(axes, columns=4)


def _draw_envelope(axes: Axes, result: Result, window: Window) -> None:
    envelope, vehicle = result.envelope, result.drive.vehicle
    shown = _within(envelope.s, window)
    s, left, right, expected = envelope.s[shown], envelope.left[:, shown], envelope.right[:, shown], result.expected.half_width[shown]
    for unit in reversed(range(len(vehicle.units))):
        axes.fill_between(s, right[unit], left[unit], color=body_fill(unit), linewidth=0.0, label=body_name(vehicle, unit))
    for unit in range(len(vehicle.units)):
        axes.plot(s, np.column_stack([left[unit], right[unit]]), color=body_colour(unit), linewidth=1.0)
    _plot_expected(axes, s, result.aim[shown] + expected, "balanced circle")
    _plot_expected(axes, s, result.aim[shown] - expected)
    _draw_limits(axes, result, shown, window)
    for number, finding in enumerate(result.fit.findings):
        label = "tight or narrow, by geometry" if number == 0 else None
        s_from, s_to = max(finding.s_from, window.s_from), min(finding.s_to, window.s_to)
        if s_from < s_to:
            axes.axvspan(s_from, s_to, color=BREACH, alpha=0.15, linewidth=0.0, zorder=0.5, label=label)  # over enlarged stretches
    axes.axhline(0.0, color=MUTED, linewidth=0.6)
    axes.set_ylabel("reach [m]\n(left positive)")


def _draw_limits(axes: Axes, result: Result, shown: BoolArray, window: Window) -> None:
    """Draw limits as they lie beside the line, crosses where bodies reach furthest beyond them, and how deep the deepest is."""
    limits, s = result.drive.road.beside, result.envelope.s[shown]
    if limits is None:
        return
    seen = _FAR * max(float(np.max(result.envelope.reach_left)), -float(np.min(result.envelope.reach_right)))
    table = limits.table(s)
    table[np.abs(table) > seen] = np.nan
    label: str | None = "limits" if np.any(np.isfinite(table)) else "limits (further out)"
    for wheels, overhangs in ((table[0], table[2]), (table[1], table[3])):
        axes.plot(s, wheels, color=INK, linewidth=1.2, label=label)
        if np.any(np.abs(overhangs - wheels) > 0.0):  # False where both lie too far out to be drawn
            axes.plot(s, overhangs, color=INK, linewidth=1.1, linestyle=(0, (1, 1.5)), label="of overhangs" if label else None)
        label = None
    begin, end = judged_stretch(result, window.s_from, window.s_to)
    here = [breach for breach in result.balance.breaches if begin <= breach.s_deepest <= end]
    if not here:
        return
    places = [breach_place(result, breach) for breach in here]
    mark_broken(axes, np.array(places), "limit broken")
    deepest = max(here, key=lambda breach: breach.depth)
    place = breach_place(result, deepest)
    outwards = 1.0 if place[1] > 0.0 else -1.0
    what = "beyond" if deepest.obstacle is None else f"into {deepest.obstacle or 'an obstacle'}"
    share = (place[0] - window.s_from) / (window.s_to - window.s_from)
    aligned = "left" if share < _BY_END else "right" if share > 1.0 - _BY_END else "center"
    axes.annotate(
        f"{deepest.depth:.2f} m {what}", place, xytext=(0.0, 7.0 * outwards),
        textcoords="offset points", ha=aligned, va="bottom" if outwards > 0.0 else "top", color=BREACH, fontweight="bold", fontsize="small",
        bbox=ON_WHITE,
    ).set_in_layout(False)  # fmt: skip
    axes.margins(y=0.16)


def _draw_curvature(axes: Axes, result: Result, window: Window) -> None:
    drive, shown = result.drive, _within(result.envelope.s, window)
    s = result.envelope.s[shown]
    axes.plot(s, drive.road.path.at(s).curvature, color="0.65", linewidth=1.2, label="road")
    _plot_expected(axes, s, result.expected.kappa[shown], "balanced circle")
    edges = drive.stations.s[: len(drive.kappa) + 1]
    held = np.flatnonzero(_within(edges[:-1], window))
    planned, edges = drive.kappa[held], edges[held[0] : held[-1] + 2]
    axes.stairs(planned, edges, baseline=None, color=body_colour(0), linewidth=1.3, label="planned" if result.planned else "driven")
    _draw_curvature_limit(axes, drive.vehicle.max_curvature, planned)
    axes.set_ylabel("curvature [1/m]")


def _draw_curvature_limit(axes: Axes, most: float, planned: FloatArray) -> None:
    """Draw the vehicle's limit on the sides where the plan comes within reach of it; elsewhere it would flatten the curve."""
    label: str | None = "vehicle's limit"
    for sign in (1.0, -1.0):
        if _NEAR_LIMIT * float(np.max(sign * planned)) > most:
            axes.axhline(sign * most, color=BREACH, linestyle=(0, (4, 2)), linewidth=1.0, label=label)
            label = None
    if label:
        axes.plot([], [], color=BREACH, linestyle=(0, (4, 2)), linewidth=1.0, label=f"{label} ({most:.3f}, further out)")


def _draw_articulation(axes: Axes, result: Result, window: Window) -> None:
    drive = result.drive
    s, expected_s = drive.stations.s[: len(drive.z)], result.envelope.s
    shown, expected_shown = _within(s, window), _within(expected_s, window)
    couplings = len(drive.vehicle.units) - 1
    for coupling in range(couplings):
        label = "driven" if couplings == 1 else f"coupling {coupling + 1}"
        driven, geometric = np.rad2deg(drive.z[:, 2 + coupling]), np.rad2deg(result.expected.beta[:, coupling])
        axes.plot(s[shown], driven[shown], color=body_colour(1 + coupling), linewidth=1.3, label=label)
        _plot_expected(axes, expected_s[expected_shown], geometric[expected_shown], "balanced circle" if coupling == 0 else None)
    axes.set_ylabel("articulation [deg]")


def _plot_expected(axes: Axes, s: FloatArray, values: FloatArray, label: str | None = None) -> None:
    axes.plot(s, values, color=INK, linestyle=(0, (1, 1.2)), linewidth=1.3, label=label)
