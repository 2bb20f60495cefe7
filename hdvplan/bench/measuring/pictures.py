"""The picture of a benchmark: one page for print."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hdvplan.arrays import BoolArray, FloatArray, runs_of
from hdvplan.bench.measuring.directory import read_record, read_table
from hdvplan.bench.measuring.ranking import ranked_times, unit_of
from hdvplan.bench.measuring.samples import OVER_BUDGET
from hdvplan.bench.suite import COURSE, KEY
from hdvplan.fileio import write_atomically
from hdvplan.report import FAINT, MUTED
from hdvplan.report.style import figure_bytes, plain_decades, styled

_SIZE_IN = (11.0, 8.5)
_DASHES = ("-", "--", ":")
_MARKS = ("o", "s", "^", "D", "v", "P", "X")
_COLOURS = 10  # of the style's cycle
_ALONG = 5  # solvers drawn along the road, those in front: more lines hide each other
_EXACT_M = 1e-14  # where a distance of zero is drawn
_FURTHEST = 1e4  # factor at which a profile ends
_POINTS = 400
_NAMED = 3  # roads, vehicles, ... that a title names; of more it says how many


def draw(directory: Path, file: Path) -> None:
    """Draw a finished run into a file of the kind that its ending says, one that Matplotlib knows.

    Raises:
        OptionError: the run is not finished, or damaged.
        OSError: the file cannot be written.

    """
    record, summary = read_record(directory), read_table(directory, "summary.csv")
    shown = pictured(read_table(directory, "samples.csv.gz"), read_table(directory, "timing.csv"), order_of(summary))
    write_atomically(file, figure_bytes(bench_figure(shown, *captions_of(record)), file.suffix.lower().removeprefix(".")))


def bench_figure(shown: Pictured, title: str, caption: str) -> Figure:
    """Return one page: performance profiles, distribution, step time over s, time against accuracy.

    ``title`` says what was run, ``caption`` on what; both are cut by nobody, so keep them short.
    """
    with styled():
        figure = Figure(figsize=_SIZE_IN, layout="constrained")
        axes = figure.subplots(2, 2)
        _profiles(axes[0, 0], shown)
        _distribution(axes[0, 1], shown)
        _along(axes[1, 0], shown)
        _accuracy(axes[1, 1], shown)
        figure.suptitle(title, fontsize="medium", fontweight="bold", x=0.01, ha="left")
        handles, labels = axes[0, 0].get_legend_handles_labels()
        legend = figure.legend(handles, labels, loc="outside lower left", ncols=min(5, len(labels) or 1), title=caption, alignment="left")
        legend.get_title().set(fontsize="x-small", color=MUTED)
    return figure


def captions_of(record: Mapping[str, Any]) -> tuple[str, str]:
    """Return title and caption of a run, from its ``run.json``."""
    settings, machine = record["settings"], record["machine"]
    several = {name: settings[name] for name in ("roads", "vehicles", "schemes", "classes") if settings[name]}
    words = [
        ", ".join(PurePath(value).stem for value in values) if len(values) <= _NAMED else f"{len(values)} {name}"
        for name, values in several.items()
    ]
    sample = f"{settings['sample']} recorded QPs a drive" if settings["sample"] else "whole drives"
    held = "" if settings["accuracy"] is None else f", every solver held to {settings['accuracy']:g} m"
    unit = "QP" if settings["sample"] else "step"
    busy = " BUSY MACHINE." if record["load"]["warning"] else ""
    title = "; ".join([*words, sample]) + held
    return (
        title,
        f"processor time, each {unit} with its fastest round of {settings['rounds']}; {machine['processor']}, {machine['python']}.{busy}",
    )


def _look(number: int) -> dict[str, object]:
    """Return colour and dashes of solver ``number``: no two of thirty are alike."""
    return {"color": f"C{number % _COLOURS}", "linestyle": _DASHES[number // _COLOURS % len(_DASHES)], "linewidth": 1.6}


def _factors(shown: Pictured) -> FloatArray:
    most = max((float(ratios[np.isfinite(ratios)].max(initial=1.0)) for ratios in shown.ratios.values()), default=1.0)
    return np.geomspace(1.0, min(max(2.0, 1.2 * most), _FURTHEST), _POINTS)


def _profiles(axes: Axes, shown: Pictured) -> None:
    at = _factors(shown)
    for number, (solver, ratios) in enumerate(shown.ratios.items()):
        axes.step(at, share_within(ratios, at), where="post", label=solver, **_look(number))  # type: ignore[arg-type] # line properties
    axes.set(xscale="log", xlim=(1.0, at[-1]), ylim=(0.0, 1.03), xlabel="within this factor of the fastest")
    axes.set_ylabel(f"share of {shown.unit}s")
    plain_decades(axes, "x")
    _headed(axes, f"performance profiles, {shown.steps} {shown.unit}s")


def _distribution(axes: Axes, shown: Pictured) -> None:
    solvers = [solver for solver in shown.ms if len(shown.ms[solver])]
    for row, solver in enumerate(solvers):
        colour, ms = f"C{list(shown.ms).index(solver) % _COLOURS}", shown.ms[solver]
        low, first, middle, third, high = np.percentile(ms, [5, 25, 50, 75, 95])
        axes.plot([low, high], [row, row], color=colour, linewidth=1.2)
        axes.plot([first, third], [row, row], color=colour, linewidth=6.0, solid_capstyle="butt")
        axes.plot([middle], [row], marker="|", markersize=11.0, markeredgewidth=1.6, color="white")
        axes.plot([ms[-1]], [row], marker=".", color=colour)
    axes.set(
        xscale="log", xlabel=f"{shown.unit} [ms]", yticks=range(len(solvers)), yticklabels=solvers, ylim=(max(len(solvers), 1) - 0.5, -0.5)
    )
    axes.grid(visible=True, axis="x")
    axes.tick_params(axis="y", length=0.0)
    plain_decades(axes, "x")
    _headed(axes, "distribution: 5, 25, 50, 75, 95 %, dot: the longest")


def _along(axes: Axes, shown: Pictured) -> None:
    for number, one in enumerate(shown.along[:_ALONG]):
        if len(one.s):
            axes.plot(one.s, one.ms, marker=_MARKS[number % len(_MARKS)], markersize=2.5, **_look(number) | {"linewidth": 1.0})  # type: ignore[arg-type] # line properties
    held = next((one for one in shown.along if len(one.s)), None)
    if held is not None:
        for begin, end in _stretches(held):
            axes.axvspan(begin, end, color=FAINT, linewidth=0.0)
    axes.set(yscale="log", xlabel="s [m]", ylabel=f"{shown.unit} [ms]")
    plain_decades(axes, "y")
    grey = "; grey: limits bind" if held is not None and held.binding.any() else ""
    few = f"; the first {_ALONG} solvers" if len(shown.along) > _ALONG else ""
    _headed(axes, f"{shown.course.replace(', as set', '')}{grey}{few}")


def _stretches(one: Along) -> list[tuple[float, float]]:
    """Return where limits bind, from half-way to the step before to half-way to the step behind [m]."""
    middles = np.concatenate([one.s[:1], 0.5 * (one.s[1:] + one.s[:-1]), one.s[-1:]])
    return [(float(middles[begin]), float(middles[end])) for begin, end in runs_of(one.binding)]


def _accuracy(axes: Axes, shown: Pictured) -> None:
    for number, points in enumerate(shown.accuracy.values()):
        if len(points):
            colour, again = f"C{number % _COLOURS}", number >= _COLOURS  # hollow marks: the colours' second time
            axes.scatter(
                np.maximum(points[:, 0], _EXACT_M), points[:, 1], s=26.0, alpha=0.8, marker=_MARKS[number % len(_MARKS)], edgecolors=colour,
                facecolors="none" if again else colour, linewidths=1.2 if again else 0.0,
            )  # fmt: skip
    axes.set(xscale="log", yscale="log", xlabel=_distance_words(shown), ylabel=f"{shown.unit} [ms]")
    axes.grid(visible=True)
    plain_decades(axes, "x")
    plain_decades(axes, "y")
    _headed(axes, f"time against accuracy, a mark a cell with all {shown.unit}s accepted")


def _distance_words(shown: Pictured) -> str:
    exact = any(len(points) and points[:, 0].min() < _EXACT_M for points in shown.accuracy.values())
    return "e_y off the optimum, at most [m]" + (f"; below {_EXACT_M:g} drawn there" if exact else "")


def _headed(axes: Axes, title: str) -> None:
    axes.set_title(title, loc="left", fontsize="small")


_STEP = [*COURSE, "step"]


@dataclass(frozen=True)
class Along:
    """The times of one solver's accepted steps along one course, by s."""

    solver: str
    s: FloatArray  # [m]
    ms: FloatArray
    binding: BoolArray


