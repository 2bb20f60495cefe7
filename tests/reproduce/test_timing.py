"""[GEO] table I: planning times on real roads."""

import numpy as np
import pytest

from hdvplan.case import Case
from hdvplan.reproduce.study import Study
from hdvplan.reproduce.timing import limited, timed_steps, timing
from hdvplan.road.load import load_road
from hdvplan.vehicle.load import load_vehicle
from tests.reproduce.conftest import by_name, silent


@pytest.fixture(scope="module")
def short() -> Study:
    return timing(silent, ("goteborg_lindholmsallen_uturn",))


def test_every_planning_step_but_the_first_is_timed() -> None:
    bus = load_vehicle("bus")
    road = limited(load_road("goteborg_lindholmsallen_uturn"), bus)
    steps = timed_steps(Case(road, bus))
    assert len(steps) == int(np.ceil(road.path.length / 5.0)) - 1
    assert steps["s"].iloc[0] == 5.0
    assert (steps["time_ms"] > 0.0).all()
    assert (steps["qps"] == 1).all()


@pytest.mark.slow
def test_a_table_has_every_vehicle_scheme_and_solver_beside_the_published_number(short: Study) -> None:
    rows = by_name(short)
    for vehicle in ("bus", "tractor-trailer"):
        for scheme in ("SQP", "RTI"):
            for solver in ("osqp", "riccati"):
                mean, most = (rows[f"{vehicle}, {scheme}, {solver}: {word}"] for word in ("mean", "max"))
                assert 0.0 < mean.ours <= most.ours
                assert mean.published is not None
    assert by_name(short)["bus, riccati: SQP / RTI, max"].published is not None
    assert sum(row.status != "" for row in short.rows) == 8  # as many as are published, by the solver that they were measured with
