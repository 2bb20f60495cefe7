"""How well vehicles are backed with errors that no plan knows of, and what a planning step of several legs costs.

python benchmarks/legs.py [--out results/legs]

Backing: a vehicle stands 0.3 m beside a straight of 60 m and is driven along it rear first. Then the same with trailers 5 % longer than
the plan believes, a steering bias of 0.002 1/m, and noise of the measured state (1 cm, 0.2 degrees at every plan; seeded). The table has
the largest offset of any axle and the largest articulation over the second half of the way; infinite where the vehicle folds.

Times: a line of 45 m, straight and then a bend of 20 m radius, is driven in two, three and five legs, forwards and back in turn, and five
such lines behind each other in one leg forwards. Rounds alternate all; every step counts with its fastest round, a drive's first plan not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from cases import options_of, words, write_results

from hdvplan.arrays import FloatArray
from hdvplan.centring.stationary import CentringTable
from hdvplan.driving.drive import simulate
from hdvplan.driving.legs import drive_legs, ready_legs
from hdvplan.errors import HdvplanError
from hdvplan.machine import use_one_thread
from hdvplan.planning.objectives import objective_named
from hdvplan.planning.settings import PlannerSettings
from hdvplan.report.grid import markdown_table
from hdvplan.road.legs import Leg, Legs
from hdvplan.road.path import from_curvature
from hdvplan.road.road import Road
from hdvplan.solvers.registry import DEFAULT, dependable
from hdvplan.vehicle.kinematics import place_many
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle

LENGTH_M, OFF_M = 60.0, 0.3
VEHICLES = ("bus", "articulated-bus", "tractor-trailer", "tractor-semitrailer", "semitrailer-steered", "road-train", "b-double", "a-double")
LEGS, ROUNDS, SLACK_M = (1, 2, 3, 5), 5, 0.5
LINE_M, BEND = 45.0, 0.05  # and 1/m
TIMED = PlannerSettings(horizon=60.0)
HORIZONS_M, REPLANS_M = (10.0, 20.0, 30.0, 40.0, 60.0), (1.0, 5.0, 10.0)


@dataclass(frozen=True)
class Errors:
    """What a plan does not know: trailers so much longer, steering so much to the left [1/m], noise of offset [m] and angles [rad]."""

    longer: float = 0.0
    bias: float = 0.0
    offset: float = 0.0
    angle: float = 0.0


FOLDED_DEG = 90.0  # articulation from which a vehicle does not come out of a fold
NONE, SOME = Errors(), Errors(0.05, 0.002, 0.01, np.deg2rad(0.2))


def backed(vehicle: Vehicle, horizon: float, replan: float, errors: Errors = NONE) -> FloatArray:
    """Return the states (n, states) of a vehicle that is backed along the straight, at stations in the order of driving.

    Raises:
        HdvplanError: it cannot be planned further.

    """
    road = Road("straight", from_curvature([0.0, LENGTH_M], [0.0, 0.0]))
    settings = PlannerSettings(horizon=horizon, replan=replan)
    begun = ready_legs(Legs("straight", (Leg(road, True),)), vehicle, objective_named("geometric"), dependable(DEFAULT), settings)
    course, way, random = begun.course, begun.course.ways[0], np.random.default_rng(0)
    lead, *others = vehicle.units
    true = replace(vehicle, units=(lead, *(replace(unit, wheelbase=(1.0 + errors.longer) * unit.wheelbase) for unit in others)))
    z, kappa, at, states = begun.begin.z.copy(), 0.0, 0, []
    z[0] += OFF_M
    rigid = vehicle.rigid_states
    while at < course.end:
        noise = np.zeros(len(z))
        noise[0], noise[1:rigid] = random.normal(0.0, errors.offset), random.normal(0.0, errors.angle, rigid - 1)
        plan = begun.planner.plan(at, z + noise, kappa)
        count = min(settings.executed, course.end - at)
        for i in range(count):
            step = float(course.stations.points["step"][at + i])
            if step != 0.0:
                held, wheels = plan.kappa[i : i + 1] + errors.bias, plan.z[i : i + 2, rigid:]
                z = simulate(true.table(), way.stations.path, way.s(at + i), step, z, held, 1, wheels)[-1]
                states.append(z)
        at, kappa = at + count, float(plan.kappa[count - 1])
        if not np.all(np.isfinite(z)):
            break
    return np.array(states)


def row(vehicle: Vehicle, horizon: float, replan: float, errors: Errors) -> dict[str, object]:
    """Return what the second half of a drive came to."""
    told = {"vehicle": vehicle.name, "horizon_m": horizon, "replan_m": replan, "errors": "some" if errors != NONE else "none"}
    try:
        z = backed(vehicle, horizon, replan, errors)
    except HdvplanError:
        z = np.full((1, vehicle.states), np.inf)
    late = z[len(z) // 2 :]
    angle = float(np.max(np.abs(np.rad2deg(late[:, 2 : vehicle.rigid_states])), initial=0.0))
    if not angle < FOLDED_DEG:
        return told | {"off_m": np.inf, "articulation_deg": np.inf}
    straight = np.zeros((5, len(late)))
    straight[2] = 1.0  # its cosine
    axles = place_many(vehicle.table(), straight, late)["y"]
    return told | {"off_m": float(np.max(np.abs(axles))), "articulation_deg": angle}


def steps(legs: Legs, vehicle: Vehicle) -> FloatArray:
    """Return the times of a drive's planning steps but the first [s]."""
    drives = drive_legs(legs, vehicle, objective_named("geometric"), dependable(DEFAULT), TIMED)
    plans = [plan for drive in drives for plan in drive.plans]
    return np.array([plan.times.total for plan in plans[1:]])


