"""The least width of two straight corridors that meet at a right angle, sharp inside and outside, for a rigid vehicle.

Found by optimal control in the plane, which shares nothing with planning or proving: the rear axle starts in the first corridor at any
offset and heading, and its path is a chain of arcs of any curvatures up to the largest. Each step linearises where the corners of the body
and the inner corner of the corridors lie, at every pose, and moves the curvatures within a trust region by the linear program that makes
the corridors narrowest. Between poses 0.25 m apart a point of the body bows out by less than a millimetre.

The first corridor runs along x, its inner wall is y = 0 for x < 0; the second along y, its inner wall is x = 0 for y > 0. The outer walls
are y = -D and x = D.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # its subpackages load when they are first used
import shapely

from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.road.path import from_curvature
from hdvplan.road.regions import Kind, Region
from hdvplan.road.road import Road
from hdvplan.vehicle.model import Unit, Vehicle

STEP_M = 0.25
_BEFORE_M = 25.0  # from the start to the inner corner
_AFTER_M = 22.0
_ARM_M = 60.0  # of the corridors' walls
_CHANGE = 1e-6  # for derivatives by differences


@dataclass(frozen=True)
class Turn:
    """A way round the corner: offset and heading at the start, and the curvatures of its arcs [1/m]; ``width`` is what it takes [m]."""

    given: FloatArray  # y, heading, curvatures
    width: float


def corner(vehicle: Vehicle, width: float, *, radius: float = 12.0, ramp: float = 6.0) -> Case:
    """Return a road round the corner of two corridors of ``width`` [m]: a rounded line between walls in the plane."""
    constant = 0.5 * np.pi * radius - ramp
    lengths = np.array([35.0, ramp, constant, ramp, 35.0])
    path = from_curvature(np.concatenate([[0.0], np.cumsum(lengths)]), np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0]) / radius)
    across = float(path.at(path.length).x)  # the line leaves there to the north; it came along y = 0
    half = 0.5 * width
    inner, outer = (across - half, half), (across + half, -half)
    block = shapely.box(inner[0] - _ARM_M, inner[1], inner[0], inner[1] + _ARM_M)
    south = shapely.box(inner[0] - _ARM_M, outer[1] - 5.0, outer[0] + 5.0, outer[1])
    east = shapely.box(outer[0], outer[1], outer[0] + 5.0, inner[1] + _ARM_M)
    regions = tuple(Region(Kind.OBSTACLE, wall, name) for wall, name in ((block, "block"), (south, "south"), (east, "east")))
    furthest = np.sqrt(2.0) * half + (np.sqrt(2.0) - 1.0) * radius  # the outer corner, from the line
    return Case(Road("corner", path, regions=regions).with_limits(half + 0.5, furthest + 0.5), vehicle)


def poses(given: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return x, y, heading of the rear axle at the ends of all arcs, shape (..., n + 1), exact."""
    turned = given[..., 2:] * STEP_M
    heading = np.concatenate([given[..., 1:2], given[..., 1:2] + np.cumsum(turned, axis=-1)], axis=-1)
    middle, chord = heading[..., :-1] + 0.5 * turned, STEP_M * np.sinc(0.5 * turned / np.pi)
    start = np.zeros_like(given[..., :1])
    x = np.concatenate([start - _BEFORE_M, np.cumsum(chord * np.cos(middle), axis=-1) - _BEFORE_M], axis=-1)
    y = np.concatenate([given[..., :1], given[..., :1] + np.cumsum(chord * np.sin(middle), axis=-1)], axis=-1)
    return x, y, heading


def reaches(unit: Unit, given: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how wide the corridors must be at every pose for the outer walls, and the room to the inner corner; (..., n + 1) [m]."""
    x, y, heading = poses(given)
    cos, sin = np.cos(heading), np.sin(heading)
    half = 0.5 * unit.width
    corners = [(ahead, left) for ahead in (unit.front, -unit.rear_overhang) for left in (half, -half)]
    xs = np.stack([x + ahead * cos - left * sin for ahead, left in corners])
    ys = np.stack([y + ahead * sin + left * cos for ahead, left in corners])
    outer = np.maximum(np.max(xs, axis=0), -np.min(ys, axis=0))
    beside = x * sin - y * cos - half  # of the inner corner, left of the body's left side
    inner = np.maximum(
        np.maximum(-np.max(ys, axis=0), np.min(xs, axis=0)), np.where((heading >= 0.0) & (heading <= 0.5 * np.pi), beside, -9.0)
    )
    return outer, inner


def narrowest(unit: Unit, most: float, start: FloatArray, *, steps: int = 200) -> Turn:
    """Return the way round the corner that a start leads to, a local optimum, moved so far that it keeps the inner corner."""
    given, trust = start, 0.02
    outer, inner = reaches(unit, given)
    worst = float(np.max(outer) + 2.0 * max(0.0, -float(np.min(inner))))
    for _ in range(steps):
        moved = given + _CHANGE * np.eye(len(given))
        by_outer, by_inner = ((after - here).T / _CHANGE for after, here in zip(reaches(unit, moved), (outer, inner), strict=True))
        count = len(outer)
        # Variables: the change of ``given``, the width, and what the inner corner is cut by at the worst pose, which costs double.
        rows = np.block([[by_outer, -np.ones((count, 1)), np.zeros((count, 1))], [-by_inner, np.zeros((count, 1)), -np.ones((count, 1))]])
        room = np.concatenate([-outer, inner])
        low = np.concatenate([[-trust * 10.0, -trust], np.maximum(-trust, -most - given[2:]), [0.0, 0.0]])
        high = np.concatenate([[trust * 10.0, trust], np.minimum(trust, most - given[2:]), [99.0, 99.0]])
        cost = np.concatenate([np.zeros(len(given)), [1.0, 2.0]])
        found = scipy.optimize.linprog(cost, rows, room, bounds=list(zip(low.tolist(), high.tolist(), strict=True)), method="highs")
        if found.x is None:
            break
        after = given + found.x[:-2]
        new_outer, new_inner = reaches(unit, after)
        value = float(np.max(new_outer) + 2.0 * max(0.0, -float(np.min(new_inner))))
        if value < worst - 1e-7:
            given, outer, inner, worst, trust = after, new_outer, new_inner, value, min(1.5 * trust, 0.05)
        else:
            trust *= 0.4
        if trust < 1e-6:
            break
    return Turn(given, float(np.max(outer) + max(0.0, -float(np.min(inner)))))


def starts(most: float, count: int) -> list[FloatArray]:
    """Return ways to begin with: a quarter of a circle that begins at different places, wound off with or without a swing out before."""
    arcs = round((_BEFORE_M + _AFTER_M) / STEP_M)
    s, found = STEP_M * np.arange(arcs), []
    for number in range(count):
        begin, radius, swing = 18.0 + 1.5 * (number % 5), 10.0 / (most * 10.0) + 1.5 * (number // 5), 0.02 * (number % 3)
        kappa = np.where((s >= begin) & (s < begin + 0.5 * np.pi * radius), 1.0 / radius, 0.0)
        kappa[(s >= begin - 8.0) & (s < begin)] -= swing
        found.append(np.concatenate([[-3.0, 0.0], np.clip(kappa, -most, most)]))
    return found
