"""Drives of the papers' scenarios: RTI beside SQP, and what a drive holds. tests/reproduce has the published numbers."""

import numpy as np
import pytest

from hdvplan.driving.drive import Drive, drive
from hdvplan.judging.balance import Balance, balance_of
from hdvplan.planning.objectives import geometric, lead_axle
from hdvplan.planning.settings import PlannerSettings, Scheme
from hdvplan.road.path import from_curvature
from hdvplan.road.road import Road
from hdvplan.solvers.riccati import RiccatiWorkspace
from hdvplan.vehicle.load import load_vehicle
from tests.core.conftest import Driven

KEPT = 1e-7  # what an active bound is kept to: active_set.c


def balance(driven: Drive) -> Balance:
    return balance_of(driven)


CASES = [
    ("uturn", "bus", geometric, 0.5),
    ("uturn", "bus", lead_axle, 0.5),  # with the limit binding
    ("roundabout", "tractor-trailer-paper", geometric, 0.25),
]


@pytest.mark.parametrize(("scenario", "vehicle", "objective", "step"), CASES)
def test_one_program_a_step_drives_as_well_as_many(driven: Driven, scenario: str, vehicle: str, objective: object, step: float) -> None:
    rti, sqp = (driven(scenario, vehicle, scheme, objective, step=step) for scheme in (Scheme.RTI, Scheme.SQP))
    assert np.max(np.abs(rti.z[:, 0] - sqp.z[:, 0])) < 0.01  # "vehicle performance almost identical"
    assert all(plan.qp_count == 1 for plan in rti.plans[1:])
    assert max(plan.qp_count for plan in sqp.plans) > 1


def test_the_geometric_weight_does_as_well_as_the_searched_one(driven: Driven) -> None:
    found = balance(driven("uturn_articulated", "tractor-trailer-24m", Scheme.SQP, geometric))
    assert abs(found.imbalance) < 0.05
    assert max(found.max_left, found.max_right) < 4.90


def test_a_drive_has_a_sample_at_every_station_and_poses_between() -> None:
    road = Road("bend", from_curvature(np.array([0.0, 20.0, 30.2]), np.array([0.0, 0.0, 0.03])))
    shares: list[float] = []
    settings = PlannerSettings(horizon=20.0, replan=4.0)
    done = drive(road, load_vehicle("bus"), geometric, RiccatiWorkspace, settings, on_progress=shares.append)
    assert len(done.z) == len(done.kappa) + 1 == 62  # 30.2 m in steps of 0.5 m
    assert done.poses_s[-1] == pytest.approx(33.5)  # when the rear end, 2.66 m behind the axle, has left the road
    assert np.max(np.diff(done.poses_s)) <= 0.25 + 1e-12
    assert np.array_equal(done.poses_z[::2][: len(done.z)], done.z)
    assert len(shares) == len(done.plans) == 8
    assert shares[-1] == 1.0
    assert np.all(np.diff(shares) > 0.0)
    for plan in done.plans:  # each starts from what was executed
        part = slice(plan.first, plan.first + settings.executed)
        assert np.array_equal(done.kappa[part], plan.kappa[: len(done.kappa[part])])
        assert np.max(np.abs(plan.z[0] - done.z[plan.first])) < 1e-12
        if plan.first > 0:
            assert plan.kappa_before == done.kappa[plan.first - 1]


def test_a_drive_begins_with_no_more_curvature_than_the_vehicle_has() -> None:
    road = Road("tight", from_curvature(np.array([0.0, 5.0, 10.0, 60.0]), np.array([0.14, 0.14, 0.0, 0.0])))
    done = drive(road, load_vehicle("bus"), geometric, RiccatiWorkspace, PlannerSettings(horizon=30.0))
    assert done.stations.centring.kappa[0] > 0.1
    assert done.plans[0].kappa_before == 0.1
    assert np.max(np.abs(done.kappa)) <= 0.1 + KEPT
