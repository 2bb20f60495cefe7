"""Which solver is the fastest, by how much, and in how many steps: pure functions over data frames.

Solvers are ranked by ``step``: the shifted geometric mean over the accepted steps, each with its fastest round, of the processor time that
the process took. Waiting for the processor is not in it; neighbours on the same core still slow it. A solver that waits instead of working
(sleeps, or asks another process) would be flattered: its steps count by the clock, and one that does so often is not ranked, see
``hdvplan.bench.measuring.referee``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import pairwise

import numpy as np
import pandas as pd

from hdvplan.bench.measuring.referee import TUNED
from hdvplan.bench.suite import AS_SET, GROUP, KEY
from hdvplan.judging.balance import KEPT_M
from hdvplan.machine import busy_warning, others_words

SHIFT_MS = 0.1  # of the geometric mean: steps far shorter than this do not decide it


def unit_of(table: pd.DataFrame) -> str:
    """Return what one time in a timing or summary table is of: a planning step, or, of a sample, one QP, which linearises nothing."""
    return "QP" if len(table) and (table["linearise_ms"].dropna() == 0.0).all() and table["linearise_ms"].notna().any() else "step"


def ranked_times(samples: pd.DataFrame) -> pd.DataFrame:
    """Return what solvers are ranked by: of every step but the first the fastest round's time [ms], and whether it is accepted.

    That is processor time, which a busy machine hardly stretches, but the clock's where the solver gave its core away of its own accord:
    its work may have been done by another process.
    One row a cell and step: KEY, step, ``ms``, ``accepted``, ``binding``.
    """
    waits = samples.reindex(columns=["waits"], fill_value=0)["waits"] > 0  # older runs have no such column
    longer = samples[["cpu_s", "total_s"]].max(axis=1)
    warm = samples.assign(took=samples["cpu_s"].mask(waits, longer))[samples["step"] > 0]
    grouped = warm.groupby([*KEY, "step"], sort=False)
    steps = grouped.agg(ms=("took", "min"), accepted=("accepted", "all"), binding=("binding", "first")).reset_index()
    steps["ms"] *= 1e3
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


def scheme_ratios(summary: pd.DataFrame, named: list[str]) -> pd.DataFrame:
    """Return how many times as long SQP takes as RTI, ``step_ms`` and ``worst_ms``, by columns ``named``: of solvers proved in both."""
    proved = summary[summary["proved"].astype(bool)].set_index(named)
    sqp, rti = (proved.loc[proved["scheme"] == scheme, ["step_ms", "worst_ms"]] for scheme in ("sqp", "rti"))
    return (sqp / rti).dropna()


LEVEL = 1.05  # solvers within 5 % are level: the same program differs by 1 to 1.7 % between two processes (standard deviation)
BUSY_LEVEL = 1.2  # on a busy machine, where two rounds may both be disturbed
_SAME_PATH_M = 1e-3
_STRETCHED = 1.1  # times as long by the clock as by the processor: something else had the core
_WINDOWS_S = (60.0, 300.0, 900.0)  # of load averages
_OUTLASTS_S = 300.0  # a session as long as this is not judged by the minute before it


@dataclass(frozen=True)
class Finding:
    """The answer of one group; None where there is no winner."""

    vehicle: str
    scheme: str
    limits: str
    winner: str | None
    runner_up: str | None
    ratio: float | None  # of the runner-up's step to the winner's
    won: float | None  # the winner's share of all steps
    path_difference_m: float | None
    text: str


@dataclass(frozen=True)
class Load:
    """What else the machine did; ``warning`` is empty where it was quiet enough."""

    before: float | None  # load average when a short session began, the highest
    after: float | None  # the highest over the last session or a part of it, at its end; the benchmark itself is one of it
    cores: int | None
    wall_per_cpu: float | None  # of all timed steps
    warning: str


def findings_of(summary: pd.DataFrame, load: Load) -> list[Finding]:
    """Return one finding a vehicle, scheme and class of limits, of a summary in its order; each says where the machine was busy."""
    return [_finding(mine, load) for _, mine in summary.groupby(GROUP, sort=False)]


def load_of(summary: pd.DataFrame, sessions: Sequence[Mapping[str, object]], at_end: object, cores: object, finished: str) -> Load:
    """Return the load of a machine with ``cores``, from the averages that were noted and from the times themselves.

    ``sessions``, ``at_end`` and ``finished`` as in ``run.json``: load averages over 1, 5 and 15 minutes, or None, and times. What ran
    before a session counts only where the session was so short that it may have run beside it for most of it.
    """
    lasted = _lasted(sessions, finished)
    begun = [
        averages[0]
        for session, seconds in zip(sessions, lasted, strict=True)
        if (averages := session.get("load_average")) and isinstance(averages, list) and seconds < _OUTLASTS_S
    ]
    before = max(map(float, begun), default=None)
    spans = _WINDOWS_S[: max(1, sum(window <= lasted[-1] for window in _WINDOWS_S))] if lasted else _WINDOWS_S[:1]
    after = max(map(float, at_end[: len(spans)])) if isinstance(at_end, list) else None
    count = cores if isinstance(cores, int) else None
    stretched = float(summary["wall_per_cpu"].median()) if len(summary) and summary["wall_per_cpu"].notna().any() else None
    reasons = others_words(before, after, count)
    if stretched is not None and stretched > _STRETCHED:
        reasons.append(f"steps took {stretched:.2f} times as long by the clock as by the processor")
    return Load(before, after, count, stretched, busy_warning(reasons, count))


def _lasted(sessions: Sequence[Mapping[str, object]], finished: str) -> list[float]:
    """Return how long each session lasted at most, until the next began [s]; 0 where a time is not known."""
    times = [*(str(session.get("started", "")) for session in sessions), finished]
    try:
        instants = [datetime.fromisoformat(time).timestamp() for time in times]
    except ValueError:
        return [0.0] * len(sessions)
    return [after - before for before, after in pairwise(instants)]


def group_words(vehicle: str, scheme: str, limits: str) -> str:
    """Return what a verdict is about."""
    return f"{vehicle}, {scheme}" + ("" if limits == AS_SET else f", limits {limits}")


def broken_limits(summary: pd.DataFrame) -> list[str]:
    """Return of each group whose executed plans break their limits by how much they do at most."""
    return [
        f"{group_words(*map(str, key))}: plans break their limits by up to {deepest:.2f} m, as envelope.csv has it of each cell"
        for key, mine in summary.groupby(GROUP, sort=False)
        if (deepest := mine["limit_violation_m"].max()) > KEPT_M
    ]


def _finding(group: pd.DataFrame, load: Load) -> Finding:
    vehicle, scheme, limits = (str(group.iloc[0][name]) for name in GROUP)
    name, busy = group_words(vehicle, scheme, limits), " [busy machine]" if load.warning else ""
    unit = unit_of(group)

    def found(
        text: str, winner: str | None, rival: str | None = None, ratio: float | None = None, won: float | None = None,
        apart: float | None = None,
    ) -> Finding:  # fmt: skip
        return Finding(vehicle, scheme, limits, winner, rival, ratio, won, apart, f"{name}: {text}{busy}")

    able = group[group["proved"].astype(bool) & group["step_ms"].notna()]
    if able.empty:
        best = group.sort_values(["whole", "success"], ascending=False, kind="stable").iloc[0]
        accepted = f"has all its {unit}s accepted; {best['solver']} has {_share(best['success'])}"
        if best["whole"] and best["success"] == 1.0:
            accepted = f"is ranked; {best['solver']} has all its {unit}s accepted, but a status that is not ok in the table of timing"
        return found(f"no winner: no solver {accepted if best['whole'] else 'finished within its budget'}", None)
    winner, took = able.iloc[0], f"{able.iloc[0]['step_ms']:.3g} ms a {unit}"
    solver, won, steps = str(winner["solver"]), float(winner["won"]), int(winner["distinct_steps"])
    if len(group) == 1:
        return found(f"{solver} alone, {took}, all {steps} {unit}s accepted; no other solver to compare with", solver, won=won)
    rivals = group[group["ratio"].notna() & (group["solver"] != solver)].sort_values("ratio", kind="stable")
    failed = _failing(group)
    if rivals.empty:
        return found(f"{solver} is the only solver with accepted {unit}s, {took}{failed}", solver, won=won)
    stopped = rivals[~rivals["whole"].astype(bool) & (rivals["success"] == 1.0)]  # all that they reached is accepted
    second = able.iloc[1] if len(able) > 1 else stopped.iloc[0] if len(stopped) else None
    level = BUSY_LEVEL if load.warning else LEVEL
    if second is None or (not second["proved"] and second["ratio"] < level):  # nobody who leaves steps out can draw level
        others = group[group["whole"].astype(bool) & (group["success"] == 1.0) & (group["solver"] != solver)]
        only = f"with all its {unit}s accepted" if others.empty else "with every status ok and every step accepted"
        return found(f"{solver} is the only solver {only}, {took}{failed}", solver, won=won)
    rival, ratio = str(second["solver"]), float(second["ratio"])
    differ = np.max([winner["path_difference_m"], second["path_difference_m"]])  # NaN where one has no whole drive
    apart = float(differ) if np.isfinite(differ) else None
    same = "" if apart is None else f", {'the same path to' if apart < _SAME_PATH_M else 'but paths apart by'} {apart:.0e} m"
    if apart is None and np.isfinite(off := max(winner["distance_m"], second["distance_m"])):
        same = f", the same optima to {off:.0e} m"  # a sample of programs has no path
    if ratio < level:
        within = f"within {max(100.0 * (ratio - 1.0), 0.1):.1f} %"
        return found(f"no winner: {solver} and {rival} {within}, {took}{same}{failed}", None, rival, ratio, won, apart)
    over = "" if second["proved"] else f", over the {unit}s that {rival} did within its budget"
    text = f"{solver} is fastest in {_share(won)} of {steps} {unit}s, {ratio:.1f} times as fast as {rival}{over} ({took}){same}{failed}"
    return found(text, solver, rival, ratio, won, apart)


def _failing(group: pd.DataFrame) -> str:
    out = [str(solver) for solver in group.loc[~group["proved"].astype(bool), "solver"]]
    return f"; not ranked with it: {', '.join(out)}" if out else ""


def _share(share: float) -> str:
    """Return a share in percent that says 100 only where it is all."""
    percent = 100.0 * share
    return f"{percent:.0f} %" if percent in {0.0, 100.0} else f"{min(max(percent, 0.1), 99.9):.1f} %"


def how_ranked(accuracy: float | None = None) -> str:
    """Return the rule of the ranking, for captions; ``accuracy`` is the one to which solvers are held [m]."""
    rule = (
        "steps whose recomputed residuals prove them"
        if accuracy is None
        else f"steps with e_y within {TUNED * accuracy:g} m of the optimum of the same QP, solved and proved by the reference"
    )
    return (
        f"step: geometric mean, shifted by {SHIFT_MS:g} ms, of processor time over the accepted steps, each with its fastest round; "
        "x best: the same over the steps that both did; won: share of steps in which the solver was fastest of those with all steps "
        f"accepted; accepted: {rule}, as a share of all, also of those not reached in time"
    )
