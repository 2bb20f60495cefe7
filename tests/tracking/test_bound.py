"""No error of the stated kind may lead a body beyond its bound, which is near to the worst one; and the same in plain Python."""

from __future__ import annotations

import numpy as np
import pytest

import hdvplan
from hdvplan import core
from hdvplan.api import drive_case
from hdvplan.arrays import FloatArray, Records
from hdvplan.driving.drive import simulate
from hdvplan.judging.result import Result
from hdvplan.judging.straying import BRUSH, FINER, SPACING_M, Chain, Posed, Tracked, chain_of
from hdvplan.judging.tracking import Search, pieces_around
from hdvplan.road.path import evaluate_many, from_curvature
from hdvplan.road.road import Road
from hdvplan.vehicle.kinematics import axles_behind, place_many
from tests.core.twins import tracking as twin
from tests.nightly import nightly
from tests.tracking.attacks import STEP_M, Driver, strayed
from tests.tracking.scenes import SCENES, case_of

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


@pytest.mark.parametrize("name", ["bus", *(nightly(name) for name in VEHICLES[1:])])
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


SAME = 1e-9  # [m], [rad]: rounding of bounds of up to some metres, over some hundred intervals
LITTLE_M = 1e-3  # [m]: nothing of second order counts
ERRORS = {"bus": 0.8, "rear-steered-bus": 0.2, "semitrailer-steered": 0.2, "a-double": 0.1}


@pytest.mark.slow
@pytest.mark.parametrize("followed", [False, True])
@pytest.mark.parametrize("name", [name if "semitrailer" in name else nightly(name) for name in ERRORS])
def test_units_stray_no_further_than_in_python(name: str, followed: bool) -> None:
    chain, error = bend(name), ERRORS[name]
    units, links = chain.vehicle.table(), np.ascontiguousarray(chain.links[100:340])  # a straight, and most of a U-turn
    made = Tracked(units, links, LENGTH_M)
    made.err(error)
    if followed:
        made.follow(np.array([45.0]))  # all from there to 60 m before it
    expected = twin.Strays(units, links, made.gains).of(error, error / LENGTH_M)
    assert np.ptp(expected["axle"][:, -1]) > (0.05 if followed else 0.1) * error  # the bend counts
    for field in made.strays.dtype.names or ():
        np.testing.assert_allclose(made.strays[field], expected[field], rtol=0.0, atol=SAME, err_msg=field)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["semitrailer-steered", "a-double"])
def test_gains_are_what_the_same_errors_do_at_a_place(name: str) -> None:
    made, at, number = tracked(bend(name), LITTLE_M), 45.0, int(45.0 / SPACING_M)
    made.follow(np.array([at]))
    for unit, gain in enumerate(made.gains[number]):
        here, before = (made.links[number - back, unit] for back in (0, 1))
        middle, parts = (number + 0.5) * SPACING_M, ((1.0, 0.0), (0.0, 1.0), (here["next_by_axle"], here["next_by_heading"]))
        for field, (by_axle, by_heading) in zip(("axle", "heading", "next"), parts, strict=True):
            if unit + 1 < made.links.shape[1] or field != "next":
                most, _ = worst(weights(made, brush(unit, middle, by_axle, by_heading)), made.levels)
                assert most <= gain[field] < 1.01 * most + 0.003 * abs(by_heading)  # what errors gain that turn between nodes
        if unit + 1 < made.links.shape[1]:
            of = weights(made, brush(unit, middle, *parts[2]))
            less = weights(made, brush(unit, middle - SPACING_M, before["next_by_axle"], before["next_by_heading"]))
            length = max(len(of), len(less) + 1)
            change = np.pad(of, (0, length - len(of))) - np.pad(less, (1, length - len(less) - 1))
            most = worst(change, made.levels)[0] / (SPACING_M * made.links[number, unit + 1]["coupling_speed"])
            assert most <= gain["next_slope"] < 1.1 * most
    assert np.all(np.isinf(made.gains["axle"][number + 100 :]))  # nobody has asked


def brush(unit: int, at: float, by_axle: float, by_heading: float) -> Records:
    found = np.zeros(1, BRUSH)
    found["at"], found["unit"], found["by_axle"], found["by_heading"], found["gap"] = at, unit, by_axle, by_heading, -1.0
    return found


def test_what_is_followed_is_only_ever_nearer() -> None:
    made = tracked(bend("a-double"), 0.1)
    before = made.strays.copy()
    assert made.follow(np.array([50.0]))
    assert not made.follow(np.array([50.0]))
    near = made.strays["heading"] <= before["heading"]
    assert np.all(near)
    assert np.min(made.strays["heading"] / before["heading"]) < 0.6
    again = Tracked(made.units, made.links, LENGTH_M, made.gains)
    again.err(0.1)
    np.testing.assert_allclose(made.strays["axle"], again.strays["axle"], rtol=0.0, atol=1e-6)  # ended where nothing changed any more


@pytest.mark.slow
@pytest.mark.parametrize("name", [name if "obstacles" in name or "nose" in name else nightly(name) for name in SCENES])
def test_the_pairs_that_errors_may_close_are_those_of_numpy(name: str) -> None:
    result = hdvplan.plan(case_of(SCENES[name]))
    chain = chain_of(result.drive)
    error = 0.2 if len(chain.vehicle.units) > 1 else 0.4  # the bound is finite
    made, behind = tracked(chain, error), axles_behind(chain.vehicle)
    assert result.tracking is not None
    own, units, kept = np.arange(len(chain.posed.s)), chain.vehicle.table(), 0
    near = int(np.searchsorted(chain.posed.s, result.tracking.s))
    for pieces in pieces_around(result.drive, result.balance):
        search, end = Search(chain, made, [pieces]), float(pieces.record["end"][0])
        for posed in (Posed(*(column[own % 4 == 0] for column in chain.posed)), chain.closely(near - 30, near + 30)):
            found = search._brushes(posed)
            expected = twin.brushes(units, made.links, made.strays, pieces.pieces, end, posed, behind)
            assert found is not None
            assert len(found) == len(expected)
            kept += len(found)
            order = [np.lexsort([one[field] for field in ("by_heading", "piece", "unit", "at")]) for one in (found, expected)]
            for field in found.dtype.names or ():
                np.testing.assert_allclose(found[field][order[0]], expected[field][order[1]], rtol=0.0, atol=SAME, err_msg=field)
    assert kept > 10


@pytest.mark.parametrize("name", ["bus", "semitrailer-active"])
def test_between_simulated_poses_bodies_are_where_smaller_steps_lead_them(name: str) -> None:
    chain = bend(name)
    drive, units = chain.drive, chain.vehicle.table()
    spacing, wheels = float(drive.poses_s[1] - drive.poses_s[0]), drive.poses_z[:, chain.vehicle.rigid_states :]
    z = simulate(units, drive.stations.path, float(drive.poses_s[0]), spacing, drive.poses_z[0], drive.poses_kappa, FINER, wheels)
    s = drive.poses_s[0] + spacing / FINER * np.arange(len(z))
    expected, found = place_many(units, evaluate_many(drive.stations.path, s), z), chain.closely()
    np.testing.assert_allclose(found.s, s, rtol=0.0, atol=SAME)
    for field in ("x", "y", "cos", "sin"):  # in one Runge-Kutta step of up to 0.25 m, over kinks of the curvature: it leaves 0.02 mm
        np.testing.assert_allclose(found.poses[field], expected[field], rtol=0.0, atol=5e-5)
