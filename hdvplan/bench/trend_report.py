"""A history as tables, JSON, a chart and a section of the HTML report. Trends in, text and pictures out."""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil
from pathlib import PurePath
from textwrap import shorten

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from rich.table import Table

from hdvplan.bench.trends import LEVEL, Change, Series, Trend
from hdvplan.report.colours import BREACH, INK, MUTED
from hdvplan.report.grid import grid
from hdvplan.report.html import Section
from hdvplan.report.style import figure_bytes, styled
from hdvplan.texts import printable

_COLUMNS = ("cell", "what", "commits", "latest", "level", "changes")
_FOUND = ("commit", "cell", "what", "before", "after", "change", "libraries")
_TEXT = ("cell", "what", "changes", "commit", "libraries")
_ACROSS = 3  # panels of a chart
_PANEL_IN = (4.2, 1.9)
_PANELS = 24  # of a chart; those with changes come first
_ROOM, _LEAST_ROOM = 0.3, 0.04  # around what a panel shows: of its range, and of its values, so that noise does not look large
_MARKED = 60  # values beyond which single marks are small
_WIDEST = 60  # letters of a panel's title
_NAMED = 3  # roads, vehicles, ... that a title names; of more it says how many


def trend_tables(trend: Trend) -> list[Table]:
    """Return the tables for the terminal: every series, then every change, the latest first."""
    title, note = titles_of(trend)
    tables = [grid(title, _COLUMNS, _series_rows(trend), text=_TEXT, caption=note)]
    found = _change_rows(trend)
    return [*tables, grid("where levels changed, the latest first", _FOUND, found, text=_TEXT)] if found else tables


def trend_json(trend: Trend) -> dict[str, object]:
    """Return a trend for other programs: its entries, and of every series values and changes."""
    at = {id(entry): number for number, entry in enumerate(trend.entries)}
    return {
        "machine": dict(trend.entries[-1].machine),
        "work": dict(trend.entries[-1].work),
        "base": trend.base,
        "false_alarms": LEVEL,
        "commits": [
            {"commit": entry.revision.commit, "subject": entry.revision.subject, "committed": entry.revision.committed}
            | {"measured": entry.measured, "verdict": entry.verdict}
            for entry in trend.entries
        ],
        "series": [
            {
                "cell": one.cell, "what": one.what, "unit": one.unit,
                "entries": [at[id(entry)] for entry in one.entries],
                "values": one.values.tolist(), "shown": one.shown.tolist(),
                "changes": [
                    {"commit": one.entries[change.at].revision.commit, "before": change.before, "after": change.after}
                    | {"ratio": change.ratio, "versions": list(change.versions)}
                    for change in one.changes
                ],
            }
            for one in trend.series
        ],
    }  # fmt: skip


def trend_section(trend: Trend) -> Section:
    """Return a trend as a section of the HTML report."""
    title, note = titles_of(trend)
    found = _change_rows(trend)
    columns, rows = (_FOUND, found) if found else (_COLUMNS, _series_rows(trend))
    return Section(title, note, figure_bytes(trend_figure(trend), "svg"), columns, rows, _TEXT)


def trend_figure(trend: Trend) -> Figure:
    """Return the chart: a panel for each series, those with changes first; levels as lines, changes marked with commit and size."""
    ordered = sorted(trend.series, key=lambda one: -len(one.changes))
    drawn, title = ordered[:_PANELS], titles_of(trend)[0]
    if len(ordered) > len(drawn):
        title = f"{title}; {len(drawn)} of {len(ordered)} series"
    rows, across = max(1, ceil(len(drawn) / _ACROSS)), min(_ACROSS, max(1, len(drawn)))
    with styled():
        figure = Figure(figsize=(_PANEL_IN[0] * across, _PANEL_IN[1] * rows + 0.7), layout="constrained")
        axes = figure.subplots(rows, across, squeeze=False).ravel()
        for panel, one in zip(axes, drawn, strict=False):
            _panel(panel, one, trend)
        for panel in axes[len(drawn) :]:
            panel.set_axis_off()
        figure.suptitle(title, fontsize="small", fontweight="bold", x=0.01, ha="left")
        figure.supxlabel(titles_of(trend)[1], fontsize="x-small", color=MUTED, x=0.01, ha="left")
    return figure


def titles_of(trend: Trend) -> tuple[str, str]:
    """Return one line about what was measured on which machine, and one about how changes are found."""
    last = trend.entries[-1]
    count = len(trend.entries)
    head = f"{count} commit{'s' * (count > 1)}: {_work(last.work)}; {last.machine.get('processor')}, {last.machine.get('python_minor')}"
    shown = "commits by date, numbers as measured" if trend.base is None else f"commits by date, ratios to {_short(trend.base)}"
    return printable(head), f"{shown}; a history in which nothing changes shows a change with a probability of about {LEVEL:.0%}"


