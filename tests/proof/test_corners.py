"""Proofs against the least width of a right-angled corner, see ``tests.proof.corners``."""

from __future__ import annotations

import numpy as np
import pytest

from hdvplan.judging.balance import KEPT_M
from hdvplan.proof.answer import proof_of
from hdvplan.vehicle.load import load_vehicle
from tests.proof import corners
from tests.proof.corners import corner, narrowest, reaches, starts

BUS = load_vehicle("bus")
EXACT_M = 7.1186  # of the bus, what halving the arcs converges to: 7.1148, 7.1177, 7.1186 at 0.5, 0.25, 0.125 m

LACKS_M = 0.3  # points of a body's outline are 0.4 m apart: a sharp corner pokes between them


@pytest.fixture(scope="module")
def best() -> corners.Turn:
    """The narrowest of a few ways round the corner."""
    return min((narrowest(BUS.lead, BUS.max_curvature, start) for start in starts(BUS.max_curvature, 4)), key=lambda way: way.width)


@pytest.mark.slow
def test_every_start_leads_to_the_same_least_width(best: corners.Turn) -> None:
    other = narrowest(BUS.lead, BUS.max_curvature, starts(BUS.max_curvature, 10)[9])
    assert other.width == pytest.approx(best.width, abs=1e-5)  # a local optimum's last step
    assert best.width == pytest.approx(EXACT_M, abs=2e-3)  # its poses are 0.25 m apart


@pytest.mark.slow
def test_the_least_width_is_driven_from_corridor_to_corridor(best: corners.Turn) -> None:
    x, y, heading = corners.poses(best.given)
    outer, inner = reaches(BUS.lead, best.given)
    assert np.max(outer) <= best.width + 1e-6  # of the linear program
    assert np.min(inner) >= -1e-6
    assert np.max(np.abs(best.given[2:])) <= BUS.max_curvature + 1e-12
    assert x[0] + BUS.lead.front < -10.0  # well before the corner
    assert y[-1] - BUS.lead.rear_overhang > 10.0  # and after it
    assert heading[-1] == pytest.approx(0.5 * np.pi, abs=0.1)


@pytest.mark.slow
def test_corridors_as_wide_as_the_least_are_not_called_impossible() -> None:
    # What is given is kept to KEPT_M by both walls of a corridor.
    assert proof_of(corner(BUS, EXACT_M - 2.0 * KEPT_M + 2e-3)) is None


@pytest.mark.slow
def test_narrower_corridors_are_proved_impossible() -> None:
    found = proof_of(corner(BUS, EXACT_M - 2.0 * KEPT_M - LACKS_M))
    assert found is not None
    assert found.kind == "motion"
