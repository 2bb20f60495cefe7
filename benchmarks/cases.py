"""Which runs several benchmarks are about: a vehicle on a shipped road, loaded as `hdvplan plan` loads it."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from functools import cache
from pathlib import Path

from hdvplan.case import Case
from hdvplan.road.line import RoadOptions
from hdvplan.road.load import REFERENCE_SLACK, load_road
from hdvplan.vehicle.load import load_vehicle


@cache
def free_case(road: str, name: str) -> Case:
    """Return the run of a vehicle on a road, both by their names, without limits."""
    vehicle = load_vehicle(name)
    loaded = load_road(road, RoadOptions(max_curvature=REFERENCE_SLACK * vehicle.max_curvature))
    return Case(replace(loaded, limits=None), vehicle)


def case_within(case: Case, half_width: float) -> Case:
    """Return a run with limits so far to each side of the line [m]."""
    return replace(case, road=case.road.with_limits(half_width, half_width))


def suite_roads() -> list[str]:
    """Return the roads of the committed benchmark."""
    roads: list[str] = tomllib.loads(Path("benchmarks/suite.toml").read_text(encoding="utf-8"))["roads"]
    return roads