def timed(vehicle: Vehicle, *, limited: bool) -> list[dict[str, object]]:
    """Return the mean and the longest step of one long leg and of several, and the mean over that of the long one."""
    roads = [Road("bends", from_curvature(*bends(count))) for count in (1, max(LEGS))]
    if limited:
        half = float(CentringTable.of(vehicle).at(np.array([BEND])).half_width[0]) + SLACK_M
        roads = [road.with_limits(half, half) for road in roads]
    drives = [Legs("bends", (Leg(roads[1], False),))]
    drives += [Legs("bends", tuple(Leg(roads[0], bool(number % 2)) for number in range(count))) for count in LEGS[1:]]
    rounds = [[steps(legs, vehicle) for legs in drives] for _ in range(ROUNDS)]
    fastest = [1e3 * np.min(np.stack(one), axis=0) for one in zip(*rounds, strict=True)]
    return [
        {
            "vehicle": vehicle.name, "limits": "yes" if limited else "no", "legs": count, "steps": len(own), "mean_ms": float(np.mean(own)),
            "max_ms": float(np.max(own)), "times_one_leg": float(np.mean(own) / np.mean(fastest[0])),
        }
        for count, own in zip(LEGS, fastest, strict=True)
    ]  # fmt: skip


def bends(count: int) -> tuple[FloatArray, FloatArray]:
    """Return arclengths and curvatures of lines behind each other that are straight and then bend."""
    begins = LINE_M * np.arange(count, dtype=np.float64)
    s = (begins[:, None] + np.array([0.0, 15.0, 25.0, LINE_M - 1e-3])).ravel()
    return s, np.tile([0.0, 0.0, BEND, BEND], count)


def markdown(backing: pd.DataFrame, times: pd.DataFrame) -> str:
    """Return the tables as they are read."""
    wide = backing.pivot_table(index=["vehicle", "horizon_m"], columns=["replan_m", "errors"], values="off_m", sort=False)
    shown = wide.map(lambda off: "-" if np.isnan(off) else f"{off:.3f}" if np.isfinite(off) else "folds")
    shown.columns = pd.Index([f"{one} errors, every {replan:g} m" for replan in REPLANS_M for one in ("no", "some")])
    shown = shown.reset_index()
    return f"""# Legs that are driven backwards

Largest offset of any axle [m] over the last {0.5 * LENGTH_M:g} m of {LENGTH_M:g} m straight back, begun {OFF_M:g} m beside the line, by the
horizon and how often the plan is made again. Errors: trailers {100.0 * SOME.longer:g} % longer than the plan believes, a steering bias of
{SOME.bias:g} 1/m, noise of every measured state of {1e2 * SOME.offset:g} cm and {np.rad2deg(SOME.angle):.1f} degrees.

{markdown_table(shown, text=("vehicle",))}

Time of a planning step [ms]: one long leg forwards, and several short ones, every other one backwards. Limits lie {SLACK_M:g} m beyond the
geometric half width.

{markdown_table(times.round({"mean_ms": 4, "max_ms": 3, "times_one_leg": 2}), text=("vehicle", "limits"))}
"""


def main() -> None:
    """Write the tables."""
    parser = options_of(__doc__, "legs")
    parser.add_argument("--vehicles", type=words, default=",".join(VEHICLES), metavar="A,B")
    asked = parser.parse_args()
    vehicles = [load_vehicle(name) for name in asked.vehicles]
    cells = [(vehicle, horizon, replan) for vehicle in vehicles for horizon in HORIZONS_M for replan in REPLANS_M if replan < horizon]
    backing = pd.DataFrame([row(*cell, errors) for cell in cells for errors in (NONE, SOME)])
    times = pd.DataFrame([one for vehicle in vehicles for limited in (False, True) for one in timed(vehicle, limited=limited)])
    page = markdown(backing, times)
    write_results(asked.out, {"backing": backing.round(4), "times": times}, {"legs": page}, [], form=None)
    print(page)


if __name__ == "__main__":
    use_one_thread()
    main()