@dataclass(frozen=True)
class Pictured:
    """All that is drawn of a benchmark; mappings are by solver, the fastest first."""

    steps: int  # different ones
    unit: str  # what a step is: "step", or "QP" of a sample
    ratios: Mapping[str, FloatArray]  # of every step given to a solver: its time to the fastest one's; inf where it is not accepted
    ms: Mapping[str, FloatArray]  # of every step with its fastest round
    course: str  # that ``along`` is about
    along: tuple[Along, ...]
    accuracy: Mapping[str, FloatArray]  # (cells, 2): largest distance of e_y from the optimum [m], step [ms]


def order_of(summary: pd.DataFrame) -> list[str]:
    """Return the solvers of a finished benchmark's summary in the order of drawing: the fastest first, those behind that left steps out."""
    solvers = summary.groupby("solver", sort=False).agg(proved=("proved", "all"), ratio=("ratio", "median"))
    ordered = solvers.sort_values(["proved", "ratio"], ascending=[False, True], kind="stable", na_position="last")
    return [str(name) for name in ordered.index]


def pictured(samples: pd.DataFrame, timing: pd.DataFrame, order: Sequence[str]) -> Pictured:
    """Return what is drawn of a finished benchmark's tables, for the solvers in ``order`` that have an accepted step."""
    ranked = ranked_times(samples)
    good = ranked[ranked["accepted"]]
    order = [solver for solver in order if (good["solver"] == solver).any()]
    best = good.groupby(_STEP)["ms"].min()
    stopped = {tuple(map(str, key)) for key in timing.loc[timing["status"] == OVER_BUDGET, KEY].itertuples(index=False, name=None)}
    ratios = {}
    for solver in order:
        mine = ranked[ranked["solver"] == solver].set_index(_STEP)
        halted = {(key[0], key[1], key[2], key[4]) for key in stopped if key[3] == solver}  # as COURSE
        reached = set(mine.index)
        given = best[[key in reached or key[:-1] not in halted for key in best.index]]
        times = mine["ms"].where(mine["accepted"]).reindex(given.index)
        ratios[solver] = np.sort((times / given).fillna(np.inf).to_numpy(np.float64))
    course = _most_binding(ranked)
    return Pictured(
        len(best),
        unit_of(timing),
        ratios,
        {solver: np.sort(good.loc[good["solver"] == solver, "ms"].to_numpy(np.float64)) for solver in order},
        ", ".join(course),
        tuple(_times_along(samples, good, course, solver) for solver in order) if course else (),
        {solver: _cells(timing[timing["solver"] == solver]) for solver in order},
    )


