"""No driver who errs as much as the answer allows leads a body into what bounds its street."""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
import pytest
import shapely

import hdvplan
from hdvplan.arrays import FloatArray, Records
from hdvplan.judging.clearance import Shapes
from hdvplan.judging.result import Result
from hdvplan.judging.straying import Chain, chain_of
from hdvplan.judging.tracking import Search, pieces_around, tracking_of
from hdvplan.vehicle.model import Unit
from tests.nightly import nightly
from tests.tracking import attacks
from tests.tracking.attacks import Driver, Motion
from tests.tracking.scenes import SCENES, Scene, case_of
from tests.tracking.test_bound import attacks as errors_of
from tests.tracking.test_bound import tracked

NEAR_M = 15.0  # before and beyond the places that errors aim at, in which bodies are looked at, every 0.1 m
AIMED = 12  # places that errors aim at: those that the smallest error reaches, and others that larger ones reach
RUN = {"sharp corners", "obstacles in a bend"}  # with every change
NAMES = [name if name in RUN else nightly(name) for name in SCENES]
TOUCH_M = 1e-4  # bodies are smaller by so much: two integrations of one plan


@functools.cache
def driven(name: str) -> tuple[Scene, Result, Chain, float]:
    scene = SCENES[name]
    result = hdvplan.plan(case_of(scene))
    tracking = tracking_of(result.drive, result.balance, 6.0)
    assert tracking is not None
    return scene, result, chain_of(result.drive), tracking.error


def aims(result: Result, chain: Chain, error: float) -> Records:
    """Return pairs of a body and a kerb that errors close, those of the least error first, and some of every other."""
    search = Search(chain, tracked(chain, error), pieces_around(result.drive, result.balance))
    near = search.near(error)
    found = None if near is None else search.closed(near)
    assert found is not None
    aimed: Records = found[np.unique(np.concatenate([np.arange(AIMED // 2), np.linspace(0, len(found) - 1, AIMED // 2).astype(np.int64)]))]
    return aimed


def motions(chain: Chain, aimed: Records, error: float) -> Motion:
    """Return how the vehicle moves with errors at each of the aims, to either side, and others; as the plan itself with none."""

    def errors(half_steps: FloatArray) -> FloatArray:
        found = errors_of(tracked(chain, error), aimed, half_steps, np.random.default_rng(3))
        return error * np.concatenate([found, -found[: len(aimed)]])

    return led(chain, errors)


def led(chain: Chain, errors: Callable[[FloatArray], FloatArray]) -> Motion:
    """Return how the vehicle moves with errors (attacks, n) at half steps (n,) [m], those of none before them."""
    planned = chain.closely()
    lead = planned.poses[:, 0]
    front = [lead[axis] + chain.vehicle.lead.wheelbase * lead[part] for axis, part in (("x", "cos"), ("y", "sin"))]
    headings = np.unwrap(np.arctan2(planned.poses["sin"], planned.poses["cos"]), axis=0)
    driver = Driver(chain.vehicle, np.stack(front, axis=1), headings[0])
    half_steps = 0.5 * attacks.STEP_M * np.arange(2 * len(driver.front), dtype=np.float64)
    motion = driver.driven(np.concatenate([np.zeros((1, len(half_steps))), errors(half_steps)]))
    axles, turned = motion.axles, motion.headings
    for unit in range(len(chain.vehicle.units)):  # what the plan's own integration leaves is no error
        for number, axis in enumerate("xy"):
            own = np.interp(motion.front, planned.front, planned.poses[axis][:, unit]) - axles[:, 0, unit, number]
            axles[:, :, unit, number] += own[:, None]
        turned[:, :, unit] += (np.interp(motion.front, planned.front, headings[:, unit]) - turned[:, 0, unit])[:, None]
    return Motion(motion.front, axles, turned)


def outlines(unit: Unit, axles: FloatArray, headings: FloatArray, *, wheels: bool) -> Shapes:
    rear, front = (0.0, min(unit.wheelbase, unit.front)) if wheels else (-unit.rear_overhang, unit.front)
    half = 0.5 * unit.width - TOUCH_M
    along = np.array([rear + TOUCH_M, front - TOUCH_M, front - TOUCH_M, rear + TOUCH_M])
    across = np.array([-half, -half, half, half])
    cosine, sine = np.cos(headings)[..., None], np.sin(headings)[..., None]
    x = axles[..., 0, None] + along * cosine - across * sine
    y = axles[..., 1, None] + along * sine + across * cosine
    return np.asarray(shapely.polygons(np.stack([x, y], axis=-1).reshape(-1, 4, 2)))


def touching(scene: Scene, chain: Chain, motion: Motion, aimed: Records) -> int:
    """Return at how many poses bodies lie beyond what bounds them, in the plane."""
    near = np.flatnonzero((motion.front > np.min(aimed["at"]) - NEAR_M) & (motion.front < np.max(aimed["at"]) + NEAR_M))
    for area in (scene.bodies, scene.wheels, *scene.obstacles):
        shapely.prepare(area)
    count = 0
    for number, unit in enumerate(chain.vehicle.units):
        axles, headings = motion.axles[near][:, :, number], motion.headings[near][:, :, number]
        bodies = outlines(unit, axles, headings, wheels=False)
        count += int(np.count_nonzero(~shapely.covers(scene.bodies, bodies)))
        count += sum(int(np.count_nonzero(shapely.intersects(obstacle, bodies))) for obstacle in scene.obstacles)
        if scene.wheels is not scene.bodies:
            count += int(np.count_nonzero(~shapely.covers(scene.wheels, outlines(unit, axles, headings, wheels=True))))
    return count


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_no_driver_who_errs_as_much_as_is_allowed_touches_a_kerb(name: str) -> None:
    scene, result, chain, error = driven(name)
    assert 0.05 < error <= (result.balance.min_clearance or 0.0)
    aimed = aims(result, chain, 1.1 * error)
    assert touching(scene, chain, motions(chain, aimed, error), aimed) == 0


def test_a_kerb_that_turns_away_leaves_room_to_err_beyond_its_turn() -> None:
    road = hdvplan.load_road("monaco_fairmont_hairpin").with_limits(5.0, 5.0)
    result = hdvplan.plan(hdvplan.Case(road, hdvplan.load_vehicle("semitrailer-steered")))
    assert (result.balance.min_clearance or 0.0) > 2.0  # the lines on which pieces of the kerb lie cross that room
    tracking = tracking_of(result.drive, result.balance, 6.0)
    assert tracking is not None
    assert tracking.error > 0.1


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_drivers_who_err_by_more_do_touch(name: str) -> None:
    scene, result, chain, error = driven(name)
    aimed = aims(result, chain, 1.1 * error)
    assert touching(scene, chain, motions(chain, aimed, 1.5 * error), aimed) > 0  # a steered trailer's bound is that loose beside the nose
