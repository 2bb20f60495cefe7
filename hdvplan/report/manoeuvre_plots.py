"""The pictures of manoeuvres, to scale: of a turn with the standard's circles, and of forward and backward legs in their site."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hdvplan.judging.result import body_name
from hdvplan.report import BREACH, INK, answer_colour, body_colour
from hdvplan.report.layers import Layer, leg_area, line_of, shown_poses, turn_features, view_of
from hdvplan.report.leg_plots import Stop, Way, draw_lines, draw_stops, draw_swept, ends_of
from hdvplan.report.maps import SLIDE, UNTURNED, draw_area, draw_bodies, draw_features, outline_of, point, scale_bar
from hdvplan.report.maps import Turn as TurnOf
from hdvplan.report.style import ON_WHITE, styled, write_head
from hdvplan.turning.follow import Followed
from hdvplan.turning.reversing import words
from hdvplan.turning.reversing.answer import Answer
from hdvplan.turning.reversing.sites import unit
from hdvplan.turning.swept import chart_of
from hdvplan.turning.turn import Turn, verdict
from hdvplan.vehicle.kinematics import corners_at

_ROOM_M = 2.0
_TITLE, _NOTICE = 110, 170  # characters a line
_BESIDE_M = 0.8  # of the size from the edge of the picture
_WIDE, _HIGH = 11.0, (6.0, 12.0)  # of the picture of legs [inches]


@styled()
def turn_figure(turn: Turn) -> Figure:
    """Return the picture of a manoeuvre."""
    figure = Figure(figsize=(12.0, 7.5), layout="constrained")
    layout = figure.add_gridspec(2, 2, width_ratios=(1.7, 1.0))
    draw_turn(figure.add_subplot(layout[:, 0]), turn)
    angles = figure.add_subplot(layout[1, 1] if turn.driven.manoeuvre.angle is not None else layout[:, 1])
    if turn.driven.manoeuvre.angle is not None:
        _draw_width(figure.add_subplot(layout[0, 1]), turn)
    _draw_angles(angles, turn.driven)
    source = None if turn.template is None else turn.template.source
    write_head(figure, "\n".join(textwrap.wrap(verdict(turn), _TITLE)), answer_colour(fits=turn.complies), notice=source)
    return figure


def draw_turn(axes: Axes, turn: Turn) -> None:
    """Draw the swept areas, wheel tracks, three poses, the guided path, the arc's centre and the limits, to scale."""
    features = [feature for feature in turn_features(turn) if feature.layer is not Layer.LIMITS]
    bounds = shapely.total_bounds([feature.geometry for feature in features])
    draw_features(axes, features, shapely.box(*bounds).buffer(1.0).envelope)
    poses = shown_poses(turn.driven)
    draw_bodies(axes, corners_at(turn.driven.vehicle, turn.driven.poses[poses]))
    axes.plot(*chart_of(turn.driven).centre, marker="+", color=INK, markersize=9)
    for limit in turn.circles:
        words = f"{limit.words} {limit.value:.2f} m, {'at least' if limit.least else 'at most'}"
        draw_circle(axes, turn, limit.value, words, broken=not limit.kept(turn.figures))
    axes.set_aspect("equal")
    axes.autoscale_view()
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    axes.set_xlim(left - _ROOM_M, right + _ROOM_M)
    axes.set_ylim(low - _ROOM_M - 0.1 * (high - low), high + _ROOM_M)
    scale_bar(axes)
    axes.set_axis_off()
    axes.legend(loc="upper left", bbox_to_anchor=(0.0, 0.0), ncols=2, borderaxespad=0.2)


def draw_circle(axes: Axes, turn: Turn, radius: float, label: str, *, broken: bool = False) -> None:
    """Draw a circle about the arc's centre [m], thick where it is a broken limit."""
    around, centre = np.linspace(0.0, 2.0 * np.pi, 361), chart_of(turn.driven).centre
    x, y = centre[0] + radius * np.cos(around), centre[1] + radius * np.sin(around)
    colour, width = (BREACH, 2.4) if broken else (INK, 1.2)
    axes.plot(x, y, color=colour, linewidth=width, linestyle=(0, (2, 1.5)), label=label, zorder=4)


