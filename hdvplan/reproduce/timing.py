"""[GEO] table I: how long a planning step takes on real roads, by SQP and RTI, with OSQP as published and with the default solver."""

from __future__ import annotations

from functools import partial
from itertools import product

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from hdvplan.api import drive_case
from hdvplan.case import Case
from hdvplan.centring.stationary import CentringTable
from hdvplan.machine import busy_warning, load_average, machine_facts, others_words, usable_cores
from hdvplan.planning.settings import PlannerSettings, Scheme
from hdvplan.report.style import plain_decades, styled
from hdvplan.reproduce import drawing, published
from hdvplan.reproduce.study import Progress, Row, Study
from hdvplan.road.load import load_road
from hdvplan.road.road import Road
from hdvplan.solvers.registry import DEFAULT
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle

ROADS = (
    "goteborg_tuvevagen_brunnsbo",
    "goteborg_nya_allen",
    "goteborg_fiskhamnsgatan",
    "goteborg_gullbergsmotet_loop_north",
    "neubrandenburg_ring",
    "newyork_columbus_circle",
)  # 11.9 km: arterials with roundabouts, S-bends, a motorway loop, a ring
VEHICLES = ("bus", "tractor-trailer")
AS_PUBLISHED = "osqp"
SOLVERS = (AS_PUBLISHED, DEFAULT)
HALF_WIDTH_M = 4.5  # more only where the vehicle's balanced circle needs it
_SPARE_M = 0.5
_ROUNDS = 2

_MACHINE = "other machine, C for MATLAB, other roads"


def timing(on_progress: Progress, roads: tuple[str, ...] = ROADS) -> Study:
    """Drive both vehicles along ``roads`` by both schemes and with both solvers, and time every planning step."""
    tracks, vehicles = [load_road(name) for name in roads], {name: load_vehicle(name) for name in VEHICLES}
    cases = [
        Case(limited(road, vehicles[name]), vehicles[name], solver=solver, settings=PlannerSettings(scheme=scheme))
        for name, scheme, solver, road in product(VEHICLES, Scheme, SOLVERS, tracks)
    ]
    samples, driven, before = [], 0.0, _load()
    for case in cases:
        names = {"road": case.road.name, "vehicle": case.vehicle.name, "scheme": str(case.settings.scheme), "solver": case.solver_name}
        samples.append(timed_steps(case).assign(**names))
        driven += case.road.path.length
        on_progress(driven / sum(case.road.path.length for case in cases))
    data = pd.concat(samples, ignore_index=True)
    length, facts, cores = sum(road.path.length for road in tracks), machine_facts(), usable_cores()
    busy = busy_warning(others_words(before, _load(), cores), cores)
    return Study(
        "timing",
        "Computation times on real roads",
        f"{published.GEO} table I",
        f"{len(roads)} roads from OpenStreetMap, {length / 1000.0:.1f} km; horizon 100 m, step 0.5 m, replanning every 5 m, limits at "
        "+-4.5 m or 0.5 m beyond the balanced circle where that is more. "
        "Whole planning steps, without each drive's first, the faster of two drives. "
        f"Here: {facts['processor']}, {facts['python']}; published: laptop with an i7-6820HQ, MATLAB and OSQP."
        + (f" **{busy}.**" if busy else ""),
        tuple(cases),
        _rows(data),
        data,
        partial(_figure, data),
    )


def _load() -> float | None:
    averages = load_average()
    return None if averages is None else averages[0]


def limited(road: Road, vehicle: Vehicle) -> Road:
    """Return the road with the study's limits for ``vehicle``."""
    curvature = road.path.at(np.linspace(0.0, road.path.length, int(2.0 * road.path.length))).curvature
    reach = max(HALF_WIDTH_M, float(CentringTable.of(vehicle).at(curvature).half_width.max()) + _SPARE_M)
    return road.with_limits(reach, reach)


def timed_steps(case: Case) -> pd.DataFrame:
    """Return of every planning step but the first, which starts from nothing, its s [m], time [ms] and number of QPs.

    The drive is repeated and every step counts with its fastest round: what planning takes, not what else the machine does.
    """
    rounds = [drive_case(case).plans[1:] for _ in range(_ROUNDS)]
    times = np.min([[plan.times.total for plan in plans] for plans in rounds], axis=0)
    s = [case.settings.step * plan.first for plan in rounds[0]]
    return pd.DataFrame({"s": s, "time_ms": 1e3 * times, "qps": [plan.qp_count for plan in rounds[0]]})


