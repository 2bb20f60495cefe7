"""The least even half width of a road, and the least edge on one side while the other is held."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from hdvplan.case import Case
from hdvplan.judging.clearance import SIDES
from hdvplan.judging.result import Result
from hdvplan.need.search import WIDE_M, Least, Question, least
from hdvplan.road.road import Road
from hdvplan.road.street import Kerb

_NONE_M = 0.1  # the least reach that is asked for: kerbs of one side lie on that side of the line
OTHER = {"left": "right", "right": "left"}


def even(road: Road) -> Callable[[float], Road]:
    """Return what gives the road with kerbs a half width [m] to both sides of its line."""
    return lambda half: road.with_limits(half, half)


def beside_held(road: Road, held: tuple[Kerb, ...], side: str) -> Callable[[float], Road]:
    """Return what gives the road with the kerbs ``held``, and those on ``side`` at a reach [m] from its line."""
    return lambda reach: road.with_kerbs((*held, *kerbs_on(road.with_limits(reach, reach), side)))


def kerbs_on(road: Road, side: str) -> tuple[Kerb, ...]:
    """Return the kerbs on one side of a road, "left" or "right"; none without limits."""
    return () if road.kerbs is None else tuple(kerb for kerb in road.kerbs.kerbs if kerb.left == (side == "left"))


def least_half_width(case: Case, known: Sequence[Result] = (), *, on_progress: Callable[[float], None] | None = None) -> Least:
    """Return the least half width W for which a plan keeps +-W everywhere, and what obstacles leave of it.

    The road's own widths do not count; its obstacles and the clearance wanted do. ``known`` are plans for other streets of the same line.
    """
    lowest = 0.5 * case.vehicle.width + case.settings.clearance
    return least(case, Question(even(case.road), SIDES, lowest, _first(case)), known, on_progress=on_progress)


def least_edge(
    case: Case, held: tuple[Kerb, ...], side: str, known: Sequence[Result] = (), *, on_progress: Callable[[float], None] | None = None
) -> Least:
    """Return the least reach on ``side`` ("left" or "right") for which a plan keeps the kerbs ``held``, which lie opposite.

    Nothing is reached, and ``result`` is None, where no plan keeps them. ``known`` are plans as for ``least_half_width``.
    """
    return least(case, Question(beside_held(case.road, held, side), (side,), _NONE_M, _first(case)), known, on_progress=on_progress)


def _first(case: Case) -> tuple[float, ...]:
    """Return what is asked for first: so much that limits hardly matter; where an obstacle cannot be passed so, less [m]."""
    return WIDE_M, 2.0 * case.vehicle.width, 4.0 * case.vehicle.width