def _work(work: Mapping[str, object]) -> str:
    command, suite = work.get("command"), work.get("suite")
    if isinstance(command, list):
        return " ".join(map(str, command))
    told = dict(suite) if isinstance(suite, dict) else {}
    lists = [told[name] for name in ("roads", "vehicles", "schemes", "solvers") if isinstance(told.get(name), list)]
    return "; ".join(", ".join(PurePath(str(one)).stem for one in some) if len(some) <= _NAMED else f"{len(some)}" for some in lists)


def _series_rows(trend: Trend) -> list[tuple[str, ...]]:
    return [
        (
            one.cell,
            one.what,
            str(len(one.values)),
            f"{one.values[-1]:.3f} {one.unit}",
            _level(one.levels[-1][1], one, trend),
            ", ".join(f"{_percent(change)} at {_commit(one, change)}" for change in one.changes) or "-",
        )
        for one in trend.series
    ]


def _change_rows(trend: Trend) -> list[tuple[str, ...]]:
    at = {id(entry): number for number, entry in enumerate(trend.entries)}
    found = [(at[id(one.entries[change.at])], one, change) for one in trend.series for change in one.changes]
    return [
        (
            one.entries[change.at].revision.words,
            one.cell,
            one.what,
            _level(change.before, one, trend),
            _level(change.after, one, trend),
            _percent(change),
            ", ".join(change.versions) or "-",
        )
        for _, one, change in sorted(found, key=lambda entry: (-entry[0], -abs(np.log(entry[2].ratio))))
    ]


def _level(level: float, one: Series, trend: Trend) -> str:
    return f"{level:.3f} {one.unit}" if trend.base is None else f"x {level:.3f}"


def _percent(change: Change) -> str:
    return f"{100.0 * (change.ratio - 1.0):+.0f} %"


def _commit(one: Series, change: Change) -> str:
    return _short(str(one.entries[change.at].revision.commit))


def _short(name: str) -> str:
    return name[:9] if len(name) >= 40 else name  # noqa: PLR2004 - a hash, else a name


def _panel(axes: Axes, one: Series, trend: Trend) -> None:
    position = {id(entry): number for number, entry in enumerate(trend.entries)}
    x = np.array([position[id(entry)] for entry in one.entries])
    axes.plot(x, one.shown, ".", color=MUTED, markersize=5.0 if len(x) <= _MARKED else 2.5)
    ends = [*(begin for begin, _ in one.levels[1:]), len(x)]
    for (begin, level), end in zip(one.levels, ends, strict=True):
        axes.plot([x[begin] - 0.4, x[end - 1] + 0.4], [level, level], color=INK, linewidth=1.4)
    for change in one.changes:
        worse = change.ratio > 1.0
        axes.axvline(x[change.at] - 0.5, color=BREACH if worse else INK, linewidth=1.4 if worse else 0.9, linestyle="-" if worse else "--")
        axes.annotate(
            f"{_percent(change)}\n{_commit(one, change)[:7]}", (x[change.at] - 0.5, 1.0), xycoords=("data", "axes fraction"),
            xytext=(3, -2), textcoords="offset points", va="top", fontsize="xx-small", color=BREACH if worse else INK,
        )  # fmt: skip
    unit = one.unit if trend.base is None else "x base"
    axes.set_title(f"{shorten(one.cell, _WIDEST, placeholder='...')}\n{one.what} [{unit}]", loc="left", fontsize="x-small")
    axes.xaxis.set_major_locator(MaxNLocator(5, integer=True))
    axes.set_xlim(-0.8, len(trend.entries) - 0.2)
    low, high = _seen(one)
    for beyond, mark, edge in ((one.shown > high, "^", high), (one.shown < low, "v", low)):
        if np.any(beyond):
            axes.plot(x[beyond], np.full(np.count_nonzero(beyond), edge), mark, color=MUTED, markersize=4.0, clip_on=False)
    axes.set_ylim(low, high)
    axes.tick_params(labelsize="x-small")


def _seen(one: Series) -> tuple[float, float]:
    """Return the range that a panel shows: nine of ten values and all levels with room around them; outliers are marks at its edge."""
    levels = [level for _, level in one.levels]
    low, high = min(*np.percentile(one.shown, [5]), *levels), max(*np.percentile(one.shown, [95]), *levels)
    room = max(_ROOM * (high - low), _LEAST_ROOM * high)
    return float(low - room), float(high + 1.5 * room)  # changes are written above
