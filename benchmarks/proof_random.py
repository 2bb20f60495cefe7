"""Proofs held against drives that fit: none of the cases may be called impossible. Writes random.csv, run.json; goes on where it stopped.

python benchmarks/proof_random.py [--out results/proof/random] [--first 0] [--cases 400] [--vehicles a,b] [--narrower 0.2]

A vehicle steers at random, every third time from one curvature to another at once. The edges of its street lie where it swept, less what
still counts as kept, and in some streets obstacles stand in what it left free beside it, with edges further off. A drive that meets itself
is left out. Every tenth case is tried again with limits, and obstacles, nearer by ``--narrower`` metres on both sides: a proof that proves
nothing would never be wrong.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from time import process_time

import numpy as np
import pandas as pd
import shapely
from cases import fill_by_seed, options_of, words
from random_drives import edges_around, random_drive, road_around, swept_by

from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.judging.balance import KEPT_M
from hdvplan.proof.answer import proof_of
from hdvplan.record import write_record
from hdvplan.road.regions import Kind, Region
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle

VEHICLES = ("bus", "rigid-truck", "tractor-trailer", "articulated-bus")
_CONTROL = 10
_SUDDEN = 3
_INSIDE_M = KEPT_M - 3e-3  # edges are polygons to 2 mm
_BESIDE_M = 1.0  # of room beside what was swept, where obstacles are meant to limit
_CORNER = 0.65  # of what counts as kept: a corner of a swept area lies further inside than its edges, by the root of two


def main() -> None:
    """Try to prove what is driven, and write a row a case."""
    parser = options_of(__doc__, "proof/random")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--cases", type=int, default=400)
    parser.add_argument("--vehicles", type=words, default=list(VEHICLES))
    parser.add_argument("--narrower", type=float, default=0.2)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    table = options.out / "random.csv"
    done = set(pd.read_csv(table)["seed"]) if table.exists() else set()
    names: list[str] = options.vehicles

    def row_of(seed: int) -> dict[str, object] | None:
        return tried(seed, names[seed % len(names)], options.narrower)

    fill_by_seed(table, done, row_of, first=options.first, most=options.cases, form="%.3f")
    rows = pd.read_csv(table, keep_default_na=False)
    controls = rows[rows["narrower_proved"] != ""]
    print(f"{len(rows)} cases that a drive fits: {int((rows['proof'] != '').sum())} called impossible")
    print(f"{options.narrower:.2f} m narrower: {int((controls['narrower_proved'] == 'True').sum())} of {len(controls)} proved impossible")
    write_record(options.out, [])  # a seed is all that a case needs


def tried(seed: int, name: str, narrower: float) -> dict[str, object] | None:
    """Return one row: how the case was driven, and what is proved of it; None where the drive meets itself."""
    found = _fitting(seed, load_vehicle(name))
    if found is None:
        return None
    road = found.road
    row: dict[str, object] = {"seed": seed, "vehicle": name, "way": _way(seed), "length": road.path.length, "obstacles": len(road.regions)}
    began = process_time()
    proof = proof_of(found)
    row |= {"proof": "", "s_from": "", "s_to": ""} if proof is None else {"proof": proof.kind, "s_from": proof.s_from, "s_to": proof.s_to}
    row["cpu_s"] = process_time() - began
    nearer = replace(found, settings=replace(found.settings, clearance=narrower))
    control = (seed // len(VEHICLES)) % _CONTROL == 0
    return row | {"narrower_proved": str(proof_of(nearer) is not None) if control else ""}


def _way(seed: int) -> str:
    return "sudden" if seed % _SUDDEN == 0 else "even"


def _fitting(seed: int, vehicle: Vehicle) -> Case | None:
    """Return the case of a seed; None where its drive meets itself."""
    rng, poses = np.random.default_rng(seed), random_drive(vehicle, seed, sudden=_way(seed) == "sudden")
    beside = rng.random() < 0.4  # noqa: PLR2004 - in so many obstacles, not edges, limit
    edges = edges_around(vehicle, poses, _BESIDE_M if beside else -_INSIDE_M)
    if edges is None:
        return None
    road = road_around(vehicle, poses, edges)
    return Case(replace(road, regions=tuple(_obstacles(rng, vehicle, poses)), faces=None) if beside else road, vehicle)


def _obstacles(rng: np.random.Generator, vehicle: Vehicle, poses: FloatArray) -> Iterator[Region]:
    """Yield boxes beside the line, without what the drive swept of them."""
    swept = shapely.buffer(swept_by(vehicle, poses), -_CORNER * KEPT_M)
    for _ in range(int(rng.integers(2, 12))):
        (x, y, heading), aside = poses[rng.integers(len(poses)), 0], rng.uniform(-4.0, 4.0)
        length, width = rng.uniform(0.5, 12.0), rng.uniform(0.5, 4.0)
        box = shapely.affinity.rotate(shapely.box(-0.5 * length, -0.5 * width, 0.5 * length, 0.5 * width), rng.uniform(0.0, 180.0))
        placed = shapely.affinity.translate(box, x - aside * np.sin(heading), y + aside * np.cos(heading))
        for part in shapely.get_parts(shapely.difference(placed, swept)):
            if isinstance(part, shapely.Polygon) and part.area > 0.01:  # noqa: PLR2004 - slivers are no obstacles [m2]
                yield Region(Kind.OBSTACLE, part)


if __name__ == "__main__":
    main()
