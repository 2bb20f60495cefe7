"""No error of the stated kind may lead a body beyond its bound; where the worst error is known, the bound is near to it."""

from __future__ import annotations

import numpy as np
import pytest

import hdvplan
from hdvplan import core
from hdvplan.api import drive_case
from hdvplan.arrays import FloatArray, Records
from hdvplan.judging.result import Result
from hdvplan.judging.straying import BRUSH, SPACING_M, Chain, Tracked, chain_of
from hdvplan.road.path import from_curvature
from hdvplan.road.road import Road
from tests.tracking.attacks import STEP_M, Driver, strayed

LENGTH_M = 6.0
VEHICLES = ("bus", "articulated-bus", "tractor-trailer", "semitrailer-steered", "a-double")
ERROR_M = 0.3
WEIGHTS = core.function("hdv_weights", core.POINTER, core.POINTER, core.POINTER, core.INT, returns=core.INT)


def bend(name: str) -> Chain:
    return chain_of(drive_case(hdvplan.Case(hdvplan.load_road("uturn"), hdvplan.load_vehicle(name))))


def tracked(chain: Chain, error: float, length: float = LENGTH_M) -> Tracked:
    made = Tracked(chain.vehicle.table(), chain.links, length)
    made.bounded(error)
    return made


def brushes(chain: Chain, at: float) -> Records:
    """Corners, and the sides at the axles, towards both sides of every body."""
    found = [
        (0.0, at, sign * np.cos(off), sign * ahead, 0.5 * unit.width, 0.0, 0.0, 0.0, ahead, number, 0)
        for number, unit in enumerate(chain.vehicle.units)
        for off in [chain.links[int(at / SPACING_M), number]["axle_off"]]
        for ahead in (unit.front, 0.0, -unit.rear_overhang)
        for sign in (1.0, -1.0)
    ]
    return np.array(found, BRUSH)


def weights(made: Tracked, brush: Records) -> FloatArray:
    found = np.zeros(20_000)
    return found[: WEIGHTS(core.address(made.record), core.address(brush), core.address(found), len(found))]


def worst(of: FloatArray, levels: int) -> tuple[float, FloatArray]:
    """Return the most that errors between -1 and 1 reach with these weights of nodes, and the errors: a dynamic programme."""
    level, last = np.linspace(-1.0, 1.0, levels + 1), np.arange(levels + 1)
    reached, choices = of[-1] * level, []
    for weight in of[-2::-1]:
        around = np.stack([np.append(-np.inf, reached[:-1]), reached, np.append(reached[1:], -np.inf)])
        choices.append(np.argmax(around, axis=0))
        reached = around[choices[-1], last] + weight * level
    at = int(np.argmax(reached))
    errors = [level[at]]
    for choice in choices[::-1]:
        at += int(choice[at]) - 1
        errors.append(level[at])
    return float(np.max(reached)), np.array(errors)


