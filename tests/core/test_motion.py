"""The motion between programs and its merit, against plain NumPy that says the same."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdvplan.arrays import FloatArray
from hdvplan.planning.stations import STATION
from hdvplan.planning.terms.term import Motion
from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.vehicle.kinematics import place_many
from hdvplan.vehicle.load import load_vehicle
from tests.core.chains import few
from tests.core.scenes import defect_price, guess, l1_weights, record_of, take_step

STAGES = 12
ACTIVE = load_vehicle("semitrailer-active")  # e_y, e_psi, one articulation angle, one wheel angle
SHAPE = StageShape(STAGES, 6, 3, 2, (4, 3))  # one state and input more, of a term
draws = st.integers(0, 10**6)


def moving(random: np.random.Generator) -> Motion:
    motion = Motion.empty(ACTIVE, STAGES)
    motion.z[:], motion.stages["kappa"] = random.uniform(-0.3, 0.3, motion.z.shape), random.uniform(-0.1, 0.1, STAGES + 1)
    return motion


def filled(random: np.random.Generator) -> StageSolution:
    solution = StageSolution.empty(SHAPE)
    for numbers in solution.numbers:
        numbers[:] = random.uniform(-1.0, 1.0, numbers.shape)
    return solution


def steered(wanted: FloatArray, begin: int, known: int, before: float, changes: FloatArray, most: float) -> FloatArray:
    """Return values that are wanted from number ``begin`` on, as far as can be steered: each may differ so much from the one before.

    Those before number ``known`` stay where they lie no further beyond than a solver leaves a bound.
    """
    values = wanted.copy()
    for i in range(begin, len(values)):
        held = values[i - 1] if i > 0 else before
        within = np.clip(np.clip(wanted[i], held - changes[i], held + changes[i]), -most, most)
        values[i] = wanted[i] if i < known and abs(within - wanted[i]) <= 1e-6 else within
    return values


@given(seed=draws, kept=st.integers(0, STAGES + 1), joins=st.booleans())
@few
def test_a_motion_is_extended_by_what_is_wanted_and_all_of_it_can_be_steered(seed: int, kept: int, joins: bool) -> None:
    random = np.random.default_rng(seed)
    motion, before = moving(random), float(random.uniform(-0.1, 0.1))
    most, change = random.uniform([0.1, 0.3], [0.2, 0.4]), random.uniform(0.01, 0.1, 2)
    start = random.uniform(-0.3, 0.3, 4)
    states, curvatures = random.uniform(-0.6, 0.6, motion.z.shape), random.uniform(-0.3, 0.3, STAGES + 1)
    road = np.zeros(STAGES + 1, STATION)
    road["step"] = random.choice([0.5, 0.25, 0.0, -0.25, -0.5], len(road))  # backwards, too; and the vehicle stands
    within = np.where(road["step"] == 0.0, 2.0 * most[:, None], change[:, None] * np.abs(road["step"]) / 0.5)
    turns = np.append(np.nan, within[1, :-1])
    motion.z[0] = start
    if joins:  # the last plan has led here, but for what a solver leaves of its bounds
        motion.z[:, 3] = steered(motion.z[:, 3], 1, 0, np.nan, turns, most[1])
        motion.stages["kappa"] = steered(motion.stages["kappa"], 0, 0, before, within[0], most[0])
        motion.stages["kappa"] += random.uniform(-4e-7, 4e-7, STAGES + 1)
    z, kappa, begin = motion.z.copy(), motion.stages["kappa"].copy(), (max(kept, 1), max(kept - 1, 0))
    known = z[: begin[0], 3].copy(), kappa[: begin[1]].copy()
    brought = guess(record_of(motion, SHAPE, road=road, step=0.5, before=before), start, states, curvatures, kept, most, change)
    z[begin[0] :], kappa[begin[1] :] = states[begin[0] :], curvatures[begin[1] :]
    z[:, 3] = steered(z[:, 3], 1, begin[0], np.nan, turns, most[1])
    kappa = steered(kappa, 0, begin[1], before, within[0], most[0])
    assert np.array_equal(motion.z, z)
    assert np.array_equal(motion.stages["kappa"], kappa)
    assert brought == (np.any(z[: begin[0], 3] != known[0]) or np.any(kappa[: begin[1]] != known[1]))
    assert not (joins and brought)


@given(seed=draws, size=st.sampled_from([0.1, 1.0, 10.0, 1e3, 1e6]), share=st.sampled_from([1.0, 0.5, 0.125]))
@few
def test_as_much_of_a_step_is_taken_as_stays_where_the_model_holds(seed: int, size: float, share: float) -> None:
    random = np.random.default_rng(seed)
    motion, solution, road = moving(random), filled(random), np.zeros(STAGES + 1, STATION)
    solution.x[:] *= size
    road["curvature"] = random.uniform(-0.2, 0.2, STAGES + 1)
    z, kappa, step = motion.z.copy(), motion.kappa.copy(), solution.x[1:]
    length, largest = share, np.inf
    while 2.0 * length > 1e-3:  # halved as long as more than a thousandth was tried
        e_y, e_psi = (z[1:] + length * step[:, :4]).T[:2]
        if np.all(np.abs(e_psi) < 1.3) and np.all(1.0 - e_y * road["curvature"][1:] > 0.05):
            largest = float(np.max(np.abs(length * step[:, :4])))
            z[1:] += length * step[:, :4]
            kappa += length * step[:, 4]
            break
        length *= 0.5
    assert take_step(record_of(motion, SHAPE, road=road), solution, share) == pytest.approx(largest, rel=1e-15)
    assert np.allclose(motion.z, z, rtol=1e-15, atol=1e-15)  # rounding: a product and a sum may be rounded once
    assert np.allclose(motion.kappa, kappa, rtol=1e-15, atol=1e-15)


@given(seed=draws)
@few
def test_weights_are_the_largest_multipliers_and_price_the_gaps(seed: int) -> None:
    random = np.random.default_rng(seed)
    qp, solution, weights = StageQp.empty(SHAPE), filled(random), np.full(3, np.nan)
    qp.stages["live"], qp.c[:] = random.choice([0.0, 1.0], STAGES + 1), random.normal(size=qp.c.shape)
    solution.rows[:] *= random.choice([0.0, 1e-7, 1.0], solution.rows.shape, p=[0.9, 0.05, 0.05])
    binds = bool(np.any(solution.rows[qp.stages["live"][1:] > 0.0] > 1e-6))
    assert l1_weights(qp, solution, weights) is binds
    assert np.array_equal(weights, np.max(np.abs(solution.dynamics[1:, :3]), axis=0))
    assert defect_price(qp, weights) == pytest.approx(np.sum(np.abs(qp.c[:, :3]) * weights), rel=1e-14)  # rounding of 36 products


@pytest.mark.parametrize(("entry", "function"), [("turned_cos", np.cos), ("turned_sin", np.sin)])
def test_angles_have_the_sines_and_cosines_of_a_library(entry: str, function: Callable[[FloatArray], FloatArray]) -> None:
    angles = np.concatenate([np.linspace(-3.2, 3.2, 4001), 0.25 * np.pi + np.linspace(-1e-6, 1e-6, 101), [0.0, 1e-300, 1e-9]])
    z, road = np.zeros((len(angles), 2)), np.zeros((5, len(angles)))
    z[:, 1] = angles
    found = place_many(load_vehicle("bus").table(), road, z)[entry][:, 0]
    assert np.allclose(found, function(angles), rtol=0.0, atol=2.0**-52)  # half a unit in the last place of one, each
