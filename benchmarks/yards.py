"""Drives of several legs among walls and obstacles, in yards where a drive is known that fits: how many of them planning finds.

python benchmarks/yards.py [--out results/yards]

A yard is made around a drive: a rigid truck turns in three moves, or a tractor-semitrailer pulls out and backs in again along arcs. Its
walls lie 0.3 to 1.5 m beyond what the drive sweeps; some twenty boxes stand where it sweeps nothing, at least 0.3 m away. Planning is
given the lines of the drive, the walls and the boxes, nothing else. All from seeds.
"""

from __future__ import annotations

from time import process_time

import numpy as np
import pandas as pd
import shapely
from cases import options_of, words, write_results

from hdvplan.arrays import FloatArray
from hdvplan.driving.drive import simulate
from hdvplan.errors import HdvplanError
from hdvplan.legs import plan_legs
from hdvplan.report.grid import markdown_table
from hdvplan.road.legs import Leg, Legs
from hdvplan.road.load_legs import within
from hdvplan.road.path import ReferencePath, evaluate_many, from_curvature, from_samples
from hdvplan.road.regions import Kind, Region
from hdvplan.road.road import Road
from hdvplan.vehicle.kinematics import corners_at, place_many
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle

YARDS, BOXES, FREE_M, STEP_M = 20, 20, 0.3, 0.25


def moved(path: ReferencePath, place: FloatArray, at: float) -> ReferencePath:
    """Return a path moved so that its point at arclength ``at`` [m] has a place x, y [m] and heading [rad]."""
    here, s = path.at(at), np.linspace(0.0, path.length, int(np.ceil(path.length / 0.5)) + 1)
    all_, turn = path.at(s), place[2] - float(here.heading)
    x, y, cos, sin = all_.x - float(here.x), all_.y - float(here.y), np.cos(turn), np.sin(turn)
    heading = np.unwrap(all_.heading) + turn
    return from_samples(place[0] + cos * x - sin * y, place[1] + sin * x + cos * y, heading, all_.curvature, float(s[1]))


def end_of(path: ReferencePath, at: float) -> FloatArray:
    """Return the place and heading of a path's point, (3,) [m, rad]."""
    here = path.at(at)
    return np.array([float(here.x), float(here.y), float(here.heading)])


def ramped(parts: list[tuple[float, float]], ramp: float) -> ReferencePath:
    """Return the path of arcs and straights, (length [m], curvature [1/m]), with ramps of curvature between them."""
    s, k = [0.0], [parts[0][1]]
    for number, (length, curvature) in enumerate(parts):
        if number:
            s, k = [*s, s[-1] + ramp], [*k, curvature]
        s, k = [*s, s[-1] + length], [*k, curvature]
    return from_curvature(s, k)


def three_moves(vehicle: Vehicle, random: np.random.Generator) -> list[tuple[ReferencePath, bool]]:
    """Return the lines of a turn in three moves."""
    k, ramp = random.uniform(0.6, 0.9, 3) * vehicle.max_curvature, 2.0
    turns = np.deg2rad(np.array([random.uniform(45.0, 75.0), random.uniform(40.0, 70.0)]))
    first = ramped([(random.uniform(8.0, 20.0), 0.0), (turns[0] / k[0], k[0])], ramp)
    second = ramped([(turns[1] / k[1], -k[1]), (1.0, 0.0)], ramp)  # as the vehicle heads; driven the other way
    second = moved(second, end_of(first, first.length), second.length)
    third = ramped([(1.0, 0.0), (turns[0] / k[2], k[2]), (random.uniform(8.0, 20.0), 0.0)], ramp)
    return [(first, False), (second, True), (moved(third, end_of(second, 0.0), 0.0), False)]


def back_in(vehicle: Vehicle, random: np.random.Generator) -> list[tuple[ReferencePath, bool]]:
    """Return the lines of pulling out of a dock, and back in beside it: the second is a pull-out in reverse."""
    del vehicle
    lines = []
    for _ in range(2):
        k, turn = random.uniform(0.05, 0.075) * random.choice([-1.0, 1.0]), np.deg2rad(random.uniform(30.0, 80.0))
        lines.append(ramped([(random.uniform(8.0, 14.0), 0.0), (turn / abs(k), k), (random.uniform(18.0, 26.0), 0.0)], 8.0))
    out, back = lines
    return [(out, False), (moved(back, end_of(out, out.length), back.length), True)]


