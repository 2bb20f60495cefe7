"""Cut a long road into stretches that are planned separately, each with a run-in after which the plan no longer depends on its start.

Only the plan over the core of a stretch is kept. Before the core lies the run-in, behind it the run-out: the vehicle drives on until its
last body has left the core. Cores begin at multiples of the replanning distance, so that the stations are those of the whole road.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from hdvplan.case import Case
from hdvplan.errors import OptionError, RoadError
from hdvplan.planning.bias import Bias
from hdvplan.planning.settings import PlannerSettings
from hdvplan.road.line import Line
from hdvplan.road.regions import OPEN_M, Region
from hdvplan.road.road import Road, Smoothing, part_of
from hdvplan.road.windows import WINDOW_M, Each, Window, headings, on_knot, road_of, windows_of
from hdvplan.vehicle.model import Vehicle

RUN_IN_M = 200.0  # docs/networks.md says how fast a plan forgets where it began
_ASKEW_M = 20.0  # for bodies askew
_SPACING_M = 0.5  # of points of a road beside which regions count

CaseOf = Callable[[Road], Case]


@dataclass(frozen=True)
class Stretch:
    """A part of a road as a case of its own, which pickles.

    The case's road begins at arclength ``begins`` of the whole road [m]; ``core`` is the part of it that the stretch is there for, in the
    case's own arclengths [m]. ``turned`` is the whole road's heading where the core begins, without jumps of a full turn [rad].
    """

    number: int
    case: Case
    begins: float
    core: tuple[float, float]
    turned: float
    last: bool
    smoothing: Smoothing | None  # of the line around it, at the whole road's arclengths

    @property
    def core_begins(self) -> float:
        """Where the core begins along the whole road [m]."""
        return self.begins + self.core[0]


@dataclass(frozen=True)
class _Core:
    """From where to where on a road a stretch is for, what makes the whole road's arclengths of it [m], and the heading at its begin."""

    begin: float
    end: float
    shift: float
    turned: float
    last: bool


def stretches_of_road(case: Case, *, core: float = WINDOW_M, run_in: float = RUN_IN_M) -> Iterator[Stretch]:
    """Cut a case's road, as it is, into stretches of about ``core`` metres after a run-in of ``run_in`` metres.

    Raises:
        OptionError: a stretch would have no plan of its own.

    """
    _check_plans(case.settings, core)
    length = case.road.path.length
    count = max(1, round(length / core))
    bounds = [*(_on_grid(length * number / count, case.settings) for number in range(count)), length]
    turned = headings(case.road, bounds)
    for number in range(count):
        here = _Core(bounds[number], bounds[number + 1], 0.0, float(turned[number]), number == count - 1)
        yield _stretch(number, case, here, run_in, case.road.smoothing if number == 0 else None)


def stretches_of_line(
    line: Line, case_of: CaseOf, *, reach: float, core: float = WINDOW_M, run_in: float = RUN_IN_M, each: Each = map
) -> Iterator[Stretch]:
    """Cut a line into stretches, smoothed window by window when they are asked for; ``each`` maps the smoothing over the windows.

    ``case_of`` makes the case of a smoothed road; its bias counts along the whole road. ``reach`` is how far beyond a stretch a plan sees,
    as ``reach_of`` says [m]. The road of a stretch is that part of what ``hdvplan.road.windows.whole_road`` returns.

    Raises:
        RoadError: the line is no line of points, or it cannot be smoothed.
        OptionError: as for ``stretches_of_road``.

    """
    if line.raw.is_profile or line.raw.rounded is not None:
        msg = f"{line.name}: only lines of points are planned in stretches"
        raise RoadError(msg)
    for number, (before, here, after) in enumerate(_threes(windows_of(line, core, each=each))):
        there = [window for window in (before, here, after) if window is not None]
        begins = on_knot(max(there[0].begin, here.begin - run_in - 2.0 * reach))
        road = road_of(line.name, there, begins, on_knot(min(there[-1].end, here.end + 3.0 * reach)))
        case = case_of(road)
        _check_plans(case.settings, core)
        begin, end = _on_grid(here.begin, case.settings), here.end if after is None else _on_grid(after.begin, case.settings)
        core_here = _Core(begin - begins, end - begins, begins, here.turned, after is None)
        smoothing = here.road.smoothing
        yield _stretch(number, case, core_here, run_in, None if smoothing is None else _shifted(smoothing, here.shift))


