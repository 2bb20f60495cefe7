"""The active set and the interior point of the core against the same on dense matrices."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdvplan.arrays import FloatArray
from hdvplan.qp.program import StageQp, StageSolution
from hdvplan.solvers.riccati import InteriorWorkspace, RiccatiWorkspace
from tests.core.chains import few
from tests.core.programs import copied, dense, random_program, shape
from tests.core.twins import solver as twin

tight = st.sampled_from([0.1, 0.5, 1.0])  # nearly all programs have active, violated and inactive rows, and active bounds


def flat(point: StageSolution) -> FloatArray:
    """Return x, u and sigma in the order of ``dense``."""
    return np.concatenate([point.x.ravel(), point.u.ravel(), point.sigma.ravel()])


def multipliers(qp: StageQp, point: StageSolution) -> FloatArray:
    """Return the multipliers of all inequalities in the order of ``dense``."""
    both = np.concatenate([point.x_bounds.ravel(), point.u_bounds.ravel()])
    of_sigma = (qp.linear + qp.quadratic * point.sigma - point.rows).ravel()
    return np.concatenate([point.rows.ravel(), of_sigma, np.maximum(both, 0.0), np.maximum(-both, 0.0)])


@given(seed=st.integers(0, 10**6), tightness=tight)
@few
def test_the_interior_point_ends_where_dense_iterations_end(seed: int, tightness: float) -> None:
    qp = random_program(shape(), seed, tightness=tightness)
    found = InteriorWorkspace(qp.shape).solve(qp, None).point
    v, z = twin.interior(dense(qp))
    np.testing.assert_allclose(flat(found), v, rtol=0.0, atol=1e-4)  # products of 1e-8 leave their root where a row hardly binds
    np.testing.assert_allclose(multipliers(qp, found), z, rtol=0.0, atol=1e-3)  # times curvatures of up to 10


@given(seed=st.integers(0, 10**6), tightness=tight)
@few
def test_a_settled_active_set_solves_its_equalities_and_keeps_all_other_inequalities(seed: int, tightness: float) -> None:
    qp, program = random_program(shape(), seed, tightness=tightness), dense(random_program(shape(), seed, tightness=tightness))
    workspace = RiccatiWorkspace(qp.shape)
    cold = copied(workspace.solve(qp, None).point)
    result = workspace.solve(qp, cold)
    found = multipliers(qp, result.point)
    v, z = twin.at_active_set(program, found > 1e-6)
    np.testing.assert_allclose(flat(result.point), v, rtol=0.0, atol=1e-6)  # inequalities are kept to 1e-7
    np.testing.assert_allclose(found, z, rtol=0.0, atol=1e-4)  # and balanced to 1e-6 of the largest multiplier
    assert np.all(program.G @ v <= program.h + 1e-6)
    assert np.all(z >= -1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_a_guess_that_is_right_settles_in_fewer_factorisations_than_the_interior_point_takes(seed: int) -> None:
    qp = random_program(shape(), seed, tightness=0.1)
    workspace = RiccatiWorkspace(qp.shape)
    first = workspace.solve(qp, None)
    assert workspace.solve(qp, copied(first.point)).iterations < first.iterations // 2
