"""The drives that manoeuvres begin with: half turns by a search, and pulling out of a dock.

Half turns of one, three or five legs have few parameters: angles of arcs at the least radius, and straights between them. A leg is an arc,
a straight and an arc; the last leg's first arc completes the half turn. The first leg may swing out to the right before it turns to the
left, and the last leg straightens from beyond the half turn: tail and front then swing where there is room. The search for the smallest
site has several starts, each polished locally. What it finds is room that suffices; less may suffice, too.

Backing into a dock is pulling out in reverse. The vehicle drives straight out and turns left at full lock until it is in line with the wall
and stretched: with a trailer it turns further and back, by the angle that leaves no articulation. There the forward drive along the wall
ends on which it came. The straight is the shortest with which it passes its neighbours.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.optimize import Bounds, brentq, differential_evolution

from hdvplan.arrays import FloatArray
from hdvplan.errors import TurnError
from hdvplan.turning.reversing.legs import Draft, DrivenLeg, Strokes, Wheels, articulated, driven, wheels_at_stop
from hdvplan.turning.reversing.options import Template
from hdvplan.turning.reversing.polish import Measured, least, measured
from hdvplan.turning.reversing.sites import Site, dock_heading
from hdvplan.vehicle.model import Vehicle

_SWING_RAD = 0.9  # how far a leg may turn against the half turn
_MOST_RAD = 2.4  # that a leg's arc turns
_STANDS = 2  # parameters that say where a turning head is entered


@dataclass(frozen=True)
class HalfTurn:
    """The family of half turns with so many ``legs``; parameters lie between ``low`` and ``high`` (n,)."""

    legs: int
    heading: float  # at its begin [rad]
    free: bool  # whether its place matters along and across the road, or only its extent
    low: FloatArray
    high: FloatArray

    def strokes(self, parameters: FloatArray) -> Strokes:
        """Return the drives of ``parameters`` (n, candidates)."""
        count, first = parameters.shape[1], 0 if self.free else _STANDS
        start = np.zeros((count, 3))
        start[:, 2] = self.heading
        start[:, :first] = parameters[:first].T
        amounts, straight, backward = parameters[first:].T, [], []
        pattern = (False, True, False)
        for leg in range(self.legs):
            straight += [*pattern] if self.legs > 1 else [False, True, False, True, False]
            backward += [leg % 2 == 1] * (3 if self.legs > 1 else 5)
        rest = len(straight) - 3  # the arc that completes the half turn
        turned = np.where(np.delete(np.array(straight), rest), 0.0, amounts).sum(axis=1)
        return Strokes(start, np.insert(amounts, rest, np.pi - turned, axis=1), tuple(straight), tuple(backward))

    def draft(self, parameters: FloatArray, wheels: Wheels) -> Draft:
        """Return the drive of ``parameters`` (n,)."""
        strokes = self.strokes(parameters[:, None])
        lengths, kappas = np.abs(strokes.lengths(wheels)[0]), strokes.kappas(wheels)[0]
        return Draft(strokes.start[0], lengths, kappas, np.repeat(np.arange(self.legs), len(lengths) // self.legs))


def half_turn(template: Template, vehicle: Vehicle, legs: int) -> HalfTurn:
    """Return the family of half turns of one, three or five ``legs`` in a site."""
    length = vehicle.reach_ahead + vehicle.reach_behind
    begin, end = [(-_SWING_RAD, 0.0), (0.0, length)], [(0.0, length), (-_SWING_RAD, 0.0)]
    between = [(-_SWING_RAD, _MOST_RAD), (0.0, 1.5 * length), (-_SWING_RAD, _MOST_RAD)]
    bounds = [*begin, *end] if legs == 1 else [*begin, (0.0, _MOST_RAD), *(between * (legs - 2)), *end]
    if template is Template.THREE_POINT:
        return HalfTurn(legs, 0.0, True, *np.array(bounds).T)
    stands = [(-vehicle.width, vehicle.width), (-2.0 * length, length)]
    return HalfTurn(legs, 0.5 * np.pi, False, *np.array([*stands, *bounds]).T)


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


KEPT_M = 0.002  # from neighbours: more than bodies bow out between two poses
_FURTHER_RAD = 1.5  # most by which a tractor turns further: the angle of its trailer would have changed sign long before
_STRETCHED_RAD = 1e-10
_FOLDED_RAD = 0.5 * np.pi  # articulation at which a trailer's axle stands still
_EVERY_M = 0.5
_FOUND_M = 1e-4
_SCAN_M = 0.25  # between straights that are tried: a longer one may not pass what a shorter one does, along a row at an angle


def pull_out(vehicle: Vehicle, site: Site, spacing: float) -> Draft:
    """Return the forward drive out of a dock with the shortest straight that passes its neighbours, seen at poses ``spacing`` apart [m].

    Raises:
        TurnError: none was found, however far the vehicle drives straight out, or its trailer folds up.

    """
    heading, most = dock_heading(site.template), 2.0 * (vehicle.reach_ahead + vehicle.reach_behind)
    door = np.array([vehicle.reach_behind * np.cos(heading), vehicle.reach_behind * np.sin(heading), heading])
    arcs = _arcs(vehicle, np.pi - heading)

    def out(straight: float) -> Draft:
        lengths, kappas = np.array([(straight, 0.0), *arcs]).T
        return Draft(door, lengths, kappas, np.zeros(len(lengths), dtype=np.int64))

    def at(straight: float) -> DrivenLeg:
        return driven(vehicle, door, out(straight).pieces(0), spacing)

    def spare(straight: float) -> float:
        return float(site.gaps(vehicle, at(straight).poses).min()) - site.clearance - KEPT_M

    if np.abs(at(0.0).beta).max(initial=0.0) >= _FOLDED_RAD:
        msg = f"the {vehicle.name} would push its trailer backwards at full lock"
        raise TurnError(msg)
    if spare(0.0) >= 0.0:
        return out(0.0)
    passes = next((far for far in np.arange(_SCAN_M, most, _SCAN_M) if spare(float(far)) >= 0.0), None)
    if passes is None:
        msg = f"no way was found for the {vehicle.name} out of its dock past its neighbours"
        raise TurnError(msg, hint="give a larger --door-spacing")
    return out(float(brentq(spare, passes - _SCAN_M, passes, xtol=_FOUND_M)) + _FOUND_M)


def _arcs(vehicle: Vehicle, angle: float) -> tuple[tuple[float, float], ...]:
    """Return the arcs (length [m], kappa [1/m]) that turn a stretched vehicle to the left by ``angle`` [rad] and stretch it again."""
    wheels = wheels_at_stop(vehicle)
    if len(vehicle.units) == 1:
        return ((angle / wheels.turn, wheels.kappa),)

    def around(further: float) -> tuple[tuple[float, float], ...]:
        return ((angle + further) / wheels.turn, wheels.kappa), (further / wheels.turn, -wheels.kappa)

    def left_over(further: float) -> float:
        driven_arcs = [arc for arc in around(further) if arc[0] > 0.0]
        counts = [max(1, int(np.ceil(length / _EVERY_M))) for length, _ in driven_arcs]
        angles: FloatArray = articulated(vehicle, driven_arcs, counts, np.zeros(1))[-1]
        return float(angles[-1, 0])

    if not left_over(0.0) > 0.0 > left_over(_FURTHER_RAD):
        msg = (
            f"the trailer of the {vehicle.name} does not come in line with its tractor again within {np.rad2deg(_FURTHER_RAD):.0f} degrees"
        )
        raise TurnError(msg)
    return around(float(brentq(left_over, 0.0, _FURTHER_RAD, xtol=_STRETCHED_RAD)))
