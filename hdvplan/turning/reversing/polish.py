"""Local optima: a manoeuvre's parameters are changed until the ends of its site are as near together as constraints allow.

The generators' manoeuvres are pieces at full lock and straights. ``polished`` starts from one, and lets every piece be steered otherwise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

from hdvplan.arrays import FloatArray
from hdvplan.turning.follow import motion
from hdvplan.turning.reversing.legs import Draft, articulated, lead_along, posed
from hdvplan.turning.reversing.sites import Site
from hdvplan.vehicle.model import Vehicle

KEPT_M = 0.003  # from blocks that stand: more than bodies bow out between the poses of a polished manoeuvre
_PRICE = 500.0  # metres of a site's size for a metre within a block, or a radian: none is worth it
_ENOUGH_M = 1.0  # of room, of which more counts as this
_FAR_M = 10.0  # by which an end may be moved: docks need 4 m less
_DIFFERENCE = 1e-6  # of parameters, for derivatives
_POLISHED_M = 1e-5
_MOST_STEPS = 100
_SPLIT = 2  # parts of a generator's piece, each steered by itself
_EVERY_M = 0.2  # between the poses at which the longest of these is measured
_SHORTEST, _LONGEST = 0.3, 1.8  # of a generator's piece: further from it the optimum of another manoeuvre begins
_MOVED_M = 3.0  # by which the begin of a drive may lie elsewhere
_TRIALS = 4  # with more and more room kept from blocks
_MET = 3  # Newton steps to how a drive ends


@dataclass(frozen=True)
class Measured:
    """What candidates need: reaches to the ends (candidates, poses, ends), and the least room to blocks (candidates, poses) [m].

    Reaches hold the clearance that is kept, the room is what is left beyond it. ``off`` (candidates, n) is to be none, and ``spare``
    (candidates, poses, n) not negative [rad].
    """

    reaches: FloatArray
    room: FloatArray
    off: FloatArray
    spare: FloatArray

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
        """The size, much more where blocks are entered, or a drive ends or folds otherwise than it may (candidates,) [m]."""
        amiss = np.abs(self.off).sum(axis=1) + np.maximum(0.0, -self.spare).sum(axis=2).max(axis=1)
        return np.asarray(self.size + _PRICE * (self.entered + amiss))


Measure = Callable[[FloatArray], Measured]  # of parameters (n, candidates)


def measured(site: Site, vehicle: Vehicle, lead: FloatArray, beta: FloatArray | None = None) -> Measured:
    """Return what the poses ``lead`` (candidates, poses, 3) with articulation angles ``beta`` (candidates, poses, couplings) need."""
    poses, none = posed(vehicle, lead, beta), np.zeros((len(lead), 0))
    if site.blocks:
        room = site.gaps(vehicle, poses, site.clearance + KEPT_M).min(axis=(0, 3)) - site.clearance
    else:
        room = np.full(lead.shape[:2], np.inf)
    return Measured(site.reaches(vehicle, poses), room, none, np.zeros((*lead.shape[:2], 0)))


def least(measure: Measure, begin: FloatArray, low: FloatArray, high: FloatArray, each: int, far: float) -> FloatArray:
    """Return the parameters of a local optimum beside ``begin`` (n,): the ends' reaches are least, each above all its poses' (SLSQP).

    Of every ``each`` poses, those of a piece, the one that reaches furthest counts, and the one with least room. An end is moved by at most
    ``far`` [m]. The best of all that was looked at is returned: where constraints contradict each other nearby, the program ends anywhere.
    """
    n, last = len(begin), dict[bytes, tuple[FloatArray, FloatArray]]()
    first = measure(begin[:, None])
    best = first.cost[0], begin

    def rows(parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the constraints' values without the ends, and their derivatives."""
        nonlocal best
        key = parameters.tobytes()
        if key not in last:
            last.clear()
            found, steps = _stepped(measure, parameters, high)
            best = min(best, (found.cost[0], parameters.copy()), key=lambda one: one[0])
            last[key] = _derived(_rows(found, each), steps)
        return last[key]

    ends, off = first.reaches.shape[2], first.off.shape[1]
    pieces = first.reaches.shape[1] // each
    of_end = np.vstack([np.tile(np.eye(ends), (pieces, 1)), np.zeros((pieces * (1 + first.spare.shape[2]), ends))])
    met = {
        "type": "eq",
        "fun": lambda z: rows(z[:n])[0][:off],
        "jac": lambda z: np.column_stack([rows(z[:n])[1][:off], np.zeros((off, ends))]),
    }
    kept = {
        "type": "ineq",
        "fun": lambda z: rows(z[:n])[0][off:] + of_end @ z[n:],
        "jac": lambda z: np.column_stack([rows(z[:n])[1][off:], of_end]),
    }
    reach = first.reaches.max(axis=1)[0]
    minimize(  # type: ignore[call-overload]  # the stubs want the functions' arrays of one kind
        lambda z: float(z[n:].sum()), np.concatenate([begin, reach]), method="SLSQP",
        jac=lambda _: np.concatenate([np.zeros(n), np.ones(ends)]),
        bounds=[*zip(low, high, strict=True), *zip(reach - far, reach + far, strict=True)],
        constraints=[kept, met] if off else [kept],
        options={"ftol": _POLISHED_M, "maxiter": _MOST_STEPS},
    )  # fmt: skip
    return np.clip(best[1], low, high)  # SLSQP steps over bounds by rounding


