"""Proofs held against drives that fit: none of the cases may be called impossible. Writes random.csv, run.json; goes on where it stopped.

python benchmarks/proof_random.py [--out results/proof/random] [--first 0] [--cases 1000] [--vehicles a,b] [--narrower 0.2]

Every tenth case is tried again with limits, and obstacles, nearer by ``--narrower`` metres on both sides: a proof that proves nothing
would never be wrong.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from time import process_time

import pandas as pd
from cases import words
from proof_cases import fitting

from hdvplan.proof.answer import proof_of
from hdvplan.record import write_record
from hdvplan.vehicle.load import load_vehicle

VEHICLES = ("bus", "rigid-truck", "tractor-trailer", "articulated-bus")
_CONTROL = 10


def main(arguments: Sequence[str] | None = None) -> None:
    """Try to prove what is driven, and write a row a case."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("results/proof/random"))
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--vehicles", type=words, default=list(VEHICLES))
    parser.add_argument("--narrower", type=float, default=0.2)
    options = parser.parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)
    table = options.out / "random.csv"
    done = set(pd.read_csv(table)["seed"]) if table.exists() else set()
    for seed in range(options.first, options.first + options.cases):
        if seed not in done:
            row = tried(seed, options.vehicles[seed % len(options.vehicles)], options.narrower)
            pd.DataFrame([row]).to_csv(table, mode="a", header=not table.exists(), index=False, float_format="%.3f", lineterminator="\n")
            if row["proof"]:
                print(*row.values(), sep="  ", flush=True)
    rows = pd.read_csv(table, keep_default_na=False)
    fits = rows[rows["way"] != ""]
    controls = fits[fits["narrower_proved"] != ""]
    proved = int((controls["narrower_proved"] == "True").sum())
    print(f"{len(fits)} cases that a drive fits: {int((fits['proof'] != '').sum())} called impossible")
    print(f"{options.narrower:.2f} m narrower: {proved} of {len(controls)} proved impossible")
    write_record(options.out, [])  # a seed is all that a case needs


def tried(seed: int, name: str, narrower: float) -> dict[str, object]:
    """Return one row: how the case was driven, and what is proved of it; ``way`` is empty where there is no drive that fits."""
    row: dict[str, object] = {"seed": seed, "vehicle": name, "way": "", "length": 0.0, "obstacles": 0, "two_regions": False}
    found = fitting(seed, load_vehicle(name))
    if found is None:
        return row | {"proof": "", "s_from": "", "s_to": "", "cpu_s": 0.0, "narrower_proved": ""}
    road = found.case.road
    limits = road.limits
    row |= {"way": found.way, "length": road.path.length, "obstacles": len(road.regions)}
    row["two_regions"] = limits is not None and limits.two_regions
    began = process_time()
    proof = proof_of(found.case)
    row |= {"proof": "", "s_from": "", "s_to": ""} if proof is None else {"proof": proof.kind, "s_from": proof.s_from, "s_to": proof.s_to}
    row["cpu_s"] = process_time() - began
    nearer = replace(found.case, settings=replace(found.case.settings, clearance=narrower))
    control = (seed // 4) % _CONTROL == 0
    return row | {"narrower_proved": str(proof_of(nearer) is not None) if control else ""}


if __name__ == "__main__":
    main()
