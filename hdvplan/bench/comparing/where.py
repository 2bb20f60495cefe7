"""Where a slowdown is: in which part of the planning step, in which steps, and so at which places of the road."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hdvplan.arrays import FloatArray, IntArray
from hdvplan.bench.comparing.sides import Steps

_SHARE = 0.8  # of the added time: the steps that are named account for so much of it
_ALIKE = 0.5  # of the least of these: steps that gained so much belong to them
_FEW = 0.5  # of all steps; more are no place
_MOST = 3  # stretches that are named


@dataclass(frozen=True)
class Stretch:
    """Steps that follow each other, by number, and where they begin [m]; NaN where that is not known."""

    first: int
    last: int
    begin: float
    end: float


@dataclass(frozen=True)
class Place:
    """Where a cell became slower: what each part of a mean step gained [ms], the largest first, and the steps that hold most of it."""

    parts: tuple[tuple[str, float], ...]
    stretches: tuple[Stretch, ...]  # none: it is spread over the drive
    share: float  # of the added time, within the stretches


def place_of(base: Sequence[Steps], new: Sequence[Steps]) -> Place:
    """Return where the new side's steps take longer; both sides' processes have the same steps."""
    parts = {
        name: 1e3 * float(np.mean(_usual([one.parts[name] for one in new]) - _usual([one.parts[name] for one in base])))
        for name in base[0].parts
        if all(name in one.parts for one in (*base, *new))
    }
    inside = _usual([one.total for one in new]) - _usual([one.total for one in base])
    gained = inside
    if all(one.outer.size for one in (*base, *new)):
        gained = _usual([one.outer for one in new]) - _usual([one.outer for one in base])
        parts["outside of the planner"] = 1e3 * float(np.mean(gained - inside))
    if parts:
        parts["rest of the step"] = 1e3 * float(np.mean(inside)) - sum(parts.get(name, 0.0) for name in base[0].parts)
    largest = tuple(sorted(parts.items(), key=lambda entry: -entry[1]))
    steps, share = _steps(gained)
    return Place(largest, _stretches(steps, base[0].s), share)


def place_words(place: Place) -> tuple[str, str]:
    """Return the part and the place in words."""
    whole = sum(gain for _, gain in place.parts if gain > 0.0)
    told = [f"{name} +{gain:.3g} ms" for name, gain in place.parts if whole > 0.0 and gain > 0.2 * whole]
    where = [
        (f"step {one.first}" if one.first == one.last else f"steps {one.first}-{one.last}")
        + (
            ""
            if np.isnan(one.begin)
            else f" (s = {one.begin:.0f} m)"
            if one.first == one.last
            else f" (s = {one.begin:.0f}-{one.end:.0f} m)"
        )
        for one in place.stretches
    ]
    return ", ".join(told) or "-", f"{100.0 * place.share:.0f} % in {', '.join(where)}" if where else "all along"


def _usual(processes: Sequence[FloatArray]) -> FloatArray:
    """Return every step's median over all rounds of all processes."""
    return np.asarray(np.median(np.concatenate(processes), axis=0), np.float64)


def _steps(gained: FloatArray) -> tuple[IntArray, float]:
    """Return the fewest steps that hold most of what was added, and their share of it; none where it takes many."""
    order = np.argsort(gained)[::-1]
    added = np.maximum(gained[order], 0.0)
    whole = float(added.sum())
    if whole <= 0.0:
        return np.empty(0, np.int64), 0.0
    count = int(np.searchsorted(np.cumsum(added), _SHARE * whole)) + 1
    count = int(np.count_nonzero(added >= _ALIKE * added[count - 1]))
    if count > max(1.0, _FEW * len(gained)):
        return np.empty(0, np.int64), 0.0
    return np.sort(order[:count]).astype(np.int64), float(added[:count].sum() / whole)


def _stretches(steps: IntArray, s: FloatArray) -> tuple[Stretch, ...]:
    """Return steps, numbered from the first that is timed, as stretches; none where they are scattered."""
    if not len(steps):
        return ()
    runs = np.split(steps, np.flatnonzero(np.diff(steps) > 1) + 1)
    if len(runs) > _MOST:
        return ()
    places = s if len(s) else np.full(int(steps.max()) + 1, np.nan)
    return tuple(Stretch(int(run[0]) + 1, int(run[-1]) + 1, float(places[run[0]]), float(places[run[-1]])) for run in runs)