KINDS = {"rigid-truck": three_moves, "tractor-semitrailer": back_in}


def swept(vehicle: Vehicle, lines: list[tuple[ReferencePath, bool]]) -> shapely.Geometry:
    """Return what the bodies sweep while the lead axle follows the lines, each forwards from a straight stance: so backwards, too [m]."""
    outlines: list[shapely.Geometry] = []
    for path, _ in lines:
        long, steps = path.extended(60.0, 60.0), int(path.length / STEP_M)
        s = STEP_M * np.arange(steps + 1, dtype=np.float64)
        kappa = evaluate_many(long, s[:-1] + 0.5 * STEP_M)[4]
        z = simulate(vehicle.table(), long, 0.0, STEP_M, np.zeros(vehicle.states), kappa, 1)
        z[:, :2] = 0.0  # the lead axle follows the line; what the steps leave of that is centimetres
        poses = place_many(vehicle.table(), evaluate_many(long, s), z)
        outlines += np.asarray(shapely.polygons(corners_at(vehicle, poses))).ravel().tolist()
    return shapely.union_all(outlines)


def yard(vehicle: Vehicle, seed: int) -> Legs:
    """Return the lines of a drive, among walls and boxes between which it fits."""
    random = np.random.default_rng(seed)
    lines = KINDS[vehicle.name](vehicle, random)
    free = shapely.buffer(swept(vehicle, lines), FREE_M)
    west, south, east, north = np.array(free.bounds) + np.array([-1.0, -1.0, 1.0, 1.0]) * random.uniform(0.0, 1.2, 4)
    inside = shapely.box(west, south, east, north)
    walls = [shapely.box(west - 1.0, south - 1.0, west, north + 1.0), shapely.box(east, south - 1.0, east + 1.0, north + 1.0)]
    walls += [shapely.box(west, south - 1.0, east, south), shapely.box(west, north, east, north + 1.0)]
    boxes: list[shapely.Polygon] = []
    while len(boxes) < BOXES:
        x, y, long, wide = *random.uniform([west, south], [east, north]), *random.uniform(0.5, 4.0, 2)
        box = shapely.affinity.rotate(shapely.box(x, y, x + long, y + wide), random.uniform(0.0, 90.0))
        if shapely.contains(inside, box) and not shapely.intersects(box, free):
            boxes.append(box)
    regions = tuple(Region(Kind.OBSTACLE, polygon, "wall" if number < 4 else "box") for number, polygon in enumerate((*walls, *boxes)))  # noqa: PLR2004
    legs = tuple(within(Leg(Road(f"yard {seed}", path), backward), regions) for path, backward in lines)
    return Legs(f"yard {seed}", legs, (), regions)


def row(vehicle: Vehicle, seed: int) -> dict[str, object]:
    """Return what became of one yard."""
    begun = process_time()
    told: dict[str, object] = {"vehicle": vehicle.name, "seed": seed}
    try:
        found = plan_legs(yard(vehicle, seed), vehicle)
    except HdvplanError as error:
        return told | {"fits": False, "spare_m": np.nan, "why": str(error), "cpu_s": process_time() - begun}
    spare = min(one.spare for one in found.verdicts if one.spare is not None)
    return told | {"fits": bool(found.fits), "spare_m": spare, "why": "" if found.fits else found.text, "cpu_s": process_time() - begun}


def main() -> None:
    """Write the table."""
    parser = options_of(__doc__, "yards")
    parser.add_argument("--vehicles", type=words, default=",".join(KINDS), metavar="A,B")
    asked = parser.parse_args()
    vehicles = [load_vehicle(name) for name in asked.vehicles]
    table = pd.DataFrame([row(vehicle, seed) for vehicle in vehicles for seed in range(YARDS)])
    counts = table.groupby("vehicle", sort=False).agg(yards=("fits", "size"), found=("fits", "sum"), cpu_s=("cpu_s", "mean")).reset_index()
    text = f"# Yards in which a drive is known that fits\n\n{markdown_table(counts.round(2), text=('vehicle',))}\n"
    write_results(asked.out, {"yards": table}, {"yards": text}, [], form=None)
    print(text)


if __name__ == "__main__":
    main()