def attacks(made: Tracked, of: Records, half_steps: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return errors (attacks, n) between -1 and 1: the worst of every brush, waves as long as every trailer answers to, and noise."""
    found = []
    for number in range(len(of)):
        errors = worst(weights(made, of[number : number + 1]), made.levels)[1]
        nodes = of["at"][number] - SPACING_M * np.arange(len(errors))
        found.append(np.interp(half_steps, nodes[::-1], errors[::-1]))
    steepest = 1.0 / made.length
    for wave in (12.0, 20.0, 30.0, 50.0, 80.0):
        phase = rng.uniform(0.0, 2.0 * np.pi)
        slope = 2.0 * np.pi / wave
        found.append(min(1.0, steepest / slope) * np.sin(slope * half_steps + phase))
    for kind in range(15):
        steps = rng.choice([-1.0, 1.0], len(half_steps)) if kind % 3 else rng.uniform(-1.0, 1.0, len(half_steps))
        held = int(rng.integers(1, 120))
        steps = np.repeat(steps, held)[: len(half_steps)]
        errors, now = np.empty(len(half_steps)), 0.0
        for i, step in enumerate(steps):  # bang-bang within the class
            now = float(np.clip(now + step * steepest * 0.5 * STEP_M, -1.0, 1.0))
            errors[i] = now
        found.append(errors)
    return np.stack([*found, np.ones(len(half_steps)), -np.ones(len(half_steps))])


@pytest.mark.parametrize("name", [name if name == "bus" else pytest.param(name, marks=pytest.mark.slow) for name in VEHICLES])
def test_no_driver_leads_a_body_beyond_its_bound(name: str) -> None:
    chain, error = bend(name), ERROR_M
    posed = chain.closely()
    lead = posed.poses[:, 0]
    points = np.stack([lead[axis] + chain.vehicle.lead.wheelbase * lead[part] for axis, part in (("x", "cos"), ("y", "sin"))], axis=1)
    headings = np.unwrap(np.arctan2(posed.poses["sin"], posed.poses["cos"]), axis=0)
    driver = Driver(chain.vehicle, points, headings[0])
    planned = driver.driven(np.zeros((1, 2 * len(driver.front))))
    made, at = tracked(chain, error), float(posed.front[int(np.argmax(np.abs(np.diff(headings[:, -1]))))])
    of = np.concatenate([brushes(chain, at), brushes(chain, at - 8.0)])
    half_steps = 0.5 * STEP_M * np.arange(2 * len(driver.front), dtype=np.float64)
    driven = driver.driven(error * attacks(made, of, half_steps, np.random.default_rng(7)))
    made.follow(of["at"])
    gain, remainder = made.approaches(of)
    beyond = 0.55 if name == "a-double" else 0.3  # of the first order, which is within 3 % of the worst
    assert np.all(remainder < beyond * error * gain)
    for number, brush in enumerate(of):
        unit, normal_heading = int(brush["unit"]), float(np.interp(brush["at"], posed.front, headings[:, brush["unit"]]))
        moved, turned = strayed(planned, driven, unit, float(brush["at"]))
        normal = np.sign(brush["by_axle"]) * np.array([-np.sin(normal_heading), np.cos(normal_heading)])
        came = moved @ normal + brush["by_heading"] * np.sin(turned) - brush["second"] * (1.0 - np.cos(turned))
        bound = error * gain[number] + remainder[number]
        assert np.isfinite(bound)
        assert np.max(came) <= bound + 1e-4  # 0.1 mm: two integrations of one plan
        assert np.max(came) > 0.9 * error  # the attacks are attacks


def test_on_a_straight_a_front_corner_gains_what_axle_and_heading_allow_apart(straight: Result) -> None:
    chain = chain_of(straight.drive)
    unit, error = chain.vehicle.lead, 1e-6  # so small that no second order counts
    at = float(chain.posed.front[-1]) - 10.0
    gain, _ = tracked(chain, error, 0.5 * SPACING_M).approaches(brushes(chain, at)[:1])[:, 0]
    apart = unit.front / unit.wheelbase + abs(1.0 - unit.front / unit.wheelbase)
    assert gain == pytest.approx(apart, rel=0.01)  # within the 0.25 m that the change takes the axle moves by 0.5 % of that


def test_on_a_straight_a_constant_error_moves_every_body_by_as_much(straight: Result) -> None:
    chain, length = chain_of(straight.drive), 60.0  # so long that hardly anything but constant errors is left
    gain, remainder = tracked(chain, 0.2, length).approaches(brushes(chain, float(chain.posed.front[-1]) - 10.0))
    unit = chain.vehicle.lead
    askew = max(unit.front - unit.wheelbase, unit.rear_overhang) / length
    assert np.all(0.2 * gain + remainder >= 0.2)
    assert np.all(gain <= 1.0 + askew + 0.01)  # what errors gain that turn between nodes


def test_on_a_circle_an_axle_comes_as_far_as_a_wider_circle_leads_it() -> None:
    road = Road("circle", from_curvature(np.array([0.0, 150.0]), np.full(2, 0.05)))
    chain = chain_of(drive_case(hdvplan.Case(road, hdvplan.load_vehicle("bus"))))
    error, length = 0.2, chain.vehicle.lead.wheelbase
    at = float(chain.posed.front[-1]) - 30.0
    radius = 1.0 / abs(float(np.gradient(chain.links["course"][:, 0], SPACING_M)[int(at / SPACING_M)]))
    wider = np.sqrt((radius + error) ** 2 - length**2) - np.sqrt(radius**2 - length**2)
    gain, remainder = tracked(chain, error, 50.0).approaches(brushes(chain, at)[3:4])[:, 0]  # the axle, to the outside
    assert wider <= error * gain + remainder <= 1.05 * wider  # a length of 50 m allows little else than constant errors


def test_the_dynamic_programme_is_that_of_numpy() -> None:
    chain = bend("tractor-trailer")
    made = tracked(chain, 0.1)
    of = brushes(chain, 120.0)
    for number in range(len(of)):
        brush = of[number : number + 1]
        gain = float(made.approaches(brush)[0, 0])
        assert 0.0 <= gain - worst(weights(made, brush), made.levels)[0] < 5e-3  # what errors gain that turn between nodes
