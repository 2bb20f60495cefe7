"""Half turns of one, three or five legs, by few parameters: angles of arcs at the least radius, and straights between them.

A leg is an arc, a straight and an arc; the last leg's first arc completes the half turn. The first leg may swing out to the right before
it turns to the left, and the last leg straightens from beyond the half turn: tail and front then swing where there is room.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.turning.reversing.legs import Draft, Strokes, Wheels
from hdvplan.turning.reversing.options import Template
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
