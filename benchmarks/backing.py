"""How well a vehicle is backed along a straight by plans that are made again every few metres, with errors that no plan knows of.

python benchmarks/backing.py [--out results/backing]

A vehicle stands 0.3 m beside a straight of 60 m and is driven along it rear first. Then the same with trailers 5 % longer than the plan
believes, a steering bias of 0.002 1/m, and noise of the measured state (1 cm, 0.2 degrees at every plan; seeded). The table has the largest
offset of any axle and the largest articulation over the second half of the way; infinite where the vehicle folds.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from hdvplan.arrays import FloatArray
from hdvplan.driving.drive import simulate
from hdvplan.driving.legs import ready_legs
from hdvplan.errors import HdvplanError
from hdvplan.planning.objectives import objective_named
from hdvplan.planning.settings import PlannerSettings
from hdvplan.road.legs import Leg, Legs
from hdvplan.road.path import from_curvature
from hdvplan.road.road import Road
from hdvplan.solvers.registry import DEFAULT, dependable
from hdvplan.vehicle.kinematics import place_many
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle

LENGTH_M, OFF_M = 60.0, 0.3
VEHICLES = ("bus", "articulated-bus", "tractor-trailer", "tractor-semitrailer", "semitrailer-steered", "road-train", "b-double", "a-double")
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


def main() -> None:
    """Write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/backing"))
    out = parser.parse_args().out
    rows = [
        row(load_vehicle(name), horizon, replan, errors)
        for name in VEHICLES
        for horizon in HORIZONS_M
        for replan in REPLANS_M
        if replan < horizon
        for errors in (NONE, SOME)
    ]
    table = pd.DataFrame(rows)
    out.mkdir(parents=True, exist_ok=True)
    table.to_csv(out / "backing.csv", index=False, float_format="%.4f")
    wide = table.pivot_table(index=["vehicle", "horizon_m"], columns=["errors", "replan_m"], values="off_m", sort=False)
    print(wide.to_string(float_format="%.3f"))


if __name__ == "__main__":
    main()
