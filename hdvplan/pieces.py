"""A long road, driven piece by piece as one drive: what is in memory does not grow with the road.

A piece is a road of its own on which the vehicle goes on as it stood at the end of the piece before. The street goes on beyond its ends,
and it is judged with what was driven on the pieces beside it: what comes of it is what the whole road's drive comes to there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass, replace
from itertools import chain, islice, tee

from hdvplan.api import drive_case
from hdvplan.case import Case
from hdvplan.driving.drive import Drive, among
from hdvplan.errors import HdvplanError, OptionError, PlanError, RoadError, SolverError
from hdvplan.judging.result import Passed, Result, result_of
from hdvplan.passing.sides import choose_sides
from hdvplan.planning.bias import Bias
from hdvplan.planning.settings import PlannerSettings
from hdvplan.road.line import Line
from hdvplan.road.load import Found
from hdvplan.road.road import Road, Smoothing, part_of
from hdvplan.road.windows import WINDOW_M, Window, on_knot, road_of, windows_of
from hdvplan.vehicle.model import Vehicle

_BEFORE_M = 200.0  # of road before a piece: obstacles there bear on the sides on which those of the piece are passed
_ASKEW_M = 20.0  # for bodies askew

CaseOf = Callable[[Road], Case]


@dataclass(frozen=True)
class Piece:
    """A part of a road from ``s_from`` to ``s_to`` on a wider part, which begins at arclength ``begins`` of the whole road; all in metres.

    ``smoothing`` is that of the line around it, at the whole road's arclengths.
    """

    road: Road
    s_from: float
    s_to: float
    begins: float
    last: bool
    smoothing: Smoothing | None


@dataclass(frozen=True)
class Judged:
    """A piece that was driven and judged: arclengths of the result count from ``begins`` of the whole road [m]."""

    result: Result
    begins: float
    last: bool
    smoothing: Smoothing | None


def pieces_of(found: Found, vehicle: Vehicle, settings: PlannerSettings, *, length: float = WINDOW_M) -> Iterator[Piece]:
    """Cut a road into pieces of about ``length`` metres; a long line of points is smoothed as they are asked for.

    Raises:
        RoadError: it cannot be smoothed.
        OptionError: ``length`` is too short for plans of these settings.

    """
    if settings.replan > 0.5 * length:
        msg = f"a road that is planned in stretches of {length:g} m cannot be replanned every {settings.replan:g} m only"
        raise OptionError(msg, hint="choose a smaller --replan")
    if found.line is not None and found.line.windowed:
        return _pieces_of_line(found.line, _reach(vehicle, settings), settings, length)
    return _pieces_of_road(found(), _reach(vehicle, settings), settings, length)


def _pieces_of_line(line: Line, reach: float, settings: PlannerSettings, length: float) -> Iterator[Piece]:
    for before, here, after in _threes(windows_of(line, length)):
        there = [window for window in (before, here, after) if window is not None]
        begins = on_knot(max(there[0].begin, here.begin - _BEFORE_M - reach))
        road = road_of(line.name, there, begins, on_knot(min(there[-1].end, here.end + 2.0 * reach)))
        begin, end = _on_grid(here.begin, settings), here.end if after is None else _on_grid(after.begin, settings)
        smoothing, by = here.road.smoothing, here.shift
        if smoothing is not None:
            s = smoothing.max_deviation_s + by, smoothing.max_curvature_s + by
            smoothing = replace(smoothing, max_deviation_s=s[0], max_curvature_s=s[1])
        yield Piece(road, begin - begins, end - begins, begins, after is None, smoothing)


def _pieces_of_road(road: Road, reach: float, settings: PlannerSettings, length: float) -> Iterator[Piece]:
    """Cut a road whose path is known; only one that is open."""
    whole, count = road.path.length, max(1, round(road.path.length / length))
    for number in range(count):
        last = number == count - 1
        begin, end = _on_grid(whole * number / count, settings), whole if last else _on_grid(whole * (number + 1) / count, settings)
        begins, ends = max(0.0, begin - _BEFORE_M), min(whole, end + reach)
        wide = part_of(road, begins, ends, reach, reach)
        yield Piece(wide, begin - begins, end - begins, begins, last, None if number else road.smoothing)


def planned(pieces: Iterable[Piece], case_of: CaseOf) -> Iterator[Judged]:
    """Drive over the pieces of a road in their order, and judge each when the next one is driven.

    ``case_of`` makes the case of a wider part of the road; its bias counts along the whole road.

    Raises:
        HdvplanError: what ``hdvplan.plan`` raises; ``s_m`` is the whole road's.

    """
    before: Drive | None = None
    here: tuple[Drive, Piece, Case, tuple[Passed, ...]] | None = None
    for piece in pieces:
        with _counted_from(piece.begins):
            case = case_of(piece.road)
            wide, passed = choose_sides(replace(case, bias=_moved(case.bias, piece.begins)))
        begins, reach = piece.begins + piece.s_from, _reach(case.vehicle, case.settings)
        road = part_of(wide, piece.s_from, piece.s_to, reach, reach)
        for name in ("bounds", "kerbs", "street"):  # where ``cached_property`` looks: that street does not end where the piece does
            street = getattr(wide, name)
            road.__dict__[name] = None if street is None else street.shifted(piece.s_from)
        case = replace(case, road=road, bias=_moved(case.bias, begins))
        with _counted_from(begins):
            drive = drive_case(case, after=None if here is None else here[0])
        if here is not None:
            yield _judged(*here, before, drive)
            before = here[0]
        own = (one for one in passed if piece.s_from <= 0.5 * (one.s_from + one.s_to) < piece.s_to)
        moved = tuple(replace(one, s_from=one.s_from - piece.s_from, s_to=one.s_to - piece.s_from) for one in own)
        here = drive, piece, case, moved
    if here is not None:
        yield _judged(*here, before, None)


def _judged(drive: Drive, piece: Piece, case: Case, passed: tuple[Passed, ...], before: Drive | None, after: Drive | None) -> Judged:
    begins = piece.begins + piece.s_from
    with _counted_from(begins):
        whole = among(drive, before, after, _ASKEW_M)
        result = result_of(whole, solver=case.solver, objective=case.objective, passed=passed)
    return Judged(result, begins, piece.last, piece.smoothing)


@contextmanager
def _counted_from(begins: float) -> Iterator[None]:
    """Let errors in the block have the whole road's arclengths: theirs count from ``begins`` [m], which a message that has one says."""
    try:
        yield
    except HdvplanError as error:
        moved = copy(error)
        if isinstance(moved, RoadError | PlanError | SolverError) and moved.s_m is not None:
            moved.s_m += begins
        elif "s = " not in str(error):
            raise
        moved.args = (f"{error}; this s counts from {begins:.0f} m along the road",)
        raise moved from error


def _moved(bias: Bias, by: float) -> Bias:
    return Bias(bias.s - by, bias.offset)


def _reach(vehicle: Vehicle, settings: PlannerSettings) -> float:
    """Return how far beyond a place a plan sees, or a body stands [m]."""
    return on_knot(settings.horizon + vehicle.reach_ahead + vehicle.reach_behind + 2.0 * _ASKEW_M)


def _threes(windows: Iterable[Window]) -> Iterator[tuple[Window | None, Window, Window | None]]:
    """Return every window with the one before and the one after it."""
    before, here, after = tee(windows, 3)
    return zip(chain[Window | None]([None], before), here, chain[Window | None](islice(after, 1, None), [None]), strict=False)


def _on_grid(s: float, settings: PlannerSettings) -> float:
    """Return the arclength nearest to ``s`` at which a plan begins [m]."""
    return settings.step * settings.executed * round(s / (settings.step * settings.executed))
