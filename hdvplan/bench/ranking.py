"""Which solver is the fastest, by how much, and in how many steps: pure functions over data frames.

Solvers are ranked by ``step``: the shifted geometric mean over the accepted steps, each with its fastest round, of the processor time that
the process took. Waiting for the processor is not in it; neighbours on the same core still slow it. A solver that waits instead of working
(sleeps, or asks another process) would be flattered: where wall time is 1.5 times as long, and that much longer than beside the other
solvers, wall time counts.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from hdvplan.bench.suite import COURSE, GROUP, KEY

SHIFT_MS = 0.1  # of the geometric mean: steps far shorter than this do not decide it
_WAITS = 1.5


def unit_of(table: pd.DataFrame) -> str:
    """Return what one time in a timing or summary table is of: a planning step, or, of a sample, one QP, which linearises nothing."""
    return "QP" if len(table) and (table["linearise_ms"].dropna() == 0.0).all() and table["linearise_ms"].notna().any() else "step"


def waiting_cells(samples: pd.DataFrame) -> frozenset[tuple[str, ...]]:
    """Return the cells whose solver waits: wall time is much longer than processor time, here and not beside the other solvers."""
    warm = samples[samples["step"] > 0]
    fastest = warm.groupby([*KEY, "step"], sort=False)[["total_s", "cpu_s"]].min().groupby(KEY, sort=False).sum()
    ratio = (fastest["total_s"] / fastest["cpu_s"]).rename("ratio").reset_index()
    found = set()
    for _, course in ratio.groupby(COURSE, sort=False):
        for number, cell in course.iterrows():
            others = course["ratio"].drop(number)
            if cell["ratio"] > _WAITS and not cell["ratio"] <= _WAITS * others.min():
                found.add(tuple(str(cell[name]) for name in KEY))
    return frozenset(found)


def ranked_times(samples: pd.DataFrame, waiting: frozenset[tuple[str, ...]]) -> pd.DataFrame:
    """Return what solvers are ranked by: of every step but the first the fastest round's time [ms], and whether it is accepted.

    One row a cell and step: KEY, step, ``ms``, ``accepted``, ``binding``.
    """
    warm = samples[samples["step"] > 0]
    grouped = warm.groupby([*KEY, "step"], sort=False)
    steps = grouped.agg(
        cpu=("cpu_s", "min"), wall=("total_s", "min"), accepted=("accepted", "all"), binding=("binding", "first")
    ).reset_index()
    waits = [key in waiting for key in steps[KEY].itertuples(index=False, name=None)]
    steps["ms"] = 1e3 * np.where(waits, steps["wall"], steps["cpu"])
    return steps[[*KEY, "step", "ms", "accepted", "binding"]]


def shifted_mean(times: pd.Series[float]) -> float:
    """Return the geometric mean of times [ms], shifted by ``SHIFT_MS``; NaN of none."""
    return float(np.exp(np.log(times + SHIFT_MS).mean()) - SHIFT_MS)


def of_group(ranked: pd.DataFrame, group: pd.DataFrame) -> pd.DataFrame:
    """Return the steps of one group as a table: one row a road and step, one column a solver, NaN where it is not accepted."""
    mine = ranked.merge(group[GROUP].drop_duplicates(), on=GROUP)
    return mine[mine["accepted"]].pivot_table(index=["road", "step"], columns="solver", values="ms")


def ranking(group: pd.DataFrame, times: pd.DataFrame) -> pd.DataFrame:
    """Return the solvers of one group in their order, with ``ratio``, ``won`` and ``proved``: all its steps done and accepted.

    Steps are won among the proved solvers; ``won`` is NaN for others.
    ``times`` as ``of_group`` returns them.
    """
    proved = (group["success"] == 1.0) & group["whole"] & (group["cells_ok"] == group["cells"])
    group = group.assign(proved=proved)
    able = (group[proved] if proved.any() else group).dropna(subset="step_ms").sort_values("step_ms", kind="stable")
    ratios: dict[str, float] = {}
    if len(able) and str(able["solver"].iloc[0]) in times:
        best = times[str(able["solver"].iloc[0])]
        for solver in map(str, times):
            both = times[solver].notna() & best.notna()
            ratios[solver] = shifted_mean(times.loc[both, solver]) / shifted_mean(best[both]) if both.any() else np.nan
    solvers = [str(solver) for solver in group["solver"]]
    ranked = [solver for solver in map(str, group.loc[proved, "solver"]) if solver in times]
    fastest = times[ranked].dropna(how="all").idxmin(axis=1) if ranked else pd.Series(dtype=str)
    won = {solver: float((fastest == solver).mean()) for solver in ranked}
    group = group.assign(ratio=[ratios.get(solver, np.nan) for solver in solvers], won=[won.get(solver, np.nan) for solver in solvers])
    return group.sort_values(["proved", "ratio"], ascending=[False, True], kind="stable", na_position="last")