def stretch_of(case: Case, s_from: float, s_to: float) -> Case:
    """Return the case from arclength ``s_from`` to ``s_to`` [m] of its road; arclengths count from ``s_from``.

    Bodies behind the stretch's start, and plans beyond its end, lie on the road as it goes on.
    """
    beside = case.settings.horizon + case.vehicle.reach_ahead + case.vehicle.reach_behind + _ASKEW_M
    return replace(case, road=part_of(case.road, s_from, s_to, beside, beside), bias=Bias(case.bias.s - s_from, case.bias.offset))


def reach_of(vehicle: Vehicle, settings: PlannerSettings) -> float:
    """Return how far beyond a place a plan sees, or a body stands [m]."""
    return settings.horizon + vehicle.reach_ahead + vehicle.reach_behind + 2.0 * _ASKEW_M


def _check_plans(settings: PlannerSettings, core: float) -> None:
    """Refuse plans that are executed over so much road that the grid of their begins leaves a core without any."""
    if settings.replan > 0.5 * core:
        msg = f"a road that is planned in stretches of {core:g} m cannot be replanned every {settings.replan:g} m only"
        raise OptionError(msg, hint="choose a smaller --replan")


def _threes(windows: Iterable[Window]) -> Iterator[tuple[Window | None, Window, Window | None]]:
    """Return every window with the one before and the one after it."""
    before: Window | None = None
    here: Window | None = None
    for after in windows:
        if here is not None:
            yield before, here, after
        before, here = here, after
    if here is not None:
        yield before, here, None


def _stretch(number: int, case: Case, core: _Core, run_in: float, smoothing: Smoothing | None) -> Stretch:
    """Return the stretch of a core on the case's road, with run-in and run-out as far as the road goes."""
    road, plan = case.road, case.settings.step * case.settings.executed
    start = core.begin - min(_up(run_in, case.settings), plan * float(np.floor(core.begin / plan + 1e-9)))
    ahead = case.vehicle.reach_behind + _ASKEW_M + case.settings.horizon  # beyond a road's end nothing is kept
    end = min(road.path.length, core.end + _up(ahead, case.settings))
    bias = Bias(case.bias.s - core.shift, case.bias.offset)
    cut = stretch_of(replace(case, road=replace(road, regions=_near(road.regions, road, start, end)), bias=bias), start, end)
    return Stretch(number, cut, core.shift + start, (core.begin - start, core.end - start), core.turned, core.last, smoothing)


def _shifted(smoothing: Smoothing, shift: float) -> Smoothing:
    return replace(smoothing, max_deviation_s=smoothing.max_deviation_s + shift, max_curvature_s=smoothing.max_curvature_s + shift)


def _near(regions: tuple[Region, ...], road: Road, start: float, end: float) -> tuple[Region, ...]:
    """Return the regions in the box around a part of a road that can matter there."""
    if not regions:
        return ()
    here = road.path.at(np.arange(start, end, _SPACING_M))
    points = np.stack([here.x, here.y], axis=1)
    low, high = points.min(axis=0) - OPEN_M, points.max(axis=0) + OPEN_M
    bounds = np.array([region.polygon.bounds for region in regions])
    there = np.all(bounds[:, 2:] >= low, axis=1) & np.all(bounds[:, :2] <= high, axis=1)
    return tuple(region for region, counts in zip(regions, there, strict=True) if counts)


def _on_grid(s: float, settings: PlannerSettings) -> float:
    """Return the arclength nearest to ``s`` at which a plan begins [m]."""
    return settings.step * settings.executed * round(s / (settings.step * settings.executed))


def _up(length: float, settings: PlannerSettings) -> float:
    """Return a length in whole plans that is at least ``length`` [m]."""
    return settings.step * settings.executed * float(np.ceil(length / (settings.step * settings.executed)))