def _draw_width(axes: Axes, turn: Turn) -> None:
    band, driven = turn.figures.band, turn.driven
    axes.plot(band.t, band.width, color=INK, linewidth=1.4)
    widest = int(np.nanargmax(band.width))
    axes.plot(band.t[widest], band.width[widest], marker="o", color=INK, markersize=5)
    at = (float(band.t[widest]), float(band.width[widest]))
    axes.annotate(f"{at[1]:.2f} m", at, (6.0, 4.0), textcoords="offset points", fontsize="small")
    axes.axvspan(0.0, driven.manoeuvre.radius * driven.angle, color="0.93", zorder=0)
    axes.set_xlabel("along arc and tangents [m]; grey: the turn")
    axes.set_title("swept width [m]", loc="left", fontsize="small")
    axes.set_ylim(bottom=0.0)


def _draw_angles(axes: Axes, driven: Followed) -> None:
    axes.plot(driven.s, np.rad2deg(driven.steering), color=INK, linestyle=(0, (5, 2)), linewidth=1.2, label="steering, front wheels")
    names = [body_name(driven.vehicle, unit) for unit in range(len(driven.vehicle.units))]
    for number, beta in enumerate(driven.beta.T):
        axes.plot(driven.s, np.rad2deg(beta), color=body_colour(number + 1), linewidth=1.6, label=f"{names[number]} to {names[number + 1]}")
    axes.set_xlabel(f"along the path of the {driven.manoeuvre.point.words} [m]")
    axes.set_title("angles [degrees]", loc="left", fontsize="small")
    axes.legend(loc="best")


@styled()
def turns_figure(turns: Mapping[str, Turn], inside: Mapping[str, float]) -> Figure:
    """Return several turns beside each other, each with its published inside radius [m]."""
    figure = Figure(figsize=(13.0, 8.5), layout="constrained")
    for axes, (name, turn) in zip(figure.subplots(2, 2).flat, turns.items(), strict=True):
        draw_turn(axes, turn)
        draw_circle(axes, turn, inside[name], f"published inside radius {inside[name]:.2f} m")
        axes.legend(loc="upper left", bbox_to_anchor=(0.0, 0.0), ncols=2, borderaxespad=0.2)
        axes.set_title(f"{name}: inside radius {turn.figures.wheels.inside:.2f} m", loc="left", fontsize="medium")
    return figure


@styled()
def reversal_figure(answer: Answer) -> Figure:
    """Return the picture of a manoeuvre of forward and backward legs."""
    left, low, right, high = view_of(answer).bounds
    figure = Figure(figsize=(_WIDE, float(np.clip(_WIDE * (high - low) / (right - left) + 1.0, *_HIGH))), layout="constrained")
    axes = figure.add_subplot()
    draw_site(axes, answer, ways_in(answer))
    axes.set_xlim(left, right)
    axes.set_ylim(low, high)
    axes.set_aspect("equal")
    axes.set_axis_off()
    scale_bar(axes)
    axes.legend(loc="upper left", bbox_to_anchor=(0.0, 0.0), ncols=3, borderaxespad=0.2)
    notice = "\n".join(textwrap.wrap(words.details(answer), _NOTICE))
    write_head(figure, words.verdict(answer), answer_colour(fits=answer.fits), notice=notice)
    return figure


def draw_site(axes: Axes, answer: Answer, ways: Sequence[Way], *, weight: float = SLIDE, turned: TurnOf = UNTURNED) -> None:
    """Draw a site with its size, the legs as ``ways_in`` has them, and the vehicle at begin, cusps and end."""
    _draw_blocks(axes, answer, weight, turned)
    _draw_size(axes, answer, weight, turned)
    draw_swept(axes, ways, weight=weight, turned=turned)
    draw_lines(axes, ways, weight=weight, turned=turned)
    draw_stops(axes, stops_in(answer), weight=weight, turned=turned)


