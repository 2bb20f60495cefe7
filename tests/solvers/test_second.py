"""A drive goes on whatever its solver does: another one answers, and the drive says so."""

import signal
import sys
from dataclasses import replace
from time import perf_counter
from typing import get_args

import numpy as np
import pytest

from hdvplan.api import drive_case
from hdvplan.case import Case
from hdvplan.driving.drive import Drive, drive
from hdvplan.errors import SolverError
from hdvplan.judging.result import result_of
from hdvplan.judging.sentences import solver_texts
from hdvplan.judging.verdict import verdict_line, verdict_of
from hdvplan.planning import planner as planner_module
from hdvplan.planning.objectives import geometric
from hdvplan.planning.settings import PlannerSettings
from hdvplan.process import ended_by_signals
from hdvplan.qp.program import StageQp, StageSolution
from hdvplan.qp.workspace import QpResult, Status, WorkspaceMaker, backed
from hdvplan.report.summary import summary_of
from hdvplan.road.path import from_curvature
from hdvplan.road.road import Road
from hdvplan.solvers.registry import dependable, solver_named
from hdvplan.solvers.riccati import RiccatiWorkspace
from hdvplan.vehicle.load import load_vehicle
from tests.fakes import Fake, Fault

SETTINGS = PlannerSettings(horizon=40.0)
BEND = Road("bend", from_curvature(np.array([0.0, 20.0, 35.0, 50.0, 70.0]), np.array([0.0, 0.0, 0.05, 0.0, 0.0])))
FAULTS: tuple[Fault, ...] = tuple(fault for fault in get_args(Fault) if fault not in {"crashing", "slow"})  # the one ends the process
LIMIT_S = 0.3


def second(fake: Fake) -> WorkspaceMaker:
    return backed(fake, RiccatiWorkspace, limit_s=LIMIT_S)


def driven(make: WorkspaceMaker, settings: PlannerSettings = SETTINGS, road: Road = BEND, vehicle: str = "bus") -> Drive:
    return drive(road, load_vehicle(vehicle), geometric, make, settings)


@pytest.mark.parametrize("fault", FAULTS)
def test_what_a_solver_fails_at_another_one_solves(fault: Fault) -> None:
    road = BEND.with_limits(2.4, 2.4)  # binding: only then do multipliers matter
    found, wanted = driven(second(Fake(fault, honest=3)), road=road), driven(RiccatiWorkspace, road=road)
    rescued = [bool(plan.instead) for plan in found.plans]
    assert rescued[-1]
    assert all(plan.usable for plan in found.plans)
    # The same optimum from another start: interior points end within 1e-6 of it, and a drive of 70 m does not add to that.
    np.testing.assert_allclose(found.z, wanted.z, atol=1e-5)


def test_a_drive_says_which_steps_another_solver_planned_and_why() -> None:
    found = driven(second(Fake("raising", honest=4, often=3)))
    result = result_of(found, solver="mine", objective="geometric")
    summary = summary_of(result)
    assert summary["status"] == "some steps by another solver"
    told = summary["rescued_steps"]
    assert isinstance(told, list)
    assert 0 < len(told) < len(found.plans)
    assert verdict_line(result, verdict_of(result)).endswith(f"; mine failed in {len(told)} of {len(found.plans)} steps")
    assert told[0]["why"] == "RuntimeError: no licence; solved by riccati"
    (text,) = solver_texts(result)
    assert text == (
        f"mine failed in {len(told)} of {len(found.plans)} planning steps, first at s = {told[0]['s_m']:.1f} m: "
        "RuntimeError: no licence; solved by riccati"
    )


def test_a_solver_that_did_not_answer_is_not_asked_again() -> None:
    began = perf_counter()
    found = driven(backed(Fake("sleeping"), RiccatiWorkspace, limit_s=LIMIT_S))
    assert perf_counter() - began < 3600.0  # what it sleeps
    assert found.plans[0].times.total > LIMIT_S  # who asks for a plan has waited for both solvers
    assert {plan.instead for plan in found.plans} == {f"no answer within {LIMIT_S:g} s; solved by riccati"}


def test_without_any_answer_the_last_plan_is_driven_as_far_as_it_reaches() -> None:
    broken = backed(Fake("raising", honest=2), Fake("not a number", honest=0))
    with pytest.raises(
        SolverError, match=r"at s = \d+\.\d m no plan was solved since what the last one covered: .* no licence; "
    ) as raised:
        driven(broken, replace(SETTINGS, horizon=20.0))
    assert raised.value.s_m is not None
    assert 20.0 <= raised.value.s_m <= 30.0  # the second QP is the first plan's last, or the second plan's


def test_a_first_plan_without_any_answer_names_both_solvers() -> None:
    with pytest.raises(
        SolverError, match=r"at s = 0\.0 m the first plan could not be solved: raising says failed \(RuntimeError: no licence; "
    ) as raised:
        driven(backed(Fake("raising"), Fake("nothing")))
    assert raised.value.status == Status.FAILED


def test_honest_solvers_are_left_alone() -> None:
    road = BEND.with_limits(2.4, 2.4)
    for name in ("riccati", "piqp", "clarabel", "osqp"):
        found = drive_case(Case(road, load_vehicle("bus"), "geometric", name, SETTINGS))
        assert not any(plan.instead for plan in found.plans), name
        alone = driven(solver_named(name), road=road)
        np.testing.assert_array_equal(found.z, alone.z)


class Writing(RiccatiWorkspace):
    """A solver that drops all rows from the program that it is given, and solves the rest."""

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """See ``QpWorkspace``."""
        qp.h[:] = 100.0
        return super().solve(qp, guess)


def test_a_solver_that_writes_into_the_program_is_named_and_another_one_plans() -> None:
    road = BEND.with_limits(1.9, 1.9)
    wanted, found = (drive_case(Case(road, load_vehicle("bus"), "geometric", one, SETTINGS)) for one in ("riccati", Writing))
    assert any(plan.merit is not None for plan in wanted.plans)  # the rows that it drops would bind
    assert any("writes into the program that it is given; solved by riccati" in plan.instead for plan in found.plans)
    np.testing.assert_allclose(found.z, wanted.z, atol=1e-5)  # as above


def test_each_program_is_judged_once_and_that_counts_as_check(monkeypatch: pytest.MonkeyPatch) -> None:
    calls, usual = [], planner_module._judge
    monkeypatch.setattr(planner_module, "_judge", lambda *arguments: calls.append(usual(*arguments)))
    found = drive(BEND, load_vehicle("bus"), geometric, dependable(Fake("wrong", honest=1000)), SETTINGS)
    assert len(calls) == sum(plan.qp_count for plan in found.plans)
    assert all(0.0 < plan.times.check < plan.times.total for plan in found.plans)


def test_the_core_does_not_read_a_point_of_another_shape() -> None:
    said = [plan.instead for plan in driven(second(Fake("another shape", honest=3))).plans]
    assert any(said)
    assert all("a point of another shape" in one for one in said if one)


class Stopped(RiccatiWorkspace):
    """A solver during whose work somebody ends the command."""

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """See ``QpWorkspace``."""
        signal.raise_signal(signal.SIGTERM)
        return super().solve(qp, guess)


@pytest.mark.skipif(sys.platform == "win32", reason="needs signals")
def test_a_signal_that_comes_while_a_solver_works_is_no_failure_of_the_solver() -> None:
    with pytest.raises(SystemExit) as left, ended_by_signals():
        driven(backed(Stopped, RiccatiWorkspace))
    assert left.value.code == 143
