"""The figures of all studies, in the layout of the papers' own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
import pandas as pd
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline

from hdvplan.arrays import FloatArray
from hdvplan.judging.bodies import corners, pose_at
from hdvplan.report.geojson import swept_area
from hdvplan.report.maps import draw_direction, finish_map
from hdvplan.report.style import plain_decades, styled
from hdvplan.reproduce.published import StepTime
from hdvplan.reproduce.swept import Swept

BLUE, YELLOW, GREY = "#0072B2", "#E69F00", "0.35"  # the papers' blue and yellow, as Okabe and Ito have them
_PALE = 0.45
_BAR_SHARE = 0.2  # of a map's height, free below the road for the scale bar
_BODIES_M = 15.0  # of road between two drawn buses
_COLOURS = (BLUE, "#D55E00", "#009E73", YELLOW, "#CC79A7")


class Searched(Protocol):
    """What a search for K found."""

    @property
    def vehicle(self) -> str:
        """Its name."""

    @property
    def scores(self) -> FloatArray:
        """One score per weight [m^2]."""

    @property
    def geometric(self) -> float:
        """The geometric K."""


@styled()
def uturn_figure(previous: Swept, proposed: Swept) -> Figure:
    """Return [GEO] fig. 7: the bus on the road by the previous method, blue, and the proposed one, yellow; beside it the reaches."""
    figure = Figure(figsize=(12.0, 5.2), layout="constrained")
    road, reach = figure.subplots(1, 2, width_ratios=(1.25, 1.0))
    for found, colour, label in ((previous, BLUE, "previous: rear axle centred"), (proposed, YELLOW, "proposed: geometric weight")):
        _draw_area(road, found, colour, label)
        _draw_bodies(road, found, _BODIES_M, colour)
        reach.plot(found.envelope.s, found.left, color=colour, label=label)
        reach.plot(found.envelope.s, -found.right, color=colour)
    _draw_road(road, proposed)
    _draw_limits(reach, proposed)
    _plot_pair(reach, proposed.envelope.s, proposed.expected.half_width, "geometric half width")
    _finish(reach, "s [m]", "reach [m], left positive", "envelope")
    road.set_title("swept area", loc="left", fontsize="medium")
    road.legend(fontsize="small", loc="center left")
    return figure


@styled()
def roundabout_figure(planned: Swept, curves: Mapping[str, FloatArray]) -> Figure:
    """Return [GEO] figs. 8-10: swept area; envelope; curvature and articulation; the published curves pale underneath."""
    figure = Figure(figsize=(13.0, 8.0), layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=(1.0, 1.25))
    road, envelope, curvature, beta = (figure.add_subplot(place) for place in (grid[:, 0], grid[0, 1], grid[1, 1], grid[2, 1]))
    drive, s, expected = planned.drive, planned.envelope.s, planned.expected
    _draw_area(road, planned, YELLOW, "swept by the trailer, not by the tractor", unit=1)
    _draw_area(road, planned, BLUE, "swept by the tractor", unit=0)
    _draw_bodies(road, planned, 21.0, "0.2")
    _draw_road(road, planned)
    road.set_title("fig. 8: swept area", loc="left", fontsize="medium")
    road.legend(fontsize="small", loc="upper left")
    for side, label in (("left", "published"), ("right", None)):
        _plot_published(envelope, curves[f"env_plan_{side}"], label)
    envelope.plot(s, planned.left, color=BLUE, linewidth=1.4, label="planned")
    envelope.plot(s, -planned.right, color=BLUE, linewidth=1.4)
    _plot_pair(envelope, s, expected.half_width, "geometric")
    _draw_limits(envelope, planned)
    _finish(
        envelope, "", "reach [m], left positive", f"fig. 9: envelope, {planned.left.max():.2f} m left, {planned.right.max():.2f} m right"
    )
    _plot_published(curvature, curves["kappa_plan"], "published")
    curvature.plot(s, drive.road.path.at(s).curvature, color="0.55", linewidth=1.0, label="road")
    curvature.stairs(drive.kappa, drive.stations.s[: len(drive.kappa) + 1], baseline=None, color=BLUE, linewidth=1.4, label="planned")
    _plot_geometric(curvature, s, expected.kappa, "geometric")
    _finish(curvature, "", "curvature [1/m]", "fig. 10, top: tractor curvature")
    _plot_published(beta, curves["beta_plan"], "published")
    beta.plot(drive.stations.s[: len(drive.z)], drive.z[:, 2], color=BLUE, linewidth=1.4, label="planned")
    _plot_geometric(beta, s, expected.beta[:, 0], "geometric")
    _finish(beta, "s [m]", "articulation [rad]", "fig. 10, bottom: articulation angle")
    for axes in (envelope, curvature, beta):
        axes.set_xlim(0.0, drive.road.path.length)
    return figure


@styled()
def overhang_figure(found: Mapping[str, Swept], half: float) -> Figure:
    """Return [BUS] figs. 6-8: what the bus sweeps outside a lane of half width ``half`` [m] by each rule, on the road and over s."""
    figure = Figure(figsize=(13.0, 5.2), layout="constrained")
    road, envelope = figure.subplots(1, 2, width_ratios=(1.0, 1.3))
    for (label, one), colour in zip(found.items(), _COLOURS[:3], strict=True):
        _draw_area(road, one, colour, label)
        envelope.plot(one.envelope.s, one.left, color=colour, label=label)
        envelope.plot(one.envelope.s, -one.right, color=colour)
    last = list(found.values())[-1]
    _draw_bodies(road, last, _BODIES_M, "0.2")
    _draw_road(road, last)
    _plot_pair(envelope, last.envelope.s, np.full(len(last.envelope.s), half), "lane")
    _finish(envelope, "s [m]", "reach [m], left positive", "envelope")
    road.set_title("swept area", loc="left", fontsize="medium")
    return figure


@styled()
def objectives_figure(planned: Mapping[str, Swept], words: Mapping[str, str], searches: Sequence[Searched], shares: FloatArray) -> Figure:
    """Return [ART] figs. 4-5: the U-turn by every objective; below the envelopes, and the search for K."""
    figure = Figure(figsize=(15.0, 7.6), layout="constrained")
    grid = figure.add_gridspec(2, 1, height_ratios=(1.0, 2.0))
    above, below = grid[0].subgridspec(1, len(planned)), grid[1].subgridspec(1, 2, width_ratios=(1.8, 1.0))
    for place, (name, found), colour in zip(range(len(planned)), planned.items(), _COLOURS, strict=True):
        axes = figure.add_subplot(above[place])
        _draw_area(axes, found, colour, "swept area")
        _draw_bodies(axes, found, 26.0, "0.15")
        _draw_road(axes, found)
        axes.set_title(f"{name}: {words[name]}\n{found.left.max():.2f} m left, {found.right.max():.2f} m right", fontsize="medium")
    envelope, searching = figure.add_subplot(below[0]), figure.add_subplot(below[1])
    for (name, found), colour in zip(planned.items(), _COLOURS, strict=True):
        envelope.plot(found.envelope.s, found.left, color=colour, label=name)
        envelope.plot(found.envelope.s, -found.right, color=colour)
    some = next(iter(planned.values()))
    _plot_pair(envelope, some.envelope.s, some.expected.half_width, "geometric")
    _finish(envelope, "s [m]", "reach [m], left positive", "envelopes")
    for result, colour in zip(searches, (BLUE, YELLOW), strict=True):
        best = shares[int(np.argmin(result.scores))]
        searching.plot(shares, result.scores, "o-", markersize=3.5, color=colour, label=f"{result.vehicle}: best {best:.2f}")
        searching.axvline(result.geometric, color=colour, linestyle=(0, (4, 2)), label=f"geometric: {result.geometric:.3f}")
    _finish(searching, "K, weight of the trailer axle", "|aL - aR| summed [m²]", "search for K on U-turns")
    return figure


@styled()
def s_turns_figure(data: pd.DataFrame) -> Figure:
    """Return [GEO] fig. 11: the improvement by a varying K over maximum curvature and sharpness, a vehicle a panel, in one scale."""
    figure = Figure(figsize=(13.0, 5.2), layout="constrained")
    vehicles = list(dict.fromkeys(data["vehicle"]))
    low, high = float(data["improvement"].min()), float(data["improvement"].max())
    panels = figure.subplots(1, len(vehicles), squeeze=False)[0]
    for axes, name in zip(panels, vehicles, strict=True):
        table = data[data["vehicle"] == name].pivot_table(index="sharpness", columns="curvature", values="improvement")
        x, y, gain = table.columns.to_numpy(float), table.index.to_numpy(float), table.to_numpy(float)
        shades = axes.pcolormesh(x, y, gain, cmap="cividis", vmin=low, vmax=high, shading="nearest")
        lines = axes.contour(x, y, gain, colors="white", linewidths=1.0)
        axes.clabel(lines, fmt="%g %%", fontsize="small")
        axes.set_xlabel("maximum curvature [1/m]")
        axes.set_ylabel("sharpness [1/m²]")
        axes.set_title(f"{name}: gain in absolute D", loc="left", fontsize="medium")
    figure.colorbar(shades, ax=list(panels), label="gain in absolute D [%]")
    return figure


@styled()
def timing_figure(data: pd.DataFrame, published: Mapping[tuple[str, str], StepTime]) -> Figure:
    """Return [GEO] table I as bars: published, and each solver here; the mean as a bar and the largest as a mark, logarithmic."""
    figure = Figure(figsize=(10.0, 4.8), layout="constrained")
    axes = figure.subplots()
    solvers = list(dict.fromkeys(data["solver"]))
    labels = ["published: OSQP, MATLAB, laptop", *(f"here: {solver}" for solver in solvers)]
    width = 0.8 / len(labels)
    means, most = np.empty((len(labels), len(published))), np.empty((len(labels), len(published)))
    for column, ((vehicle, scheme), theirs) in enumerate(published.items()):
        means[0, column], most[0, column] = theirs.mean.value, theirs.most.value
        part = data[(data["vehicle"] == vehicle) & (data["scheme"] == scheme)].groupby("solver")["time_ms"]
        for row, solver in enumerate(solvers, start=1):
            means[row, column], most[row, column] = part.mean()[solver], part.max()[solver]
    for row, (label, colour) in enumerate(zip(labels, ("0.6", YELLOW, BLUE), strict=True)):
        x = np.arange(len(published)) + width * (row - 0.5 * (len(labels) - 1))
        axes.bar(x, means[row], 0.92 * width, color=colour, label=f"{label}, mean")
        axes.plot(x, most[row], linestyle="none", marker="v", color=colour, markeredgecolor="0.1", markersize=7)
        for place, mean in zip(x, means[row], strict=True):
            axes.annotate(f"{mean:.3g}", (place, mean), xytext=(0, -12), textcoords="offset points", ha="center", fontsize="x-small")
    axes.plot([], [], linestyle="none", marker="v", color="white", markeredgecolor="0.1", label="largest")
    axes.set_yscale("log")
    axes.set_ylim(bottom=0.4 * float(means.min()))
    plain_decades(axes, "y")
    axes.set_xticks(np.arange(len(published)), [f"{vehicle}\n{scheme.upper()}" for vehicle, scheme in published])
    axes.set_ylabel("time of one planning step [ms]")
    axes.legend(fontsize="small", ncols=2, loc="upper center", bbox_to_anchor=(0.5, 1.2), frameon=False)
    axes.grid(visible=True, axis="y", color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)
    return figure


def _draw_area(axes: Axes, found: Swept, colour: str, label: str, *, unit: int | None = None) -> None:
    """Draw the swept area of one body, or of all, in the pale version of a colour: opaque, as overlaps must not mix to a third one."""
    fill = 1.0 - _PALE * (1.0 - np.array(to_rgb(colour)))
    envelope = found.envelope
    left, right = (envelope.reach_left, envelope.reach_right) if unit is None else (envelope.left[unit], envelope.right[unit])
    area = swept_area(found.drive.road.path, envelope.s, left, right)
    for part in shapely.get_parts(area):
        if isinstance(part, shapely.Polygon):
            rings = (part.exterior, *part.interiors)
            outline = Outline.make_compound_path(*(Outline(np.asarray(ring.coords), closed=True) for ring in rings))
            axes.add_patch(PathPatch(outline, facecolor=fill, edgecolor=colour, linewidth=0.8, label=label))
            label = ""


def _draw_bodies(axes: Axes, found: Swept, apart: float, colour: str) -> None:
    """Draw outlines of the bodies every ``apart`` [m] of road."""
    places = np.arange(apart, found.drive.road.path.length, apart)
    outlines = list(corners(found.drive, np.array([pose_at(found.drive, float(s)) for s in places])).reshape(-1, 4, 2))
    axes.add_collection(PolyCollection(outlines, facecolors="none", edgecolors=colour, linewidths=0.9, zorder=3))


def _draw_road(axes: Axes, found: Swept) -> None:
    """Draw the road's centre and limits, to scale."""
    path, limits = found.drive.road.path, found.drive.road.limits
    s = np.linspace(0.0, path.length, 400)
    axes.plot(*path.to_plane(s, 0.0), color=GREY, linewidth=0.9, linestyle=(0, (6, 3)), label="road centre")
    if limits is not None:
        for number, limit in enumerate(limits.table(s)[:2]):
            axes.plot(*path.to_plane(s, limit), color="0.1", linewidth=1.4, label="limits" if number == 0 else None)
    axes.set_aspect("equal")
    axes.margins(0.06)
    low, high = axes.get_ylim()
    axes.set_ylim(low - _BAR_SHARE * (high - low), high)
    draw_direction(axes, path, 0.0, path.length, count=4)
    finish_map(axes, north=False)


