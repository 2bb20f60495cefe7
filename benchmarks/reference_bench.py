"""What the behaviour reference holds of benchmarks: their pure decisions about samples that are given beforehand. Nothing is planned."""

from __future__ import annotations

import numpy as np
import pandas as pd
from reference_scenes import Quantities, Told

from hdvplan.arrays import FloatArray
from hdvplan.bench.comparing.counters import COUNTS, LENGTHS, WORK, Tolerance, changes_of
from hdvplan.bench.comparing.decision import Pairs, Rule, agreement, decide
from hdvplan.bench.measuring.courses import with_limits
from hdvplan.bench.measuring.ranking import load_of, of_group, ranked_times, ranking
from hdvplan.bench.measuring.referee import accepted
from hdvplan.bench.suite import CLASSES, GIVEN, KEY, Suite
from hdvplan.road.load import load_road
from hdvplan.vehicle.load import load_vehicle

_STEPS = 40
_CELL = {"road": "road", "vehicle": "bus", "scheme": "rti", "limits": "as set"}


def decided(told: Told) -> Quantities:
    """Return the decision of the kind that ``decides`` names."""
    return {"gate": _gate, "joint": _joint, "acceptance": _acceptance, "ranking": _ranking, "load": _load, "counters": _counters}[
        told["decides"]
    ](told)


def limited(told: Told) -> Quantities:
    """Return the least and the most room between a smoothed ``road`` and the limits of every class of a suite for a ``vehicle`` [m]."""
    road, vehicle = load_road(told["road"]), load_vehicle(told["vehicle"])
    found: Quantities = {}
    for name in (name for name in CLASSES if name != GIVEN):
        limits = with_limits(road, vehicle, Suite(), name).passable
        if limits is not None:
            left, right = limits.table(np.linspace(0.0, road.path.length, 200))[:2]
            for side, room in (("left", left), ("right", -right)):
                found |= {f"least {side} {name}": float(room.min()), f"most {side} {name}": float(room.max())}
    return found


def _gate(told: Told) -> Quantities:
    """Return what the timing gate says of ``pairs`` of processes, the new ones ``slower`` by a factor, both sides ``uneven``."""
    base, new = _times(told["pairs"], told["uneven"], 1.0, 0), _times(told["pairs"], told["uneven"], told["slower"], 1)
    (found,) = decide([Pairs(base.mean(axis=1), new.mean(axis=1), Rule().factor, Rule().floor)])
    numbers = {"ratio": found.ratio, "low": found.low, "high": found.high, "noise": found.noise, "base": found.base, "new": found.new}
    return {"verdict": str(found.verdict)} | {name: _number(value) for name, value in numbers.items()}


def _number(value: float) -> float | str:
    """Return a number, or that there is none: what is not finite is never within a tolerance."""
    return float(value) if np.isfinite(value) else "none"


def _times(pairs: int, uneven: float, factor: float, side: int) -> FloatArray:
    """Return times (pairs, steps) [s] that scatter by sines, the same everywhere."""
    row, column = np.arange(pairs)[:, None] + 0.5 * side, np.arange(_STEPS)
    process, step = np.sin(12.9898 * row) ** 2, np.sin(78.233 * column + row) ** 2
    return np.asarray(1e-3 * factor * (1.0 + uneven * process) * (1.0 + 0.3 * step), np.float64)


def _joint(told: Told) -> Quantities:
    """Return how ``pairs`` agree in three statistics, of which the first is ``larger`` on the new side."""
    pairs = np.arange(told["pairs"])
    ratios = told["uneven"] * np.sin(12.9898 * pairs + 78.233 * np.arange(3)[:, None])
    ratios[0] += np.log(told["larger"])
    rows = zip(*agreement(ratios), strict=True)
    return {
        f"{name} {row}": _number(one) for row, pair in enumerate(rows) for name, one in zip(("chance", "detectable"), pair, strict=True)
    }


def _acceptance(told: Told) -> Quantities:
    """Return how many points on a logarithmic grid of residuals are accepted at each of the ``scales``."""
    grid = np.logspace(-8.1, 0.1, 30)  # none of which lies on a threshold
    primal, dual, gap = np.meshgrid(grid, grid, grid)
    return {f"accepted {scale:g}": int(np.sum(accepted(primal, dual, gap, np.full(primal.shape, scale)))) for scale in told["scales"]}


def _ranking(told: Told) -> Quantities:
    """Return the order of solvers: ``took`` is each one's step [ms], ``refused`` its refused steps."""
    samples = pd.concat([_samples(name, ms, told) for name, ms in told["took"].items()], ignore_index=True)
    ranked = ranked_times(samples)
    cells = [{**_CELL, "solver": name} for name in told["took"]]
    group = pd.DataFrame(cells).assign(cells=1, cells_ok=1, whole=True)
    share = ranked.groupby("solver")["accepted"].mean()
    mean = ranked[ranked["accepted"]].groupby("solver")["ms"].mean()
    group = group.assign(success=group["solver"].map(share), step_ms=group["solver"].map(mean))
    table = ranking(group, of_group(ranked, group))
    found: Quantities = {"order": " ".join(table["solver"]), "proved": " ".join(table.loc[table["proved"], "solver"])}
    return found | {
        f"{name} {row['solver']}": float(row[name]) for _, row in table.iterrows() for name in ("ratio", "won") if np.isfinite(row[name])
    }


def _samples(solver: str, took: float, told: Told) -> pd.DataFrame:
    step = np.tile(np.arange(_STEPS + 1), 2)
    cpu = 1e-3 * took * (1.0 + 0.3 * np.sin(78.233 * np.arange(len(step)) + took) ** 2)
    refused = step > _STEPS - told.get("refused", {}).get(solver, 0)
    table = pd.DataFrame({"round": np.repeat([0, 1], _STEPS + 1), "step": step, "cpu_s": cpu, "total_s": cpu})
    return table.assign(accepted=~refused, binding=False, solver=solver, **_CELL)[[*KEY, *table.columns, "accepted", "binding"]]


def _load(told: Told) -> Quantities:
    """Return whether a machine with two cores counts as busy, by its load ``before`` and ``after``, and clock per processor time."""
    session = {"started": "2024-01-01T00:00:00+00:00", "load_average": [told["before"]] * 3}
    summary = pd.DataFrame({"wall_per_cpu": [told["wall_per_cpu"]]})
    found = load_of(summary, [session], [told["after"]] * 3, 2, "2024-01-01T00:01:30+00:00")
    return {"busy": str(bool(found.warning)), "reasons": found.warning.count(",") if found.warning else 0}


def _counters(told: Told) -> Quantities:
    """Return which counters of a cell are told when all of them grow by ``share``, and all lengths by ``longer`` [m]."""
    counts, lengths = [*COUNTS, *WORK], list(LENGTHS)
    base = pd.DataFrame([{**_CELL, "solver": "piqp", "status": "ok", **dict.fromkeys(counts, 100), **dict.fromkeys(lengths, 1.0)}])
    new = base.copy()
    new[counts] = (new[counts] * (1.0 + told["share"])).round().astype(int)
    new[lengths] = new[lengths] + told["longer"]
    changes = changes_of(base, new, Tolerance(work=told["work"]))
    return {"changes": len(changes), "changed": " ".join(change.counter for change in changes)}
