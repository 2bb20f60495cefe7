"""The smallest site that a family of manoeuvres was found to fit in: several starts of a global search, each polished locally.

What is found is room that suffices. Less may suffice, too: no search of this kind shows that nothing else fits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.optimize import Bounds, differential_evolution

from hdvplan.arrays import FloatArray
from hdvplan.turning.reversing.half_turns import half_turn
from hdvplan.turning.reversing.legs import wheels_at_stop
from hdvplan.turning.reversing.polish import Measured, least, measured
from hdvplan.turning.reversing.sites import Site
from hdvplan.vehicle.model import Vehicle

_PARTS, _FINER, _FINEST = 8, 48, 500  # of a piece: a quarter turn then bows out by 0.5, 0.013 and 0.0001 % of its radius
_ENTERED_M = 0.002  # of that, which a polished manoeuvre may take: rounding, and poses that were not looked at
_FAR_M = 3.0  # by which a local search may move an end
_DRAWN = 40  # at random, times the square of the parameters' number, of which the best begin the search
_POPULATION = 8  # times that number
_NONE = 0.5  # of the drawn parameters are 0
_GENERATIONS = 150
_SETTLED = 1e-4  # spread of a population that is done, as a share of its size

Cost = Callable[[FloatArray], FloatArray]  # of parameters (n, candidates), a size of each [m]


@dataclass(frozen=True)
class Found:
    """What one start led to: parameters (n,), the size of the site, and by how much blocks that stand are entered [m]."""

    parameters: FloatArray
    size: float
    entered: float

    @property
    def kept(self) -> bool:
        """Whether no block is entered."""
        return self.entered <= _ENTERED_M


def half_turns_in(
    site: Site, vehicle: Vehicle, legs: int, starts: int, on_progress: Callable[[float], None] | None = None
) -> tuple[Found, ...]:
    """Return what ``starts`` searches for a half turn of so many ``legs`` found, the smallest first; ``on_progress``: their share."""
    family, wheels = half_turn(site.template, vehicle, legs), wheels_at_stop(vehicle)

    def measure(parameters: FloatArray, parts: int) -> Measured:
        lead = family.strokes(parameters).lead(wheels, parts)
        return measured(site, vehicle, lead.reshape(len(lead), -1, 3))

    def cost(parameters: FloatArray) -> FloatArray:
        return measure(parameters, _PARTS).cost

    found = []
    for seed in range(starts):
        rough = _global(cost, family.low, family.high, seed)
        smooth = least(partial(measure, parts=_FINER), rough, family.low, family.high, _FINER + 1, _FAR_M)
        fine = measure(smooth[:, None], _FINEST)
        found.append(Found(smooth, site.base + float(fine.size[0]), float(fine.entered[0])))
        if on_progress is not None:
            on_progress((seed + 1) / starts)
    return tuple(sorted(found, key=lambda one: (not one.kept, one.size if one.kept else one.entered)))


def _global(cost: Cost, low: FloatArray, high: FloatArray, seed: int) -> FloatArray:
    """Return the best parameters (n,) of a differential evolution that begins with the best of many drawn."""
    rng = np.random.default_rng(seed)
    ended = differential_evolution(
        cost,  # type: ignore[arg-type]  # the stubs know no vectorized cost
        Bounds(low, high), init=_begun(cost, low, high, rng), maxiter=_GENERATIONS, mutation=(0.3, 0.9),
        recombination=0.9, tol=_SETTLED, rng=rng, polish=False, updating="deferred", vectorized=True,
    )  # fmt: skip
    return np.asarray(ended.x)


def _begun(cost: Cost, low: FloatArray, high: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return the first population, (candidates, n): the best of many that are drawn, in which any parameter may be none."""
    drawn = rng.uniform(low, high, (_DRAWN * len(low) ** 2, len(low)))
    none = np.clip(0.0, low, high)
    drawn = np.where(rng.random(drawn.shape) < _NONE, none, drawn)
    return np.asarray(drawn[np.argsort(cost(drawn.T))[: _POPULATION * len(low)]])