def ways_in(answer: Answer) -> tuple[Way, ...]:
    """Return the legs of a manoeuvre."""
    units = range(len(answer.vehicle.units))
    return tuple(
        Way(leg.backward, line_of(leg), shapely.union_all([leg_area(answer, leg, unit) for unit in units]))
        for leg in answer.chosen.manoeuvre.legs
    )


def stops_in(answer: Answer) -> tuple[Stop, ...]:
    """Return where the vehicle stands, in the order of driving."""
    legs = answer.chosen.manoeuvre.legs
    ends = [(legs[at], when, name) for at, when, name in ends_of(len(legs))]
    bodies = [corners_at(answer.vehicle, leg.poses[[when]])[0] for leg, when, _ in ends]
    return tuple(
        Stop(name, np.degrees(leg.beta[when]), leg.lead[when, :2], standing)
        for (leg, when, name), standing in zip(ends, bodies, strict=True)
    )


def _draw_blocks(axes: Axes, answer: Answer, weight: float, turned: TurnOf) -> None:
    """Draw what stands, kerbs that bodies may reach over lighter than the rest, and a dock's doors."""
    site, view, seen = answer.chosen.manoeuvre.site, view_of(answer), set[float]()
    over = [site.overhang] * len(site.blocks) + [site.beyond_ends] * len(answer.walls)
    for block, overhang in zip(answer.blocks, over, strict=True):
        label = f"kerb, bodies may reach {overhang:.2f} m over it" if overhang > 0.0 else "wall, parked vehicle"
        colour, named = "0.92" if overhang > 0.0 else "0.8", None if overhang in seen else label
        area = outline_of(shapely.transform(block.area(view), turned))
        draw_area(axes, area, facecolor=colour, edgecolor=INK, linewidth=0.8 * weight, label=named, zorder=0.5)
        seen.add(overhang)
    if answer.template.docks:
        doors = turned(np.array([[view.bounds[0], 0.0], [view.bounds[2], 0.0]]))
        axes.plot(*doors.T, color=INK, linewidth=0.8 * weight, linestyle=(0, (8, 3)), label="doors")


def _draw_size(axes: Axes, answer: Answer, weight: float, turned: TurnOf) -> None:
    """Draw the size of the site, of a head each arm, as a dimension near the view's upper or right edge."""
    site, edges = answer.chosen.manoeuvre.site, np.array(view_of(answer).bounds[2:]) - _BESIDE_M
    ahead = unit(site.ends[0][1])
    across = int(np.argmin(np.abs(ahead)))  # 0: the size is measured along y
    to, *behind = (float(np.hypot(*wall.tips[0])) for wall in answer.walls)  # from the origin
    marks, texts = [-behind[0] if behind else -site.base, to], [f"{answer.template.words} {answer.size:.2f} m"]
    if answer.arms:
        marks.insert(1, 0.0)
        texts = [f"arm {length:.2f} m" for length in reversed(answer.arms)]
    ends = np.outer(marks, ahead)
    ends[:, across] = edges[across]
    ends = turned(ends)
    arrow = {"arrowstyle": "<->", "color": INK, "linewidth": 0.7 * weight, "shrinkA": 0.0, "shrinkB": 0.0}
    level = np.abs(ends[1] - ends[0]).argmax() == 0
    for begin, end, text in zip(ends, ends[1:], texts, strict=False):
        axes.annotate("", point(begin), point(end), arrowprops=arrow, zorder=6)
        axes.annotate(
            text, point(0.5 * (begin + end)), ha="center", va="center", fontsize="small",
            rotation=0.0 if level else 90.0, bbox=ON_WHITE, zorder=6,
        )  # fmt: skip
