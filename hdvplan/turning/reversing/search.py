"""The smallest site that a family of manoeuvres was found to fit in: several starts of a global search, each polished locally.

What is found is room that suffices. Less may suffice, too: no search of this kind shows that nothing else fits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.optimize import Bounds, differential_evolution, minimize

from hdvplan.arrays import FloatArray
from hdvplan.turning.reversing.half_turns import half_turn
from hdvplan.turning.reversing.legs import posed, wheels_at_stop
from hdvplan.turning.reversing.sites import Site
from hdvplan.vehicle.model import Vehicle

KEPT_M = 0.003  # from blocks that stand: more than bodies bow out between the poses of a polished manoeuvre
_PRICE = 500.0  # metres of a site's size for a metre within a block: none is worth entering it
_PARTS, _FINER, _FINEST = 8, 48, 500  # of a piece: a quarter turn then bows out by 0.5, 0.013 and 0.0001 % of its radius
_ENTERED_M = 0.002  # of that, which a polished manoeuvre may take: rounding, and poses that were not looked at
_DRAWN = 40  # at random, times the square of the parameters' number, of which the best begin the search
_POPULATION = 8  # times that number
_NONE = 0.5  # of the drawn parameters are 0
_GENERATIONS = 150
_SETTLED = 1e-4  # spread of a population that is done, as a share of its size
_DIFFERENCE = 1e-6  # of parameters, for derivatives
_POLISHED_M = 1e-5
_MOST_STEPS = 100

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


@dataclass(frozen=True)
class Measured:
    """What candidates need: reaches to the ends (candidates, poses, ends), and the least room to blocks (candidates, poses) [m].

    Reaches hold the clearance that is kept, the room is what is left beyond it.
    """

    reaches: FloatArray
    room: FloatArray

    @property
    def size(self) -> FloatArray:
        """How far the ends are apart (candidates,) [m]."""
        return np.asarray(self.reaches.max(axis=1).sum(axis=1))

    @property
    def entered(self) -> FloatArray:
        """By how much blocks, and what is kept from them, are entered (candidates,) [m]."""
        return np.asarray(np.maximum(0.0, KEPT_M - self.room.min(axis=1)))

    @property
    def cost(self) -> FloatArray:
        """The size, much more where blocks are entered (candidates,) [m]."""
        return np.asarray(self.size + _PRICE * self.entered)

    def found(self, parameters: FloatArray, base: float) -> Found:
        """Return what the only candidate is."""
        return Found(parameters, base + float(self.size[0]), float(self.entered[0]))


def half_turns_in(
    site: Site, vehicle: Vehicle, legs: int, starts: int, on_progress: Callable[[float], None] | None = None
) -> tuple[Found, ...]:
    """Return what ``starts`` searches for a half turn of so many ``legs`` found, the smallest first; ``on_progress``: their share."""
    family, wheels = half_turn(site.template, vehicle, legs), wheels_at_stop(vehicle)

    def measured(parameters: FloatArray, parts: int) -> Measured:
        lead = family.strokes(parameters).lead(wheels, parts)
        return _measured(site, vehicle, lead.reshape(len(lead), -1, 3))

    def cost(parameters: FloatArray) -> FloatArray:
        return measured(parameters, _PARTS).cost

    found = []
    for seed in range(starts):
        rough = _global(cost, family.low, family.high, seed)
        smooth = _polished(partial(measured, parts=_FINER), rough, family.low, family.high, _FINER + 1)
        found.append(measured(smooth[:, None], _FINEST).found(smooth, site.base))
        if on_progress is not None:
            on_progress((seed + 1) / starts)
    return tuple(sorted(found, key=lambda one: (not one.kept, one.size if one.kept else one.entered)))


def _measured(site: Site, vehicle: Vehicle, lead: FloatArray) -> Measured:
    poses = posed(vehicle, lead)
    if not site.blocks:
        return Measured(site.reaches(vehicle, poses), np.full(lead.shape[:2], np.inf))
    room = site.gaps(vehicle, poses, site.clearance + KEPT_M).min(axis=(0, 3)) - site.clearance
    return Measured(site.reaches(vehicle, poses), room)


def _global(cost: Cost, low: FloatArray, high: FloatArray, seed: int) -> FloatArray:
    """Return the best parameters (n,) of a differential evolution that begins with the best of many drawn."""
    rng = np.random.default_rng(seed)
    ended = differential_evolution(
        cost,  # type: ignore[arg-type]  # the stubs know no vectorized cost
        Bounds(low, high), init=_begun(cost, low, high, rng), maxiter=_GENERATIONS, mutation=(0.3, 0.9),
        recombination=0.9, tol=_SETTLED, rng=rng, polish=False, updating="deferred", vectorized=True,
    )  # fmt: skip
    return np.asarray(ended.x)


def _polished(measured: Callable[[FloatArray], Measured], begin: FloatArray, low: FloatArray, high: FloatArray, each: int) -> FloatArray:
    """Return the parameters of a local optimum beside ``begin`` (n,): the ends' reaches are least, each above all its poses' (SLSQP).

    Of every ``each`` poses, those of a piece, the one that reaches furthest counts, and the one with least room.
    """
    n, last = len(begin), dict[bytes, tuple[FloatArray, FloatArray]]()

    def rows(parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the constraints' values without the ends, and their derivatives."""
        key = parameters.tobytes()
        if key not in last:
            last.clear()
            steps = np.column_stack([np.zeros((n, 1)), _DIFFERENCE * np.eye(n)])
            found = measured(parameters[:, None] + steps)
            reach = -found.reaches.reshape(n + 1, -1, each, found.reaches.shape[2]).max(axis=2).reshape(n + 1, -1)
            values = np.column_stack([reach, np.minimum(found.room.reshape(n + 1, -1, each).min(axis=2), 1.0) - KEPT_M])
            last[key] = values[0], (values[1:] - values[0]).T / _DIFFERENCE
        return last[key]

    first = measured(begin[:, None])
    ends = first.reaches.shape[2]
    pieces = first.reaches.shape[1] // each
    of_end = np.vstack([np.tile(np.eye(ends), (pieces, 1)), np.zeros((pieces, ends))])
    ended = minimize(  # type: ignore[call-overload]  # the stubs want the functions' arrays of one kind
        lambda z: float(z[n:].sum()), np.concatenate([begin, first.reaches.max(axis=1)[0]]), method="SLSQP",
        jac=lambda _: np.concatenate([np.zeros(n), np.ones(ends)]),
        bounds=[*zip(low, high, strict=True), *[(None, None)] * ends],
        constraints={
            "type": "ineq",
            "fun": lambda z: rows(z[:n])[0] + of_end @ z[n:],
            "jac": lambda z: np.column_stack([rows(z[:n])[1], of_end]),
        },
        options={"ftol": _POLISHED_M, "maxiter": _MOST_STEPS},
    )  # fmt: skip
    better = np.clip(ended.x[:n], low, high)
    return better if measured(better[:, None]).cost[0] < first.cost[0] else begin


def _begun(cost: Cost, low: FloatArray, high: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return the first population, (candidates, n): the best of many that are drawn, in which any parameter may be none."""
    drawn = rng.uniform(low, high, (_DRAWN * len(low) ** 2, len(low)))
    none = np.clip(0.0, low, high)
    drawn = np.where(rng.random(drawn.shape) < _NONE, none, drawn)
    return np.asarray(drawn[np.argsort(cost(drawn.T))[: _POPULATION * len(low)]])