def _rows(found: Measured, each: int) -> FloatArray:
    """Return the constraints' values of candidates: how a drive ends, the ends, the room, the articulation."""
    count, pieces = len(found.reaches), found.reaches.shape[1] // each
    reach = -found.reaches.reshape(count, pieces, each, -1).max(axis=2).reshape(count, -1)
    room = np.minimum(found.room.reshape(count, pieces, each).min(axis=2), _ENOUGH_M) - KEPT_M
    spare = found.spare.reshape(count, pieces, each, found.spare.shape[2]).min(axis=2).reshape(count, -1)
    return np.column_stack([found.off, reach, room, spare])


def _stepped(measure: Measure, at: FloatArray, high: FloatArray) -> tuple[Measured, FloatArray]:
    """Return what parameters ``at`` (n,) need, then those with one of them changed by the steps (n,), which stay below ``high``."""
    steps = np.where(at + _DIFFERENCE > high, -_DIFFERENCE, _DIFFERENCE)
    return measure(at[:, None] + np.column_stack([np.zeros(len(at)), np.diag(steps)])), steps


def _derived(values: FloatArray, steps: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the first of ``values`` (1 + n, m), (m,), and the derivatives, (m, n)."""
    return values[0], (values[1:] - values[0]).T / steps


@dataclass(frozen=True)
class _Free:
    """The parameters of a draft's pieces: how long each is, how it is steered, as a share of full lock, and where the drive begins."""

    site: Site
    vehicle: Vehicle
    draft: Draft
    end: FloatArray  # heading at its end, and articulation angles [rad]
    folded: FloatArray  # the most that trailers may be articulated (couplings,) [rad]

    @property
    def stands(self) -> int:
        """How many coordinates of the begin are parameters: at a dock it is given, and between two walls it does not matter."""
        return 0 if self.site.template.docks or not self.site.blocks else 2

    @property
    def begin(self) -> FloatArray:
        """The parameters of the draft."""
        draft = self.draft
        return np.concatenate([draft.lengths, draft.kappas / self.vehicle.max_curvature, draft.start[: self.stands]])

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """The least and the most of each parameter."""
        draft, lock = self.draft, np.ones(len(self.draft.kappas))
        stands = draft.start[: self.stands]
        low = np.concatenate([_SHORTEST * draft.lengths, -lock, stands - _MOVED_M])
        return low, np.concatenate([_LONGEST * draft.lengths, lock, stands + _MOVED_M])

    @property
    def each(self) -> int:
        """How many poses every piece is measured at."""
        return 1 + int(np.ceil(self.draft.lengths.max() / _EVERY_M))

    def drafted(self, parameters: FloatArray) -> Draft:
        """Return the draft that parameters (n,) describe."""
        start, lengths, kappas = self._parts(parameters[:, None])
        return replace(self.draft, start=start[0], lengths=lengths[0], kappas=kappas[0])

    def _parts(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        count, n = parameters.shape[1], len(self.draft.lengths)
        start = np.tile(self.draft.start, (count, 1))
        start[:, : self.stands] = parameters[2 * n :].T
        return start, parameters[:n].T, parameters[n : 2 * n].T * self.vehicle.max_curvature

    def measure(self, parameters: FloatArray) -> Measured:
        """Return what the drives of ``parameters`` (n, candidates) need, by how much they end otherwise, and trailers may fold further."""
        start, lengths, kappas = self._parts(parameters)
        signs, units = np.where(self.draft.leg % 2 == 1, -1.0, 1.0), self.vehicle.table()
        different, which = np.unique(kappas, return_inverse=True)
        motions = np.array([motion(units, kappa) for kappa in different.tolist()])[which.reshape(kappas.shape)]
        lead = lead_along(start, signs * lengths, (motions[..., 0], motions[..., 1]), self.each - 1)
        beta = self._beta(lengths, kappas)
        flat = lead.reshape(len(lead), -1, 3)
        found = measured(self.site, self.vehicle, flat, beta)
        off = np.column_stack([flat[:, -1, 2], beta[:, -1]]) - self.end
        return replace(found, off=off, spare=self.folded - np.abs(beta))

    def _beta(self, lengths: FloatArray, kappas: FloatArray) -> FloatArray:
        """Return the articulation angles (candidates, poses, couplings) [rad]; vehicles with trailers have a single leg, forwards."""
        count, pieces = lengths.shape
        couplings = len(self.vehicle.units) - 1
        if not couplings:
            return np.zeros((count, pieces * self.each, 0))
        counts, stretched = [self.each - 1] * pieces, np.zeros(couplings)
        drives = (list(zip(own, steered, strict=True)) for own, steered in zip(lengths.tolist(), kappas.tolist(), strict=True))
        return np.array([np.concatenate(articulated(self.vehicle, drive, counts, stretched)) for drive in drives])

    def met(self, parameters: FloatArray) -> FloatArray:
        """Return parameters beside these (n,) with which the drive ends as it should, by other lengths."""
        n, high = len(self.draft.lengths), self.bounds[1]
        for _ in range(_MET):
            found, steps = _stepped(self.measure, parameters, high)
            off, change = _derived(found.off, steps)
            parameters = parameters.copy()
            parameters[:n] -= parameters[:n] * np.linalg.lstsq(change[:, :n] * parameters[:n], off)[0]  # no short one turns negative
        return parameters


def polished(
    site: Site, vehicle: Vehicle, draft: Draft, end: FloatArray, folded: FloatArray, lacking: Callable[[Draft], float]
) -> Draft | None:  # fmt: skip
    """Return a local optimum beside ``draft``, whose pieces are split; ``end`` and ``folded`` are as in ``_Free``.

    ``lacking`` tells how much room is lacking between the poses at which a drive is measured here: so much more is kept in a further try.
    None where some is lacking after the last.
    """
    split = Draft(
        draft.start, np.repeat(draft.lengths / _SPLIT, _SPLIT), np.repeat(draft.kappas, _SPLIT), np.repeat(draft.leg, _SPLIT)
    )  # fmt: skip
    free = _Free(site, vehicle, split, end, folded)
    parameters = free.begin
    for _ in range(_TRIALS):
        parameters = free.met(least(free.measure, parameters, *free.bounds, free.each, _FAR_M))
        found = free.drafted(parameters)
        short = lacking(found)
        if short == 0.0:
            return found
        free = replace(free, site=replace(free.site, clearance=free.site.clearance + short))
    return None