def _rows(data: pd.DataFrame) -> tuple[Row, ...]:
    groups = data.groupby(["vehicle", "scheme", "solver"])
    steps = {key: groups.get_group(key) for key in product(VEHICLES, ("sqp", "rti"), SOLVERS)}
    times = {key: group["time_ms"] for key, group in steps.items()}
    rows = []
    for (name, scheme, solver), taken in times.items():
        theirs = published.TIMES[name, scheme]
        for word, number, ours in (("mean", theirs.mean, float(taken.mean())), ("max", theirs.most, float(taken.max()))):
            remark = f"{number.value / ours:.0f} x faster: {_MACHINE}"
            quantity = f"{name}, {scheme.upper()}, {solver}: {word}"
            rows.append(Row(quantity, "ms", number, ours, remark, counted=solver == AS_PUBLISHED))
    for name, solver in product(VEHICLES, SOLVERS):
        sqp, rti = times[name, "sqp", solver], times[name, "rti", solver]
        qps = steps[name, "sqp", solver]["qps"]
        remark = f"SQP takes {qps.mean():.1f} QPs a step, {qps.max()} at most; theirs is not published"
        for word, ratio in (("mean", sqp.mean() / rti.mean()), ("max", sqp.max() / rti.max())):
            rows.append(Row(f"{name}, {solver}: SQP / RTI, {word}", "", _ratio(name, word), float(ratio), remark, counted=False))
    return tuple(rows)


def _ratio(vehicle: str, word: str) -> published.Number:
    sqp, rti = (published.TIMES[vehicle, scheme] for scheme in ("sqp", "rti"))
    pair = (sqp.mean, rti.mean) if word == "mean" else (sqp.most, rti.most)
    value = pair[0].value / pair[1].value
    return published.Number(value, value * (pair[0].reading_error / pair[0].value + pair[1].reading_error / pair[1].value))


@styled()
def _figure(data: pd.DataFrame) -> Figure:
    """Return [GEO] table I as bars: published, and each solver here; the mean as a bar and the largest as a mark, logarithmic."""
    figure = Figure(figsize=(10.0, 4.8), layout="constrained")
    axes = figure.subplots()
    solvers = list(dict.fromkeys(data["solver"]))
    labels = ["published: OSQP, MATLAB, laptop", *(f"here: {solver}" for solver in solvers)]
    width = 0.8 / len(labels)
    theirs = [[(time.mean.value, time.most.value) for time in published.TIMES.values()]]
    times = data.groupby(["solver", "vehicle", "scheme"])["time_ms"]
    found = times.mean(), times.max()
    ours = [[tuple(float(one[solver, *key]) for one in found) for key in published.TIMES] for solver in solvers]
    means, most = np.moveaxis(np.array(theirs + ours), 2, 0)
    for row, (label, colour) in enumerate(zip(labels, ("0.6", drawing.YELLOW, drawing.BLUE), strict=True)):
        x = np.arange(len(published.TIMES)) + width * (row - 0.5 * (len(labels) - 1))
        axes.bar(x, means[row], 0.92 * width, color=colour, label=f"{label}, mean")
        axes.plot(x, most[row], linestyle="none", marker="v", color=colour, markeredgecolor="0.1", markersize=7)
        for place, mean in zip(x, means[row], strict=True):
            axes.annotate(f"{mean:.3g}", (place, mean), xytext=(0, -12), textcoords="offset points", ha="center", fontsize="x-small")
    axes.plot([], [], linestyle="none", marker="v", color="white", markeredgecolor="0.1", label="largest")
    axes.set_yscale("log")
    axes.set_ylim(bottom=0.4 * float(means.min()))
    plain_decades(axes, "y")
    axes.set_xticks(np.arange(len(published.TIMES)), [f"{vehicle}\n{scheme.upper()}" for vehicle, scheme in published.TIMES])
    axes.set_ylabel("time of one planning step [ms]")
    axes.legend(fontsize="small", ncols=2, loc="upper center", bbox_to_anchor=(0.5, 1.2), frameon=False)
    axes.grid(visible=True, axis="y", color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)
    return figure
