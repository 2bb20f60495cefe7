"""Roads with obstacles on them, made from a seed, and the sides on which they can be passed, one by one."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import shapely

from hdvplan.api import drive_case
from hdvplan.case import Case
from hdvplan.errors import PlanError
from hdvplan.judging.balance import KEPT_M, balance_of
from hdvplan.road.path import from_curvature
from hdvplan.road.regions import Kind, Region, Side
from hdvplan.road.road import Road

HALF_WIDTH_M = 4.6
LEAD_M = 60.0  # of road before the first obstacle and after the last

Box = tuple[float, float, float, float]  # s from and to, offsets from and to [m]


def road_with(
    boxes: Sequence[Box], *, bend: float = 0.0, half_width: float | None = HALF_WIDTH_M, sides: Sequence[Side | None] = ()
) -> Road:
    """Return a road that is straight, or a bend between straights, with obstacles at places along it."""
    length = max(s_to for _, s_to, _, _ in boxes) + LEAD_M
    s = np.array([0.0, 40.0, 60.0, length - 50.0, length - 30.0, length])
    path = from_curvature(s, bend * np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0]))
    given = itertools.chain(sides, itertools.repeat(None))
    regions = []
    for number, ((s_from, s_to, low, high), side) in enumerate(zip(boxes, given, strict=False)):
        corners = [path.to_plane(at, offset) for at, offset in ((s_from, low), (s_to, low), (s_to, high), (s_from, high))]
        regions.append(Region(Kind.OBSTACLE, shapely.Polygon([(float(x), float(y)) for x, y in corners]), f"o{number}", side))
    road = Road("arrangement", path, regions=tuple(regions))
    return road.within(None) if half_width is None else road.with_limits(half_width, half_width)


def slalom(seed: int, count: int, gaps: tuple[float, float]) -> Road:
    """Return ``count`` obstacles on the line of a road, ``gaps`` apart [m], some of them with one side closed."""
    rng = np.random.default_rng(seed)
    boxes, s = list[Box](), LEAD_M
    bend = float(rng.choice([0.0, 0.0, 0.01, 0.03]))
    for _ in range(count):
        length, width, middle = rng.uniform(1.0, 6.0), rng.uniform(1.5, 3.5), rng.uniform(-1.6, 1.6)
        boxes.append((s, s + length, middle - 0.5 * width, middle + 0.5 * width))
        s += length + rng.uniform(*gaps)
    return road_with(boxes, bend=bend)


def free_by_force(case: Case) -> Iterator[tuple[Side, ...]]:
    """Yield every choice of sides with which a plan of the whole road is free of contact."""
    for sides in itertools.product(Side, repeat=len(case.road.passages)):
        try:
            drive = drive_case(replace(case, road=case.road.passing(dict(enumerate(sides)))))
            balance = balance_of(drive)
        except PlanError:
            continue
        if balance.min_clearance is not None and balance.min_clearance >= -KEPT_M:
            yield sides