def _cells(timing: pd.DataFrame) -> FloatArray:
    """Return distance and time of the cells in which all steps were accepted: refused ones have neither, however fast they are."""
    return timing.loc[timing["success"] == 1.0, ["distance_m", "step_ms"]].dropna().to_numpy(np.float64)


def share_within(ratios: FloatArray, at: FloatArray) -> FloatArray:
    """Return the share of steps within each of the factors ``at`` of the fastest (Dolan, More 2002); ``ratios`` sorted."""
    return np.asarray(np.searchsorted(ratios, at, side="right") / max(len(ratios), 1), np.float64)


def _most_binding(ranked: pd.DataFrame) -> tuple[str, ...]:
    if ranked.empty:
        return ()
    held = ranked.groupby(COURSE, sort=False)["binding"].sum()
    where = held.idxmax()
    return tuple(map(str, where)) if isinstance(where, tuple) else (str(where),)


def _times_along(samples: pd.DataFrame, ranked: pd.DataFrame, course: tuple[str, ...], solver: str) -> Along:
    key = pd.DataFrame([[*course, solver]], columns=[*COURSE, "solver"])
    places = samples.drop_duplicates([*KEY, "step"])[[*KEY, "step", "s_m"]]
    mine = ranked.merge(key, on=[*COURSE, "solver"]).merge(places, on=[*KEY, "step"]).sort_values("s_m")
    return Along(solver, mine["s_m"].to_numpy(np.float64), mine["ms"].to_numpy(np.float64), mine["binding"].to_numpy(np.bool_))
