"""Several vehicles on one road: a table of their answers, and a picture with what each sweeps on top of the others."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hdvplan.answers import NEEDS, NO, YES, room_number, worded
from hdvplan.judging.result import Result, body_name
from hdvplan.judging.verdict import amount_text, short_verdict, strays_text, verdict_of
from hdvplan.report import INK, MUTED, answer_colour, body_colour
from hdvplan.report.geojson import swept_area
from hdvplan.report.layers import Drawn, Layer, drawn_features
from hdvplan.report.maps import (
    around,
    centre_of,
    draw_area,
    draw_direction,
    draw_features,
    draw_overview,
    finish_map,
    frame,
    outline_of,
    reach_within,
)
from hdvplan.report.rooms import Window, shown_reach, tightest_windows
from hdvplan.report.style import SLIDE_IN, legend_above, styled, write_head
from hdvplan.road.regions import called

_ROAD = (Layer.ROAD, Layer.OBSTACLES, Layer.SWEEPABLE, Layer.LIMITS)
_NUMBERS = {
    "spare_m": ("to spare [m]", 2),
    "kept_m": ("kept [m]", 2),
    "clearance_m": ("asked [m]", 2),
    "half_width_m": ("half width [m]", 2),
    "s_m": ("at s [m]", 1),
}
_MAPS = 2  # of the places that are tightest for the vehicle with the least room
_LETTERS = 50  # of a title, within its map
_BEYOND_M = 0.5  # that the profile shows
_MAP_OVER_PROFILE = 1.6  # height


def answer_rows(results: Sequence[Result]) -> pd.DataFrame:
    """Return a row a vehicle: its answer and whether it is proved, what it needs, and the place that decides.

    The room to spare is beyond the clearance, negative where some is lacking. Lengths are in metres; NaN: there is none.
    """
    rows = []
    for result in results:
        verdict = verdict_of(result)
        beside = verdict.side if verdict.obstacle is None else called(verdict.obstacle)
        part = f"{verdict.part} of the {body_name(result.drive.vehicle, verdict.unit)}, {beside}"
        decides = strays_text(verdict) or part
        spare, half = (np.nan, verdict.half_width) if verdict.spare is None else (verdict.spare, np.nan)
        rows.append((result.drive.vehicle.name, verdict.word, verdict.proved, spare, verdict.clearance_wanted, half, verdict.s, decides))
    return pd.DataFrame(rows, columns=["vehicle", "answer", "proved", "spare_m", "clearance_m", "half_width_m", "s_m", "decides"])


def answer_texts(table: pd.DataFrame) -> pd.DataFrame:
    """Return the rows as a terminal shows them: without columns that have no number; where a clearance is asked for, with what is kept."""
    told = [room_number(spare, fits=word != NO) for spare, word in zip(table["spare_m"], table["answer"], strict=True)]
    table = table.assign(spare_m=told, kept_m=table["spare_m"] + table["clearance_m"])
    dropped = {"spare_m"} if table["clearance_m"].any() else {"kept_m", "clearance_m"}
    shown = [name for name in _NUMBERS if name not in dropped and table[name].notna().any()]
    texts = {}
    for name in shown:
        title, digits = _NUMBERS[name]
        texts[title] = ["-" if np.isnan(value) else f"{value:.{digits}f}" for value in table[name]]
    answers = table["answer"] + np.where(table["proved"], ", proved", "")
    return pd.DataFrame({"vehicle": table["vehicle"], "answer": answers, **texts, "what decides": table["decides"]})


def answer_of(results: Sequence[Result]) -> str:
    """Return one line for all vehicles; it begins with the word of the worst."""
    verdicts = {result.drive.vehicle.name: verdict_of(result) for result in results}
    words = {name: verdict.word for name, verdict in verdicts.items()}
    no = [name for name, word in words.items() if word == NO]
    if no:
        lacks = "fit" if any(verdict.fits is False for verdict in verdicts.values()) else "hold"
        return worded(NO, f"{len(no)} of {len(words)} vehicles do{'es' * (len(no) == 1)} not {lacks}: {', '.join(no)}")
    widest = max(results, key=lambda result: verdict_of(result).half_width)
    if NEEDS in words.values():
        return f"{amount_text(verdict_of(widest))} for the {widest.drive.vehicle.name}, the widest of {len(words)}"
    tightest = min(results, key=_spare)
    least = short_verdict(verdict_of(tightest)).partition(", ")[2]
    return worded(YES, f"all {len(words)} vehicles fit; {least} for the {tightest.drive.vehicle.name}")


@styled()
def compared_figure(results: Sequence[Result]) -> Figure:
    """Return the picture: where the vehicle with the least room has least, with all envelopes, and these over the whole road."""
    tightest = min(results, key=_spare)
    windows = tightest_windows(tightest)[:_MAPS]
    figure = Figure(figsize=SLIDE_IN, layout="constrained")
    grid = figure.add_gridspec(2, len(windows) + 1, height_ratios=[_MAP_OVER_PROFILE, 1.0])
    features = [feature for feature in drawn_features(tightest) if feature.layer in _ROAD]
    for number, window in enumerate(windows):
        _draw_map(figure.add_subplot(grid[0, number]), results, tightest, features, window)
    overview, road = figure.add_subplot(grid[0, -1]), tightest.drive.road
    draw_overview(overview, tightest, windows)
    draw_direction(overview, road.path, 0.0, road.path.length, count=4)
    finish_map(overview, north=road.to_lonlat is not None)
    _draw_envelopes(figure.add_subplot(grid[1, :]), results, tightest)
    fits = None if verdict_of(tightest).fits is None else all(verdict_of(result).holds for result in results)
    write_head(figure, f"{road.name}: {answer_of(results)}", answer_colour(fits=fits), size="large", notice=road.notice)
    return figure


def _spare(result: Result) -> float:
    verdict = verdict_of(result)
    return -verdict.half_width if verdict.spare is None else verdict.spare + verdict.clearance_wanted


def _draw_map(axes: Axes, results: Sequence[Result], tightest: Result, features: Sequence[Drawn], window: Window) -> None:
    points = centre_of(tightest, window)
    room = max(reach_within(result, window) for result in results)
    draw_features(axes, features, around(points, room))
    for number, result in enumerate(results):
        envelope = result.envelope
        beyond = window.s_to - window.s_from  # as far as the map may show
        near = (envelope.s >= window.s_from - beyond) & (envelope.s <= window.s_to + beyond)
        area = swept_area(result.drive.road.path, envelope.s[near], envelope.reach_left[near], envelope.reach_right[near])
        draw_area(axes, outline_of(area), facecolor="none", edgecolor=body_colour(number), linewidth=1.8, zorder=3)
    draw_direction(axes, tightest.drive.road.path, window.s_from, window.s_to, count=2)
    frame(axes, points, room)
    finish_map(axes, north=tightest.drive.road.to_lonlat is not None)
    title = textwrap.fill(f"{window.title}, {tightest.drive.vehicle.name}", _LETTERS, break_on_hyphens=False)
    axes.set_title(title, fontsize="medium", loc="left", fontweight="bold")


def _draw_envelopes(axes: Axes, results: Sequence[Result], tightest: Result) -> None:
    for number, result in enumerate(results):
        for reach, label in ((result.envelope.reach_left, result.drive.vehicle.name), (result.envelope.reach_right, None)):
            axes.plot(result.envelope.s, reach, color=body_colour(number), linewidth=1.6, label=label)
    limits = tightest.drive.road.passable
    if limits is not None:
        for limit, label in zip(limits.table(tightest.envelope.s)[:2], ("limits", None), strict=True):
            axes.plot(tightest.envelope.s, limit, color=INK, linewidth=1.0, label=label)
    left, right = zip(*(shown_reach(result) for result in results), strict=True)
    axes.set_ylim(min(map(np.min, right)) - _BEYOND_M, max(map(np.max, left)) + _BEYOND_M)
    axes.axhline(0.0, color=MUTED, linewidth=0.7)
    axes.set(xlabel="arclength s [m]", ylabel="reach [m]\n(left positive)", xlim=(0.0, tightest.drive.road.path.length))
    axes.grid(visible=True)
    legend_above(axes, columns=6)