def _draw_limits(axes: Axes, found: Swept) -> None:
    limits = found.drive.road.limits
    if limits is not None:
        for number, limit in enumerate(limits.table(found.envelope.s)[:2]):
            axes.plot(found.envelope.s, limit, color="0.1", linewidth=1.4, label="limits" if number == 0 else None)


def _plot_pair(axes: Axes, s: FloatArray, half_width: FloatArray, label: str) -> None:
    _plot_geometric(axes, s, half_width, label)
    _plot_geometric(axes, s, -half_width, None)


def _plot_geometric(axes: Axes, s: FloatArray, values: FloatArray, label: str | None) -> None:
    axes.plot(s, values, color="0.1", linewidth=1.1, linestyle=(0, (4, 2)), label=label)


def _plot_published(axes: Axes, points: FloatArray, label: str | None) -> None:
    axes.plot(*points.T, color="0.75", linewidth=4.5, solid_capstyle="butt", label=label)


def _finish(axes: Axes, x: str, y: str, title: str) -> None:
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.set_title(title, loc="left", fontsize="medium")
    axes.grid(visible=True, color="0.9", linewidth=0.6)
    axes.legend(fontsize="small", loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)


@styled()
def accuracy_figure(table: pd.DataFrame) -> Figure:
    """Return the error of the swept envelope over the distance between poses, a vehicle a colour."""
    figure = Figure(figsize=(7.5, 4.8), layout="constrained")
    axes = figure.subplots()
    for (name, rows), colour in zip(table.groupby("vehicle"), (BLUE, YELLOW), strict=True):
        axes.loglog(rows["spacing_m"], rows["joined_mm"], color=colour, marker="o", label=f"{name}, poses joined")
        axes.loglog(rows["spacing_m"], rows["outlines_mm"], color=colour, marker="s", linestyle="--", label=f"{name}, outlines alone")
    plain_decades(axes, "x")
    plain_decades(axes, "y")
    _finish(axes, "between poses [m]", "largest error of an edge [mm]", "swept envelope")
    return figure
