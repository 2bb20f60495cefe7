"""A test set for QP solvers from planning: limits off, inactive, binding and unkeepable, bus and tractor-trailer; some 10 s.

    python benchmarks/qp_set.py [DIR]

writes one Parquet file a drive, which qpbenchmark's ``ParquetTestSet`` reads (docs/extending.md), and prints how many programs of
which kind there are. Needs pyarrow. Horizon 20 m: 40 stages, 163 to 523
variables; the files hold dense matrices, as that reader wants them.
"""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pandas as pd

from hdvplan.bench.measuring.export import export
from hdvplan.case import Case
from hdvplan.planning.settings import PlannerSettings
from hdvplan.road.scenarios import SCENARIOS
from hdvplan.vehicle.load import load_vehicle

SETTINGS = PlannerSettings(horizon=20.0)
COURSES = (
    ("bus", None), ("bus", 6.0), ("bus", 2.48), ("bus", 2.2), ("tractor-trailer", None), ("tractor-trailer", 3.2), ("tractor-trailer", 2.75)
)  # fmt: skip


def cases() -> list[Case]:
    """Return the drives: a U-turn between parallel limits at several half widths [m], None: without any."""
    road = SCENARIOS["uturn"]()
    found = []
    for vehicle, half_width in COURSES:
        limited = replace(road, limits=None) if half_width is None else road.with_limits(half_width, half_width)
        found.append(Case(replace(limited, name=f"uturn-{half_width or 'off'}"), load_vehicle(vehicle), settings=SETTINGS))
    return found


if __name__ == "__main__":
    directory = Path(sys.argv[1] if len(sys.argv) > 1 else "qp-set")
    for file in export(cases(), directory):
        kinds = Counter(pd.read_parquet(file, columns=["limits"])["limits"])
        print(f"{file}: {file.stat().st_size / 1e6:.2f} MB, {', '.join(f'{count} {kind}' for kind, count in kinds.items())}")
