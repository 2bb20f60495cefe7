"""Planning step by step: the same plans as in one piece, and from wherever the caller says that the vehicle is."""

from __future__ import annotations

import numpy as np
import pytest

import hdvplan


def case_of(vehicle: str, half_width: float) -> hdvplan.Case:
    road = hdvplan.load_road("uturn").with_limits(half_width, half_width)
    return hdvplan.Case(road, hdvplan.load_vehicle(vehicle), settings=hdvplan.PlannerSettings(horizon=30.0))


@pytest.mark.parametrize(("vehicle", "half_width"), [("bus", 2.6), ("semitrailer-active", 3.2)])
def test_an_undisturbed_loop_drives_what_plan_drives(vehicle: str, half_width: float) -> None:
    case = case_of(vehicle, half_width)
    stepper = hdvplan.Stepper(case)
    states, kappas, plans = [stepper.z], [], 0
    while not stepper.done:
        count, plan = stepper.count, stepper.plan()
        part = stepper.simulate(plan)
        states += list(part[1:])
        kappas += list(plan.kappa[:count])
        stepper.arrive(part[-1], plan.kappa[count - 1])
        plans += 1
    drive = hdvplan.plan(case).drive
    assert plans == len(drive.plans)
    assert np.array_equal(kappas, drive.kappa)
    assert np.abs(np.array(states) - drive.z).max() < 1e-9  # plan keeps poses between stations, which only divides the steps


def test_a_plan_begins_where_the_vehicle_is_put() -> None:
    stepper = hdvplan.Stepper(case_of("bus", 3.5))
    first = stepper.plan()
    stepper.arrive(stepper.simulate(first)[-1] + [0.2, 0.01], first.kappa[stepper.count - 1])
    assert (stepper.at, stepper.s) == (10, 5.0)
    second = stepper.plan()
    assert np.allclose(second.z[0], stepper.z, atol=1e-12)
    assert abs(second.z[-1, 0] - first.z[-1, 0]) < 0.05  # and it comes back


@pytest.mark.parametrize("wrong", [[0.0], [0.0, np.nan]])
def test_a_wrong_state_is_refused(wrong: list[float]) -> None:
    stepper = hdvplan.Stepper(case_of("bus", 3.5))
    with pytest.raises(hdvplan.HdvplanError, match="is 2 finite numbers"):
        stepper.arrive(np.array(wrong), 0.0)
    assert stepper.at == 0
