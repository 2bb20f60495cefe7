"""What several benchmarks share: runs of a vehicle on a shipped road, loaded as `hdvplan plan` loads it, lists as options, results."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import pandas as pd

from hdvplan.case import Case
from hdvplan.record import write_record
from hdvplan.road.load import load_road
from hdvplan.road.options import RoadOptions
from hdvplan.vehicle.load import load_vehicle


@cache
def free_case(road: str, name: str) -> Case:
    """Return the run of a vehicle on a road, both by their names, without limits."""
    vehicle = load_vehicle(name)
    loaded = load_road(road, RoadOptions().followed_by(vehicle.max_curvature))
    return Case(replace(loaded, limits=None), vehicle)


def case_within(case: Case, half_width: float) -> Case:
    """Return a run with limits so far to each side of the line [m]."""
    return replace(case, road=case.road.with_limits(half_width, half_width))


def suite_roads() -> list[str]:
    """Return the roads of the committed benchmark."""
    roads: list[str] = tomllib.loads(Path("benchmarks/suite.toml").read_text(encoding="utf-8"))["roads"]
    return roads


def words(text: str) -> list[str]:
    """Return the words of an option that lists them."""
    return text.split(",")


def numbers(text: str) -> list[float]:
    """Return the numbers of an option that lists them."""
    return [float(part) for part in words(text)]


def write_results(out: Path, name: str, table: pd.DataFrame, text: str, cases: Sequence[Case]) -> None:
    """Write a table as ``name.csv`` and as ``text`` in ``name.md``, and run.json about its cases."""
    out.mkdir(parents=True, exist_ok=True)
    table.to_csv(out / f"{name}.csv", index=False, float_format="%.4f", lineterminator="\n")
    (out / f"{name}.md").write_text(text, encoding="utf-8")
    write_record(out, cases)
