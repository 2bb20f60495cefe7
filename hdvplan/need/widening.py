"""The least widening of a road's own limits with which a vehicle fits: the least area, or the least largest depth.

Places far apart are widened one by one, each on its own stretch of road. What a plan sweeps beyond the limits is a widening that would
do; many plans are made, and the best of their widenings is scaled down until no plan fits any more.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import maximum_filter1d

from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.errors import HdvplanError
from hdvplan.judging.balance import KEPT_M
from hdvplan.judging.envelope import SPACING_M
from hdvplan.judging.result import Result
from hdvplan.need.measure import OUTWARDS, Taken, taken_by
from hdvplan.need.search import ATTEMPTS, WIDE_M, Attempt, Question, least, plans_of
from hdvplan.need.stretch import stretch_of
from hdvplan.planning.settings import Scheme
from hdvplan.road.road import Limits

# A widening is drawn out along the road, for planners look at the narrowest place between stations, and aside where a plan does not quite
# find its way into it [m, m].
_AROUND_M = ((0.75, 0.0), (0.75, 0.02), (1.5, 0.03), (3.0, 0.05), (6.0, 0.1), (12.0, 0.2))
_LEAD_M = 120.0  # driven before and after a place that lacks room; places nearer to each other than twice this are one
_SCALED = 0.02  # how finely a widening is scaled down
_REPAIRS = 6  # of a widening that fits on its stretches of road, for the whole road
_ALONG = 2 * int(np.ceil(0.75 / SPACING_M)) + 1  # stations that a repair is drawn out over
_PLAIN = (Attempt("geometric", Scheme.RTI), Attempt("lead-axle", Scheme.RTI), Attempt("geometric", Scheme.SQP))
_ROUNDS = 3  # of looking for places that a plan along the whole road adds


@dataclass(frozen=True)
class Widening:
    """How far a road's limits move outwards at arclengths ``s`` [m]; rows as in ``ROWS``, shape (4, n) [m].

    ``result`` is a plan that fits then, along the whole road; None where none was found.
    """

    s: FloatArray
    outwards: FloatArray
    result: Result | None

    @property
    def depth(self) -> float:
        """The largest move of any limit [m]."""
        return float(np.max(self.outwards, initial=0.0))

    def widened(self, own: Limits) -> Limits:
        """Return the limits ``own`` moved outwards; a limit of wheels takes that of overhangs with it."""
        return _widened(own, self.s, self.outwards)


@dataclass(frozen=True)
class Widenings:
    """The widening of least area and the one of least largest depth.

    Both are None where the vehicle fits as the road is, and ``fitting`` is the plan; all are None where no widening of the road's own
    limits was found that would do: an obstacle is in the way, or no plan was found at any width.
    """

    area: Widening | None
    depth: Widening | None
    fitting: Result | None


def least_widenings(case: Case, own: Limits, *, on_progress: Callable[[float], None] | None = None) -> Widenings:
    """Return the least widenings of ``own``, the limits of ``case.road`` before its obstacles cut them.

    ``on_progress`` receives a share that grows from 0 to 1.
    """
    stations = SPACING_M * np.arange(int(np.floor(case.road.path.length / SPACING_M + 1e-9)) + 1, dtype=np.float64)
    fitting, lacking = _fit(case, own, stations, np.zeros((4, len(stations))))
    if fitting is not None:
        return Widenings(None, None, fitting)
    breached = _places(case, lacking)
    places: list[tuple[int, int]] = []
    for number in range(_ROUNDS):
        places = _joined([*places, *breached])
        area, depth = np.zeros((2, 4, len(stations)))
        for done, (first, last) in enumerate(places):
            best = _of_place(stretch_of(case, stations[first], stations[last]), own, float(stations[first]))
            if best is None:
                return Widenings(None, None, None)
            for whole, part in zip((area, depth), best, strict=True):
                whole[:, first : first + part.shape[1]] = part
            if on_progress is not None:
                on_progress((number + (done + 1) / len(places)) / _ROUNDS)
        fits = [_fit(case, own, stations, outwards) for outwards in (area, depth)]
        breached = [place for result, lacking in fits if result is None for place in _places(case, lacking)]
        if all(result is not None for result, _ in fits):
            break
    return chosen(*(_along(case, own, stations, outwards, fit) for outwards, fit in zip((area, depth), fits, strict=True)))


def chosen(area: Widening, depth: Widening) -> Widenings:
    """Return the widenings of a search for the least area and of one for the least depth: each the other one where that is better.

    One with which a plan was found is better than one without.
    """
    if area.result is not None and (depth.result is None or area.depth <= depth.depth):
        return Widenings(area, area, None)
    if depth.result is not None and (area.result is None or _area(depth.outwards) <= _area(area.outwards)):
        return Widenings(depth, depth, None)
    return Widenings(area, depth, None)


def _along(case: Case, own: Limits, s: FloatArray, outwards: FloatArray, fit: tuple[Result | None, FloatArray]) -> Widening:
    """Return a widening with the plan that fits along the whole road: a little deeper where the plans of its parts do not meet."""
    result, lacking = fit
    for _ in range(_REPAIRS if result is None else 0):
        deeper = maximum_filter1d(np.where(lacking > 0.0, lacking + KEPT_M, 0.0), _ALONG, axis=1)
        outwards = outwards + deeper
        result, lacking = _fit(case, own, s, outwards)
        if result is not None:
            break
    return Widening(s, outwards, result)


@dataclass
class _Pool:
    """The best widenings of a place, of all plans that were made."""

    own: Limits
    area: FloatArray | None = None
    depth: FloatArray | None = None

    def add(self, took: Taken) -> None:
        """Keep the widening that a plan would need where it is a better one."""
        if not took.passes or np.max(took.reach) > WIDE_M:
            return
        outwards = np.stack([_deep_enough(row) for row in np.maximum(took.beyond(self.own), 0.0)])
        if self.area is None or _area(outwards) < _area(self.area):
            self.area = outwards
        if self.depth is None or np.max(outwards) < np.max(self.depth):
            self.depth = outwards


def _of_place(case: Case, own: Limits, s_from: float) -> tuple[FloatArray, FloatArray] | None:
    """Return the widenings of least area and of least depth of a stretch of road that begins at ``s_from``; None where none would do."""
    own = replace(own, s=own.s - s_from)
    pool = _Pool(own)
    for sides in ((0, 1, 2, 3), (0, 2), (1, 3)):  # both, left, right
        least(case, _deepest(own, sides), on_result=lambda _, took: pool.add(took))
    plain = replace(case, settings=replace(case.settings, elastic_growth=0.0))  # the price of a breach is then its area
    for made in plans_of(replace(plain, road=case.road.within(own)), _PLAIN):
        if not isinstance(made, HdvplanError):
            pool.add(taken_by(made))
    if pool.area is None or pool.depth is None:
        return None
    return _scaled(case, own, pool.area), _scaled(case, own, pool.depth)


def _deepest(own: Limits, sides: tuple[int, ...]) -> Question:
    """Return the question for the least uniform move of the limits in the rows ``sides``, the others held."""
    moved = np.isin(np.arange(4), sides)

    def band(room: float) -> Limits:
        return Limits(own.s, *(own.table(own.s) + np.where(moved[:, None], room * OUTWARDS, 0.0)))

    def needed(took: Taken) -> float:
        beyond = np.max(took.beyond(own), axis=1)
        held = took.passes and np.all(beyond[~moved] <= KEPT_M)
        return max(0.0, float(np.max(beyond[moved]))) if held else np.inf

    return Question(band, needed, 0.0)


def _scaled(case: Case, own: Limits, outwards: FloatArray) -> FloatArray:
    """Return a widening with as little room around it as a plan needs to follow it, then scaled down as far as a plan still fits."""
    stations: FloatArray = SPACING_M * np.arange(outwards.shape[1], dtype=np.float64)
    for along, aside in _AROUND_M:
        longer = maximum_filter1d(outwards, 2 * int(np.ceil(along / SPACING_M)) + 1, axis=1)
        drawn: FloatArray = np.where(longer > 0.0, longer + aside, 0.0)
        if _fit(case, own, stations, drawn)[0] is not None:
            break
    low, high = 0.0, 1.0
    while high - low > _SCALED:
        middle = 0.5 * (low + high)
        if _fit(case, own, stations, middle * drawn)[0] is None:
            low = middle
        else:
            high = middle
    return high * drawn


def _fit(case: Case, own: Limits, s: FloatArray, outwards: FloatArray) -> tuple[Result | None, FloatArray]:
    """Return a plan that keeps ``own`` moved outwards, or None; and how far the best plan reaches beyond that, (4, n) [m]."""
    band = _widened(own, s, outwards)
    best: tuple[bool, float] = (True, np.inf)  # those that pass obstacles come first
    lacking: FloatArray = np.ones((4, len(s)))  # where no plan can be made, all is lacking
    for made in plans_of(replace(case, road=case.road.within(band)), ATTEMPTS):
        if isinstance(made, HdvplanError):
            continue
        took = taken_by(made)
        beyond = took.beyond(band)
        if took.passes and np.all(beyond <= KEPT_M):
            return made, beyond
        rank = (not took.passes, float(np.max(beyond)))
        if rank < best:
            best, lacking = rank, beyond
    return None, lacking


def _places(case: Case, lacking: FloatArray) -> list[tuple[int, int]]:
    """Return the first and last stations of the places where a plan lacks room, with what is driven before and after them."""
    count = lacking.shape[1]
    at = np.flatnonzero(np.max(lacking, axis=0) > 0.0)
    ahead, grid = int(_LEAD_M / SPACING_M), round(case.settings.replan / SPACING_M)  # plans begin where those of the whole road do
    return [(max(0, one - ahead) // grid * grid, min(count - 1, one + ahead)) for one in (at if len(at) else np.arange(count)).tolist()]


def _widened(own: Limits, s: FloatArray, outwards: FloatArray) -> Limits:
    """Return ``own`` moved outwards; jumps stay jumps, and overhangs never get less room than wheels."""
    nodes = np.concatenate([own.s, s])
    order = np.argsort(nodes, kind="stable")
    rows = np.concatenate([np.stack([own.left, own.right, own.left_sweep, own.right_sweep]), own.table(s)], axis=1)[:, order]
    rows += OUTWARDS * np.stack([np.interp(nodes[order], s, row) for row in outwards])
    rows[2], rows[3] = np.maximum(rows[2], rows[0]), np.minimum(rows[3], rows[1])
    return Limits(nodes[order], *rows)


def _joined(places: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return stretches of stations, joined where they overlap."""
    joined: list[tuple[int, int]] = []
    for first, last in sorted(places):
        if joined and first <= joined[-1][1]:
            joined[-1] = joined[-1][0], max(last, joined[-1][1])
        else:
            joined.append((first, last))
    return joined


def _deep_enough(outwards: FloatArray) -> FloatArray:
    """Return one limit's widening without the stretches where the limit counts as kept anyway."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], outwards > 0.0, [False]]).astype(int)))
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        if np.max(outwards[begin:end]) <= KEPT_M:
            outwards[begin:end] = 0.0
    return outwards


def _area(outwards: FloatArray) -> float:
    """Return the area of a widening on a straight road [m2]."""
    return SPACING_M * float(np.sum(np.maximum(outwards[0], outwards[2]) + np.maximum(outwards[1], outwards[3])))
