"""[ART] table 2, figs. 4-5: five objectives in one U-turn, and the exhaustive search for the weight K beside the geometric one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from time import process_time

import numpy as np
from matplotlib.figure import Figure

from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.centring.stationary import CentringTable, stationary
from hdvplan.judging.result import Result
from hdvplan.planning.objectives import Goal, Objective, axle_max
from hdvplan.planning.stations import Stations
from hdvplan.planning.terms.centring import Reach
from hdvplan.report.style import styled
from hdvplan.reproduce import drawing, published
from hdvplan.reproduce.study import (
    REFERENCE_STEP_M,
    Progress,
    Row,
    Study,
    area_difference,
    best_fit,
    explained,
    sides_of,
    swept,
    whole_manoeuvre,
)  # fmt: skip
from hdvplan.road.scenarios import Scenario, uturn_articulated, uturn_articulated_profile, uturn_profile
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle

OBJECTIVES = {"J1": "lead-axle", "J2": "trail-axle", "J3": "art-weighted", "J4": "axle-max", "J5": "body-max"}
WORDS = {"J1": "tractor axle", "J2": "trailer axle", "J3": "both axles, weighted", "J4": "furthest axle", "J5": "furthest body side"}
PUBLISHED_STEP_M = 0.1
SHARES = np.linspace(0.0, 1.0, 21)
CURVATURES = (0.02, 0.03, 0.04, 0.05, 0.065)  # of the U-turns that K is searched on [1/m]; [ART]'s own are not published
_WITHOUT_NORM = ("J1", "J2", "J3")  # what J4 and J5 keep small is less certain than the road
_FINEST_ROUNDS = 3  # the fastest of so many: a busy machine only ever adds time

_RAMPS_M = (1.0, 20.0)  # between these lie the ramps that fit best
_AREA = {
    "J4": "free within the largest reach: a light second term centres ours; without it, last row",
    "J5": "free within the largest reach",
}
_FREE = "free within the largest reach: what smoothness alone makes of it depends on its weight, which is not published"
_LAPTOP = "this machine and solver, not their laptop and MATLAB; linearising and all QPs to convergence"


@dataclass(frozen=True)
class Search:
    """The exhaustive search for one vehicle's K: what was driven, the score of every share, and what both ways cost [s of CPU]."""

    cases: tuple[Case, ...]
    vehicle: str
    scores: FloatArray  # (shares,), |aL - aR| summed over the U-turns [m^2]
    geometric: float  # 1 / (1 + weight) at the sharpest U-turn
    searching: float
    solving: float  # by root search
    reading: float  # from a planner's table

    @property
    def best(self) -> float:
        """The share with the lowest score."""
        return float(SHARES[int(np.argmin(self.scores))])


def objectives(on_progress: Progress) -> Study:
    """Plan the U-turn by all five objectives, and search K for both vehicles."""
    vehicle, road = load_vehicle("tractor-trailer-24m"), uturn_articulated()
    planned, coarse, finer, fine = {}, {}, {}, {}
    for number, (name, objective) in enumerate(OBJECTIVES.items()):
        planned[name], coarse[name] = _timed(vehicle, objective, REFERENCE_STEP_M)
        finer[name], fine[name] = _timed(vehicle, objective, PUBLISHED_STEP_M)
        on_progress(0.06 * (number + 1))
    alone = Case(road, vehicle, "axle-max, nothing beside it", settings=whole_manoeuvre(road, REFERENCE_STEP_M))
    free = swept(alone, partial(_alone, axle_max))
    searches = []
    for number, name in enumerate(published.SEARCHED):
        searches.append(search(load_vehicle(name)))
        on_progress(0.3 + 0.35 * (number + 1))
    return Study(
        "objectives",
        "Five objectives in a U-turn, and the search for K",
        f"{published.ART} table 2, figs. 4-5",
        "Curvature 0.065 1/m over 134.2 m, planned in one horizon to convergence, no limits; envelopes at 0.5 m steps, measured on the "
        "exact simulation. J4 and J5 keep the largest reach over the horizon small, as we read the max-norm. "
        "Ramps are not published (ours: 1 m). Times are of one whole plan.",
        (*(found.case for found in (*planned.values(), *finer.values(), free)), *(case for found in searches for case in found.cases)),
        (*_reach_rows(planned, free), *_time_rows(coarse, fine), *_search_rows(searches)),
        sides_of(planned),
        partial(_figure, planned, searches),
    )


def plan_whole(vehicle: Vehicle, objective: str, step: float, scenario: Scenario = uturn_articulated) -> Result:
    """Return a whole U-turn planned in one horizon."""
    road = scenario()
    return swept(Case(road, vehicle, objective, settings=whole_manoeuvre(road, step)))


def _timed(vehicle: Vehicle, objective: str, step: float) -> tuple[Result, float]:
    """Return the whole U-turn, and the time that planning it took at its fastest [s]."""
    runs = [plan_whole(vehicle, objective, step) for _ in range(_FINEST_ROUNDS)]
    return runs[0], min(run.drive.plans[0].times.total for run in runs)


