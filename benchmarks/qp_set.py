"""A test set for QP solvers from planning: limits off, inactive, binding and unkeepable, bus and tractor-trailer.

    python benchmarks/qp_set.py [DIR] [--format npz]

writes DIR and DIR.tar.xz, and prints how many programs of which kind there are. ``hdvplan/bench/measuring/export.py`` explains the
formats, and ``benchmarks/qp_loaders.py`` reads them. Horizon 100 m: 200 stages; in the format qpbenchmark 20 m, as its matrices are dense.
"""

from __future__ import annotations

import argparse
import json
import tarfile
from collections import Counter
from dataclasses import replace
from pathlib import Path

from hdvplan.bench.measuring.export import FORMATS, export
from hdvplan.case import Case
from hdvplan.planning.settings import PlannerSettings
from hdvplan.road.scenarios import SCENARIOS
from hdvplan.vehicle.load import load_vehicle

WHOLE_M, SHORT_M = 100.0, 20.0
MOST = 24  # programs of a drive
COURSES = (
    ("bus", None), ("bus", 6.0), ("bus", 2.48), ("bus", 2.2), ("tractor-trailer", None), ("tractor-trailer", 3.2), ("tractor-trailer", 2.75)
)  # fmt: skip


def cases(horizon: float) -> list[Case]:
    """Return the drives: a U-turn between parallel limits at several half widths [m], None: without any."""
    road, settings = SCENARIOS["uturn"](), PlannerSettings(horizon=horizon)
    found = []
    for vehicle, half_width in COURSES:
        limited = replace(road, limits=None) if half_width is None else road.with_limits(half_width, half_width)
        found.append(Case(replace(limited, name=f"uturn-{half_width or 'off'}"), load_vehicle(vehicle), settings=settings))
    return found


def main() -> None:
    """Write the set and its archive."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("directory", type=Path, nargs="?", default=Path("qp-set"), metavar="DIR")
    parser.add_argument("--format", choices=FORMATS, default="npz")
    asked = parser.parse_args()
    export(cases(SHORT_M if asked.format == "qpbenchmark" else WHOLE_M), asked.directory, asked.format, MOST)
    for sequence in json.loads((asked.directory / "manifest.json").read_text(encoding="utf-8"))["sequences"]:
        kinds = Counter(program["limits"] for program in sequence["programs"])
        print(f"{sequence['name']}: {', '.join(f'{count} {kind}' for kind, count in kinds.items())}")
    archive = asked.directory.with_suffix(".tar.xz")
    with tarfile.open(archive, "w:xz", preset=1) as file:
        file.add(asked.directory, asked.directory.name)
    print(f"{archive}: {archive.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
