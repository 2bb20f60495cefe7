"""Whatever is driven within the limits lies within every reachable set: arbitrary steering, simulated densely in the plane.

The simulation shares nothing with the sets but the road's projection: arcs of 2 cm, a Runge-Kutta step for the trailer, and the outline's
offsets at their own feet, as the verdict on a plan measures them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdvplan.arrays import FloatArray, IntArray
from hdvplan.judging.balance import KEPT_M
from hdvplan.proof.answer import ROUNDING_M, grid_of
from hdvplan.proof.reach import Grid, Outline, Pair, Reached, coupling_of, outline_of, reachable, reachable_with_trailer, seen_from
from hdvplan.proof.space import MOST, Beside, Frame, beside, frame_of
from hdvplan.road.path import from_curvature
from hdvplan.road.road import Road
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Unit, Vehicle

BUS, PAIR = load_vehicle("bus"), load_vehicle("tractor-trailer")
FIRST_M, LAST_M = 15.0, 45.0
STEP_M, CELL = 0.2, 2e-3  # of the sets: coarse ones err on the safe side too
ARC_M = 0.02
FOLLOWED_M = 0.5  # between corrections of a drive that follows the road
INSIDE_M2 = {1: 18.0, 2: -8.0}  # by units: offset times radius of a drive that follows the road; a trailer cuts the corner
OFFSET_M = 1e-5  # interpolated between two poses: an eighth of (0.02 m)^2 times 0.1 1/m is 5e-6, and as much for the road
HEADING = 1e-5  # the same [rad]
OUTLINE_M = 0.2  # between points that are held against the limits


def winding(half_width: float) -> Road:
    """Return an S of 20 and 25 m radius."""
    s = np.array([0.0, 12.0, 18.0, 28.0, 38.0, 50.0, 56.0, 80.0])
    path = from_curvature(s, np.array([0.0, 0.0, 0.05, 0.05, -0.04, -0.04, 0.0, 0.0])).extended(60.0, 60.0)
    return Road("winding", path).with_limits(half_width, half_width)


@dataclass(frozen=True)
class Sets:
    """A reachable set with what it was followed by; ``keep`` and ``kept`` are empty for a vehicle with a trailer."""

    vehicle: Vehicle
    road: Road
    half_width: float
    frame: Frame
    grid: Grid
    reached: Reached
    keep: IntArray
    kept: FloatArray


@cache
def sets_of(half_width: float) -> Sets:
    """Return what the bus reaches on the winding road."""
    road, frame, grid, space, lead = _given(BUS, half_width)
    keep, kept = np.zeros((frame.s.size, grid.cells), np.int64), np.zeros((frame.s.size, grid.cells, MOST, 2))
    reached = reachable(lead, BUS.max_curvature, space, frame, grid, two_regions=False, keep=(keep, kept))
    return Sets(BUS, road, half_width, frame, grid, reached, keep, kept)


@cache
def sets_of_pair(half_width: float) -> Sets:
    """Return what the tractor of a tractor with a trailer reaches."""
    road, frame, grid, space, lead = _given(PAIR, half_width)
    tractor, trailer = PAIR.units
    behind = seen_from(outline_of(trailer, two_regions=False), trailer.wheelbase)
    pair = Pair(lead, behind, coupling_of(tractor, trailer))
    reached = reachable_with_trailer(pair, PAIR.max_curvature, space, frame, grid, two_regions=False)
    return Sets(PAIR, road, half_width, frame, grid, reached, np.zeros((0, 0), np.int64), np.zeros((0, 0, 0, 2)))


def _given(vehicle: Vehicle, half_width: float) -> tuple[Road, Frame, Grid, Beside, Outline]:
    road = winding(half_width)
    frame = frame_of(road.path, np.arange(FIRST_M, LAST_M, STEP_M))
    space = beside(road, FIRST_M - 50.0, LAST_M + 50.0, room=KEPT_M + ROUNDING_M)
    assert space is not None
    return road, frame, grid_of(frame, CELL), space, outline_of(vehicle.lead, two_regions=False)


@dataclass(frozen=True)
class Steering:
    """Lengths of steering: ``share`` of the largest curvature is held, or, where that is None, the road is followed."""

    length: float  # [m]
    share: float | None


steerings = st.lists(
    st.builds(Steering, st.floats(0.05, 1.5), st.one_of(st.sampled_from([-1.0, 1.0]), st.none(), st.floats(-1.0, 1.0))),
    min_size=1,
    max_size=30,
)


def driven(sets: Sets, e: float, turned: float, gamma: float, steering: list[Steering]) -> FloatArray:
    """Return x, y, heading and articulation angle every ``ARC_M``, (n, 4), from a pose on the first normal to beyond the last."""
    start = sets.road.path.at(FIRST_M)
    heading = float(start.heading)
    pose = np.array([float(start.x) - e * np.sin(heading), float(start.y) + e * np.cos(heading), heading + turned, gamma])
    found, most, s = [pose], sets.vehicle.max_curvature, FIRST_M
    for part in [*steering, Steering(100.0, None)]:
        left = part.length
        while left > 0.0 and s < LAST_M + 1.0:
            at, off = (float(np.ravel(value)[0]) for value in sets.road.path.project(pose[0], pose[1], s))
            point, s = sets.road.path.at(at), at
            inside = INSIDE_M2[len(sets.vehicle.units)] * float(point.curvature)
            wanted = float(point.curvature) - 0.03 * (off - inside) - 0.35 * (pose[2] - float(point.heading))
            kappa = float(np.clip(wanted if part.share is None else part.share * most, -most, most))
            for _ in range(int(np.ceil(min(left, FOLLOWED_M) / ARC_M))):
                pose = _moved(sets.vehicle, pose, kappa)
                found.append(pose)
            left -= FOLLOWED_M
            if abs(off) > 2.0 * sets.half_width:
                return np.array(found)
    return np.array(found)


def _moved(vehicle: Vehicle, pose: FloatArray, kappa: float) -> FloatArray:
    middle, gamma = pose[2] + 0.5 * kappa * ARC_M, float(pose[3])
    if len(vehicle.units) > 1:
        lead, trailer = vehicle.units

        def rate(angle: float) -> float:
            return float(kappa - (np.sin(angle) - lead.hitch_offset * kappa * np.cos(angle)) / trailer.wheelbase)

        one = rate(gamma)
        two = rate(gamma + 0.5 * ARC_M * one)
        three = rate(gamma + 0.5 * ARC_M * two)
        gamma += ARC_M / 6.0 * (one + 2.0 * two + 2.0 * three + rate(gamma + ARC_M * three))
    chord = ARC_M * np.sinc(0.5 * kappa * ARC_M / np.pi)
    return np.array([pose[0] + chord * np.cos(middle), pose[1] + chord * np.sin(middle), pose[2] + kappa * ARC_M, gamma])


def crossings(sets: Sets, drive: FloatArray) -> FloatArray:
    """Return e, heading, articulation angle where the drive crosses the stations, (stations crossed, 3)."""
    s, e = sets.road.path.project(drive[:, 0], drive[:, 1], FIRST_M + ARC_M * np.arange(len(drive), dtype=np.float64))
    rising = np.maximum.accumulate(s)
    crossed = sets.frame.s[sets.frame.s <= rising[-1]]
    return np.column_stack([np.interp(crossed, rising, value) for value in (e, drive[:, 2], drive[:, 3])])


def fitting(sets: Sets, at: FloatArray) -> int:
    """Return at how many stations, from the first on, all bodies lie within the limits."""
    for i, (e, heading, gamma) in enumerate(at):
        x = sets.frame.x[i] - e * np.sin(sets.frame.heading[i])
        y = sets.frame.y[i] + e * np.cos(sets.frame.heading[i])
        if not _within(sets, sets.vehicle.lead, x, y, heading, sets.frame.s[i]):
            return i
        if len(sets.vehicle.units) > 1:
            lead, trailer = sets.vehicle.units
            x, y = x - lead.hitch_offset * np.cos(heading), y - lead.hitch_offset * np.sin(heading)
            x, y = x - trailer.wheelbase * np.cos(heading - gamma), y - trailer.wheelbase * np.sin(heading - gamma)
            if not _within(sets, trailer, x, y, heading - gamma, sets.frame.s[i] - trailer.wheelbase):
                return i
    return len(at)


def _within(sets: Sets, unit: Unit, x: float, y: float, heading: float, s: float) -> bool:
    ahead = np.linspace(-unit.rear_overhang, unit.front, int((unit.front + unit.rear_overhang) / OUTLINE_M))[:, None]
    left = np.array([-0.5, 0.5]) * unit.width
    xs, ys = x + ahead * np.cos(heading) - left * np.sin(heading), y + ahead * np.sin(heading) + left * np.cos(heading)
    _, offset = sets.road.path.project(xs, ys, s + ahead + 0.0 * left)
    return bool(np.max(np.abs(offset)) <= sets.half_width)


def held(sets: Sets, i: int, e: float, heading: float) -> bool:
    """Tell whether the set at a station holds an offset and a heading."""
    if not sets.keep.size:
        turned = heading - sets.frame.heading[i]
        return bool(
            sets.reached.low[i] - OFFSET_M <= e <= sets.reached.high[i] + OFFSET_M
            and sets.reached.right[i] - HEADING <= turned <= sets.reached.left[i] + HEADING
        )
    cells = {int((heading + by - sets.grid.first) / sets.grid.size) for by in (-HEADING, HEADING)}
    return any(
        sets.kept[i, j, p, 0] - OFFSET_M <= e <= sets.kept[i, j, p, 1] + OFFSET_M for j in cells for p in range(int(sets.keep[i, j]))
    )


@given(st.sampled_from([2.6, 3.2, 4.5]), st.floats(0.0, 1.0), st.floats(0.0, 1.0), steerings)
@pytest.mark.slow
def test_a_bus_that_fits_is_within_every_set_however_it_steers(
    half_width: float, cell: float, share: float, steering: list[Steering]
) -> None:
    sets = sets_of(half_width)
    filled = np.flatnonzero(sets.keep[0])
    j = int(filled[int(cell * (len(filled) - 1))])
    turned = sets.grid.first + (j + 0.5) * sets.grid.size - float(sets.frame.heading[0])
    low, high = sets.kept[0, j, 0]
    at = crossings(sets, driven(sets, float(low + share * (high - low)), turned, 0.0, steering))
    for i in range(fitting(sets, at)):
        assert held(sets, i, at[i, 0], at[i, 1]), f"at s = {sets.frame.s[i]:.1f} m: e {at[i, 0]:.4f}, heading {at[i, 1]:.5f}"


def test_a_bus_that_follows_the_road_fits_all_the_way_and_a_pose_askew_is_not_held() -> None:
    sets = sets_of(3.2)
    at = crossings(sets, driven(sets, 0.0, 0.0, 0.0, []))
    assert fitting(sets, at) == len(at) == sets.frame.s.size
    middle = sets.frame.s.size // 2
    assert held(sets, middle, at[middle, 0], at[middle, 1])
    assert not held(sets, middle, at[middle, 0], at[middle, 1] + 0.4)  # 0.4 rad: the front swings 3 m out
    assert not held(sets, middle, at[middle, 0] + 2.0, at[middle, 1])


@pytest.mark.slow
@given(st.sampled_from([3.2, 4.0]), st.floats(-0.5, 0.5), st.floats(-0.2, 0.2), st.floats(-0.3, 0.3), steerings)
def test_a_tractor_with_a_trailer_that_fits_is_within_every_set_however_it_steers(
    half_width: float, e: float, turned: float, gamma: float, steering: list[Steering]
) -> None:
    sets = sets_of_pair(half_width)
    at = crossings(sets, driven(sets, e, turned, gamma, steering))
    for i in range(fitting(sets, at)):
        assert held(sets, i, at[i, 0], at[i, 1]), f"at s = {sets.frame.s[i]:.1f} m: e {at[i, 0]:.4f}, heading {at[i, 1]:.5f}"
