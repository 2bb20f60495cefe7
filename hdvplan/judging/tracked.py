"""A chain of planned tracks with a driver's errors: how far bodies stray at most, and which errors close a gap."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records, runs_of
from hdvplan.judging.straying import SPACING_M

ROUNDED_M = 1e-4  # an error is found to this
_BEFORE, _BEYOND = int(60.0 / SPACING_M), int(15.0 / SPACING_M)  # intervals from a place, on which errors there depend
_AROUND_M = 15.0  # of a place: others there are looked at together with it
_LITTLE_M = 1e-3  # an error of which nothing of second order counts
_REST, _REST_OF_GAINS = 1e-5, 1e-3  # of an error: what counts less together is not followed further back
_ASIDE = 0.4  # of what the error is found to, from the likeliest one on: the next one is then on the other side of what is sought
_LEAST = 1e-30  # that is divided by
_ROUNDING = 1e-9

TRACKED, STRAY, GAIN, BRUSH, APPROACH = (core.record(f"hdv_{name}") for name in ("tracked", "stray", "gain", "brush", "approach"))
_stray = core.function("hdv_stray", core.POINTER, core.INT, core.INT)
_gains = core.function("hdv_gains", core.POINTER, core.INT, core.INT)
_approach = core.function("hdv_approach", core.POINTER, core.POINTER, core.INT, core.POINTER)


class Tracked:
    """A chain of planned tracks with a driver's errors: how far bodies stray at most.

    ``gains`` (intervals, units), the most that they do to first order, are looked for where ``follow`` is told to.
    """

    def __init__(self, units: Records, links: Records, length: float, gains: Records | None = None) -> None:
        self.units, self.links, self.length = units, np.ascontiguousarray(links), length
        self.strays = np.zeros(links.shape, STRAY)
        self.gains = np.full(links.shape, np.inf, GAIN) if gains is None else gains
        self._followed = np.zeros(len(links), dtype=bool)
        self.levels = int(np.clip(2.0 * length / SPACING_M + _ROUNDING, 1, core.number("HDV_MOST_LEVELS")))
        self.record = np.zeros(1, TRACKED)
        for name, array in (("units", units), ("links", self.links), ("gains", self.gains), ("strays", self.strays)):
            self.record[name] = core.address(array)
        self.record["intervals"], self.record["count"] = links.shape
        self.record["spacing"], self.record["levels"], self.record["rest"] = SPACING_M, self.levels, _REST

    def err(self, error: float) -> None:
        """Bound what bodies stray with errors up to ``error`` [m]."""
        self.record["error"], self.record["slope"] = error, error / self.length
        _stray(core.address(self.record), 0, len(self.links))

    def bounded(self, error: float) -> bool:
        """Bound what bodies stray with errors up to ``error`` [m], following what leads to where none holds; return whether all do."""
        self.err(error)
        while np.any(lost := np.isinf(self.strays["heading"][:, 0])):
            if not self.follow(np.array([SPACING_M * np.argmax(lost)])):
                return False
        return True

    def follow(self, at: FloatArray) -> bool:
        """Bound strays more tightly at places ``at`` (n,) [m], by the gains of what leads there; return whether these are new."""
        wanted = np.zeros(len(self.links), dtype=bool)
        for interval in np.unique((at / SPACING_M).astype(np.int64)):
            wanted[max(interval - _BEFORE, 0) : interval + _BEYOND] = True
        wanted &= ~self._followed
        if not np.any(wanted):
            return False
        for begin, beyond in runs_of(wanted):
            _gains(core.address(self._little.record), begin, beyond)
        self._followed |= wanted
        _stray(core.address(self.record), int(np.argmax(wanted)), len(wanted) - int(np.argmax(wanted[::-1])))
        return True

    @cached_property
    def _little(self) -> Tracked:
        """The same chain with errors so small that nothing of second order counts."""
        little = Tracked(self.units, self.links, self.length, self.gains)
        little.err(_LITTLE_M)
        little.record["rest"] = _REST_OF_GAINS
        return little

    def approaches(self, brushes: Records) -> FloatArray:
        """Return how far brushes (n,) come at most: the gain, and what is added to the error's gain [m], (2, n).

        Of a brush whose gap the errors cannot close it is no more than that: what is returned is less than the gap.
        """
        brushes, found = np.ascontiguousarray(brushes), np.empty(len(brushes), APPROACH)
        _approach(core.address(self.record), core.address(brushes), len(brushes), core.address(found))
        return np.stack([found["gain"], np.nan_to_num(found["remainder"], nan=np.inf)])  # a bound that ends in no number is none

    def closed(self, brushes: Records) -> Records:
        """Return the brushes whose gap the errors may close, that of the least error first."""
        gain, remainder = self.approaches(brushes)
        error = float(self.record["error"][0])
        closed = error * gain + remainder > brushes["gap"]
        gain, remainder, brushes = gain[closed], remainder[closed], brushes[closed]
        return brushes[np.argsort(_closing(brushes["gap"], gain, remainder, error), kind="stable")]

    def solved(self, closed: Records) -> tuple[float, Records]:
        """Return the largest error that does not close the gap of some brushes [m], which the present one closes, and the brush (1,).

        Those count that are near to the first one, so that the same errors move them.
        """
        at = closed["at"][0]
        own = closed[np.abs(closed["at"] - at) < _AROUND_M]
        within = slice(max(int(np.min(own["at"]) / SPACING_M) - _BEFORE, 0), int(np.max(own["at"]) / SPACING_M) + _BEYOND)
        around = Tracked(self.units, self.links[within], self.length, self.gains[within])
        there, high = own.copy(), float(self.record["error"][0])
        there["at"] -= within.start * SPACING_M
        (over, number), low = self._over(own), 0.0
        before, error = high, high - over
        while high - low > ROUNDED_M:
            if not low < error < high:
                error = 0.5 * (low + high)
            around.err(error)
            over_before, (over, number) = over, around._over(there)
            low, high = (low, error) if over > 0.0 else (error, high)
            slope = (over - over_before) / (error - before)  # of the secant; 1 or more
            before, aside = error, _ASIDE * ROUNDED_M  # to the other side of what is sought, where this is near
            error -= over / max(slope, 1.0) + (aside if over > 0.0 else -aside)
        return low, own[number : number + 1]

    def _over(self, brushes: Records) -> tuple[float, int]:
        """Return by how much the present error is more than one that closes a gap [m], exact where that is nothing, and which brush's."""
        whole, error = brushes.copy(), float(self.record["error"][0])
        whole["gap"] = 0.0  # all of their approach is looked at, whether the gap can be closed or not
        gain, remainder = self.approaches(whole)
        closing = _closing(brushes["gap"], gain, remainder, error)
        return error - float(np.min(closing)), int(np.argmin(closing))


def _closing(gap: FloatArray, gain: FloatArray, remainder: FloatArray, error: float) -> FloatArray:
    """Return with which errors gaps [m] may close, (n,) [m]; remainders [m] are those of ``error``, and grow as its square, or nearly."""
    gap, square = np.maximum(gap, 0.0), np.minimum(remainder / error**2, 1.0 / ROUNDED_M**2)
    found: FloatArray = 2.0 * gap / np.maximum(gain + np.sqrt(gain**2 + 4.0 * square * gap), _LEAST)
    return found