def search(vehicle: Vehicle, curvatures: tuple[float, ...] = CURVATURES) -> Search:
    """Score every share of the trailer axle on U-turns of several curvatures, and time that and the geometric weight."""
    began = process_time()
    scores, cases = np.zeros(len(SHARES)), []
    for curvature in curvatures:
        road = Scenario("uturn", uturn_profile(curvature, 1.0))()
        for number, share in enumerate(SHARES):
            cases.append(Case(road, vehicle, f"art-weighted:{float(share)!r}"))
            scores[number] += abs(area_difference(swept(cases[-1])))
    searched = process_time()
    sharpest = np.array([max(curvatures)])
    table = CentringTable.of(vehicle)
    solving = process_time()
    weight = float(stationary(vehicle, sharpest).weight[0])
    solved = process_time()
    table.at(sharpest)
    return Search(tuple(cases), vehicle.name, scores, 1.0 / (1.0 + weight), searched - began, solved - solving, process_time() - solved)


def _alone(objective: Objective, stations: Stations, vehicle: Vehicle) -> Goal:
    goal = objective(stations, vehicle)
    return replace(goal, terms=tuple(term for term in goal.terms if isinstance(term, Reach)))


def _reach_rows(planned: dict[str, Result], free: Result) -> list[Row]:
    """Return reaches and areas as published, as they are here, and as they are with the ramps that fit J1 to J3 best."""
    vehicle, rows = free.case.vehicle, []
    for name, found in planned.items():
        theirs, (left, right, area) = published.OBJECTIVES[name], _sides(found)
        rows.append(Row(f"{name} ({WORDS[name]}), max left", "m", theirs.left, left))
        rows.append(Row(f"{name}, max right", "m", theirs.right, right))
        rows.append(Row(f"{name}, aL - aR", "m^2", theirs.area, area, _AREA.get(name, "")))

    def again(ramp: float, names: Sequence[str]) -> list[float]:
        other = replace(uturn_articulated, profile=uturn_articulated_profile(ramp))
        return [value for name in names for value in _sides(plan_whole(vehicle, OBJECTIVES[name], REFERENCE_STEP_M, other))]

    ramp = best_fit(rows[: 3 * len(_WITHOUT_NORM)], partial(again, names=_WITHOUT_NORM), _RAMPS_M)
    alone = Row("J4 without its second term, aL - aR", "m^2", published.OBJECTIVES["J4"].area, area_difference(free), _FREE, counted=False)
    return [*explained(rows, again(ramp, tuple(planned)), f"ramps of {ramp:.1f} m instead of 1.0, which fit J1 to J3 best"), alone]


def _sides(found: Result) -> tuple[float, float, float]:
    """Return the furthest reach to the left and to the right [m], and the difference of the areas [m^2]."""
    return found.balance.max_left, found.balance.max_right, area_difference(found)


def _time_rows(coarse: dict[str, float], fine: dict[str, float]) -> list[Row]:
    rows = []
    for name in OBJECTIVES:
        theirs = published.OBJECTIVES[name].time
        rows.append(Row(f"{name}, time at 0.1 m", "s", theirs, fine[name], _LAPTOP))
        rows.append(Row(f"{name}, time at 0.5 m", "s", None, coarse[name]))
    rows.append(Row("J5, times faster at 0.1 m", "", None, published.OBJECTIVES["J5"].time.value / fine["J5"]))
    return rows


def _search_rows(searches: list[Search]) -> list[Row]:
    rows = []
    for found in searches:
        name, theirs = found.vehicle, published.SEARCHED[found.vehicle]
        rows += [
            Row(f"{name}: K by search", "", theirs, found.best),
            Row(f"{name}: K geometric", "", theirs, found.geometric),
            Row(f"{name}: time, search", "s", None, found.searching, f"{len(SHARES)} values of K on {len(CURVATURES)} U-turns"),
            Row(f"{name}: time, geometric", "s", None, found.solving, "one root search"),
            Row(f"{name}: time, table", "s", None, found.reading, "the geometric K as planning reads it"),
        ]
    return rows


@styled()
def _figure(planned: Mapping[str, Result], searches: list[Search]) -> Figure:
    """Return [ART] figs. 4-5: the U-turn by every objective; below the envelopes, and the search for K."""
    figure = Figure(figsize=(15.0, 7.6), layout="constrained")
    grid = figure.add_gridspec(2, 1, height_ratios=(1.0, 2.0))
    above, below = grid[0].subgridspec(1, len(planned)), grid[1].subgridspec(1, 2, width_ratios=(1.8, 1.0))
    for place, (name, found), colour in zip(range(len(planned)), planned.items(), drawing.COLOURS, strict=True):
        axes = figure.add_subplot(above[place])
        drawing.area(axes, found, colour, "swept area")
        drawing.bodies(axes, found, 26.0, "0.15")
        drawing.road(axes, found)
        axes.set_title(f"{name}: {WORDS[name]}\n{drawing.sides(found)}", fontsize="medium")
    envelope, searching = figure.add_subplot(below[0]), figure.add_subplot(below[1])
    for (name, found), colour in zip(planned.items(), drawing.COLOURS, strict=True):
        drawing.reach(envelope, found, colour, name)
    some = next(iter(planned.values()))
    drawing.pair(envelope, some.envelope.s, some.expected.half_width, "geometric")
    drawing.finish(envelope, "s [m]", "reach [m], left positive", "envelopes")
    for result, colour in zip(searches, (drawing.BLUE, drawing.YELLOW), strict=True):
        searching.plot(SHARES, result.scores, "o-", markersize=3.5, color=colour, label=f"{result.vehicle}: best {result.best:.2f}")
        searching.axvline(result.geometric, color=colour, linestyle=(0, (4, 2)), label=f"geometric: {result.geometric:.3f}")
    drawing.finish(searching, "K, weight of the trailer axle", "|aL - aR| summed [m²]", "search for K on U-turns")
    return figure
