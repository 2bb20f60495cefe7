"""What the pictures of a benchmark show, as numbers: performance profiles, distributions, times along the road and against accuracy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from hdvplan.arrays import BoolArray, FloatArray
from hdvplan.bench.ranking import ranked_times, unit_of, waiting_cells
from hdvplan.bench.samples import OVER_BUDGET
from hdvplan.bench.suite import COURSE, KEY

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
    """Return what is drawn of a finished benchmark's tables, for the solvers in ``order``."""
    ranked = ranked_times(samples, waiting_cells(samples))
    good = ranked[ranked["accepted"]]
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
        tuple(_along(samples, good, course, solver) for solver in order) if course else (),
        {solver: _cells(timing[timing["solver"] == solver]) for solver in order},
    )


def _cells(timing: pd.DataFrame) -> FloatArray:
    """Return distance and time of the cells in which all steps were accepted: refused ones have neither, however fast they are."""
    return timing.loc[timing["success"] == 1.0, ["distance_m", "step_ms"]].dropna().to_numpy(np.float64)


def share_within(ratios: FloatArray, at: FloatArray) -> FloatArray:
    """Return the share of steps within each of the factors ``at`` of the fastest (Dolan, More 2002); ``ratios`` sorted."""
    return np.asarray(np.searchsorted(ratios, at, side="right") / max(len(ratios), 1), np.float64)


def _most_binding(ranked: pd.DataFrame) -> tuple[str, ...]:
    """Return the course on which limits bind in most steps; nothing where no step was planned."""
    if ranked.empty:
        return ()
    held = ranked.groupby(COURSE, sort=False)["binding"].sum()
    where = held.idxmax()
    return tuple(map(str, where)) if isinstance(where, tuple) else (str(where),)


def _along(samples: pd.DataFrame, ranked: pd.DataFrame, course: tuple[str, ...], solver: str) -> Along:
    key = pd.DataFrame([[*course, solver]], columns=[*COURSE, "solver"])
    places = samples.drop_duplicates([*KEY, "step"])[[*KEY, "step", "s_m"]]
    mine = ranked.merge(key, on=[*COURSE, "solver"]).merge(places, on=[*KEY, "step"]).sort_values("s_m")
    return Along(solver, mine["s_m"].to_numpy(np.float64), mine["ms"].to_numpy(np.float64), mine["binding"].to_numpy(np.bool_))
